"""Compositions: how well places, facings, poses and times are met, and what it costs the feet; beside the same prompts
drawn without them, as a story that is moved to the start."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from motet.errors import MotionError
from motet.formats import read_motion
from motet.models.compose import Met, met, moved
from motet.models.generate_codes import CodesModel
from motet.models.plans import Moment, parse_plan
from motet.motion.kinematics import positions
from motet.motion.motion import Motion
from motet_train.evaluate.positions import BALLS, acceleration, leap, speed
from motet_train.evaluate.tables import Goals, Report

FOLDER = Path(__file__).parent

COMPOSE_GOALS: Goals = {"place.worst": (None, 10.0), "pose.worst": (None, 5.0), "late.worst": (None, 0.1)}


def compositions() -> list[list[Moment]]:
    """Those of compositions.txt, in order; poses.bvh has ten poses of people kept back, as different as there are."""
    scripts = (FOLDER / "compositions.txt").read_text(encoding="utf-8").splitlines()
    return [parse_plan(script, lambda path: read_motion(FOLDER / path)) for script in scripts]


def compose_report(writer: CodesModel, seed: int = 0) -> dict[str, Report]:
    """Of the compositions, and "unconstrained" of the same prompts: see :func:`_figures`. refused: how many
    compositions are; they are in neither."""
    made, plain, refused = [], [], 0
    for moments in compositions():
        try:
            found = writer.compose(moments, seed=seed)
        except MotionError:
            refused += 1
            continue
        made.append((found.motion, found.met))
        free = _unconstrained(writer, moments, seed)
        plain.append((free, met(free, moments)))
    return {"composed": {**_figures(made), "refused": {"count": refused}}, "unconstrained": _figures(plain)}


def _unconstrained(writer: CodesModel, moments: list[Moment], seed: int) -> Motion:
    """The prompts of a composition as a story, moved to its start."""
    told = [(one.text, one.at) for one in moments if one.text is not None]
    stops = [at for _, at in told[1:]] + [moments[-1].at]
    seconds = [stop - at for (_, at), stop in zip(told, stops, strict=True)]
    return moved(writer.story([text for text, _ in told], seconds=seconds, seed=seed).motion, moments[0])


def _figures(found: Sequence[tuple[Motion, Sequence[Met]]]) -> Report:
    """How far off what is asked for is, centimetres (of poses the mean of joints, and the worst joint), degrees and
    seconds; the speed of standing feet, m/s, how joints tremble, m/s2, and the largest leap, degrees a frame."""
    every = [one for _, own in found for one in own if one.at > 0]
    report: Report = {}
    for what in ("place", "facing", "pose"):
        own = [one for one in every if one.what == what]
        mean, worst = float(np.mean([one.off for one in own])), max(one.off for one in own)
        report[what] = {"count": len(own), "mean": mean, "worst": worst}
    report["pose"]["worst_joint"] = max(one.worst for one in every if one.what == "pose")
    report["late"] = {"mean": float(np.mean([one.late for one in every])), "worst": max(one.late for one in every)}
    joints = [(positions(motion), motion.fps) for motion, _ in found]
    report["feet"] = {
        "speed": float(np.nanmean([speed(at[:, BALLS], at[:, 0], fps) for at, fps in joints])),
        "tremble": float(np.mean([acceleration(at, at[:, 0], fps) for at, fps in joints])),
        "leap": max(leap(motion) for motion, _ in found),
    }
    return report
