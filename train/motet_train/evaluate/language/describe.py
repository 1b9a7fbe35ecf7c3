"""How well motions are described: corpus BLEU-4 of ranked hypotheses (Papineni et al. 2002; Plappert et al. 2017,
section 5.3.3, tables 2 and 3), what a model has to beat, answers looked up among the training motions, and all figures
of a describe model in one nested object with stable keys."""

from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import zip_longest

import numpy as np
from sacrebleu.metrics.bleu import BLEU
from sklearn.feature_extraction.text import TfidfVectorizer
from sklearn.metrics import pairwise_distances_argmin

from motet.errors import TextError
from motet.models.describe import DescribeModel
from motet.models.language import EOS, RULES, SOS
from motet.motion.motion import Motion
from motet_train.evaluate.language.attributes import words_right
from motet_train.evaluate.language.confidence import confidence, timeline_figures
from motet_train.evaluate.language.motions import Looks
from motet_train.evaluate.language.split_store import SplitStore, plain, unknown_words_allowed
from motet_train.evaluate.tables import Report, gathered

RANKS = 5
"""Hypotheses for each motion, as in the paper."""

References = Sequence[Sequence[str]]
"""For each motion what was said about it, normalised."""


def bleu(hypotheses: Sequence[str], references: References, marks: bool = False, longest: int = 4) -> float:
    """Corpus BLEU of one sentence for each motion, 0 to 1: not smoothed, closest reference length.

    longest: n-grams up to so many words count.
    marks: keep SOS and EOS in hypotheses and references, as the authors did. Both are matched in every sentence, which
    makes the figure higher; later papers leave them out.
    """
    form = f"{SOS} {{}} {EOS}" if marks else "{}"
    streams = zip_longest(*(map(form.format, said) for said in references))
    metric = BLEU(smooth_method="none", tokenize="none", force=True, max_ngram_order=longest)
    score: float = metric.corpus_score([form.format(plain(t)) for t in hypotheses], list(map(list, streams))).score
    return min(score / 100, 1.0)  # which rounding may exceed


def ranks(hypotheses: Sequence[Sequence[str]], references: References, marks: bool = False) -> dict[str, float]:
    """BLEU of the first, second, ... fifth hypothesis of every motion, as "1" to "5" (a row of table 2).

    A motion with fewer hypotheses takes part with its last one.
    """
    return {
        str(rank + 1): bleu([row[min(rank, len(row) - 1)] for row in hypotheses], references, marks)
        for rank in range(RANKS)
    }


def agreement(references: References) -> float:
    """What people reach: each motion's first, second, ... sentence against its others; the mean of these BLEU.

    Motions with a single sentence are left out; NaN if there is no other. One with fewer sentences than the
    most talked about takes part with as many as it has.
    """
    several = [said for said in references if len(said) > 1]
    if not several:
        return np.nan
    values, counts = [], []
    for place in range(max(map(len, several))):
        rows = [said for said in several if len(said) > place]
        values.append(bleu([said[place] for said in rows], [[*said[:place], *said[place + 1 :]] for said in rows]))
        counts.append(len(rows))
    return float(np.average(values, weights=counts))


def nearest_motions(corpus: SplitStore, motions: Sequence[Motion]) -> list[int]:
    """For each motion the training record that looks most like it."""
    train, looks = corpus.described(corpus.parts.train), Looks(corpus)
    found = pairwise_distances_argmin(looks.features(motions), looks.features(corpus.motions(train)))
    return [train[i] for i in found]


def copied_bleu(said: References, references: References, longest: int = 4) -> float:
    """BLEU of repeating what was said about other motions: the mean over their sentences."""
    copies = ([sentences[place % len(sentences)] for sentences in said] for place in range(max(map(len, said))))
    return float(np.mean([bleu(copy, references, longest=longest) for copy in copies]))


def frequent_sentence(corpus: SplitStore) -> str:
    """The most frequent sentence about training motions, of several the first by name."""
    counts = Counter(sentence for said in corpus.references(corpus.parts.train) for sentence in said)
    return min(counts, key=lambda sentence: (-counts[sentence], sentence))


def retrieved(corpus: SplitStore, sentences: Sequence[str]) -> list[int]:
    """For each sentence the training record with the most similar sentence.

    Alike by the cosine of their words, weighted by TF-IDF: the safe choice of applications.
    """
    known = [(record, said) for record in corpus.parts.train for said in corpus.sentences(record)]
    vectors = TfidfVectorizer(token_pattern=r"\S+")
    table = vectors.fit_transform([said for _, said in known])
    alike = (vectors.transform(sentences) @ table.T).toarray()
    return [known[i][0] for i in alike.argmax(axis=1)]


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
