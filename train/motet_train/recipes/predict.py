"""Training of the small predictor: from sequences to a run."""

from dataclasses import asdict, replace

import torch
from torch import Tensor

from motet_train.data.errors import DataError
from motet_train.data.predict_data import Material, Windows
from motet_train.descent import GradientLearner, Term, Terms
from motet_train.models.kinematics import VectorPlaces, smooth_length
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
    ("channels", "kept", "held", "mirrored", "signs", "doubts"),
    PREDICTOR_TRAINING,
    AUGMENTED,
)

FILES = replace(DEFAULT, config=replace(DEFAULT.config, hidden=96), training=replace(PREDICTOR_TRAINING, steps=12_000))
"""For motion files of more people; nets of two and four times the width are worse on held-out people."""

RECIPES = {"default": DEFAULT, "files": FILES}


def train_predict(material: Material, job: Job) -> Run:
    """Train a predictor, see :meth:`motet_train.recipes.recipe.Job.run`; DataError for unfit sequences.

    From motion files it learns the positions of joints, and from the sequences held out for validation its expected
    errors; from text files, which have no bones, it learns their channels.
    """
    visits = possible(job.recipe.visits, material)
    job = replace(job, recipe=replace(job.recipe, visits=visits))
    torch.manual_seed(job.about.seed)
    net = _untrained(material, job.recipe)
    defaults = {"horizon": net.config.frames}
    about = {"data": material.about}
    manifest = job.manifest(material.contract, asdict(net.config), defaults, material.licence, about)
    learner = _learner(net.to(job.device), job, material)
    return job.run(learner.kept, learner, manifest)


def _learner(net: Predictor, job: Job, material: Material) -> GradientLearner[Predictor]:
    """Learns the frames of windows after their seed, and from held-out ones its expected errors."""
    # windows of input and output; text files, which have no bones, are taken as they are
    config = net.config
    has_bones = material.contract.skeleton is not None
    seed = config.seed_frames if has_bones else None
    windows = Windows(material, config.seed_frames + config.frames, **asdict(job.recipe.visits), seed=seed)
    held_out = windows.along(material.validation, 25).to(job.device) if config.doubts else None

    weights = _frame_weights(config.frames).to(job.device)
    places = VectorPlaces(material.contract).to(job.device) if has_bones else None
    learner = GradientLearner(
        net,
        job.training,
        lambda drawn: _loss(net, drawn, weights, places),
        lambda rng: (windows.draw(job.training.batch, rng),),
        lambda: {} if places is None or held_out is None else _error_head_fitted(learner.kept, places, held_out),
    )
    return learner


def _frame_weights(frames: int) -> Tensor:
    """The weights (N,) of predicted frames: about the inverse of their expected error, mean 1."""
    weights = 1 / (0.3 + 0.12 * torch.arange(1.0, frames + 1) ** 0.8)
    return weights / weights.mean()


def possible(visits: Visits, material: Material) -> Visits:
    """The visits that the material allows: reverse only without velocities, mirror only with known sides."""
    visits = replace(visits, reverse=0.0) if material.rates else visits
    return visits if material.mirrored else replace(visits, mirror=0.0)


def _untrained(material: Material, recipe: Recipe) -> Predictor:
    held = material.held
    kept = list(material.kept)
    net = Predictor(
        recipe.sized(
            channels=len(material.contract.channels),
            kept=material.kept,
            held=held,
            doubts=material.contract.skeleton is not None and bool(material.mirrored) and len(material.validation) > 0,
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


def _loss(net: Predictor, windows: Tensor, weights: Tensor, places: VectorPlaces | None) -> Terms:
    """The weighted mean distance between predicted and true frames: of channels, and of joints if they have positions,
    a metre of which counts like 100 units of channels."""
    seed = windows[:, : net.config.seed_frames]
    truth = windows[:, net.config.seed_frames :]
    predicted = net.plain(seed)
    moved = list(net.config.kept[net.config.held :])
    errors = smooth_length((predicted - truth)[..., moved], 1e-6)
    if places is not None:  # the channels still count, or turns about bones' own axes would not
        errors = 10.0 * smooth_length(places(predicted) - places(truth), 1e-6).mean(-1) + 0.1 * errors
    return (Term((errors * weights).mean(), len(windows)),)


@torch.no_grad()
def _error_head_fitted(net: Predictor, places: VectorPlaces, held_out: Tensor) -> dict[str, float]:
    """Fit a net's expected errors to windows that it was not trained on; their mean joint error in centimetres."""
    net.eval()
    # the net's errors on windows that it was not trained on
    windows = torch.cat([held_out, net.mirror(held_out)])
    seed = windows[:, : net.config.seed_frames]
    truth = windows[:, net.config.seed_frames :]
    predicted, disagreement = net.with_disagreement(seed)
    errors = (places(predicted) - places(truth)).norm(dim=-1).mean(-1)
    assert net.doubt is not None
    net.doubt.fit(net.error_signs(seed, predicted, disagreement), errors)
    return {"validation": round(100 * float(errors.mean()), 4)}
