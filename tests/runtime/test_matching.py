"""Motion matching against naive twins: search, desired trajectory, mirror images; poses in codes; quaternions."""

from dataclasses import replace

import numpy as np
import pytest

import motet
from motet.figures.humanoid import BONES, HUMANOID, LEFT_RIGHT
from motet.motion.rotations import conjugate, quat_product, quat_rotated, quat_to_rotmat, wrapped
from motet.steering.matching import (
    FEATURES,
    TRAJECTORY,
    Matcher,
    Playback,
    Query,
    Table,
    horizons,
    mirrored_features,
    stride_velocities,
)
from motet.steering.pose import Pose
from motet.steering.settings import SteeringSettings
from motet.steering.step import PoseCodes
from motet.steering.warping import UNDER, strided, warped

pytestmark = pytest.mark.numeric

SETTINGS = SteeringSettings()
ROWS, CODES = 300, 4


@pytest.fixture(scope="module")
def table() -> Table:
    rng = np.random.default_rng(0)
    features = rng.normal(size=(ROWS, FEATURES)).astype(np.float32)
    frames = rng.normal(size=(ROWS, CODES + 6)).astype(np.float32)
    shows = np.stack([np.arange(ROWS) < 200, np.arange(ROWS) >= 100], axis=1)
    left = np.tile(np.arange(100)[::-1], 3)
    scaling = {"mean": np.zeros(FEATURES), "scale": np.ones(FEATURES)}
    return Table.of(frames, features, 2, shows=shows, left=left, **scaling)


@pytest.fixture(scope="module")
def matcher(table: Table) -> Matcher:
    return Matcher(table, SETTINGS, 30.0)


def test_the_search_finds_what_looking_at_every_row_finds(table: Table, matcher: Matcher) -> None:
    rng = np.random.default_rng(1)
    asked, gait = rng.normal(size=(20, FEATURES)).astype(np.float32), rng.integers(2, size=20)
    asked = np.round(asked * Matcher.STEPS).astype(np.float32) / Matcher.STEPS
    rows, mirrors, costs = matcher.best(matcher.query(asked), gait)
    columns, signs = mirrored_features()
    for wanted, kind, row, mirror, cost in zip(asked, gait, rows, mirrors, costs, strict=True):
        usable = [i for i in range(ROWS) if table.shows[i, kind] and table.left[i] >= SETTINGS.lasting]
        usable = [i for i in usable if table.frames[0, i, -2:].max() >= SETTINGS.stands][:: SETTINGS.row_step]
        found = {}
        for i in usable:
            for image in (0, 1):
                features = table.features[0, i][columns] * signs if image else table.features[0, i]
                far = float(np.hypot(*wanted[4:6]))  # here neither mean nor scale
                lag = max(0.0, far / 2 - float(features[4:6] @ wanted[4:6]) / far)
                found[i, image] = float(((features - wanted) ** 2).sum() / 2 + SETTINGS.lag * lag)
        assert (row, mirror) == min(found, key=found.__getitem__)
        assert cost + float((wanted**2).sum()) / 2 == pytest.approx(min(found.values()), rel=1e-3)
    np.testing.assert_allclose(matcher.cost_at(matcher.query(asked), rows, mirrors), costs, atol=1e-3)


def test_leaps_are_entered_well_before_they_fly(table: Table) -> None:
    frames = table.frames.copy()
    frames[:, :, -2:], frames[:, :, -3] = 1.0, 0.7
    frames[:, 50:60, -2:] = frames[:, 150:160, -2:] = 0.0
    frames[:, 100:, -3] = 0.0  # played at their own rate
    goals = Matcher(replace(table, frames=frames), replace(SETTINGS, row_step=1, prepares=9), 30.0).goals
    assert [set(range(35, 75)) - set(one.rows.tolist()) for one in goals[:1]] == [set(range(50, 60))]
    assert set(range(135, 175)) - set(goals[1].rows.tolist()) == set(range(141, 160))


def test_costs_are_the_same_bits_alone_and_in_blocks_in_any_order() -> None:
    matcher = motet.load("control").matcher
    rng = np.random.default_rng(5)
    goals = matcher.goals[0]
    asked = matcher.table.features[0, rng.choice(goals.rows, 70)] + rng.normal(size=(70, FEATURES), scale=3)
    asked[0] = 100  # far more than there is
    query, gait = matcher.query(asked.astype(np.float32)), rng.integers(2, size=70)
    together = matcher.best(query, gait)
    for order in (rng.permutation(70), [3], [0]):
        for found, wanted in zip(
            matcher.best(Query(*(part[order] for part in query)), gait[order]), together, strict=True
        ):
            np.testing.assert_array_equal(found, wanted[order])
    np.testing.assert_array_equal(matcher.cost_at(query, *together[:2]), together[2])
    exact = query.features.astype(np.float64) @ goals.costs.astype(np.float64)
    np.testing.assert_array_equal(query.features @ goals.costs, exact)
    np.testing.assert_array_equal(query.lags @ goals.lags, query.lags.astype(np.float64) @ goals.lags)


def test_a_mirror_image_of_a_mirror_image_is_the_row(table: Table) -> None:
    scaling = {"mean": table.mean, "scale": table.scale}
    again = Table.of(table.frames[1], table.features[1], 2, shows=table.shows, left=table.left, **scaling)
    np.testing.assert_array_equal(again.frames, table.frames[::-1])
    np.testing.assert_array_equal(again.features, table.features[::-1])
    row, image = table.frames[:, 7]
    np.testing.assert_array_equal(image, row[[0, 1, 2, 3, 4, 5, 6, 7, 9, 8]] * [1, 1, -1, -1, 1, -1, -1, 1, 1, 1])


def test_a_row_goes_where_its_recording_goes_for_a_stride(table: Table) -> None:
    moves = table.frames[0, :, -6:-4]
    expected = [
        moves[max(n // 100 * 100, n - 15) : min(n // 100 * 100 + 100, n + 16)].mean(axis=0) for n in range(ROWS)
    ]
    np.testing.assert_allclose(stride_velocities(moves, table.left), expected, atol=1e-6)
    forward, left = np.array(expected).T
    np.testing.assert_allclose(table.way, [np.arctan2(left, forward), -np.arctan2(left, forward)], atol=1e-5)


def test_hips_and_legs_are_turned_and_what_the_spine_carries_stays() -> None:
    model = motet.load("control")
    session = model.start(characters=3)
    session.control(gait="run", speed=3.0)
    pose = [session.tick() for _ in range(40)][-1]
    angles = np.array([0.8, 0.0, -0.5])
    turned = Pose(pose.ground, warped(pose.rotations, angles), pose.height, pose.contacts)
    (quats, places), (before, old) = turned.global_transforms(), pose.global_transforms()
    about = np.stack([0 * angles, np.sin(angles / 2), 0 * angles, np.cos(angles / 2)], axis=1)
    hips = old[:, :1]
    for name in BONES:
        bone = HUMANOID.index(name)
        if name == "hips" or name.endswith(("Leg", "Foot", "Toes")):
            expected = quat_product(about, before[:, bone])
            np.testing.assert_allclose(
                places[:, bone], (hips + quat_rotated(about, old[:, bone] - hips[:, 0])[:, None])[:, 0], atol=1e-5
            )
        elif name in ("spine", "chest"):
            continue  # on the way back
        else:
            expected = before[:, bone]
        np.testing.assert_allclose(np.abs((quats[:, bone] * expected).sum(axis=1)), 1, atol=1e-5)
    np.testing.assert_array_equal(turned.rotations[1], pose.rotations[1])
    for one in range(3):  # the same bits alone
        np.testing.assert_array_equal(
            warped(pose.rotations[one : one + 1], angles[one : one + 1])[0], turned.rotations[one]
        )


def test_balls_of_the_feet_are_led_towards_the_hips_and_soles_keep_their_height() -> None:
    session = motet.load("control").start(characters=4, hold_feet=False)
    session.control(speed=1.2)
    pose = [session.tick() for _ in range(40)][-1]
    strides = np.array([0.5, 0.2, 1.0, 0.6])
    rotations = strided(pose.rotations, pose.contacts, strides)
    zero = np.zeros((4, 3))
    places, before = (
        Pose(zero, turns, pose.height, pose.contacts).positions() for turns in (rotations, pose.rotations)
    )
    for side, hip in (("left", 0.09), ("right", -0.09)):
        foot = HUMANOID.index(f"{side}Foot")
        moved = places[:, foot] - before[:, foot]
        np.testing.assert_allclose(moved[:, 1], 0, atol=0.01)
        ball = before[:, HUMANOID.index(f"{side}Toes")][:, [0, 2]] - [hip, UNDER]
        far = (strides - 1)[:, None] * ball
        np.testing.assert_allclose(moved[:, [0, 2]], far, atol=0.015)  # a knee that is nearly straight gives way
    np.testing.assert_array_equal(rotations[2], pose.rotations[2])
    for one in range(4):  # the same bits alone
        alone = slice(one, one + 1)
        again = strided(pose.rotations[alone], pose.contacts[alone], strides[alone])[0]
        np.testing.assert_array_equal(again, rotations[one])


def test_feet_of_slow_walks_do_not_leap_with_the_row_that_is_played() -> None:
    session, rng = motet.load("control").start(characters=20, hold_feet=False, phases=0), np.random.default_rng(2)
    poses = []
    for _ in range(12):
        way, faces = rng.uniform(-180, 180, (2, 20))
        session.control(speed=rng.uniform(0.1, 0.6, 20), direction=way, facing=faces)
        poses += [session.tick() for _ in range(15)]
    seen = [Pose(np.zeros((20, 3)), pose.rotations, pose.height, pose.contacts) for pose in poses]
    feet = np.stack([pose.positions()[:, [HUMANOID.index(f"{side}Foot") for side in LEFT_RIGHT]] for pose in seen])
    assert np.linalg.norm(np.diff(feet, axis=0), axis=-1).max() < 0.2


def test_a_walk_goes_as_slowly_as_it_is_told_and_its_feet_stay() -> None:
    asked = np.array([0.1, 0.2, 0.35, 0.5, 0.6])
    session = motet.load("control").start(characters=len(asked), strict=True)
    session.control(gait="walk", speed=asked)
    poses = [session.tick() for _ in range(240)][90:]
    ground = np.stack([pose.ground for pose in poses])
    np.testing.assert_allclose((ground[-1, :, 1] - ground[0, :, 1]) / 149 * 30, asked, atol=0.03)
    balls = np.stack([pose.positions()[:, HUMANOID.index("leftToes")] for pose in poses])
    steps, rises = np.diff(balls, axis=0), np.diff(balls[..., 1], axis=0)
    still = (np.hypot(steps[..., 0], steps[..., 2]) < 0.002) & (np.abs(rises) < 0.002)
    assert (still.mean(axis=0) > 0.2).all()  # feet stand, and do not only slow down
    lifted = balls[..., 1].max(axis=0) - balls[..., 1].min(axis=0)
    assert (lifted > 0.03).all()  # and they are steps


@pytest.mark.filterwarnings("ignore::motet.errors.ControlWarning")
@pytest.mark.parametrize(("gait", "speed", "most"), [("walk", 1.28, 6.0), ("run", 2.0, 8.0)])
def test_figures_that_face_ahead_go_where_they_are_told(gait: str, speed: float, most: float) -> None:
    asked = np.arange(-180.0, 180.0, 15.0)
    session = motet.load("control").start(gait, characters=len(asked), phases=0)
    session.control(speed=speed, direction=asked, facing=0.0)
    ground = np.stack([session.tick().ground for _ in range(180)])
    x, z = (ground[-1] - ground[60])[:, :2].T
    off = np.abs(np.degrees(wrapped(np.arctan2(x, z) - np.radians(asked))))
    assert (off.max() < most, off.mean() < 2) == (True, True), off


def test_a_jump_is_not_seen_and_fades(matcher: Matcher) -> None:
    playback = Playback.at(10, 3, CODES)
    before, _ = matcher.table.at(playback)
    matcher.jump(playback, np.array([0, 2]), np.array([50, 120]), np.array([1, 0]))
    after, _ = matcher.table.at(playback)
    np.testing.assert_array_equal(playback.row, [50, 10, 120])
    np.testing.assert_allclose(after[:, :CODES] + playback.offset, before[:, :CODES], atol=1e-12)
    np.testing.assert_array_equal(playback.offset[1], 0)


def test_the_desired_trajectory_is_where_the_springs_lead(matcher: Matcher) -> None:
    rng = np.random.default_rng(2)
    playback, target = Playback.at(0, 3, CODES), rng.normal(size=(3, 3))
    playback.root, playback.spring, playback.spring_rate = rng.normal(size=(3, 3, 3))
    found = matcher.desired_trajectory(playback, target, np.zeros(3, dtype=bool))
    dt, damping = 1e-4, [2 * np.log(2) / half for half in (SETTINGS.velocity, SETTINGS.facing)]
    for row in range(3):
        *velocity, angle = playback.spring[row]
        *change, rate = playback.spring_rate[row]
        velocity, change, place, time = np.array(velocity), np.array(change), np.zeros(2), 0.0
        for number, ahead in enumerate(horizons(SETTINGS)):
            while time < ahead - dt / 2:
                pull = -(damping[0] ** 2) * (velocity - target[row, :2]) - 2 * damping[0] * change
                place, velocity, change = place + dt * velocity, velocity + dt * change, change + dt * pull
                turn = -(damping[1] ** 2) * (angle - target[row, 2]) - 2 * damping[1] * rate
                angle, rate, time = angle + dt * rate, rate + dt * turn, time + dt
            facing = playback.root[row, 2]
            cos, sin = np.cos(facing), np.sin(facing)
            seen = [cos * place[0] - sin * place[1], sin * place[0] + cos * place[1]]
            np.testing.assert_allclose(found[row, 2 * number : 2 * number + 2], seen, atol=2e-3)
            turned = [np.sin(angle - facing), np.cos(angle - facing)]
            at = TRAJECTORY // 2 + 2 * number
            np.testing.assert_allclose(found[row, at : at + 2], turned, atol=2e-3)
            if number == 1:
                speed = np.hypot(*velocity)
                assert found[row, -1] == pytest.approx(speed / (speed + SETTINGS.half_speed), abs=2e-3)


def test_codes_of_a_pose_come_back_from_it() -> None:
    rng = np.random.default_rng(4)
    quats = rng.normal(size=(5, 3, 4)) + np.array([0, 0, 0, 9])
    quats /= np.linalg.norm(quats, axis=-1, keepdims=True)
    values = np.column_stack([quats.reshape(5, 12), rng.normal(size=5)])
    poses = PoseCodes(values.mean(axis=0), rng.normal(size=(13, 13)).astype(np.float16).astype(np.float64))
    codes = poses.encode(-quats.astype(np.float32), values[:, -1].astype(np.float32))
    rotations, height = poses.decode(codes)
    np.testing.assert_allclose(rotations, quats, atol=1e-5)
    np.testing.assert_allclose(height, values[:, -1], atol=1e-5)
    for one in range(5):
        np.testing.assert_array_equal(poses.decode(codes[one : one + 1])[0][0], rotations[one])


def test_quaternions_turn_as_matrices_do() -> None:
    rng = np.random.default_rng(3)
    a, b = (q / np.linalg.norm(q, axis=-1, keepdims=True) for q in rng.normal(size=(2, 6, 4)))
    vectors = rng.normal(size=(6, 3))
    np.testing.assert_allclose(quat_to_rotmat(quat_product(a, b)), quat_to_rotmat(a) @ quat_to_rotmat(b), atol=1e-12)
    turned = (quat_to_rotmat(a) @ vectors[..., None])[..., 0]
    np.testing.assert_allclose(quat_rotated(a, vectors), turned, atol=1e-12)
    np.testing.assert_allclose(quat_to_rotmat(conjugate(a)), np.swapaxes(quat_to_rotmat(a), -1, -2), atol=1e-12)
    np.testing.assert_allclose(wrapped(np.array([3.5, -3.5, 7.0])), [3.5 - 2 * np.pi, 2 * np.pi - 3.5, 7 - 2 * np.pi])
