"""All figures of a control model in one nested object with stable keys, and the goals of the one we ship."""

import re
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from motet.models.tdbn_control import TdbnModel
from motet_train.data.errors import DataError
from motet_train.evaluate.tables import Goals, Report, gathered, reached
from motet_train.papers.tdbn.body import BodyParts, body_parts
from motet_train.papers.tdbn.clips import Clips
from motet_train.papers.tdbn.experiments.bend import bends, interruptions
from motet_train.papers.tdbn.experiments.gaits import (
    constant_hysteresis,
    convergence,
    gait_transitions,
    limit_cycle,
    ramp_hysteresis,
    sampled_runs,
    synchronisation,
)
from motet_train.papers.tdbn.experiments.measures import Reference
from motet_train.papers.tdbn.experiments.shown import leaps, standing_feet
from motet_train.papers.tdbn.experiments.study import ControlStudy, Leg
from motet_train.papers.tdbn.period import is_periodic

GOALS: Goals = {
    "train.seconds": (None, 30),
    "train.reconstruction": (None, 0.25),
    "cycle.period_error": (None, 0.02),
    "cycle.drift": (None, 0.005),
    "cycle.energy": (0.7, 1.1),
    "cycle.converged": (99, None),
    "cycle.median_s": (None, 1.2),
    "cycle_run.energy": (0.7, 1.1),
    "sync.share": (1, None),
    "sync.max_s": (None, 1),
    "gait.share": (1, None),
    "gait.median_s": (None, 0.45),
    "gait.under_half": (0.8, None),
    "gait.jump_ratio": (None, 1),
    "hysteresis.ramp_width": (0.4, None),
    "hysteresis.constant_width": (0.25, None),
    "bend.share": (0.95, None),
    "bend.share_from_run": (0.95, None),
    "bend.interrupt_s": (None, 0.8),
    "feet.slide_walk": (None, 0.025),
    "feet.speed_walk": (None, 0.15),
    "feet.acceleration_walk": (None, 6),
    "feet.slide_run": (None, 0.06),
    "feet.speed_run": (None, 0.15),
    "feet.acceleration_run": (None, 11),
    "random.leap": (None, 26),
}
"""Figure -> (least, most) that the default recipe is to reach; its clips show walk, run and bend."""

ROLES = re.compile(r"(?<![a-z])(?:walk|run|bend)(?![a-z])")


def study_of(model: TdbnModel, clips: Clips) -> ControlStudy:
    """A model beside the clips it was trained on; DataError where clips and model do not go together.

    The first two periodic labels are taken for walk and run (those of these names first), the first other for bend.
    Clips of labels that the model does not know are left out.
    """
    channels = model.contract.channels
    motions, parts = clips.only(model.labels).frames(model.fps, channels), body_parts(clips.skeleton, channels)
    reference = Reference(motions, model.fps, np.flatnonzero(np.isin(parts.of_channel, parts.legs)))
    by_name = sorted(motions, key=lambda label: ("walk", "run").index(label) if label in ("walk", "run") else 2)
    gaits = [label for label in by_name if is_periodic(motions[label])]
    if not gaits:
        raise DataError("the experiments need clips of a periodic motion, such as walking")
    run, bend = (next(iter(found), None) for found in (gaits[1:], [label for label in motions if label not in gaits]))
    return ControlStudy(model, reference, gaits[0], run, bend, _legs(model, parts))


def experiments(study: ControlStudy) -> dict[str, list[Callable[[], Mapping[str, float]]]]:
    """For each group of figures the experiments that give them; names are those of CMU's labels."""
    found: dict[str, list[Callable[[], Mapping[str, float]]]] = {
        "cycle": [lambda: limit_cycle(study), lambda: convergence(study)],
        "sync": [lambda: synchronisation(study)],
        "feet": [lambda: standing_feet(study)],
        "random": [lambda: leaps(study)],
    }
    if study.run is None:
        return found
    found |= {
        "cycle_run": [lambda: limit_cycle(study, "run")],
        "gait": [lambda: gait_transitions(study)],
        "hysteresis": [lambda: ramp_hysteresis(study), lambda: constant_hysteresis(study)],
        "variety": [lambda: sampled_runs(study)],
    }
    if study.bend is not None:
        found["bend"] = [lambda: bends(study), lambda: interruptions(study)]
    return found


REHEARSED = ("gait", "bend", "sync", "cycle_run", "cycle", "hysteresis")
"""Groups of experiments with goals, quick ones first."""


def missed_goals(study: ControlStudy, enough: int) -> list[str]:
    """Goals that a model misses in the :data:`REHEARSED` experiments; stops at ``enough`` of them."""
    missed: list[str] = []
    groups = experiments(study)
    for group, run in ((name, run) for name in REHEARSED for run in groups.get(name, [])):
        named = {f"{group}.{key}": value for key, value in run().items()}
        missed += [by_label(study, name) for name in named if name in GOALS and not reached(GOALS, name, named[name])]
        if len(missed) >= enough:
            break
    return missed


def control_report(study: ControlStudy) -> Report:
    """All experiments. "train" repeats what training measured.

    A figure that does not exist (a period of no loop) is NaN, a time that never came infinite.
    """
    training: Mapping[str, Any] = study.model.manifest.training
    report: Report = {"train": {key: float(training[key]) for key in ("seconds", "reconstruction") if key in training}}
    parts = (
        {by_label(study, name): {by_label(study, key): value for run in group for key, value in run().items()}}
        for name, group in experiments(study).items()
    )
    return report | gathered(parts, study.model.manifest.name)


def by_label(study: ControlStudy, name: str) -> str:
    """The name of a figure, "bend.share_from_run", with the labels of the clips: "wave.share_from_jog"."""
    return ROLES.sub(lambda role: getattr(study, role[0]) or role[0], name)


def _legs(model: TdbnModel, parts: BodyParts) -> tuple[Leg, Leg] | None:
    if not parts.legs:
        return None
    # codes are the channels themselves, or as many of each part
    of_code = parts.of_channel
    if model.codes != len(of_code):
        of_code = np.repeat(np.arange(len(parts.names)), model.codes // len(parts.names))
    left, right = (
        Leg(np.flatnonzero(parts.of_channel == part), np.flatnonzero(of_code == part)) for part in parts.legs
    )
    return left, right
