"""How well a model finds: motions by sentences that no training saw, and motions by motions."""

from collections.abc import Iterator, Sequence
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from motet.models.describe import DescribeModel
from motet.models.language import RULES
from motet.models.search import Index, IndexSettings, Member, SearchModel
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet_train.data.sentences import alike
from motet_train.evaluate.language.floors import retrieved
from motet_train.evaluate.language.looks import Looks
from motet_train.evaluate.language.report import origin
from motet_train.evaluate.language.split_store import SplitStore, unknown_words_allowed
from motet_train.evaluate.tables import Goals, Report, gathered

SEARCH_GOALS: Goals = {"text.first_5": (0.8, None)}

Order = NDArray[np.intp]
"""For each question (Q, N) the things that were searched, best first."""


def search_report(model: SearchModel, corpus: SplitStore, describe: DescribeModel | None = None) -> Report:
    """Ranks of test motions, asked for by sentences, and nearest training motions of test motions; beside floors.

    "asked": how many sentences there are, the share of them that are about what a training motion shows ("known"), and
    the "first_5" of "text" for who knows what is said and no more ("best_5").
    "text": the sentences of test motions whose wordings no training saw ask for their own among all test motions:
    shares that are among the first, and the median rank. "text_alike": any motion counts of which the same was said.
    "words_": the floor of them: the training motion with the most similar sentence (TF-IDF), and the test motions that
    are nearest to it. "likelihood_": by a describe model of the same split, where one is given. "motion": the share of
    test motions whose nearest training motion is one of which the same was said, of those ("of") that have any.
    """
    return origin(model.manifest, corpus) | gathered(_found(model, corpus, describe), model.manifest.name)


def _found(model: SearchModel, corpus: SplitStore, describe: DescribeModel | None) -> Iterator[Report]:
    asked, looks = _Asked(corpus), Looks(corpus)
    yield {"asked": asked.told()}
    with unknown_words_allowed():
        index = _index(model, corpus, corpus.parts.test)
        found = np.array([_order(index, sentence) for sentence in asked.sentences])
    yield asked.measured("", found)
    yield asked.measured("words_", _by_words(looks, asked.sentences))
    if describe is not None:
        yield asked.measured("likelihood_", _by_likelihood(describe, corpus, asked.sentences))
    yield {"motion": _motions(model, looks, asked.groups)}


class _Asked:
    """The sentences about test motions, and which motions each is about."""

    def __init__(self, corpus: SplitStore) -> None:
        self.records, self.train = corpus.parts.test, corpus.parts.train
        kept = [corpus.kept(record) for record in self.records]
        rows = [(row, s) for row, said in enumerate(kept if any(kept) else corpus.unseen(self.records)) for s in said]
        known = {word for said in corpus.references(corpus.parts.train) for s in said for word in s.split()}
        rows = [(row, sentence) for row, sentence in rows if not known.isdisjoint(sentence.split())]
        self.rows, self.sentences = [row for row, _ in rows], [sentence for _, sentence in rows]
        self.entries = corpus.store.records

    @cached_property
    def groups(self) -> NDArray[np.int64]:
        """For each record of the store the number of what was said of it."""
        return np.array(alike([[*map(RULES.normalise, (*e.sentences, *e.unseen))] for e in self.entries]))

    def told(self) -> dict[str, float]:
        """How many sentences there are, and what can be expected of them."""
        groups, known = self.groups[list(self.records)][self.rows], self.groups[list(self.train)]
        alike = (groups[:, None] == self.groups[list(self.records)]).sum(axis=1)
        best = float(np.minimum(1, 5 / alike).mean())
        return {"sentences": float(len(groups)), "known": float(np.isin(groups, known).mean()), "best_5": best}

    def measured(self, name: str, order: Order) -> Report:
        """Two groups of figures, of own motions and of those alike."""
        takes = np.array([self.entries[record].take or self.entries[record].name for record in self.records])
        groups = self.groups[list(self.records)]
        return {
            f"{name}text": _ranks(takes[order] == takes[self.rows][:, None]),
            f"{name}text_alike": _ranks(groups[order] == groups[self.rows][:, None]),
        }


def _ranks(right: NDArray[np.bool_]) -> dict[str, float]:
    """Of which of the found (Q, N) are right, best first: the shares among the first, and the median rank."""
    ranks = right.argmax(axis=1) + 1
    shares = {f"first_{count}": float((ranks <= count).mean()) for count in (1, 5, 10)}
    return {**shares, "median_rank": float(np.median(ranks))}


def _index(model: SearchModel, corpus: SplitStore, records: Sequence[int]) -> Index:
    """An index of some records, whose paths are their places."""
    members, vectors = [], []
    for place, motion in enumerate(corpus.motions(records)):
        parts = model.windows(motion, model.settings(IndexSettings).window)
        windows = tuple((start, start + part.duration) for start, part in parts)
        members.append(Member(str(place), 0, 0, windows))
        vectors.append(model.embed([part for _, part in parts]))
    return Index(model, Path(), members, np.concatenate(vectors))


def _order(index: Index, query: str | Motion) -> list[int]:
    return [int(hit.path.name) for hit in index.search(query, len(index.members))]


def _by_words(looks: Looks, sentences: Sequence[str]) -> Order:
    looked_up = _features(looks, retrieved(looks.corpus, sentences))
    return cdist(looked_up, _features(looks, looks.corpus.parts.test)).argsort(axis=1, kind="stable")


def _by_likelihood(describe: DescribeModel, corpus: SplitStore, sentences: Sequence[str]) -> Order:
    motions = [describe.prepared(motion) for motion in corpus.motions(corpus.parts.test)]
    with unknown_words_allowed():
        scores = np.array([[describe.score(motion, sentence) for motion in motions] for sentence in sentences])
    return (-scores).argsort(axis=1, kind="stable")


def _motions(model: SearchModel, looks: Looks, groups: NDArray[np.int64]) -> dict[str, float]:
    corpus = looks.corpus
    train, test = np.array(corpus.parts.train), np.array(corpus.parts.test)
    known = np.isin(groups[test], groups[train])
    index = _index(model, corpus, corpus.parts.train)
    by_model = [int(index.search(motion, 1)[0].path.name) for motion in corpus.motions(test.tolist())]
    by_features = cdist(_features(looks, test.tolist()), _features(looks, train.tolist())).argmin(axis=1)
    right = {
        "alike": groups[train[by_model]] == groups[test],
        "features_alike": groups[train[by_features]] == groups[test],
    }
    shares = {name: float(row[known].mean()) if known.any() else np.nan for name, row in right.items()}
    return {**shares, "of": float(known.sum())}


def _features(looks: Looks, records: Sequence[int]) -> Array:
    return looks.features(looks.corpus.motions(records))
