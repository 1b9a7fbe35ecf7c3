"""Training of a figure that is steered: rows of recordings, their mirror images, poses in few codes, the step."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from motet import to_humanoid
from motet.decode.matching import ASKED, mirrored_features
from motet.formats import read_motion
from motet.motion.humanoid.bones import BONES, HUMANOID
from motet.motion.kinematics import positions
from motet.motion.mirroring import mirror
from motet.motion.motion import Motion
from motet.representation import named
from motet.representation.contract import MotionContract
from motet_train.data.cmu_trials import CMU_FOLDER
from motet_train.data.gaits import Gait, read_gaits
from motet_train.data.locomotion import Recording
from motet_train.data.matching_rows import MatchingRows, mirrored_poses, rows_of, scaling
from motet_train.models.codes.sixd_places import tree_of
from motet_train.models.control.matching import Matching, MatchingConfig, from_config
from motet_train.recipes.matching_table import take

CLIPS = CMU_FOLDER


@pytest.fixture(scope="module")
def walk() -> Motion:
    return to_humanoid(read_motion(CLIPS / "39_14.amc")).motion.resample(30.0)


@pytest.fixture(scope="module")
def rows(walk: Motion) -> MatchingRows:
    return rows_of([recording(walk)], ("walk",))


def recording(motion: Motion) -> Recording:
    return Recording(named("root_sixd").features(motion), frozenset({"walk"}))


@pytest.fixture(scope="module")
def net(walk: Motion, rows: MatchingRows) -> Matching:
    features = named("root_sixd").features(walk)
    zeros = np.zeros(len(features.channels))
    contract = MotionContract("root_sixd", features.channels, features.units, 30.0, zeros, zeros + 1, HUMANOID)
    mean, scale = scaling(rows.features)
    config = MatchingConfig(
        len(zeros),
        tree_of(contract),
        len(rows),
        gaits=("walk",),
        speeds=((0.0, 1.3, 2.0, 0.0, 0.0),),
        mean=tuple(mean.tolist()),
        scale=tuple(scale.tolist()),
    )
    made = Matching(config)
    take(made, rows)
    return made


def test_rows_of_a_mirrored_recording_are_mirrored_rows(walk: Motion, rows: MatchingRows) -> None:
    other = rows_of([recording(mirror(walk))], ("walk",))
    columns, signs = mirrored_features()
    np.testing.assert_allclose(other.features, rows.features[:, columns] * signs, atol=1e-3)
    np.testing.assert_allclose(other.moves, rows.moves * (1, -1, -1), atol=1e-4)
    np.testing.assert_allclose(other.contacts, rows.contacts[:, ::-1], atol=1e-3)
    at, sign = mirrored_poses()
    quats, image = (p[:, :-1].reshape(-1, len(BONES), 4) for p in (other.poses, rows.poses[:, at] * sign))
    np.testing.assert_allclose(np.abs((quats * image).sum(axis=-1)), 1, atol=1e-5)


def test_features_say_where_the_recording_goes(walk: Motion, rows: MatchingRows) -> None:
    hips = positions(walk)[:, 0]
    far = np.linalg.norm(hips[30:, [0, 2]] - hips[:-30, [0, 2]], axis=1)
    np.testing.assert_allclose(np.hypot(*rows.features[:-30, 4:6].T), far, atol=1e-6)
    np.testing.assert_allclose(np.hypot(rows.features[:, 6], rows.features[:, 7]), 1)
    assert rows.features[0, ASKED + 3 * 0 + 1] == pytest.approx(positions(walk)[0, HUMANOID.index("leftToes"), 1])
    assert (rows.left == np.arange(len(rows))[::-1]).all()
    assert 0.3 < rows.contacts.mean() < 0.9


@torch.no_grad()
def test_more_codes_give_poses_back_more_nearly(net: Matching, rows: MatchingRows) -> None:
    true, off = rows.poses[:, :-1].reshape(len(rows), -1, 4), []
    for even, odd in ((4, 4), (12, 12), (30, 30)):
        made = Matching(replace(net.config, even=even, odd=odd))
        take(made, rows)
        quats, height = made.poses(made.codes)
        off.append(1 - np.abs((quats.numpy() * true).sum(axis=-1)).mean())
        assert np.abs(height[:, 0].numpy() - rows.poses[:, -1]).max() < 0.05
    assert off[0] > 3 * off[1] > 9 * off[2]
    assert off[2] < 1e-4


def test_points_are_those_of_the_recording(net: Matching, walk: Motion, rows: MatchingRows) -> None:
    quats = torch.from_numpy(rows.poses[:, :-1]).float().reshape(len(rows), -1, 4)
    found = net.points(quats, torch.from_numpy(rows.poses[:, -1:]).float()).numpy()
    shape = np.linalg.norm(found[:, :, None] - found[:, None], axis=-1)
    true = positions(walk)
    np.testing.assert_allclose(shape, np.linalg.norm(true[:, :, None] - true[:, None], axis=-1), atol=1e-5)
    np.testing.assert_allclose(found[..., 1], true[..., 1], atol=1e-5)


def test_codes_of_a_mirror_image_differ_by_signs(net: Matching, rows: MatchingRows) -> None:
    with torch.no_grad():
        quats, _ = net.poses(net.codes * net.signs[: net.codes.shape[1]])
    at, sign = mirrored_poses()
    image = (rows.poses[:, at] * sign)[:, :-1].reshape(len(rows), -1, 4)
    assert np.abs((quats.numpy() * image).sum(axis=-1)).min() > 0.99


@torch.no_grad()
def test_the_encoder_is_the_inverse_of_poses(net: Matching) -> None:
    net.graphs()
    codes = net.encode(*net.poses(net.codes[:20]))
    again, _ = net.poses(codes)
    np.testing.assert_allclose((again * net.poses(net.codes[:20])[0]).sum(-1).abs().numpy(), 1, atol=1e-4)


@torch.no_grad()
def test_a_step_plays_the_row_and_follows_the_springs(net: Matching, rows: MatchingRows) -> None:
    frames, _, _, _ = net.table(torch.arange(len(rows)))
    width, count = frames.shape[1], net.codes.shape[1]
    at = 40
    speed = float(rows.speed[at])
    facing = 0.7
    going = [float(speed * np.sin(facing)), float(speed * np.cos(facing))]
    states = [torch.tensor([[1.0, 2.0, facing, 1.0]]), torch.tensor([[*going, 0.0, 0.0, facing, 0.0]])]
    recorded = torch.stack([frames[at], frames[at + 1]])[None]
    assert recorded.shape == (1, 2, width)
    control = torch.tensor([[*going, facing]])
    bend = torch.zeros(1, 2 * count)
    rotations, height, contacts, root, course, bent = net.step(
        recorded, torch.tensor([[0.0, 1.0]]), control, *states, bend
    )
    np.testing.assert_allclose(rotations.numpy()[0], net.poses(net.codes[at])[0].numpy(), atol=1e-6)
    np.testing.assert_allclose(contacts[0].numpy(), rows.contacts[at], atol=1e-6)
    assert not bent.any()
    np.testing.assert_allclose(course.numpy(), states[1].numpy(), atol=1e-5)  # asked for what it has
    forward, left, _ = rows.moves[at] / 30
    step = np.array(
        [np.sin(facing) * forward + np.cos(facing) * left, np.cos(facing) * forward - np.sin(facing) * left]
    )
    moved = root[0, :2].numpy() - [1, 2]
    assert np.linalg.norm(moved) == pytest.approx(np.linalg.norm(step), rel=0.05)
    assert height[0, 0] == pytest.approx(rows.poses[at, -1], abs=0.02)
    # asked for a stop, the springs slow down as critically damped ones do
    damping, dt = 2 * np.log(2) / net.config.steering.velocity, net.config.steering.dt
    stopped = net.step(recorded, torch.tensor([[0.0, 1.0]]), torch.tensor([[0.0, 0.0, facing]]), *states, bend)
    left_over = np.exp(-damping * dt) * (1 + damping * dt)
    np.testing.assert_allclose(stopped[4][0, :2].numpy(), np.array(going) * left_over, rtol=1e-4)


def test_a_net_is_built_from_its_manifest(net: Matching) -> None:
    import json
    from dataclasses import asdict

    again = from_config(json.loads(json.dumps(asdict(net.config))))
    assert again.config == net.config
    again.load_state_dict(net.state_dict())


def test_the_table_of_gaits() -> None:
    gaits = {gait.name: gait for gait in read_gaits()}
    assert next(iter(gaits)) == "walk"
    assert gaits["walk"].shown("walk turn left 90 degrees", "ACCAD_Male2")
    assert not gaits["walk"].shown("walk stealthily", "ACCAD_Male2")
    assert gaits["run"].shown("run/jog", "16")
    assert not Gait("a", ("x*",), ("y",)).shown("xa", "z")
