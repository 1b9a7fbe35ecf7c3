"""The table of prompts: what is asked, the rules that count as done; and recorded trials, of which some show it."""

import inspect
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cache, cached_property
from pathlib import Path
from typing import Any

from motet.bundle.manifest import Manifest
from motet.errors import MotionError
from motet.motion.motion import Motion
from motet.representation.contract import named
from motet.text.vocabulary import RULES as TEXT_RULES
from motet_train.data.corpus import Record, read_corpus
from motet_train.data.errors import DataError
from motet_train.data.store import INDEX, Store
from motet_train.evaluate.text_adherence import rules
from motet_train.evaluate.text_adherence.track import Track, track_of

RULES = {
    name: rule
    for name, rule in inspect.getmembers(rules, inspect.isfunction)
    if rule.__module__ == rules.__name__ and not name.startswith("_")
}
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
        if any(fnmatchcase(action, pattern) for pattern in self.shown):
            return True
        return None if any(fnmatchcase(action, pattern) for pattern in self.aside) else False


def holds(track: Track, rules: Sequence[Mapping[str, Any]]) -> bool:
    """Whether all of some rules are so."""
    given = ((rule["is"], {key: value for key, value in rule.items() if key != "is"}) for rule in rules)
    return track.seconds >= SHORTEST_MOTION and all(RULES[name](track, **more) for name, more in given)


@cache
def _table() -> Mapping[str, Any]:
    return tomllib.loads((Path(__file__).parent / "prompts.toml").read_text(encoding="utf-8"))


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
    lines = (Path(__file__).parent / "trials.tsv").read_text(encoding="utf-8").splitlines()[1:]
    return {trial: action for action, trials in (line.split("\t") for line in lines) for trial in trials.split()}


@dataclass(frozen=True, eq=False)
class Trial:
    """A motion of any human figure, its name, and what was said about it."""

    name: str
    sentences: tuple[str, ...]
    motion: Motion

    @property
    def action(self) -> str | None:
        """What it shows, None for a trial that the table of trials does not have."""
        return actions().get(self.name)

    def shows(self, prompt: Prompt) -> bool | None:
        """Whether it shows what a prompt asks; None where it may, and where nothing is known of it."""
        return None if self.action is None else prompt.shows(self.action)

    @cached_property
    def track(self) -> Track:
        """The track of its motion; DataError for a motion that is none of a human figure."""
        try:
            return track_of(self.motion)
        except MotionError as error:
            raise DataError(f"{self.name} cannot be judged: {error}") from error


def read_trials(path: Path, unit: str | float | None = None) -> Iterator[Trial]:
    """The trials in a store, at its frame rate, the figure moving over the ground as its root block says; or in a
    folder or zip of motion files with a table of sentences, but for those that cannot be read or have no sentence.
    DataError where it is neither.

    unit: the length unit of files that do not state theirs, as in :func:`motet.read`.
    """
    if (path / INDEX).is_file():
        store = Store.open(path)
        whole = named(store.representation).motion
        yield from (Trial(one.name, one.sentences, whole(store.motion(i))) for i, one in enumerate(store.records))
    else:
        records = (item for item in read_corpus(path, unit=unit) if isinstance(item, Record))
        yield from (Trial(record.name, record.sentences, record.motion) for record in records)


class LookUp:
    """Plays the trial whose sentences share most words with what is asked, the floor of every generator.

    Trials without a sentence are never found; DataError if none has one.
    """

    def __init__(self, trials: Sequence[Trial]) -> None:
        known = [(trial, frozenset(TEXT_RULES.words(said))) for trial in trials for said in trial.sentences]
        self._known = sorted(((trial, words) for trial, words in known if words), key=lambda pair: pair[0].name)
        if not self._known:
            raise DataError("no trial to look up has a sentence")

    def generate(self, text: str, seed: int) -> Motion:
        """The motion of :meth:`found`, the same for every seed."""
        return self.found(text).motion

    def found(self, text: str) -> Trial:
        """The trial with the sentence that shares most different words with the text; of several such sentences the one
        with the fewest different words, and where they are as many, of the first trial by name."""
        asked = frozenset(TEXT_RULES.words(text))
        return max(self._known, key=lambda pair: (len(asked & pair[1]), -len(pair[1])))[0]


def trained_on(manifest: Manifest, trials: Sequence[Trial]) -> set[str]:
    """The names of the trials that are neither validation nor test motions of a model; all, where it does not say, and
    where nothing was kept back: then its validation motions were trained on, too."""
    split = manifest.training.get("split", {})
    parts = () if split.get("by") == "none" else ("validation", "test")
    return {trial.name for trial in trials} - {name for part in parts for name in split.get(part, ())}
