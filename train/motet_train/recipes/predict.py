"""Training of a predictor: from sequences to a run."""

import json
import math
import time
from collections.abc import Callable
from copy import deepcopy
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from motet.files import write_whole
from motet_train.checkpoint import LOG
from motet_train.data.errors import DataError
from motet_train.data.predict_data import Material
from motet_train.data.windows import Windows
from motet_train.models.predict.predictor import Predictor, PredictorConfig
from motet_train.runs import Run, RunError, surroundings

EVERY = 200
"""Steps from one line of the log to the next."""

HELD_SCALES = (5.0,) * 3 + (0.5,) * 3
"""Of the root's translation (length units) and rotation (radians) relative to the last frame."""


@dataclass(frozen=True)
class Recipe:
    """How a predictor is trained: AdamW with a warm-up and a falling rate, and the mean of the weights on the way.

    warp: a window is slower or faster by up to this much, as exp(+-warp). reverse: the share played backwards. Both
    only where all channels are poses. mirror: the share that is mirrored. average: of the running mean of weights.
    """

    steps: int = 5600
    batch: int = 64
    learning_rate: float = 2e-3
    weight_decay: float = 0.01
    warm_up: int = 100
    clip: float = 1.0
    average: float = 0.998
    warp: float = 0.15
    reverse: float = 0.3
    mirror: float = 0.5


@dataclass(frozen=True)
class About:
    """What a manifest says that no computation finds out."""

    name: str
    command: str
    weights_licence: str


def train_predict(
    material: Material,
    recipe: Recipe,
    seed: int,
    about: About,
    folder: Path,
    progress: Callable[[float], object] = lambda loss: None,
) -> Run:
    """Train a predictor; an existing ``folder`` gets ``log.jsonl`` and then the run. DataError for unfit sequences."""
    torch.manual_seed(seed)
    recipe = _possible(recipe, material)
    net = _untrained(material)
    chances = recipe.warp, recipe.reverse, recipe.mirror
    seed_frames = net.config.seed_frames if material.layout is None else None  # text files are taken as they are
    windows = Windows(material, net.config.seed_frames + net.config.frames, *chances, seed_frames)
    started = time.perf_counter()
    draw = partial(windows.draw, recipe.batch, np.random.default_rng(seed))
    net, log = _fit(net, draw, recipe, folder, progress)
    training = {
        "command": about.command,
        "seed": seed,
        "recipe": asdict(recipe),
        "data": material.about,
        "seconds": round(time.perf_counter() - started, 1),
        "loss": log[-1]["loss"],
        "parameters": sum(parameter.numel() for parameter in net.parameters()),
        **surroundings(),
    }
    run = Run(_manifest(material, net, about, training), net)
    run.save(folder)
    return run


def _possible(recipe: Recipe, material: Material) -> Recipe:
    """The recipe without what the material does not allow."""
    recipe = recipe if material.poses else replace(recipe, warp=0.0, reverse=0.0)
    return recipe if material.mirrored else replace(recipe, mirror=0.0)


def _untrained(material: Material) -> Predictor:
    config = PredictorConfig(
        len(material.contract.channels), material.kept, material.held, material.mirrored, material.signs
    )
    net, kept, held = Predictor(config), list(material.kept), material.held
    if held not in (0, len(HELD_SCALES)):
        raise DataError(f"the root's translation and rotation must vary in the data: {held} of 6 columns do")
    net.mean.copy_(torch.tensor(material.contract.mean[kept]))
    net.scale.copy_(torch.tensor(material.contract.std[kept]))
    net.mean[:held] = 0.0
    net.scale[:held] = torch.tensor(HELD_SCALES[:held])
    return net


def _fit(
    net: Predictor, draw: Callable[[], Tensor], recipe: Recipe, folder: Path, progress: Callable[[float], object]
) -> tuple[Predictor, list[dict[str, float]]]:
    """The running mean of the net's weights over training, and the log."""
    mean = deepcopy(net).eval()
    rates = recipe.learning_rate, recipe.weight_decay
    optimiser = torch.optim.AdamW(net.parameters(), lr=rates[0], weight_decay=rates[1], betas=(0.9, 0.98))
    times = _importance(net.config.frames)
    log: list[dict[str, float]] = []
    losses: list[float] = []
    started = time.perf_counter()
    for step in range(recipe.steps):
        for group in optimiser.param_groups:
            group["lr"] = _rate(recipe, step)
        drawn = draw()
        loss = _loss(net, drawn, times)
        if not torch.isfinite(loss):
            raise RunError("the loss is no longer finite: start again with another seed")
        optimiser.zero_grad(set_to_none=True)
        loss.backward()  # type: ignore[no-untyped-call]
        nn.utils.clip_grad_norm_(net.parameters(), recipe.clip)
        optimiser.step()
        _approach(mean, net, min(recipe.average, (2 + step) / (11 + step)))
        losses.append(loss.item())
        progress(losses[-1])
        if (step + 1) % EVERY == 0 or step + 1 == recipe.steps:
            line = {"step": step + 1, "loss": round(float(np.mean(losses)), 6)}
            log.append({**line, "seconds": round(time.perf_counter() - started, 1)})
            losses.clear()
            write_whole(folder / LOG, "".join(json.dumps(entry) + "\n" for entry in log))
    return mean, log


def _loss(net: Predictor, windows: Tensor, times: Tensor) -> Tensor:
    """The mean distance of predicted and true frames, in radians and metres, each frame's by its importance."""
    seed, truth = windows[:, : net.config.seed_frames], windows[:, net.config.seed_frames :]
    moved = list(net.config.kept[net.config.held :])
    off = (net.plain(seed) - truth)[..., moved]
    return ((off.square().sum(-1) + 1e-6).sqrt() * times).mean()


def _importance(frames: int) -> Tensor:
    """Weights (N,) of the predicted frames, mean 1: about the inverse of the error that one has to expect."""
    weights = 1 / (0.3 + 0.12 * torch.arange(1.0, frames + 1) ** 0.8)
    return weights / weights.mean()


def _rate(recipe: Recipe, step: int) -> float:
    falling = 0.5 * (1 + math.cos(math.pi * step / recipe.steps))
    return recipe.learning_rate * min(1.0, step / recipe.warm_up) * (0.99 * falling + 0.01)


@torch.no_grad()
def _approach(mean: nn.Module, net: nn.Module, share: float) -> None:
    for average, parameter in zip(mean.parameters(), net.parameters(), strict=True):
        average.lerp_(parameter, 1 - share)


def _manifest(material: Material, net: Predictor, about: About, training: dict[str, Any]) -> dict[str, Any]:
    return {
        "name": about.name,
        "version": "1",
        "verb": "predict",
        "model": "trajectory",
        "motion": material.contract.to_json(),
        "defaults": {"horizon": net.config.frames},
        "config": asdict(net.config),
        "licence": {"weights": about.weights_licence, "data": material.licence},
        "training": training,
    }
