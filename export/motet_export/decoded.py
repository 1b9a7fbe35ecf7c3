"""Whole runs of each verb, decoded by ONNX Runtime and by torch from the same inputs and seeds."""

import warnings
from collections.abc import Callable, Sequence
from functools import partial, singledispatch
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motet.errors import TextWarning
from motet.models.base import BundleModel
from motet.models.describe import DescribeModel
from motet.models.fill import FillModel
from motet.models.generate import GenerateModel
from motet.models.language import MAX_WORDS, SPECIALS, LanguageModel
from motet.models.predict import PredictModel
from motet.models.search import SearchModel
from motet.models.steer import SteerModel
from motet.models.tdbn_control import TdbnModel
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet_export.examples import sides, walks

Decoded = dict[str, NDArray[Any]]
Runs = dict[str, Callable[[], tuple[Decoded, Decoded]]]
"""By name of a run: what ONNX Runtime decoded, and what torch decoded."""

Named = dict[str, Callable[[Any], Decoded]]
"""By name of a run: what a model decodes."""


def whole_runs(onnx: BundleModel, torch: BundleModel) -> Runs:
    """The runs by which a model is judged, each by its name."""
    runs = runs_of(onnx)
    return {name: partial(_pair, (onnx, torch), run) for name, run in runs.items()}


@singledispatch
def runs_of(model: BundleModel) -> Named:
    """What a model is asked to decode, by name."""
    raise NotImplementedError(f"no whole runs of {model!r} are defined")


@runs_of.register
def _tdbn(_: TdbnModel) -> Named:
    return {"mean_field": partial(_controlled, 0.0), "sampled": partial(_controlled, 1.0)}


def _controlled(variety: float, model: TdbnModel) -> Decoded:
    """Four characters go through all labels, one after the other, half a second of ramp between."""
    labels = len(model.labels)
    hold, ramp = round(2 * model.fps), round(model.fps / 2)
    corners = np.repeat(np.eye(labels), hold + ramp, axis=0)
    smooth = np.stack([np.convolve(column, np.ones(ramp) / ramp)[: len(corners)] for column in corners.T], axis=1)
    iterations = 2 if model.has_free_units else 1
    session = model.start(characters=4, seed=7, variety=variety, iterations=iterations, smooth=False)
    return {"frames": session.frames(smooth.clip(0, 1))}


@runs_of.register
def _steer(_: SteerModel) -> Named:
    return {"steered": _steered}


def _steered(model: SteerModel) -> Decoded:
    """Four characters in all gaits, one after the other, for a second each, every one in another direction."""
    session = model.start(characters=4)
    poses = []
    for gait in model.gaits:
        session.control(gait=gait, speed=model.usual[gait], direction=np.arange(4) * 70.0 - 100)
        poses += [session.tick() for _ in range(round(model.fps))]
    return {"frames": session.frames_of(poses)}


@runs_of.register
def _describe(_: DescribeModel) -> Named:
    searches = {"greedy": (1, None), "beam": (5, None), "consensus": (5, 50)}
    runs: Named = {name: partial(_described, *settings) for name, settings in searches.items()}
    return {**runs, "scores": _sentence_scores}


def _described(beams: int, draws: int | None, model: DescribeModel) -> Decoded:
    """Sentences of eight motions: ids of their words and log-probabilities, and the motions' contexts."""
    found = [
        row
        for motion in model.describe(_motions(model), beams, draws, decoding="consensus" if draws else "beam")
        for row in motion
    ]
    ids = np.zeros((len(found), MAX_WORDS), dtype=np.int64)
    for row, description in zip(ids, found, strict=True):
        if description.text:
            words, _ = model.vocabulary.encode(description.text)
            row[: len(words)] = words
    scores = np.array([description.log_probability for description in found])
    return {"words": ids, "log_probabilities": scores, "contexts": model.embed(_motions(model))}


def _sentence_scores(model: DescribeModel) -> Decoded:
    pairs = zip(_motions(model), _sentences(model), strict=True)
    return {"scores": np.array([model.score(motion, sentence) for motion, sentence in pairs])}


@runs_of.register
def _generate(model: GenerateModel) -> Named:
    if "candidates" not in model.defaults:
        return {"decoded": partial(_generated, None)}
    return {"samples": partial(_generated, 1), "beam": partial(_generated, 4), "scores": _motion_scores}


def _generated(candidates: int | None, model: GenerateModel) -> Decoded:
    """Three motions for each of eight sentences: normalised frames, lengths and log-likelihoods, and the contexts."""
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


def _motion_scores(model: GenerateModel) -> Decoded:
    pairs = zip(_sentences(model), _motions(model), strict=True)
    return {"scores": np.array([model.score(sentence, motion) for sentence, motion in pairs])}


@runs_of.register
def _predict(_: PredictModel) -> Named:
    return {"horizon": partial(_predicted, 1), "beyond": partial(_predicted, 3)}


def _predicted(horizons: int, model: PredictModel) -> Decoded:
    """What follows eight random walks, normalised."""
    contract = model.contract
    seeds = walks(contract, np.random.default_rng(3), 8, model.seed_frames)
    found = model.next_frames(seeds, horizons * model.horizon)
    return {"frames": contract.normalised(found)}


@runs_of.register
def _fill(_: FillModel) -> Named:
    return {"short": partial(_filled, 4), "longest": partial(_filled, None)}


def _filled(frames: int | None, model: FillModel) -> Decoded:
    """What fills a gap in each of eight random walks."""
    rng = np.random.default_rng(3)
    known = [sides(model.contract, rng, model.context) for _ in range(8)]
    return {"frames": np.stack([model.frames_between(*one, frames or model.longest) for one in known])}


@runs_of.register
def _search(_: SearchModel) -> Named:
    return {"vectors": lambda model: {"motions": model.embed(_motions(model)), "texts": _texts(model)}}


def _texts(model: SearchModel) -> NDArray[np.float32]:
    return model.embed_text(_sentences(model))


def _pair(models: Sequence[Any], run: Callable[[Any], Decoded]) -> tuple[Decoded, Decoded]:
    return run(models[0]), run(models[1])


def _motions(model: LanguageModel) -> list[Motion]:
    """Eight random walks of 5 to 75 frames about the mean of the training data."""
    rng = np.random.default_rng(3)
    contract = model.contract

    def walk(frames: int) -> Array:
        found: Array = 0.3 * rng.normal(size=(frames, len(contract.mean))).cumsum(axis=0)
        return np.tanh(found) * 2 * contract.std + contract.mean

    return [contract.features(walk(frames)) for frames in range(5, 85, 10)]


def _sentences(model: LanguageModel) -> list[str]:
    """Eight sentences of 1 to 15 words of the vocabulary."""
    rng = np.random.default_rng(4)
    words = model.vocabulary.words[len(SPECIALS) :]
    return [" ".join(rng.choice(words, length)) for length in range(1, 17, 2)]
