"""How well a model finds: motions by sentences that no training saw, and motions by motions."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from motet.models.describe import DescribeModel
from motet.models.language import RULES
from motet.models.search import Index, IndexSettings, Member, SearchModel
from motet_train.data.sentences import alike
from motet_train.evaluate.language.describe import retrieved
from motet_train.evaluate.language.motions import Looks
from motet_train.evaluate.language.split_store import SplitStore, unknown_words_allowed
from motet_train.evaluate.tables import Goals, Report, gathered

SEARCH_GOALS: Goals = {"text.first_5": (0.8, None)}

Numbers = NDArray[np.int64]


def search_report(model: SearchModel, corpus: SplitStore, describe: DescribeModel | None = None) -> Report:
    """Ranks of test motions, asked for by sentences, and nearest training motions of test motions; beside floors.

    "asked": how many sentences there are, the share of them that are about what a training motion shows ("known"), and
    the "first_5" of "text" for who knows what is said and no more ("best_5").
    "text": the sentences of test motions whose wordings no training saw ask for their own among all test motions:
    shares that are among the first, and the median rank. "text_alike": any motion counts of which the same was said.
    "words_": the floor of them: the training motion with the most similar sentence (TF-IDF), and the test motions that
    are nearest to it. "like": :func:`_likeness`. "likelihood_": by a describe model of the same split,
    where one is given. "motion": the share of test motions whose nearest training motion is one of which the same was
    said, of those ("of") that have any.
    """
    return corpus.origin(model.manifest) | gathered(_found(model, corpus, describe), model.manifest.name)


def _found(model: SearchModel, corpus: SplitStore, describe: DescribeModel | None) -> Iterator[Report]:
    entries, parts, looks = corpus.store.records, corpus.parts, Looks(corpus)
    rows, sentences = _asked(corpus, parts.test)
    said = np.array(alike([[*map(RULES.normalise, (*entry.sentences, *entry.unseen))] for entry in entries]))
    test, train = said[list(parts.test)], said[list(parts.train)]  # numbers of what was said of each
    takes = np.array([entries[record].take or entries[record].name for record in parts.test])

    def ranked(name: str, order: NDArray[np.intp]) -> Report:
        """Of own motions and of those alike; order: for each sentence (Q, N) the test motions, best first."""
        return {
            f"{name}text": _ranks(takes[order] == takes[rows][:, None]),
            f"{name}text_alike": _ranks(test[order] == test[rows][:, None]),
        }

    best = np.minimum(1, 5 / (test[rows][:, None] == test).sum(axis=1)).mean()
    known = np.isin(test[rows], train).mean()
    yield {"asked": {"sentences": float(len(rows)), "known": float(known), "best_5": float(best)}}
    index = _index(model, corpus, parts.test)
    with unknown_words_allowed():
        found = [index.search(sentence, len(index.members)) for sentence in sentences]
    yield ranked("", np.array([[int(hit.path.name) for hit in hits] for hits in found]))
    asked, seen, known_looks = (
        looks.features(corpus.motions(records)) for records in (retrieved(corpus, sentences), parts.test, parts.train)
    )
    yield ranked("words_", cdist(asked, seen).argsort(axis=1, kind="stable"))
    if describe is not None:
        motions = [describe.prepared(motion) for motion in corpus.motions(parts.test)]
        with unknown_words_allowed():
            scores = np.array([[describe.score(motion, sentence) for motion in motions] for sentence in sentences])
        yield ranked("likelihood_", (-scores).argsort(axis=1, kind="stable"))
    index = _index(model, corpus, parts.train)
    by_model = [int(index.search(motion, 1)[0].path.name) for motion in corpus.motions(parts.test)]
    by_features = cdist(seen, known_looks).argmin(axis=1)
    yield {"like": _likeness(model, corpus, said)}
    yield {"motion": _shares({"alike": train[by_model], "features_alike": train[by_features]}, test, train)}


def _likeness(model: SearchModel, corpus: SplitStore, said: Numbers) -> dict[str, float]:
    """How well a score tells that nothing found is like what was asked for: sentences for motions of their own part,
    motions for training motions. Each asks twice, the second time where none has the same description.

    "_least": the score that 95 % of the first hits that are right have in the validation part. Of the test part's first
    hits, with the model's settings: the share of right ones that are like what was asked for ("_kept"), and of wrong
    ones that are not ("_told").
    """
    how, found = model.settings(IndexSettings), dict[str, float]()
    for kind, least in (("text", how.like_text), ("motion", how.like_motion)):
        if corpus.parts.validation:
            score, right = _firsts(model, corpus, corpus.parts.validation, said, kind)
            found[f"{kind}_least"] = float(np.percentile(score[right], 5)) if right.any() else np.nan
        score, right = _firsts(model, corpus, corpus.parts.test, said, kind)
        found[f"{kind}_kept"] = float((score[right] >= least).mean()) if right.any() else np.nan
        found[f"{kind}_told"] = float((score[~right] < least).mean()) if not right.all() else np.nan
    return found


def _firsts(
    model: SearchModel, corpus: SplitStore, part: Sequence[int], said: Numbers, kind: str
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """The scores of the first hits of a part's sentences or motions (Q,), and whether they are right."""
    held = part if kind == "text" else corpus.parts.train
    rows, queries = _asked(corpus, part) if kind == "text" else (range(len(part)), corpus.motions(part))
    index, groups = _index(model, corpus, held), said[list(held)]
    with unknown_words_allowed():
        found = [index.search(query, len(index.members)) for query in queries]
    firsts = []
    for row, hits in zip(rows, found, strict=True):
        alike = [bool(groups[int(hit.path.name)] == said[part[row]]) for hit in hits]
        firsts.append((hits[0].score, alike[0]))
        firsts += [(hit.score, False) for hit, same in zip(hits, alike, strict=True) if not same][:1]
    scores, right = zip(*firsts, strict=True)
    return np.array(scores), np.array(right)


def _asked(corpus: SplitStore, part: Sequence[int]) -> tuple[list[int], list[str]]:
    """The sentences that ask, with a word that a training sentence has, and of which motion of a part each is."""
    known = corpus.words(corpus.parts.train)
    kept = [corpus.kept(record) for record in part]
    said = kept if any(kept) else corpus.unseen(part)
    rows = [(row, s) for row, own in enumerate(said) for s in own if not known.isdisjoint(s.split())]
    return [row for row, _ in rows], [sentence for _, sentence in rows]


def _ranks(right: NDArray[np.bool_]) -> dict[str, float]:
    """Of which of the found (Q, N) are right, best first: the shares among the first, and the median rank."""
    ranks = right.argmax(axis=1) + 1
    shares = {f"first_{count}": float((ranks <= count).mean()) for count in (1, 5, 10)}
    return {**shares, "median_rank": float(np.median(ranks))}


def _shares(found: Mapping[str, Numbers], test: Numbers, train: Numbers) -> dict[str, float]:
    """Which of what was found is about what test motions show, of those that a training motion shows."""
    known = np.isin(test, train)
    shares = {key: float((own == test)[known].mean()) if known.any() else np.nan for key, own in found.items()}
    return {**shares, "of": float(known.sum())}


def _index(model: SearchModel, corpus: SplitStore, records: Sequence[int]) -> Index:
    """An index of some records, whose paths are their places."""
    members, vectors = [], []
    for place, motion in enumerate(corpus.motions(records)):
        parts = model.windows(motion, model.settings(IndexSettings).window)
        windows = tuple((start, start + part.duration) for start, part in parts)
        members.append(Member(str(place), 0, 0, windows))
        vectors.append(model.embed([part for _, part in parts]))
    return Index(model, Path(), tuple(members), np.concatenate(vectors))
