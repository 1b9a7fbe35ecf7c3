"""Batches of motions with sentences, out of a store: motions of similar length together, little in memory at a time."""

import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from motet.bundle.graph import Floats
from motet.errors import MotionError
from motet.models.language import padded
from motet.representation.base import FrameMirror
from motet.representation.contract import MotionContract
from motet.text.vocabulary import MAX_WORDS, RULES, Vocabulary
from motet_train.data.errors import DataError
from motet_train.data.sentences import alike, mirror_text, usable
from motet_train.data.store import Store

Ids = NDArray[np.int64]

Cut = Callable[[NDArray[Any], np.random.Generator], NDArray[Any]]
"""What is seen of the frames (T, D) of a motion: some of them, perhaps changed."""


@dataclass(frozen=True, eq=False)
class Rows:
    """A batch: fields are tensors with a row for each of B things, or None."""

    def __len__(self) -> int:
        """B."""
        return len(getattr(self, fields(self)[0].name))

    def __getitem__(self, rows: slice) -> Self:
        """Some of the rows, padded like all of them."""
        return self._each(lambda tensor: tensor[rows])

    def to(self, device: torch.device | str) -> Self:
        """The same rows on a device."""
        return self._each(lambda tensor: tensor.to(device))

    def _each(self, changed: Callable[[Tensor], Tensor]) -> Self:
        tensors = {one.name: getattr(self, one.name) for one in fields(self)}
        return replace(self, **{name: changed(tensor) for name, tensor in tensors.items() if tensor is not None})


@dataclass(frozen=True, eq=False)
class Batch(Rows):
    """B motions of up to T frames, each with one sentence of up to W words, padded on the right.

    frames: (B, T, D) float32 in the contract's units; finite, of any value, after the motion's end.
    lengths: (B,) int64, frames of each motion, at least 1.
    words: (B, W) int64, ids without SOS and EOS; PAD = 0 after the sentence's end.
    ended: (B,) bool, whether the motion ends after its last frame rather than being part of a longer one; None: all do.
    """

    frames: Tensor
    lengths: Tensor
    words: Tensor
    ended: Tensor | None = None


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
        mirror every other visit, by chance, is to the mirrored motion and sentence. With ``windows`` a batch takes at
        most :func:`drawn_length` frames of a motion, from a random place.
        """
        longest = windows[1] if windows else sys.maxsize
        together = 16 * batch  # are sorted by length: more would waste less on padding, and mix motions less
        visits = [
            (i, int(offset))
            for i, record in enumerate(self.records)
            for offset in rng.permutation(len(self.store.records[record].spans))[:offsets]
        ]
        shuffled = [visits[i] for i in rng.permutation(len(visits))]
        found = []
        for start in range(0, len(shuffled), together):
            near = sorted(shuffled[start : start + together], key=lambda visit: min(self._length(*visit), longest))
            found += [near[i : i + batch] for i in range(0, len(near), batch)]
        for place in rng.permutation(len(found)):
            limit = drawn_length(rng, windows) if windows else sys.maxsize
            yield _padded([self._visit(rng, i, offset, limit) for i, offset in found[place]])

    def everything(self, batch: int, longest: int | None = None) -> Iterator[Batch]:
        """The first ``longest`` frames of every motion, at its first offset, with each of its sentences: to validate.

        Sorted by length, never mirrored.
        """
        pairs = [(i, sentence) for i, found in enumerate(self.sentences) for sentence in found]
        pairs.sort(key=lambda pair: self._length(pair[0], 0))
        for start in range(0, len(pairs), batch):
            yield _padded([(*self._part(i, 0, 0, longest or sys.maxsize), s) for i, s in pairs[start : start + batch]])

    def _length(self, i: int, offset: int) -> int:
        start, stop = self.store.records[self.records[i]].spans[offset]
        return stop - start

    def _visit(self, rng: np.random.Generator, i: int, offset: int, longest: int) -> tuple[Floats, bool, Ids]:
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


def drawn_length(rng: np.random.Generator, windows: tuple[int, int]) -> int:
    """A number of frames between two, as often short as long on a logarithmic scale."""
    return round(float(np.exp(rng.uniform(*np.log(windows)))))


def examples(store: Store, records: Sequence[int], vocabulary: Vocabulary, mirror: FrameMirror | None) -> Examples:
    """The examples of those records that have a :func:`usable` sentence with a word of the vocabulary; DataError if
    there are none."""
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


def _padded(rows: Sequence[tuple[Floats, bool, Ids]]) -> Batch:
    """Frames (T, D), whether the motion ends with them, and ids of a sentence, as one batch."""
    frames, lengths = padded([frames for frames, _, _ in rows], "float32")
    sentences, _ = padded([sentence for _, _, sentence in rows], "int64")
    ended = torch.tensor([end for _, end, _ in rows])
    return Batch(torch.from_numpy(frames), torch.from_numpy(lengths), torch.from_numpy(sentences), ended)


@dataclass(frozen=True, eq=False)
class Pairs(Rows):
    """B motions with two sentences each, which may be the same.

    seen: (B, S) float32, the numbers by which a net knows a motion. words, others: (B, W) int64, ids, PAD = 0 after the
    end. groups: (B,) int64, equal for rows with a sentence in common.
    """

    seen: Tensor
    words: Tensor
    others: Tensor
    groups: Tensor


@dataclass(frozen=True, eq=False)
class Views:
    """N motions, as they are and perhaps mirrored: M = 1 or 2 kinds.

    seen: (M, N, K, S), of each motion K views, of so many frames (N, K). sentences: of each kind and motion. groups:
    (M, N).
    """

    seen: Tensor
    frames: NDArray[np.int64]
    sentences: tuple[tuple[tuple[Ids, ...], ...], ...]
    groups: NDArray[np.int64]

    def only(self, motions: Sequence[int]) -> "Views":
        """Some of the motions."""
        rows = list(motions)
        sentences = tuple(tuple(kind[row] for row in rows) for kind in self.sentences)
        return Views(self.seen[:, rows], self.frames[rows], sentences, self.groups[:, rows])

    def epoch(self, rng: np.random.Generator, batch: int) -> Iterator[Pairs]:
        """Visit every motion once, with mirroring, view and two sentences drawn afresh."""
        kinds, motions, views, _ = self.seen.shape
        order = rng.permutation(motions)
        for start in range(0, motions, batch):
            rows = order[start : start + batch]
            kind, view = rng.integers(kinds, size=len(rows)), rng.integers(views, size=len(rows))
            said = [self.sentences[m][i] for m, i in zip(kind, rows, strict=True)]
            words, others = (padded([s[rng.integers(len(s))] for s in said], "int64")[0] for _ in range(2))
            groups = torch.from_numpy(self.groups[kind, rows])
            yield Pairs(self.seen[kind, rows, view], torch.from_numpy(words), torch.from_numpy(others), groups)


def views(
    examples: Examples, see: Callable[[Tensor, Tensor], Tensor], count: int, cut: Cut, seed: int, whole: bool = False
) -> Views:
    """``count`` views of each motion of the examples, of any offset.

    see: from frames (B, T, D) of lengths (B,) to the numbers (B, S) by which a net knows a motion; computed once.
    cut: what is seen of frames (T, D). whole: one view more, the last, is of all frames.
    """
    rng, found, frames = np.random.default_rng(seed), [], []
    for record in examples.records:
        spans = len(examples.store.records[record].spans)
        parts = [cut(examples.store.sequence(record, int(rng.integers(spans))), rng) for _ in range(count)]
        parts += [examples.store.sequence(record).astype(np.float64)] * whole
        mirrored = [] if examples.mirror is None else [examples.mirror(part) for part in parts]
        frames.append(list(map(len, parts)))
        given, lengths = padded([*parts, *mirrored], "float32")
        found.append(see(torch.from_numpy(given), torch.from_numpy(lengths)))
    sentences = (examples.sentences,) if examples.mirror is None else (examples.sentences, examples.mirrored)
    seen = torch.stack(found).reshape(len(found), len(sentences), count + whole, -1).transpose(0, 1)
    groups = alike([[ids.tobytes() for ids in said] for kind in sentences for said in kind])
    return Views(seen, np.array(frames), sentences, np.array(groups, dtype=np.int64).reshape(len(sentences), -1))
