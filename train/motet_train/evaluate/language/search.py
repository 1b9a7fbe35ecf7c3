"""How well a search model finds motions by sentences that were not in training, and by motions."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from motet.models.describe import DescribeModel
from motet.motion.motion import Motion
from motet.motion.rotations import Array, Indices, Mask
from motet.search.model import Hit, Index, IndexSettings, Member, SearchModel
from motet.search.nearest import NearestSettings
from motet_train.data.errors import DataError
from motet_train.evaluate.language.confidence import share
from motet_train.evaluate.language.describe import retrieved
from motet_train.evaluate.language.motions import Looks
from motet_train.evaluate.language.split_store import SplitStore, description_groups, unknown_words_allowed
from motet_train.evaluate.tables import Figures, Report, gathered, read_goals

SEARCH_GOALS = read_goals("search")

Numbers = NDArray[np.int64]

MOST_HITS = int(NearestSettings.RANGES["count"][1].high)
"""Hits that a search gives at most."""


def search_report(model: SearchModel, corpus: SplitStore, describe: DescribeModel | None = None) -> Report:
    """Ranks of test motions for sentences, and nearest training motions of test motions, with floors.

    "asked": the number of sentences, the share of them whose subject a training motion shows ("known"), and the
    "first_5" of "text" for a searcher that understands sentences perfectly ("best_5").
    "text": the sentences of test motions whose wordings are not in training search for their own motion among all test
    motions: the shares that are among the first, and the median rank. "text_alike": any motion with an equal
    description counts. "words_": their floor, the training motion with the most similar sentence (TF-IDF), and the test
    motions that are nearest to it. "likelihood_": the same by a describe model of the same split, if there is one.
    "like": see :func:`_likeness`. "motion": the share of test motions whose nearest training motion has an equal
    description, among those ("of") for which there is one.
    """
    return corpus.origin(model.manifest) | gathered(_search_parts(model, corpus, describe), model.manifest.name)


def _search_parts(model: SearchModel, corpus: SplitStore, describe: DescribeModel | None) -> Iterator[Report]:
    groups = np.array(description_groups(corpus.store.records))
    queries = _TestQueries.of(corpus, groups)
    yield {"asked": queries.figures(groups[list(corpus.parts.train)])}

    # motions by sentences: the model, the floor (by words to a training motion, from there by features), and likelihood
    test_motions = corpus.motions(corpus.parts.test)
    yield queries.ranks("", _orders(model, corpus, queries.sentences))
    looks = Looks(corpus)
    query_features = looks.features(corpus.motions(retrieved(corpus, queries.sentences)))
    distances = cdist(query_features, looks.features(test_motions))
    yield queries.ranks("words_", distances.argsort(axis=1, kind="stable"))
    if describe is not None:
        scores = _likelihoods(describe, test_motions, queries.sentences)
        yield queries.ranks("likelihood_", (-scores).argsort(axis=1, kind="stable"))

    # motions by motions
    yield {"like": _likeness(model, corpus, groups)}
    yield {"motion": _nearest(model, looks, groups, test_motions)}


def _nearest(model: SearchModel, looks: Looks, groups: Numbers, test_motions: Sequence[Motion]) -> Figures:
    """How often the training motion nearest to a test motion is described like it, by the model and by features."""
    corpus = looks.corpus
    # by the model, and by features
    train = corpus.parts.train
    index = _index(model, corpus, train)
    by_model = [_places(index.search(motion, 1))[0] for motion in test_motions]
    distances = cdist(looks.features(test_motions), looks.features(corpus.motions(train)))

    # among those whose description is in training
    train_groups = groups[list(train)]
    test_groups = groups[list(corpus.parts.test)]
    known = np.isin(test_groups, train_groups)
    return {
        "alike": share((train_groups[by_model] == test_groups)[known]),
        "features_alike": share((train_groups[distances.argmin(axis=1)] == test_groups)[known]),
        "of": known.sum(),
    }


@dataclass(frozen=True, eq=False)
class _TestQueries:
    """Q sentences that search among the N test motions. rows: each sentence's own motion.

    takes, groups: of the test motions; pieces of one take count as the same motion, those of one group as alike.
    """

    sentences: Sequence[str]
    rows: list[int]
    takes: NDArray[np.str_]
    groups: Numbers

    @staticmethod
    def of(corpus: SplitStore, groups: Numbers) -> "_TestQueries":
        """Those of a corpus; DataError without any. groups: of all its records."""
        test = corpus.parts.test
        queries = list(_queries(corpus, test))
        if not queries:
            raise DataError(
                "no sentence to search by: the test motions have none that is not in training and has a word of it; "
                "give the sentences to measure by the pool test in the table"
            )
        entries = [corpus.store.records[record] for record in test]
        takes = np.array([entry.take or entry.name for entry in entries])
        rows, sentences = zip(*queries, strict=True)
        return _TestQueries(sentences, list(rows), takes, groups[list(test)])

    def figures(self, train_groups: Numbers) -> Figures:
        """The number of sentences, the share with a known subject, and the best "first_5"."""
        query_groups = self.groups[self.rows]
        motions_alike = (query_groups[:, None] == self.groups).sum(axis=1)
        return {
            "sentences": float(len(self.rows)),
            "known": np.isin(query_groups, train_groups).mean(),
            "best_5": np.minimum(1, 5 / motions_alike).mean(),
        }

    def ranks(self, prefix: str, order: Indices) -> Report:
        """Ranks of each sentence's motion and of those alike. order: (Q, N) test motions, best first."""
        return {
            f"{prefix}text": _ranks(self.takes[order] == self.takes[self.rows][:, None]),
            f"{prefix}text_alike": _ranks(self.groups[order] == self.groups[self.rows][:, None]),
        }


def _orders(model: SearchModel, corpus: SplitStore, sentences: Sequence[str]) -> Indices:
    """The test motions (Q, N) in the order in which sentences find them."""
    index = _index(model, corpus, corpus.parts.test)
    with unknown_words_allowed():
        hits = [index.search(sentence, len(index.members)) for sentence in sentences]
    return np.array([_places(row) for row in hits])


def _likelihoods(describe: DescribeModel, motions: Sequence[Motion], sentences: Sequence[str]) -> Array:
    """The log-likelihoods (Q, N) of sentences given motions."""
    prepared = [describe.prepared(motion) for motion in motions]
    with unknown_words_allowed():
        scores = [describe.score(motion, sentence) for sentence, motion in product(sentences, prepared)]
    return np.reshape(scores, (len(sentences), -1))


def _likeness(model: SearchModel, corpus: SplitStore, groups: Numbers) -> Figures:
    """How well a score tells that no hit matches the query: sentences search for motions of their own part, motions for
    training motions. Each counts twice, the second time without the motions that have an equal description.

    "_least": the score that 95 % of the right first hits reach in the validation part. In the test part: the share of
    right first hits that are like the query ("_kept"), and of wrong ones that are not ("_told").
    """
    figures: Figures = {}
    for kind in ("text", "motion"):
        # the limit that validation would choose
        if corpus.parts.validation:
            hits, right = _first_hits(model, corpus, corpus.parts.validation, groups, kind)
            scores = np.array([hit.score for hit in hits])
            figures[f"{kind}_least"] = np.percentile(scores[right], 5) if right.any() else np.nan

        # how well the bundle tells in the test
        hits, right = _first_hits(model, corpus, corpus.parts.test, groups, kind)
        like = np.array([hit.like for hit in hits], dtype=np.bool_)
        figures[f"{kind}_kept"] = share(like[right])
        figures[f"{kind}_told"] = share(~like[~right])
    return figures


def _first_hits(
    model: SearchModel, corpus: SplitStore, part: Sequence[int], groups: Numbers, kind: str
) -> tuple[list[Hit], Mask]:
    """The first hits of a part's sentences or motions, and whether they are right."""
    searched = part if kind == "text" else corpus.parts.train
    index = _index(model, corpus, searched)
    searched_groups = groups[list(searched)]
    first_hits = []
    right = []
    queries = _queries(corpus, part) if kind == "text" else enumerate(corpus.motions(part))
    for row, query in queries:
        with unknown_words_allowed():
            hits = index.search(query, min(MOST_HITS, len(index.members)))
        # which hits have an equal description
        matches = searched_groups[_places(hits)] == groups[part[row]]
        first_hits.append(hits[0])
        right.append(bool(matches[0]))
        # the first hit if no motion had an equal description
        if not matches.all():
            first_hits.append(hits[int(matches.argmin())])
            right.append(False)
    return first_hits, np.array(right, dtype=np.bool_)


def _places(hits: Sequence[Hit]) -> list[int]:
    """The place in the index of each hit, see :func:`_index`."""
    return [int(hit.path.name) for hit in hits]


def _queries(corpus: SplitStore, part: Sequence[int]) -> Iterator[tuple[int, str]]:
    """The sentences to search by, with at least one word known from training, each with its row in a part."""
    known = corpus.words(corpus.parts.train)
    kept = [corpus.kept(record) for record in part]
    for row, sentences in enumerate(kept if any(kept) else corpus.unseen(part)):
        for sentence in sentences:
            if not known.isdisjoint(sentence.split()):
                yield row, sentence


def _ranks(right: Mask) -> Figures:
    """By which hits (Q, N), best first, are right: the shares among the first, and the median rank."""
    ranks = right.argmax(axis=1) + 1
    shares = {f"first_{count}": (ranks <= count).mean() for count in (1, 5, 10)}
    return {**shares, "median_rank": np.median(ranks)}


def _index(model: SearchModel, corpus: SplitStore, records: Sequence[int]) -> Index:
    """An index of some records, whose paths are their places."""
    members = []
    vectors = []
    for place, motion in enumerate(corpus.motions(records)):
        parts = model.windows(motion, model.settings(IndexSettings).window)
        windows = tuple((start, start + part.duration) for start, part in parts)
        members.append(Member(str(place), 0, 0, windows))
        vectors.append(model.embed([part for _, part in parts]))
    return Index(model, Path(), tuple(members), np.concatenate(vectors))
