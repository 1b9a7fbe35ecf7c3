"""Compositions: how well places, facings, poses and times are met, and what this costs the feet; compared with the same
prompts drawn without constraints, as a story moved to the start."""

from collections.abc import Sequence
from itertools import chain
from pathlib import Path

import numpy as np

from motet.composition.compose import Met, compose, met, moved
from motet.composition.plans import Moment, parse_plan
from motet.errors import MotionError
from motet.formats import read_motion
from motet.generate.model import CodesModel
from motet.motion.kinematics import positions
from motet.motion.motion import Motion
from motet_train.evaluate.positions import BALLS, acceleration, leap, speed
from motet_train.evaluate.tables import Figures, Report, read_goals

FOLDER = Path(__file__).parent

COMPOSE_GOALS = read_goals("compose")


def compositions() -> list[list[Moment]]:
    """The compositions of compositions.txt, in order; poses.bvh has ten held-out poses, as different as possible."""
    scripts = (FOLDER / "compositions.txt").read_text(encoding="utf-8").splitlines()
    return [parse_plan(script, lambda path: read_motion(FOLDER / path)) for script in scripts]


def compose_report(writer: CodesModel) -> dict[str, Report]:
    """The figures of all compositions, and "unconstrained" those of the same prompts (see :func:`_figures`). refused:
    the number of refused compositions, which count in neither."""
    composed = []
    unconstrained = []
    refused = 0
    for moments in compositions():
        try:
            composition = compose(writer, moments, seed=0)
        except MotionError:
            refused += 1
            continue
        composed.append((composition.motion, composition.met))
        story = _unconstrained(writer, moments)
        unconstrained.append((story, met(story, moments)))
    return {
        "composed": {**_figures(composed), "refused": {"count": refused}},
        "unconstrained": _figures(unconstrained),
    }


def _unconstrained(writer: CodesModel, moments: list[Moment]) -> Motion:
    """The prompts of a composition as a story, moved to its start."""
    # each prompt lasts until the next one, or until the end
    prompts = [(moment.text, moment.at) for moment in moments if moment.text is not None]
    sentences, starts = zip(*prompts, strict=True)
    seconds = np.diff([*starts, moments[-1].at]).tolist()
    story = writer.story(list(sentences), seconds=seconds, seed=0)
    return moved(story.motion, moments[0])


def _figures(compositions: Sequence[tuple[Motion, Sequence[Met]]]) -> Report:
    """Errors of places in centimetres, of facings in degrees, of poses in centimetres (the mean over joints, and the
    worst joint), and of times in seconds; the speed of standing feet, m/s, how joints tremble, m/s^2, and the largest
    leap, degrees a frame."""
    # how well each goal is met; those at the very start are met by construction
    every_goal = chain.from_iterable(goals_met for _, goals_met in compositions)
    goals = [goal for goal in every_goal if goal.at > 0]
    report: Report = {}
    for kind in ("place", "facing", "pose"):
        errors = [goal.off for goal in goals if goal.what == kind]
        report[kind] = {"count": len(errors), **_mean_and_worst(errors)}
    report["pose"]["worst_joint"] = max(goal.worst for goal in goals if goal.what == "pose")
    report["late"] = _mean_and_worst([goal.late for goal in goals])
    report["feet"] = _quality([motion for motion, _ in compositions])
    return report


def _mean_and_worst(errors: Sequence[float]) -> Figures:
    return {"mean": float(np.mean(errors)), "worst": max(errors)}


def _quality(motions: Sequence[Motion]) -> Figures:
    speeds = []
    accelerations = []
    leaps = []
    for motion in motions:
        points = positions(motion)
        root = points[:, 0]
        speeds.append(speed(points[:, BALLS], root, motion.fps))
        accelerations.append(acceleration(points, root, motion.fps))
        leaps.append(leap(motion))
    return {
        "speed": float(np.nanmean(speeds)),
        "tremble": float(np.mean(accelerations)),
        "leap": max(leaps),
    }
