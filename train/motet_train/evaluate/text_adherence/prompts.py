"""The table of prompts: what is asked, what counts as done, and which recorded trials show it."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cache
from pathlib import Path

from motet_train.evaluate.text_adherence.rules import Condition, holds
from motet_train.evaluate.text_adherence.track import Track

HERE = Path(__file__).parent
PROMPTS_FILE, TRIALS_FILE = HERE / "prompts.toml", HERE / "trials.tsv"


@dataclass(frozen=True)
class Prompt:
    """One prompt. group: "locomotion" or "rest". rules: what must be so.

    shown: patterns of the actions whose trials show it. aside: of those that may show it, counted neither way.
    walk: whether it asks for a walk forward, of which sliding feet are measured.
    """

    text: str
    group: str
    rules: tuple[Condition, ...]
    shown: tuple[str, ...]
    aside: tuple[str, ...]
    walk: bool

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


@cache
def prompts() -> tuple[Prompt, ...]:
    """All prompts, in the order of the file."""
    rows = tomllib.loads(PROMPTS_FILE.read_text(encoding="utf-8"))["prompt"]
    return tuple(
        Prompt(
            text=row["text"],
            group=row["group"],
            rules=tuple(row["rules"]),
            shown=tuple(row["shown"]),
            aside=tuple(row["aside"]),
            walk=row.get("walk", False),
        )
        for row in rows
    )


@cache
def actions() -> Mapping[str, str]:
    """The name of each recorded trial -> its action."""
    lines = TRIALS_FILE.read_text(encoding="utf-8").splitlines()[1:]
    return {trial: action for action, trials in (line.split("\t") for line in lines) for trial in trials.split()}


def _matches(action: str, patterns: tuple[str, ...]) -> bool:
    return any(fnmatchcase(action, pattern) for pattern in patterns)
