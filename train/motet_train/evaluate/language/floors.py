"""What a model has to beat: answers looked up among the training motions."""

from collections import Counter
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from sklearn.feature_extraction.text import TfidfVectorizer
from sklearn.metrics import pairwise_distances_argmin

from motet.motion.motion import Motion
from motet_train.evaluate.language.bleu import References, bleu
from motet_train.evaluate.language.looks import Looks
from motet_train.evaluate.language.split_store import SplitStore


def nearest_motions(corpus: SplitStore, motions: Sequence[Motion]) -> list[int]:
    """For each motion the training record that looks most like it."""
    train, looks = corpus.described(corpus.parts.train), Looks(corpus)
    found = pairwise_distances_argmin(looks.features(motions), looks.features(corpus.motions(train)))
    return [train[i] for i in found]


def nearest_said(corpus: SplitStore, records: Sequence[int]) -> list[tuple[str, ...]]:
    """What was said about the nearest training motion of each record."""
    return corpus.references(nearest_motions(corpus, corpus.motions(records)))


def copied_bleu(said: References, references: References, longest: int = 4) -> float:
    """BLEU of repeating what was said about other motions: the mean over their sentences."""
    most = max(map(len, said))
    copies = [[sentences[place % len(sentences)] for sentences in said] for place in range(most)]
    return float(np.mean([bleu(copy, references, longest=longest) for copy in copies]))


def frequent_sentence(corpus: SplitStore) -> str:
    """The most frequent sentence about training motions, of several the first by name."""
    counts = Counter(sentence for said in corpus.references(corpus.parts.train) for sentence in said)
    return min(counts, key=lambda sentence: (-counts[sentence], sentence))


def frequent_bleu(corpus: SplitStore, references: References) -> float:
    """BLEU of always saying the most frequent training sentence."""
    return bleu([frequent_sentence(corpus)] * len(references), references)


def retrieved(corpus: SplitStore, sentences: Sequence[str]) -> list[int]:
    """For each sentence the training record with the most similar sentence.

    Alike by the cosine of their words, weighted by TF-IDF: the safe choice of applications.
    """
    known = [(record, said) for record in corpus.parts.train for said in corpus.sentences(record)]
    vectors = TfidfVectorizer(token_pattern=r"\S+")
    table = vectors.fit_transform([said for _, said in known])
    alike: NDArray[np.float64] = (vectors.transform(sentences) @ table.T).toarray()
    return [known[i][0] for i in alike.argmax(axis=1)]
