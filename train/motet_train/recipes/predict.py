"""Training of the small predictor: from sequences to a run."""

from dataclasses import asdict, replace

import torch
from torch import Tensor

from motet_train.data.errors import DataError
from motet_train.data.predict_data import Material, Windows
from motet_train.descent import GradientLearner, Term, Terms
from motet_train.models.kinematics import VectorPlaces
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
"""Of motion files, of more people: on those held out, nets of two and four times the width are worse."""

RECIPES = {"default": DEFAULT, "files": FILES}


def train_predict(material: Material, job: Job) -> Run:
    """Train a predictor, see :meth:`motet_train.recipes.recipe.Job.run`; DataError for unfit sequences.

    Of motion files it learns where the joints will be, and, from the sequences held out for validation, how far off it
    is likely to be; of text files, which have no bones, it learns their channels.
    """
    visits = possible(job.recipe.visits, material)
    job = replace(job, recipe=replace(job.recipe, visits=visits))
    torch.manual_seed(job.about.seed)
    net = _untrained(material, job.recipe)
    count = net.config.frames
    about = {"data": material.about}
    manifest = job.manifest(material.contract, asdict(net.config), {"horizon": count}, material.licence, about)
    bones = material.contract.skeleton is not None
    seed = net.config.seed_frames if bones else None  # text files are taken as they are
    windows = Windows(material, net.config.seed_frames + count, **asdict(visits), seed=seed)
    # about the inverse of the error to be expected, mean 1
    times = 1 / (0.3 + 0.12 * torch.arange(1.0, count + 1) ** 0.8)
    times = (times / times.mean()).to(job.device)
    places = VectorPlaces(material.contract).to(job.device) if bones else None
    held = windows.along(material.validation, 25).to(job.device) if net.config.doubts else None
    learner = GradientLearner(
        net.to(job.device),
        job.training,
        lambda drawn: _loss(net, drawn, times, places),
        lambda rng: (windows.draw(job.training.batch, rng),),
        lambda: {} if places is None or held is None else _error_head_fitted(trained, places, held),
    )
    assert isinstance(learner.kept, Predictor)
    trained: Predictor = learner.kept
    return job.run(trained, learner, manifest)


def possible(visits: Visits, material: Material) -> Visits:
    """The visits that the material allows: reverse only without velocities, mirror only with known sides."""
    visits = replace(visits, reverse=0.0) if material.rates else visits
    return visits if material.mirrored else replace(visits, mirror=0.0)


def _untrained(material: Material, recipe: Recipe) -> Predictor:
    held, kept = material.held, list(material.kept)
    sides = {"mirrored": material.mirrored, "signs": material.signs}
    doubts = material.contract.skeleton is not None and bool(material.mirrored) and len(material.validation) > 0
    sizes = {"channels": len(material.contract.channels), "kept": material.kept, "held": held, "doubts": doubts}
    net = Predictor(recipe.sized(**sizes, **sides))
    if held not in (0, 6):
        raise DataError(f"the root's translation and rotation must vary in the data, but only {held} of 6 columns do")
    net.measure_by(material.contract.mean[kept], material.contract.std[kept])
    net.mean[:held] = 0.0
    net.scale[:held] = torch.tensor([5.0] * 3 + [0.5] * 3)[:held]  # length units and radians from the last frame
    return net


def _loss(net: Predictor, windows: Tensor, times: Tensor, places: VectorPlaces | None) -> Terms:
    """The mean distance of predicted and true frames, each frame's by its importance: of channels, and of joints where
    they have places, of which a metre counts like 100 units of channels."""

    def length(vectors: Tensor) -> Tensor:
        """Of vectors (..., K), with gradients at 0: (...)."""
        return (vectors.square().sum(-1) + 1e-6).sqrt()

    seed, truth = windows[:, : net.config.seed_frames], windows[:, net.config.seed_frames :]
    predicted, moved = net.plain(seed), list(net.config.kept[net.config.held :])
    off = length((predicted - truth)[..., moved])
    if places is not None:  # without channels, turns about bones' own axes would not count
        off = 10.0 * length(places(predicted) - places(truth)).mean(-1) + 0.1 * off
    return (Term((off * times).mean(), len(windows)),)


@torch.no_grad()
def _error_head_fitted(net: Predictor, places: VectorPlaces, held: Tensor) -> dict[str, float]:
    """Teach a net its errors where it was not trained; the mean distance of joints there, in centimetres."""
    net.eval()
    held = torch.cat([held, net.mirror(held)])
    seed, truth = held[:, : net.config.seed_frames], held[:, net.config.seed_frames :]
    predicted, disagreement = net.with_disagreement(seed)
    off = (places(predicted) - places(truth)).norm(dim=-1).mean(-1)
    assert net.doubt is not None
    net.doubt.fit(net.error_signs(seed, predicted, disagreement), off)
    return {"validation": round(100 * float(off.mean()), 4)}
