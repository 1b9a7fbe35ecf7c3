"""A small transformer over words as an ONNX bundle: its cache of keys and values grows, and beams carry it."""

from itertools import product
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from motet.bundle.bundle import Bundle
from motet.bundle.graph import GraphSpec, OnnxGraph, TensorSpec
from motet.decode.beam import Limits, beam_search
from motet.models.describe import DescribeModel
from motet.models.load import load, verify
from motet.text.vocabulary import EOS, NEW_MODEL_RULES, PAD, SOS, SPECIALS, UNK
from motet_export.bundles import export_run
from motet_export.exporter import export_graph
from motet_export.parity import check_carried
from motet_train.runs import Run, TorchGraph

WORDS = [*SPECIALS, "a", "person", "walks", "runs"]
CHANNELS, WIDTH, HEADS = 3, 8, 2
CONTEXT = TensorSpec("context", ("batch", WIDTH))
CACHES = {"keys": "next_keys", "values": "next_values"}
STEP = GraphSpec(
    (
        TensorSpec("word", ("batch",), "int64"),
        CONTEXT,
        *(TensorSpec(name, ("batch", HEADS, "past", WIDTH // HEADS)) for name in CACHES),
        TensorSpec("place", ("batch",), "int64"),
    ),
    (
        TensorSpec("log_probabilities", ("batch", len(WORDS))),
        *(TensorSpec(name, ("batch", HEADS, "longer", WIDTH // HEADS)) for name in CACHES.values()),
        TensorSpec("next_place", ("batch",), "int64"),
    ),
    {**CACHES, "place": "next_place"},
    dict.fromkeys(CACHES, (HEADS, 0, WIDTH // HEADS)),
)
ENCODER = GraphSpec(
    (TensorSpec("frames", ("batch", "time", CHANNELS)), TensorSpec("lengths", ("batch",), "int64")), (CONTEXT,)
)
MOTION = {
    "representation": "angles",
    "channels": ["a", "b", "c"],
    "units": ["rad"] * CHANNELS,
    "fps": 10.0,
    "mean": [0.0] * CHANNELS,
    "std": [1.0] * CHANNELS,
    "skeleton": None,
}


class Encoder(nn.Module):
    """The mean frame."""

    def __init__(self) -> None:
        super().__init__()
        self.linear = nn.Linear(CHANNELS, WIDTH)

    def forward(self, frames: Tensor, lengths: Tensor) -> Tensor:
        here = torch.arange(frames.shape[1]) < lengths[:, None]
        mean = (frames * here[:, :, None]).sum(dim=1) / lengths[:, None]
        return torch.tanh(self.linear(mean))


class Layer(nn.Module):
    """One layer of attention, word by word, with what it has seen in a cache."""

    def __init__(self) -> None:
        super().__init__()
        self.table, self.places = nn.Embedding(len(WORDS), WIDTH), nn.Embedding(300, WIDTH)
        self.three, self.out = nn.Linear(WIDTH, 3 * WIDTH), nn.Linear(WIDTH, len(WORDS))

    def forward(
        self, word: Tensor, context: Tensor, keys: Tensor, values: Tensor, place: Tensor
    ) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        seen = self.table(word) + self.places(place) + context
        query, key, value = self.three(seen).reshape(-1, 3, HEADS, WIDTH // HEADS).unbind(dim=1)
        keys, values = (torch.cat(pair, dim=2) for pair in ((keys, key[:, :, None]), (values, value[:, :, None])))
        weights = (keys @ query[..., None] / (WIDTH // HEADS) ** 0.5).softmax(dim=2)
        found = (weights * values).sum(dim=2).flatten(1)
        return self.out(seen + found).log_softmax(dim=-1), keys, values, place + 1

    def sentence(self, context: Tensor, ids: list[int]) -> Tensor:
        """The log-probabilities after each of the words, all at once: no cache, a mask instead."""
        words = torch.tensor(ids)
        seen = self.table(words) + self.places(torch.arange(len(ids))) + context
        query, key, value = self.three(seen).reshape(len(ids), 3, HEADS, -1).permute(1, 2, 0, 3)
        scores = query @ key.transpose(1, 2) / (WIDTH // HEADS) ** 0.5
        mask = torch.triu(torch.full_like(scores[0], -torch.inf), diagonal=1)
        found = ((scores + mask).softmax(dim=-1) @ value).permute(1, 0, 2).flatten(1)
        return self.out(seen + found).log_softmax(dim=-1)


class Transformer(nn.Module):
    def __init__(self) -> None:
        super().__init__()
        torch.manual_seed(0)
        self.encoder, self.layer = Encoder(), Layer()
        for parameter in self.parameters():
            parameter.data *= 2

    def graphs(self) -> dict[str, tuple[nn.Module, GraphSpec]]:
        return {"encoder": (self.encoder, ENCODER), "step": (self.layer, STEP)}

    def tables(self) -> dict[str, np.ndarray]:
        return {}


@pytest.fixture(scope="module")
def net() -> Transformer:
    return Transformer()


@pytest.fixture(scope="module")
def step(net: Transformer) -> bytes:
    return export_graph(net.layer, STEP, {"role": "step"})


def log_probability(net: Transformer, context: np.ndarray, ids: tuple[int, ...], limits: Limits) -> float:
    with torch.no_grad():
        found = net.layer.sentence(torch.from_numpy(context), [limits.start, *ids])
    return float(sum(found[n, word] for n, word in enumerate([*ids, limits.end])))


def test_a_step_that_grows_is_that_of_torch(net: Transformer, step: bytes) -> None:
    graph = OnnxGraph(step, STEP)
    assert check_carried(graph, TorchGraph(net.layer, STEP))["error"] < 1e-5
    limits = Limits(*(WORDS.index(word) for word in (SOS, EOS)), 3, [WORDS.index(word) for word in (PAD, SOS, UNK)])
    contexts = np.random.default_rng(0).normal(size=(5, WIDTH)).astype(np.float32)
    every = [ids for length in range(4) for ids in product(range(len(SPECIALS), len(WORDS)), repeat=length)]
    for context, found in zip(contexts, beam_search(graph, {"context": contexts}, limits, len(every)), strict=True):
        wanted = {ids: log_probability(net, context, ids, limits) for ids in every}
        assert found[0].ids == max(wanted, key=wanted.__getitem__)
        for ids, score, _ in found:
            assert score == pytest.approx(wanted[ids], abs=1e-4)


def test_a_bundle_of_it_works_and_is_described_alone_as_in_a_batch(
    net: Transformer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    named = {"name": "small", "verb": "describe", "model": "transformer", "loop": "beam", "motion": MOTION}
    words = {"text": NEW_MODEL_RULES.to_json(), "vocabulary": WORDS, "defaults": {"beams": 3, "max_words": 6}}
    export_run(Run({**named, **words, "config": {}, "licence": {"weights": None}}, net), tmp_path / "x.zip")
    model = load(tmp_path / "x.zip")
    assert isinstance(model, DescribeModel)
    errors = verify(Bundle.open(tmp_path / "x.zip")).errors
    assert errors.keys() == {"encoder", "step", "run", "meaning"}
    assert max(errors.values()) < 1e-6
    assert model.manifest.graphs["step"].spec == STEP
    rng = np.random.default_rng(1)
    motions = [model.contract.features(rng.normal(size=(length, CHANNELS))) for length in (9, 5, 30)]
    together = model.describe(motions)
    for motion, row in zip(motions, together, strict=True):
        (alone,) = model.describe([motion])
        assert [found.text for found in alone] == [found.text for found in row]
