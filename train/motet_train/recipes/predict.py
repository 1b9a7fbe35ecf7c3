"""Training of the predictors: from sequences to a run."""

from dataclasses import asdict, replace

import torch
from torch import Tensor

from motet_train.data.errors import DataError
from motet_train.data.predict_data import Material, Windows
from motet_train.descent import GradientLearner, Term, Terms
from motet_train.models.figure_predictor import FigurePredictor, FigurePredictorConfig
from motet_train.models.kinematics import smooth_length, vector_figure_of
from motet_train.models.predictor import Predictor, PredictorConfig
from motet_train.recipes.recipe import ADAMW, AUGMENTED, Job, Recipe, Visits
from motet_train.runs import Run

PREDICTOR_TRAINING = replace(
    ADAMW, steps=5600, every=200, batch=64, weight_decay=0.01, warm_up=100, cosine=True, clip=1.0, average=0.998
)

DEFAULT = Recipe(
    "predict",
    "trajectory",
    "free_run",
    PredictorConfig(0, ()),
    ("channels", "kept", "held", "mirrored", "signs"),
    PREDICTOR_TRAINING,
    AUGMENTED,
)
"""For the protocol's text files, which have no bones."""

FIGURE_RECIPE = Recipe(
    "predict",
    "figure-trajectory",
    "free_run",
    FigurePredictorConfig(0),
    ("channels", "figure", "doubts"),
    replace(
        PREDICTOR_TRAINING,
        steps=7000,
        every=1000,
        batch=128,
        learning_rate=7e-4,
        weight_decay=0.001,
        cosine=False,
        average=0.998,
    ),
    replace(AUGMENTED, warp=0.0),
)
"""For motion files of a figure."""

RECIPES = {"default": DEFAULT, "files": FIGURE_RECIPE}

MARKER_WEIGHT = 0.25
"""Weight of the mean distance of markers in the loss, against that of joints."""


def train_predict(material: Material, job: Job) -> Run:
    """Train a predictor, see :meth:`motet_train.recipes.recipe.Job.run`; DataError for unfit sequences.

    From motion files it learns the places of joints, and from the sequences held out for validation its expected
    errors; from text files, which have no bones, it learns their channels. DataError for a recipe of the other kind.
    """
    visits = possible(job.recipe.visits, material)
    job = replace(job, recipe=replace(job.recipe, visits=visits))
    torch.manual_seed(job.about.seed)
    has_bones = material.contract.skeleton is not None
    refuse_unfit(job.recipe, has_bones)
    learner = _figure_learner(material, job) if has_bones else _channel_learner(material, job)
    config = learner.net.config
    manifest = job.manifest(
        material.contract, asdict(config), {"horizon": config.frames}, material.licence, {"data": material.about}
    )
    return job.run(learner.kept, learner, manifest)


def refuse_unfit(recipe: Recipe, has_bones: bool) -> None:
    """DataError where a recipe is not for data of its kind, motion files that have bones, or text files without."""
    learns_figure = isinstance(recipe.config, FigurePredictorConfig)
    if has_bones and not learns_figure:
        raise DataError("motion files have bones, which this preset does not learn: train with --preset files")
    if learns_figure and not has_bones:
        raise DataError("text files have no bones: leave out --preset files, or give motion files")


def possible(visits: Visits, material: Material) -> Visits:
    """The visits that the material allows: reverse only without velocities, mirror only with known sides."""
    visits = replace(visits, reverse=0.0) if material.rates else visits
    return visits if material.mirrored else replace(visits, mirror=0.0)


def _channel_learner(material: Material, job: Job) -> GradientLearner[Predictor]:
    """Learns the channels of windows after their seed."""
    net = _untrained_channels(material, job.recipe).to(job.device)
    config = net.config
    windows = Windows(material, config.seed_frames + config.frames, **asdict(job.recipe.visits))
    weights = _frame_weights(config.frames).to(job.device)
    return GradientLearner(
        net,
        job.training,
        lambda drawn: _channel_loss(net, drawn, weights),
        lambda rng: (windows.draw(job.training.batch, rng),),
    )


def _frame_weights(frames: int) -> Tensor:
    """The weights (N,) of predicted frames: about the inverse of their expected error, mean 1."""
    weights = 1 / (0.3 + 0.12 * torch.arange(1.0, frames + 1) ** 0.8)
    return weights / weights.mean()


def _untrained_channels(material: Material, recipe: Recipe) -> Predictor:
    held = material.held
    kept = list(material.kept)
    net = Predictor(
        recipe.sized(
            channels=len(material.contract.channels),
            kept=material.kept,
            held=held,
            mirrored=material.mirrored,
            signs=material.signs,
        )
    )
    if held not in (0, 6):
        raise DataError(f"the root's translation and rotation must vary in the data, but only {held} of 6 columns do")
    net.measure_by(material.contract.mean[kept], material.contract.std[kept])
    net.mean[:held] = 0.0
    net.scale[:held] = torch.tensor([5.0] * 3 + [0.5] * 3)[:held]  # length units and radians from the last frame
    return net


def _channel_loss(net: Predictor, windows: Tensor, weights: Tensor) -> Terms:
    """The weighted mean distance between predicted and true channels."""
    seed = windows[:, : net.config.seed_frames]
    truth = windows[:, net.config.seed_frames :]
    moved = list(net.config.kept[net.config.held :])
    errors = smooth_length((net.plain(seed) - truth)[..., moved], 1e-6)
    return (Term((errors * weights).mean(), len(windows)),)


def _figure_learner(material: Material, job: Job) -> GradientLearner[FigurePredictor]:
    """Learns where points of a figure are after the seed of a window, and from held-out windows its expected errors."""
    contract = material.contract
    figure = vector_figure_of(contract)
    net = FigurePredictor(
        job.recipe.sized(
            channels=len(contract.channels),
            figure=figure if material.mirrored else replace(figure, partners=()),
            doubts=bool(material.mirrored) and len(material.validation) > 0,
        )
    )
    config = net.config
    seed = config.seed_frames
    windows = Windows(material, seed + config.frames, **asdict(job.recipe.visits), seed=seed)
    held_out = windows.along(material.validation, 25).to(job.device) if config.doubts else None
    learner = GradientLearner(
        net.to(job.device),
        job.training,
        lambda drawn: _figure_loss(net, drawn),
        lambda rng: (windows.draw(job.training.batch, rng),),
        lambda: {} if held_out is None else _error_head_fitted(learner.kept, held_out),
    )
    return learner


def _figure_loss(net: FigurePredictor, windows: Tensor) -> Terms:
    """The mean distance of joints from their true places, how it changes from frame to frame, and the same of markers,
    which count less, and show how bones turn about themselves."""
    seed = net.config.seed_frames
    with torch.autocast(windows.device.type, enabled=False):
        points = net.seen(windows)
    apart = points[:, seed - 1 : seed] + net.steps(net.weights(points[:, :seed])).float() - points[:, seed:]
    # by member, row and point
    lengths = smooth_length(apart, 1e-8).mean(2) + smooth_length(apart.diff(dim=2), 1e-8).mean(2)
    joints = net.points.joints
    losses = (lengths[..., :joints].mean(2) + MARKER_WEIGHT * lengths[..., joints:].mean(2)).sum(0)
    return (Term(losses, len(windows)),)


@torch.no_grad()
def _error_head_fitted(net: FigurePredictor, held_out: Tensor) -> dict[str, float]:
    """Fit a net's expected errors to windows that it was not trained on; their mean joint error in centimetres."""
    net.eval()
    seed = net.config.seed_frames
    frames = held_out[:, :seed]
    predicted, disagreement = net.with_disagreement(frames)
    apart = net.seen(torch.cat([frames, predicted], dim=1)) - net.seen(held_out)
    errors = apart[:, seed:, : net.points.joints].norm(dim=-1).mean(-1)
    assert net.doubt is not None
    net.doubt.fit(net.error_signs(frames, predicted, disagreement), errors)
    return {"validation": round(100 * float(errors.mean()), 4)}
