"""Training of a control model: from labelled clips to a run."""

import platform
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

from motet.contract import MotionContract
from motet.rotations import Array
from motet_train.contrastive import Progress
from motet_train.data.body import body_parts
from motet_train.data.clips import CONSTANT, Clips, DataError, sequences
from motet_train.data.period import is_periodic
from motet_train.models.tdbn import TDBN, TDBNConfig, to_config, train_tdbn
from motet_train.runs import Run


@dataclass(frozen=True)
class About:
    """What a manifest says that no computation finds out."""

    name: str
    command: str
    weights_licence: str


def train_control(clips: Clips, config: TDBNConfig, seed: int, about: About, progress: Progress) -> Run:
    """Train a temporal deep belief net on labelled clips; DataError where a clip is too short for it."""
    found = {
        label: [s for motion in motions for s in sequences(motion, config.fps)]
        for label, motions in clips.motions.items()
    }
    _check_lengths(found, config.taps)
    started = time.perf_counter()
    parts = body_parts(clips.skeleton, clips.channels).of_channel.tolist()
    net = TDBN(config, parts, len(found))
    mean, std = _statistics(found)
    net.mean, net.scale = (
        torch.tensor(mean).float(),
        torch.tensor(np.where(std < CONSTANT, 1.0, std * config.sigma)).float(),
    )
    onsets = [1.0 if is_periodic(frames) else config.onset for frames in found.values()]
    generator = torch.Generator().manual_seed(seed)
    train_tdbn(net, _tensors(found), onsets, generator, progress)
    training = {
        "command": about.command,
        "seed": seed,
        "seconds": round(time.perf_counter() - started, 2),
        "reconstruction": round(reconstruction(net, found, std), 6),
        "threads": torch.get_num_threads(),
        "machine": f"{platform.system()} {platform.machine()}, CPU",
        "torch": torch.__version__,
    }
    contract = MotionContract(clips.channels, ("deg",) * len(clips.channels), config.fps, mean, std, clips.skeleton)
    return Run(_manifest(about, clips, contract, net, found, training), net)


def reconstruction(net: TDBN, found: Mapping[str, Sequence[Array]], std: Array) -> float:
    """RMS error in z units of frames encoded and decoded, over the channels that are not constant."""
    frames = torch.cat([s for group in _tensors(found) for s in group])
    with torch.no_grad():
        error = (net.decode(net.encode(frames)) - frames).numpy()[:, std >= CONSTANT] / std[std >= CONSTANT]
    return float(np.sqrt(np.mean(error**2)))


def _manifest(
    about: About,
    clips: Clips,
    contract: MotionContract,
    net: TDBN,
    found: Mapping[str, Sequence[Array]],
    training: Mapping[str, Any],
) -> dict[str, Any]:
    taps, temperature = net.config.taps, net.config.temperature
    starts = {label: np.round(group[0][:taps], 6).tolist() for label, group in found.items()}
    return {
        "name": about.name,
        "version": "1",
        "verb": "control",
        "model": "tdbn",
        "motion": contract.to_json(),
        "control": {"labels": list(found), "starts": starts},
        "defaults": {"temperature": temperature},
        "config": to_config(net),
        "licence": {"weights": about.weights_licence, "data": clips.licence},
        "training": dict(training),
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
