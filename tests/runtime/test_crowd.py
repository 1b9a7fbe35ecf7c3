"""Characters come and go in a running session, and each moves as it would alone."""

import threading
from typing import Any

import numpy as np
import pytest

from motet import ControlError, SteerModel, load
from motet.steering.pose import Pose
from motet.steering.sentence_acts import SaidActs
from motet.steering.session import SteerSession

pytestmark = pytest.mark.numeric

PARTS = ("ground", "rotations", "height", "contacts")


@pytest.fixture(scope="module")
def model() -> SteerModel:
    return load("control")


def same(pose: Pose, each: list[Pose]) -> None:
    """A pose of all is bit for bit those of each alone, and so are its events."""
    for part in PARTS:
        np.testing.assert_array_equal(getattr(pose, part), np.concatenate([getattr(one, part) for one in each]))
    events = {event._replace(character=i) for i, one in enumerate(each) for event in one.events}
    assert set(pose.events) == events


def steer(session: SteerSession, number: int) -> None:
    """Different for each, of all that a session can be told."""
    ways = [(0.0, 3.0), (2.5, -1.0), (-3.0, 0.5), (1.0, 1.0), (-2.0, -2.0)]
    session.look_at((0.0, 1.0 + number, 3.0), ids=session.characters - 1)
    session.reach("left", (0.4, 1.2, 0.5), ids=session.characters - 1)
    session.go_to(ways[number], ids=session.characters - 1)
    style = ["marching", "none", "drunk", "old", "tiptoe"][number]
    session.control(style=[*session.styles[:-1], style])


@pytest.mark.parametrize("hold_feet", [True, False])
@pytest.mark.parametrize("by", ["tick", "advance"])
def test_who_comes_and_who_stays_moves_as_alone(model: SteerModel, hold_feet: bool, by: str) -> None:
    def begun(place: Any) -> SteerSession:
        return model.start(places=[place], hold_feet=hold_feet)

    def moved(session: SteerSession) -> Pose:
        return session.tick() if by == "tick" else session.advance(1 / 32)

    places = [(0.0, 0.0, 0.0), (1.0, 0.5, 30.0), (-1.0, 0.5, 200.0), (0.5, 2.0, -70.0), (4.0, 4.0, 10.0)]
    crowd = begun(places[0])
    alone = [begun(places[0])]
    for session in (crowd, alone[0]):
        steer(session, 0)
    for step in range(120):
        if step in {20, 45, 70}:
            number = len(alone)
            assert crowd.add(places[number]) == [number]
            alone.append(begun(places[number]))
            if by == "advance":  # of the time that the crowd's display is at
                alone[-1]._state.ahead = crowd._state.ahead
                alone[-1].advance(0)
            if step < 60:
                steer(crowd, number)
                steer(alone[-1], number)
        if step == 75:
            crowd.act("jump", ids=2)
            alone[2].act("jump")
        if step == 85:
            crowd.remove([0, 3])
            alone = [one for i, one in enumerate(alone) if i not in (0, 3)]
        if step == 105:
            crowd.remove(0)
            del alone[0]
        if step == 110:
            assert crowd.add([places[3], places[4]]) == [1, 2]
            more = [begun(place) for place in places[3:]]
            for one in more if by == "advance" else []:
                one._state.ahead = crowd._state.ahead
                one.advance(0)
            alone += more
        same(moved(crowd), [moved(one) for one in alone])
    assert crowd.characters == len(alone) == 3


def test_a_snapshot_has_its_number(model: SteerModel) -> None:
    session = model.start(characters=2)
    session.control(speed=1.2, direction=[0, 90])
    for _ in range(10):
        session.tick()
    kept = session.snapshot()
    expected = [session.tick() for _ in range(20)]
    session.add([(3, 3, 0), (4, 4, 0)])
    session.remove(1)
    assert len(session.tick()) == 3
    session.restore(kept)
    assert session.characters == 2
    for pose in expected:
        again = session.tick()
        for part in PARTS:
            np.testing.assert_array_equal(getattr(again, part), getattr(pose, part))


def test_who_comes_to_many_searches_in_turn(model: SteerModel) -> None:
    every = model.matcher.settings.search_every
    session, alone = model.start(characters=31), model.start(places=[(5, 5, 40)], phases=31 % every)
    session.tick()
    (number,) = session.add((5, 5, 40))
    session.control(speed=1.0, direction=90)
    alone.control(speed=1.0, direction=90)
    for _ in range(30):
        pose, one = session.tick(), alone.tick()
        for part in PARTS:
            np.testing.assert_array_equal(getattr(pose, part)[number:], getattr(one, part))


@pytest.mark.parametrize("places", ["here", None, [], [(0, 0)], (1, 2, np.nan), np.zeros((1, 1, 3)), {}])
def test_places_that_make_no_sense_add_no_one(model: SteerModel, places: Any) -> None:
    session = model.start()
    with pytest.raises(ControlError):
        session.add(places)
    assert session.characters == len(session.tick()) == 1


@pytest.mark.parametrize("ids", [None, 2, -1, [0, 0], [0, 1], "0", 0.0, []])
def test_who_is_not_there_or_the_last_is_not_removed(model: SteerModel, ids: Any) -> None:
    session = model.start(characters=2)
    with pytest.raises(ControlError):
        session.remove(ids)
    assert session.characters == len(session.tick()) == 2


def test_more_than_a_session_can_have_are_not_added(model: SteerModel) -> None:
    session = model.start()
    with pytest.raises(ControlError, match="100000 characters"):
        session.add(np.zeros((100_000, 3)))


def test_acts_are_prepared_in_a_thread_while_the_session_ticks(model: SteerModel) -> None:
    """Once it is prepared, an act in words takes no model."""
    words = SaidActs(model, load("generate"))
    session = model.start(words=words)
    thread = threading.Thread(target=session.prepare, args=("wave", "jump"))
    thread.start()
    session.tick()
    thread.join()
    words.words = None  # type: ignore[assignment]
    session.act("wave")
    session.tick()
    assert session.acting[0] is not None
