"""Kinds of motions, by what is said of them: usual ones, unusual ones, and everything else.

The rule was fixed before anything was measured by it.
"""

import re
from collections.abc import Mapping, Sequence

from motet_train.data.store import Entry

KINDS: Mapping[str, str] = {
    "boxing": "boxing|boxers?|punch|punches|punching|jabs?",
    "dance": "dance|dances|dancing|dancer|charleston|salsa|lambada|macarena|ballet",
    "climbing": "climb|climbs|climbing|climber|ladder",
    "walks and runs": "walk|walks|walking|run|runs|running|jog|jogs|jogging",
}
"""Kind -> its words. An action belongs to the first kind of which a word is in it, before its first comma; where a
record names none, what counts is that half of its sentences have a word of the kind."""

REST = "everything else"


def kind_of(entry: Entry) -> str:
    """The kind of a record of a store, :data:`REST` where no word fits."""
    texts = [entry.action.partition(",")[0]] if entry.action else entry.sentences
    for kind, words in KINDS.items():
        if texts and 2 * sum(_says(text, words) for text in texts) >= len(texts):
            return kind
    return REST


def _says(text: str, words: str) -> bool:
    return any(re.fullmatch(words, word) for word in re.findall(r"[a-z]+", text.lower()))


def by_kind(entries: Sequence[Entry]) -> dict[str, list[Entry]]:
    """The records of each kind that has some, in the order of :data:`KINDS`, everything else last."""
    found = {kind: [entry for entry in entries if kind_of(entry) == kind] for kind in (*KINDS, REST)}
    return {kind: members for kind, members in found.items() if members}
