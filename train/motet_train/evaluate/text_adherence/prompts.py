"""The table of prompts: what is asked, the rules that count as done, and which recorded trials show it."""

import inspect
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

from motet_train.evaluate.text_adherence import arms, going, legs, posture
from motet_train.evaluate.text_adherence.track import Track

HERE = Path(__file__).parent

RULES: Mapping[str, Callable[..., bool]] = MappingProxyType(
    {
        name: found
        for module in (going, legs, arms, posture)
        for name, found in inspect.getmembers(module, inspect.isfunction)
        if found.__module__ == module.__name__ and not name.startswith("_")
    }
)
"""Name -> rule: a track, and parameters by name, to whether it is so."""

SHORTEST_MOTION = 0.3
"""Seconds: a motion that is shorter does nothing that a sentence could say."""


@dataclass(frozen=True)
class Prompt:
    """One prompt. group: "locomotion" or "rest". rules: what must be so, the name of a rule, "is", and its parameters.

    shown: patterns of the actions whose trials show it. aside: of those that may show it, counted neither way.
    walk: whether it asks for a walk forward, of which sliding feet are measured.
    """

    text: str
    group: str
    rules: Sequence[Mapping[str, Any]]
    shown: Sequence[str]
    aside: Sequence[str]
    walk: bool = False

    @property
    def turns(self) -> bool:
        """Whether it asks for a turn of a certain angle."""
        return any(rule["is"] == "turns" for rule in self.rules)

    def passes(self, track: Track) -> bool:
        """Whether a motion does what the prompt says."""
        return holds(track, self.rules)

    def shows(self, action: str) -> bool | None:
        """Whether trials of an action show it; None where they may."""
        if _matches(action, self.shown):
            return True
        return None if _matches(action, self.aside) else False


def holds(track: Track, rules: Sequence[Mapping[str, Any]]) -> bool:
    """Whether all of some rules are so."""
    given = ({key: value for key, value in rule.items() if key != "is"} for rule in rules)
    found = (RULES[rule["is"]](track, **more) for rule, more in zip(rules, given, strict=True))
    return track.seconds >= SHORTEST_MOTION and all(found)


@cache
def _table() -> Mapping[str, Any]:
    return tomllib.loads((HERE / "prompts.toml").read_text(encoding="utf-8"))


@cache
def prompts() -> tuple[Prompt, ...]:
    """All prompts, in the order of the file."""
    return tuple(Prompt(**row) for row in _table()["prompt"])


def outside() -> tuple[str, ...]:
    """Everyday sentences about what none of the recorded trials shows."""
    return tuple(_table()["outside"])


@cache
def actions() -> Mapping[str, str]:
    """The name of each recorded trial -> its action."""
    lines = (HERE / "trials.tsv").read_text(encoding="utf-8").splitlines()[1:]
    return {trial: action for action, trials in (line.split("\t") for line in lines) for trial in trials.split()}


def _matches(action: str, patterns: Sequence[str]) -> bool:
    return any(fnmatchcase(action, pattern) for pattern in patterns)
