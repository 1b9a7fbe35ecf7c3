"""All figures of a describe model in one nested object with stable keys."""

from collections.abc import Iterator, Sequence

import numpy as np

from motet.errors import TextError
from motet.models.describe import DescribeModel
from motet.models.language import RULES
from motet_train.evaluate.language.attributes import words_right
from motet_train.evaluate.language.bleu import (
    RANKS,
    References,
    agreement,
    bleu,
    copied_bleu,
    frequent_sentence,
    nearest_motions,
    ranks,
)
from motet_train.evaluate.language.confidence import confidence, timeline_figures
from motet_train.evaluate.language.split_store import SplitStore, unknown_words_allowed
from motet_train.evaluate.tables import Report, gathered


def describe_report(model: DescribeModel, corpus: SplitStore) -> Report:
    """Table 2, with and without SOS and EOS; floors and ceiling; what the best description of test motions gets right.

    "confidence" and "timeline" are of validation motions, as the constants behind them were chosen on these.
    "bleu_unseen" is of those references alone that nobody said, word for word, about a training motion: where people
    describe from a pool of phrases, BLEU rewards knowing the pool. Motions without such a reference are left out.
    Since a phrase of four words either stands there or does not, "unseen" has BLEU-1 to BLEU-4 of the best description
    by the same references, and beside it that of copying what was said about the nearest training motion.
    Training BLEU is of 200 motions, always the same. A figure that does not exist is NaN.
    """
    return corpus.origin(model.manifest) | gathered(_described(model, corpus), model.manifest.name)


def _described(model: DescribeModel, corpus: SplitStore) -> Iterator[Report]:
    test, found = corpus.described(corpus.parts.test), dict[str, list[list[str]]]()
    for part, records in (("train", corpus.described(corpus.parts.train, 200)), ("test", test)):
        found[part] = [[one.text for one in row] for row in model.describe(corpus.motions(records), RANKS)]
        said = corpus.references(records)
        yield {f"bleu_{part}": ranks(found[part], said), f"bleu_{part}_marked": ranks(found[part], said, marks=True)}
    references = corpus.references(test)
    copied = corpus.references(nearest_motions(corpus, corpus.motions(test)))
    yield _unseen(found["test"], copied, references, corpus.unseen(test))
    best = [row[0] for row in found["test"]]
    floors = {
        "nearest": copied_bleu(copied, references),
        "frequent": bleu([frequent_sentence(corpus)] * len(references), references),
        "human": agreement(references),
    }
    own = bleu(best, references)
    yield {"floor": floors, "gain": {key: own - floors[key] for key in ("nearest", "frequent")}}
    yield {"words": words_right(best, references), "likelihood": {"test": _log_probability(model, corpus, test)}}
    if validation := [record for record in corpus.parts.validation if corpus.sentences(record)]:
        yield {"confidence": confidence(model, corpus, validation)}
        yield {"timeline": timeline_figures(model, corpus, validation)}


def _unseen(hypotheses: list[list[str]], copied: References, references: References, unseen: References) -> Report:
    """BLEU on references that stand in no training sentence, and how many do; beside the floor."""
    kept = [i for i, said in enumerate(unseen) if said]
    sentences = sum(map(len, references))
    counts = {
        "test_sentences": float(sentences),
        "test_sentences_seen": 1 - sum(map(len, unseen)) / sentences,
        "test_motions_unseen": float(len(kept)),
    }
    if not kept:
        return {"wording": counts, "bleu_unseen": dict.fromkeys(map(str, range(1, RANKS + 1)), np.nan)}
    rows, said, asked = ([row[i] for i in kept] for row in (hypotheses, copied, unseen))
    by_length = {f"bleu_{n}": bleu([row[0] for row in rows], asked, longest=n) for n in (1, 2, 3, 4)}
    floor = {f"nearest_{n}": copied_bleu(said, asked, n) for n in (1, 2, 3, 4)}
    return {"wording": counts, "bleu_unseen": ranks(rows, asked), "unseen": by_length | floor}


def _log_probability(model: DescribeModel, corpus: SplitStore, records: Sequence[int]) -> float:
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
