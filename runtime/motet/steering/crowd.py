"""Characters that come and go: states of sessions joined, and some of their characters picked.

Letters in shapes: B characters of a state, n that are picked. Picked characters are numbered through all states.
"""

from collections.abc import Iterator, Sequence
from dataclasses import fields, replace
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from motet.motion.rotations import Array
from motet.steering.action_layer import ActionLayer, Body
from motet.steering.arrival import Going, Paths
from motet.steering.events import Event, Happenings
from motet.steering.foot_lock import Foot, FootLock
from motet.steering.look_layer import LookLayer
from motet.steering.matching import Rows
from motet.steering.pose import Pose
from motet.steering.reach_layer import ReachLayer
from motet.steering.targets import Guidance

if TYPE_CHECKING:
    from motet.steering.session import SteerSnapshot

SOLES = 6
"""Numbers of a foot before those of its sole: its shift, drift and height, two each."""

FOOT = SOLES + 9


def picked(states: "Sequence[SteerSnapshot]", characters: Rows) -> "SteerSnapshot":
    """The state of characters (n,) of several sessions of one model; the time of the display is the first one's."""
    first = states[0]
    counts = [len(state.command.gait) for state in states]
    locks = [state.lock for state in states if state.lock is not None]
    return replace(
        first,
        playback=_whole([state.playback for state in states], characters),
        actions=_actions([state.actions for state in states], counts, characters),
        idle=_whole([state.idle for state in states], characters),
        command=_whole([state.command for state in states], characters),
        lock=_lock(locks, characters) if locks else None,
        poses=_poses([state.poses for state in states if state.poses is not None], counts, characters),
        guidance=_guidance([state.guidance for state in states], characters),
        happenings=_happenings([state.happenings for state in states], characters),
        late=_events([state.late for state in states], counts, characters),
    )


def _arrays(states: Sequence[Any], names: Sequence[str], characters: Rows) -> dict[str, NDArray[Any]]:
    """Fields that are arrays (B, ...), of the characters that are picked (n, ...)."""
    arrays = dict[str, NDArray[Any]]()
    for name in names:
        arrays[name] = np.concatenate([getattr(state, name) for state in states])[characters]
    return arrays


def _whole(states: Sequence[Any], characters: Rows) -> Any:
    """Of states that have nothing but arrays (B, ...)."""
    names = [field.name for field in fields(states[0])]
    return type(states[0])(**_arrays(states, names, characters))


def _numbered(counts: Sequence[int], characters: Rows) -> list[dict[int, int]]:
    """The new numbers of the characters that are picked, by their numbers in each state."""
    new = {old: number for number, old in enumerate(characters.tolist())}
    numbers = list[dict[int, int]]()
    first = 0
    for count in counts:
        stop = first + count
        numbers.append({old - first: new[old] for old in range(first, stop) if old in new})
        first = stop
    return numbers


def _events(states: Sequence[Sequence[Event]], counts: Sequence[int], characters: Rows) -> tuple[Event, ...]:
    kept = list[Event]()
    for events, numbers in zip(states, _numbered(counts, characters), strict=True):
        for event in events:
            if event.character in numbers:
                kept.append(event._replace(character=numbers[event.character]))
    return tuple(kept)


def _poses(states: Sequence[tuple[Pose, Pose]], counts: Sequence[int], characters: Rows) -> tuple[Pose, Pose] | None:
    if not states:
        return None
    first = _pose([pose for pose, _ in states], counts, characters)
    second = _pose([pose for _, pose in states], counts, characters)
    return first, second


def _pose(states: Sequence[Pose], counts: Sequence[int], characters: Rows) -> Pose:
    arrays = _arrays(states, ("ground", "rotations", "height", "contacts"), characters)
    return Pose(**arrays, events=_events([state.events for state in states], counts, characters))


def _happenings(states: Sequence[Happenings], characters: Rows) -> Happenings:
    done = list(chain.from_iterable(state.done for state in states))
    arrays = _arrays(states, ("down", "air", "gait", "arrived"), characters)
    return Happenings(**arrays, done=tuple(done[i] for i in characters.tolist()))


def _actions(states: Sequence[ActionLayer], counts: Sequence[int], characters: Rows) -> ActionLayer:
    playing = list(chain.from_iterable(state.playing for state in states))
    orders = dict[int, Any]()
    for state, numbers in zip(states, _numbered(counts, characters), strict=True):
        for figure, act in state.orders.items():
            if figure in numbers:
                orders[numbers[figure]] = act
    bodies = dict[str, Any]()
    for name in ("base", "shown", "shown_before"):
        each = [getattr(state, name) for state in states]
        bodies[name] = Body(**_arrays(each, Body._fields, characters))
    arrays: dict[str, Any] = _arrays(
        states, ("led", "offset", "offset_rate", "stretch", "velocity", "velocity_offset"), characters
    )
    return replace(states[0], playing=[playing[i] for i in characters.tolist()], orders=orders, **bodies, **arrays)


def _guidance(states: Sequence[Guidance], characters: Rows) -> Guidance:
    look = _look([state.look for state in states], characters)
    left = _reach([state.hands[0] for state in states], characters)
    right = _reach([state.hands[1] for state in states], characters)
    going = _going([state.going for state in states], characters)
    return replace(states[0], look=look, hands=(left, right), going=going)


def _look(states: Sequence[LookLayer], characters: Rows) -> LookLayer:
    return LookLayer(
        **_arrays(states, ("points",), characters), turn=_whole([state.turn for state in states], characters)
    )


def _reach(states: Sequence[ReachLayer], characters: Rows) -> ReachLayer:
    arrays: dict[str, Any] = _arrays(states, ("points", "beyond"), characters)
    aim = _whole([state.aim for state in states], characters)
    weight = _whole([state.weight for state in states], characters)
    return ReachLayer(states[0].side, aim=aim, weight=weight, **arrays)


def _going(states: Sequence[Going], characters: Rows) -> Going:
    paths = list[Array]()
    for state in states:
        paths += np.split(state.paths.points, state.paths.first[1:-1])
    names = [field.name for field in fields(Going) if field.name != "paths"]
    return Going(Paths.of([paths[i] for i in characters.tolist()]), **_arrays(states, names, characters))


def _lock(states: Sequence[FootLock], characters: Rows) -> FootLock:
    numbers = np.concatenate([_feet(state) for state in states], axis=2)[:, :, characters]
    new = np.isnan(numbers[0, SOLES])
    lock = FootLock(len(characters), states[0].dt, states[0].settings)
    if new.all():
        return lock
    if len(characters) == 1:
        lock.feet = tuple(_foot(values) for values in numbers[:, :, 0].tolist())
        return lock
    lock.feet = (_foot(list(np.swapaxes(numbers, 0, 1).copy())),)
    lock.new = new if new.any() else None
    return lock


def _feet(lock: FootLock) -> Array:
    """The numbers of a lock's feet (2, FOOT, B), those of soles NaN where they are not known yet."""
    numbers = np.zeros((2, FOOT, lock.characters))
    numbers[:, SOLES:] = np.nan
    sides = [slice(0, 1), slice(1, 2)] if lock.characters == 1 else [slice(0, 2)]
    for side, foot in zip(sides, lock.feet, strict=False):  # several that are new have two feet as well
        for row, values in enumerate(_values(foot)):
            numbers[side, row] = values
    if lock.new is not None:
        numbers[:, SOLES:, lock.new] = np.nan
    return numbers


def _values(foot: Foot) -> Iterator[Any]:
    yield from (*foot.shift, *foot.drift, *foot.height)
    for point in foot.soles or ():
        yield from point


def _foot(values: Sequence[Any]) -> Foot:
    """The foot of FOOT numbers, or arrays of them."""
    soles = tuple((values[i], values[i + 1], values[i + 2]) for i in range(SOLES, FOOT, 3))
    return Foot((values[0], values[1]), (values[2], values[3]), (values[4], values[5]), soles)
