"""Recordings without what is at their ends by accident, and periods repeated."""

import math
from dataclasses import replace

import numpy as np

from motet.figures.feet.contacts import ADULT_HEIGHT
from motet.motion.kinematics import positions, skeleton_of
from motet.motion.motion import Motion
from motet.motion.rotations import Array


def repeated(features: Motion, seconds: float = 3.5) -> Motion:
    """Features (T, D) of one period, repeated to fill at least ``seconds``.

    The last frame of the period is its first again. The root channels are changes, so the path goes on.
    """
    period = features.values[1:]
    times = math.ceil(seconds * features.fps / max(1, len(period)))
    values = np.concatenate([features.values, *[period] * max(0, times - 1)])
    return replace(features, values=values)


def trim(motion: Motion) -> Motion:
    """The motion without lead-ins of another pose, and with at most half a second of stillness at its ends.

    A held pose counts as stillness like standing about; a motion that is still throughout stays as it is, and nothing
    between two movements is touched. A skeleton of unknown unit is taken for a person of 1.7 m. Of 256 CMU trials of
    2,857 s this shortens 41, by 61 s: five that leap to the action from a few frames of another pose, standing about
    around karate, jumps and songs, and dancers who hold their last pose for up to eleven seconds.
    """
    skeleton = skeleton_of(motion)
    places = positions(motion) * (skeleton.metres_per_unit or ADULT_HEIGHT / skeleton.height)
    half = round(0.5 * motion.fps)
    start, stop = _between_leaps(places, motion.fps, half)
    # a still figure's fastest joint stays below 0.2 m/s over a quarter of a second
    width = max(1, round(0.25 * motion.fps))
    speeds = _speeds(places[start:stop], width, motion.fps)
    moving = start + np.flatnonzero(speeds.max(axis=1) > 0.2)
    if not len(moving):
        return motion[start:stop]
    first = int(moving[0]) - half
    last = int(moving[-1]) + width + 1 + half
    return motion[max(start, first) : min(stop, last)]


def _between_leaps(places: Array, fps: float, reach: int) -> tuple[int, int]:
    """The span of frames from the last leap within ``reach`` frames of the start to the first one near the end.

    Joints do not move at more than 10 m/s on average: there the recording leaps to another pose.
    """
    leaps = np.flatnonzero(_speeds(places, 1, fps).mean(axis=1) > 10.0) + 1
    start = int(max((leap for leap in leaps if leap <= reach), default=0))
    last = len(places) - 1
    stop = int(min((leap for leap in leaps if leap > max(start, last - reach)), default=len(places)))
    return start, stop


def _speeds(places: Array, frames: int, fps: float) -> Array:
    """Speeds of joints (T, J, 3) from each frame to the one ``frames`` later: (T - frames, J) in m/s."""
    speeds: Array = np.linalg.norm(places[frames:] - places[:-frames], axis=-1) * fps / frames
    return speeds
