"""The table of prompts, with the rules that a motion has to pass; and recorded trials, with the prompts they show."""

import inspect
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cache, cached_property
from pathlib import Path

from motet.bundle.fields import Json
from motet.bundle.manifest import Manifest
from motet.errors import MotionError
from motet.motion.motion import Motion
from motet.representation.contract import named
from motet.text.vocabulary import NEW_MODEL_RULES
from motet_train.data.corpus import Record, read_corpus
from motet_train.data.errors import DataError
from motet_train.data.store import INDEX, Store
from motet_train.data.table import read_toml
from motet_train.evaluate.text_adherence import rules
from motet_train.evaluate.text_adherence.track import Track, track_of

RULE_BY_NAME: dict[str, Callable[..., bool]] = {}
"""Name -> rule: a function of a track and keyword arguments."""

for name, rule in inspect.getmembers(rules, inspect.isfunction):
    if rule.__module__ == rules.__name__ and not name.startswith("_"):
        RULE_BY_NAME[name] = rule

SHORTEST_SHOWN = 0.3
"""Seconds: a shorter motion passes no prompt."""


@dataclass(frozen=True)
class Prompt:
    """One prompt. group: "locomotion" or "rest". rules: the rules to pass, each with its name, "is", and its arguments.

    shown: patterns of the actions whose trials show it. aside: of actions that may show it and do not count.
    walk: whether it is a walk forward, in which the sliding of feet is measured.
    """

    text: str
    group: str
    rules: Sequence[Json]
    shown: Sequence[str]
    aside: Sequence[str]
    walk: bool = False

    @property
    def turns(self) -> bool:
        """Whether it specifies the angle of a turn."""
        return any(rule["is"] == "turns" for rule in self.rules)

    def passes(self, track: Track) -> bool:
        """Whether a motion does what the prompt says."""
        return holds(track, self.rules)

    def shows(self, action: str) -> bool | None:
        """Whether trials of an action show it; None if they may."""
        if any(fnmatchcase(action, pattern) for pattern in self.shown):
            return True
        if any(fnmatchcase(action, pattern) for pattern in self.aside):
            return None
        return False


def holds(track: Track, rules: Sequence[Json]) -> bool:
    """Whether a motion passes all of some rules."""
    if track.seconds < SHORTEST_SHOWN:
        return False
    for rule in rules:
        # all of a rule but its name
        arguments = {key: value for key, value in rule.items() if key != "is"}
        if not RULE_BY_NAME[rule["is"]](track, **arguments):
            return False
    return True


_TABLE = read_toml(__file__, "prompts.toml")

EVERYDAY_PROMPTS = tuple(Prompt(**row) for row in _TABLE["prompt"])
"""All prompts, in the order of the file."""

OUTSIDE: Sequence[str] = _TABLE["outside"]
"""Everyday sentences about actions that no recorded trial shows."""


@cache
def actions() -> Mapping[str, str]:
    """The name of each recorded trial -> its action."""
    lines = (Path(__file__).parent / "trials.tsv").read_text(encoding="utf-8").splitlines()[1:]
    trial_actions = {}
    for line in lines:
        action, trials = line.split("\t")
        trial_actions.update(dict.fromkeys(trials.split(), action))
    return trial_actions


@dataclass(frozen=True, eq=False)
class Trial:
    """A motion of any human figure, its name, and the sentences about it."""

    name: str
    sentences: tuple[str, ...]
    motion: Motion

    @property
    def action(self) -> str | None:
        """The action that it shows, None for a trial that is not in the table of trials."""
        return actions().get(self.name)

    def shows(self, prompt: Prompt) -> bool | None:
        """Whether it shows a prompt; None if it may, and for a trial of unknown action."""
        return None if self.action is None else prompt.shows(self.action)

    @cached_property
    def track(self) -> Track:
        """The track of its motion; DataError for a figure that is not human."""
        try:
            return track_of(self.motion)
        except MotionError as error:
            raise DataError(f"{self.name} cannot be judged: {error}") from error


def read_trials(path: Path, unit: str | float | None = None) -> Iterator[Trial]:
    """The trials in a store, at its frame rate and with the path of its root block; or in a folder or zip of motion
    files with a table of sentences, except those that cannot be read or have no sentence. DataError for anything else.

    unit: the length unit of files that do not state theirs, as in :func:`motet.read`.
    """
    if (path / INDEX).is_file():
        store = Store.open(path)
        playable = named(store.representation).motion
        for number, entry in enumerate(store.records):
            yield Trial(entry.name, entry.sentences, playable(store.motion(number)))
    else:
        for record in read_corpus(path, unit=unit):
            if isinstance(record, Record):
                yield Trial(record.name, record.sentences, record.motion)


class LookUp:
    """Plays the trial whose sentences share most words with the prompt, the floor of every generator.

    Trials without a sentence do not count; DataError if none has one.
    """

    def __init__(self, trials: Sequence[Trial]) -> None:
        self._sentences: list[tuple[Trial, frozenset[str]]] = []
        for trial in sorted(trials, key=lambda trial: trial.name):
            for sentence in trial.sentences:
                words = frozenset(NEW_MODEL_RULES.words(sentence))
                if words:
                    self._sentences.append((trial, words))
        if not self._sentences:
            raise DataError("no trial to look up has a sentence")

    def generate(self, text: str, seed: int) -> Motion:
        """The motion of :meth:`nearest`, the same for every seed."""
        return self.nearest(text).motion

    def nearest(self, text: str) -> Trial:
        """The trial with the sentence that shares most different words with the text; of several such sentences the
        one with the fewest different words, then the first trial by name."""
        # most words in common, then fewest words
        text_words = frozenset(NEW_MODEL_RULES.words(text))
        nearest, _ = max(self._sentences, key=lambda pair: (len(text_words & pair[1]), -len(pair[1])))
        return nearest


def trained_on(manifest: Manifest, trials: Sequence[Trial]) -> set[str]:
    """The names of the trials that are neither validation nor test motions of a model; all of them if it does not say,
    or if it was trained on these, too (split "none")."""
    split = manifest.training.get("split", {})
    names = {trial.name for trial in trials}
    if split.get("by") == "none":
        return names
    return names.difference(split.get("validation", ()), split.get("test", ()))
