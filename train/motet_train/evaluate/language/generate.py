"""All figures of a generate model in one nested object with stable keys: the chain from a sentence to a motion and back
(Plappert et al. 2017, section 5.4.3, tables 3 and 4), and whether motions do what was asked: walk, run, turn, jump."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from motet.errors import TextError
from motet.models.describe import DescribeModel
from motet.models.generate import Generated, GenerateModel
from motet.motion.motion import Motion
from motet.representation.root_block import ROOT_BLOCK, ROOT_BLOCK_UNITS
from motet_train.evaluate.language.attributes import common_side, common_turning, common_verbs
from motet_train.evaluate.language.describe import RANKS, bleu, ranks, retrieved
from motet_train.evaluate.language.motions import measures, quiet_energy
from motet_train.evaluate.language.split_store import SplitStore, unknown_words_allowed
from motet_train.evaluate.tables import Goals, Report, gathered

LANGUAGE_GOALS: Goals = {
    "gain.nearest": (0.10, None),
    "gain.frequent": (0.10, None),
    "words.verbs": (0.9, None),
    "words.sides": (0.8, None),
    "relative_test.1": (0.65, None),
    "asked.walks": (0.9, None),
    "asked.runs": (0.9, None),
    "asked.left": (0.9, None),
    "asked.right": (0.9, None),
    "asked.jumps": (0.9, None),
    "motion.frozen": (None, 0.1),
}
"""Figure -> (least, most) that the default recipes of describe and generate are to reach."""


def generate_report(model: GenerateModel, corpus: SplitStore, describe: DescribeModel | None = None) -> Report:
    """Tables 3 and 4 between their bounds; prompts; measures of generated motions beside the data's.

    "motion" is measured on the likeliest motion for each test sentence, "motion_data" on the motions they are about.

    describe: the model that closes the chain, trained on the same part of the corpus; without it the tables are left
        out. Relative performance is chained BLEU over its first training BLEU, as in the paper (there .387).
    """
    return corpus.origin(model.manifest) | gathered(_generated(model, corpus, describe), model.manifest.name)


def _generated(model: GenerateModel, corpus: SplitStore, describe: DescribeModel | None) -> Iterator[Report]:
    test, train = corpus.described(corpus.parts.test), corpus.described(corpus.parts.train, 40)
    found = answers(model, corpus, test)
    if describe is not None:
        yield _chain(describe, corpus, {"train": answers(model, corpus, train), "test": found})
    known = kinds(corpus)
    limits, quiet = thresholds(known), quiet_energy(corpus.motions(corpus.parts.train), corpus.contract)
    yield {"threshold": {"quiet": quiet, **limits}}
    if measurable(limits):
        yield {"asked": prompted(model, limits), "asked_data": recognised(known, limits)}
    motions = {"motion": [row[0].features for row in found.rows], "motion_data": corpus.motions(found.records)}
    yield {key: measures(shown, corpus.contract, quiet) for key, shown in motions.items()}
    yield {"likelihood": {"train": _likelihood(model, corpus, train), "test": _likelihood(model, corpus, test)}}


class Answers(NamedTuple):
    """Motions for sentences. records: for each sentence the one it describes. rows: ranked motions."""

    records: Sequence[int]
    sentences: Sequence[str]
    rows: Sequence[list[Generated]]


def answers(model: GenerateModel, corpus: SplitStore, records: Sequence[int]) -> Answers:
    """Ranked motions for every sentence of the records; one of which the model knows no word is left out.

    As many hypotheses as the model keeps by default, as users get them; from one that keeps less than five the last
    stands for those that lack.
    """
    asked = known_sentences(model, corpus, records)
    with unknown_words_allowed():
        rows = model.generate([sentence for _, sentence in asked])
    return Answers([record for record, _ in asked], [sentence for _, sentence in asked], rows)


def known_sentences(model: GenerateModel, corpus: SplitStore, records: Sequence[int]) -> list[tuple[int, str]]:
    """Every record with every sentence of it that the model can take."""
    return [(record, said) for record in records for said in corpus.sentences(record) if knows(model, said)]


def knows(model: GenerateModel, sentence: str, every_word: bool = False) -> bool:
    """Whether a model knows a word of a sentence, or every word."""
    try:
        return not (model.unknown(sentence) and every_word)
    except TextError:
        return False


def chained(describe: DescribeModel, found: Answers, corpus: SplitStore) -> dict[str, float]:
    """A row of table 3: BLEU of the descriptions of the first to the fifth motion, "1" to "5".

    One entry for each sentence that a motion was made for; references are all that was said about its record.
    """
    texts = [
        best_descriptions(describe, [row[min(rank, len(row) - 1)].features for row in found.rows])
        for rank in range(RANKS)
    ]
    return ranks(list(zip(*texts, strict=True)), corpus.references(found.records))


def bounds_chained(describe: DescribeModel, found: Answers, corpus: SplitStore) -> dict[str, float]:
    """The same with motions that are not generated.

    retrieval: the training motion about which the most alike sentence was said, the floor. data: the very motion that
    the sentence is about, what a perfect model would get.
    """
    records = {"retrieval": retrieved(corpus, found.sentences), "data": found.records}
    texts = {key: best_descriptions(describe, corpus.motions(chosen)) for key, chosen in records.items()}
    return {key: bleu(row, corpus.references(found.records)) for key, row in texts.items()}


def best_descriptions(describe: DescribeModel, motions: Sequence[Motion]) -> list[str]:
    """The best description of each motion; nothing for one that is too short to be described."""
    usable = [i for i, motion in enumerate(motions) if round(motion.duration * describe.fps) >= 2]
    rows = describe.describe([motions[i] for i in usable]) if usable else []
    texts = {i: row[0].text for i, row in zip(usable, rows, strict=True)}
    return [texts.get(i, "") for i in range(len(motions))]


def _chain(describe: DescribeModel, corpus: SplitStore, found: Mapping[str, Answers]) -> Report:
    train = corpus.described(corpus.parts.train, 200)
    base = bleu(best_descriptions(describe, corpus.motions(train)), corpus.references(train))
    rows = {part: chained(describe, own, corpus) for part, own in found.items()}
    bounds = bounds_chained(describe, found["test"], corpus)

    def relative(row: Mapping[str, float], ending: str = "") -> dict[str, float]:
        return {f"{key}{ending}": value / base if base else np.nan for key, value in row.items()}

    return {
        **{f"chain_{part}": row for part, row in rows.items()},
        **{f"relative_{part}": relative(row) for part, row in rows.items()},
        "bound": {"describe_train": base, **bounds, **relative(bounds, "_relative")},
    }


def _likelihood(model: GenerateModel, corpus: SplitStore, records: Sequence[int]) -> float:
    """Log-likelihood of a frame of the records' motions given each of their sentences, the ending frame included."""
    total, frames = 0.0, 0
    with unknown_words_allowed():
        for record, sentence in known_sentences(model, corpus, records):
            motion = corpus.motion(record)
            total += model.score(sentence, motion)
            frames += len(motion) + 1
    return total / frames if frames else np.nan


class Travel(NamedTuple):
    """How a motion moves over the ground.

    speed: the median forward, m/s, which a stop does not change. turn: the sum to the left, degrees. rise: the highest
    above the median height of the root, m.
    """

    speed: float
    turn: float
    rise: float


Thresholds = Mapping[str, float]
"""What counts as what, see :func:`thresholds`."""


class Asked(NamedTuple):
    """A sentence, whether a motion is what it says, and the thresholds that this takes."""

    sentence: str
    is_so: Callable[[Travel, Thresholds], bool]
    needs: tuple[str, ...]


ASKED: Mapping[str, Asked] = {
    "walks": Asked("a person walks", lambda travel, than: than["slow"] <= travel.speed < than["run"], ("slow", "run")),
    "runs": Asked("a person runs", lambda travel, than: travel.speed >= than["run"], ("run",)),
    "left": Asked("a person walks and turns left", lambda travel, than: travel.turn >= than["turn"], ("turn",)),
    "right": Asked("a person walks and turns right", lambda travel, than: travel.turn <= -than["turn"], ("turn",)),
    "jumps": Asked("a person jumps", lambda travel, than: travel.rise >= than["rise"], ("rise",)),
}


def travel(motion: Motion) -> Travel:
    """How a motion with the root block moves; what its first frame says of velocities repeats the second."""
    block = motion.select(ROOT_BLOCK, ROOT_BLOCK_UNITS).values
    steps, height = block[1:], block[:, 3]
    forward = float(np.median(steps[:, 0])) if len(steps) else 0.0
    return Travel(forward, float(steps[:, 2].sum() / motion.fps), float(height.max() - np.median(height)))


def kinds(corpus: SplitStore) -> dict[str, list[Travel]]:
    """How the training motions move that people say walk, run, jump, go straight, turn left, turn right.

    Empty without a root block. A motion that does two of walking, running and jumping is none of them.
    """
    found: dict[str, list[Travel]] = {key: [] for key in (*ASKED, "straight")}
    if not set(ROOT_BLOCK) <= set(corpus.store.channels):
        return found
    for record in corpus.described(corpus.parts.train):
        sentences = corpus.sentences(record)
        verbs, turning, side = common_verbs(sentences), common_turning(sentences), common_side(sentences)
        own = [f"{verb}s" for verb in verbs if len(verbs) == 1]
        if turning is False:
            own.append("straight")
        elif turning and side:
            own.append(side)
        for kind in own:
            found[kind].append(travel(corpus.motion(record)))
    return found


def thresholds(found: Mapping[str, Sequence[Travel]]) -> dict[str, float]:
    """The thresholds between :func:`kinds`, but for those without training motions of a kind.

    slow: m/s, half of the speed that nine of ten training walks exceed. run: m/s, between the median speeds of walks
    and of runs. turn: degrees, between the median turns of straight and of turning ones. rise: m, between the median
    rises of walks and of jumps.
    """
    walks, runs, jumps = (found[key] for key in ("walks", "runs", "jumps"))
    limits = {"slow": np.percentile([t.speed for t in walks], 10) / 2 if walks else np.nan}
    samples = {
        "run": ([t.speed for t in walks], [t.speed for t in runs]),
        "turn": ([abs(t.turn) for t in found["straight"]], [abs(t.turn) for t in (*found["left"], *found["right"])]),
        "rise": ([t.rise for t in walks], [t.rise for t in jumps]),
    }
    limits |= {key: np.mean([np.median(one) for one in pair]) for key, pair in samples.items() if all(pair)}
    return {key: float(limit) for key, limit in limits.items() if np.isfinite(limit)}


def measurable(limits: Thresholds) -> dict[str, Asked]:
    """Those of ASKED whose thresholds exist."""
    return {key: asked for key, asked in ASKED.items() if all(name in limits for name in asked.needs)}


def recognised(found: Mapping[str, Sequence[Travel]], limits: Thresholds) -> dict[str, float]:
    """What a model can reach: for each measurable one of ASKED the share of the training motions of that kind that
    count as such; NaN where there are none."""
    return {
        key: float(np.mean([asked.is_so(t, limits) for t in found[key]])) if found[key] else np.nan
        for key, asked in measurable(limits).items()
    }


def prompted(model: GenerateModel, limits: Thresholds, seeds: int = 10) -> dict[str, float]:
    """For each measurable one of ASKED the share of seeds whose likeliest motion is what the sentence says.

    A sentence of which the model knows no word counts as failed.
    """
    shares = {}
    for key, asked in measurable(limits).items():
        known = knows(model, asked.sentence)
        with unknown_words_allowed():
            rows = model.generate([asked.sentence] * seeds, seed=range(seeds)) if known else []
        shares[key] = sum(asked.is_so(travel(row[0].features), limits) for row in rows) / seeds
    return shares
