"""All figures of a describe or generate model in one nested object with stable keys, and the goals of those we ship."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict

import numpy as np

from motet.bundle.manifest import Manifest
from motet.errors import TextError
from motet.models.describe import DescribeModel
from motet.models.generate import GenerateModel
from motet.models.language import RULES
from motet_train.evaluate.language.attributes import Score, sides_right, turns_right, verbs_right
from motet_train.evaluate.language.bleu import RANKS, References, agreement, bleu, ranks
from motet_train.evaluate.language.chain import Answers, answers, best_descriptions, bounds_chained, chained, likelihood
from motet_train.evaluate.language.confidence import confidence
from motet_train.evaluate.language.floors import copied_bleu, frequent_bleu, nearest_said
from motet_train.evaluate.language.motions import measures, quiet_energy
from motet_train.evaluate.language.prompts import kinds, measurable, prompted, recognised, thresholds
from motet_train.evaluate.language.split_store import SplitStore, unknown_words_allowed
from motet_train.evaluate.language.timelines import timeline_figures
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
"""Figure -> (least, most) that the default recipes are to reach."""

SAMPLE, CHAIN_SAMPLE = 200, 40
"""Training motions, always the same, of which training BLEU is taken, and chained training BLEU."""


def describe_report(model: DescribeModel, corpus: SplitStore) -> Report:
    """Table 2, with and without SOS and EOS; floors and ceiling; what the best description of test motions gets right.

    "confidence" and "timeline" are of validation motions, as the constants behind them were chosen on these.
    "bleu_unseen" is of those references alone that nobody said, word for word, about a training motion: where people
    describe from a pool of phrases, BLEU rewards knowing the pool. Motions without such a reference are left out.
    Since a phrase of four words either stands there or does not, "unseen" has BLEU-1 to BLEU-4 of the best description
    by the same references, and beside it that of copying what was said about the nearest training motion.
    A figure that does not exist is NaN.
    """
    return origin(model.manifest, corpus) | gathered(_described(model, corpus), model.manifest.name)


def _described(model: DescribeModel, corpus: SplitStore) -> Iterator[Report]:
    test, found = corpus.described(corpus.parts.test), dict[str, list[list[str]]]()
    references = corpus.references(test)
    for part, records in (("train", corpus.described(corpus.parts.train, SAMPLE)), ("test", test)):
        found[part] = [[one.text for one in row] for row in model.describe(corpus.motions(records), RANKS)]
        said = corpus.references(records)
        yield {f"bleu_{part}": ranks(found[part], said), f"bleu_{part}_marked": ranks(found[part], said, marks=True)}
    copied = nearest_said(corpus, test)
    yield _unseen(found["test"], copied, corpus, test)
    best = [row[0] for row in found["test"]]
    floors = {
        "nearest": copied_bleu(copied, references),
        "frequent": frequent_bleu(corpus, references),
        "human": agreement(references),
    }
    own = bleu(best, references)
    yield {"floor": floors, "gain": {key: own - floors[key] for key in ("nearest", "frequent")}}
    yield {"words": _words(best, references), "likelihood": {"test": _log_probability(model, corpus, test)}}
    if validation := [record for record in corpus.parts.validation if corpus.sentences(record)]:
        yield {"confidence": confidence(model, corpus, validation)}
        yield {"timeline": timeline_figures(model, corpus, validation)}


def generate_report(model: GenerateModel, corpus: SplitStore, describe: DescribeModel | None = None) -> Report:
    """Tables 3 and 4 between their bounds; prompts; measures of generated motions beside the data's.

    "motion" is measured on the likeliest motion for each test sentence, "motion_data" on the motions they are about.

    describe: the model that closes the chain, trained on the same part of the corpus; without it the tables are left
        out. Relative performance is chained BLEU over its first training BLEU, as in the paper (there .387).
    """
    return origin(model.manifest, corpus) | gathered(_generated(model, corpus, describe), model.manifest.name)


def _generated(model: GenerateModel, corpus: SplitStore, describe: DescribeModel | None) -> Iterator[Report]:
    test = corpus.described(corpus.parts.test)
    found = answers(model, corpus, test)
    if describe is not None:
        yield _chain(model, describe, corpus, found)
    known = kinds(corpus)
    limits, quiet = thresholds(known), quiet_energy(corpus.motions(corpus.parts.train), corpus.contract)
    kept = {key: value for key, value in asdict(limits).items() if np.isfinite(value)}
    yield {"threshold": {"quiet": quiet, **kept}}
    if measurable(limits):
        yield {"asked": prompted(model, limits), "asked_data": recognised(known, limits)}
    motions = {"motion": found.best, "motion_data": corpus.motions(found.records)}
    yield {key: measures(shown, corpus.contract, quiet) for key, shown in motions.items()}
    parts = {"train": corpus.described(corpus.parts.train, CHAIN_SAMPLE), "test": test}
    yield {"likelihood": {part: likelihood(model, corpus, records) for part, records in parts.items()}}


def origin(manifest: Manifest, corpus: SplitStore) -> Report:
    """How the model was trained, and how many motions and people are in each part of the data."""
    training, parts, store = manifest.training, corpus.parts, corpus.store
    told = ("seconds", "epochs", "kept_epoch", "loss", "validation", "steps_per_second")
    people = [{store.records[i].subject for i in part} for part in (parts.train, parts.test)]
    return {
        "train": {key: float(training[key]) for key in told if key in training},
        "data": {
            "train": float(len(parts.train)),
            "validation": float(len(parts.validation)),
            "test": float(len(parts.test)),
            "test_unknown_words": float(len(corpus.unknown_words(parts.test))),
            "test_people": float(len(people[1])),
            "test_people_unseen": float(len(people[1] - people[0])),
        },
    }


def _unseen(hypotheses: list[list[str]], copied: References, corpus: SplitStore, records: tuple[int, ...]) -> Report:
    """BLEU on references that stand in no training sentence, and how many do; beside the floor."""
    unseen = corpus.unseen(records)
    kept = [i for i, said in enumerate(unseen) if said]
    sentences = sum(map(len, corpus.references(records)))
    counts = {
        "test_sentences": float(sentences),
        "test_sentences_seen": 1 - sum(map(len, unseen)) / sentences,
        "test_motions_unseen": float(len(kept)),
    }
    if not kept:
        return {"wording": counts, "bleu_unseen": dict.fromkeys(map(str, range(1, RANKS + 1)), np.nan)}
    found, said, references = ([rows[i] for i in kept] for rows in (hypotheses, copied, unseen))
    best = [row[0] for row in found]
    by_length = {f"bleu_{n}": bleu(best, references, longest=n) for n in (1, 2, 3, 4)}
    floor = {f"nearest_{n}": copied_bleu(said, references, n) for n in (1, 2, 3, 4)}
    return {"wording": counts, "bleu_unseen": ranks(found, references), "unseen": by_length | floor}


def _words(texts: list[str], references: References) -> dict[str, float]:
    """Shares that are right, and of how many."""
    scores: dict[str, Score] = {
        "verbs": verbs_right(texts, references),
        "sides": sides_right(texts, references),
        "turns": turns_right(texts, references),
    }
    shares = {key: right / count if count else np.nan for key, (right, count) in scores.items()}
    return shares | {f"{key}_of": float(count) for key, (_, count) in scores.items()}


def _log_probability(model: DescribeModel, corpus: SplitStore, records: tuple[int, ...]) -> float:
    """Log-probability of a word of the records' sentences given their motions, EOS included."""
    total, count = 0.0, 0
    with unknown_words_allowed():
        for record in records:
            motion = corpus.motion(record)
            for sentence in corpus.sentences(record):
                try:
                    total += model.score(motion, sentence)
                except TextError:  # of unknown words only
                    continue
                count += len(RULES.words(sentence)) + 1
    return total / count if count else np.nan


def _chain(model: GenerateModel, describe: DescribeModel, corpus: SplitStore, found: Answers) -> Report:
    train = corpus.described(corpus.parts.train, SAMPLE)
    base = bleu(best_descriptions(describe, corpus.motions(train)), corpus.references(train))
    some = answers(model, corpus, corpus.described(corpus.parts.train, CHAIN_SAMPLE))
    rows = {"train": chained(describe, some, corpus), "test": chained(describe, found, corpus)}
    bounds = bounds_chained(describe, found, corpus)

    def relative(row: Mapping[str, float], ending: str = "") -> dict[str, float]:
        return {f"{key}{ending}": value / base if base else np.nan for key, value in row.items()}

    return {
        **{f"chain_{part}": row for part, row in rows.items()},
        **{f"relative_{part}": relative(row) for part, row in rows.items()},
        "bound": {"describe_train": base, **bounds, **relative(bounds, "_relative")},
    }
