"""What a user sees of a control model: smooth sessions, whose path is laid and whose feet stand.

Measured by :mod:`motet_train.evaluate.positions`, beside the training motions, of which there are joint angles
alone: their path is laid, too, and their feet are left as they then are.
"""

import numpy as np

from motet.errors import MotionError
from motet.motion.feet.contacts import lay_root_path
from motet.motion.humanoid import map_of
from motet.motion.kinematics import positions, skeleton_of
from motet.motion.motion import Motion
from motet_train.evaluate.positions import acceleration, leap, slide, speed, stances
from motet_train.papers.tdbn.experiments.gaits import Figures
from motet_train.papers.tdbn.experiments.study import ControlStudy

GAIT_S = 20.0
"""Of each gait."""

RANDOM_S, CHANGES = 60.0, (0.25, 0.5, 1.0)
"""Seconds of each random control, and after which it changes, to uniform numbers between 0 and 1 for every label."""


def standing_feet(study: ControlStudy) -> Figures:
    """How far feet slide and how fast they are while they stand, how much joints tremble, and the pace, in both gaits.

    "plain" is without smoothing.

    None for a figure that is no human's: which joints are in the balls of its feet is not known.
    """
    model, figures = study.model, dict[str, float]()
    try:
        balls = _balls(model.contract.features(study.reference.motions[study.walk][0]))
    except MotionError:
        return {}
    for role in ("walk", "run"):
        label = getattr(study, role)
        if label is None:
            continue
        clips = [lay_root_path(model.contract.features(clip)) for clip in study.reference.motions[label]]
        script = f"{label} {GAIT_S:g}s"
        of = {f"_{role}": [model.run(script)], f"_{role}_plain": [model.run(script, smooth=False)]}
        for ending, motions in {**of, f"_{role}_recorded": clips}.items():
            measured = [_measured(motion, balls) for motion in motions]
            figures |= {key + ending: float(np.mean([one[key] for one in measured])) for key in measured[0]}
    return figures


def leaps(study: ControlStudy) -> Figures:
    """The largest turn of a joint in a frame, degrees, under controls that change at random."""
    found, model = {"leap": 0.0, "leap_plain": 0.0}, study.model
    rng = np.random.default_rng(0)
    for seconds in CHANGES:
        controls = rng.uniform(size=(round(RANDOM_S / seconds), len(model.labels)))
        track = controls.repeat(study.frames(seconds), axis=0)
        for key, smooth in (("leap", True), ("leap_plain", False)):
            frames = model.start(smooth=smooth).frames(track)[0]
            found[key] = max(found[key], leap(model.contract.features(frames)))
    recorded = [leap(model.contract.features(clip)) for clips in study.reference.motions.values() for clip in clips]
    return {**found, "leap_recorded": max(recorded)}


def _balls(motion: Motion) -> list[int]:
    """The joints in the balls of both feet, in their ankles where there are none."""
    joints = map_of(motion).joints
    return [joints.get(f"{side}Toes", joints[f"{side}Foot"]) for side in ("left", "right")]


def _measured(motion: Motion, balls: list[int]) -> Figures:
    places = positions(motion) * (skeleton_of(motion).metres_per_unit or 1.0)
    points, root = places[:, balls], places[:, 0]
    return {
        "slide": slide(stances(points, root, motion.fps)),
        "speed": speed(points, root, motion.fps),
        "acceleration": acceleration(places, root, motion.fps),
        "pace": float(np.linalg.norm((root[-1] - root[0])[[0, 2]])) / motion.duration,
    }
