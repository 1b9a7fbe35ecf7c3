"""Batches of motions with sentences, out of a store: motions of like length together, little in memory at a time."""

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from motet.bundle.graph import Floats
from motet.errors import MotionError
from motet.models.language import MAX_WORDS, RULES, Vocabulary, padded
from motet.representation.base import FrameMirror
from motet.representation.contract import MotionContract
from motet_train.data.batch import Batch
from motet_train.data.errors import DataError
from motet_train.data.mirror_text import mirror_text
from motet_train.data.store import Store

Ids = NDArray[np.int64]
Row = tuple[Floats, bool, Ids]
"""Frames (T, D), whether the motion ends with them, and the ids of a sentence."""

MAX = sys.maxsize

SHUFFLED = 16
"""Batches that are sorted by length together: more would waste less on padding, and mix motions less."""


@dataclass(frozen=True, eq=False)
class Examples:
    """The motions of one part of a store, each with its sentences as ids, and the mirrored ones' where mirror is set.

    sentences: for each of ``records`` its sentences; mirrored: the same sentences, mirrored.
    """

    store: Store
    records: tuple[int, ...]
    sentences: tuple[tuple[Ids, ...], ...]
    mirrored: tuple[tuple[Ids, ...], ...]
    mirror: FrameMirror | None = None

    def epoch(
        self, rng: np.random.Generator, batch: int, offsets: int | None = None, windows: tuple[int, int] | None = None
    ) -> Iterator[Batch]:
        """Visit motions once in batches of at most ``batch``, each with one of its sentences, drawn afresh.

        Every down-sampling offset of a motion is a visit of its own; ``offsets`` draws only so many for each. With a
        mirror every other visit, by chance, is to the mirrored motion and sentence. With
        ``windows`` a batch takes no more frames of a motion than a number drawn between the two, as often short as
        long on a logarithmic scale, and from a place drawn afresh.
        """
        longest = windows[1] if windows else MAX
        visits = [(i, int(offset)) for i in range(len(self.records)) for offset in self._drawn(rng, i, offsets)]
        shuffled = [visits[i] for i in rng.permutation(len(visits))]
        found = []
        for start in range(0, len(shuffled), SHUFFLED * batch):
            alike = shuffled[start : start + SHUFFLED * batch]
            alike.sort(key=lambda visit: min(self._length(*visit), longest))
            found += [alike[i : i + batch] for i in range(0, len(alike), batch)]
        for place in rng.permutation(len(found)):
            limit = round(float(np.exp(rng.uniform(*np.log(windows))))) if windows else MAX
            yield _padded([self._visit(rng, i, offset, limit) for i, offset in found[place]])

    def everything(self, batch: int, longest: int | None = None) -> Iterator[Batch]:
        """The first ``longest`` frames of every motion, at its first offset, with each of its sentences: to validate.

        Sorted by length, never mirrored.
        """
        pairs = [(i, sentence) for i, found in enumerate(self.sentences) for sentence in found]
        pairs.sort(key=lambda pair: self._length(pair[0], 0))
        for start in range(0, len(pairs), batch):
            cut = [(*self._part(i, 0, 0, longest or MAX), s) for i, s in pairs[start : start + batch]]
            yield _padded(cut)

    def _drawn(self, rng: np.random.Generator, i: int, offsets: int | None) -> Ids:
        count = len(self.store.records[self.records[i]].spans)
        return rng.permutation(count)[:offsets]

    def _length(self, i: int, offset: int) -> int:
        start, stop = self.store.records[self.records[i]].spans[offset]
        return stop - start

    def _visit(self, rng: np.random.Generator, i: int, offset: int, longest: int) -> Row:
        start = int(rng.integers(max(0, self._length(i, offset) - longest) + 1))
        frames, ended = self._part(i, offset, start, longest)
        sentence = int(rng.integers(len(self.sentences[i])))
        if self.mirror is not None and rng.random() < 0.5:
            return self.mirror(frames), ended, self.mirrored[i][sentence]
        return frames, ended, self.sentences[i][sentence]

    def _part(self, i: int, offset: int, start: int, longest: int) -> tuple[Floats, bool]:
        """Frames of a motion, and whether it ends with them."""
        frames = self.store.sequence(self.records[i], offset)
        ends = self.store.records[self.records[i]].ends and start + longest >= len(frames)
        return frames[start : start + longest], ends


def examples(store: Store, records: Sequence[int], vocabulary: Vocabulary, mirror: FrameMirror | None) -> Examples:
    """The examples of those records that have a sentence which can be used; DataError if there are none.

    A sentence that is not :func:`usable`, or has no word of the vocabulary, is left out.
    """
    kept, sentences, mirrored = [], [], []
    for record in records:
        said = (s for s in store.records[record].sentences if usable(s))
        found = [s for s in said if not vocabulary.ids.keys().isdisjoint(RULES.words(s))]
        if found:
            kept.append(record)
            sentences.append(tuple(vocabulary.encode(s)[0] for s in found))
            mirrored.append(tuple(vocabulary.encode(mirror_text(s))[0] for s in found) if mirror else ())
    if not kept:
        raise DataError(f"none of {len(records)} motions has a sentence of 1 to {MAX_WORDS} words that can be used")
    return Examples(store, tuple(kept), tuple(sentences), tuple(mirrored), mirror)


def frame_mirror(contract: MotionContract) -> FrameMirror:
    """How frames of a contract are mirrored; DataError where they cannot be."""
    try:
        return contract.mirror
    except MotionError as error:
        raise DataError(f"the motions cannot be mirrored ({error}): train with --no-mirror") from error


def usable(sentence: str) -> bool:
    """Whether a sentence has 1 to MAX_WORDS words."""
    return 1 <= len(RULES.words(sentence)) <= MAX_WORDS


def _padded(rows: Sequence[Row]) -> Batch:
    """The rows as one batch, padded on the right, sentences with PAD, whose id is 0."""
    frames, lengths = padded([frames for frames, _, _ in rows], "float32")
    sentences, _ = padded([sentence for _, _, sentence in rows], "int64")
    ended = torch.tensor([end for _, end, _ in rows])
    return Batch(torch.from_numpy(frames), torch.from_numpy(lengths), torch.from_numpy(sentences), ended)
