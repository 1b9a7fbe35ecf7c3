"""The published systems that predict, by name, and their training: from motions to a run."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, replace
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn.functional import softplus

from motet.bundle.fields import Json
from motet_train.data.errors import DataError
from motet_train.data.predict_data import Material, Windows
from motet_train.data.table import read_toml
from motet_train.descent import Descent, GradientLearner, Term, Terms, Training
from motet_train.models.net import configured
from motet_train.papers.li2018 import SYSTEMS, convseq2seq, from_config, srnn
from motet_train.papers.li2018.expmap import CMU_LAYOUT, OUTPUT_FRAMES, PROTOCOL_WINDOW, SEED_FRAMES, ExpmapMaterial
from motet_train.papers.li2018.stepwise import Stepwise
from motet_train.recipes.predict import possible
from motet_train.recipes.recipe import AUGMENTED, Job, Recipe, Visits
from motet_train.runs import Run
from motet_train.trainer import Part

PRESETS = read_toml(__file__, "recipes.toml")


def _recipes(model: str) -> dict[str, Recipe]:
    """The recipes of a model in recipes.toml, by the names of their presets."""
    derived = {"dimensions": 0, "parts": ()} if model == "srnn" else {"dimensions": 0}
    recipes = {}
    for name, preset in PRESETS[model].items():
        config = configured(SYSTEMS[model][1], {**derived, **preset.get("config", {})})
        visits = Visits(**preset["visits"]) if "visits" in preset else AUGMENTED
        training = configured(Training, preset["training"])
        defaults = {"horizon": OUTPUT_FRAMES}
        recipes[name] = Recipe("predict", model, "free_run", config, tuple(derived), training, visits, defaults)
    return recipes


RECIPES: Mapping[str, Mapping[str, Recipe]] = {model: _recipes(model) for model in PRESETS}
"""Model -> name of a preset -> recipe."""


def sized(recipe: Recipe, material: Material) -> Any:
    """The system's configuration for the material; DataError where it needs parts of the body that are not known."""
    if "parts" not in recipe.derived:
        config = recipe.sized(dimensions=len(material.kept))
        if isinstance(config, convseq2seq.Config) and config.padding == "paper":
            layout = material.layout if isinstance(material, ExpmapMaterial) else CMU_LAYOUT
            config = replace(config, padding=layout.padding)
        return config
    if not isinstance(material, ExpmapMaterial):
        raise DataError("srnn is trained on exponential-map text files, whose columns are assigned to legs and arms")
    return recipe.sized(dimensions=len(material.kept), parts=srnn.parts_of(material.layout, material.kept))


def train_system(material: Material, job: Job) -> Run:
    """Train a system, see :meth:`motet_train.recipes.recipe.Job.run`; DataError where the data cannot be trained on.

    material: of text files, as the paper's, or of motion files on the humanoid, which a bundle can continue.
    The weights kept are those with the smallest :func:`validation_error`.
    """
    visits = possible(job.recipe.visits, material)
    kept = list(material.kept)
    job = replace(job, recipe=replace(job.recipe, visits=visits))
    torch.manual_seed(job.about.seed)
    config = sized(job.recipe, material)
    # the manifest, from which the net is built
    sizes = {"channels": len(material.contract.channels), "kept": kept, "seed_frames": SEED_FRAMES}
    manifest = job.manifest(
        material.contract,
        {**sizes, "system": asdict(config)},
        job.recipe.defaults,
        material.licence,
        {"data": material.about},
    )
    net = from_config(job.recipe.model, manifest["config"])
    net.measure_by(material.contract.mean[kept], material.contract.std[kept])
    # train it on windows
    learner = _learner(net.to(job.device), config, _windows(material, visits), job)
    return job.run(learner.kept, learner, manifest)


def _windows(material: Material, visits: Visits) -> Windows:
    """Windows of the protocol's length; those of text files, which have no bones, are taken as they are."""
    anchor = None if material.contract.skeleton is None else SEED_FRAMES
    return Windows(material, PROTOCOL_WINDOW, **asdict(visits), seed=anchor)


def _learner(net: Stepwise, config: Any, windows: Windows, job: Job) -> GradientLearner[Stepwise]:
    training = job.training

    def batches(rng: np.random.Generator) -> Iterator[Tensor]:
        yield windows.draw(training.batch, rng)

    def validated() -> Json:
        return {"validation": round(validation_error(learner.kept, windows.material), 6)}

    def loss(windows: Tensor) -> Terms:
        return (Term(net.system.loss(net.normalised(windows), net.seed_frames), len(windows)),)

    # an adversary beside it, if the recipe has one
    parts: dict[str, Part] = {}
    if training.adversary:
        if not isinstance(config, convseq2seq.Config):
            raise DataError("this system is not trained against an adversary")
        adversary = Adversary(net, convseq2seq.Discriminator(config, PROTOCOL_WINDOW).to(job.device), training)
        loss = adversary.loss
        parts = adversary.parts
    learner = GradientLearner(net, training, loss, batches, validated, net.system.progress, parts)
    return learner


class Adversary:
    """A discriminator of whole windows trained beside a system, as a part of its loss (Li et al. 2018)."""

    def __init__(self, net: Stepwise, judge: nn.Module, training: Training) -> None:
        self.net = net
        self.judge = judge
        self.weight = training.adversary
        self.descent = Descent(judge, self._judging, training)
        self.parts: dict[str, Part] = {"judge": judge, "judging": self.descent.optimiser}

    def loss(self, windows: Tensor) -> Terms:
        """The discriminator learns (eq. 8), then its loss for the system (eq. 9)."""
        # the discriminator learns to tell true windows from those that end in predictions
        normal = self.net.normalised(windows)
        seed_frames = self.net.seed_frames
        predicted = self.net.system.imagine(normal, seed_frames)
        false = torch.cat([normal[:, :seed_frames], predicted], dim=1)
        self.descent.step([(torch.cat([false.detach(), normal]), True)])

        # how clearly it tells them, and how far they are from the truth
        self.judge.requires_grad_(False)
        opinion = softplus(-self.judge(false).float()).mean()
        self.judge.requires_grad_(True)
        error = self.net.system.error(predicted, normal[:, seed_frames:])
        return (Term(error + self.weight * opinion, len(windows)),)

    def _judging(self, windows: Tensor) -> Terms:
        """Of false windows and as many true ones (2 B, L + N, D)."""
        false, true = windows.chunk(2)
        return (Term(softplus(self.judge(false).float()) + softplus(-self.judge(true).float()), len(true)),)


@torch.no_grad()
def validation_error(net: Stepwise, material: Material) -> float:
    """The mean distance of predicted and true frames, without the root, in the contract's units.

    Over eight evenly spaced windows of each of the held-out motions, or of all where none could be held out.
    """
    # windows of all motions that are long enough
    steps = material.stride * np.arange(PROTOCOL_WINDOW)
    cuts = []
    for sequence in material.validation or material.sequences:
        if len(sequence) > steps[-1]:
            starts = np.linspace(0, len(sequence) - steps[-1] - 1, 8).astype(int)
            cuts.append(sequence[starts[:, None] + steps])

    # how far predictions are from them
    windows = torch.from_numpy(np.concatenate(cuts)).to(net.mean.device)
    errors = net(windows[:, :SEED_FRAMES], OUTPUT_FRAMES) - windows[:, SEED_FRAMES:]
    return float(errors[..., list(material.kept[material.held :])].norm(dim=-1).double().mean())
