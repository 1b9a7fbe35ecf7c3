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
from motet_train.descent import Descent, GradientLearner, Term, Terms, Training
from motet_train.papers.li2018 import convseq2seq, from_config, recurrent, srnn
from motet_train.papers.li2018.expmap import CMU_LAYOUT, OUTPUT_FRAMES, PROTOCOL_WINDOW, SEED_FRAMES, ExpmapMaterial
from motet_train.papers.li2018.stepwise import Stepwise
from motet_train.recipes.predict import possible
from motet_train.recipes.recipe import AUGMENTED, Job, Recipe, Visits
from motet_train.runs import Run
from motet_train.trainer import Part

CODE = Training(steps=20_000, every=500, learning_rate=5e-5, decay=(0.99, 10_000), l2=0.0005, adversary=0.01)
PAPER_TRAINING = Training(steps=20_000, every=500, learning_rate=2e-4, batch=64, l2=0.001, adversary=0.01)
"""Section 4.1. How long it trains is not said there: 20,000 steps are the code's. The error is divided by the number of
channels, as in the code, while eq. 7 sums over them; so both regularisers weigh that many times as much as in eq. 9."""

SHORT_TRAINING = Training(steps=2000, every=100, falling=0.7, l2=1.4e-5, average=0.99)
"""What learns best in a quarter of an hour on a CPU, by the error on held-out files: a higher learning rate, which
falls; the paper's weight of the squared weights, .001, relative to an error that eq. 7 sums over 70 channels; no
adversary, which doubles the time and brings nothing; and the running mean of the weights, as of motet's own
predictor."""

RESIDUAL = Training(steps=3000, every=250, falling=0.5, clip=5.0, average=0.99)
"""Clipped as in Martinez et al. 2017; after 1,500 steps Adam is off by .62 on held-out files, and their SGD by .88."""

TAUGHT = Training(every=100, falling=0.5, clip=25.0, average=0.99)
"""Of nets that are taught the next frame: the clipping is that of Jain et al. 2016, who took SGD and more steps. How
many each takes here was set by time; with twice as many, which three of them were tried with, the error on held-out
files is smaller by seven per cent at most, see docs/predict.md."""


def _recipe(model: str, config: Any, training: Training, visits: Visits = AUGMENTED) -> Recipe:
    derived = ("dimensions", "parts") if model == "srnn" else ("dimensions",)
    return Recipe("predict", model, "free_run", config, derived, training, visits, {"horizon": OUTPUT_FRAMES})


RECIPES: Mapping[str, Mapping[str, Recipe]] = {
    "convseq2seq": {
        "default": _recipe("convseq2seq", convseq2seq.Config(0, padding="same", loss="distance"), SHORT_TRAINING),
        "paper": _recipe("convseq2seq", convseq2seq.Config(0, padding="paper"), PAPER_TRAINING, Visits()),
        "code": _recipe(
            "convseq2seq",
            convseq2seq.Config(0, padding="paper", dropout=(0.2, 0.2, 0.5), predicted_share=0.95),
            CODE,
            Visits(),
        ),
    },
    "rrnn": {"default": _recipe("rrnn", recurrent.RRNNConfig(0), RESIDUAL)},
    "erd": {"default": _recipe("erd", recurrent.ERDConfig(0), replace(TAUGHT, steps=900))},
    "lstm-3lr": {"default": _recipe("lstm-3lr", recurrent.LSTM3LRConfig(0), replace(TAUGHT, steps=700))},
    "srnn": {"default": _recipe("srnn", srnn.Config(0, ()), replace(TAUGHT, steps=650, learning_rate=3e-3))},
    "lstm-ae": {"default": _recipe("lstm-ae", recurrent.LSTMAEConfig(0), replace(TAUGHT, steps=750))},
}
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
