"""The published systems that predict, by name, and their training: from motions to a run."""

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from motet.files import write_whole
from motet_train.checkpoint import refuse_other
from motet_train.data.errors import DataError
from motet_train.data.predict_data import Material
from motet_train.data.windows import Windows
from motet_train.evaluate.predict.protocol import OUTPUT_FRAMES, SEED_FRAMES, WINDOW
from motet_train.fit_windows import Fitting, Learner, best, fit_windows
from motet_train.models.predict import convseq2seq, lstm_3lr, lstm_ae, rrnn, srnn
from motet_train.models.predict.stepwise import Stepwise
from motet_train.models.predict.systems import stepwise
from motet_train.recipes.predict import About
from motet_train.runs import Run, surroundings

VALIDATION_WINDOWS = 32
"""Of each validation sequence, evenly spaced."""


@dataclass(frozen=True)
class Recipe:
    """What is trained, and how.

    model: a name of :data:`motet_train.models.predict.systems.SYSTEMS`. config: gives its sizes for the material.
    """

    model: str
    config: Callable[[Material], Any]
    fitting: Fitting


def _convseq2seq(fitting: Fitting, **sizes: Any) -> Recipe:
    return Recipe("convseq2seq", lambda material: convseq2seq.Config(len(material.kept), **sizes), fitting)


CODE = Fitting(steps=20_000, learning_rate=5e-5, decay=(0.99, 10_000), l2=0.0005, adversary=0.01, every=500)
PAPER = Fitting(steps=20_000, batch=64, l2=0.001, adversary=0.01, every=500)
SHORT = Fitting(steps=2000, learning_rate=1e-3, falling=0.7, l2=1.4e-5)
"""What learns best in a quarter of an hour on a CPU, by the error on files that were kept back: a higher learning rate,
which falls, the paper's weight of the squared weights, .001, relative to an error that eq. 7 sums over 70 channels, and
no adversary, which doubles the time and brings nothing."""

RESIDUAL = Fitting(
    steps=10_000, optimiser="sgd", learning_rate=0.005, decay=(0.95, 10_000), clip=5.0, every=250, patience=10
)
"""Of Martinez et al. 2017; it ends when the validation error has stopped falling."""

TAUGHT = Fitting(steps=1000, learning_rate=1e-3, falling=0.5, clip=25.0)
"""Of nets that are taught the next frame: the clipping is that of Jain et al. 2016, who took SGD and more steps."""


def _structural(material: Material) -> srnn.Config:
    if material.layout is None:
        raise DataError("a structural net needs text files whose columns are known")
    return srnn.Config(len(material.kept), srnn.parts_of(material.layout, material.kept))


RECIPES: Mapping[str, Mapping[str, Recipe]] = {
    "convseq2seq": {
        "default": _convseq2seq(SHORT, padding="same", loss="distance"),
        "paper": _convseq2seq(PAPER),
        "code": _convseq2seq(CODE, dropout=(0.2, 0.2, 0.5), own=0.95),
    },
    "rrnn": {"default": Recipe("rrnn", lambda material: rrnn.Config(len(material.kept)), RESIDUAL)},
    "erd": {"default": Recipe("erd", lambda material: lstm_3lr.ERDConfig(len(material.kept)), TAUGHT)},
    "lstm-3lr": {"default": Recipe("lstm-3lr", lambda material: lstm_3lr.Config(len(material.kept)), TAUGHT)},
    "srnn": {"default": Recipe("srnn", _structural, replace(TAUGHT, steps=1200))},
    "lstm-ae": {"default": Recipe("lstm-ae", lambda material: lstm_ae.Config(len(material.kept)), TAUGHT)},
}
"""Model -> name of a preset -> recipe."""


def train_system(
    material: Material,
    recipe: Recipe,
    seed: int,
    about: About,
    folder: Path,
    device: str = "cpu",
    progress: Callable[[int, float], object] = lambda steps, loss: None,
) -> Run:
    """Train a system in an existing folder, which is a run after the first validation.

    The weights kept are those with the smallest :func:`validation_error`. A folder with a run that was stopped is
    continued, see :func:`motet_train.fit_windows.fit_windows`; RunError where it was started with other settings.
    DataError where the data cannot be trained on.
    """
    torch.manual_seed(seed)
    config = recipe.config(material)
    sizes = {"channels": len(material.contract.channels), "kept": list(material.kept), "seed_frames": SEED_FRAMES}
    manifest = json.loads(json.dumps(_manifest(material, recipe, {**sizes, "system": asdict(config)}, about, seed)))
    net = _untrained(manifest, material)
    refuse_other(folder / "run.json", manifest, _essence)
    write_whole(folder / "run.json", json.dumps(manifest, indent=1) + "\n")
    judge = convseq2seq.Discriminator(config, WINDOW) if recipe.fitting.adversary else None
    learner = Learner(net.to(device), recipe.fitting, judge and judge.to(device))
    draw = partial(_draw, net, Windows(material, WINDOW), device)
    validate = partial(validation_error, net, material, device)
    fit_windows(learner, draw, validate, seed, folder, progress)
    training = {**manifest["training"], **_results(learner, device)}
    run = Run({**manifest, "training": training}, net.cpu())
    run.save(folder)
    return run


def _untrained(manifest: Mapping[str, Any], material: Material) -> Stepwise:
    net, kept = stepwise(manifest["model"], manifest["config"]), list(material.kept)
    net.mean.copy_(torch.tensor(material.contract.mean[kept]))
    net.scale.copy_(torch.tensor(material.contract.std[kept]))
    return net


def _draw(net: Stepwise, windows: Windows, device: str, rng: np.random.Generator, batch: int) -> Tensor:
    return net.normalised(windows.draw(batch, rng).to(device))


@torch.no_grad()
def validation_error(net: Stepwise, material: Material, device: str = "cpu") -> float:
    """The mean distance of predicted and true frames, without the root, in the contract's units.

    Over windows of the motions that were kept back, or of all where none could be.
    """
    long = [s for s in material.validation or material.sequences if len(s) > material.stride * (WINDOW - 1)]
    windows = torch.from_numpy(np.concatenate([_spread(s, material.stride) for s in long])).to(device)
    off = net(windows[:, :SEED_FRAMES], OUTPUT_FRAMES) - windows[:, SEED_FRAMES:]
    moved = list(material.kept[material.held :])
    return float(off[..., moved].norm(dim=-1).double().mean())


def _spread(sequence: NDArray[np.float32], stride: int) -> NDArray[np.float32]:
    """Windows (W, L + N, C) all along a sequence (T, C)."""
    starts = np.linspace(0, len(sequence) - stride * (WINDOW - 1) - 1, VALIDATION_WINDOWS).astype(int)
    return sequence[starts[:, None] + stride * np.arange(WINDOW)]


def _manifest(material: Material, recipe: Recipe, config: Mapping[str, Any], about: About, seed: int) -> dict[str, Any]:
    return {
        "name": about.name,
        "version": "1",
        "verb": "predict",
        "model": recipe.model,
        "motion": material.contract.to_json(),
        "defaults": {"horizon": OUTPUT_FRAMES},
        "config": dict(config),
        "licence": {"weights": about.weights_licence, "data": material.licence},
        "training": {
            "command": about.command,
            "seed": seed,
            "recipe": asdict(recipe.fitting),
            "data": material.about,
        },
    }


def _results(learner: Learner, device: str) -> dict[str, Any]:
    log, kept = learner.log, best(learner.log)
    return {
        "steps": log[-1]["step"],
        "kept_step": kept["step"],
        "loss": kept["loss"],
        "validation_error": kept["validation_error"],
        "seconds": round(sum(line["seconds"] for line in log), 1),
        "parameters": sum(parameter.numel() for parameter in learner.net.parameters()),
        **surroundings(device),
    }


def _essence(manifest: Mapping[str, Any]) -> dict[str, Any]:
    training = manifest["training"]
    return {
        **{key: manifest[key] for key in ("model", "config", "motion")},
        **{key: training[key] for key in ("seed", "data", "recipe")},
    }
