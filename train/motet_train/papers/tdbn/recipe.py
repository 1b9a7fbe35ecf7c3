"""Training of a control model: from labelled clips to a run."""

from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch

from motet.bundle.manifest import Manifest
from motet.models.tdbn_control import TdbnModel
from motet.motion.rotations import Array
from motet.motion.skeleton import Skeleton
from motet.representation.contract import MotionContract, living
from motet_train.data.errors import DataError
from motet_train.papers.tdbn.angle_crbm import AngleCRBM, AngleCRBMConfig
from motet_train.papers.tdbn.body import body_parts
from motet_train.papers.tdbn.clips import Clips
from motet_train.papers.tdbn.control_net import ControlNet
from motet_train.papers.tdbn.divergence import DivergenceLearner
from motet_train.papers.tdbn.experiments.report import missed_goals, study_of
from motet_train.papers.tdbn.period import is_periodic
from motet_train.papers.tdbn.tdbn import TDBN, TDBNConfig
from motet_train.recipes.recipe import Job, Recipe
from motet_train.runs import Run
from motet_train.trainer import Line, kept

RECIPES = {
    "default": Recipe("control", "tdbn", "session", TDBNConfig()),
    "unclamped": Recipe("control", "tdbn", "session", TDBNConfig().unclamped()),
    "thesis": Recipe("control", "tdbn", "session", TDBNConfig.thesis()),
}
BASELINES = {"default": Recipe("control", "angle-crbm", "session", AngleCRBMConfig())}


@dataclass(frozen=True, eq=False)
class Lessons:
    """For each group, such as the clips of a label, sequences (T, D), control values (T, L) of their frames, and
    onsets: see :func:`motet_train.papers.tdbn.crbm.transitions`."""

    sequences: Sequence[Sequence[Array]]
    controls: Sequence[Sequence[Array]]
    onsets: Sequence[float]


def train_control(clips: Clips, job: Job) -> Run:
    """Train on labelled clips, see :meth:`motet_train.recipes.recipe.Job.run`; DataError where one is too short."""
    config = job.recipe.config
    found = clips.frames(config.fps)
    _check_lengths(found, config.taps)
    net = untrained(config, clips.skeleton, clips.channels, len(found))
    units = ("deg",) * len(clips.channels)
    mean, std = _statistics(found, units)
    contract = MotionContract("angles", clips.channels, units, config.fps, mean, std, clips.skeleton)
    net.measure_by(mean, std * config.sigma)
    starts = {label: np.round(group[0][: net.taps], 6).tolist() for label, group in found.items()}
    control = {"labels": list(found), "starts": starts}
    manifest = job.manifest(contract, net.to_config(), net.defaults, clips.licence, control=control)
    labels = zip(np.eye(len(found)), found.values(), strict=True)
    controls = [[np.tile(label, (len(frames), 1)) for frames in group] for label, group in labels]
    periodic = [is_periodic(frames) for frames in found.values()]
    lessons = Lessons(list(found.values()), controls, [1.0 if one else config.onset for one in periodic])

    def missed(run: Run, enough: int) -> list[str]:
        model = TdbnModel(Manifest.from_json(run.manifest), run.torch_graphs())
        return missed_goals(study_of(model, clips), enough)

    def more(log: Sequence[Line]) -> dict[str, Any]:
        tried = sum("missed" in line for line in log)
        chosen = {"candidates": tried, "missed": kept(log, "best")["missed"]} if tried else {}
        return {"reconstruction": round(reconstruction(net.cpu(), found, std), 6), **chosen}

    # clips that show no gait have none to try a candidate with
    return train_lessons(net, job, manifest, lessons, missed if any(periodic) else None, more)


def untrained(
    config: TDBNConfig | AngleCRBMConfig, skeleton: Skeleton, channels: tuple[str, ...], labels: int
) -> ControlNet:
    """A net of the sizes that a figure's channels need."""
    if isinstance(config, AngleCRBMConfig):
        return AngleCRBM(config, len(channels), labels)
    return TDBN(config, body_parts(skeleton, channels).of_channel.tolist(), labels)


def train_lessons(
    net: ControlNet,
    job: Job,
    manifest: Mapping[str, Any],
    lessons: Lessons,
    missed: Callable[[Run, int], list[str]] | None = None,
    more: Callable[[Sequence[Line]], Mapping[str, Any]] = lambda log: {},
) -> Run:
    """Train a net that has its mean and scale; missed: the goals that a candidate misses, of several to choose from."""
    generator = torch.Generator(job.device).manual_seed(job.about.seed)
    given, told = (
        [[torch.tensor(rows, dtype=torch.float32, device=job.device) for rows in group] for group in part]
        for part in (lessons.sequences, lessons.controls)
    )
    stages, others = net.to(job.device).stages(given, told, lessons.onsets, generator)

    def misses(enough: int) -> list[str]:
        assert missed is not None
        return missed(Run(manifest, deepcopy(net).cpu()), enough)

    choose = missed is not None and sum(stage.whole for stage in stages) > 1
    return job.run(net, DivergenceLearner(net, stages, generator, misses if choose else None, others), manifest, more)


def reconstruction(net: ControlNet, found: Mapping[str, Sequence[Array]], std: Array) -> float:
    """RMS error in z units of frames encoded and decoded, over the channels that are not constant."""
    frames = torch.tensor(np.concatenate([s for group in found.values() for s in group]), dtype=torch.float32)
    with torch.no_grad():
        error = (net.decode(net.encode(frames)) - frames).numpy()[:, std > 0] / std[std > 0]
    return float(np.sqrt(np.mean(error**2)))


def _statistics(found: Mapping[str, Sequence[Array]], units: Sequence[str]) -> tuple[Array, Array]:
    every = np.concatenate([s for group in found.values() for s in group])
    return every.mean(axis=0), living(every.std(axis=0), units)


def _check_lengths(found: Mapping[str, Sequence[Array]], taps: int) -> None:
    for label, group in found.items():
        shortest = min(map(len, group))
        if shortest < 4 * taps:
            raise DataError(f"a clip of {label!r} has {shortest} frames at the model's rate; it needs {4 * taps}")
