"""Kinds of motions, by what is said of them: usual ones, unusual ones, and everything else.

The rule was fixed before anything was measured by it.
"""

import re
from collections.abc import Mapping, Sequence

from motet_train.data.store import Entry

REST = "everything else"

KINDS: Mapping[str, tuple[str, ...]] = {
    "boxing": ("boxing", "boxer", "boxers", "punch", "punches", "punching", "jab", "jabs"),
    "dance": ("dance", "dances", "dancing", "dancer", "charleston", "salsa", "lambada", "macarena", "ballet"),
    "climbing": ("climb", "climbs", "climbing", "climber", "ladder"),
    "walks and runs": ("walk", "walks", "walking", "run", "runs", "running", "jog", "jogs", "jogging"),
}
"""Kind -> its words. An action belongs to the first kind of which a word is in it, before its first comma; where a
record names none, what counts is that half of its sentences have a word of the kind."""


def kind_of(entry: Entry) -> str:
    """The kind of a record of a store, :data:`REST` where no word fits."""
    if entry.action:
        return _first([entry.action.partition(",")[0]])
    return _first(entry.sentences)


def _first(texts: Sequence[str]) -> str:
    said = [set(re.findall(r"[a-z]+", text.lower())) for text in texts]
    for kind, words in KINDS.items():
        if said and sum(not words_of.isdisjoint(words) for words_of in said) * 2 >= len(said):
            return kind
    return REST


def by_kind(entries: Sequence[Entry]) -> dict[str, tuple[Entry, ...]]:
    """The records of each kind that has some, in the order of :data:`KINDS`, everything else last."""
    found = {kind: tuple(entry for entry in entries if kind_of(entry) == kind) for kind in (*KINDS, REST)}
    return {kind: members for kind, members in found.items() if members}
