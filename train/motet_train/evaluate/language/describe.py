"""How well motions are described: corpus BLEU-4 of ranked hypotheses (Papineni et al. 2002; Plappert et al. 2017,
section 5.3.3, tables 2 and 3), the floors a model has to beat, sentences looked up among the training motions, and all
figures of a describe model as one report."""

from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import chain, zip_longest
from operator import attrgetter
from typing import TypeVar

import numpy as np
from sacrebleu.metrics.bleu import BLEU
from sklearn.feature_extraction.text import TfidfVectorizer
from sklearn.metrics import pairwise_distances_argmin

from motet.errors import TextError
from motet.models.describe import DescribeModel
from motet.motion.motion import Motion
from motet.text.vocabulary import EOS, NEW_MODEL_RULES, SOS
from motet_train.evaluate.language.attributes import words_right
from motet_train.evaluate.language.confidence import confidence, timeline_figures
from motet_train.evaluate.language.motions import Looks
from motet_train.evaluate.language.split_store import SplitStore, plain, unknown_words_allowed
from motet_train.evaluate.tables import Figures, Report, gathered

RANKS = 5
"""Hypotheses for each motion, as in the paper."""

NGRAM_ORDERS = (1, 2, 3, 4)
"""Longest n-grams of the BLEU scores on unseen references."""

Hypothesis = TypeVar("Hypothesis")

Hypotheses = Sequence[Sequence[str]]
"""The ranked sentences for each motion."""

References = Sequence[Sequence[str]]
"""The normalised sentences about each motion."""


def bleu(hypotheses: Sequence[str], references: References, marks: bool = False, longest: int = 4) -> float:
    """Corpus BLEU of one sentence for each motion, 0 to 1: without smoothing, closest reference length.

    marks: keep SOS and EOS in hypotheses and references, as the authors did. Both match in every sentence, which raises
        the score; later papers leave them out.
    longest: the number of words in the longest n-grams.
    """
    form = f"{SOS} {{}} {EOS}" if marks else "{}"
    texts = [form.format(plain(hypothesis)) for hypothesis in hypotheses]
    # sacrebleu takes the first references of all motions, then the second ones
    marked = (map(form.format, sentences) for sentences in references)
    streams = list(map(list, zip_longest(*marked)))
    metric = BLEU(smooth_method="none", tokenize="none", force=True, max_ngram_order=longest)
    score: float = metric.corpus_score(texts, streams).score
    return min(score / 100, 1.0)  # rounding may exceed 1


def ranked(row: Sequence[Hypothesis], rank: int) -> Hypothesis:
    """The hypothesis of a rank, from 0, or the last of a row that has fewer."""
    return row[min(rank, len(row) - 1)]


def ranks(hypotheses: Hypotheses, references: References, marks: bool = False) -> Figures:
    """BLEU of the first, second, ... fifth hypothesis of every motion, as "1" to "5" (a row of table 2).

    A motion with fewer hypotheses counts with its last one.
    """
    scores = {}
    for rank in range(RANKS):
        texts = [ranked(row, rank) for row in hypotheses]
        scores[str(rank + 1)] = bleu(texts, references, marks)
    return scores


def agreement(references: References) -> float:
    """The score of people: BLEU of each motion's first, second, ... sentence against its others, averaged.

    Motions with a single sentence are left out; NaN without any other. A motion with fewer sentences than the maximum
    counts only for the sentences it has.
    """
    several = [sentences for sentences in references if len(sentences) > 1]
    if not several:
        return np.nan
    scores = []
    weights = []
    for place in range(max(map(len, several))):
        rows = [sentences for sentences in several if len(sentences) > place]
        # each motion with a sentence at this place, against its other sentences
        hypotheses = [sentences[place] for sentences in rows]
        others = [[*sentences[:place], *sentences[place + 1 :]] for sentences in rows]
        scores.append(bleu(hypotheses, others))
        weights.append(len(rows))
    return np.average(scores, weights=weights)


def nearest_motions(corpus: SplitStore, motions: Sequence[Motion]) -> list[int]:
    """For each motion the training record that looks most similar."""
    train = corpus.described(corpus.parts.train)
    looks = Looks(corpus)
    features = looks.features(motions)
    train_features = looks.features(corpus.motions(train))
    nearest_rows = pairwise_distances_argmin(features, train_features)
    return [train[row] for row in nearest_rows]


def copied_bleu(copied: References, references: References, longest: int = 4) -> float:
    """BLEU of repeating sentences about other motions, one list for each motion: the mean over their sentences."""
    scores = []
    for place in range(max(map(len, copied))):
        hypotheses = [sentences[place % len(sentences)] for sentences in copied]
        scores.append(bleu(hypotheses, references, longest=longest))
    return float(np.mean(scores))


def frequent_sentence(corpus: SplitStore) -> str:
    """The most frequent sentence about training motions, the first in alphabetical order of several."""
    sentences = chain.from_iterable(corpus.references(corpus.parts.train))
    counts = Counter(sentences)
    return min(counts, key=lambda sentence: (-counts[sentence], sentence))


def retrieved(corpus: SplitStore, sentences: Sequence[str]) -> list[int]:
    """For each sentence the training record with the most similar sentence.

    Similarity is the cosine between TF-IDF vectors of their words, the standard baseline.
    """
    references = corpus.references(corpus.parts.train)
    records = np.repeat(corpus.parts.train, list(map(len, references)))
    # cosines between all sentences and those of training
    vectors = TfidfVectorizer(token_pattern=r"\S+")
    table = vectors.fit_transform(chain.from_iterable(references))
    similarities = (vectors.transform(sentences) @ table.T).toarray()
    nearest: list[int] = records[similarities.argmax(axis=1)].tolist()
    return nearest


def describe_report(model: DescribeModel, corpus: SplitStore) -> Report:
    """Table 2, with and without SOS and EOS; floors and ceiling; how often the best descriptions are right.

    "confidence" and "timeline" use validation motions, since their constants were chosen on these. "bleu_unseen" uses
    only references that do not occur, word for word, among those of training motions: where people describe from a
    pool of phrases, BLEU rewards knowing the pool. Motions without such a reference are left out. "unseen" has BLEU-1
    to BLEU-4 of the best description for the same references, since a four-word phrase is all or nothing, and next to
    them the scores of copying the sentences of the nearest training motion. Training BLEU uses 200 motions, always the
    same. Undefined figures are NaN.
    """
    return corpus.origin(model.manifest) | gathered(_described(model, corpus), model.manifest.name)


def _described(model: DescribeModel, corpus: SplitStore) -> Iterator[Report]:
    # table 2
    train = corpus.described(corpus.parts.train, 200)
    test = corpus.described(corpus.parts.test)
    yield _table_2("train", _hypotheses(model, corpus, train), corpus.references(train))
    hypotheses = _hypotheses(model, corpus, test)
    references = corpus.references(test)
    yield _table_2("test", hypotheses, references)

    # the same on references that are not in training
    copied = corpus.references(nearest_motions(corpus, corpus.motions(test)))
    trained = corpus.trained_sentences()
    seen = sum(sentence in trained for sentence in chain.from_iterable(references))
    yield _unseen(hypotheses, copied, references, corpus.unseen(test), seen)

    # the best description of each motion against the floors
    best = [row[0] for row in hypotheses]
    yield _floors(best, copied, references, frequent_sentence(corpus))
    yield {"words": words_right(best, references), "likelihood": {"test": _log_probability(model, corpus, test)}}

    # what was chosen on validation motions, if any has a sentence
    yield from _validated(model, corpus)


def _validated(model: DescribeModel, corpus: SplitStore) -> Iterator[Report]:
    validation = [record for record in corpus.parts.validation if corpus.sentences(record)]
    if validation:
        yield {"confidence": confidence(model, corpus, validation)}
        yield {"timeline": timeline_figures(model, corpus, validation)}


def _floors(best: Sequence[str], copied: References, references: References, frequent: str) -> Report:
    """BLEU of copying, of the most frequent sentence and of people, and the gains over the first two."""
    score = bleu(best, references)
    floors = {"nearest": copied_bleu(copied, references), "frequent": bleu([frequent] * len(references), references)}
    gains = {key: score - floor for key, floor in floors.items()}
    return {"floor": {**floors, "human": agreement(references)}, "gain": gains}


def _hypotheses(model: DescribeModel, corpus: SplitStore, records: Sequence[int]) -> Hypotheses:
    """The ranked descriptions of each record."""
    rows = model.describe(corpus.motions(records), RANKS)
    return [list(map(attrgetter("text"), row)) for row in rows]


def _table_2(part: str, hypotheses: Hypotheses, references: References) -> Report:
    """The rows of table 2 for a part of the data."""
    return {
        f"bleu_{part}": ranks(hypotheses, references),
        f"bleu_{part}_marked": ranks(hypotheses, references, marks=True),
    }


def _unseen(
    hypotheses: Hypotheses, copied: References, references: References, unseen: References, seen: int
) -> Report:
    """BLEU on the sentences of motions that no training saw, beside the floor.

    references: what was said about the motions; ``seen`` of these sentences stand in training, word for word. unseen:
    for each motion the others, and those of the pool "test", which are no references.
    """
    motions = [i for i, sentences in enumerate(unseen) if sentences]
    sentences = sum(map(len, references))
    wording = {
        "test_sentences": float(sentences),
        "test_sentences_seen": seen / sentences,
        "test_motions_unseen": float(len(motions)),
    }
    if not motions:
        return {"wording": wording, "bleu_unseen": {str(rank + 1): np.nan for rank in range(RANKS)}}
    # only motions with unseen references count
    rows = [hypotheses[i] for i in motions]
    nearest = [copied[i] for i in motions]
    rows_unseen = [unseen[i] for i in motions]
    return {
        "wording": wording,
        "bleu_unseen": ranks(rows, rows_unseen),
        "unseen": _by_order(rows, nearest, rows_unseen),
    }


def _by_order(hypotheses: Hypotheses, copied: References, references: References) -> Figures:
    """BLEU of the first hypotheses, and of copying, for n-grams of each length."""
    best = [row[0] for row in hypotheses]
    scores = {f"bleu_{n}": bleu(best, references, longest=n) for n in NGRAM_ORDERS}
    floors = {f"nearest_{n}": copied_bleu(copied, references, n) for n in NGRAM_ORDERS}
    return scores | floors


def _log_probability(model: DescribeModel, corpus: SplitStore, records: Sequence[int]) -> float:
    """The mean log-probability of a word, EOS included, in the records' sentences given their motions."""
    total = 0.0
    count = 0
    with unknown_words_allowed():
        for record in records:
            motion = corpus.motion(record)
            for sentence in corpus.sentences(record):
                try:
                    total += model.score(motion, sentence)
                except TextError:  # all its words are unknown
                    continue
                count += len(NEW_MODEL_RULES.words(sentence)) + 1
    return total / count if count else np.nan
