"""Where one performance of an act ends and the next begins, in takes that show the same several times.

A take of someone who sits down and rises, again and again, teaches to do so for as long; what a sentence asks for is
done once. Each act of a take shows what the whole take shows, so that the sentences of the take are true of it.
Letters in shapes: T frames, J joints.
"""

from itertools import pairwise

import numpy as np

from motet.motion.kinematics import positions
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet.representation.contract import named
from motet_train.data.sixd_windows import poses_of

LEAST, MOST = 4.0, 12.0
"""Seconds of an act; a take that is not longer is one."""

AHEAD = 0.4
"""Seconds after a pose of which another pose tells what is being done."""

BACK, KNOWN = 0.4, 0.45
"""Metres, of the joint that is farthest off, by which an act may end off its start, and a pose is off all that it
shows: one foot that hops is an act of its own."""

SHARE = 0.95
"""Of a take's poses that each of its acts shows: starting and stopping are often shown once."""


def acts(motion: Motion) -> list[tuple[int, int]]:
    """Spans of frames of the acts in a motion in ``root_sixd``, one after another; itself alone where it is none of
    some that are alike, or short.

    An act ends when the figure is first back in the pose and on the move in which it began, and has shown what there is
    to show. What remains after the last is not shown.
    """
    fps, end = motion.fps, len(motion)
    if end <= MOST * fps:
        return [(0, end)]
    apart = _apart(_seen(motion))
    cuts = [0]
    while (cut := _end(apart, cuts[-1], fps)) is not None:
        cuts.append(cut)
    return list(pairwise(cuts)) or [(0, end)]


def _end(apart: Array, start: int, fps: float) -> int | None:
    """Where the act that begins at a frame ends, by how far frames are from each other (T, T)."""
    second = round(fps)
    for stop in range(start + round(LEAST * fps), min(start + round(MOST * fps), len(apart))):
        if apart[stop, start] <= BACK and np.mean(apart[start:stop].min(axis=0) <= KNOWN) >= SHARE:
            return stop + int(np.argmin(apart[stop : stop + second, start]))
    return None


def _seen(motion: Motion) -> Array:
    """Where joints are at each frame and AHEAD of it, (T, 2 J, 3) in metres, seen from where the figure then is."""
    ahead = round(AHEAD * motion.fps)
    places = positions(named("root_sixd").motion(motion))
    pose = poses_of(motion.values, motion.fps)[: len(places) - ahead]
    x, z, facing = (part[:, None] for part in pose.T)
    both = np.concatenate([places[: len(pose)], places[ahead:]], axis=1)
    aside, along = both[..., 0] - x, both[..., 2] - z
    sin, cos = np.sin(facing), np.cos(facing)
    return np.stack([cos * aside - sin * along, both[..., 1], sin * aside + cos * along], axis=-1)


def _apart(seen: Array) -> Array:
    """How far frames (T, J, 3) are from each other (T, T): of each two the joint that is farthest."""
    found = np.zeros((len(seen), len(seen)))
    for joint in np.moveaxis(seen, 1, 0):
        squares = (joint**2).sum(axis=1)
        np.maximum(found, squares[:, None] + squares - 2 * joint @ joint.T, out=found)
    apart: Array = np.sqrt(found)
    return apart
