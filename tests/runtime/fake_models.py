"""Small models of describe, generate and search whose graphs are numpy functions of random matrices."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motet.bundle.graph import Arrays, GraphSpec, TensorSpec
from motet.bundle.manifest import Manifest
from motet.models.describe import DescribeModel
from motet.motion.motion import Motion
from motet.motion.skeleton import Joint, Skeleton
from motet.papers.mixture_model import MixtureModel
from motet.representation.contract import MotionContract
from motet.search.model import SearchModel
from motet.text.vocabulary import SPECIALS, Vocabulary

Array = NDArray[Any]
FPS = 10.0
CHANNELS = ("hips.ty", "knee.rx", "knee.ry")
SKELETON = Skeleton((Joint("hips", -1, (0.0, 0.0, 0.0)), Joint("knee", 0, (0.0, -1.0, 0.0))), 1.0)
CONTRACT = MotionContract(
    "angles", CHANNELS, ("m", "deg", "deg"), FPS, np.array([1.0, 20.0, 5.0]), np.array([0.5, 10.0, 1.0]), SKELETON
)
VOCABULARY = Vocabulary([*SPECIALS, "walks", "person", "a", "left", "8", "0"])
STATE = 6


def manifest(
    verb: str, loop: str, contract: MotionContract, defaults: dict[str, Any], vocabulary: Vocabulary | None = None
) -> Manifest:
    """The manifest of a fake model."""
    words = {} if vocabulary is None else {"text": vocabulary.rules.to_json(), "vocabulary": list(vocabulary.words)}
    named = {"name": f"fake-{verb}", "verb": verb, "model": "fake", "loop": loop}
    return Manifest.from_json({**named, "motion": contract.to_json(), **words, "defaults": defaults})


class FakeGraph:
    """A function behind the face of a graph; counts its calls."""

    def __init__(self, spec: GraphSpec, function: Callable[..., tuple[Array, ...]]) -> None:
        self.spec, self.function, self.calls = spec, function, 0

    def __call__(self, feeds: Arrays) -> dict[str, Array]:
        self.calls += 1
        wanted = {tensor.name: np.dtype(tensor.dtype) for tensor in self.spec.inputs}
        assert {name: array.dtype for name, array in feeds.items()} == wanted
        outputs = self.function(**feeds)
        return {t.name: np.asarray(o, t.dtype) for t, o in zip(self.spec.outputs, outputs, strict=True)}


def spec(inputs: dict[str, str], outputs: dict[str, str], sizes: dict[str, int]) -> GraphSpec:
    """From "batch time D" to shapes; a name with "*" in front is int64. A "next_" output is fed back."""

    def tensor(name: str, shape: str) -> TensorSpec:
        axes = tuple(sizes.get(axis, axis) for axis in shape.lstrip("*").split())
        return TensorSpec(name, axes, "int64" if shape.startswith("*") else "float32")

    feedback = {name[5:]: name for name in outputs if name.startswith("next_")}
    return GraphSpec(
        tuple(tensor(n, s) for n, s in inputs.items()), tuple(tensor(n, s) for n, s in outputs.items()), feedback
    )


def word_step(seed: int, vocabulary: int, context: int, sharpness: float = 2.0) -> FakeGraph:
    """A recurrent step over words with random weights."""
    rng = np.random.default_rng(seed)
    table, state_in = rng.normal(size=(vocabulary, vocabulary)), rng.normal(size=(vocabulary, STATE))
    of_context, of_state = rng.normal(size=(context, vocabulary)), rng.normal(size=(STATE, vocabulary))

    def step(word: Array, context: Array, state: Array) -> tuple[Array, Array]:
        following = np.tanh(0.5 * state + state_in[word])
        logits = sharpness * (table[word] + _times(context, of_context) + _times(following, of_state))
        return logits - np.log(np.exp(logits).sum(axis=1, keepdims=True)), following

    sizes = {"C": context, "S": STATE, "V": vocabulary}
    return FakeGraph(
        spec(
            {"word": "*batch", "context": "batch C", "state": "batch S"},
            {"log_probabilities": "batch V", "next_state": "batch S"},
            sizes,
        ),
        step,
    )


def frame_step(seed: int, size: int, context: int, mixtures: int = 3, stop: float = -2.0) -> FakeGraph:
    """A recurrent step over frames with random weights; ``stop`` is the logit of an end."""
    rng = np.random.default_rng(seed)
    state_in, of_state = rng.normal(size=(size + 1, STATE)), rng.normal(size=(STATE, mixtures * size)) * 0.5
    of_context, weights = rng.normal(size=(context, mixtures)), rng.normal(size=(STATE, mixtures))

    def step(frame: Array, context: Array, state: Array) -> tuple[Array, ...]:
        following = np.tanh(0.5 * state + _times(frame, state_in))
        logits = _times(following, weights) + _times(context, of_context)
        means = _times(following, of_state).reshape(-1, mixtures, size)
        active = 1 / (1 + np.exp(stop + following[:, 0]))
        log_weights = logits - np.log(np.exp(logits).sum(axis=1, keepdims=True))
        return log_weights, means, 0.1 + np.exp(0.5 * means), active, following

    sizes = {"C": context, "S": STATE, "K": mixtures, "D": size, "D1": size + 1}
    return FakeGraph(
        spec(
            {"frame": "batch D1", "context": "batch C", "state": "batch S"},
            {
                "log_weights": "batch K",
                "means": "batch K D",
                "stds": "batch K D",
                "active": "batch",
                "next_state": "batch S",
            },
            sizes,
        ),
        step,
    )


def describe_model() -> DescribeModel:
    """A describe model of three channels and ten words."""
    size = len(CHANNELS)
    step = word_step(1, len(VOCABULARY), size)

    def encode(frames: Array, lengths: Array) -> tuple[Array]:
        return (_means((frames - CONTRACT.mean) / [0.5, 10, 1], lengths),)

    sizes = {"C": size, "D": size}
    graphs = {
        "encoder": FakeGraph(
            spec({"frames": "batch time D", "lengths": "*batch"}, {"context": "batch C"}, sizes), encode
        ),
        "step": step,
    }
    return DescribeModel(_manifest("describe", {"beams": 5, "max_words": 6}), graphs)


def generate_model() -> MixtureModel:
    """A generate model of three channels and ten words."""
    size, context = len(CHANNELS), 4
    step = frame_step(2, size, context)
    table = np.random.default_rng(3).normal(size=(len(VOCABULARY), context))

    def encode(words: Array, lengths: Array) -> tuple[Array]:
        return (_means(table[words], lengths),)

    sizes = {"C": context, "D1": size + 1}
    graphs = {
        "encoder": FakeGraph(
            spec({"words": "*batch words", "lengths": "*batch"}, {"context": "batch C"}, sizes), encode
        ),
        "step": step,
    }
    defaults = {"hypotheses": 3, "candidates": 4, "temperature": 1.0, "max_seconds": 3}
    return MixtureModel(_manifest("generate", defaults), graphs)


def search_model(name: str = "fake-search") -> SearchModel:
    """A search model of three channels and ten words: a motion is its mean, a sentence the mean of its words."""
    size = len(CHANNELS)
    table = np.random.default_rng(4).normal(size=(len(VOCABULARY), size))

    def motion(frames: Array, lengths: Array) -> tuple[Array]:
        return (_unit(_means((frames - CONTRACT.mean) / [0.5, 10, 1], lengths)),)

    def text(words: Array, lengths: Array) -> tuple[Array]:
        return (_unit(_means(table[words], lengths)),)

    sizes, vector = {"D": size, "E": size}, {"vector": "batch E"}
    graphs = {
        "motion": FakeGraph(spec({"frames": "batch time D", "lengths": "*batch"}, vector, sizes), motion),
        "text": FakeGraph(spec({"words": "*batch words", "lengths": "*batch"}, vector, sizes), text),
    }
    known = {**_manifest("search", {"count": 2}).source, "name": name}
    return SearchModel(Manifest.from_json(known), graphs)


def log_likelihood(frame: Array, out: dict[str, Array], row: int) -> float:
    """Equation 8 times the flag's Bernoulli, in the most literal way."""
    active = float(out["active"][row])
    if not frame[-1]:
        return float(np.log(1 - active))
    means, stds = out["means"][row].astype(float), out["stds"][row].astype(float)
    normals = np.exp(-0.5 * ((frame[:-1] - means) / stds) ** 2) / (stds * np.sqrt(2 * np.pi))
    return float(np.log(active) + np.log((np.exp(out["log_weights"][row]) * normals.prod(axis=1)).sum()))


def moving(frames: int, fps: float = FPS, seed: int = 0) -> Motion:
    """A motion with the channels of the fake models, in another order and with one more."""
    values = np.random.default_rng(seed).normal(size=(frames, 4)).cumsum(axis=0) * 0.3
    return Motion(values, ("knee.ry", "knee.rz", "hips.ty", "knee.rx"), ("deg", "deg", "m", "rad"), fps, SKELETON)


def _manifest(verb: str, defaults: dict[str, Any]) -> Manifest:
    return manifest(
        verb, {"describe": "beam", "generate": "mixture", "search": "nearest"}[verb], CONTRACT, defaults, VOCABULARY
    )


def _unit(vectors: Array) -> Array:
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def _means(values: Array, lengths: Array) -> Array:
    """Mean over the real part of right-padded sequences (B, T, C)."""
    return np.stack([row[:length].mean(axis=0) for row, length in zip(values, lengths, strict=True)])


def _times(rows: Array, matrix: Array) -> Array:
    """A matrix product whose rows do not depend on each other, to the bit."""
    return (rows[:, :, None] * matrix).sum(axis=1)
