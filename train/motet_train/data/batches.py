"""Draw batches of motions with sentences from a store; motions of a batch have similar lengths."""

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
from motet.text.vocabulary import MAX_WORDS, NEW_MODEL_RULES, Vocabulary
from motet_train.data.errors import DataError
from motet_train.data.sentences import alike, mirror_text, usable
from motet_train.data.store import Store

Ids = NDArray[np.int64]

Sentences = tuple[tuple[Ids, ...], ...]
"""For each motion its sentences as ids."""

Visit = tuple[int, int, int | None]
"""A motion, its down-sampling offset, and which of its sentences; None for one that is drawn."""

Cut = Callable[[NDArray[Any], np.random.Generator], NDArray[Any]]
"""Takes frames (T, D) of a motion and random numbers; gives an excerpt (T', D), perhaps changed."""


@dataclass(frozen=True, eq=False)
class Rows:
    """A batch of B rows: each field is a tensor whose first axis is the rows, or None."""

    def __len__(self) -> int:
        """B."""
        return len(getattr(self, fields(self)[0].name))

    def __getitem__(self, rows: slice) -> Self:
        """A slice of the rows, with unchanged padding."""
        return self._each(lambda tensor: tensor[rows])

    def to(self, device: torch.device | str) -> Self:
        """The same rows on a device."""
        return self._each(lambda tensor: tensor.to(device))

    def _each(self, changed: Callable[[Tensor], Tensor]) -> Self:
        tensors = {}
        for field in fields(self):
            tensor = getattr(self, field.name)
            if tensor is not None:
                tensors[field.name] = changed(tensor)
        return replace(self, **tensors)


@dataclass(frozen=True, eq=False)
class Batch(Rows):
    """B motions of up to T frames, each with one sentence of up to W words, padded on the right.

    frames: (B, T, D) float32 in the contract's units; arbitrary finite values after the end of a motion.
    lengths: (B,) int64, frames of each motion, at least 1.
    words: (B, W) int64, ids without SOS and EOS; PAD = 0 after the end of the sentence.
    ended: (B,) bool, False for an excerpt that stops before the end of its motion; None if all motions end.
    """

    frames: Tensor
    lengths: Tensor
    words: Tensor
    ended: Tensor | None = None


@dataclass(frozen=True, eq=False)
class Examples:
    """Motions of one part of a store with their sentences as word ids.

    records: indices into the store. sentences: those of each record. mirrored: the same sentences with left and right
    exchanged, empty without ``mirror``. mirror: mirrors frames.
    """

    store: Store
    records: tuple[int, ...]
    sentences: Sentences
    mirrored: Sentences
    mirror: FrameMirror | None = None

    def epoch(
        self,
        rng: np.random.Generator,
        batch: int,
        offsets: int | None = None,
        windows: tuple[int, int] | None = None,
        pairs: bool = False,
    ) -> Iterator[Batch]:
        """Visit each motion once, in batches of at most ``batch``, each with one of its sentences drawn afresh.

        pairs: visit it once with each of its sentences instead.

        Every down-sampling offset of a motion is a visit of its own; ``offsets`` draws only so many of them. With a
        mirror, half of the visits are to the mirrored motion and sentence. With ``windows`` a batch takes at most
        :func:`drawn_length` frames of a motion, from a random start.
        """
        longest = windows[1] if windows else sys.maxsize
        batches = self._batches(rng, batch, offsets, longest, pairs)
        for place in rng.permutation(len(batches)):
            limit = drawn_length(rng, windows) if windows else sys.maxsize
            yield _padded([self._visit(rng, visit, limit) for visit in batches[place]])

    def _batches(
        self, rng: np.random.Generator, batch: int, offsets: int | None, longest: int, pairs: bool
    ) -> list[list[Visit]]:
        """Visits in random order, grouped into batches of similar length."""
        visits = self._visits(rng, offsets, pairs)
        shuffled = [visits[i] for i in rng.permutation(len(visits))]

        def length(visit: Visit) -> int:
            return min(self._length(*visit[:2]), longest)

        # sorting more motions together would waste less on padding, but mix them less
        together = 16 * batch
        batches = []
        for start in range(0, len(shuffled), together):
            similar = sorted(shuffled[start : start + together], key=length)
            batches += [similar[i : i + batch] for i in range(0, len(similar), batch)]
        return batches

    def _visits(self, rng: np.random.Generator, offsets: int | None, pairs: bool) -> list[Visit]:
        """Every motion at some or all of its offsets, once or with each of its sentences."""
        visits: list[Visit] = []
        for i, record in enumerate(self.records):
            sentences = range(len(self.sentences[i])) if pairs else (None,)
            for offset in rng.permutation(len(self.store.records[record].spans))[:offsets]:
                visits += [(i, int(offset), sentence) for sentence in sentences]
        return visits

    def everything(self, batch: int, longest: int | None = None) -> Iterator[Batch]:
        """The first ``longest`` frames of every motion, at its first offset, with each of its sentences: to validate.

        Sorted by length, never mirrored.
        """
        pairs = []
        for i, sentences in enumerate(self.sentences):
            pairs += [(i, ids) for ids in sentences]
        pairs.sort(key=lambda pair: self._length(pair[0], 0))
        # neighbours in length share a batch
        for start in range(0, len(pairs), batch):
            rows = []
            for i, ids in pairs[start : start + batch]:
                frames, ended = self._excerpt(i, 0, 0, longest or sys.maxsize)
                rows.append((frames, ended, ids))
            yield _padded(rows)

    def _length(self, i: int, offset: int) -> int:
        start, stop = self.store.records[self.records[i]].spans[offset]
        return stop - start

    def _visit(self, rng: np.random.Generator, visit: Visit, longest: int) -> tuple[Floats, bool, Ids]:
        i, offset, sentence = visit
        # a random excerpt
        start = int(rng.integers(max(0, self._length(i, offset) - longest) + 1))
        frames, ended = self._excerpt(i, offset, start, longest)
        # with a sentence of its own, perhaps both mirrored
        if sentence is None:
            sentence = int(rng.integers(len(self.sentences[i])))
        if self.mirror is not None and rng.random() < 0.5:
            return self.mirror(frames), ended, self.mirrored[i][sentence]
        return frames, ended, self.sentences[i][sentence]

    def _excerpt(self, i: int, offset: int, start: int, longest: int) -> tuple[Floats, bool]:
        """Up to ``longest`` frames of a motion, and whether the motion ends with them."""
        frames = self.store.sequence(self.records[i], offset)
        ended = self.store.records[self.records[i]].ends and start + longest >= len(frames)
        return frames[start : start + longest], ended


def drawn_length(rng: np.random.Generator, windows: tuple[int, int]) -> int:
    """A number of frames drawn log-uniformly between two limits."""
    return round(float(np.exp(rng.uniform(*np.log(windows)))))


def examples(store: Store, records: Sequence[int], vocabulary: Vocabulary, mirror: FrameMirror | None) -> Examples:
    """The examples of those records that have a :func:`usable` sentence with a word of the vocabulary.

    DataError if there are none.
    """
    kept = []
    sentences = []
    mirrored = []
    for record in records:
        # a sentence without any known word teaches nothing
        texts = []
        for text in store.records[record].sentences:
            if usable(text) and not vocabulary.ids.keys().isdisjoint(NEW_MODEL_RULES.words(text)):
                texts.append(text)
        if texts:
            kept.append(record)
            sentences.append(tuple(vocabulary.encode(text)[0] for text in texts))
            mirrored.append(tuple(vocabulary.encode(mirror_text(text))[0] for text in texts) if mirror else ())
    if not kept:
        raise DataError(f"none of {len(records)} motions has a sentence of 1 to {MAX_WORDS} words that can be used")
    return Examples(store, tuple(kept), tuple(sentences), tuple(mirrored), mirror)


def frame_mirror(contract: MotionContract) -> FrameMirror:
    """The mirroring of frames of a contract; DataError if they cannot be mirrored."""
    try:
        return contract.mirror
    except MotionError as error:
        raise DataError(f"the motions cannot be mirrored ({error}): train with --no-mirror") from error


def _padded(rows: Sequence[tuple[Floats, bool, Ids]]) -> Batch:
    """One batch of rows: frames (T, D), whether the motion ends with them, and the ids of a sentence."""
    frames, lengths = padded_tensors([frames for frames, _, _ in rows], "float32")
    sentences, _ = padded_tensors([sentence for _, _, sentence in rows], "int64")
    return Batch(frames, lengths, sentences, torch.tensor([end for _, end, _ in rows]))


def padded_tensors(rows: Sequence[NDArray[Any]], dtype: str) -> tuple[Tensor, Tensor]:
    """Rows (T, ...) of any lengths, padded on the right, (B, T, ...); and their lengths (B,)."""
    table, lengths = padded(rows, dtype)
    return torch.from_numpy(table), torch.from_numpy(lengths)


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
    """Views of N motions, as recorded (M = 1) or also mirrored (M = 2).

    seen: (M, N, K, S), K views of each motion. frames: (N, K), the lengths of these. sentences: by M and motion.
    groups: (M, N), equal for motions with a sentence in common.
    """

    seen: Tensor
    frames: NDArray[np.int64]
    sentences: tuple[Sentences, ...]
    groups: NDArray[np.int64]

    def only(self, motions: Sequence[int]) -> "Views":
        """Some of the motions."""
        rows = list(motions)
        sentences = []
        for by_motion in self.sentences:
            sentences.append(tuple(by_motion[row] for row in rows))
        return Views(self.seen[:, rows], self.frames[rows], tuple(sentences), self.groups[:, rows])

    def epoch(self, rng: np.random.Generator, batch: int) -> Iterator[Pairs]:
        """Visit every motion once, with mirroring, view and two sentences drawn afresh."""
        kinds, motions, views, _ = self.seen.shape
        order = rng.permutation(motions)
        for start in range(0, motions, batch):
            rows = order[start : start + batch]
            # for each motion whether it is mirrored, and which view is seen
            kind = rng.integers(kinds, size=len(rows))
            view = rng.integers(views, size=len(rows))
            # two of its sentences
            sentences = [self.sentences[k][row] for k, row in zip(kind, rows, strict=True)]
            words = _one_of_each(sentences, rng)
            others = _one_of_each(sentences, rng)
            groups = torch.from_numpy(self.groups[kind, rows])
            yield Pairs(self.seen[kind, rows, view], words, others, groups)


def _one_of_each(sentences: Sequence[Sequence[Ids]], rng: np.random.Generator) -> Tensor:
    """A random sentence of each motion, (B, W) int64."""
    ids, _ = padded_tensors([choices[int(rng.integers(len(choices)))] for choices in sentences], "int64")
    return ids


def views(
    examples: Examples,
    see: Callable[[Tensor, Tensor], Tensor],
    count: int,
    cut: Cut,
    seed: int,
    whole: bool = False,
) -> Views:
    """``count`` views of each motion of the examples, each of a random down-sampling offset.

    see: from frames (B, T, D) of lengths (B,) to the numbers (B, S) by which a net knows a motion; computed once.
    cut: draws an excerpt of frames (T, D). whole: add a last view of all frames.
    """
    rng = np.random.default_rng(seed)
    mirror = examples.mirror
    seen = []
    frames = []
    for record in examples.records:
        excerpts = _excerpts(examples.store, record, count, cut, rng, whole)
        frames.append(list(map(len, excerpts)))
        if mirror is not None:
            excerpts += [mirror(excerpt) for excerpt in excerpts]
        # the net sees all views of a motion at once
        seen.append(see(*padded_tensors(excerpts, "float32")))
    sentences = (examples.sentences,) if mirror is None else (examples.sentences, examples.mirrored)
    # (N, M K, S) becomes (M, N, K, S)
    by_motion = torch.stack(seen).reshape(len(seen), len(sentences), count + whole, -1)
    return Views(by_motion.transpose(0, 1), np.array(frames), sentences, _groups(sentences))


def _excerpts(
    store: Store, record: int, count: int, cut: Cut, rng: np.random.Generator, whole: bool
) -> list[NDArray[Any]]:
    """``count`` excerpts of a motion, and all of its frames if ``whole``."""
    offsets = len(store.records[record].spans)
    excerpts: list[NDArray[Any]] = []
    for _ in range(count):
        offset = int(rng.integers(offsets))
        excerpts.append(cut(store.sequence(record, offset), rng))
    if whole:
        excerpts.append(store.sequence(record).astype(np.float64))
    return excerpts


def _groups(sentences: Sequence[Sequence[Sequence[Ids]]]) -> NDArray[np.int64]:
    """Numbers (M, N), equal for motions that have a sentence in common."""
    texts = []
    for by_motion in sentences:
        for of_motion in by_motion:
            texts.append([ids.tobytes() for ids in of_motion])
    return np.array(alike(texts), dtype=np.int64).reshape(len(sentences), -1)
