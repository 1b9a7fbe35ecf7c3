"""Training of a control model: from labelled clips to a run, by contrastive divergence, layer after layer."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import deepcopy
from itertools import accumulate, pairwise
from typing import Any, Literal

import numpy as np
import torch
from torch import nn

from motet.bundle.manifest import Manifest
from motet.motion.skeleton import Skeleton
from motet.papers.tdbn_control import TdbnModel
from motet.representation.contract import MotionContract, living
from motet_train import distributed
from motet_train.data.errors import DataError
from motet_train.papers.tdbn.clips import Clips, body_parts, is_periodic
from motet_train.papers.tdbn.rbm import Layer, Stage
from motet_train.papers.tdbn.report import missed_goals, study_of
from motet_train.papers.tdbn.tdbn import TDBN, AngleCRBM, AngleCRBMConfig, ControlNet, Lessons, TDBNConfig
from motet_train.recipes.recipe import Job, Recipe
from motet_train.runs import Run, RunError
from motet_train.trainer import Line, Part, kept

RECIPES = {
    "default": Recipe("control", "tdbn", "session", TDBNConfig()),
    "unclamped": Recipe("control", "tdbn", "session", TDBNConfig().unclamped()),
    "thesis": Recipe("control", "tdbn", "session", TDBNConfig.thesis()),
}
BASELINES = {"default": Recipe("control", "angle-crbm", "session", AngleCRBMConfig())}


def train_control(clips: Clips, job: Job) -> Run:
    """Train on labelled clips, see :meth:`motet_train.recipes.recipe.Job.run`; DataError where one is too short."""
    config = job.recipe.config
    found = clips.frames(config.fps)
    for label, group in found.items():
        if (shortest := min(map(len, group))) < 4 * config.taps:
            have = f"a clip of {label!r} has {shortest} frames at the model's rate"
            raise DataError(f"{have}; it needs {4 * config.taps}")
    net = untrained(config, clips.skeleton, clips.channels, len(found))
    units, every = ("deg",) * len(clips.channels), np.concatenate([s for group in found.values() for s in group])
    mean, std = every.mean(axis=0), living(every.std(axis=0), units)
    contract = MotionContract("angles", clips.channels, units, config.fps, mean, std, clips.skeleton)
    net.measure_by(mean, std * config.sigma)
    starts = {label: np.round(group[0][: config.taps], 6).tolist() for label, group in found.items()}
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
        given, moving = torch.tensor(every, dtype=torch.float32), std > 0
        with torch.no_grad():
            error = (net.cpu().decode(net.encode(given)) - given).numpy()[:, moving] / std[moving]
        # RMS in z units of frames encoded and decoded
        return {"reconstruction": round(float(np.sqrt(np.mean(error**2))), 6), **chosen}

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
    stages, others = net.to(job.device).stages(Lessons(given, told, lessons.onsets), generator)

    def misses(enough: int) -> list[str]:
        assert missed is not None
        return missed(Run(manifest, deepcopy(net).cpu()), enough)

    choose = missed is not None and sum(stage.whole for stage in stages) > 1
    return job.run(net, DivergenceLearner(net, stages, generator, misses if choose else None, others), manifest, more)


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
    first, target = 0, 0.0

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
        self.stages, self.generator, self.missed = stages, generator, missed
        self.bounds = list(accumulate((stage.epochs for stage in stages), initial=0))
        self.ends = [end for span in pairwise(self.bounds) for end in (*range(*span, EPOCHS_A_CHUNK)[1:], span[1])]
        self.parts: dict[str, Part] = {"net": net, **others, "learning": self}
        self.layer: Layer | None = None
        self.done, self.fewest = 0, 1000  # more goals than exist

    def chunk(self, start: int, stop: int, rng: np.random.Generator) -> Iterator[tuple[int, float, float]]:
        """Train from one epoch to another of the same stage; all random numbers are the generator's."""
        number = self._stage(start)
        if start == self.bounds[number]:
            self.stages[number].begin()
            self.layer = self.stages[number].layer()
        assert self.layer is not None
        for self.done in range(start + 1, stop + 1):
            yield self.done, self.layer.epoch(self.done - 1 - self.bounds[number]), 1.0

    def validate(self) -> Mapping[str, Any]:
        """The goals that a whole net misses."""
        if self.missed is None or self.done not in self.bounds or not self.stages[self._stage(self.done - 1)].whole:
            return {}
        found = self.missed(self.fewest)
        self.fewest = min(self.fewest, len(found))
        return {"validation": len(found), "missed": found}

    def _stage(self, done: int) -> int:
        return next(n for n, stop in enumerate(self.bounds[1:]) if done < stop)

    def state_dict(self) -> dict[str, Any]:
        """Where learning is: the epochs done, the velocities of the layer, the generator."""
        assert self.layer is not None
        velocities = {name: ascent.velocity for name, ascent in self.layer.ascents.items()}
        generator = self.generator.get_state()
        return {"done": self.done, "fewest": self.fewest, "velocities": velocities, "generator": generator}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Go on there; the net has its weights."""
        self.done, self.fewest = state["done"], state["fewest"]
        self.layer = self.stages[self._stage(self.done - 1)].layer()
        for name, ascent in self.layer.ascents.items():
            ascent.velocity.copy_(state["velocities"][name])
        self.generator.set_state(state["generator"])
