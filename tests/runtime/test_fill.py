"""Filling gaps, joining and looping: by a graph that adds nothing, so that what comes out is known beforehand."""

import logging
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from fake_fill import CONTRACT, DEFAULTS, fill_model, glider
from fake_models import CONTRACT as OTHER_FIGURE
from fake_models import manifest
from test_mmm_figure import mmm

from motet.errors import ArgumentError, BundleError, MotionError
from motet.motion import Motion, positions, to_humanoid
from motet.motion.kinematics import local_rotations, local_translations, posed
from motet.motion.rotations import axis_to_rotmat
from motet.predict.fill import FillModel
from motet.representation.placed import placed

pytestmark = pytest.mark.numeric


@pytest.fixture(scope="module")
def model() -> FillModel:
    return fill_model()


def spoiled(motion: Motion, start: int, stop: int) -> Motion:
    """The motion with nonsense in some frames."""
    values = np.array(motion.values)
    values[start:stop] = 1e3
    return replace(motion, values=values)


@pytest.mark.parametrize("fps", [24.0, 30.0, 100.0, 120.0])
def test_a_gap_in_an_even_movement_is_filled_as_it_was(model: FillModel, fps: float) -> None:
    motion = glider(round(3 * fps), fps)
    start, stop = round(fps), round(2 * fps)
    found = model.fill(spoiled(motion, start, stop), [(1.0, 2.0)])
    np.testing.assert_allclose(found.values[start:stop], motion.values[start:stop], atol=2e-3)
    assert (found.channels, found.units, found.fps) == (motion.channels, motion.units, motion.fps)


@pytest.mark.parametrize("figure", ["walk", "mixamo"])
def test_all_other_frames_of_any_figure_stay_to_the_bit(
    model: FillModel, figure: str, request: pytest.FixtureRequest
) -> None:
    motion: Motion = request.getfixturevalue(figure)
    found = model.fill(motion, [(1.0, 1.5), (2.0, 2.4)])
    changed = (found.values != motion.values).any(axis=1)
    assert np.flatnonzero(changed).tolist() == [*range(120, 180), *range(240, 288)]
    # on the figure's own bones, and joined without a leap: the walk's fastest joint goes 8 m/s
    metres = motion.skeleton.unit_factor(1.0) if motion.skeleton else 0.0
    speeds = np.linalg.norm(np.diff(positions(found), axis=0), axis=-1) * metres * motion.fps
    assert speeds.max() < 9


def test_what_the_model_adds_is_in_the_gap_of_any_figure(walk: Motion, mixamo: Motion) -> None:
    up = fill_model(added=0.1)
    for motion in (walk, mixamo):
        assert motion.skeleton is not None
        lifted, plain = (positions(each.fill(motion, [(1.0, 1.5)])) for each in (up, fill_model()))
        scale = (lifted - plain)[120:180] * motion.skeleton.unit_factor(1.0)
        leg = to_humanoid(motion).leg
        assert leg is not None
        # as high as its legs are long over those of the humanoid
        np.testing.assert_allclose(scale[20:40, 0], [[0, 0.1 * leg / 0.84, 0]] * 20, atol=2e-3)


def test_channels_of_which_the_humanoid_says_nothing_go_straight_through(model: FillModel) -> None:
    motion = glider()
    extra = np.sin(np.arange(len(motion)))[:, None]
    values, names = np.column_stack([motion.values, extra]), (*motion.channels, "light")
    joined = Motion(values, names, (*motion.units, "1"), motion.fps, motion.skeleton)
    found = model.fill(joined, [(1.0, 2.0)]).values[29:61, -1]
    np.testing.assert_allclose(found, np.linspace(extra[29, 0], extra[60, 0], 32), atol=1e-12)


def test_several_gaps_are_as_one_after_the_other(model: FillModel, walk: Motion) -> None:
    both = model.fill(walk, [(2.0, 2.4), (1.0, 1.5)])
    one = model.fill(spoiled(walk, 240, 288)[:240], [(1.0, 1.5)])
    np.testing.assert_array_equal(both.values[:240], one.values)


@pytest.mark.parametrize(
    ("gaps", "said"),
    [
        ([], "no gap to fill"),
        ([(1.0, 1.0)], "is empty: it must start before it stops"),
        ([(2.0, 1.0)], "is empty: it must start before it stops"),
        ([(float("nan"), 1.0)], "is empty"),
        ([1.0, 1.5], r"a gap is two numbers in seconds, such as \(1.0, 2.0\), not 1.0"),
        ([(1.0, "end")], r"a gap is two numbers in seconds, .*, not \(1.0, 'end'\)"),
        ([(1.0, 1.001)], "has no frame at 30 fps: make it longer"),
        ([(0.0, 1.0)], "at the very start of the motion of 3 s: a gap needs frames before it"),
        ([(2.0, 3.0)], r"at the very end of the motion of 3 s: a gap needs frames after it.*motet predict"),
        ([(0.1, 1.0)], r"at least 0.13 s of motion \(4 frames at 30 fps\) before it, but there are 0.1 s"),
        ([(2.0, 2.9)], r"at least 0.13 s of motion \(4 frames at 30 fps\) after it, but there are 0.1 s"),
        ([(-1.0, 1.0)], "not within the motion of 3 s"),
        ([(1.0, 4.0)], "not within the motion of 3 s"),
        ([(1.0, 1.6), (1.5, 2.0)], "1:1.6 and 1.5:2 overlap or touch: merge them"),
        ([(1.5, 2.0), (1.0, 1.5)], "1:1.5 and 1.5:2 overlap or touch: merge them"),
        ([(1.0, 1.5), (1.6, 2.0)], "at least 0.13 s of motion .* after it, but there are 0.1 s"),
        ([(0.4, 2.6)], "too long: at most 2 s can be filled"),
    ],
)
def test_gaps_that_cannot_be_filled(model: FillModel, gaps: list[tuple[float, float]], said: str) -> None:
    with pytest.raises(MotionError, match=said):
        model.fill(glider(), gaps)


def test_a_motion_without_a_figure_is_refused(model: FillModel) -> None:
    with pytest.raises(MotionError, match="no skeleton"):
        model.fill(replace(glider(), skeleton=None), [(1.0, 2.0)])


def test_a_figure_in_another_world_comes_on_the_humanoid(
    model: FillModel, mixamo: Motion, caplog: pytest.LogCaptureFixture
) -> None:
    """With z up, as some files have it."""
    skeleton, up = mixamo.skeleton, axis_to_rotmat("x", np.array(np.pi / 2))
    assert skeleton is not None
    joints = [replace(joint, offset=tuple(up @ joint.offset)) for joint in skeleton.joints]
    turned, moved = up @ local_rotations(mixamo) @ up.T, local_translations(mixamo) @ up.T
    names = {name: joint for joint, name in enumerate(skeleton.names)}
    other = replace(mixamo, skeleton=replace(skeleton, joints=tuple(joints)))
    standing = posed(other, *({name: each[:, i] for name, i in names.items()} for each in (turned, moved)))
    np.testing.assert_allclose(positions(standing), positions(mixamo) @ up.T, atol=1e-6)
    with caplog.at_level(logging.WARNING):
        found = model.fill(standing, [(1.0, 2.0)])
    assert "uses the model's skeleton" in caplog.text
    assert (found.skeleton, found.fps) == (CONTRACT.skeleton, 30.0)
    joined = model.join(standing, mixamo, seconds=0.5)
    assert (joined.skeleton, joined.fps, len(joined)) == (CONTRACT.skeleton, 30.0, 100 + 15 + 100)


def test_a_file_without_a_skeleton_of_its_own_comes_on_the_humanoid(
    model: FillModel, caplog: pytest.LogCaptureFixture
) -> None:
    """MMM's figure, whose files do not hold one."""
    motion = mmm()
    stands = replace(motion, values=np.repeat(motion.values[:1], 200, axis=0))
    with caplog.at_level(logging.WARNING):
        found = [model.fill(stands, [(0.5, 1.0)]), model.looped(stands), model.join(stands, stands)]
    assert "uses the model's skeleton" in caplog.text
    assert [(each.skeleton, each.fps, len(each)) for each in found] == [
        (CONTRACT.skeleton, 30.0, count) for count in (60, 75, 150)
    ]


def test_joining_the_parts_of_an_even_movement_gives_it_whole(model: FillModel) -> None:
    motion = glider()
    turn = axis_to_rotmat("y", np.array(2.0))
    second = motion[60:]
    # wherever the second part was, and whichever way it went
    values = np.array(second.values)
    values[:, :3] = second.values[:, :3] @ turn.T + [5.0, 0.0, -3.0]
    values[:, motion.channels.index("hips.ry")] += np.degrees(2.0)
    found = model.join(motion[:30], replace(second, values=values), seconds=1.0)
    np.testing.assert_array_equal(found.values[:30], motion.values[:30])
    np.testing.assert_allclose(positions(found), positions(motion), atol=1e-5)


def test_a_motion_that_is_joined_is_moved_over_the_ground_and_turned_as_a_whole(
    model: FillModel, walk: Motion, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING):
        found = model.join(walk, walk[100:], seconds=0.5)
    assert caplog.text == ""
    assert len(found) == len(walk) + 60 + len(walk) - 100
    np.testing.assert_array_equal(found.values[: len(walk)], walk.values)
    before, after = positions(walk[100:]), positions(found[len(walk) + 60 :])
    np.testing.assert_allclose(after[..., 1], before[..., 1], atol=1e-6)
    apart = [np.linalg.norm(each - each[:1, :1], axis=-1) for each in (before, after)]
    np.testing.assert_allclose(apart[1], apart[0], atol=1e-6)


def test_a_motion_of_another_figure_and_rate_is_brought_to_the_first_and_that_is_said(
    model: FillModel, walk: Motion, mixamo: Motion, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING):
        found = model.join(mixamo, walk.resample(30.0), seconds=0.5)
    assert "resampled the second motion from 30 to 120 fps" in caplog.text
    assert "retargeted the second motion" in caplog.text
    assert (found.channels, found.skeleton, found.fps) == (mixamo.channels, mixamo.skeleton, 120.0)
    assert len(found) == len(mixamo) + 60 + 397  # 100 frames at 30 fps
    # the same walk, as it is on the first figure
    own, after = positions(mixamo), positions(found[len(mixamo) + 60 :])
    heights = [each[: len(after), :, 1] - each[: len(after), :1, 1] for each in (own, after)]
    np.testing.assert_allclose(heights[1], heights[0], atol=0.02 * np.ptp(own[..., 1]))


@pytest.mark.parametrize("seconds", [0.0, -1.0, 2.1, float("nan"), float("inf")])
def test_transitions_that_are_none(model: FillModel, seconds: float) -> None:
    said = "more than 0 and at most 2 seconds, not"
    with pytest.raises(MotionError, match=said):
        model.join(glider(), glider(), seconds=seconds)
    with pytest.raises(MotionError, match=said):
        model.looped(glider(), seconds=seconds)


def test_motions_too_short_to_be_joined(model: FillModel) -> None:
    with pytest.raises(MotionError, match=r"before it, but there are 0\.1 s"):
        model.join(glider(3), glider())
    with pytest.raises(MotionError, match=r"after it, but there are 0\.1 s"):
        model.join(glider(), glider(3))


def test_what_is_no_motion_is_refused(model: FillModel, walk: Motion) -> None:
    number: Any = 3
    path: Any = "walk.bvh"
    for call in (
        lambda: model.join(walk, number),
        lambda: model.looped(path),
        lambda: model.fill([number], [[(1.0, 2.0)]]),
    ):
        with pytest.raises(ArgumentError, match="expected a motion"):
            call()


def test_a_loop_leads_to_its_own_start(model: FillModel, walk: Motion) -> None:
    found = model.looped(walk, seconds=0.5)
    np.testing.assert_array_equal(found.values[: len(walk)], walk.values)
    assert len(found) == len(walk) + 60
    joined = model.join(walk, walk, seconds=0.5)
    np.testing.assert_array_equal(found.values, joined.values[: len(found)])
    # what comes next is the walk's first pose, moved on: the last step is as small as those before it
    steps = np.linalg.norm(np.diff(positions(joined)[len(found) - 10 : len(found) + 1], axis=0), axis=-1)
    assert steps[-1].max() < 1.5 * steps[:-1].max()


def test_frames_between_are_the_same_wherever_they_are(model: FillModel) -> None:
    frames = placed(glider())
    found = model.frames_between(frames[:30], frames[60:], 30)
    np.testing.assert_allclose(found, frames[30:60], atol=1e-5)
    given = {"past": frames[:30].astype(np.float32), "after": frames[60:].astype(np.float32)}
    np.testing.assert_allclose(model.replay(given, {"frames": 30})["filled"], found, atol=1e-5)
    with pytest.raises(BundleError, match="1 to 60 frames, not 61"):
        model.replay(given, {"frames": 61})
    with pytest.raises(MotionError, match="at least 4 frames of 135 channels before it, not \\(3, 135\\)"):
        model.frames_between(frames[:3], frames[60:], 30)
    with pytest.raises(MotionError, match="frames must be a whole number from 0 to 120, not 121"):
        model.frames_between(frames[:30], frames[60:], 121)
    with pytest.raises(MotionError, match="finite numbers"):
        model.frames_between(frames[:30] * np.nan, frames[60:], 30)


def test_a_model_of_another_figure_or_without_its_limits_is_refused() -> None:
    graphs = dict(fill_model().graphs)
    with pytest.raises(BundleError, match="needs motet's humanoid"):
        FillModel(manifest("fill", "between", OTHER_FIGURE, DEFAULTS), graphs)
    with pytest.raises(BundleError, match=r"defaults\.longest: is missing"):
        FillModel(manifest("fill", "between", CONTRACT, {"context": 20, "least": 4}), graphs)
