"""Describe: ranked sentences for a motion (section 4.2 of Plappert et al. 2017), and for each part of a long one.

Where a long motion changes is the best path of a hidden Markov model (Viterbi 1967) over short windows, whose states
are sentences and whose changes all cost the same.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Annotated, Any, ClassVar, Literal, SupportsIndex, TypedDict, Unpack, overload

import numpy as np
from numpy.typing import NDArray

from motet.bundle.graph import Arrays, Floats, Graph
from motet.bundle.manifest import Manifest
from motet.decode.beam import LOOPS, Hypothesis, Limits, noise_of, score_words
from motet.decode.loop import Ids, Loop, Scores, taken, two_rows
from motet.errors import DecodingError
from motet.models.language import ENCODED, MAX_SECONDS, LanguageModel, padded
from motet.models.nearest_neighbour import AnswerSettings, Known, Seen, known_of, path_of
from motet.motion.motion import Motion, motions_of
from motet.motion.rotations import Array
from motet.settings import Progress, Range, Settings, seeds_of, silent
from motet.text.vocabulary import EOS, PAD, SOS, UNK

Decoding = Literal["known", "beam", "consensus"]
"""How descriptions are found."""

COMPARED_AT_ONCE = 256
"""Motions that are compared with all known ones at once."""

LEAST_PROBABILITY = 1e-6
"""The probability below which none is told."""

EVENLY = 16
"""Where the step attends to frames, motions are padded to a multiple of this many, and only those of one length are
decoded together: how a sum over frames is rounded depends on their number."""


@dataclass(frozen=True, eq=False)
class Encoded:
    """Motions as a step knows them.

    rows: (N,), which of the motions these are. contexts: the step's inputs (N, ...) that the encoder takes or gives, by
    name.
    """

    rows: Ids
    contexts: Arrays

    def __getitem__(self, part: slice) -> "Encoded":
        """Some of the motions."""
        return Encoded(self.rows[part], {name: array[part] for name, array in self.contexts.items()})


@dataclass(frozen=True)
class ConfidenceSettings(Settings):
    """log_probability: least of a confident description. Training finds it (docs/describe.md)."""

    FEATURE: ClassVar[str] = "confidence"
    log_probability: Annotated[float, Range(-1000, 0, "nats")] = -5.5


@dataclass(frozen=True)
class TimelineSettings(Settings):
    """How a motion is cut into parts.

    window, hop: the length of a window, and the time from one to the next. Longer windows miss short actions: of the
        joins between motions of validation subjects, 1.5 s finds four fifths, 3 s half.
    change: the cost of a change of sentence. Three windows cover each moment, so with 12 nats a new sentence pays where
        it is e^4 times as probable for the length of a window.
    near: the distance within which a window is scored for other windows' sentences.
    """

    FEATURE: ClassVar[str] = "timeline"
    window: Annotated[float, Range(0.1, 30, "s")] = 1.5
    hop: Annotated[float, Range(0.1, 30, "s")] = 0.5
    change: Annotated[float, Range(0, 1000, "nats")] = 12.0
    near: Annotated[float, Range(0, 600, "s")] = 15.0


@dataclass(frozen=True)
class Description:
    """A sentence and the natural logarithm of its probability: that it is right about the motion, where known motions
    answer; else that it is said of the motion, in these very words.

    score: by which the sentences of a motion are ranked: the probability that it is right, the log-probability, or the
        agreement of a sampled sentence with all samples, from 0 to 1. confident: whether it is as probable as correct
        descriptions are.
    """

    text: str
    log_probability: float
    score: float
    confident: bool

    @property
    def probability(self) -> float:
        """The probability that is said in :attr:`log_probability`, from 0 to 1."""
        return math.exp(self.log_probability)

    def to_json(self) -> dict[str, Any]:
        """All fields and the probability as a JSON object."""
        return {**asdict(self), "probability": self.probability}


@dataclass(frozen=True)
class Part(Description):
    """A description of a part of a motion, from ``start`` to ``stop`` in seconds."""

    start: float
    stop: float


class _Options(TypedDict, total=False):
    decoding: Decoding | None
    seed: SupportsIndex
    progress: Progress


class DescribeModel(LanguageModel):
    """A motion captioning model. Its loops (:mod:`motet.decode.beam`) take the step, contexts (B, ...) by name, limits
    and their settings by name, and return up to ``beams`` hypotheses for each row, best first."""

    VERB = "describe"
    SETTINGS = (ConfidenceSettings, TimelineSettings, AnswerSettings)
    LOOPS = LOOPS
    known: Known | None = None
    """The motions that it knows, whose sentences answer; None for a model that only writes sentences."""

    def __init__(self, manifest: Manifest, graphs: Mapping[str, Graph], tables: Arrays | None = None) -> None:
        super().__init__(manifest, graphs, tables)
        self.bind("encoder", {"frames": "batch time D", "lengths": "*batch"}, {"context": "batch C"})
        encoder = graphs["encoder"].spec
        self.bind("step", self.loop.inputs, self.loop.outputs, provided=(*encoder.inputs, *encoder.outputs))
        self._attends = graphs["step"].spec.takes("lengths")
        if "space" in graphs:
            self.bind("space", {"frames": "batch time D", "lengths": "*batch"}, {"vector": "batch E"})
            self.known = known_of(self)

    @overload
    def describe(
        self, motions: Motion, beams: int | None = None, draws: int | None = None, **options: Unpack[_Options]
    ) -> list[Description]: ...
    @overload
    def describe(
        self, motions: Sequence[Motion], beams: int | None = None, draws: int | None = None, **options: Unpack[_Options]
    ) -> list[list[Description]]: ...
    def describe(
        self,
        motions: Motion | Sequence[Motion],
        beams: int | None = None,
        draws: int | None = None,
        *,
        decoding: Decoding | None = None,
        seed: SupportsIndex = 0,
        progress: Progress = silent,
    ) -> list[Description] | list[list[Description]]:
        """Up to ``beams`` descriptions of a motion, the best first; for several motions, a list for each.

        decoding: "known" for sentences about known motions that are near (:mod:`motet.models.nearest_neighbour`), of
            different kinds of action, or one, :data:`motet.models.nearest_neighbour.NOTHING`; "beam" for beam search,
            whose best is the most probable sentence; "consensus" for sampling ``draws`` sentences, the best being the
            one that agrees most with all (:mod:`motet.decode.beam`), not necessarily a probable one. By default
            consensus where ``draws`` is given, otherwise known where the bundle has known motions, or else the
            bundle's loop.
        seed: of sampling; each motion gets the same samples as alone.
        progress: called with the number of motions done and in total.

        A motion at another frame rate is resampled. MotionError like :meth:`frames`; cut longer motions with
        :meth:`windows`. DecodingError where ``beams`` (the bundle's by default) is not between 1 and 100, ``draws`` not
        between 1 and 1,000 or given for another decoding than consensus, the seed negative, or no motion known.
        """
        name = self._decoding(decoding, draws)
        if name == "known":
            described = self._answers(motions_of(motions), beams, progress)
            return described[0] if isinstance(motions, Motion) else described
        # else the net's own words, by the beam or by consensus of draws
        loop = self.LOOPS[name] if name else self.loop
        settings = self._settled(loop, {"beams": beams, "draws": draws}, seed)
        encoded = self._encoded([self.frames(motion) for motion in motions_of(motions)])
        rows = list(map(self._described, self._hypotheses(loop, encoded, settings, progress)))
        return rows[0] if isinstance(motions, Motion) else rows

    def _settled(self, loop: Loop, counts: Mapping[str, int | None], seed: SupportsIndex) -> dict[str, Any]:
        """All settings of a loop, and the noise that it draws with."""
        (first,) = seeds_of(seed, 1, DecodingError)
        settings: dict[str, Any] = {**loop.settled(loop.defaults(self.manifest.defaults), counts)}
        if "draws" in settings:
            settings["noise"] = noise_of(self.limits(settings), settings["draws"], first)
        return settings

    def _described(self, hypotheses: Sequence[Hypothesis]) -> list[Description]:
        """The hypotheses as sentences, and whether each is probable enough to be relied on."""
        least = self.settings(ConfidenceSettings).log_probability
        descriptions = []
        for hypothesis in hypotheses:
            log_probability = hypothesis.log_probability
            text = self.vocabulary.decode(hypothesis.ids)
            descriptions.append(Description(text, log_probability, hypothesis.score, log_probability >= least))
        return descriptions

    def _decoding(self, decoding: str | None, draws: int | None) -> str | None:
        """How to decode, None for the bundle's loop; DecodingError where that is not possible."""
        choices = ("known",) * (self.known is not None) + tuple(self.LOOPS)
        if decoding not in (None, *choices):
            raise DecodingError(f"decoding must be one of {', '.join(choices)}, not {decoding!r}")
        if decoding == "known" and draws is not None:
            raise DecodingError("known motions answer without draws: leave them out, or choose consensus")
        return decoding or ("consensus" if draws is not None else "known" if self.known else None)

    def _answers(self, motions: Sequence[Motion], beams: int | None, progress: Progress) -> list[list[Description]]:
        """What known motions answer."""
        assert self.known is not None
        beam = self.LOOPS["beam"]
        count = int(beam.settled(beam.defaults(self.manifest.defaults), {"beams": beams})["beams"])
        least = self.known.settings.sure
        answers = list[list[Description]]()
        # blocks bound the memory; progress counts motions
        for start in range(0, len(motions), COMPARED_AT_ONCE):
            for row in self.known.answers(self._seen(motions[start : start + COMPARED_AT_ONCE]), count):
                descriptions = []
                for text, chance in row:
                    descriptions.append(
                        Description(text, math.log(max(chance, LEAST_PROBABILITY)), chance, chance >= least)
                    )
                answers.append(descriptions)
            progress(len(answers), len(motions))
        return answers

    def _seen(self, motions: Sequence[Motion]) -> list[Seen]:
        """Motions as known ones are compared with them."""
        seen = list[Seen]()
        for motion in motions:
            frames = self.frames(motion)
            (vector,) = self.contexts([frames], "space")  # alone: padding changes how sums round
            seen.append(Seen(vector, len(frames) / self.fps, *path_of(frames, self.contract)))
        return seen

    def timeline(self, motion: Motion, *, progress: Progress = silent) -> list[Part]:
        """What happens in a motion of any length: consecutive parts, each with its best description.

        Short windows are described, each sentence (of known motions: each kind of action) is scored for all nearby
        windows, and the motion is cut where switching to another pays. Each part is then described like in
        :meth:`describe`, one of more than 30 s by its middle; neighbours with the same description are merged.

        progress: called with the number of windows done and in total.
        MotionError like :meth:`frames`, except for long motions.
        """
        motion = self.on_figure(motion).resample(self.fps)
        cuts_of = self._written_cuts if self.known is None else self._known_cuts
        return self._parts(motion, cuts_of(motion, progress))

    def _known_cuts(self, motion: Motion, progress: Progress) -> list[int]:
        """The frames at which the kind of action changes, by known motions."""
        assert self.known is not None
        settings = self.known.settings
        spans = windows(len(motion), motion.fps, TimelineSettings(settings.window, settings.hop))
        return edges(spans, best_path(self._kinds(motion, spans, progress), settings.change * 0.5 / settings.hop))

    def _written_cuts(self, motion: Motion, progress: Progress) -> list[int]:
        """The frames at which the sentence that is written changes."""
        settings = self.settings(TimelineSettings)
        spans = windows(len(motion), motion.fps, settings)
        # the best sentence of each window; windows have one length, and so are one group
        beam = self.LOOPS["beam"]
        encoded = self._encoded([self.frames(motion[start:stop]) for start, stop in spans])
        likeliest = self._hypotheses(beam, encoded, beam.defaults(self.manifest.defaults))
        ids = self.vocabulary.ids
        sentences = [(ids[SOS], *best.ids, ids[EOS]) for best, *_ in likeliest]
        # each sentence scored for the windows around its own
        near = round(settings.near / settings.hop)
        scores = near_scores(self.graphs["step"], encoded[0].contexts, sentences, near, progress)
        return edges(spans, best_path(scores, settings.change))

    def _kinds(self, motion: Motion, spans: Sequence[tuple[int, int]], progress: Progress) -> Iterator[Array]:
        """Of each window in turn the log-probabilities (Q,) of the sets of kinds of action."""
        assert self.known is not None
        for start in range(0, len(spans), COMPARED_AT_ONCE):
            frames = [self.frames(motion[a:b]) for a, b in spans[start : start + COMPARED_AT_ONCE]]
            counted, _ = self.known.near(self.contexts(frames, "space"))
            yield from np.log(0.02 + self.known.shares(counted))
            progress(start + len(frames), len(spans))

    def _parts(self, motion: Motion, cuts: list[int]) -> list[Part]:
        """Parts of a motion between cuts; a cut between two equal descriptions is dropped."""
        longest = int(MAX_SECONDS * motion.fps + 1e-9)
        middles = []
        for start, stop in pairwise(cuts):
            skipped = max(0, stop - start - longest) // 2
            middles.append(motion[start + skipped : stop][:longest])
        descriptions = [row[0] for row in self.describe(middles)]

        # what is described the same is one part
        inner = []
        for cut, (before, after) in zip(cuts[1:-1], pairwise(descriptions), strict=True):
            if before.text != after.text:
                inner.append(cut)
        if len(inner) < len(cuts) - 2:
            return self._parts(motion, [cuts[0], *inner, cuts[-1]])
        parts = []
        for description, (start, stop) in zip(descriptions, pairwise(cuts), strict=True):
            parts.append(Part(**asdict(description), start=start / motion.fps, stop=stop / motion.fps))
        return parts

    def _hypotheses(
        self, loop: Loop, encoded: Sequence[Encoded], settings: Mapping[str, Any], progress: Progress = silent
    ) -> list[list[Hypothesis]]:
        """The hypotheses of all motions, decoded in batches of the loop's size."""
        rest = {name: value for name, value in settings.items() if name != "max_words"}
        limits = self.limits(settings)
        count = sum(len(group.rows) for group in encoded)
        hypotheses: dict[int, list[Hypothesis]] = {}
        # motions of like length together; rows are in the order of the motions
        for group in encoded:
            for start in range(0, len(group.rows), loop.batch):
                batch = group[start : start + loop.batch]
                decoded = loop.run(self.graphs["step"], batch.contexts, limits, **rest)
                hypotheses.update(zip(batch.rows.tolist(), decoded, strict=True))
                progress(len(hypotheses), count)
        return [hypotheses[row] for row in range(count)]

    def _encoded(self, sequences: Sequence[Array]) -> list[Encoded]:
        """Frames (T_i, D) of motions as the step knows them, in groups to be decoded together."""
        if not self._attends:
            return [Encoded(np.arange(len(sequences)), {"context": self.contexts(sequences)})]
        lengths = np.array(list(map(len, sequences)), dtype=np.int64)
        even = -(-lengths // EVENLY) * EVENLY
        groups = []
        for length in np.unique(even):
            rows = np.flatnonzero(even == length)
            alike = [sequence for sequence, whole in zip(sequences, even, strict=True) if whole == length]
            groups.append(Encoded(rows, self._attended(alike, int(length))))
        return groups

    def _attended(self, sequences: Sequence[Array], length: int) -> Arrays:
        """All that the step takes of motions, frames (T_i, D) padded to one length: (N, ...), by name."""
        encoder = self.graphs["encoder"]
        frames, lengths = padded(sequences, "float32", length)
        inputs = {"frames": frames, "lengths": lengths}
        parts = []
        for start in range(0, len(sequences), ENCODED):
            rows = np.arange(start, min(start + ENCODED, len(sequences)))
            feeds = taken(inputs, two_rows(rows))
            parts.append(taken({**feeds, **encoder(feeds)}, np.arange(len(rows))))
        attended = dict[str, NDArray[Any]]()
        for name in parts[0]:
            if self.graphs["step"].spec.takes(name):
                attended[name] = np.concatenate([part[name] for part in parts])
        return attended

    def embed(self, motions: Motion | Sequence[Motion]) -> Floats:
        """The context vector (C,) float32 of a motion, or (N, C) of several; MotionError like :meth:`frames`."""
        vectors = self.contexts([self.frames(motion) for motion in motions_of(motions)])
        return vectors[0] if isinstance(motions, Motion) else vectors

    def score(self, motion: Motion, sentence: str) -> float:
        """Log-probability of a sentence given a motion; unknown words count as UNK, and a TextWarning names them."""
        ids = self.vocabulary.ids
        words = np.concatenate([[ids[SOS]], self.ids(sentence), [ids[EOS]]])[None]
        (encoded,) = self._encoded([self.frames(motion)])
        scores = score_words(self.graphs["step"], encoded.contexts, encoded.rows, words)
        return float(scores[0])

    def limits(self, settings: Mapping[str, Any]) -> Limits:
        """The limits of a sentence, in ids of the vocabulary, with "max_words" of the settings."""
        start, end, *banned = map(self.vocabulary.ids.__getitem__, (SOS, EOS, PAD, UNK))
        return Limits(start, end, int(settings["max_words"]), [start, *banned])

    def replay(self, inputs: Arrays, settings: Mapping[str, Any]) -> Arrays:
        """Frames (T, D), and noise where the loop draws, to ids (W, words) int64 and log-probabilities (W,)."""
        extra = {"noise": inputs["noise"]} if "noise" in inputs else {}
        chosen = self.loop.settled(self.defaults, settings)
        (row,) = self._hypotheses(self.loop, self._encoded([inputs["frames"]]), {**chosen, **extra})
        ids = np.zeros((len(row), max(len(hypothesis.ids) for hypothesis in row)), dtype=np.int64)
        for place, hypothesis in zip(ids, row, strict=True):
            place[: len(hypothesis.ids)] = hypothesis.ids
        return {"ids": ids, "log_probabilities": np.array([hypothesis.log_probability for hypothesis in row])}


def windows(frames: int, fps: float, settings: TimelineSettings) -> list[tuple[int, int]]:
    """Frames (start, stop) of overlapping windows, evenly spread, of the settings' length or the motion's."""
    length = max(2, round(settings.window * fps))
    hop = max(1, round(settings.hop * fps))
    count = max(1, 1 + -(-(frames - length) // hop))
    starts = np.linspace(0, max(0, frames - length), count).round().astype(int).tolist()
    return [(start, min(start + length, frames)) for start in starts]


def near_scores(
    step: Graph,
    contexts: Arrays,
    sentences: Sequence[tuple[int, ...]],
    near: int,
    progress: Progress = silent,
    at_once: int = 512,
) -> Scores:
    """Log-probabilities (W, S) of the sentences of W windows, sorted by their ids, given each window.

    contexts: of the windows, as in :func:`motet.decode.beam.beam_search`. sentences: the ids of one for each window,
    from the start to the end. near: how many windows before and after a window are scored for its sentence; the others
    get minus infinity. progress: counts windows. at_once: pairs scored in one batch.
    """
    # each sentence once, and which pairs with windows are near enough to be scored
    places = {ids: place for place, ids in enumerate(sorted(set(sentences)))}
    words = padded([np.array(ids) for ids in places], "int64")[0]
    rows, columns = _near_pairs(np.array([places[ids] for ids in sentences]), near)
    scores = np.full((len(sentences), len(places)), -np.inf)
    # batch after batch; the others stay at minus infinity
    for start in range(0, len(rows), at_once):
        row = rows[start : start + at_once]
        column = columns[start : start + at_once]
        scores[row, column] = score_words(step, contexts, row, words[column])
        progress(int(row[-1]) + 1, len(sentences))
    return scores


def _near_pairs(sentence_of_row: Ids, near: int) -> tuple[Ids, Ids]:
    """Each window (P,) with each sentence (P,) of those up to ``near`` before and after it."""
    nearby = []
    for row in range(len(sentence_of_row)):
        nearby.append(np.unique(sentence_of_row[max(0, row - near) : row + near + 1]))
    counts = [len(sentences) for sentences in nearby]
    return np.repeat(np.arange(len(nearby)), counts), np.concatenate(nearby)


def best_path(scores: Iterable[Array], change: float, at_once: int = COMPARED_AT_ONCE) -> list[int]:
    """For each window (S,) the column such that the sum, less ``change`` for each change of column, is largest.

    at_once: windows after which what is behind them is decided as far as all paths agree on it, so that memory does not
    grow with the length.
    """
    rows = iter(scores)
    best = next(rows)
    back = list[NDArray[np.intp]]()
    path = list[int]()
    for row in rows:
        leader = int(best.argmax())
        stays = best >= best[leader] - change
        back.append(np.where(stays, np.arange(len(best)), leader))
        best = np.where(stays, best, best[leader] - change) + row
        if len(back) % at_once == 0:
            path += _agreed(back, len(best))
    return path + _traced(back, int(best.argmax()))


def _traced(back: Sequence[NDArray[np.intp]], last: int) -> list[int]:
    """The path that ends in a column."""
    path = [last]
    for before in reversed(back):
        path.append(int(before[path[-1]]))
    return path[::-1]


def _agreed(back: list[NDArray[np.intp]], columns: int) -> list[int]:
    """The beginning that all paths share, which is taken from ``back``."""
    ends = np.arange(columns)
    for place in range(len(back) - 1, -1, -1):
        ends = back[place][ends]
        if (ends == ends[0]).all():
            path = _traced(back[:place], int(ends[0]))
            del back[: place + 1]
            return path
    return []


def edges(spans: Sequence[tuple[int, int]], path: Sequence[int]) -> list[int]:
    """The boundaries of parts in frames: the first, the last, and the middle between two windows that differ."""
    middles = [(start + stop) / 2 for start, stop in spans]
    boundaries = [spans[0][0]]
    for (before, after), (column, next_column) in zip(pairwise(middles), pairwise(path), strict=True):
        if column != next_column:
            boundaries.append(round((before + after) / 2))
    return [*boundaries, spans[-1][1]]
