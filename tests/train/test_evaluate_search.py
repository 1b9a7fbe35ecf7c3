"""How well a search model finds, by a model whose answers are known."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from language_models import KINDS, STORE, FakeDescribe, WholeMotions, told
from numpy.typing import NDArray

from motet.motion.motion import Motion
from motet.search.nearest import LOOPS
from motet_train.data.errors import DataError
from motet_train.data.store import Store
from motet_train.evaluate.language.search import SEARCH_GOALS, search_report
from motet_train.evaluate.language.split_store import SplitStore, plain, split_as
from motet_train.evaluate.tables import report_table

Floats = NDArray[np.float32]


class FakeSearch(WholeMotions):
    """Puts motions of a kind near each other, and a sentence to the motion it is about, or nearer to the next one."""

    loop = LOOPS["nearest"]
    defaults = LOOPS["nearest"].defaults({})

    def __init__(self, store: Store, off: bool = False) -> None:
        self.manifest, self.off = told(store, "search"), off
        self.records = {store.sequence(i).tobytes(): i for i in range(len(store.records))}
        self.about = {plain(s): i for i, entry in enumerate(store.records) for s in entry.sentences[2:]}

    def embed(self, motions: Sequence[Motion]) -> Floats:
        return np.stack([self.vector(self.records[m.values.astype(np.float32).tobytes()]) for m in motions])

    def embed_text(self, sentence: str) -> Floats:
        record = self.about[sentence]
        return self.vector(record) + 2 * self.off * self.vector(record + (-4 if record % 5 == 4 else 1))

    def unknown(self, sentence: str) -> list[str]:
        return []

    def vector(self, record: int) -> Floats:
        found = np.zeros(len(self.records) + len(KINDS), np.float32)
        found[[record, len(self.records) + record % len(KINDS)]] = np.sqrt(0.5)
        return found


class Scorer(FakeDescribe):
    """Finds every sentence as likely for every motion."""

    def prepared(self, motion: Motion) -> Motion:
        return motion


@pytest.fixture(scope="module")
def corpus() -> SplitStore:
    return split_as(told(STORE, "search"), STORE)


def test_a_perfect_model_finds_all_at_once(corpus: SplitStore) -> None:
    report = search_report(FakeSearch(corpus.store), corpus)  # type: ignore[arg-type]
    first = {"first_1": 1, "first_5": 1, "first_10": 1, "median_rank": 1}
    assert report["asked"] == {"sentences": 5, "known": 1, "best_5": 1}
    assert report["text"] == report["text_alike"] == first
    # whoever turns right in training swings the legs as whoever walks in the test: by looks that is nearer
    assert report["words_text"] == {**first, "first_1": 0.8}
    assert report["motion"] == {"alike": 1, "features_alike": 1, "of": 5}
    like = report["like"]
    assert like["text_kept"] == like["text_told"] == like["motion_told"] == 1
    assert like["text_least"] == pytest.approx(1)
    assert "text.first_5" in report_table({"fake": report}, SEARCH_GOALS)


def test_the_rank_of_a_model_that_takes_the_next_one(corpus: SplitStore) -> None:
    model, describe = FakeSearch(corpus.store, off=True), Scorer(corpus.store)
    report = search_report(model, corpus, describe)  # type: ignore[arg-type]
    assert report["text"] == {"first_1": 0, "first_5": 1, "first_10": 1, "median_rank": 2}
    # of equally likely ones the first of the store comes first
    assert report["likelihood_text"] == {"first_1": 0.2, "first_5": 1, "first_10": 1, "median_rank": 3}


def test_a_part_without_new_sentences_is_named_or_leaves_its_figure_out() -> None:
    records = [replace(entry, sentences=("a person walks",)) for entry in STORE.records]
    model = FakeSearch(STORE)
    with pytest.raises(DataError, match=r"no sentence to search by: the test motions have none .* pool test"):
        search_report(model, split_as(told(STORE, "search"), replace(STORE, records=tuple(records))))  # type: ignore[arg-type]

    # only the validation part has nothing new: the limit that it would choose is unknown
    records[-5:] = STORE.records[-5:]
    records[:-10] = STORE.records[:-10]
    report = search_report(model, split_as(told(STORE, "search"), replace(STORE, records=tuple(records))))  # type: ignore[arg-type]
    assert np.isnan(report["like"]["text_least"])
    assert report["text"]["first_1"] == 1
