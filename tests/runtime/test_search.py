"""The vectors of a search model, and the nearest of them."""

from dataclasses import replace

import numpy as np
import pytest
from fake_models import CONTRACT, VOCABULARY, FakeGraph, moving, search_model, spec

from motet.bench.cases import cases
from motet.errors import BundleError, MotionError, TextError, TextWarning
from motet.models.load import build
from motet.search.model import SearchModel
from motet.search.nearest import nearest


@pytest.fixture(scope="module")
def model() -> SearchModel:
    return search_model()


def test_vectors_of_motions(model: SearchModel) -> None:
    motions = [moving(9, seed=1), moving(4, seed=2), moving(40, fps=40.0, seed=3)]
    wanted = np.array([(model.frames(m) - CONTRACT.mean).mean(axis=0) / [0.5, 10, 1] for m in motions])
    found = model.embed(motions)
    assert (found.dtype, found.shape) == (np.float32, (3, 3))
    np.testing.assert_allclose(found, wanted / np.linalg.norm(wanted, axis=1, keepdims=True), atol=1e-5)
    np.testing.assert_array_equal(model.embed(motions[1]), found[1])
    assert model.embed([]).shape == (0, 3)


def test_vectors_of_sentences(model: SearchModel) -> None:
    found = model.embed_text(["a person walks", "walks"])
    assert (found.dtype, found.shape) == (np.float32, (2, 3))
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1, atol=1e-6)
    np.testing.assert_array_equal(model.embed_text("A PERSON, walks!"), found[0])
    with pytest.warns(TextWarning, match="does not know limps"):
        model.embed_text("a person limps")


def test_what_cannot_be_embedded(model: SearchModel) -> None:
    with pytest.raises(TextError, match="knows no word of 'xyz'"):
        model.embed_text("xyz")
    with pytest.raises(TextError, match="no words"):
        model.embed_text("")
    with pytest.raises(MotionError, match="two frames"):
        model.embed(moving(1))


def test_the_nearest_are_those_of_a_naive_search() -> None:
    scores = np.random.default_rng(0).integers(0, 5, (4, 9)).astype(np.float32)
    naive = [sorted(range(9), key=lambda column, row=row: (-row[column], column))[:3] for row in scores]
    np.testing.assert_array_equal(nearest(scores, 3), naive)
    assert nearest(scores[0], 20).shape == (9,)


def test_the_golden_run_gives_both_vectors(model: SearchModel) -> None:
    frames = model.frames(moving(20)).astype(np.float32)
    found = model.replay({"frames": frames}, {"text": "a person walks"})
    np.testing.assert_array_equal(found["ids"], [VOCABULARY.ids[word] for word in ("a", "person", "walks")])
    np.testing.assert_array_equal(found["motion"], model.embed(moving(20)))
    np.testing.assert_array_equal(found["text"], model.embed_text("a person walks"))


def test_graphs_that_do_not_fit_are_refused(model: SearchModel) -> None:
    with pytest.raises(BundleError, match="no graph for the role 'text'"):
        build(model.manifest, {"motion": model.graphs["motion"]})
    other = spec({"words": "*batch words", "lengths": "*batch"}, {"vector": "batch E"}, {"E": 4})
    with pytest.raises(BundleError, match=r"graphs.text: 'vector' is float32 \['batch', 4\], expected .* 3\]"):
        build(model.manifest, {**model.graphs, "text": FakeGraph(other, lambda words, lengths: ())})
    with pytest.raises(BundleError, match="'beam' does not search; expected one of nearest"):
        build(replace(model.manifest, loop="beam"), model.graphs)


def test_what_is_measured(model: SearchModel) -> None:
    text, motion, nearest = (case.call() for case in cases(model))
    np.testing.assert_array_equal(np.shape(text), np.shape(motion))
    assert np.shape(nearest)[-1] == 5
