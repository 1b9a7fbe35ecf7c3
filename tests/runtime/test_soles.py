"""Characters with long shoes, big heads and short arms stay on the ground, moment by moment."""

from pathlib import Path

import numpy as np
import pytest

import motet
from motet.figures.humanoid import from_humanoid, to_humanoid
from motet.figures.humanoid.bones import MIXAMO
from motet.motion.kinematics import global_transforms
from motet.motion.rotations import Array, rotated

pytestmark = pytest.mark.numeric

CMU = Path(__file__).parents[2] / "train/motet_train/data/cmu"

METRE = float(MIXAMO.metres_per_unit or 0)

BOX = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])


def box(middle: tuple[float, float, float], half: tuple[float, float, float]) -> Array:
    return (np.array(middle) + BOX * half) / METRE


def character(shoe: float, head: float) -> dict[int, Array]:
    """Corners of boxes from joints of a figure of the humanoid's size: soles 8 cm below the ankles, shoes that reach
    ``shoe`` m ahead of these, and a head of half ``head`` m."""
    skin = {MIXAMO.index("mixamorig:Head"): box((0, 0.1, 0), (head, head, head))}
    for side in ("Left", "Right"):
        skin[MIXAMO.index(f"mixamorig:{side}Foot")] = box((0, -0.05, shoe / 2 - 0.05), (0.05, 0.03, shoe / 2 + 0.05))
        skin[MIXAMO.index(f"mixamorig:{side}Hand")] = box((0, 0, 0), (0.09, 0.04, 0.04))
    return skin


def lowest(motion: motet.Motion, skin: dict[int, Array], part: str = "") -> Array:
    """The height (T,) in metres of the lowest corner, of joints with ``part`` in their names."""
    turned, places = global_transforms(motion)
    joints = [joint for joint in skin if part in MIXAMO.names[joint]]
    corners = [places[:, i, None] + rotated(turned[:, i, None], skin[i]) for i in joints]
    heights: Array = np.concatenate(corners, axis=1)[..., 1].min(axis=1) * METRE
    return heights


@pytest.mark.parametrize("shoe", [0.2, 0.28])
def test_who_walks_in_shoes_of_any_length_neither_sinks_nor_hovers(shoe: float) -> None:
    walk = to_humanoid(motet.read(CMU / "39_14.amc")).motion
    skin = character(shoe, 0.12)
    put = from_humanoid(walk, MIXAMO, skin=skin)
    heights = lowest(put, skin)
    assert heights.min() > -0.006
    assert np.median(np.abs(heights)) < 0.01
    assert heights.max() < 0.025
    # the feet alone are turned, and no faster than before
    plain = from_humanoid(walk, MIXAMO)
    turned = global_transforms(put)[0]
    before = global_transforms(plain)[0]
    feet = [i for i, name in enumerate(MIXAMO.names) if "Foot" in name or "Toe" in name]
    others = [i for i in range(len(MIXAMO.names)) if i not in feet]
    np.testing.assert_allclose(turned[:, others], before[:, others], atol=1e-9)
    assert steepest(turned[:, feet]) < 1.1 * steepest(before[:, feet])
    # and the body goes up and down as it did
    rise = np.diff((global_transforms(put)[1] - global_transforms(plain)[1])[:, 0, 1]) * METRE
    assert np.abs(rise).max() * walk.fps < 0.25


def steepest(turned: Array) -> float:
    """The largest turn of joints from one frame to the next, by the trace of their rotations."""
    between = np.swapaxes(turned[:-1], -1, -2) @ turned[1:]
    cosine = (np.trace(between, axis1=-2, axis2=-1) - 1) / 2
    return float(np.arccos(np.clip(cosine, -1, 1)).max())


def test_who_stands_on_short_arms_is_raised_off_a_big_head() -> None:
    """Turned over about the middle of the body, as in a cartwheel."""
    walk = to_humanoid(motet.read(CMU / "39_14.amc")).motion
    values = np.array(walk.values)
    spin = np.linspace(0, 360, len(walk))
    values[:, walk.channels.index("hips.rz")] = spin
    turning = motet.Motion(values, walk.channels, walk.units, walk.fps, walk.skeleton)
    skin = character(0.3, 0.3)
    put = from_humanoid(turning, MIXAMO, skin=skin)
    assert lowest(put, skin).min() > -0.006
    # without that the head was far below the ground
    feet_alone = {joint: corners for joint, corners in skin.items() if "Foot" in MIXAMO.names[joint]}
    assert lowest(from_humanoid(turning, MIXAMO, skin=feet_alone), skin, "Head").min() < -0.05


def test_the_floor_is_where_feet_stand_not_where_toes_dip() -> None:
    """Of a recording whose tipped toes dip below the floor on the humanoid, which stood 4 cm above it."""
    walk = to_humanoid(motet.read(CMU / "09_07.amc")).motion
    skin = character(0.2, 0.12)
    put = from_humanoid(walk, MIXAMO, skin=skin)
    assert abs(np.median(np.sort(lowest(put, skin))[: len(put) // 2])) < 0.01


def test_one_frame_and_none_are_put_on_the_ground() -> None:
    walk = to_humanoid(motet.read(CMU / "39_14.amc")).motion
    skin = character(0.3, 0.12)
    still = from_humanoid(walk[:1], MIXAMO, skin=skin)
    assert lowest(still, skin)[0] == pytest.approx(0, abs=0.01)
    assert len(from_humanoid(walk[:0], MIXAMO, skin=skin)) == 0
