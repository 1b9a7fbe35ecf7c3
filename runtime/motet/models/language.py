"""What models between motion and language share: limits on inputs, and batches of sequences."""

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motet.bundle.graph import Arrays, Floats, Graph
from motet.bundle.manifest import Manifest
from motet.decode.loop import two_rows
from motet.errors import BundleError, MotionError, TextError, TextWarning, needs, warn
from motet.figures.feet.treadmill import travelling
from motet.models.base import BundleModel
from motet.motion.motion import Motion, is_many
from motet.motion.rotations import Array
from motet.text.clauses import stem
from motet.text.vocabulary import TextRules, Vocabulary

MAX_SECONDS = 30.0  # of a motion that a model takes, as in the paper's training data

ENCODED = 32
"""Sequences encoded at once: 47 motions take 28 ms on one thread, and in batches of 64 they take 75."""


def texts_of(sentences: str | Iterable[str]) -> list[str]:
    """A sentence, or several, as a list; ArgumentError for anything else."""
    texts = list(sentences) if is_many(sentences) else [sentences]
    for text in texts:
        needs(text, str, "a sentence")
    return [str(text) for text in texts]


class LanguageModel(BundleModel):
    """A model between motion and language: a motion contract, a vocabulary, graphs, and a decoding loop."""

    def __init__(self, manifest: Manifest, graphs: Mapping[str, Graph], tables: Arrays | None = None) -> None:
        super().__init__(manifest, graphs, tables)
        if manifest.text is None:
            raise BundleError("manifest, text: is missing")
        try:
            self.vocabulary = Vocabulary(manifest.vocabulary, TextRules.from_json(manifest.text), manifest.common)
        except TextError as error:
            raise BundleError(f"manifest, vocabulary: {error}") from error
        self.sizes["V"] = len(self.vocabulary)

    def unknown(self, sentence: str) -> list[str]:
        """The words of a sentence that the model does not know; TextError like :meth:`ids`."""
        return self.vocabulary.encode(sentence)[1]

    def ids(self, sentence: str) -> NDArray[np.int64]:
        """Ids (words,) int64 of a sentence, UNK for unknown words, which a TextWarning names. TextError for a sentence
        that is empty, too long, or of unknown words only."""
        ids, unknown = self.vocabulary.encode(sentence)
        if unknown:
            english = "; it is for English" if 2 * len(unknown) > len(ids) else ""
            warn(f"the model does not know {', '.join(unknown)} (in {sentence!r}){english}", TextWarning)
        for word in self.vocabulary.rules.words(sentence):
            if (meant := self.vocabulary.meant(word)) and stem(meant) != stem(word):
                warn(f"{word!r} is read as {meant!r} (in {sentence!r})", TextWarning)
        return ids

    def frames(self, motion: Motion) -> Array:
        """The frames (T, D) float64 of a motion in the contract's channels and units, resampled to its frame rate.

        A motion of any other human figure is retargeted onto the model's (docs/humanoid.md), and a clip in place is
        given the path that its feet imply (:func:`motet.motion.with_travel`), of which a TravelWarning tells.
        MotionError where the motion lacks channels (it names them), or has less than two frames or more than 30 s.
        """
        if motion.duration > MAX_SECONDS:
            limit = f"the model takes at most {MAX_SECONDS:g} s: cut it, or describe its windows"
            raise MotionError(f"the motion lasts {motion.duration:.1f} s, but {limit}")
        frames = self.contract.frames(self.on_figure(motion))
        if len(frames) < 2:
            raise MotionError(f"the model needs two frames at {self.fps:g} fps, but the motion has {len(frames)}")
        return frames

    def prepared(self, motion: Motion) -> Motion:
        """A motion as the model sees it, to be prepared once and reused; MotionError like :meth:`frames`."""
        return self.contract.features(self.frames(motion))

    def on_figure(self, motion: Motion) -> Motion:
        """A motion of any length on the model's figure, as in :meth:`frames`; one that is, at the model's frame rate,
        is taken as it is."""
        if motion.fps == self.fps and motion.skeleton == self.contract.skeleton:
            return motion
        return self.contract.on_figure(travelling(motion))

    def windows(self, motion: Motion, longest: float = MAX_SECONDS) -> list[tuple[float, Motion]]:
        """A motion of any length in the fewest equal parts of at most ``longest`` seconds, each with its start time.
        One of another human figure is first retargeted as a whole onto the model's, like in :meth:`frames`."""
        motion = self.on_figure(motion)
        most = max(1, math.floor(longest * motion.fps + 1e-9))  # parts are of whole frames
        count = max(1, math.ceil(len(motion) / most))
        edges = np.linspace(0, len(motion), count + 1).round().astype(int).tolist()
        return [(start / motion.fps, motion[start:stop]) for start, stop in pairwise(edges)]

    def contexts(self, sequences: Sequence[NDArray[Any]], role: str = "encoder") -> Floats:
        """Vectors (N, C) float32 of the sequences (T_i, ...) that the encoder of a role takes."""
        encoder = self.graphs[role]
        values_tensor = encoder.spec.inputs[0]
        context = encoder.spec.outputs[0]
        vectors = np.empty((len(sequences), context.size(1)), dtype=np.float32)
        order = np.argsort(list(map(len, sequences)), kind="stable")  # similar lengths together
        for start in range(0, len(order), ENCODED):
            rows = two_rows(order[start : start + ENCODED])
            values, lengths = padded([sequences[row] for row in rows], values_tensor.dtype)
            vectors[rows] = encoder({values_tensor.name: values, "lengths": lengths})[context.name]
        return vectors


def padded(
    sequences: Sequence[NDArray[Any]], dtype: str, length: int | None = None
) -> tuple[NDArray[Any], NDArray[np.int64]]:
    """Sequences (T_i, ...) as one array (B, T, ...), zeros on the right, and their lengths (B,) int64.

    length: T, that of the longest one by default.
    """
    lengths = np.array(list(map(len, sequences)), dtype=np.int64)
    result = np.zeros((len(sequences), length or int(lengths.max()), *sequences[0].shape[1:]), dtype=dtype)
    for row, sequence in zip(result, sequences, strict=True):
        row[: len(sequence)] = sequence
    return result, lengths
