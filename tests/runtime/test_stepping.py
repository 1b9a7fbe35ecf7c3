"""Planned steps: feet of slow figures stand or are lifted, and stops end in balance."""

from dataclasses import replace

import numpy as np
import pytest

from motet import SteerModel, SteerSession, load
from motet.figures.humanoid import HUMANOID, sole_points
from motet.motion.rotations import Array, quat_to_rotmat
from motet.steering.foot_lock import FootLock
from motet.steering.pose import Pose
from motet.steering.stepping import FREE, Footing, Plan, Step, StepSettings, lift_of, stepped

DT = 1 / 30
SETTINGS = StepSettings()
SWING_TICKS = int(SETTINGS.swing / DT) + 1
DIRECTIONS = np.arange(-180.0, 180.0, 45.0)


@pytest.fixture(scope="module")
def model() -> SteerModel:
    return load("control")


def soles(pose: Pose) -> Array:
    """Points (B, 2, 3, 3): heel, ball and tip of the left and the right sole."""
    turned, places = pose.global_transforms()
    return sole_points(quat_to_rotmat(turned.astype(np.float64)), places).reshape(len(pose), 2, 3, 3)


def clocks(session: SteerSession) -> Array:
    """How long feet (B, 2) have been lifted, as :class:`Step` has it."""
    lock = session.snapshot().lock
    assert isinstance(lock, FootLock)
    return lock.feet[:, :, 6]


def slow_walks(model: SteerModel, speed: float) -> tuple[Array, Array]:
    """Points (T, B, 2, 3, 3) of the soles and clocks (T, B, 2) of figures that walk in all directions, and face z."""
    session = model.start(characters=len(DIRECTIONS))
    session.control(speed=speed, direction=DIRECTIONS, facing=0.0)
    for _ in range(60):
        session.tick()
    points, lifted = list[Array](), list[Array]()
    for _ in range(150):
        points.append(soles(session.tick()))
        lifted.append(clocks(session))
    return np.stack(points), np.stack(lifted)


@pytest.mark.parametrize("speed", [0.1, 0.3, 0.5])
def test_a_foot_of_a_slow_walk_stands_or_is_lifted(model: SteerModel, speed: float) -> None:
    points, lifted = slow_walks(model, speed)
    balls = points[..., 1, :]
    heights = points[..., 1].min(axis=3)
    # a foot swings only while the other stands
    assert (lifted >= 0).all()
    assert (lifted == 0).any(axis=2).all()
    # none moves on the ground
    speeds = np.linalg.norm(np.diff(balls[..., [0, 2]], axis=0), axis=3) / DT
    assert not ((speeds > 0.15) & (balls[1:, ..., 1] < 0.01)).any()
    # each is lifted in the middle of its swing, and all take steps
    middle = (lifted > SETTINGS.swing / 2) & (lifted < SETTINGS.swing)
    assert heights[middle].min() > 0.9 * SETTINGS.lowest
    assert middle.any(axis=0).all()


def test_stops_end_in_balance_and_without_another_step(model: SteerModel) -> None:
    session = model.start(characters=len(DIRECTIONS))
    session.control(speed=1.2, direction=DIRECTIONS)
    for _ in range(60):
        session.tick()
    session.control(speed=0.0)
    poses = [session.tick() for _ in range(180)]
    left, right, neck = (poses[75].positions()[:, HUMANOID.index(name)] for name in ("leftFoot", "rightFoot", "neck"))
    way = neck - (left + right) / 2
    assert np.degrees(np.arctan2(np.hypot(way[:, 0], way[:, 2]), way[:, 1])).max() < 4
    heights = np.stack([soles(pose)[..., 1].min(axis=2) for pose in poses[75:]])
    assert heights.max() < 0.01


def test_a_walk_at_its_usual_speed_has_no_planned_steps(model: SteerModel) -> None:
    session = model.start(characters=2)
    session.control(speed=[0.7, 1.2], direction=[30.0, -90.0], facing=0.0)
    for _ in range(60):
        session.tick()
    for _ in range(30):
        session.tick()
        assert (clocks(session) == FREE).all()


def test_a_figure_steps_alone_as_among_others(model: SteerModel) -> None:
    def walk(speeds: list[float]) -> Array:
        session = model.start(characters=len(speeds))
        session.control(speed=speeds, direction=100.0, facing=0.0)
        before = [session.tick().rotations for _ in range(60)]
        session.control(speed=0.0, facing=40.0)
        return np.stack([*before, *(session.tick().rotations for _ in range(60))])

    np.testing.assert_allclose(walk([0.3])[:, 0], walk([1.2, 0.3])[:, 1], rtol=0, atol=1e-6)


def footing(distance: float, clock: float = 0.0, stands: bool = True) -> Footing:
    return Footing(distance, clock, stands, is_left=True)


def test_a_foot_that_strays_is_put_down_ahead_of_its_drift() -> None:
    plan = Plan(SETTINGS, plans=True, settled=False)
    step = Step(0.16, 0.0, 0.2, 0.0, 0.0, 0.0, 0.0)
    other = footing(0.0)
    assert stepped(step, footing(0.16), other._replace(clock=0.1), (0.0, 0.0), plan, DT).clock == 0
    assert stepped(step, footing(0.14), other, (0.0, 0.0), plan, DT).clock == 0
    shifts, lifts = list[float](), list[float]()
    for _ in range(SWING_TICKS):
        # the pose moves on as it has done so far
        step = stepped(step, footing(step.shift_x, step.clock), other, (-0.2 * DT, 0.0), plan, DT)
        shifts.append(step.shift_x)
        lifts.append(lift_of(step, plan))
    assert step.clock == 0
    assert shifts[-1] == pytest.approx(-0.2 * SETTINGS.leads)
    assert lifts[-1] == 0
    assert SETTINGS.lowest < lifts[0] < SETTINGS.highest
    # over the ground it begins and ends slowly
    moves = np.abs(np.diff([0.16, *shifts]) - 0.2 * DT)
    assert moves.argmax() in range(4, 9)
    assert moves[0] < moves.max() / 10


def test_a_settled_foot_steps_to_where_its_pose_has_it() -> None:
    plan = Plan(SETTINGS, plans=True, settled=True)
    step = Step(0.05, -0.04, 0.3, 0.3, 0.0, 0.0, 0.0)
    for _ in range(SWING_TICKS):
        step = stepped(step, footing(0.064, step.clock), footing(0.0), (0.0, 0.0), plan, DT)
    assert (step.shift_x, step.shift_z, step.clock) == pytest.approx((0, 0, 0))
    near = replace(SETTINGS, settles=0.1)
    again = stepped(Step(0.05, 0, 0, 0, 0, 0, 0.0), footing(0.05), footing(0), (0, 0), plan._replace(settings=near), DT)
    assert again.clock == 0
