"""All figures of a control model in one nested object with stable keys, and the goals of the one we ship."""

import re
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np

from motet.papers.tdbn_control import TdbnModel
from motet_train.data.errors import DataError
from motet_train.evaluate.tables import Goals, Report, gathered, reached
from motet_train.papers.tdbn import experiments
from motet_train.papers.tdbn.clips import Clips, body_parts, is_periodic
from motet_train.papers.tdbn.study import ControlStudy, Leg, Reference

# fmt: off
GOALS: Goals = {
    "train.seconds": (None, 30), "train.reconstruction": (None, 0.25),
    "cycle.period_error": (None, 0.02), "cycle.drift": (None, 0.005), "cycle.energy": (0.7, 1.1),
    "cycle.converged": (99, None), "cycle.median_s": (None, 1.2),
    "cycle_run.energy": (0.7, 1.1),
    "sync.share": (1, None), "sync.max_s": (None, 1),
    "gait.share": (1, None), "gait.median_s": (None, 0.45), "gait.under_half": (0.8, None),
    "gait.jump_ratio": (None, 1),
    "hysteresis.ramp_width": (0.4, None), "hysteresis.constant_width": (0.25, None),
    "bend.share": (0.95, None), "bend.share_from_run": (0.95, None), "bend.interrupt_s": (None, 0.8),
    "feet.slide_walk": (None, 0.025), "feet.speed_walk": (None, 0.15), "feet.acceleration_walk": (None, 6),
    "feet.slide_run": (None, 0.06), "feet.speed_run": (None, 0.15), "feet.acceleration_run": (None, 11),
    "random.leap": (None, 26),
}
# fmt: on
"""Figure -> (least, most) that the default recipe is to reach; its clips show walk, run and bend."""


def study_of(model: TdbnModel, clips: Clips) -> ControlStudy:
    """A model beside the clips it was trained on; DataError where clips and model do not go together.

    The first two periodic labels are taken for walk and run (those of these names first), the first other for bend.
    Clips of labels that the model does not know are left out.
    """
    channels = model.contract.channels
    motions, parts = clips.only(model.labels).frames(model.fps, channels), body_parts(clips.skeleton, channels)
    reference = Reference(motions, np.flatnonzero(np.isin(parts.of_channel, parts.legs)))
    by_name = sorted(motions, key=lambda label: ("walk", "run").index(label) if label in ("walk", "run") else 2)
    gaits = [label for label in by_name if is_periodic(motions[label])]
    if not gaits:
        raise DataError("the experiments need clips of a periodic motion, such as walking")
    run, bend = (next(iter(found), None) for found in (gaits[1:], [label for label in motions if label not in gaits]))
    # codes are the channels themselves, or as many of each part
    of_channel = of_code = parts.of_channel
    if model.codes != len(of_code):
        of_code = np.repeat(np.arange(len(parts.names)), model.codes // len(parts.names))
    legs = [Leg(np.flatnonzero(of_channel == part), np.flatnonzero(of_code == part)) for part in parts.legs]
    return ControlStudy(model, reference, gaits[0], run, bend, (legs[0], legs[1]) if legs else None)


def experiments_of(study: ControlStudy) -> dict[str, list[Callable[[], Mapping[str, float]]]]:
    """For each group of figures the experiments that give them; names are those of CMU's labels."""
    found: dict[str, list[Callable[..., Mapping[str, float]]]] = {
        "cycle": [experiments.limit_cycle, experiments.convergence],
        "sync": [experiments.synchronisation],
        "feet": [experiments.standing_feet],
        "random": [experiments.leaps],
    }
    if study.run is not None:
        found |= {
            "cycle_run": [partial(experiments.limit_cycle, role="run")],
            "gait": [experiments.gait_transitions],
            "hysteresis": [experiments.ramp_hysteresis, experiments.constant_hysteresis],
            "variety": [experiments.sampled_runs],
        }
        if study.bend is not None:
            found["bend"] = [experiments.bends, experiments.interruptions]
    return {name: [partial(run, study) for run in group] for name, group in found.items()}


def missed_goals(study: ControlStudy, enough: int) -> list[str]:
    """Goals that a model misses in the experiments that have some, quick ones first; stops at ``enough`` of them."""
    missed: list[str] = []
    groups = experiments_of(study)
    for group in ("gait", "bend", "sync", "cycle_run", "cycle", "hysteresis"):
        for run in groups.get(group, []):
            named = {f"{group}.{key}": value for key, value in run().items()}
            wrong = [name for name in named if name in GOALS and not reached(GOALS, name, named[name])]
            missed += [by_label(study, name) for name in wrong]
            if len(missed) >= enough:
                return missed
    return missed


def control_report(study: ControlStudy) -> Report:
    """All experiments. "train" repeats what training measured.

    A figure that does not exist (a period of no loop) is NaN, a time that never came infinite.
    """
    training: Mapping[str, Any] = study.model.manifest.training
    report: Report = {"train": {key: float(training[key]) for key in ("seconds", "reconstruction") if key in training}}
    parts = (
        {by_label(study, name): {by_label(study, key): value for run in group for key, value in run().items()}}
        for name, group in experiments_of(study).items()
    )
    return report | gathered(parts, study.model.manifest.name)


def by_label(study: ControlStudy, name: str) -> str:
    """The name of a figure, "bend.share_from_run", with the labels of the clips: "wave.share_from_jog"."""
    roles = r"(?<![a-z])(?:walk|run|bend)(?![a-z])"
    return re.sub(roles, lambda role: getattr(study, role[0]) or role[0], name)
