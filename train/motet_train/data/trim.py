"""Cutting off what is not action: a T-pose before a recording, and standing still at both ends."""

import numpy as np

from motet.motion.feet.root_path import ADULT_HEIGHT
from motet.motion.kinematics import positions, skeleton_of
from motet.motion.motion import Motion
from motet.motion.rotations import Array

LEAP, EDGE = 10.0, 0.5
"""m/s, seconds: joints that move faster on average within so long of an end do not move, the recording leaps there."""

STILL, WINDOW, KEEP = 0.2, 0.25, 0.5
"""m/s, seconds, seconds: a figure is still whose fastest joint gets no further over the window; so much is kept."""


def trim(motion: Motion) -> Motion:
    """The motion without a lead-in that leaps to the action, and with stillness at its ends cut to KEEP seconds.

    A pose that is held counts as stillness like standing about; a motion that is still throughout stays as it is, and
    nothing between two movements is touched. A skeleton that does not know its unit is taken for a person of 1.7 m.
    Of 256 CMU trials of 2,857 s this shortens 41, by 61 s: five that leap to the action from a few frames of another
    pose, standing about around karate, jumps and songs, and dancers who hold their last pose for up to eleven seconds.
    """
    skeleton = skeleton_of(motion)
    places = positions(motion) * (skeleton.metres_per_unit or ADULT_HEIGHT / skeleton.height)
    start, stop = _between_leaps(_speed(places, 1, motion.fps).mean(axis=1), round(EDGE * motion.fps))
    width, keep = max(1, round(WINDOW * motion.fps)), round(KEEP * motion.fps)
    moving = start + np.flatnonzero(_speed(places[start:stop], width, motion.fps).max(axis=1) > STILL)
    if not len(moving):
        return motion[start:stop]
    return motion[max(start, int(moving[0]) - keep) : min(stop, int(moving[-1]) + width + 1 + keep)]


def _speed(places: Array, frames: int, fps: float) -> Array:
    """How fast joints (T, J, 3) in metres get from each frame to the one ``frames`` later: (T - frames, J) in m/s."""
    speed: Array = np.linalg.norm(places[frames:] - places[:-frames], axis=-1) * fps / frames
    return speed


def _between_leaps(speed: Array, edge: int) -> tuple[int, int]:
    """Start and stop of the frames between the last leap near the beginning and the first one near the end."""
    leaps = np.flatnonzero(speed > LEAP) + 1
    start = int(max((leap for leap in leaps if leap <= edge), default=0))
    return start, int(min((leap for leap in leaps if leap > max(start, len(speed) - edge)), default=len(speed) + 1))
