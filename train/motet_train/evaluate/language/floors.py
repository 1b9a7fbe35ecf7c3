"""What a model has to beat: answers looked up among the training motions."""

from collections import Counter
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from sklearn.feature_extraction.text import TfidfVectorizer

from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet_train.evaluate.language.bleu import References, bleu
from motet_train.evaluate.language.split_store import SplitStore
from motet_train.evaluate.nearest import nearest


def nearest_motions(corpus: SplitStore, motions: Sequence[Motion]) -> list[int]:
    """For each motion the training record with the most similar pose features: mean and deviation of each channel."""
    train = corpus.described(corpus.parts.train)
    known = np.array([pose_features(corpus, motion) for motion in corpus.motions(train)])
    asked = np.array([pose_features(corpus, motion) for motion in motions])
    return [train[i] for i in nearest(asked, known)[0]]


def nearest_bleu(corpus: SplitStore, records: Sequence[int]) -> float:
    """BLEU of repeating the sentences of the nearest motion: the mean over its sentences."""
    found = corpus.references(nearest_motions(corpus, corpus.motions(records)))
    references = corpus.references(records)
    most = max(map(len, found))
    return float(np.mean([bleu([said[place % len(said)] for said in found], references) for place in range(most)]))


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


def pose_features(corpus: SplitStore, motion: Motion) -> Array:
    """(2 D,): mean and standard deviation over time of each channel, in the training motions' units of deviation."""
    z = corpus.z(motion)
    features: Array = np.concatenate([z.mean(axis=0), z.std(axis=0)])
    return features
