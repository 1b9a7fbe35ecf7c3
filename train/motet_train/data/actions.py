"""Actions: what motions show, each with the sentences that ask for it; mirrored motions show mirrored actions."""

from collections.abc import Mapping
from dataclasses import dataclass

from motet.models.language import RULES
from motet_train.data.batches import usable
from motet_train.data.mirror_text import mirror_text
from motet_train.data.sixd_windows import action_of
from motet_train.data.store import Store


@dataclass(frozen=True)
class Actions:
    """of: the action that a record shows, as it is and mirrored. sentences: of each action, normalised, to train on.

    unseen: of each action those whose wordings are for measuring.
    """

    of: Mapping[tuple[int, bool], int]
    sentences: tuple[tuple[str, ...], ...]
    unseen: tuple[tuple[str, ...], ...]

    def __len__(self) -> int:
        """How many."""
        return len(self.sentences)


def actions_of(store: Store, records: tuple[int, ...]) -> Actions:
    """The actions of some records.

    Where none of the sentences of an action says a side, its mirror image is the same action.
    """
    numbers: dict[tuple[str, bool], int] = {}
    of: dict[tuple[int, bool], int] = {}
    said: list[tuple[dict[str, None], dict[str, None]]] = []
    sided = _sided(store, records)
    for record in records:
        entry = store.records[record]
        for mirrored in (False, True):
            key = action_of(store, record), mirrored and action_of(store, record) in sided
            number = of[record, mirrored] = numbers.setdefault(key, len(numbers))
            if number == len(said):
                said.append(({}, {}))
            for known, sentences in zip(said[number], (entry.sentences, entry.unseen), strict=True):
                known.update(dict.fromkeys(_worded(s, mirrored) for s in sentences if usable(s)))
    return Actions(of, tuple(tuple(found) for found, _ in said), tuple(tuple(found) for _, found in said))


def _sided(store: Store, records: tuple[int, ...]) -> set[str]:
    """The actions of which some sentence says a side."""
    return {
        action_of(store, record)
        for record in records
        if any(_worded(s, True) != _worded(s, False) for s in store.records[record].sentences)
    }


def _worded(sentence: str, mirrored: bool) -> str:
    return mirror_text(sentence) if mirrored else RULES.normalise(sentence)
