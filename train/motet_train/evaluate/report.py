"""All figures of a control model in one nested object with stable keys, and as a table beside the goals."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from motet.control import ControlModel
from motet_train.data.body import BodyParts, body_parts
from motet_train.data.clips import Clips, DataError, sequences
from motet_train.data.period import is_periodic
from motet_train.evaluate.bend import bends, interruptions
from motet_train.evaluate.gaits import (
    constant_hysteresis,
    convergence,
    gait_transitions,
    limit_cycle,
    ramp_hysteresis,
    synchronisation,
)
from motet_train.evaluate.lab import Lab, Leg
from motet_train.evaluate.measures import Reference
from motet_train.evaluate.variety import sampled_runs

Report = dict[str, dict[str, float]]

GOALS: Mapping[str, tuple[float | None, float | None]] = {
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
}
"""Figure -> (least, most) that the default recipe is to reach."""


def lab_of(model: ControlModel, clips: Clips) -> Lab:
    """A model beside the clips it was trained on; DataError where clips and model do not go together.

    The first two periodic labels are taken for walk and run (those of these names first), the first other for bend.
    """
    if set(clips.labels) != set(model.labels):
        raise DataError(f"the clips show {', '.join(clips.labels)}, the model knows {', '.join(model.labels)}")
    contract = model.contract
    motions = {
        label: [s for motion in found for s in sequences(motion.select(contract.channels, contract.units), model.fps)]
        for label, found in clips.motions.items()
    }
    parts = body_parts(contract.skeleton, contract.channels)
    reference = Reference(motions, model.fps, np.flatnonzero(np.isin(parts.of_channel, parts.legs)))
    by_name = sorted(motions, key=lambda label: ("walk", "run").index(label) if label in ("walk", "run") else 2)
    gaits = [label for label in by_name if is_periodic(motions[label])]
    if len(gaits) < 2:
        raise DataError("the experiments need clips of two periodic motions, such as walking and running")
    others = [label for label in motions if label not in gaits]
    return Lab(model, reference, gaits[0], gaits[1], others[0] if others else None, _legs(model, parts))


def experiments(lab: Lab) -> dict[str, list[Callable[[], Mapping[str, float]]]]:
    """For each key of the report the experiments whose figures stand under it."""
    found: dict[str, list[Callable[[], Mapping[str, float]]]] = {
        "cycle": [lambda: limit_cycle(lab), lambda: convergence(lab)],
        "cycle_run": [lambda: limit_cycle(lab, "run")],
        "sync": [lambda: synchronisation(lab)],
        "gait": [lambda: gait_transitions(lab)],
        "hysteresis": [lambda: ramp_hysteresis(lab), lambda: constant_hysteresis(lab)],
        "variety": [lambda: sampled_runs(lab)],
    }
    if lab.bend is not None:
        found["bend"] = [lambda: bends(lab), lambda: interruptions(lab)]
    return found


def control_report(lab: Lab, progress: Callable[[str], None]) -> Report:
    """Run all experiments; ``progress`` is called with the name of each group before it starts.

    "train" repeats what training measured. A figure that does not exist (a period of no loop) is NaN, a time that
    never came infinite.
    """
    training: Mapping[str, Any] = lab.model.manifest.get("training", {})
    report: Report = {"train": {key: float(training[key]) for key in ("seconds", "reconstruction") if key in training}}
    for name, group in experiments(lab).items():
        progress(name)
        report[name] = {key: value for run in group for key, value in run().items()}
    return report


def json_ready(report: Report) -> dict[str, dict[str, float | None]]:
    """The report with numbers that JSON lacks as null, rounded to six digits."""
    return {
        name: {key: float(f"{value:.6g}") if np.isfinite(value) else None for key, value in figures.items()}
        for name, figures in report.items()
    }


def table(reports: Mapping[str, Report]) -> str:
    """One line per figure, one column per report, and the goal behind those that have one."""
    first = next(iter(reports.values()))
    lines = [" " * 28 + "".join(f"{name[-14:]:>15}" for name in reports)]
    for group, figures in first.items():
        for key in figures:
            values = [report[group].get(key, float("nan")) for report in reports.values()]
            name = f"{group}.{key}"
            lines.append(f"{name:<28}" + "".join(f"{value:>15.4g}" for value in values) + _goal(name, values))
    return "\n".join(lines)


def reached(name: str, value: float) -> bool:
    """Whether a figure is within its goal; a figure that is not a number is not."""
    least, most = GOALS[name]
    return (least is None or value >= least) and (most is None or value <= most)


def _goal(name: str, values: list[float]) -> str:
    if name not in GOALS:
        return ""
    least, most = GOALS[name]
    text = (
        f"{least:g} to {most:g}" if None not in (least, most) else f">= {least:g}" if most is None else f"<= {most:g}"
    )
    return f"   {text:<12}" + ("" if all(reached(name, value) for value in values) else "  NOT REACHED")


def _legs(model: ControlModel, parts: BodyParts) -> tuple[Leg, Leg] | None:
    if not parts.legs:
        return None
    width = model.codes // len(parts.names)
    left, right = (
        Leg(np.flatnonzero(parts.of_channel == part), slice(part * width, (part + 1) * width)) for part in parts.legs
    )
    return left, right
