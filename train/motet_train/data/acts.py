"""Split takes that repeat an act into its single performances.

A take of someone who sits down and rises again and again would teach a model to repeat the act for as long, but a
sentence asks for it once. Each act of a take shows everything that the take shows, so the take's sentences are true of
it. Letters in shapes: T frames, J joints.
"""

from itertools import pairwise

import numpy as np

from motet.motion.kinematics import positions
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet.representation.contract import named
from motet.representation.root_block import poses_of

LONGEST_ACT = 12.0
"""Longest act, in seconds; a shorter take is a single act."""


def acts(motion: Motion) -> list[tuple[int, int]]:
    """Consecutive spans of frames (start, stop) of the acts in a motion in ``root_sixd``.

    An act takes 4 to 12 s, and ends when the figure has first returned to the pose and movement in which it began,
    and has shown all poses of the take. What remains after the last act is left out. A take that is short, or does
    not repeat itself, is one span.
    """
    if len(motion) <= LONGEST_ACT * motion.fps:
        return [(0, len(motion))]
    distances = _distances(_local_positions(motion))
    cuts = [0]
    cut = _end(distances, 0, motion.fps)
    while cut is not None:
        cuts.append(cut)
        cut = _end(distances, cut, motion.fps)
    return list(pairwise(cuts)) or [(0, len(motion))]


def _end(distances: Array, start: int, fps: float) -> int | None:
    """The end of the act that begins at frame ``start``, from the distances of frames (T, T)."""
    second = round(fps)
    shortest = start + round(4 * fps)
    longest = start + round(LONGEST_ACT * fps)
    for stop in range(shortest, min(longest, len(distances))):
        # back in its first pose: no joint is farther than 40 cm
        if distances[stop, start] > 0.4:
            continue
        # a pose is shown if no joint is farther than 45 cm: hopping on one foot is another act; starting and stopping
        # are often shown only once
        nearest_in_act = distances[start:stop].min(axis=0)
        if np.mean(nearest_in_act <= 0.45) >= 0.95:
            # within the next second, cut where the figure is closest to its first pose
            return stop + int(np.argmin(distances[stop : stop + second, start]))
    return None


def _local_positions(motion: Motion) -> Array:
    """Positions of joints at each frame and 0.4 s later, so that movement counts as well as posture, (T, 2 J, 3) in
    metres, relative to the root at that frame."""
    ahead = round(0.4 * motion.fps)
    world = positions(named("root_sixd").motion(motion))
    pose = poses_of(motion.values, motion.fps)[: len(world) - ahead]
    now_and_ahead = np.concatenate([world[: len(pose)], world[ahead:]], axis=1)
    # translate to the root's place on the floor
    x, z, facing = (part[:, None] for part in pose.T)
    side = now_and_ahead[..., 0] - x
    forward = now_and_ahead[..., 2] - z
    # turn to the root's facing
    sin = np.sin(facing)
    cos = np.cos(facing)
    return np.stack([cos * side - sin * forward, now_and_ahead[..., 1], sin * side + cos * forward], axis=-1)


def _distances(local: Array) -> Array:
    """Distances (T, T) between frames (T, J, 3): for each pair, of the joint that is farthest."""
    largest = np.zeros((len(local), len(local)))
    for joint in np.moveaxis(local, 1, 0):
        # |a - b|^2 = |a|^2 + |b|^2 - 2 a b
        squares = (joint**2).sum(axis=1)
        np.maximum(largest, squares[:, None] + squares - 2 * joint @ joint.T, out=largest)
    distances: Array = np.sqrt(largest)
    return distances
