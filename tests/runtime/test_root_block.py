from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from figures import walker

from motet.bundle.fields import Fields
from motet.bundle.manifest import read_contract
from motet.errors import MotionError
from motet.formats import read_motion
from motet.motion.kinematics import heading, positions
from motet.motion.motion import Motion, lines
from motet.representation.contract import MotionContract
from motet.representation.root_block import ROOT_BLOCK, ROOT_BLOCK_UNITS, from_root_block, to_root_block


def block(motion: Motion) -> dict[str, np.ndarray]:
    return dict(zip(ROOT_BLOCK, motion.select(ROOT_BLOCK, ROOT_BLOCK_UNITS).values.T, strict=True))


def moved(motion: Motion, turn: float, place: tuple[float, float]) -> np.ndarray:
    """Positions with the figure's first frame turned by ``turn`` and put at ``place``."""
    found = positions(motion)
    sin, cos = np.sin(turn), np.cos(turn)
    rotation = np.array([[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]])
    start = found[0, 0] * [1, 0, 1]
    return (found - start) @ rotation.T + [place[0], 0, place[1]]


@pytest.mark.parametrize("scale", [1.0, 20.0])
def test_it_comes_back_up_to_place_and_heading(scale: float) -> None:
    motion = walker(40, scale=scale, metres_per_unit=1 / scale)
    found = from_root_block(to_root_block(motion))
    assert set(found.channels) == set(motion.channels)
    np.testing.assert_allclose(positions(found), moved(motion, -heading(motion)[0], (0, 0)), atol=1e-9 * scale)
    again = to_root_block(found)
    np.testing.assert_allclose(again.values, to_root_block(motion).values, atol=1e-9)


def test_a_recorded_trial_comes_back(clips: Path) -> None:
    motion = read_motion(clips / "02_06.amc").resample(10)
    found = from_root_block(to_root_block(motion))
    assert found.channels == motion.channels
    np.testing.assert_array_equal(found.values[:, 6:], motion.values[:, 6:])
    np.testing.assert_allclose(positions(found), moved(motion, -heading(motion)[0], (0, 0)), atol=1e-8)


def test_walking_a_circle_to_the_left() -> None:
    time = np.arange(30) / 10
    angle = np.radians(40) * time
    radius = 2.0
    places = np.column_stack([radius * (1 - np.cos(angle)), np.full(30, 0.9), radius * np.sin(angle)])
    motion = walker(30, fps=10).select(tuple(f"hips.{kind}{axis}" for kind in "tr" for axis in "xyz"))
    values = np.column_stack([places, np.zeros(30), np.degrees(angle), np.full(30, 7.0)])
    found = block(to_root_block(replace(motion, values=values)))
    chord = 2 * radius * np.sin(np.radians(2)) * 10
    np.testing.assert_allclose(np.hypot(found["root.forward"], found["root.left"]), chord)
    assert (found["root.forward"] > 0.99 * chord).all()
    assert (found["root.left"] > 0).all()
    np.testing.assert_allclose(found["root.turn"], 40)
    np.testing.assert_allclose(found["root.height"], 0.9)
    np.testing.assert_allclose(found["root.roll"], 7)
    np.testing.assert_allclose(found["root.pitch"], 0, atol=1e-9)


def test_a_lone_frame_stands_still() -> None:
    for frames in (0, 1):
        found = to_root_block(walker(40)[:frames])
        np.testing.assert_array_equal(found.values[:, :3], np.zeros((frames, 3)))
        assert len(from_root_block(found)) == frames


def test_what_the_block_needs_is_named() -> None:
    motion = walker(10)
    with pytest.raises(MotionError, match=r"lacks hips\.tx, hips\.ty, hips\.tz"):
        to_root_block(motion.select(motion.channels[3:]))
    with pytest.raises(MotionError, match="length unit of this skeleton is unknown"):
        to_root_block(walker(10, metres_per_unit=None))
    with pytest.raises(MotionError, match="no skeleton"):
        to_root_block(replace(motion, skeleton=None))
    with pytest.raises(MotionError, match=r"root\.forward"):
        from_root_block(motion)


def contract_of(motion: Motion) -> MotionContract:
    width = len(motion.channels)
    name = "root_angles" if set(ROOT_BLOCK) <= set(motion.channels) else "angles"
    return MotionContract(
        name, motion.channels, motion.units, motion.fps, np.zeros(width), np.ones(width), motion.skeleton
    )


def test_a_contract_takes_motions_with_and_without_the_block() -> None:
    motion = walker(80, fps=40)
    expected = to_root_block(motion.continuous().resample(10))
    contract = contract_of(expected)
    np.testing.assert_array_equal(contract.frames(motion), expected.values)
    np.testing.assert_array_equal(contract.frames(expected), expected.values)
    angles = contract_of(motion.select(motion.channels[6:9]))
    np.testing.assert_array_equal(angles.frames(motion), motion.values[:, 6:9])
    with pytest.raises(MotionError, match=r"lacks hips\.tx"):
        contract.frames(motion.select(motion.channels[3:]))


def test_a_contract_needs_no_skeleton() -> None:
    contract = contract_of(replace(walker(3), skeleton=None))
    again = read_contract(Fields(contract.to_json(), "motion"))
    assert again.skeleton is None
    assert again.features(np.zeros((2, len(again.channels)))).skeleton is None


def test_smoothing_passes_through_every_frame() -> None:
    motion = walker(20, fps=10).continuous()
    smooth = motion.resample(30)
    assert (smooth.fps, len(smooth)) == (30, 19 * 3 + 1)
    np.testing.assert_allclose(smooth.values[::3], motion.values, atol=1e-9)
    line = np.linspace(1, 5, 20)[:, None] * np.ones(len(motion.channels))
    np.testing.assert_allclose(replace(motion, values=line).resample(25).values[:, 0], 1 + 4 / 19 * 0.4 * np.arange(48))


def test_smoothing_is_nearer_to_the_motion_than_lines() -> None:
    motion = walker(122, fps=60).continuous()
    slow = motion[::6]
    smooth = slow.resample(60).values
    straight = lines(slow.values, np.arange(len(smooth)) / 6)
    truth = motion.values[: len(smooth)]
    assert np.abs(smooth - truth).max() < 0.4 * np.abs(straight - truth).max()
