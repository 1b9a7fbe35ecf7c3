"""Training of a control model: from labelled clips to a run."""

from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from typing import Any

import numpy as np
import torch
from torch import Tensor

from motet.bundle.manifest import Manifest
from motet.models.tdbn_control import TdbnModel
from motet.motion.rotations import Array
from motet.motion.skeleton import Skeleton
from motet.representation.contract import MotionContract, living
from motet_train.data.errors import DataError
from motet_train.papers.tdbn import angle_crbm, tdbn
from motet_train.papers.tdbn.angle_crbm import AngleCRBM, AngleCRBMConfig
from motet_train.papers.tdbn.body import body_parts
from motet_train.papers.tdbn.clips import Clips
from motet_train.papers.tdbn.contrastive import Stage
from motet_train.papers.tdbn.divergence import DivergenceLearner
from motet_train.papers.tdbn.experiments.report import missed_goals, study_of
from motet_train.papers.tdbn.period import is_periodic
from motet_train.papers.tdbn.tdbn import TDBN, Sequences, TDBNConfig
from motet_train.recipes.recipe import Job, Recipe
from motet_train.runs import Run
from motet_train.trainer import Line, Part, kept

RECIPES = {
    "default": Recipe("control", "tdbn", "session", TDBNConfig()),
    "unclamped": Recipe("control", "tdbn", "session", TDBNConfig().unclamped()),
    "thesis": Recipe("control", "tdbn", "session", TDBNConfig.thesis()),
}
BASELINES = {"default": Recipe("control", "angle-crbm", "session", AngleCRBMConfig())}

Net = TDBN | AngleCRBM


def train_control(clips: Clips, job: Job) -> Run:
    """Train on labelled clips, see :meth:`motet_train.recipes.recipe.Job.run`; DataError where one is too short."""
    config = job.recipe.config
    found = clips.frames(config.fps)
    _check_lengths(found, config.taps)
    net = untrained(config, clips.skeleton, clips.channels, len(clips.labels))
    units = ("deg",) * len(clips.channels)
    mean, std = _statistics(found, units)
    net.measure_by(mean, std * config.sigma)
    onsets = [1.0 if is_periodic(frames) else config.onset for frames in found.values()]
    contract = MotionContract("angles", clips.channels, units, config.fps, mean, std, clips.skeleton)
    manifest = _manifest(job, clips, contract, net, found)
    net.to(job.device)
    generator = torch.Generator(job.device).manual_seed(job.about.seed)
    given = [[frames.to(job.device) for frames in group] for group in _tensors(found)]
    labels = torch.eye(len(given), device=job.device)
    controls = [[label.expand(len(frames), -1) for frames in group] for label, group in zip(labels, given, strict=True)]
    stages, others = stages_of(net, given, controls, onsets, generator)
    learner = DivergenceLearner(net, stages, generator, _missed(net, manifest, clips, found), others)

    def more(log: Sequence[Line]) -> dict[str, Any]:
        tried = sum("missed" in line for line in log)
        chosen = {"candidates": tried, "missed": kept(log, "best")["missed"]} if tried else {}
        return {"reconstruction": round(reconstruction(net.cpu(), found, std), 6), **chosen}

    return job.run(net, learner, manifest, more)


def untrained(config: TDBNConfig | AngleCRBMConfig, skeleton: Skeleton, channels: tuple[str, ...], labels: int) -> Net:
    """A net of the sizes that a figure's channels need."""
    if isinstance(config, AngleCRBMConfig):
        return AngleCRBM(config, len(channels), labels)
    return TDBN(config, body_parts(skeleton, channels).of_channel.tolist(), labels)


def stages_of(
    net: Net, sequences: Sequences, controls: Sequences, onsets: Sequence[float], generator: torch.Generator
) -> tuple[list[Stage], Mapping[str, Part]]:
    """How a net learns, and what else has a state; see :func:`motet_train.papers.tdbn.tdbn.stages`."""
    if isinstance(net, TDBN):
        return tdbn.stages(net, sequences, controls, onsets, generator)
    return angle_crbm.stages(net, sequences, controls, onsets, generator)


def _missed(
    net: Net, manifest: Mapping[str, Any], clips: Clips, found: Mapping[str, list[Array]]
) -> Callable[[int], list[str]] | None:
    """How candidates are chosen; None if there is one only, or if the clips show no gait to try it with."""
    single = not isinstance(net, TDBN) or net.config.restarts * net.config.tries == 1
    if single or not any(map(is_periodic, found.values())):
        return None

    def missed(enough: int) -> list[str]:
        run = Run(manifest, deepcopy(net).cpu())
        model = TdbnModel(Manifest.from_json(run.manifest), run.torch_graphs())
        return missed_goals(study_of(model, clips), enough)

    return missed


def _manifest(
    job: Job, clips: Clips, contract: MotionContract, net: Net, found: Mapping[str, list[Array]]
) -> dict[str, Any]:
    starts = {label: np.round(group[0][: net.taps], 6).tolist() for label, group in found.items()}
    control = {"labels": list(found), "starts": starts}
    return job.manifest(contract, net.to_config(), defaults_of(net), clips.licence, control=control)


def defaults_of(net: Net) -> dict[str, float]:
    """How a session runs that is told nothing else."""
    defaults: dict[str, float] = {"temperature": net.config.temperature}
    if isinstance(net, AngleCRBM):
        defaults["iterations"] = net.config.iterations
    return defaults


def reconstruction(net: Net, found: Mapping[str, Sequence[Array]], std: Array) -> float:
    """RMS error in z units of frames encoded and decoded, over the channels that are not constant."""
    frames = torch.cat([s for group in _tensors(found) for s in group])
    with torch.no_grad():
        error = (net.decode(net.encode(frames)) - frames).numpy()[:, std > 0] / std[std > 0]
    return float(np.sqrt(np.mean(error**2)))


def _statistics(found: Mapping[str, Sequence[Array]], units: Sequence[str]) -> tuple[Array, Array]:
    every = np.concatenate([s for group in found.values() for s in group])
    return every.mean(axis=0), living(every.std(axis=0), units)


def _tensors(found: Mapping[str, Sequence[Array]]) -> list[list[Tensor]]:
    return [[torch.tensor(s).float() for s in group] for group in found.values()]


def _check_lengths(found: Mapping[str, Sequence[Array]], taps: int) -> None:
    for label, group in found.items():
        shortest = min(map(len, group))
        if shortest < 4 * taps:
            raise DataError(f"a clip of {label!r} has {shortest} frames at the model's rate; it needs {4 * taps}")
