"""Bodies on the floor: nothing stays under it, bones keep their lengths, and what is above it stays as it is."""

from dataclasses import replace

import numpy as np
import pytest
from test_odd_figures import ON_THE_FLOOR, posed

from motet.figures.floor import LIMB_ENDS, THICKNESS, TOLERATED, above_floor
from motet.figures.humanoid.bones import HUMANOID
from motet.motion.kinematics import global_transforms, positions
from motet.motion.motion import Motion

PARENTS = np.array([joint.parent for joint in HUMANOID.joints])[1:]
TRUNK = [i for i, name in enumerate(HUMANOID.names) if not name.endswith(LIMB_ENDS)]


def sunk(motion: Motion, depth: float) -> Motion:
    """The motion with its hips lower by metres."""
    values = motion.values.copy()
    values[:, motion.channels.index("hips.ty")] -= depth
    return replace(motion, values=values)


@pytest.mark.parametrize("pose", ON_THE_FLOOR)
def test_nothing_stays_under_the_floor(pose: str) -> None:
    low = sunk(ON_THE_FLOOR[pose], 0.15)
    before, after = positions(low), positions(above_floor(low))
    assert before[..., 1].min() < -0.04
    assert after[..., 1].min() > -TOLERATED - 1e-6
    thick = [THICKNESS.get(HUMANOID.names[i].removeprefix("left").removeprefix("right"), 0.0) for i in TRUNK]
    assert (after[:, TRUNK, 1] - thick).min() > -1e-6
    lengths = (np.linalg.norm(places[:, 1:] - places[:, PARENTS], axis=-1) for places in (before, after))
    np.testing.assert_allclose(*lengths, atol=1e-9)


def test_the_trunk_is_lifted_and_never_turned() -> None:
    low = sunk(ON_THE_FLOOR["lies"], 0.15)
    (turned, places), (after, lifted) = map(global_transforms, (low, above_floor(low)))
    np.testing.assert_allclose(after[:, TRUNK], turned[:, TRUNK], atol=1e-9)
    risen = lifted[:, TRUNK] - places[:, TRUNK]
    np.testing.assert_allclose(risen - risen[:, :1], 0, atol=1e-9)
    assert (risen[..., 1] > 0.1).all()


def test_only_what_is_under_the_floor_is_turned() -> None:
    """The feet of a figure that sits on its heels."""
    kneeling = posed(0.3, hips=(30, 0, 0), UpperLeg=(-100, 0, 0), LowerLeg=(140, 0, 0), Foot=(50, 0, 0))
    before, after = positions(kneeling), positions(above_floor(kneeling))
    feet = [i for i, name in enumerate(HUMANOID.names) if name.endswith(("Foot", "Toes", "Toes_end"))]
    rest = np.setdiff1d(np.arange(len(HUMANOID.names)), feet)
    assert before[:, feet, 1].min() < -0.1
    assert after[..., 1].min() > -TOLERATED - 1e-6
    np.testing.assert_allclose(after[:, rest], before[:, rest], atol=1e-6)


def test_who_is_above_the_floor_stays_as_they_are() -> None:
    for pose in ON_THE_FLOOR.values():
        high = sunk(pose, -1.5)
        np.testing.assert_allclose(positions(above_floor(high)), positions(high), atol=1e-9)


def test_who_sinks_for_a_moment_is_lifted_without_a_leap() -> None:
    pose = ON_THE_FLOOR["lies"]
    values = np.repeat(pose.values[:1], 60, axis=0)
    values[:, pose.channels.index("hips.ty")] = 0.3
    values[30, pose.channels.index("hips.ty")] = 0.0
    moved = positions(above_floor(replace(pose, values=values, fps=30.0))) - positions(replace(pose, values=values))
    assert moved[30, TRUNK, 1].min() > 0.06
    assert np.abs(np.diff(moved, axis=0)).max() < 0.05
    np.testing.assert_allclose(moved[:20], 0, atol=1e-9)
