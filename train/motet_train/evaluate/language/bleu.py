"""Corpus BLEU-4 of ranked hypotheses (Papineni et al. 2002; Plappert et al. 2017, section 5.3.3, tables 2 and 3), and
what a model has to beat: answers looked up among the training motions."""

from collections import Counter
from collections.abc import Sequence
from itertools import zip_longest

import numpy as np
from sacrebleu.metrics.bleu import BLEU
from sklearn.feature_extraction.text import TfidfVectorizer
from sklearn.metrics import pairwise_distances_argmin

from motet.models.language import EOS, SOS
from motet.motion.motion import Motion
from motet_train.evaluate.language.motions import Looks
from motet_train.evaluate.language.split_store import SplitStore, plain

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
