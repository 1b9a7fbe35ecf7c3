"""Steered figures that go to points and along paths, and what happens to them on the way."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from motet import ControlError, SteerModel, load
from motet.steering.paths import Paths


@pytest.fixture(scope="module")
def model() -> SteerModel:
    return load("control")


def test_points_of_paths_are_those_of_interpolation_along_each() -> None:
    rng = np.random.default_rng(5)
    paths = [rng.normal(size=(n, 2)) for n in (2, 7, 3)] + [
        np.ones((2, 2)),
        np.repeat(rng.normal(size=(2, 2)), 3, axis=0),
    ]
    laid = Paths.of(paths)
    for share in (-0.1, 0.0, 0.31, 0.77, 1.0, 1.4):
        found = laid.at(share * laid.lengths)
        for path, place in zip(paths, found, strict=True):
            along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
            wanted = [np.interp(share * along[-1], along, column) for column in path.T]
            np.testing.assert_allclose(place, wanted, atol=1e-9)


def test_figures_arrive_within_centimetres_and_face_as_they_are_told(model: SteerModel) -> None:
    points = np.array([(0, 3), (2, 2), (0, 0.5), (0.3, 0), (-1, -1), (0, 0)], dtype=np.float64)
    session = model.start(characters=len(points))
    session.go_to(points, facing=np.arange(6) * 60.0)
    told = [event for _ in range(180) for event in session.tick().events if event.kind == "arrived"]
    pose = session.tick()
    assert session.arrived.all()
    assert sorted(event.character for event in told) == list(range(6))
    assert np.hypot(*(pose.ground[:, :2] - points).T).max() < 0.08
    off = np.degrees(pose.ground[:, 2]) - np.arange(6) * 60
    assert np.abs((off + 180) % 360 - 180).max() < 8
    session.control(speed=1.0, direction=0)
    assert not session.arrived.any()


def test_a_run_slows_down_and_changes_of_gait_are_told_where_they_are_seen(model: SteerModel) -> None:
    session = model.start()
    poses = [session.tick()]
    session.go_to((3, 7), gait="run", speed=3.0)
    poses += [session.tick() for _ in range(180)]
    assert np.hypot(*(poses[-1].ground[0, :2] - [3, 7])) < 0.08
    session.control(gait="walk", speed=1.2)
    poses += [session.tick() for _ in range(60)]
    assert [event.name for pose in poses for event in pose.events if event.kind == "gait"] == ["run", "walk"]


def test_a_path_is_followed_to_its_end(model: SteerModel) -> None:
    path = np.array([(0, 4), (4, 4), (4, 4), (4, 0)], dtype=np.float64)
    session, way = model.start(), np.concatenate([[(0, 0)], path])
    session.go_along(path)
    off = []
    for _ in range(360):
        here = session.tick().ground[0, :2]
        step = np.diff(way, axis=0)
        part = ((here - way[:-1]) * step).sum(axis=1) / np.maximum((step**2).sum(axis=1), 1e-9)
        off.append(np.hypot(*(way[:-1] + part.clip(0, 1)[:, None] * step - here).T).min())
    assert session.arrived.all()
    assert max(off) < 0.25
    assert np.hypot(*(here - path[-1])) < 0.08


ZIGZAG = np.array([(0, 0), (0, 2), (0.5, 0), (1, 2), (1.5, 0), (2, 2)], dtype=np.float64)


@pytest.mark.parametrize(("gait", "speed", "seconds"), [("walk", 1.28, 9.5), ("walk", 0.5, 23.0), ("run", 2.45, 6.0)])
def test_corners_are_reached_in_turn_however_sharp(model: SteerModel, gait: str, speed: float, seconds: float) -> None:
    session = model.start(gait, characters=2, places=[(0, 0, 0), (0, 0, 180)])
    session.go_along(ZIGZAG, gait=gait, speed=speed)
    ground = np.stack([session.tick().ground[:, :2] for _ in range(round(seconds * model.fps))])
    assert session.arrived.all()
    # one corner after the other
    for figure in range(2):
        tick = 0
        for corner in ZIGZAG:
            near = np.linalg.norm(ground[tick:, figure] - corner, axis=1) < 0.3 * max(speed, 1)
            assert near.any()
            tick += int(near.argmax())


def test_figures_on_their_way_do_not_slow_down_for_a_new_way_ahead(model: SteerModel) -> None:
    session = model.start()
    session.control(speed=1.28, direction=0)
    for _ in range(60):
        session.tick()
    x, z = session.tick().ground[0, :2]
    session.go_to((x, z + 4))
    places = np.stack([session.tick().ground[0, :2] for _ in range(30)])
    assert np.linalg.norm(np.diff(places[::6], axis=0), axis=1).min() * model.fps / 6 > 1.1
    session.go_to(None)
    for _ in range(60):
        pose = session.tick()
    assert session.arrived.all()
    assert 1.0 < pose.ground[0, 1] - z < 2.6


@pytest.mark.parametrize(
    "points", [[(0.0, 1.0)], [(0.5, 0.5)] * 20, [(0.0, 0.0)], np.linspace((0, 0), (0, 2), 10_000), [(0, 0), (0, 2)] * 3]
)
def test_odd_paths_are_walked_to_their_ends(model: SteerModel, points: Any) -> None:
    session = model.start(characters=2)
    session.go_along(points)
    for _ in range(400):
        pose = session.tick()
    assert session.arrived.all()
    assert np.hypot(*(pose.ground[:, :2] - points[-1]).T).max() < 0.08


def test_figures_that_meet_go_around_each_other(model: SteerModel) -> None:
    nearest = {}
    for room in (None, 0.8):
        session = model.start(characters=2, places=[(0, -3, 0), (0, 3, 180)])
        session.keep_apart(room)
        session.go_to([(0, 3), (0, -3)])
        ground = np.array([session.tick().ground[:, :2] for _ in range(240)])
        nearest[room] = np.hypot(*(ground[:, 0] - ground[:, 1]).T).min()
        assert session.arrived.all()
    assert nearest[None] < 0.1
    assert nearest[0.8] > 0.5


def test_a_figure_goes_around_two_that_stand_side_by_side(model: SteerModel) -> None:
    session = model.start(characters=3, places=[(-0.41, 0, 0), (0.41, 0, 0), (0, -2, 0)])
    session.keep_apart(0.8)
    session.go_to((0, 1.5), ids=[2])
    ground = np.array([session.tick().ground[:, :2] for _ in range(360)])
    assert session.arrived[2]
    assert np.linalg.norm(ground[:, 2:] - ground[:, :2], axis=2).min() > 0.4


def test_a_crowd_crosses_a_circle_apart_and_goes_on_from_a_snapshot_as_before(model: SteerModel) -> None:
    angles = np.arange(12) * np.pi / 6
    places = 3 * np.stack([np.sin(angles), np.cos(angles)], axis=1)
    session = model.start(characters=12, places=np.column_stack([places, np.degrees(angles) + 180]))
    session.keep_apart(0.5)
    session.go_to(-places)
    ground = [session.tick().ground[:, :2] for _ in range(75)]
    snapshot = session.snapshot()
    ground += [session.tick().ground[:, :2] for _ in range(225)]
    apart = np.linalg.norm(np.array(ground)[:, :, None] - np.array(ground)[:, None], axis=3) + 9 * np.eye(12)
    assert session.arrived.all()
    assert apart.min() > 0.38
    session.restore(snapshot)
    again = [session.tick().ground[:, :2] for _ in range(30)]
    np.testing.assert_array_equal(again, ground[75:105])


def test_a_figure_alone_goes_as_if_it_kept_from_nobody(model: SteerModel) -> None:
    alone = [model.start(), model.start()]
    alone[1].keep_apart(0.8)
    for session in alone:
        session.go_to((3, 4))
    for _ in range(60):
        np.testing.assert_array_equal(alone[0].tick().ground, alone[1].tick().ground)


@pytest.mark.parametrize("direction", [-135, -45, 90])
def test_a_slow_side_step_goes_where_it_is_asked(model: SteerModel, direction: float) -> None:
    session = model.start()
    session.control(speed=0.2, direction=direction, facing=0)
    ground = [session.tick().ground[0, :2] for _ in range(150)]
    x, z = ground[-1] - ground[60]
    assert np.hypot(x, z) / 3 == pytest.approx(0.2, abs=0.01)
    assert np.degrees(np.arctan2(x, z)) == pytest.approx(direction, abs=1)


def test_events_are_those_of_contacts_with_hysteresis(model: SteerModel) -> None:
    session = model.start("run")
    session.control(speed=2.5, direction=0)
    down, air, wanted, found = None, 0, list[tuple[int, str]](), list[tuple[int, str]]()
    for tick in range(240):
        pose = session.tick()
        found += [(tick, event.kind) for event in pose.events if event.kind != "gait"]
        now, before, flew = list[bool](), down, air
        for foot, contact in enumerate(pose.contacts[0].tolist()):
            stays = down is not None and down[foot] and contact >= 0.2
            now.append(stays or contact > 0.5)
        down, air = now, 0 if any(now) else air + 1
        if before is None:
            continue
        sides = zip(("left", "right"), before, now, strict=True)
        wanted += [(tick, f"{side} foot") for side, was, stands in sides if stands and not was]
        wanted += [(tick, "take-off")] * (air == 2) + [(tick, "landing")] * (air == 0 and flew >= 2)
    assert found == wanted
    kinds = {kind for _, kind in found}
    assert kinds == {"left foot", "right foot", "take-off", "landing"}


@pytest.mark.parametrize("pictures", [60, 24, 144])
def test_a_display_of_any_rate_misses_no_event_and_gets_none_twice(model: SteerModel, pictures: int) -> None:
    ticks, shown = model.start(), model.start()
    for session in (ticks, shown):
        session.control(speed=1.4, direction=20)
    events = [event for _ in range(91) for event in ticks.tick().events]
    poses = [shown.advance(1 / pictures) for _ in range(3 * pictures)]
    assert [event for pose in poses for event in pose.events] == events
    moved = np.array([b.moved_since(a)[0] for a, b in pairwise(poses)]) * pictures
    assert np.hypot(*moved[-pictures:, :2].T).mean() == pytest.approx(1.4, rel=0.1)


def test_moves_add_up_to_the_way(model: SteerModel) -> None:
    session = model.start(places=[(1, 2, 40)])
    session.control(speed=1.2, direction=90)
    poses = [session.tick() for _ in range(40)]
    x, z, facing = poses[0].ground[0]
    for before, pose in pairwise(poses):
        forward, left, turn = pose.moved_since(before)[0]
        x, z = (
            x + np.sin(facing) * forward + np.cos(facing) * left,
            z + np.cos(facing) * forward - np.sin(facing) * left,
        )
        facing += turn
    np.testing.assert_allclose([x, z], poses[-1].ground[0, :2], atol=1e-9)


def test_what_is_matched_costs_what_features_differ_and_leads_where_is_asked(model: SteerModel) -> None:
    session = model.start(characters=2)
    session.control(speed=1.4, direction=[0, 60])
    for _ in range(60):
        session.tick()
    found, matcher, play = session.matched, model.matcher, session.snapshot().playback
    assert (found.row == play.row + (play.part > 0.5)).all()
    trajectory = matcher.desired_trajectory(play, session.target, np.zeros(2, dtype=bool))
    asked = matcher.desired_features(trajectory, found.row, found.mirrored.astype(int))
    own = matcher.table.features[found.mirrored.astype(int), found.row]
    least = ((asked.clip(-16, 16) - own) ** 2).sum(axis=1) / 2
    assert (found.cost >= least - 0.05 * (1 + least)).all()
    np.testing.assert_allclose(found.path[:, -1] - play.root[:, :2], session.target[:, :2], atol=0.1)


def test_what_is_matched_leads_as_slowly_uphill_as_the_figure_goes(model: SteerModel) -> None:
    session = model.start()
    session.set_ground(lambda x, z: 0.4 * z)
    session.control(speed=1.4, direction=0)
    for _ in range(60):
        session.tick()
    (x, z), *_ = session.matched.path[:, -1] - session.snapshot().playback.root[:, :2]
    # a slope of .4 slows by 1 / (1 + .7 x .4)
    np.testing.assert_allclose([x, z], [0, 1.4 / 1.28], atol=0.1)


@pytest.mark.parametrize(
    ("told", "said"),
    [
        ({"points": (0, np.nan)}, "points must be finite"),
        ({"points": (0, 1, 2)}, "points need x and z"),
        ({"points": (0, 1), "facing": "north"}, "facing needs a number"),
        ({"points": (0, 1), "speed": np.inf}, "speed must be finite"),
        ({"points": (0, 1), "speed": 0}, "speed must be above 0"),
        ({"points": (0, 1), "gait": "fly"}, "unknown gait 'fly'"),
        ({"points": (0, 1), "gait": "jump"}, "'jump' goes nowhere: give a gait such as 'walk'"),
        ({"points": (0, 1), "ids": 2}, "ids must be numbers"),
    ],
)
def test_ways_that_make_no_sense_are_refused(model: SteerModel, told: dict[str, Any], said: str) -> None:
    session = model.start(characters=2)
    before = session.snapshot().going
    with pytest.raises(ControlError, match=said):
        session.go_to(**told)
    assert session.snapshot().going is before


@pytest.mark.parametrize(
    "points",
    [
        [],
        [(0, 1)] * 10_001,
        [(0, 1), (np.nan, 2)],
        [(0, 1, 2)],
        np.zeros((3, 4, 2)),
        [(0, np.inf)],
        [[0, 1], [2]],
        (0, 1),
        "there",
    ],
)
def test_paths_that_make_no_sense_are_refused(model: SteerModel, points: Any) -> None:
    with pytest.raises(ControlError, match="path"):
        model.start(characters=2).go_along(points)
    with pytest.raises(ControlError, match=r"characters keep 0.1 to 5 m apart"):
        model.start(characters=2).keep_apart(9)
