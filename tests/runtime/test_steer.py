"""Figures that are steered: they go where they are told, alone as in a crowd, and refuse what makes no sense."""

import pickle
from typing import Any

import numpy as np
import pytest

from motet import ControlError, ControlWarning, SteerModel, load
from motet.figures.humanoid.bones import HUMANOID
from motet.motion.kinematics import positions
from motet.motion.rotations import wrapped
from motet.steering import step as steering
from motet.steering.matching import Playback
from motet.steering.pose import Pose

pytestmark = pytest.mark.numeric


@pytest.fixture(scope="module")
def model() -> SteerModel:
    return load("control")


def walked(model: SteerModel, ticks: int, **control: float) -> list[Pose]:
    session = model.start()
    session.control(**control)
    return [session.tick() for _ in range(ticks)]


@pytest.mark.parametrize(("gait", "speed"), [("walk", 0.8), ("walk", 1.5), ("run", 3.0), ("run", 4.0)])
def test_it_goes_as_fast_and_where_it_is_told(model: SteerModel, gait: str, speed: float) -> None:
    session = model.start(gait)
    session.control(speed=speed, direction=60)
    poses = [session.tick() for _ in range(90)]
    velocity = (poses[-1].ground - poses[-31].ground)[0, :2]
    assert np.hypot(*velocity) == pytest.approx(speed, rel=0.1)
    assert np.degrees(np.arctan2(velocity[0], velocity[1])) == pytest.approx(60, abs=5)
    assert np.degrees(poses[-1].ground[0, 2]) == pytest.approx(60, abs=8)


@pytest.mark.parametrize("gait", ["walk", "run"])
def test_the_slowest_that_a_gait_goes_is_no_standing_whatever_is_faced(model: SteerModel, gait: str) -> None:
    ways, facings = (part.ravel() for part in np.meshgrid(np.arange(0, 360, 30), np.arange(0, 360, 30)))
    session = model.start(characters=len(ways))
    session.control(gait=gait, speed=max(0.2, model.speeds[gait][0]), direction=ways, facing=facings)
    places = np.array([session.tick().ground[:, :2] for _ in range(150)])
    paces = 30 * np.linalg.norm(np.diff(places[60:], axis=0), axis=2).mean(axis=0)
    assert (paces / np.linalg.norm(session.target[:, :2], axis=1)).min() > 0.5


def test_who_flies_lands_as_recorded_whatever_is_told_meanwhile(model: SteerModel) -> None:
    session = model.start(characters=4)
    session.control(gait="jump")
    while session.tick().contacts.max() > 0.1:
        pass
    session.control(gait="walk", speed=[0.2, 0.4, 0.55, 1.4])  # slow walks are played at rates of their own
    rows, rates = [], []
    while session.tick().contacts.max() < 0.1:
        rows.append(session._state.playback.row.copy())
        rates.append(session._state.playback.rate.copy())
    assert len(rows) > 8
    assert (np.diff(rows, axis=0) == 1).all()
    assert np.all(np.array(rates) == 1)


def test_it_walks_backwards_and_stands_still(model: SteerModel) -> None:
    session = model.start()
    session.control(speed=1.0, direction=180, facing=0)
    poses = [session.tick() for _ in range(60)]
    assert poses[-1].ground[0, 1] < -1
    assert abs(np.degrees(poses[-1].ground[0, 2])) < 15
    session.control(speed=0)
    poses = [session.tick() for _ in range(90)]
    assert np.hypot(*(poses[-1].ground - poses[-31].ground)[0, :2]) < 0.1
    assert poses[-1].contacts.min() > 0.5


def test_a_gait_that_only_goes_forward_goes_a_curve_to_what_is_behind(model: SteerModel) -> None:
    """Instead of turning on the spot, for which no skip is recorded."""
    session = model.start("skip", characters=4)
    session.control(speed=1.2, direction=[180, -150, 120, 0])
    poses = [session.tick() for _ in range(120)]
    steps = np.linalg.norm(np.diff([pose.ground[:, :2] for pose in poses[:60]], axis=0), axis=2)
    assert steps.sum(axis=0).min() > 1.2  # metres in two seconds
    x, z = (poses[-1].ground - poses[-31].ground)[:, :2].T
    off = np.degrees(wrapped(np.arctan2(x, z) - np.radians([180, -150, 120, 0])))
    assert np.abs(off).max() < 15


def test_targets_of_gaits_that_go_any_way_are_left_and_others_are_near_the_facing(model: SteerModel) -> None:
    rng, gaits = np.random.default_rng(0), np.array([0, model.gaits.index("skip")] * 20)
    target, facing = rng.normal(size=(40, 3)) * 2, rng.uniform(-3, 3, 40)
    target[::8, :2] = 0
    found = model.abilities.curved(target, gaits, facing)
    stays = (gaits == 0) | (target[:, :2] == 0).all(axis=1)
    assert np.array_equal(found[stays], target[stays])
    led, goes = found[~stays], target[~stays]
    assert np.allclose(np.hypot(*led[:, :2].T), np.hypot(*goes[:, :2].T))
    most = model.abilities.settings.ahead + 1e-9
    for angle in (np.arctan2(*led[:, :2].T), led[:, 2]):
        assert np.abs(wrapped(angle - facing[~stays])).max() <= most


def test_each_of_many_searches_in_its_turn_and_moves_as_it_would_alone(
    model: SteerModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    count, every = 44, model.matcher.settings.search_every
    ways = np.linspace(-180, 180, count)
    crowd = model.start(characters=count)
    who = [0, 5, 13, 43]
    alone = [model.start(phases=n % every) for n in who]
    sizes: list[int] = []
    best = model.matcher.best
    for turn, gait in ((0, "walk"), (90, "run")):
        crowd.control(gait=gait, speed=1.5, direction=ways + turn)
        for session, n in zip(alone, who, strict=True):
            session.control(gait=gait, speed=1.5, direction=ways[n] + turn)
        for _ in range(40):
            with monkeypatch.context() as patch:
                patch.setattr(model.matcher, "best", lambda query, kind: sizes.append(len(kind)) or best(query, kind))
                together = crowd.tick()
            for session, n in zip(alone, who, strict=True):
                one = session.tick()
                for part in ("ground", "height", "rotations", "contacts"):
                    np.testing.assert_array_equal(getattr(together, part)[n], getattr(one, part)[0])
    assert set(sizes) == {count // every, count // every + 1}  # in every tick as many
    assert np.hypot(*together.ground[:, :2].T).min() > 1


@pytest.mark.parametrize("phases", [6, -1, 0.5, [0, 1, 2], "one", [0, np.nan]])
def test_phases_that_make_no_sense(model: SteerModel, phases: Any) -> None:
    with pytest.raises(ControlError, match="phases must be whole numbers from 0 to 5, for all or for each of 2"):
        model.start(characters=2, phases=phases)


def test_feet_that_are_held_slide_less(model: SteerModel) -> None:
    def slide(hold_feet: bool) -> float:
        session = model.start(hold_feet=hold_feet)
        session.control(speed=1.6)
        poses = [session.tick() for _ in range(150)]
        toes = np.stack([pose.positions()[0, HUMANOID.index("leftToes")] for pose in poses])
        stands = np.array([pose.contacts[0, 0] > 0.9 for pose in poses])
        steps = np.linalg.norm(np.diff(toes[:, [0, 2]], axis=0), axis=1)
        return float(steps[stands[1:] & stands[:-1]].mean())

    assert slide(True) < 0.5 * slide(False)


def test_between_ticks_a_display_sees_what_lies_between(model: SteerModel) -> None:
    ticking, shown = model.start(), model.start()
    for session in (ticking, shown):
        session.control(speed=1.4)
    ticks = [ticking.tick() for _ in range(12)]
    for tick in range(10):
        np.testing.assert_allclose(shown.advance(0).ground, ticks[tick].ground, atol=1e-5)
        middle = shown.advance(0.5 / model.fps)
        np.testing.assert_allclose(middle.ground, (ticks[tick].ground + ticks[tick + 1].ground) / 2, atol=1e-5)
        np.testing.assert_allclose(np.linalg.norm(middle.rotations, axis=-1), 1, atol=1e-5)
        shown.advance(0.5 / model.fps)


def test_poses_are_the_motion_that_a_script_gives(model: SteerModel) -> None:
    session = model.start(hold_feet=False)
    session.control(speed=1.2, direction=30)
    poses = [session.tick() for _ in range(40)]
    motion = model.contract.motion(session.frames_of(poses)[0], plant=False)
    found, seen = positions(motion), np.stack([pose.positions()[0] for pose in poses])
    # the motion begins at the origin and faces z
    shape = np.linalg.norm(found[:, :, None] - found[:, None], axis=-1)
    np.testing.assert_allclose(shape, np.linalg.norm(seen[:, :, None] - seen[:, None], axis=-1), atol=1e-4)
    way = np.linalg.norm(np.diff(found[:, 0], axis=0), axis=1)
    np.testing.assert_allclose(way, np.linalg.norm(np.diff(seen[:, 0], axis=0), axis=1), atol=1e-4)


def test_it_is_pushed_put_and_bent(model: SteerModel) -> None:
    session = model.start(characters=2)
    session.put([[1, 2, 90], [-1, 0, 0]])
    np.testing.assert_allclose(session.tick().ground[:, :2], [[1, 2], [-1, 0]], atol=0.01)
    session.push((4, 0))
    pushed = [session.tick() for _ in range(60)]
    assert (pushed[-1].ground[:, 0] - [1, -1] > 0.1).all()
    assert np.abs(pushed[-1].ground - pushed[-10].ground).max() < 0.05  # caught
    other = model.start("zombie")
    other.control(speed=0.5)
    zombie = [other.tick() for _ in range(30)][-1]
    session.take(zombie)
    bent = session.tick()
    distance = np.abs(bent.rotations - zombie.rotations).max()
    assert distance < 0.4
    for _ in range(40):
        bent = session.tick()
    assert np.abs(bent.rotations - zombie.rotations).max() > distance


def test_a_figure_that_is_put_elsewhere_leaves_earlier_poses_where_they_were(model: SteerModel) -> None:
    session = model.start()
    session.control(speed=1.4)
    pose = session.advance(0.5)
    before, place = session.tick(), pose.ground.copy()
    ground = before.ground.copy()
    session.put([50, 0, 90])
    np.testing.assert_array_equal(before.ground, ground)
    np.testing.assert_array_equal(pose.ground, place)
    # nor does a display see it fly there
    np.testing.assert_allclose(session.advance(0.01).ground[0], [50, 0, np.pi / 2], atol=0.1)


def test_a_crowd_that_is_told_nothing_stands_as_one_does(model: SteerModel) -> None:
    alone, crowd = model.start(), model.start(characters=8)
    for _ in range(40):
        one, all_of_them = alone.tick(), crowd.tick()
    np.testing.assert_allclose(all_of_them.rotations, np.repeat(one.rotations, 8, axis=0), atol=1e-5)


def test_it_goes_on_from_a_motion(model: SteerModel) -> None:
    walk = model.run("walk 2s speed 1.4")
    session = model.start(walk)
    np.testing.assert_allclose(
        session.tick().positions()[0, :, 1], positions(model.contract.on_figure(walk))[-1, :, 1], atol=0.06
    )


def test_a_speed_that_a_gait_does_not_have(model: SteerModel) -> None:
    session = model.start()
    with pytest.warns(ControlWarning, match="'walk' allows 0 or 0.1-1.92 m/s in this direction, not 20") as caught:
        session.control(speed=20)
    assert [warning.filename for warning in caught] == [__file__]
    session.control(speed=21)  # said once
    poses = [session.tick() for _ in range(60)]
    assert np.hypot(*(poses[-1].ground - poses[-31].ground)[0, :2]) < 2.5
    with pytest.raises(ControlError, match="not 20"):
        model.start(strict=True).control(speed=20)


@pytest.mark.parametrize(
    ("control", "reason"),
    [
        ({"speed": np.nan}, "speed must be finite numbers"),
        ({"direction": np.inf}, "direction must be finite numbers"),
        ({"speed": [1, 2, 3]}, "one for each of 2 characters"),
        ({"gait": "swim"}, "unknown gait 'swim'; expected one of walk, run"),
        ({"gait": 3}, "unknown gait 3; expected one of walk, run"),
        ({"gait": ["walk"]}, "1 gaits do not fit 2 characters"),
        ({"velocity": (1, 2, 3)}, "a velocity needs x and z"),
        ({"velocity": (1, 2), "speed": 1}, "not both"),
        ({"velocity": (np.nan, 2)}, "a velocity must be finite numbers"),
        ({"facing": "left"}, "facing needs a number"),
    ],
)
def test_what_is_told_is_refused_and_changes_nothing(
    model: SteerModel, control: dict[str, object], reason: str
) -> None:
    session, other = (model.start(characters=2) for _ in range(2))
    with pytest.raises(ControlError, match=reason):
        session.control(**control)  # type: ignore[arg-type]
    for _ in range(3):
        np.testing.assert_array_equal(session.tick().ground, other.tick().ground)


def test_sessions_and_poses_that_make_no_sense(model: SteerModel) -> None:
    for count in (0, 1_000_000, 2.5, "two"):
        with pytest.raises(ControlError, match="characters must be a whole number from 1 to 100000"):
            model.start(characters=count)  # type: ignore[arg-type]
    for start in (3, object()):
        with pytest.raises(ControlError, match="unknown gait"):
            model.start(start)  # type: ignore[arg-type]
    session = model.start(characters=2)
    pose = session.tick()
    with pytest.raises(ControlError, match="does not fit 2 characters"):
        session.take(Pose(pose.ground, pose.rotations[:, :5], pose.height, pose.contacts))
    with pytest.raises(ControlError, match="a pose must be finite numbers"):
        session.take(Pose(pose.ground, pose.rotations * np.float32(np.nan), pose.height, pose.contacts))
    with pytest.raises(ControlError, match="advances by 0 to 1 s"):
        session.advance(5)
    with pytest.raises(ControlError, match="places need x, z and facing"):
        session.put([1, 2])


def test_a_velocity_of_no_length_stops_and_faces_as_before(model: SteerModel) -> None:
    session = model.start()
    session.control(velocity=(1.0, 1.0))
    for _ in range(60):
        pose = session.tick()
    assert np.degrees(pose.ground[0, 2]) == pytest.approx(45, abs=8)
    session.control(velocity=(0, 0))
    for _ in range(60):
        pose = session.tick()
    assert np.degrees(pose.ground[0, 2]) == pytest.approx(45, abs=8)


@pytest.mark.parametrize(
    "orders",
    [
        [{"direction": 90}, {"speed": 1.3}],
        [{"speed": 1.3, "direction": 90}, {"speed": 0}, {"speed": 1.3}],
        [{"velocity": (1.3, 0)}, {"velocity": (0, 0)}, {"speed": 1.3}],
        [{"gait": "run", "direction": 90}, {"gait": "walk"}, {"speed": 1.3}],
    ],
)
def test_a_figure_that_stands_remembers_its_direction(model: SteerModel, orders: list[dict[str, Any]]) -> None:
    session = model.start()
    for order in orders:
        session.control(**order)
        session.tick()
    np.testing.assert_allclose(session.target[0], [1.3, 0, np.pi / 2], atol=1e-9)


def test_a_side_step_goes_on_after_a_stop(model: SteerModel) -> None:
    session = model.start()
    session.control(speed=1.0, direction=90, facing=0)
    before = session.target
    session.control(speed=0)
    np.testing.assert_array_equal(session.target, np.zeros((1, 3)))
    session.control(speed=1.0)
    np.testing.assert_array_equal(session.target, before)
    session.control(direction=180)
    np.testing.assert_allclose(np.abs(session.target), [[0, 1, np.pi]], atol=1e-9)  # it faces where it goes again


def test_a_speed_that_one_gait_lacks_is_remembered_for_another(model: SteerModel) -> None:
    session = model.start()
    with pytest.warns(ControlWarning, match="'walk' allows 0 or 0.1-1.92 m/s"):
        session.control(speed=3.0)
    session.control(gait="run")
    assert session.target[0, 1] == pytest.approx(3.0)


def test_a_figure_that_is_set_down_goes_where_it_faces(model: SteerModel) -> None:
    session = model.start(places=(0, 0, 90))
    session.control(speed=1.0)
    np.testing.assert_allclose(session.target, [[1, 0, np.pi / 2]], atol=1e-9)


def test_a_snapshot_is_the_state_alone(model: SteerModel) -> None:
    session = model.start()
    session.control(speed=1.4)
    session.advance(0.5)
    assert len(pickle.dumps(session.snapshot())) < 9_000  # the model's tables are 10 MB
    again = pickle.loads(pickle.dumps(session.snapshot()))
    other = model.start()
    other.restore(again)
    np.testing.assert_array_equal(other.advance(0.3).rotations, session.advance(0.3).rotations)


def test_a_snapshot_holds_what_was_told(model: SteerModel) -> None:
    session, other = model.start(), model.start()
    session.control(direction=90)
    other.restore(session.snapshot())
    other.control(speed=1.3)
    np.testing.assert_allclose(other.target[0], [1.3, 0, np.pi / 2], atol=1e-9)
    for held in (True, False):
        with pytest.raises(ControlError, match="held feet does not fit"):
            model.start(hold_feet=not held).restore(model.start(hold_feet=held).snapshot())


@pytest.mark.parametrize("away", [1e5, 1e6])
def test_far_from_the_origin_it_moves_as_near_it(model: SteerModel, away: float) -> None:
    near, far = model.start(), model.start(places=(away, -away, 0))
    for session in (near, far):
        session.control(speed=1.3)
    for _ in range(60):
        here, there = near.tick(), far.tick()
        np.testing.assert_allclose(there.ground - (away, -away, 0), here.ground, atol=1e-7)
        np.testing.assert_allclose(there.rotations, here.rotations, atol=1e-5)
        np.testing.assert_allclose(there.positions() - (away, 0, -away), here.positions(), atol=1e-5)


def test_the_last_rows_of_a_long_table_are_played_at_any_rate(model: SteerModel) -> None:
    """A row is a whole number and a part of the next: a rate is kept to the bit wherever it is played."""
    playback = Playback.at(9000, 1, model.matcher.table.codes)
    playback.rate = np.array([0.8123])
    playback.ticks_to_search = np.array([100])
    playback.spring = np.array([[0.0, 0.0, 0.0]])
    steering.tick(model.matcher, model.pose_codes, playback, np.zeros((1, 3)), np.zeros(1, np.int64))
    assert playback.row[0] + playback.part[0] == 9000.8123
