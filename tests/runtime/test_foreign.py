"""Motions of other figures in the verbs: brought onto the model's figure, and predictions back onto their own."""

import logging
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import run
from figures import walker
from test_mmm_figure import mmm
from test_retarget import SKELETONS, angles_between

import motet
from motet.errors import MotionError
from motet.formats.text import with_names
from motet.models.describe import DescribeModel
from motet.motion import MIXAMO, Joint, Motion, Skeleton, global_transforms, positions
from motet.motion.rotations import euler_to_rotmat, rotmats_to_euler
from motet.papers.tdbn_control import TdbnModel
from motet.predict.model import PredictModel

CLIPS = ("39_14", "09_07", "02_06")


@pytest.fixture(scope="module")
def describer() -> DescribeModel:
    return motet.load_as(DescribeModel, "describe")


@pytest.fixture(scope="module")
def predictor() -> PredictModel:
    return motet.load_as(PredictModel, "predict")


@pytest.mark.parametrize("bundle", ["describe", "predict", "tdbn"])
def test_files_of_the_models_own_joints_are_taken_as_they_are(bundle: str, tmp_path: Path, clips: Path) -> None:
    contract = motet.load(bundle).contract
    for name in CLIPS:
        amc = motet.read(clips / f"{name}.amc")
        own = amc if bundle == "tdbn" else motet.to_humanoid(amc).motion
        motet.write(tmp_path / "a.bvh", own)
        for motion in (own, motet.read(tmp_path / "a.bvh", unit="m"), contract.features(contract.frames(amc))):
            assert contract.on_figure(motion) is motion


def test_limbs_come_out_as_those_of_the_models_own_figure(walk: Motion, mixamo: Motion) -> None:
    contract = motet.load("language-to-motion").contract
    own, brought = contract.frames(walk), contract.frames(mixamo)
    limbs = [i for i, name in enumerate(contract.channels) if name.split(".")[0] in ("lfemur", "rtibia", "rhumerus")]
    np.testing.assert_allclose(brought[:, limbs], own[:, limbs], atol=0.01)
    speed = contract.channels.index("root.forward")
    np.testing.assert_allclose(brought[:, speed], own[:, speed], atol=0.15)
    thumb = contract.channels.index("lthumb.rx")
    np.testing.assert_allclose(brought[:, thumb], contract.mean[thumb], atol=1e-6)


def test_another_figure_of_the_humanoids_proportions_gives_a_models_frames(
    describer: DescribeModel, walk: Motion, mixamo: Motion
) -> None:
    one, other = (describer.contract.frames(motion) for motion in (walk, mixamo))
    np.testing.assert_allclose(one, other, atol=0.5)
    np.testing.assert_allclose(one.mean(axis=0), other.mean(axis=0), atol=0.1)


def test_a_motion_that_does_not_say_where_it_goes_is_refused(predictor: PredictModel, walk: Motion) -> None:
    with pytest.raises(MotionError, match=r"lacks the root's tx, ty and tz"):
        predictor.predict(walk.select(walk.channels[3:]))


@pytest.mark.parametrize("clip", CLIPS)
def test_a_motion_of_another_figure_is_described_as_on_its_own(
    describer: DescribeModel, clips: Path, clip: str, caplog: pytest.LogCaptureFixture
) -> None:
    motion = motet.read(clips / f"{clip}.amc")
    action = {"39_14": "walk", "09_07": "run|jog"}.get(clip, "")
    with caplog.at_level(logging.INFO, "motet"):
        found = describer.describe(motet.from_humanoid(motet.to_humanoid(motion).motion, MIXAMO))
    assert re.search(action, found[0].text)
    assert found[0].text == describer.describe(motion)[0].text
    (said,) = [record.getMessage() for record in caplog.records if "brought to" in record.getMessage()]
    assert said.startswith("brought to the humanoid: joints of Mixamo, confidence 1.00")


def test_a_long_motion_is_brought_as_a_whole(describer: DescribeModel, mixamo: Motion) -> None:
    long = replace(mixamo, values=np.concatenate([mixamo.values] * 12))
    windows = describer.windows(long)
    assert len(windows) == 2
    assert all(part.skeleton == describer.contract.skeleton for _, part in windows)


def test_a_prediction_goes_on_on_the_files_own_skeleton(predictor: PredictModel, walk: Motion, mixamo: Motion) -> None:
    found, expected = predictor.predict(mixamo, frames=20), predictor.predict(walk, frames=20)
    assert (found.skeleton, found.channels, found.units) == (mixamo.skeleton, mixamo.channels, mixamo.units)
    seed = mixamo.continuous().resample(30, to_end=True)
    steps = np.abs(np.diff(positions(seed)[-10:], axis=0)).max()
    assert np.abs(positions(found)[0] - positions(seed)[-1]).max() < 1.5 * steps
    turned, other = (global_transforms(motet.to_humanoid(motion).motion)[0] for motion in (found, expected))
    legs = [motet.motion.HUMANOID.index(f"{side}UpperLeg") for side in ("left", "right")]
    assert np.degrees(angles_between(turned[:, legs], other[:, legs])).mean() < 8
    whole = predictor.predict(mixamo, frames=20, append=True)
    np.testing.assert_array_equal(whole.values[-20:], found.values)
    np.testing.assert_array_equal(whole.values[:-20], seed.values)


@pytest.mark.parametrize("convention", ["mixamo", "bandai-namco", "lafan1"])
def test_a_stream_measures_a_figure_once_and_predicts_as_without_it(
    predictor: PredictModel, walk: Motion, convention: str, caplog: pytest.LogCaptureFixture
) -> None:
    like = motet.read(SKELETONS / f"{convention}.bvh")
    own = motet.from_humanoid(motet.to_humanoid(walk).motion, like)
    session = predictor.stream(own[:200])
    with caplog.at_level(logging.INFO, "motet"):
        # the figure and its ground are those of the start; of a few frames more they are nearly the same
        for end, apart in ((200, 1e-6), (201, 0.01), (202, 0.01), (240, 0.01)):
            session.push(own.values[{200: 200, 201: 200, 202: 201, 240: 202}[end] : end])
            expected = predictor.predict(own[:end], frames=10)
            streamed = positions(session.predict(10)) / own.skeleton.height
            np.testing.assert_allclose(streamed, positions(expected) / own.skeleton.height, atol=apart)
    said = [record for record in caplog.records if "brought to the humanoid" in record.getMessage()]
    assert len(said) == 1 + 4  # the session's, and those without one


def test_joints_that_no_model_knows_stay_as_they_are(predictor: PredictModel, mixamo: Motion) -> None:
    skeleton = mixamo.skeleton
    assert skeleton is not None
    finger = Joint("mixamorig:LeftHandIndex1", skeleton.index("mixamorig:LeftHand"), (8.0, 0.0, 0.0))
    fingered = Motion(
        np.column_stack([mixamo.values, np.full(len(mixamo), 33.0)]),
        (*mixamo.channels, f"{finger.name}.rz"),
        (*mixamo.units, "deg"),
        mixamo.fps,
        Skeleton((*skeleton.joints, finger), skeleton.metres_per_unit),
    )
    found = predictor.predict(fingered, frames=5)
    np.testing.assert_allclose(found.values[:, -1], 33.0)
    np.testing.assert_allclose(found.values[:, :-1], predictor.predict(mixamo, frames=5).values, atol=1e-6)


def test_a_figure_whose_z_is_up_goes_on_on_the_models_own(
    predictor: PredictModel, mixamo: Motion, caplog: pytest.LogCaptureFixture
) -> None:
    lying = turned(mixamo, euler_to_rotmat(np.array([np.pi / 2, 0.0, 0.0]), "xyz"))
    with caplog.at_level(logging.INFO, "motet"):
        found = predictor.predict(lying, frames=5)
    assert found.skeleton == predictor.contract.skeleton
    assert "the new frames use the model's figure" in caplog.text
    assert len(predictor.predict(lying, frames=5, append=True)) > 5


def test_a_motion_of_kit_goes_on_on_the_models_figure(predictor: PredictModel) -> None:
    two = mmm(LHx=20)
    motion = replace(two, values=np.repeat(two.values, 40, axis=0))
    assert predictor.predict(motion, frames=5).skeleton == predictor.contract.skeleton


def turned(motion: Motion, turn: np.ndarray) -> Motion:
    """The motion in another world: rest pose and frames turned."""
    skeleton = motion.skeleton
    assert skeleton is not None
    joints = [replace(joint, offset=tuple((turn @ joint.offset).tolist())) for joint in skeleton.joints]
    values = np.array(motion.values)
    for name, columns in motion.rotation_columns().items():
        order = skeleton.joints[skeleton.index(name)].order
        ordered = [columns["xyz".index(axis)] for axis in order]
        local = turn @ euler_to_rotmat(np.radians(values[:, ordered]), order) @ turn.T
        values[:, ordered] = np.degrees(rotmats_to_euler(local, order))
    path = [motion.channels.index(f"{skeleton.names[0]}.t{axis}") for axis in "xyz"]
    values[:, path] = values[:, path] @ turn.T
    return replace(motion, values=values, skeleton=replace(skeleton, joints=tuple(joints)))


def test_control_goes_on_from_another_figure(mixamo: Motion, walk: Motion) -> None:
    model = motet.load_as(TdbnModel, "tdbn")
    found, expected = (model.run("walk 1s", motion) for motion in (mixamo, walk))
    knee = found.channels.index("ltibia.rx")
    assert np.abs(found.values[:, knee] - expected.values[:, knee]).mean() < 5
    assert np.abs(found.values - model.run("walk 1s", "run").values).max() > 5


def test_a_figure_that_is_no_humans_is_refused_with_both_reasons(describer: DescribeModel) -> None:
    with pytest.raises(
        MotionError, match=r"no joint was found for .*; and it cannot be used as it is: this motion lacks"
    ):
        describer.describe(walker(80))


def test_a_figure_of_unknown_names_without_sides_is_warned_of(
    describer: DescribeModel, mixamo: Motion, caplog: pytest.LogCaptureFixture
) -> None:
    assert mixamo.skeleton is not None
    names = [f"bone{i}" + "_end" * n.endswith("_end") for i, n in enumerate(mixamo.skeleton.names)]
    with caplog.at_level(logging.WARNING, "motet"):
        assert "walk" in describer.describe(with_names(mixamo, names))[0].text
    assert "joints found by the tree, confidence 0.60" in caplog.text


@pytest.mark.parametrize("name", ["rokoko", "unreal", "xsens"])
def test_the_command_line_takes_any_figure(tmp_path: Path, name: str, mixamo: Motion) -> None:
    motet.write(tmp_path / "a.bvh", mixamo, like=SKELETONS / f"{name}.bvh")
    described = run("-v", "describe", tmp_path / "a.bvh")
    assert described.exit_code == 0
    assert "walk" in described.stdout.splitlines()[0]
    assert "brought to the humanoid: joints of " in described.stderr
    assert run("embed", tmp_path / "a.bvh", "-o", tmp_path / "a.npy").exit_code == 0
    assert run("predict", tmp_path / "a.bvh", "-o", tmp_path / "next.bvh", "--frames", 5).exit_code == 0
    source, found = motet.read(tmp_path / "a.bvh"), motet.read(tmp_path / "next.bvh")
    assert source.skeleton is not None
    assert found.skeleton is not None
    assert found.skeleton.names == source.skeleton.names
    assert run("control", "walk .5s", "--start", tmp_path / "a.bvh", "-o", tmp_path / "c.bvh").exit_code == 0


def test_a_wrist_between_forearm_and_hand_takes_the_twist(walk: Motion) -> None:
    skeleton = walk.skeleton
    assert skeleton is not None
    back = motet.from_humanoid(motet.to_humanoid(walk).motion, skeleton)
    for channel in ("lwrist.ry", "rwrist.ry", "lhand.rx", "rhand.rx", "lhand.rz", "rhand.rz"):
        own, found = (motion.select((channel,)).values for motion in (walk, back))
        assert np.abs(own - found).mean() < 5  # at rest the wrists would be 17 degrees off
    hand = skeleton.index("lhand")
    apart = angles_between(global_transforms(back)[0][:, hand], global_transforms(walk)[0][:, hand])
    assert np.degrees(apart).max() < 0.01
