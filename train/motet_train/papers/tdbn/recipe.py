"""Training of a control model: from labelled clips to a run, by contrastive divergence, layer after layer."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import deepcopy
from functools import partial
from itertools import accumulate, chain, pairwise
from typing import Any, Literal

import numpy as np
import torch
from torch import nn

from motet.bundle.fields import Json
from motet.bundle.manifest import Manifest
from motet.motion.rotations import Array
from motet.motion.skeleton import Skeleton
from motet.papers.tdbn_control import TdbnModel
from motet.representation.contract import MotionContract, living
from motet_train import distributed
from motet_train.data.errors import DataError
from motet_train.data.table import read_toml
from motet_train.models.net import configured
from motet_train.papers.tdbn.clips import Clips, Sequences, body_parts, is_periodic
from motet_train.papers.tdbn.rbm import Layer, Stage
from motet_train.papers.tdbn.report import missed_goals, study_of
from motet_train.papers.tdbn.tdbn import TDBN, AngleCRBM, AngleCRBMConfig, ControlNet, Lessons, TDBNConfig
from motet_train.recipes.recipe import Job, Recipe
from motet_train.runs import Run, RunError
from motet_train.trainer import Line, Part, kept

RECIPES = {
    name: Recipe("control", "tdbn", "session", configured(TDBNConfig, preset))
    for name, preset in read_toml(__file__, "presets.toml").items()
}
BASELINES = {"default": Recipe("control", "angle-crbm", "session", AngleCRBMConfig())}


def train_control(clips: Clips, job: Job) -> Run:
    """Train on labelled clips, see :meth:`motet_train.recipes.recipe.Job.run`; DataError where one is too short."""
    config = job.recipe.config
    motions = clips.frames(config.fps)
    _check_lengths(motions, 4 * config.taps)
    # the net, with the mean and scale of all frames
    frames = np.concatenate(list(chain.from_iterable(motions.values())))
    contract = _contract(clips, config.fps, frames)
    net = untrained(config, clips.skeleton, clips.channels, len(motions))
    net.measure_by(contract.mean, contract.std * config.sigma)
    control = {"labels": list(motions), "starts": _starts(motions, config.taps)}
    manifest = job.manifest(contract, net.to_config(), net.defaults, clips.licence, control=control)
    # clips that show no gait have none to try a candidate with
    any_gait = any(map(is_periodic, motions.values()))
    missed = partial(_missed, clips) if any_gait else None
    results = partial(_results, net, frames, contract.std)
    return train_lessons(net, job, manifest, _lessons(motions, config.onset), missed, results)


def _check_lengths(motions: Sequences, least: int) -> None:
    for label, group in motions.items():
        shortest = min(map(len, group))
        if shortest < least:
            have = f"a clip of {label!r} has {shortest} frames at the model's rate"
            raise DataError(f"{have}; it needs {least}")


def _starts(motions: Sequences, taps: int) -> Json:
    """The first frames of each label, from which sessions begin."""
    return {label: np.round(group[0][:taps], 6).tolist() for label, group in motions.items()}


def _contract(clips: Clips, fps: float, frames: Array) -> MotionContract:
    """The contract of joint angles with the mean and standard deviation of frames (N, D)."""
    units = ("deg",) * len(clips.channels)
    std = living(frames.std(axis=0), units)
    return MotionContract("angles", clips.channels, units, fps, frames.mean(axis=0), std, clips.skeleton)


def _lessons(motions: Sequences, onset: float) -> Lessons:
    """The sequences of each label under its control, with an onset for the motions that end."""
    controls = []
    onsets = []
    for label, group in zip(np.eye(len(motions)), motions.values(), strict=True):
        controls.append([np.tile(label, (len(frames), 1)) for frames in group])
        onsets.append(1.0 if is_periodic(group) else onset)
    return Lessons(list(motions.values()), controls, onsets)


def _missed(clips: Clips, run: Run, enough: int) -> list[str]:
    """The goals that a net misses, see :func:`motet_train.papers.tdbn.report.missed_goals`."""
    model = TdbnModel(Manifest.from_json(run.manifest), run.torch_graphs())
    return missed_goals(study_of(model, clips), enough)


def _results(net: ControlNet, frames: Array, std: Array, log: Sequence[Line]) -> Json:
    """Entries of the manifest: RMS error in z units of coded frames (N, D), the nets tried, the goals missed."""
    moving = std > 0
    original = torch.tensor(frames, dtype=torch.float32)
    with torch.no_grad():
        error = (net.cpu().decode(net.encode(original)) - original).numpy()[:, moving] / std[moving]
    results: dict[str, Any] = {"reconstruction": round(float(np.sqrt(np.mean(error**2))), 6)}
    tried = sum("missed" in line for line in log)
    if tried:
        results |= {"candidates": tried, "missed": kept(log, "best")["missed"]}
    return results


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
    manifest: Json,
    lessons: Lessons,
    missed: Callable[[Run, int], list[str]] | None = None,
    more: Callable[[Sequence[Line]], Json] = lambda log: {},
) -> Run:
    """Train a net that has its mean and scale; missed: the goals that a candidate misses, of several to choose from."""
    generator = torch.Generator(job.device).manual_seed(job.about.seed)
    stages, others = net.to(job.device).stages(lessons.tensors(job.device), generator)

    def misses(enough: int) -> list[str]:
        assert missed is not None
        return missed(Run(manifest, deepcopy(net).cpu()), enough)

    choose = missed is not None and sum(stage.whole for stage in stages) > 1
    learner = DivergenceLearner(net, stages, generator, misses if choose else None, others)
    return job.run(net, learner, manifest, more)


EPOCHS_A_CHUNK = 200
"""Epochs from one checkpoint to the next, within a stage."""


class DivergenceLearner:
    """A net that is trained in stages, see :class:`motet_train.trainer.Learner`.

    Each whole net is a candidate: the loss of contrastive divergence does not say how a figure moves. Kept is the
    first that misses no goal, which ends training, else the one that misses the fewest.
    missed: the goals that the net misses; it may stop counting at the number given, as more is no improvement. None
    where there is nothing to choose. others: what else has a state.
    """

    unit: Literal["epoch", "step"] = "epoch"
    keep: Literal["best", "last"] = "best"
    patience: int | None = None
    first = 0
    target = 0.0
    layer: Layer

    def __init__(
        self,
        net: nn.Module,
        stages: Sequence[Stage],
        generator: torch.Generator,
        missed: Callable[[int], list[str]] | None,
        others: Mapping[str, Part],
    ) -> None:
        if distributed.count() > 1:
            raise RunError("contrastive divergence trains in one process, without torchrun")
        self.kept: nn.Module = net
        self.stages = stages
        self.generator = generator
        self.missed = missed
        self.bounds = list(accumulate((stage.epochs for stage in stages), initial=0))
        self.ends: list[int] = []
        for first, last in pairwise(self.bounds):
            self.ends += [*range(first, last, EPOCHS_A_CHUNK)[1:], last]
        self.parts: dict[str, Part] = {"net": net, **others, "learning": self}
        self.done = 0
        self.fewest = 1000  # more goals than exist

    def chunk(self, start: int, stop: int, rng: np.random.Generator) -> Iterator[tuple[int, float, float]]:
        """Train from one epoch to another of the same stage; all random numbers are the generator's."""
        number = self._stage(start)
        if start == self.bounds[number]:
            self.stages[number].begin()
            self.layer = self.stages[number].layer()
        for self.done in range(start + 1, stop + 1):
            yield self.done, self.layer.epoch(self.done - 1 - self.bounds[number]), 1.0

    def validate(self) -> Json:
        """The goals that a whole net misses."""
        if self.missed is None or self.done not in self.bounds or not self.stages[self._stage(self.done - 1)].whole:
            return {}
        missed = self.missed(self.fewest)
        self.fewest = min(self.fewest, len(missed))
        return {"validation": len(missed), "missed": missed}

    def _stage(self, done: int) -> int:
        return next(n for n, stop in enumerate(self.bounds[1:]) if done < stop)

    def state_dict(self) -> Json:
        """Where learning is: the epochs done, the velocities of the layer, the generator."""
        velocities = {name: ascent.velocity for name, ascent in self.layer.ascents.items()}
        generator = self.generator.get_state()
        return {"done": self.done, "fewest": self.fewest, "velocities": velocities, "generator": generator}

    def load_state_dict(self, state: Json) -> None:
        """Go on there; the net has its weights."""
        self.done = state["done"]
        self.fewest = state["fewest"]
        self.layer = self.stages[self._stage(self.done - 1)].layer()
        for name, ascent in self.layer.ascents.items():
            ascent.velocity.copy_(state["velocities"][name])
        self.generator.set_state(state["generator"])
