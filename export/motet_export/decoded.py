"""Whole runs of each verb: those decoded by ONNX Runtime and by torch from the same inputs, and the golden run."""

import warnings
from collections.abc import Callable, Mapping
from functools import partial, singledispatch
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motet.bundle.golden import TOLERANCE, vectors
from motet.bundle.graph import Arrays
from motet.decode.beam import noise_of
from motet.decode.loop import Recording
from motet.errors import TextWarning
from motet.generate.base import GenerateModel
from motet.models.base import BundleModel
from motet.models.describe import DescribeModel
from motet.models.language import LanguageModel
from motet.motion.motion import Motion
from motet.papers.tdbn_control import TdbnModel
from motet.predict.fill import FillModel
from motet.predict.model import PredictModel
from motet.search.model import SearchModel
from motet.steering.model import SteerModel
from motet.text.vocabulary import MAX_WORDS, SPECIALS
from motet_export.parity import Examples, sides, walks

Decoded = dict[str, NDArray[Any]]
Runs = dict[str, Callable[[], Decoded]]
"""By name of a run: what a model decodes."""

Golden = tuple[Arrays, dict[str, Any]]
"""The inputs of a whole run, and its settings."""


def whole_runs(onnx: BundleModel, torch: BundleModel) -> dict[str, Callable[[], tuple[Decoded, Decoded]]]:
    """By name of a run: what one and what the other model decodes."""

    def both(name: str) -> tuple[Decoded, Decoded]:
        return runs_of(onnx)[name](), runs_of(torch)[name]()

    return {name: partial(both, name) for name in runs_of(onnx)}


def differences(small: BundleModel, exact: BundleModel) -> dict[str, float]:
    """What fewer bits change in whole runs, for the manifest.

    "<run>.equal": share of the decoded sentences that are the same. "<run>.score": mean |difference| of the
    log-likelihoods of known pairs, in units of their mean |value|. "<run>.frames", where nothing but frames is decoded:
    their mean |difference|.
    """
    report: dict[str, float] = {}
    for name, run in whole_runs(small, exact).items():
        found, expected = run()
        if "words" in found and found["words"].shape == expected["words"].shape:
            report[f"{name}.equal"] = float((found["words"] == expected["words"]).all(axis=1).mean())
        if "scores" in found:
            off = np.abs(found["scores"] - expected["scores"]).mean() / np.abs(expected["scores"]).mean()
            report[f"{name}.score"] = float(off)
        if set(found) == {"frames"}:
            report[f"{name}.frames"] = float(np.abs(found["frames"] - expected["frames"]).mean())
    return report


def golden_vectors(model: BundleModel, draws: Mapping[str, Examples]) -> tuple[bytes, dict[str, Any]]:
    """The file of golden vectors of a bundle that is being exported, and what the manifest says of it."""
    rng = np.random.default_rng(5)
    feeds = {role: draws[role](rng, 2) for role in model.graphs}
    given, settings = golden_run(model, rng)
    return vectors(model, feeds, given, settings), {"file": "golden.npz", "tolerance": TOLERANCE, "run": settings}


@singledispatch
def runs_of(model: BundleModel) -> Runs:
    """What a model is asked to decode, by name."""
    raise NotImplementedError(f"no whole runs of {model!r} are defined")


@singledispatch
def golden_run(model: BundleModel, _: np.random.Generator) -> Golden:
    """The whole run by which a bundle is verified, one that :meth:`BundleModel.replay` takes."""
    raise NotImplementedError(f"no golden run of {model!r} is defined")


@runs_of.register
def _(model: TdbnModel) -> Runs:
    """Four characters go through all labels, one after the other, half a second of ramp between."""
    ramp = round(model.fps / 2)
    corners = np.repeat(np.eye(len(model.labels)), round(2 * model.fps) + ramp, axis=0)
    smooth = np.stack([np.convolve(column, np.ones(ramp) / ramp)[: len(corners)] for column in corners.T], axis=1)

    def controlled(variety: float) -> Decoded:
        iterations = 2 if model.has_free_units else 1
        session = model.start(characters=4, seed=7, variety=variety, iterations=iterations, smooth=False)
        return {"frames": session.frames(smooth.clip(0, 1))}

    return {"mean_field": partial(controlled, 0.0), "sampled": partial(controlled, 1.0)}


@golden_run.register
def _(model: TdbnModel, rng: np.random.Generator) -> Golden:
    """From the first label to each other one, in 12 ticks."""
    places = np.linspace(0, len(model.labels) - 1, 12)[:, None]
    track = np.maximum(0, 1 - np.abs(places - np.arange(len(model.labels)))).astype(np.float32)
    iterations = 2 if model.has_free_units else 1
    noise = rng.random((12 * iterations, model.sizes["N"]), np.float32)
    return {"track": track, "noise": noise}, {"iterations": iterations}


@runs_of.register
def _(model: SteerModel) -> Runs:
    """Four characters in all gaits, one after the other, for a second each, every one in another direction."""

    def steered() -> Decoded:
        session, poses = model.start(characters=4), []
        for gait in model.gaits:
            session.control(gait=gait, speed=model.usual[gait], direction=np.arange(4) * 70.0 - 100)
            poses += [session.tick() for _ in range(round(model.fps))]
        return {"frames": session.frames_of(poses)}

    return {"steered": steered}


@golden_run.register
def _(_model: SteerModel, rng: np.random.Generator) -> Golden:
    """Off into any direction, and into another, at a walk's speeds, 12 ticks each."""
    return {"track": np.repeat(rng.uniform(-1.5, 1.5, (2, 3)), 12, axis=0).astype(np.float32)}, {}


@runs_of.register
def _(model: DescribeModel) -> Runs:
    """Sentences of eight motions: ids of their words and log-probabilities, and the motions' contexts; and scores."""

    def described(beams: int, draws: int | None = None) -> Decoded:
        rows = model.describe(_motions(model), beams, draws, decoding="consensus" if draws else "beam")
        found = [description for row in rows for description in row]
        ids = np.zeros((len(found), MAX_WORDS), dtype=np.int64)
        for row, description in zip(ids, found, strict=True):
            if description.text:
                words, _ = model.vocabulary.encode(description.text)
                row[: len(words)] = words
        scores = np.array([description.log_probability for description in found])
        return {"words": ids, "log_probabilities": scores, "contexts": model.embed(_motions(model))}

    def scores() -> Decoded:
        return {
            "scores": np.array([model.score(*pair) for pair in zip(_motions(model), _sentences(model), strict=True)])
        }

    searches = {"greedy": (1,), "beam": (5,), "consensus": (5, 50)}
    return {name: partial(described, *settings) for name, settings in searches.items()} | {"scores": scores}


@golden_run.register
def _(model: DescribeModel, rng: np.random.Generator) -> Golden:
    frames = walks(model.contract, rng, 1, 20)[0]
    if "draws" not in model.defaults:
        return {"frames": frames}, {}
    return {"frames": frames, "noise": noise_of(model.limits(model.defaults), int(model.defaults["draws"]))}, {}


@runs_of.register
def _(model: GenerateModel) -> Runs:
    """Three motions for each of eight sentences: normalised frames, lengths and log-likelihoods, and the contexts."""

    def generated(candidates: int | None = None) -> Decoded:
        hypotheses = 3 if "hypotheses" in model.defaults else None
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", TextWarning)  # these sentences make no sense
            rows = model.generate(_sentences(model), hypotheses, candidates=candidates, seed=7, max_seconds=4)
        found = [generated for row in rows for generated in row]
        return {
            "frames": np.concatenate([model.contract.normalised(g.frames) for g in found]),
            "lengths": np.array([len(g.frames) for g in found]),
            "log_likelihoods": np.array([g.log_likelihood or 0.0 for g in found]),
            "contexts": model.embed(_sentences(model)),
        }

    def scores() -> Decoded:
        return {
            "scores": np.array([model.score(*pair) for pair in zip(_sentences(model), _motions(model), strict=True)])
        }

    if "candidates" not in model.defaults:
        return {"decoded": generated}
    return {"samples": partial(generated, 1), "beam": partial(generated, 4), "scores": scores}


@golden_run.register
def _(model: GenerateModel, rng: np.random.Generator) -> Golden:
    """Two seconds for a sentence of five words, with few hypotheses where the loop has such."""
    text, few = _text(model, rng), ("hypotheses", "candidates", "max_seconds", "seconds")
    settings: dict[str, Any] = {name: 2 for name in few if name in model.defaults}
    noise = Recording(rng)
    model.decode(model.contexts([model.ids(text)]), [noise], {**model.defaults, **settings})
    given = {kind: np.array(drawn, dtype=np.float32) for kind, drawn in noise.drawn.items() if drawn}
    return given, {**settings, "text": text}


@runs_of.register
def _(model: PredictModel) -> Runs:
    """What follows eight random walks, normalised."""

    def predicted(horizons: int) -> Decoded:
        seeds = walks(model.contract, np.random.default_rng(3), 8, model.seed_frames)
        return {"frames": model.contract.normalised(model.next_frames(seeds, horizons * model.horizon))}

    return {"horizon": partial(predicted, 1), "beyond": partial(predicted, 3)}


@golden_run.register
def _(model: PredictModel, rng: np.random.Generator) -> Golden:
    """One frame more than the horizon, so that the encoder is asked again."""
    return {"frames": walks(model.contract, rng, 1, model.seed_frames)[0]}, {"frames": model.horizon + 1}


@runs_of.register
def _(model: FillModel) -> Runs:
    """What fills a gap in each of eight random walks."""

    def filled(frames: int) -> Decoded:
        rng = np.random.default_rng(3)
        known = [sides(model.contract, rng, model.context) for _ in range(8)]
        return {"frames": np.stack([model.frames_between(*one, frames) for one in known])}

    return {"short": partial(filled, 4), "longest": partial(filled, model.longest)}


@golden_run.register
def _(model: FillModel, rng: np.random.Generator) -> Golden:
    """Half a second between two parts of a random walk."""
    past, after = sides(model.contract, rng, model.context)
    return {"past": past, "after": after}, {"frames": round(model.fps / 2)}


@runs_of.register
def _(model: SearchModel) -> Runs:
    return {"vectors": lambda: {"motions": model.embed(_motions(model)), "texts": model.embed_text(_sentences(model))}}


@golden_run.register
def _(model: SearchModel, rng: np.random.Generator) -> Golden:
    """A motion, and a sentence of five words."""
    return {"frames": walks(model.contract, rng, 1, 20)[0]}, {"text": _text(model, rng)}


def _motions(model: LanguageModel) -> list[Motion]:
    """Eight random walks of 5 to 75 frames about the mean of the training data."""
    rng, contract = np.random.default_rng(3), model.contract
    steps = (rng.normal(size=(frames, len(contract.mean))) for frames in range(5, 85, 10))
    drawn = (np.tanh(0.3 * one.cumsum(axis=0)) for one in steps)
    return [contract.features(walk * 2 * contract.std + contract.mean) for walk in drawn]


def _sentences(model: LanguageModel) -> list[str]:
    """Eight sentences of 1 to 15 words of the vocabulary."""
    rng = np.random.default_rng(4)
    return [" ".join(rng.choice(_known(model), length)) for length in range(1, 17, 2)]


def _text(model: LanguageModel, rng: np.random.Generator) -> str:
    return " ".join(rng.choice(_known(model), 5))


def _known(model: LanguageModel) -> tuple[str, ...]:
    return (*model.vocabulary.words[len(SPECIALS) :], *model.vocabulary.common)
