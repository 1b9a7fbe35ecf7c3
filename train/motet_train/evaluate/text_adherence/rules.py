"""All rules by name, and whether a motion keeps several."""

import inspect
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

from motet_train.evaluate.text_adherence import arms, going, legs, posture
from motet_train.evaluate.text_adherence.track import Track

Rule = Callable[..., bool]
"""A track, and parameters by name, to whether it is so."""

Condition = Mapping[str, Any]
"""The name of a rule, "is", and its parameters."""

RULES: Mapping[str, Rule] = MappingProxyType(
    {
        name: found
        for module in (going, legs, arms, posture)
        for name, found in inspect.getmembers(module, inspect.isfunction)
        if not name.startswith("_")
        and found.__module__ == module.__name__
        and found.__annotations__.get("return") is bool
    }
)
"""Name -> rule."""

SHORTEST = 0.3
"""Seconds: a motion that is shorter does nothing that a sentence could say."""


def holds(track: Track, conditions: Sequence[Condition]) -> bool:
    """Whether all conditions are so."""
    return track.seconds >= SHORTEST and all(_is_so(track, **condition) for condition in conditions)


def _is_so(track: Track, **condition: Any) -> bool:
    return bool(RULES[condition.pop("is")](track, **condition))
