"""All figures of a control model in one nested object with stable keys, and the goals of the shipped model."""

import re
from collections.abc import Callable, Iterable, Mapping
from functools import partial

import numpy as np

from motet.bundle.fields import Json
from motet.papers.tdbn_control import TdbnModel
from motet_train.data.errors import DataError
from motet_train.evaluate.tables import Report, gathered, reached, read_goals
from motet_train.papers.tdbn import experiments
from motet_train.papers.tdbn.clips import BodyParts, Clips, body_parts, is_periodic
from motet_train.papers.tdbn.study import ControlStudy, Leg, Reference

GOALS = read_goals("control")
"""Of the default recipe, whose clips show walk, run and bend."""


def study_of(model: TdbnModel, clips: Clips) -> ControlStudy:
    """A model with the clips it was trained on; DataError if clips and model do not match.

    The first two periodic labels stand for walk and run (those of these names first), the first other one for bend.
    Clips of labels that the model does not know are left out.
    """
    channels = model.contract.channels
    motions = clips.only(model.labels).frames(model.fps, channels)
    parts = body_parts(clips.skeleton, channels)
    reference = Reference(motions, np.flatnonzero(np.isin(parts.of_channel, parts.legs)))
    names = ["walk", "run"]
    by_name = sorted(motions, key=lambda label: names.index(label) if label in names else 2)
    gaits = [label for label in by_name if is_periodic(motions[label])]
    if not gaits:
        raise DataError("the experiments need clips of a periodic motion, such as walking")
    run = gaits[1] if len(gaits) > 1 else ""
    bend = next((label for label in motions if label not in gaits), "")
    return ControlStudy(model, reference, gaits[0], run, bend, _legs(parts, model.codes))


def _legs(parts: BodyParts, codes: int) -> list[Leg]:
    """The channels and codes of the left and the right leg, if there are legs."""
    # codes are the channels themselves, or the same number of each part
    of_code = parts.of_channel
    if codes != len(of_code):
        of_code = np.repeat(np.arange(len(parts.names)), codes // len(parts.names))
    return [Leg(np.flatnonzero(parts.of_channel == leg), np.flatnonzero(of_code == leg)) for leg in parts.legs]


Experiment = Callable[[ControlStudy], Mapping[str, float]]


def experiments_of(study: ControlStudy) -> dict[str, list[Experiment]]:
    """The experiments of each group of figures; roles are named by CMU's labels."""
    groups: dict[str, list[Experiment]] = {
        "cycle": [experiments.limit_cycle, experiments.convergence],
        "sync": [experiments.synchronisation],
        "feet": [experiments.standing_feet],
        "random": [experiments.leaps],
    }
    if study.run:
        groups["cycle_run"] = [partial(experiments.limit_cycle, role="run")]
        groups["gait"] = [experiments.gait_transitions]
        groups["hysteresis"] = [experiments.ramp_hysteresis, experiments.constant_hysteresis]
        groups["variety"] = [experiments.sampled_runs]
        if study.bend:
            groups["bend"] = [experiments.bends, experiments.interruptions]
    return groups


def missed_goals(study: ControlStudy, enough: int) -> list[str]:
    """The goals that a model misses, by quick experiments first; stops at ``enough`` of them."""
    missed: list[str] = []
    groups = experiments_of(study)
    for group in ("gait", "bend", "sync", "cycle_run", "cycle", "hysteresis", "random", "feet"):
        for experiment in groups.get(group, []):
            figures = {f"{group}.{key}": value for key, value in experiment(study).items()}
            wrong = [name for name in figures if name in GOALS and not reached(GOALS, name, figures[name])]
            missed += [by_label(study, name) for name in wrong]
            if len(missed) >= enough:
                return missed
    return missed


def control_report(study: ControlStudy) -> Report:
    """The figures of all experiments, and under "train" those of the training.

    A figure that does not exist, such as the period of no loop, is NaN; a time that is never reached is infinite.
    """
    training: Json = study.model.manifest.training
    report: Report = {"train": {key: float(training[key]) for key in ("seconds", "reconstruction") if key in training}}
    parts = (_figures(study, name, group) for name, group in experiments_of(study).items())
    return report | gathered(parts, study.model.manifest.name)


def _figures(study: ControlStudy, name: str, group: Iterable[Experiment]) -> Report:
    """The figures of a group of experiments, by the labels of the clips."""
    figures = {}
    for experiment in group:
        for key, value in experiment(study).items():
            figures[by_label(study, key)] = value
    return {by_label(study, name): figures}


def by_label(study: ControlStudy, name: str) -> str:
    """The name of a figure, such as "bend.share_from_run", with the labels of the clips: "wave.share_from_jog"."""
    roles = r"(?<![a-z])(?:walk|run|bend)(?![a-z])"
    return re.sub(roles, lambda role: getattr(study, role[0]) or role[0], name)
