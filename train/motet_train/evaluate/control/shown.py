"""What a user sees of a control model: smooth sessions, whose path is laid and whose feet stand.

Measured by :mod:`motet_train.evaluate.control.feet`, beside the training motions, of which there are joint angles
alone: their path is laid, too, and their feet are left as they then are.
"""

import numpy as np

from motet.errors import MotionError
from motet.motion.kinematics import positions, skeleton_of
from motet.motion.motion import Motion
from motet.motion.retarget import map_of
from motet.motion.root_path import lay_root_path
from motet_train.evaluate.control.feet import acceleration, leap, slide, speed
from motet_train.evaluate.control.gaits import Figures
from motet_train.evaluate.control.study import ControlStudy

SECONDS = 20.0
"""Of each gait, and of each random control."""

CHANGES = (0.25, 0.5, 1.0)
"""Seconds after which a random control changes, to uniform numbers between 0 and 1 for every label."""


def standing_feet(study: ControlStudy) -> Figures:
    """How far feet slide and how fast they are while they stand, how much joints tremble, in both gaits.

    None for a figure that is no human's: which joints are in the balls of its feet is not known.
    """
    model, figures = study.model, dict[str, float]()
    try:
        balls = _balls(model.contract.features(study.reference.motions[study.walk][0]))
    except MotionError:
        return {}
    for role in ("walk", "run"):
        label = getattr(study, role)
        if label is not None:
            clips = [lay_root_path(model.contract.features(clip)) for clip in study.reference.motions[label]]
            of_clips = [_measured(clip, balls) for clip in clips]
            for key, value in _measured(model.run(f"{label} {SECONDS:g}s"), balls).items():
                figures[f"{key}_{role}"] = value
                figures[f"{key}_{role}_recorded"] = float(np.mean([one[key] for one in of_clips]))
    return figures


def leaps(study: ControlStudy) -> Figures:
    """The largest turn of a joint in a frame, degrees, under controls that change at random."""
    rng, model = np.random.default_rng(0), study.model
    found = []
    for seconds in CHANGES:
        controls = rng.uniform(size=(round(SECONDS / seconds), len(model.labels)))
        track = controls.repeat(study.frames(seconds), axis=0)
        found.append(leap(model.contract.features(model.start().frames(track)[0])))
    recorded = [leap(model.contract.features(clip)) for clips in study.reference.motions.values() for clip in clips]
    return {"leap": max(found), "leap_recorded": max(recorded)}


def _balls(motion: Motion) -> list[int]:
    """The joints in the balls of both feet, in their ankles where there are none."""
    joints = map_of(motion).joints
    return [joints.get(f"{side}Toes", joints[f"{side}Foot"]) for side in ("left", "right")]


def _measured(motion: Motion, balls: list[int]) -> Figures:
    places = positions(motion) * (skeleton_of(motion).metres_per_unit or 1.0)
    points, root = places[:, balls], places[:, 0]
    return {
        "slide": slide(points, root, motion.fps),
        "speed": speed(points, root, motion.fps),
        "acceleration": acceleration(places, root, motion.fps),
    }
