"""All figures of a generate model as one report: the chain from a sentence to a motion and back (Plappert et al. 2017,
section 5.4.3, tables 3 and 4), and whether motions do what the sentence says: walk, run, turn, jump."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from motet.errors import TextError
from motet.generate.base import Generated, GenerateModel
from motet.models.describe import DescribeModel
from motet.motion.motion import Motion
from motet.representation.root_block import ROOT_BLOCK, ROOT_BLOCK_UNITS
from motet_train.evaluate.language.attributes import common_side, common_turning, common_verbs
from motet_train.evaluate.language.describe import RANKS, bleu, ranked, ranks, retrieved
from motet_train.evaluate.language.motions import measures, quiet_energy
from motet_train.evaluate.language.split_store import SplitStore, unknown_words_allowed
from motet_train.evaluate.tables import Figures, Report, gathered, read_goals

LANGUAGE_GOALS = read_goals("language")


def generate_report(model: GenerateModel, corpus: SplitStore, describe: DescribeModel | None = None) -> Report:
    """Tables 3 and 4 with their bounds; prompts; measures of generated and of recorded motions.

    "motion" measures the most likely motion for each test sentence, "motion_data" the motions that these describe.

    describe: the model that closes the chain, trained on the same part of the corpus; without it the tables are left
        out. Relative performance is chained BLEU divided by its first training BLEU, as in the paper (there .387).
    """
    return corpus.origin(model.manifest) | gathered(_generated(model, corpus, describe), model.manifest.name)


def _generated(model: GenerateModel, corpus: SplitStore, describe: DescribeModel | None) -> Iterator[Report]:
    test = corpus.described(corpus.parts.test)
    train = corpus.described(corpus.parts.train, 40)
    # the chain from sentences to motions and back
    test_answers = answers(model, corpus, test)
    if describe is not None:
        yield _chain(describe, corpus, {"train": answers(model, corpus, train), "test": test_answers})

    # whether motions do what sentences say, by thresholds from the training motions
    travels = kinds(corpus)
    limits = thresholds(travels)
    quiet = quiet_energy(corpus.motions(corpus.parts.train), corpus.contract)
    yield {"threshold": {"quiet": quiet, **limits}}
    if measurable(limits):
        yield {"asked": prompted(model, limits), "asked_data": recognised(travels, limits)}

    # measures of the motions themselves
    generated = [row[0].features for row in test_answers.rows]
    recorded = corpus.motions(test_answers.records)
    yield {"motion": measures(generated, corpus.contract, quiet)}
    yield {"motion_data": measures(recorded, corpus.contract, quiet)}
    yield {"likelihood": {"train": _likelihood(model, corpus, train), "test": _likelihood(model, corpus, test)}}


class Answers(NamedTuple):
    """Motions for sentences. records: the record that each sentence describes. rows: ranked motions."""

    records: Sequence[int]
    sentences: Sequence[str]
    rows: Sequence[list[Generated]]


def answers(model: GenerateModel, corpus: SplitStore, records: Sequence[int]) -> Answers:
    """Ranked motions for every sentence of the records, except those without a word that the model knows.

    The number of hypotheses is the model's default, as for users; where it is below five, the last one stands for the
    missing ones.
    """
    known = known_sentences(model, corpus, records)
    sentences = [sentence for _, sentence in known]
    with unknown_words_allowed():
        rows = model.generate(sentences)
    return Answers([record for record, _ in known], sentences, rows)


def known_sentences(model: GenerateModel, corpus: SplitStore, records: Sequence[int]) -> list[tuple[int, str]]:
    """Every record with each of its sentences that the model accepts."""
    known = []
    for record in records:
        for sentence in corpus.sentences(record):
            if knows(model, sentence):
                known.append((record, sentence))
    return known


def knows(model: GenerateModel, sentence: str, every_word: bool = False) -> bool:
    """Whether a model knows a word of a sentence, or every word."""
    try:
        return not (model.unknown(sentence) and every_word)
    except TextError:
        return False


def chained(describe: DescribeModel, answers: Answers, corpus: SplitStore) -> Figures:
    """A row of table 3: BLEU of the descriptions of the first to the fifth motion, "1" to "5".

    Each sentence with a generated motion counts once; its references are all sentences of its record.
    """
    texts = []
    for rank in range(RANKS):
        motions = [ranked(row, rank).features for row in answers.rows]
        texts.append(best_descriptions(describe, motions))
    return ranks(list(zip(*texts, strict=True)), corpus.references(answers.records))


def bounds_chained(describe: DescribeModel, answers: Answers, corpus: SplitStore) -> Figures:
    """The same for recorded motions.

    retrieval: the training motion with the most similar sentence, the floor. data: the motion that the sentence
    describes, the score of a perfect model.
    """
    references = corpus.references(answers.records)
    scores = {}
    for key, records in {"retrieval": retrieved(corpus, answers.sentences), "data": answers.records}.items():
        scores[key] = bleu(best_descriptions(describe, corpus.motions(records)), references)
    return scores


def best_descriptions(describe: DescribeModel, motions: Sequence[Motion]) -> list[str]:
    """The best description of each motion; empty for a motion that is too short to be described."""
    usable = [i for i, motion in enumerate(motions) if round(motion.duration * describe.fps) >= 2]
    rows = describe.describe([motions[i] for i in usable]) if usable else []
    texts = [""] * len(motions)
    for i, row in zip(usable, rows, strict=True):
        texts[i] = row[0].text
    return texts


def _chain(describe: DescribeModel, corpus: SplitStore, answers: Mapping[str, Answers]) -> Report:
    train = corpus.described(corpus.parts.train, 200)
    train_bleu = bleu(best_descriptions(describe, corpus.motions(train)), corpus.references(train))
    # absolute scores, and those of recorded motions
    rows = {part: chained(describe, part_answers, corpus) for part, part_answers in answers.items()}
    bounds = bounds_chained(describe, answers["test"], corpus)

    # relative to the describe model on its own training motions
    report: Report = {f"chain_{part}": row for part, row in rows.items()}
    for part, row in rows.items():
        report[f"relative_{part}"] = _relative(row, train_bleu)
    relative_bounds = {f"{key}_relative": score for key, score in _relative(bounds, train_bleu).items()}
    report["bound"] = {"describe_train": train_bleu, **bounds, **relative_bounds}
    return report


def _relative(scores: Figures, train_bleu: float) -> Figures:
    return {key: score / train_bleu if train_bleu else np.nan for key, score in scores.items()}


def _likelihood(model: GenerateModel, corpus: SplitStore, records: Sequence[int]) -> float:
    """The mean log-likelihood of a frame, the ending frame included, of the records' motions given their sentences."""
    total = 0.0
    frames = 0
    with unknown_words_allowed():
        for record, sentence in known_sentences(model, corpus, records):
            motion = corpus.motion(record)
            total += model.score(sentence, motion)
            frames += len(motion) + 1
    return total / frames if frames else np.nan


class Travel(NamedTuple):
    """How a motion moves over the ground.

    speed: the median forward speed, m/s, robust against a stop. turn: the total turn to the left, degrees. rise: the
    highest root height above the median, m.
    """

    speed: float
    turn: float
    rise: float


Thresholds = Mapping[str, float]
"""Limits between kinds of motions, see :func:`thresholds`."""


class KindPrompt(NamedTuple):
    """A sentence, and the quantity of its motions that is at least one threshold, and below another if it has one."""

    sentence: str
    quantity: Callable[[Travel], float]
    least: str
    below: str | None = None

    def passes(self, travel: Travel, limits: Thresholds) -> bool:
        """Whether a motion is of the kind."""
        most = np.inf if self.below is None else limits[self.below]
        return limits[self.least] <= self.quantity(travel) < most


ASKED: Mapping[str, KindPrompt] = {
    "walks": KindPrompt("a person walks", lambda travel: travel.speed, "slow", "run"),
    "runs": KindPrompt("a person runs", lambda travel: travel.speed, "run"),
    "left": KindPrompt("a person walks and turns left", lambda travel: travel.turn, "turn"),
    "right": KindPrompt("a person walks and turns right", lambda travel: -travel.turn, "turn"),
    "jumps": KindPrompt("a person jumps", lambda travel: travel.rise, "rise"),
}


def travel(motion: Motion) -> Travel:
    """How a motion with the root block moves; the velocities of its first frame repeat the second and do not count."""
    block = motion.select(ROOT_BLOCK, ROOT_BLOCK_UNITS).values
    # the first frame has no velocity of its own
    steps = block[1:]
    height = block[:, 3]
    speed = np.median(steps[:, 0]) if len(steps) else 0.0
    turn = steps[:, 2].sum() / motion.fps
    rise = height.max() - np.median(height)
    return Travel(speed, turn, rise)


def kinds(corpus: SplitStore) -> dict[str, list[Travel]]:
    """How training motions move that people describe as walk, run, jump, straight, turning left or turning right.

    Empty lists without a root block. A motion with two of walking, running and jumping counts as none of them.
    """
    travels: dict[str, list[Travel]] = {key: [] for key in (*ASKED, "straight")}
    if not set(ROOT_BLOCK) <= set(corpus.store.channels):
        return travels
    for record in corpus.described(corpus.parts.train):
        sentences = corpus.sentences(record)
        verbs = common_verbs(sentences)
        turning = common_turning(sentences)
        side = common_side(sentences)
        # a single verb, and straight on or a turn to one side
        record_kinds = [f"{verb}s" for verb in verbs] if len(verbs) == 1 else []
        if turning is False:
            record_kinds.append("straight")
        elif turning and side:
            record_kinds.append(side)
        for kind in record_kinds:
            travels[kind].append(travel(corpus.motion(record)))
    return travels


def thresholds(travels: Mapping[str, Sequence[Travel]]) -> Figures:
    """The thresholds between :func:`kinds`, except those between kinds without training motions.

    slow: m/s, half of the speed that nine of ten training walks exceed. run: m/s, half-way between the median speeds of
    walks and of runs. turn: degrees, half-way between the median turns of straight and of turning motions. rise: m,
    half-way between the median rises of walks and of jumps.
    """
    walks = travels["walks"]
    turns = [*travels["left"], *travels["right"]]
    limits = {
        "slow": np.percentile([walk.speed for walk in walks], 10) / 2 if walks else np.nan,
        "run": _half_way(lambda travel: travel.speed, walks, travels["runs"]),
        "turn": _half_way(lambda travel: abs(travel.turn), travels["straight"], turns),
        "rise": _half_way(lambda travel: travel.rise, walks, travels["jumps"]),
    }
    return {key: limit for key, limit in limits.items() if np.isfinite(limit)}


def _half_way(quantity: Callable[[Travel], float], lower: Sequence[Travel], upper: Sequence[Travel]) -> float:
    """The value half-way between the medians of a quantity in two kinds; NaN if there is nothing on one side."""
    if not lower or not upper:
        return np.nan
    return float(np.mean([np.median(list(map(quantity, kind))) for kind in (lower, upper)]))


def measurable(limits: Thresholds) -> dict[str, KindPrompt]:
    """The entries of ASKED whose thresholds exist."""
    known = {*limits, None}
    return {key: prompt for key, prompt in ASKED.items() if {prompt.least, prompt.below} <= known}


def recognised(travels: Mapping[str, Sequence[Travel]], limits: Thresholds) -> Figures:
    """The ceiling of a model: for each measurable entry of ASKED the share of the training motions of that kind that
    pass its test; NaN without such motions."""
    shares = {}
    for key, prompt in measurable(limits).items():
        passed = [prompt.passes(recorded, limits) for recorded in travels[key]]
        shares[key] = float(np.mean(passed)) if passed else np.nan
    return shares


def prompted(model: GenerateModel, limits: Thresholds, seeds: int = 10) -> Figures:
    """For each measurable entry of ASKED the share of seeds whose most likely motion passes its test.

    A sentence without a word that the model knows counts as failed.
    """
    shares = {}
    for key, prompt in measurable(limits).items():
        known = knows(model, prompt.sentence)
        with unknown_words_allowed():
            rows = model.generate([prompt.sentence] * seeds, seed=range(seeds)) if known else []
        passed = [prompt.passes(travel(row[0].features), limits) for row in rows]
        shares[key] = sum(passed) / seeds
    return shares
