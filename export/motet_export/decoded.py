"""Whole runs of each verb: the runs that compare ONNX Runtime with torch, and the golden run of a bundle."""

import warnings
from collections.abc import Callable, Mapping
from functools import partial, singledispatch
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motet.bundle.fields import Json
from motet.bundle.golden import TOLERANCE, difference, vectors
from motet.bundle.graph import Arrays
from motet.decode.beam import noise_of
from motet.decode.loop import Recording
from motet.errors import TextWarning
from motet.generate.base import GenerateModel
from motet.models.base import BundleModel
from motet.models.describe import DescribeModel
from motet.models.language import LanguageModel
from motet.motion.kinematics import positions
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet.papers.tdbn_control import TdbnModel
from motet.predict.fill import FillModel
from motet.predict.model import PredictModel
from motet.search.model import SearchModel
from motet.steering.model import SteerModel
from motet.text.vocabulary import MAX_WORDS, SPECIALS
from motet_export.parity import FRAME_INPUTS, Examples, nudged, sides, walks

Decoded = dict[str, NDArray[Any]]
Runs = dict[str, Callable[[], Decoded]]
"""Name of a run -> decodes it with a model."""

Golden = tuple[Arrays, Json]
"""The inputs of a whole run and its settings."""


def whole_runs(onnx: BundleModel, torch: BundleModel) -> dict[str, Callable[[], tuple[Decoded, Decoded]]]:
    """Name of a run -> decodes it with both models.

    Both take the motions, words and frames of the second one, and its contract and vocabulary read what they give. So
    the runs differ where the first one declares others.
    """

    def both(name: str) -> tuple[Decoded, Decoded]:
        return runs_of(onnx, torch)[name](), runs_of(torch, torch)[name]()

    return {name: partial(both, name) for name in runs_of(onnx, torch)}


def differences(small: BundleModel, exact: BundleModel) -> dict[str, float]:
    """The effect of fewer bits on whole runs, for the manifest.

    "<run>.equal": share of decoded sentences that are the same. "<run>.score": mean |difference| of the log-likelihoods
    of known pairs, relative to their mean |value|. "<run>.frames": mean |difference| of frames, for runs of
    equal lengths.
    """
    report: dict[str, float] = {}
    for name, run in whole_runs(small, exact).items():
        rounded, expected = run()
        # sentences, likelihoods and frames, where a run has them
        if "words" in rounded and rounded["words"].shape == expected["words"].shape:
            report[f"{name}.equal"] = float((rounded["words"] == expected["words"]).all(axis=1).mean())
        if "scores" in rounded:
            error = np.abs(rounded["scores"] - expected["scores"]).mean()
            report[f"{name}.score"] = float(error / np.abs(expected["scores"]).mean())
        if "frames" in rounded and "lengths" not in rounded:
            report[f"{name}.frames"] = float(np.abs(rounded["frames"] - expected["frames"]).mean())
    return report


def golden_vectors(model: BundleModel, draws: Mapping[str, Examples]) -> tuple[bytes, Json]:
    """The file of golden vectors of a bundle, and its entry in the manifest."""
    rng = np.random.default_rng(5)
    feeds = {}
    # inputs of single calls, of frames zeros, ones, negatives and one as it is drawn; and of a whole run
    for role, graph in model.graphs.items():
        framed = any(graph.spec.takes(name) for name in FRAME_INPUTS)
        feeds[role] = draws[role](rng, 4 if framed else 2)
    inputs, settings = golden_run(model, rng)
    frames = walks(model.contract, rng, 1, 12)[0].astype(np.float64)
    tolerance = float(f"{_tolerance(model, feeds, inputs, settings):.1g}")
    entry = {"file": "golden.npz", "tolerance": tolerance, "run": settings}
    return vectors(model, feeds, inputs, settings, frames), entry


def _tolerance(model: BundleModel, feeds: Mapping[str, Arrays], inputs: Arrays, settings: Json) -> float:
    """Ten times the effect of the inputs' last bits on the outputs, between TOLERANCE and ten times that."""
    rng = np.random.default_rng(6)
    largest = 0.0
    for role, graph in model.graphs.items():
        largest = max(largest, difference(graph(nudged(feeds[role], rng)), graph(feeds[role])))
    # towards 0, which leaves controls and noise in their range
    near = {}
    for name, values in inputs.items():
        near[name] = np.nextafter(values, np.zeros_like(values)) if values.dtype == np.float32 else values
    moved = model.replay(near, settings)
    exact = model.replay(inputs, settings)
    if all(moved[name].shape == values.shape for name, values in exact.items()):
        largest = max(largest, difference(moved, exact))
    return min(max(TOLERANCE, 10 * largest), 10 * TOLERANCE)


@singledispatch
def runs_of(model: BundleModel, _like: BundleModel) -> Runs:
    """The whole runs of a model, by name, from the inputs of a model ``like`` it."""
    raise NotImplementedError(f"no whole runs of {model!r} are defined")


@singledispatch
def golden_run(model: BundleModel, _: np.random.Generator) -> Golden:
    """The whole run that verifies a bundle, as :meth:`BundleModel.replay` takes it."""
    raise NotImplementedError(f"no golden run of {model!r} is defined")


@runs_of.register
def _(model: TdbnModel, like: TdbnModel) -> Runs:
    """Four characters go through all labels in turn, with ramps of half a second between them."""
    ramp = round(like.fps / 2)
    corners = np.repeat(np.eye(len(like.labels)), round(2 * like.fps) + ramp, axis=0)
    # a running mean turns the steps between labels into ramps
    window = np.ones(ramp) / ramp
    columns = [np.convolve(column, window)[: len(corners)] for column in corners.T]
    smooth = np.stack(columns, axis=1)

    def controlled(variety: float) -> Decoded:
        iterations = 2 if model.has_free_units else 1
        session = model.start(characters=4, seed=7, variety=variety, iterations=iterations, smooth=False)
        frames = session.frames(smooth.clip(0, 1))
        return {"frames": frames, "places": _places(model, frames[0])}

    return {"mean_field": partial(controlled, 0.0), "sampled": partial(controlled, 1.0)}


@golden_run.register
def _(model: TdbnModel, rng: np.random.Generator) -> Golden:
    """From the first label to the last in 12 ticks."""
    places = np.linspace(0, len(model.labels) - 1, 12)[:, None]
    track = np.maximum(0, 1 - np.abs(places - np.arange(len(model.labels)))).astype(np.float32)
    iterations = 2 if model.has_free_units else 1
    noise = rng.random((12 * iterations, model.sizes["N"]), np.float32)
    return {"track": track, "noise": noise}, {"iterations": iterations}


@runs_of.register
def _(model: SteerModel, like: SteerModel) -> Runs:
    """Four characters, each in another direction, in all gaits in turn, for a second each."""

    def steered() -> Decoded:
        session = model.start(characters=4)
        poses = []
        for gait in like.gaits:
            session.control(gait=gait, speed=like.usual[gait], direction=np.arange(4) * 70.0 - 100)
            poses += [session.tick() for _ in range(round(like.fps))]
        frames = session.frames_of(poses)
        return {"frames": frames, "places": _places(model, frames[0])}

    return {"steered": steered}


@golden_run.register
def _(_model: SteerModel, rng: np.random.Generator) -> Golden:
    """In two random directions at walking speeds, 12 ticks each."""
    return {"track": np.repeat(rng.uniform(-1.5, 1.5, (2, 3)), 12, axis=0).astype(np.float32)}, {}


@runs_of.register
def _(model: DescribeModel, like: DescribeModel) -> Runs:
    """Descriptions of eight motions: word ids, log-probabilities and contexts; and the scores of known pairs."""

    def described(beams: int, draws: int | None = None) -> Decoded:
        rows = model.describe(_motions(like), beams, draws, decoding="consensus" if draws else "beam")
        descriptions = list(chain.from_iterable(rows))
        ids = np.zeros((len(descriptions), MAX_WORDS), dtype=np.int64)
        for row, description in zip(ids, descriptions, strict=True):
            if description.text:
                words, _ = like.vocabulary.encode(description.text)
                row[: len(words)] = words
        scores = np.array([description.log_probability for description in descriptions])
        return {"words": ids, "log_probabilities": scores, "contexts": model.embed(_motions(like))}

    return {
        "greedy": partial(described, 1),
        "beam": partial(described, 5),
        "consensus": partial(described, 5, 50),
        "scores": lambda: {"scores": np.array([model.score(*pair) for pair in _pairs(like)])},
    }


@golden_run.register
def _(model: DescribeModel, rng: np.random.Generator) -> Golden:
    """A motion of 20 frames, with the noise of the draws that a model makes."""
    inputs: Decoded = {"frames": walks(model.contract, rng, 1, 20)[0]}
    if "draws" in model.defaults:
        inputs["noise"] = noise_of(model.limits(model.defaults), int(model.defaults["draws"]))
    return inputs, {}


@runs_of.register
def _(model: GenerateModel, like: GenerateModel) -> Runs:
    """Three motions for each of eight sentences: normalised frames, lengths, log-likelihoods and contexts, and the
    joint positions of the first one."""

    def generated(candidates: int | None = None) -> Decoded:
        hypotheses = 3 if "hypotheses" in model.defaults else None
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", TextWarning)  # these sentences make no sense
            rows = model.generate(_sentences(like), hypotheses, candidates=candidates, seed=7, max_seconds=4)
        motions = list(chain.from_iterable(rows))
        return {
            "frames": np.concatenate([like.contract.normalised(motion.frames) for motion in motions]),
            "lengths": np.array([len(motion.frames) for motion in motions]),
            "log_likelihoods": np.array([motion.log_likelihood or 0.0 for motion in motions]),
            "contexts": model.embed(_sentences(like)),
            "places": _places(model, motions[0].frames),
        }

    if "candidates" not in model.defaults:
        return {"decoded": generated}
    return {
        "samples": partial(generated, 1),
        "beam": partial(generated, 4),
        "scores": lambda: {"scores": np.array([model.score(text, motion) for motion, text in _pairs(like)])},
    }


@golden_run.register
def _(model: GenerateModel, rng: np.random.Generator) -> Golden:
    """Two seconds for a sentence of five words, with two hypotheses and candidates if the loop has such."""
    text = _text(model, rng)
    settings: dict[str, Any] = {}
    for name in ("hypotheses", "candidates", "max_seconds", "seconds"):
        if name in model.defaults:
            settings[name] = 2
    # decode once to record the random numbers
    noise = Recording(rng)
    model.decode(model.contexts([model.ids(text)]), [noise], {**model.defaults, **settings})
    inputs = {kind: np.array(drawn, dtype=np.float32) for kind, drawn in noise.drawn.items() if drawn}
    return inputs, {**settings, "text": text}


@runs_of.register
def _(model: PredictModel, like: PredictModel) -> Runs:
    """Continuations of eight random walks, normalised, and the joint positions of the first one."""

    def predicted(horizons: int) -> Decoded:
        seeds = walks(like.contract, np.random.default_rng(3), 8, like.seed_frames)
        frames = model.next_frames(seeds, horizons * like.horizon)
        return {"frames": like.contract.normalised(frames), "places": _places(model, frames[0])}

    return {"horizon": partial(predicted, 1), "beyond": partial(predicted, 3)}


@golden_run.register
def _(model: PredictModel, rng: np.random.Generator) -> Golden:
    """One frame more than the horizon, so that the encoder is called again."""
    return {"frames": walks(model.contract, rng, 1, model.seed_frames)[0]}, {"frames": model.horizon + 1}


@runs_of.register
def _(model: FillModel, like: FillModel) -> Runs:
    """Gaps in eight random walks, filled."""

    def filled(frames: int) -> Decoded:
        rng = np.random.default_rng(3)
        known = [sides(like.contract, rng, like.context) for _ in range(8)]
        return {"frames": np.stack([model.frames_between(past, after, frames) for past, after in known])}

    return {"short": partial(filled, 4), "longest": partial(filled, like.longest)}


@golden_run.register
def _(model: FillModel, rng: np.random.Generator) -> Golden:
    """Half a second between the two parts of a random walk."""
    past, after = sides(model.contract, rng, model.context)
    return {"past": past, "after": after}, {"frames": round(model.fps / 2)}


@runs_of.register
def _(model: SearchModel, like: SearchModel) -> Runs:
    """Vectors of eight motions and eight sentences."""
    return {"vectors": lambda: {"motions": model.embed(_motions(like)), "texts": model.embed_text(_sentences(like))}}


@golden_run.register
def _(model: SearchModel, rng: np.random.Generator) -> Golden:
    """A motion, and a sentence of five words."""
    return {"frames": walks(model.contract, rng, 1, 20)[0]}, {"text": _text(model, rng)}


def _places(model: BundleModel, frames: Array) -> Array:
    """Joint positions (T, J, 3) of frames (T, D) by the model's manifest, in its skeleton's unit; none without a
    skeleton."""
    contract = model.contract
    return np.zeros((0, 0, 3)) if contract.skeleton is None else positions(contract.motion(frames, plant=False))


def _motions(model: LanguageModel) -> list[Motion]:
    """Eight random walks of 5 to 75 frames about the mean of the training data."""
    rng = np.random.default_rng(3)
    contract = model.contract
    motions = []
    for frames in range(5, 85, 10):
        steps = rng.normal(size=(frames, len(contract.mean)))
        walk = np.tanh(0.3 * steps.cumsum(axis=0))  # bounded by two standard deviations
        motions.append(contract.features(walk * 2 * contract.std + contract.mean))
    return motions


def _sentences(model: LanguageModel) -> list[str]:
    """Eight sentences of 1 to 15 words of the vocabulary."""
    rng = np.random.default_rng(4)
    return [" ".join(rng.choice(_known(model), length)) for length in range(1, 17, 2)]


def _pairs(model: LanguageModel) -> list[tuple[Motion, str]]:
    return list(zip(_motions(model), _sentences(model), strict=True))


def _text(model: LanguageModel, rng: np.random.Generator) -> str:
    return " ".join(rng.choice(_known(model), 5))


def _known(model: LanguageModel) -> tuple[str, ...]:
    """The words of the vocabulary, and the common words that stand for one of them."""
    return (*model.vocabulary.words[len(SPECIALS) :], *model.vocabulary.common)
