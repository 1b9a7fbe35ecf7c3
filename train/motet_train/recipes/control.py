"""Training of a control model: from labelled clips to a run."""

import platform
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

from motet.models.control import ControlModel
from motet.motion.rotations import Array
from motet.representation.contract import MotionContract
from motet_train.data.body import body_parts
from motet_train.data.clips import CONSTANT, Clips, sequences
from motet_train.data.errors import DataError
from motet_train.data.period import is_periodic
from motet_train.evaluate.control.experiments import missed_goals, study_of
from motet_train.models.control import angle_crbm, tdbn
from motet_train.models.control.angle_crbm import AngleCRBM, AngleCRBMConfig
from motet_train.models.control.contrastive import Progress
from motet_train.models.control.tdbn import TDBN, TDBNConfig
from motet_train.recipes.audition import audition
from motet_train.runs import Run


@dataclass(frozen=True)
class About:
    """What a manifest says that no computation finds out."""

    name: str
    command: str
    weights_licence: str


Net = TDBN | AngleCRBM
Config = TDBNConfig | AngleCRBMConfig


def train_control(clips: Clips, config: Config, seed: int, about: About, progress: Progress) -> Run:
    """Train the net of the configuration on labelled clips; DataError where a clip is too short for it."""
    found = _sequences(clips, config.fps)
    _check_lengths(found, config.taps)
    started = time.perf_counter()
    net = _untrained(clips, config)
    mean, std = _statistics(found)
    net.mean, net.scale = (
        torch.tensor(mean).float(),
        torch.tensor(np.where(std < CONSTANT, 1.0, std * config.sigma)).float(),
    )
    onsets = [1.0 if is_periodic(frames) else config.onset for frames in found.values()]
    generator = torch.Generator().manual_seed(seed)
    contract = MotionContract(clips.channels, ("deg",) * len(clips.channels), config.fps, mean, std, clips.skeleton)
    manifest = _manifest(about, clips, contract, net, found)
    candidates = _candidates(net, _tensors(found), onsets, generator, progress)
    tried = _choose(Run(manifest, net), clips, candidates)
    training = {
        "command": about.command,
        "seed": seed,
        "seconds": round(time.perf_counter() - started, 2),
        "reconstruction": round(reconstruction(net, found, std), 6),
        **tried,
        "threads": torch.get_num_threads(),
        "machine": f"{platform.system()} {platform.machine()}, CPU",
        "torch": torch.__version__,
    }
    return Run({**manifest, "training": training}, net)


def _sequences(clips: Clips, fps: float) -> dict[str, list[Array]]:
    """For each label its sequences (T, D)."""
    return {label: [s for motion in group for s in sequences(motion, fps)] for label, group in clips.motions.items()}


def _untrained(clips: Clips, config: Config) -> Net:
    if isinstance(config, AngleCRBMConfig):
        return AngleCRBM(config, len(clips.channels), len(clips.labels))
    parts = body_parts(clips.skeleton, clips.channels).of_channel.tolist()
    return TDBN(config, parts, len(clips.labels))


def _candidates(
    net: Net,
    found: Sequence[Sequence[Tensor]],
    onsets: Sequence[float],
    generator: torch.Generator,
    progress: Progress,
) -> Iterator[None]:
    if isinstance(net, AngleCRBM):
        return angle_crbm.train_angle_crbm(net, found, onsets, generator, progress)
    return tdbn.train_tdbn(net, found, onsets, generator, progress)


def _choose(run: Run, clips: Clips, candidates: Iterator[None]) -> dict[str, Any]:
    """Train candidates until one moves as it should; says how many there were and what the chosen one misses.

    A net of which there is one candidate only, or whose clips show no gait to try it with, is taken as it is.
    """
    single = not isinstance(run.model, TDBN) or run.model.config.restarts * run.model.config.tries == 1
    if single or not any(map(is_periodic, _sequences(clips, run.manifest["motion"]["fps"]).values())):
        next(candidates)
        return {}

    def missed(enough: int) -> list[str]:
        return missed_goals(study_of(ControlModel(run.manifest, run.torch_graphs()), clips), enough)

    tried, goals = audition(run.model, candidates, missed)
    return {"candidates": tried, "missed": goals}


def _model(net: Net) -> dict[str, Any]:
    """What a manifest says of the net alone."""
    if isinstance(net, AngleCRBM):
        defaults = {"temperature": net.config.temperature, "iterations": net.config.iterations}
        return {"model": "angle-crbm", "defaults": defaults, "config": angle_crbm.to_config(net)}
    return {"model": "tdbn", "defaults": {"temperature": net.config.temperature}, "config": tdbn.to_config(net)}


def reconstruction(net: Net, found: Mapping[str, Sequence[Array]], std: Array) -> float:
    """RMS error in z units of frames encoded and decoded, over the channels that are not constant."""
    frames = torch.cat([s for group in _tensors(found) for s in group])
    with torch.no_grad():
        error = (net.decode(net.encode(frames)) - frames).numpy()[:, std >= CONSTANT] / std[std >= CONSTANT]
    return float(np.sqrt(np.mean(error**2)))


def _manifest(
    about: About,
    clips: Clips,
    contract: MotionContract,
    net: Net,
    found: Mapping[str, Sequence[Array]],
) -> dict[str, Any]:
    starts = {label: np.round(group[0][: net.taps], 6).tolist() for label, group in found.items()}
    return {
        "name": about.name,
        "version": "1",
        "verb": "control",
        **_model(net),
        "motion": contract.to_json(),
        "control": {"labels": list(found), "starts": starts},
        "licence": {"weights": about.weights_licence, "data": clips.licence},
    }


def _statistics(found: Mapping[str, Sequence[Array]]) -> tuple[Array, Array]:
    every = np.concatenate([s for group in found.values() for s in group])
    return every.mean(axis=0), every.std(axis=0)


def _tensors(found: Mapping[str, Sequence[Array]]) -> list[list[Tensor]]:
    return [[torch.tensor(s).float() for s in group] for group in found.values()]


def _check_lengths(found: Mapping[str, Sequence[Array]], taps: int) -> None:
    for label, group in found.items():
        shortest = min(map(len, group))
        if shortest < 4 * taps:
            raise DataError(f"a clip of {label!r} has {shortest} frames at the model's rate; it needs {4 * taps}")
