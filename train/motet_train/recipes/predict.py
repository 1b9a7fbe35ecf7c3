"""Training of the small predictor: from sequences to a run."""

from collections.abc import Iterator
from dataclasses import asdict, replace

import numpy as np
import torch
from torch import Tensor

from motet_train.data.errors import DataError
from motet_train.data.predict_data import Material
from motet_train.data.windows import Windows
from motet_train.descent import GradientLearner, Term, Terms, Training
from motet_train.models.predict.predictor import Predictor, PredictorConfig
from motet_train.recipes.recipe import Job, Recipe, Visits
from motet_train.runs import Run

HELD_SCALES = (5.0,) * 3 + (0.5,) * 3
"""Of the root's translation (length units) and rotation (radians) relative to the last frame."""

DEFAULT = Recipe(
    "predict",
    "trajectory",
    "free_run",
    PredictorConfig(0, ()),
    ("channels", "kept", "held", "mirrored", "signs"),
    Training(
        steps=5600,
        every=200,
        batch=64,
        optimiser="adamw",
        learning_rate=2e-3,
        weight_decay=0.01,
        warm_up=100,
        cosine=True,
        clip=1.0,
        average=0.998,
        keep="last",
    ),
    Visits(warp=0.15, reverse=0.3, mirror=0.5),
)

RECIPES = {"default": DEFAULT}


def train_predict(material: Material, job: Job) -> Run:
    """Train a predictor, see :meth:`motet_train.recipes.recipe.Job.run`; DataError for unfit sequences."""
    visits = possible(job.recipe.visits, material)
    job = replace(job, recipe=replace(job.recipe, visits=visits))
    training = job.recipe.training
    assert training is not None
    torch.manual_seed(job.about.seed)
    net = _untrained(material, job.recipe)
    defaults = {"horizon": net.config.frames}
    manifest = job.manifest(material.contract, asdict(net.config), defaults, material.licence, {"data": material.about})
    seed = net.config.seed_frames if material.layout is None else None  # text files are taken as they are
    windows = Windows(material, net.config.seed_frames + net.config.frames, **asdict(visits), seed=seed)
    times, batch = _importance(net.config.frames).to(job.device), training.batch

    def batches(rng: np.random.Generator) -> Iterator[Tensor]:
        yield windows.draw(batch, rng)

    learner = GradientLearner(net.to(job.device), training, lambda drawn: _loss(net, drawn, times), batches)
    trained = learner.kept
    assert isinstance(trained, Predictor)
    return job.run(trained, learner, manifest)


def possible(visits: Visits, material: Material) -> Visits:
    """The visits without what the material does not allow: warp and reverse only of poses, mirror of known sides."""
    visits = visits if material.poses else replace(visits, warp=0.0, reverse=0.0)
    return visits if material.mirrored else replace(visits, mirror=0.0)


def _untrained(material: Material, recipe: Recipe) -> Predictor:
    held, kept = material.held, list(material.kept)
    sides = {"mirrored": material.mirrored, "signs": material.signs}
    net = Predictor(recipe.sized(channels=len(material.contract.channels), kept=material.kept, held=held, **sides))
    if held not in (0, len(HELD_SCALES)):
        raise DataError(f"the root's translation and rotation must vary in the data, but only {held} of 6 columns do")
    net.measure_by(material.contract.mean[kept], material.contract.std[kept])
    net.mean[:held] = 0.0
    net.scale[:held] = torch.tensor(HELD_SCALES[:held])
    return net


def _loss(net: Predictor, windows: Tensor, times: Tensor) -> Terms:
    """The mean distance of predicted and true frames, in radians and metres, each frame's by its importance."""
    seed, truth = windows[:, : net.config.seed_frames], windows[:, net.config.seed_frames :]
    moved = list(net.config.kept[net.config.held :])
    off = (net.plain(seed) - truth)[..., moved]
    return (Term(((off.square().sum(-1) + 1e-6).sqrt() * times).mean(), len(windows)),)


def _importance(frames: int) -> Tensor:
    """Weights (N,) of the predicted frames, mean 1: about the inverse of the error that one has to expect."""
    weights = 1 / (0.3 + 0.12 * torch.arange(1.0, frames + 1) ** 0.8)
    return weights / weights.mean()
