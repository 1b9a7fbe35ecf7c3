"""Knees and elbows that keep their side, feet that are let go in a squat, and joints that do not jump."""

from itertools import product

import numpy as np
import pytest

import motet
from motet.figures.humanoid import BONES, limb_of
from motet.figures.two_bones import TwoBones
from motet.motion.rotations import Array
from motet.motion.scalar_or_batch import Vector, plus, rotated
from motet.steering.foot_lock import FootLock, FootLockSettings
from motet.steering.model import SteerModel
from motet.steering.pose import Pose
from motet.steering.sentence_acts import SaidActs
from motet.steering.turn_limit import BONES_OF_LIMIT, TurnLimit, TurnSettings

DT = 1 / 30
FAST = TurnSettings(**dict.fromkeys(BONES_OF_LIMIT, 5400.0))
"""Settings by which nothing is limited."""


@pytest.fixture(scope="module")
def model() -> SteerModel:
    return motet.load("control")


def turned(rotations: Array) -> Array:
    """Degrees (T - 1, ...) between rotations (T, ..., 4) that follow each other."""
    cosines = np.abs((rotations[1:].astype(np.float64) * rotations[:-1]).sum(axis=-1))
    return np.degrees(2 * np.arccos(cosines.clip(max=1)))


def leg(bend: float) -> TwoBones:
    """A leg along -y whose shin is turned back by some degrees, forward where they are negative."""
    angle = np.radians(bend)
    ankle = (0.0, -0.42 - 0.42 * float(np.cos(angle)), -0.42 * float(np.sin(angle)))
    return TwoBones((0.0, 0.0, 0.0), (0.0, -0.42, 0.0), ankle, (1.0, 0.0, 0.0))


def knee_and_ankle(limb: TwoBones, target: Vector) -> tuple[Vector, Vector]:
    thigh, shin = limb.turns(target)
    knee = rotated(thigh, limb._along)
    return knee, plus(knee, rotated(shin, limb._down))


@pytest.mark.parametrize("bend", [30.0, 100.0, 155.0, 170.0, -30.0, -100.0, -170.0])
def test_a_knee_keeps_its_side(bend: float) -> None:
    limb = leg(bend)
    # at its own ankle nothing turns, however far it is bent
    for turn in limb.turns(limb.ankle):
        np.testing.assert_allclose(turn, (0, 0, 0, 1), atol=1e-6)
    # and a little nearer to the hip the knee stays on its side
    nearer = tuple(0.9 * part for part in limb.ankle)
    knee, ankle = knee_and_ankle(limb, nearer)  # type: ignore[arg-type]
    aside = np.cross(knee, ankle)[0]
    assert np.sign(aside) == np.sign(bend)
    if abs(bend) < 160:
        np.testing.assert_allclose(ankle, nearer, atol=1e-9)


def test_a_knee_that_is_nearly_straight_bends_back() -> None:
    knee, ankle = knee_and_ankle(leg(-5.0), (0.0, -0.7, 0.0))
    assert knee[2] > 0.1
    np.testing.assert_allclose(ankle, (0, -0.7, 0), atol=1e-9)


@pytest.mark.parametrize("characters", [1, 2])
def test_no_foot_is_held_while_the_hips_are_low(characters: int) -> None:
    squat = np.tile(np.array([0, 0, 0, 1], np.float32), (characters, len(BONES), 1))
    for side in ("left", "right"):
        upper, lower, foot = (BONES.index(name) for name in limb_of(side, ("UpperLeg", "LowerLeg", "Foot")))
        for bone, half in ((upper, -0.8), (lower, 1.2), (foot, -0.4)):
            squat[:, bone, ::3] = np.sin(half), np.cos(half)

    def held(height: float) -> float:
        """How far the lock takes a leg away from what is played, while the figure slides 5 cm."""
        lock = FootLock.none(characters)
        for step in np.linspace(0, 0.05, 6):
            ground = np.tile([step, 0.0, 0.0], (characters, 1))
            heights = np.full(characters, height, np.float32)
            played = Pose(ground, squat, heights, np.ones((characters, 2), np.float32))
            lock, pose = lock.update(played, FootLockSettings(), DT)
        return float(np.abs(pose.rotations - squat).max())

    assert held(0.6) > 0.02
    assert held(0.49) < 1e-6


@pytest.mark.parametrize("characters", [1, 3])
def test_joints_go_to_where_they_jump_at_their_limits(characters: int) -> None:
    rest = np.tile(np.array([0, 0, 0, 1], np.float32), (characters, len(BONES), 1))
    bent = rest.copy()
    bent[:, :, ::3] = -np.sin(1.0), -np.cos(1.0)  # 115 degrees, of the other sign
    shown = []
    limit = TurnLimit.none(characters)
    for rotations in (rest, *[bent] * 12):
        pose = Pose(np.zeros((characters, 3)), rotations, np.ones(characters, np.float32), np.ones((characters, 2)))
        limit, pose = limit.update(pose, TurnSettings(), DT)
        shown.append(pose.rotations)
    steps = turned(np.stack(shown))
    for kind, bones in BONES_OF_LIMIT.items():
        most = getattr(TurnSettings(), kind) * DT
        for bone in bones:
            figures = steps[:, :, BONES.index(bone)]
            np.testing.assert_allclose(figures[: int(np.degrees(2) // most)], most, atol=0.05)
            assert figures.sum(axis=0) == pytest.approx(np.degrees(2), abs=0.5)
    assert steps[0, :, BONES.index("hips")] == pytest.approx(np.degrees(2), abs=0.05)
    np.testing.assert_array_equal(shown[-1], bent)


def test_no_joint_jumps_where_acts_cut_each_other(model: SteerModel) -> None:
    said = SaidActs(model, motet.load("generate"))
    acts = [said.act(words) for words in ("squat", "point forward", "sit down", "kick", "dance", "pick up")]
    pairs = list(product(acts, acts))
    cuts = np.random.default_rng(1).integers(5, 80, len(pairs))
    session = model.start(characters=len(pairs))
    session.control(speed=np.arange(len(pairs)) % 2 * 1.3)
    session.act([first for first, _ in pairs])
    poses = []
    for tick in range(120):
        figures = np.flatnonzero(cuts == tick)
        if len(figures):
            session.act([pairs[figure][1] for figure in figures], ids=figures.tolist())
        poses.append(session.tick())
    assert turned(np.stack([pose.rotations[:, 1:] for pose in poses])).max() < 35
    speeds = np.diff([pose.positions() - pose.place[:, None] for pose in poses], axis=0) * model.fps
    assert np.linalg.norm(np.diff(speeds, axis=0), axis=-1).max() < 16  # m/s; with knees that flip 28


def test_an_elbow_keeps_its_side_while_a_figure_passes_a_point(
    model: SteerModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(model._tuned, TurnSettings, FAST)
    points = np.random.default_rng(5).uniform((-0.3, 0.3, 2.5), (0.8, 1.9, 3.5), (60, 3))
    session = model.start(characters=len(points))
    session.control(speed=1.2)
    session.reach("left", points)
    poses = [session.tick() for _ in range(150)]
    assert session.out_of_reach[:, 0].all()
    arm = [BONES.index(bone) for bone in limb_of("left", ("UpperArm", "LowerArm"))]
    assert turned(np.stack([pose.rotations[:, arm] for pose in poses])).max() < 40  # degrees; with arms that flip 145
    # hands that would have to be behind the back hang again as they are played
    plain = model.start(characters=len(points))
    plain.control(speed=1.2)
    other = [plain.tick() for _ in range(150)][-1]
    right = points[:, 0] < 0.1
    difference = turned(np.stack([poses[-1].rotations[right], other.rotations[right]]))
    assert difference.max() < 0.1  # degrees
