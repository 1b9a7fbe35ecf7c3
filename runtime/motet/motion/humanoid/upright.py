"""Which way up a figure stands: files that were made with another axis up are turned."""

from typing import NamedTuple

import numpy as np

from motet.motion.humanoid.fitting import Fitted
from motet.motion.humanoid.rest_pose import legs_up, middle, trunk_up
from motet.motion.rotations import UP, Array, swing

ALONG = 0.82
"""Cosine from which on a body counts as standing along an axis."""


class Up(NamedTuple):
    """The rotation (3, 3) of the world that makes y point up, and what there is to say about it."""

    turn: Array
    note: str | None


STANDS = Up(np.eye(3), None)
"""What stands along y, or of which nothing tells."""


def upright(fitted: Fitted, places: Array) -> Up:
    """The rotation (3, 3) of the world that makes y point up, and what there is to say about it.

    The identity where y points up, or nothing tells. A figure stands along another axis where its rest pose and most
    of its frames (T, J, 3) say so, or where the frames alone do and it walks about: a body that lies down does not.
    """
    if not len(places):
        return STANDS
    if fitted.up is None or fitted.up[1] > 0.5:
        return _turned_frames(fitted, places)
    stands = float(np.median(trunk_up(places, fitted.joint_map) @ fitted.up)) > 0.7
    return Up(swing(fitted.up, UP), "turned upright: the figure does not stand along y") if stands else STANDS


def _turned_frames(fitted: Fitted, places: Array) -> Up:
    """The same where the frames may stand along another axis than the rest pose, which has y up."""
    trunk, legs = trunk_up(places, fitted.joint_map), legs_up(places, fitted.joint_map)
    mean = np.median(trunk, axis=0)
    axis = int(np.argmax(np.abs(mean)))
    up = np.sign(mean[axis]) * np.eye(3)[axis]
    stands = trunk @ up > ALONG
    if axis == 1 or np.mean(stands) < 0.5 or np.mean(trunk[:, 1] > ALONG) > 0.1 or np.median(legs @ up) < ALONG:
        return STANDS
    name = "xyz"[axis]
    if not _walks(fitted, places[stands], up):
        return Up(
            np.eye(3), f"the body lies along {name} in most frames: if it stands there, export the file with y up"
        )
    return Up(swing(up, UP), f"turned upright: the frames stand along {name}, the rest pose along y")


def _walks(fitted: Fitted, places: Array, up: Array) -> bool:
    """Whether a figure goes its leg's length and more across a direction (3,), and not along it."""
    path = middle(places, fitted.joint_map, "UpperLeg")
    along = float(np.ptp(path @ up))
    across = float(np.linalg.norm(np.ptp(path - (path @ up)[:, None] * up, axis=0)))
    return across > max(fitted.leg, 2 * along)
