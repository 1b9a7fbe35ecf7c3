"""Steps whose states grow, as the cache of keys and values of a transformer does, in every loop that carries states."""

from itertools import product
from typing import Any

import numpy as np
import pytest
from fake_models import CONTRACT, FakeGraph, manifest, spec

from motet.bundle.fields import Fields
from motet.bundle.graph import GraphSpec, TensorSpec
from motet.decode.beam import Limits, beam_search, draw_sequences
from motet.decode.loop import zero_state
from motet.errors import BundleError
from motet.predict.free_run import free_run
from motet.predict.model import PredictModel

pytestmark = pytest.mark.numeric

START, END, WORDS, WIDTH = 0, 1, 5, 4
RNG = np.random.default_rng(0)
KEYS, VALUES, OUT = RNG.normal(size=(WORDS, WIDTH)), RNG.normal(size=(WORDS, WIDTH)), RNG.normal(size=(WIDTH, WORDS))


def attended(keys: Any, values: Any, context: Any) -> Any:
    """Log-probabilities (N, V): the last key looks at all keys (N, T, W), itself included."""
    weights = np.exp(np.einsum("ntw,nw->nt", keys, keys[:, -1] + context.mean(axis=1, keepdims=True)))
    logits = 2 * np.einsum("nt,ntw->nw", weights / weights.sum(axis=1, keepdims=True), values) @ OUT
    return logits - np.log(np.exp(logits).sum(axis=1, keepdims=True))


def step() -> FakeGraph:
    """One layer of attention over the words so far: its cache (N, 2, T, W) grows by one."""

    def run(word: Any, context: Any, cache: Any) -> tuple[Any, Any]:
        new = np.stack([KEYS[word], VALUES[word]], axis=1)[:, :, None]
        whole = np.concatenate([cache, new], axis=2)
        return attended(whole[:, 0], whole[:, 1], context), whole

    sizes = {"C": 3, "V": WORDS, "W": WIDTH, "2": 2}
    made = spec(
        {"word": "*batch", "context": "batch C", "cache": "batch 2 past W"},
        {"log_probabilities": "batch V", "next_cache": "batch 2 longer W"},
        sizes,
    )
    return FakeGraph(GraphSpec(made.inputs, made.outputs, made.feedback, {"cache": (2, 0, WIDTH)}), run)


def log_probability(context: Any, ids: tuple[int, ...]) -> float:
    """Of a whole sentence, without a cache."""
    words, total = [START, *ids, END], 0.0
    for length in range(1, len(words)):
        said = np.array(words[:length])[None]
        total += attended(KEYS[said], VALUES[said], context[None])[0, words[length]]
    return float(total)


def test_a_state_starts_with_the_size_that_the_contract_says() -> None:
    found = zero_state(step(), 7)
    assert {name: (array.shape, array.dtype) for name, array in found.items()} == {
        "cache": ((7, 2, 0, WIDTH), np.dtype(np.float32))
    }


@pytest.mark.parametrize("beams", [3, 200])
def test_a_beam_carries_a_cache_that_grows(beams: int) -> None:
    contexts = np.random.default_rng(1).normal(size=(4, 3)).astype(np.float32)
    normal = [word for word in range(WORDS) if word != END]
    every = [ids for length in range(4) for ids in product(normal, repeat=length)]
    for context, found in zip(
        contexts, beam_search(step(), {"context": contexts}, Limits(START, END, 3), beams), strict=True
    ):
        for ids, score, _ in found:
            assert score == pytest.approx(log_probability(context, ids), abs=1e-5)
        if beams > len(every):
            assert found[0].ids == max(every, key=lambda ids: log_probability(context, ids))


def test_draws_carry_a_cache_that_grows() -> None:
    contexts = np.random.default_rng(2).normal(size=(3, 3)).astype(np.float32)
    for context, drawn in zip(
        contexts, draw_sequences(step(), {"context": contexts}, Limits(START, END, 5), 40, 1.0), strict=True
    ):
        assert max(len(one.ids) for one in drawn) > 1
        for one in drawn:
            assert one.log_probability == pytest.approx(log_probability(context, one.ids), abs=1e-5)


def growing_sum() -> dict[str, FakeGraph]:
    """A predictor whose frame is the sum of all that its cache holds, and its own number of steps."""
    sizes = {"L": 2, "C": 3}

    def run(last: Any, cache: Any, count: Any) -> tuple[Any, ...]:
        whole = np.concatenate([cache, last[:, None]], axis=1)
        frame = whole.sum(axis=1) + count[:, None]
        return frame, frame, whole, count + 1

    made = spec(
        {"last": "batch C", "cache": "batch past C", "count": "*batch"},
        {"frame": "batch C", "next_last": "batch C", "next_cache": "batch longer C", "next_count": "*batch"},
        sizes,
    )
    encoder = spec({"frames": "batch L C"}, {"last": "batch C"}, sizes)
    return {
        "encoder": FakeGraph(encoder, lambda frames: (frames[:, -1],)),
        "step": FakeGraph(GraphSpec(made.inputs, made.outputs, made.feedback, {"cache": (0, 3)}), run),
    }


def test_a_free_run_carries_what_grows_beside_what_the_encoder_gives() -> None:
    graphs = growing_sum()
    found = free_run(graphs["encoder"], graphs["step"], np.ones((2, 2, 3), np.float32), 4, 10)
    np.testing.assert_array_equal(found[0, :, 0], [1, 3, 7, 15])  # 1; 1+1 and 1; 1+1+3 and 2; 1+1+3+7 and 3
    model = PredictModel(manifest("predict", "free_run", CONTRACT, {"horizon": 4}), graphs)
    np.testing.assert_array_equal(model.next_frames(np.ones((1, 2, 3)))[0], found[0])


@pytest.mark.parametrize(
    ("start", "reason"),
    [
        ({}, r"axis 2 of 'cache' must have a fixed size"),
        ({"cache": [2, 0]}, r"start: \[2, 0\] does not fit the state 'cache'"),
        ({"cache": [2, 0, 5]}, "does not fit the state 'cache'"),
        ({"cache": [2, -1, WIDTH]}, "does not fit the state 'cache'"),
        ({"cache": [2, 1e9, WIDTH]}, "does not fit the state 'cache'"),
        ({"cache": "none"}, "start.cache: must be a list"),
        ({"word": []}, "does not fit the state 'word'"),
        ({"none": [1]}, "no input 'none'"),
    ],
)
def test_a_start_that_does_not_fit_is_refused(start: dict[str, Any], reason: str) -> None:
    data = {**step().spec.to_json(), "start": start}
    with pytest.raises(BundleError, match=reason):
        GraphSpec.read(Fields(data, "graphs.step")).start_shape("cache")
    found = GraphSpec.read(Fields(step().spec.to_json(), "graphs.step"))
    assert found == step().spec
    assert found.input("cache") == TensorSpec("cache", ("batch", 2, "past", WIDTH))
