"""Corpus BLEU-4 of ranked hypotheses (Papineni et al. 2002; Plappert et al. 2017, section 5.3.3, tables 2 and 3)."""

from collections.abc import Sequence
from itertools import zip_longest

import numpy as np
from sacrebleu.metrics.bleu import BLEU

from motet.models.language import EOS, SOS
from motet_train.evaluate.language.split_store import plain

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
    mark = _marked if marks else str
    streams = zip_longest(*(map(mark, said) for said in references))
    metric = BLEU(smooth_method="none", tokenize="none", force=True, max_ngram_order=longest)
    score: float = metric.corpus_score([mark(plain(text)) for text in hypotheses], list(map(list, streams))).score
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
    found = []
    for place in range(max(map(len, several), default=0)):
        rows = [said for said in several if len(said) > place]
        others = [[*said[:place], *said[place + 1 :]] for said in rows]
        found.append((bleu([said[place] for said in rows], others), len(rows)))
    values, counts = zip(*found, strict=True) if found else ((np.nan,), (1,))
    return float(np.average(values, weights=counts))


def _marked(sentence: str) -> str:
    return f"{SOS} {sentence} {EOS}"
