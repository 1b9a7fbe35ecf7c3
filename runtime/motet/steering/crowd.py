"""Characters that come and go: states of sessions joined, and some of their characters picked.

Letters in shapes: B characters of a state, n that are picked. Who is picked is numbered through all states.
"""

from collections.abc import Iterator, Sequence
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from motet.motion.rotations import Array
from motet.steering.action_layer import Acting, Body
from motet.steering.arrival import Going, Paths
from motet.steering.events import Event, Happenings
from motet.steering.foot_lock import Foot, FootLock
from motet.steering.look_layer import Look
from motet.steering.matching import Rows
from motet.steering.pose import Pose
from motet.steering.reach_layer import Reach
from motet.steering.targets import Guidance

if TYPE_CHECKING:
    from motet.steering.session import SteerSnapshot

SOLES = 6
"""Numbers of a foot before those of its sole: its shift, drift and height, two each."""

FOOT = SOLES + 9


def picked(states: "Sequence[SteerSnapshot]", who: Rows) -> "SteerSnapshot":
    """The state of characters (n,) of several sessions of one model; the time of the display is the first one's."""
    first = states[0]
    counts = [len(state.command.gait) for state in states]
    locks = [state.lock for state in states if state.lock is not None]
    return replace(
        first,
        playback=_whole([state.playback for state in states], who),
        acting=_acting([state.acting for state in states], counts, who),
        standing=_whole([state.standing for state in states], who),
        command=_whole([state.command for state in states], who),
        lock=_lock(locks, who) if locks else None,
        poses=_poses([state.poses for state in states if state.poses is not None], counts, who),
        guidance=_guidance([state.guidance for state in states], who),
        happenings=_happenings([state.happenings for state in states], who),
        late=_events([state.late for state in states], counts, who),
    )


def _arrays(states: Sequence[Any], names: Sequence[str], who: Rows) -> dict[str, NDArray[Any]]:
    """Fields that are arrays (B, ...), of those who are picked (n, ...)."""
    return {name: np.concatenate([getattr(state, name) for state in states])[who] for name in names}


def _whole(states: Sequence[Any], who: Rows) -> Any:
    """Of states that have nothing but arrays (B, ...)."""
    names = [field.name for field in fields(states[0])]
    return type(states[0])(**_arrays(states, names, who))


def _numbered(counts: Sequence[int], who: Rows) -> list[dict[int, int]]:
    """The new numbers of those who are picked, by their numbers in each state."""
    new = {old: number for number, old in enumerate(who.tolist())}
    found = list[dict[int, int]]()
    first = 0
    for count in counts:
        found.append({old - first: new[old] for old in range(first, first + count) if old in new})
        first += count
    return found


def _events(states: Sequence[Sequence[Event]], counts: Sequence[int], who: Rows) -> tuple[Event, ...]:
    found = list[Event]()
    for events, numbers in zip(states, _numbered(counts, who), strict=True):
        for event in events:
            if event.character in numbers:
                found.append(event._replace(character=numbers[event.character]))
    return tuple(found)


def _poses(states: Sequence[tuple[Pose, Pose]], counts: Sequence[int], who: Rows) -> tuple[Pose, Pose] | None:
    if not states:
        return None
    first = _pose([one for one, _ in states], counts, who)
    return first, _pose([one for _, one in states], counts, who)


def _pose(states: Sequence[Pose], counts: Sequence[int], who: Rows) -> Pose:
    arrays = _arrays(states, ("ground", "rotations", "height", "contacts"), who)
    return Pose(**arrays, events=_events([state.events for state in states], counts, who))


def _happenings(states: Sequence[Happenings], who: Rows) -> Happenings:
    done = [one for state in states for one in state.done]
    arrays = _arrays(states, ("down", "air", "gait", "arrived"), who)
    return Happenings(**arrays, done=tuple(done[i] for i in who.tolist()))


def _acting(states: Sequence[Acting], counts: Sequence[int], who: Rows) -> Acting:
    playing = [one for state in states for one in state.playing]
    asked = dict[int, Any]()
    for state, numbers in zip(states, _numbered(counts, who), strict=True):
        for figure, act in state.asked.items():
            if figure in numbers:
                asked[numbers[figure]] = act
    bodies = dict[str, Any]()
    for name in ("base", "shown", "before"):
        each = [getattr(state, name) for state in states]
        bodies[name] = Body(**_arrays(each, Body._fields, who))
    arrays: dict[str, Any] = _arrays(states, ("led", "offset", "offset_rate", "damping", "going", "drift"), who)
    return replace(states[0], playing=[playing[i] for i in who.tolist()], asked=asked, **bodies, **arrays)


def _guidance(states: Sequence[Guidance], who: Rows) -> Guidance:
    look = _look([state.look for state in states], who)
    left = _reach([state.hands[0] for state in states], who)
    right = _reach([state.hands[1] for state in states], who)
    going = _going([state.going for state in states], who)
    return replace(states[0], look=look, hands=(left, right), going=going)


def _look(states: Sequence[Look], who: Rows) -> Look:
    return Look(**_arrays(states, ("points",), who), turn=_whole([state.turn for state in states], who))


def _reach(states: Sequence[Reach], who: Rows) -> Reach:
    arrays: dict[str, Any] = _arrays(states, ("points", "beyond"), who)
    aim = _whole([state.aim for state in states], who)
    weight = _whole([state.weight for state in states], who)
    return Reach(states[0].side, aim=aim, weight=weight, **arrays)


def _going(states: Sequence[Going], who: Rows) -> Going:
    paths = list[Array]()
    for state in states:
        paths += np.split(state.paths.points, state.paths.first[1:-1])
    names = [field.name for field in fields(Going) if field.name != "paths"]
    return Going(Paths.of([paths[i] for i in who.tolist()]), **_arrays(states, names, who))


def _lock(states: Sequence[FootLock], who: Rows) -> FootLock:
    numbers = np.concatenate([_feet(state) for state in states], axis=2)[:, :, who]
    new = np.isnan(numbers[0, SOLES])
    lock = FootLock(len(who), states[0].dt, states[0].settings)
    if new.all():
        return lock
    if len(who) == 1:
        lock.feet = tuple(_foot(values) for values in numbers[:, :, 0].tolist())
        return lock
    lock.feet = (_foot(list(np.swapaxes(numbers, 0, 1).copy())),)
    lock.new = new if new.any() else None
    return lock


def _feet(lock: FootLock) -> Array:
    """The numbers of a lock's feet (2, FOOT, B), those of soles NaN where they are not known yet."""
    found = np.zeros((2, FOOT, lock.characters))
    found[:, SOLES:] = np.nan
    sides = [slice(0, 1), slice(1, 2)] if lock.characters == 1 else [slice(0, 2)]
    for side, foot in zip(sides, lock.feet, strict=False):  # several that are new have two feet as well
        for row, values in enumerate(_values(foot)):
            found[side, row] = values
    if lock.new is not None:
        found[:, SOLES:, lock.new] = np.nan
    return found


def _values(foot: Foot) -> Iterator[Any]:
    yield from (*foot.shift, *foot.drift, *foot.height)
    for point in foot.soles or ():
        yield from point


def _foot(values: Sequence[Any]) -> Foot:
    """The foot of FOOT numbers, or arrays of them."""
    soles = tuple((values[i], values[i + 1], values[i + 2]) for i in range(SOLES, FOOT, 3))
    return Foot((values[0], values[1]), (values[2], values[3]), (values[4], values[5]), soles)
