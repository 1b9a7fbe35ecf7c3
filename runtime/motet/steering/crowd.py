"""Characters that come and go: states of sessions joined, and some of their characters picked.

Letters in shapes: B characters of a state, n that are picked. Picked characters are numbered through all states.
"""

from collections.abc import Sequence
from dataclasses import fields, is_dataclass, replace
from itertools import chain
from typing import Any

import numpy as np

from motet.steering.events import Event
from motet.steering.matching import Rows
from motet.steering.paths import Paths

EVENTS = ("events", "late")
"""Fields that hold events, which name characters by their numbers."""


def picked(states: Sequence[Any], counts: Sequence[int], characters: Rows) -> Any:
    """The state of characters (n,) of several states of one kind, which have so many characters each: arrays (B, ...),
    lists of B, and dataclasses and tuples of these. Anything else, such as the time of the display, is the first
    one's."""
    first = states[0]
    # arrays and lists have an entry for each character
    if isinstance(first, np.ndarray):
        return np.concatenate(states)[characters]
    if isinstance(first, list):
        joined = list(chain.from_iterable(states))
        return [joined[character] for character in characters.tolist()]
    # tuples and dataclasses have parts that do
    if isinstance(first, tuple):
        return tuple(picked(parts, counts, characters) for parts in zip(*states, strict=True))
    if isinstance(first, Paths):
        return Paths.of(picked([state.each for state in states], counts, characters))
    if not is_dataclass(first):
        return first
    values = dict[str, Any]()
    for field in fields(first):
        each = [getattr(state, field.name) for state in states]
        part = _events if field.name in EVENTS else picked
        values[field.name] = part(each, counts, characters)
    return replace(first, **values)  # type: ignore[type-var]


def _events(states: Sequence[Sequence[Event]], counts: Sequence[int], characters: Rows) -> tuple[Event, ...]:
    """The events of characters (n,) by their new numbers, of states with so many characters each."""
    new_numbers = {old: new for new, old in enumerate(characters.tolist())}
    kept = list[Event]()
    for events, start in zip(states, np.cumsum([0, *counts[:-1]]).tolist(), strict=True):
        for event in events:
            number = new_numbers.get(start + event.character)
            if number is not None:
                kept.append(event._replace(character=number))
    return tuple(kept)
