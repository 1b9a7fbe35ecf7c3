"""One motion after another: placed where the first one leads, with the same facing."""

import logging
from dataclasses import replace

import numpy as np

from motet.motion.humanoid import from_humanoid, on_humanoid
from motet.motion.kinematics import (
    AXES,
    continued,
    global_transforms,
    local_rotations,
    local_translations,
    posed,
    skeleton_of,
)
from motet.motion.motion import Motion
from motet.motion.rotations import Array, axis_to_rotmat, inverse, product, rotated

log = logging.getLogger(__name__)


def to_figure_of(motion: Motion, like: Motion) -> Motion:
    """A motion at the frame rate, on the skeleton and in the channels of another.

    If needed, it is resampled and retargeted to the other figure through the humanoid; both are logged as warnings.
    MotionError, with the reason, for figures that are not human.
    """
    if motion.fps != like.fps:
        log.warning("resampled the second motion from %g to %g fps, the rate of the first", motion.fps, like.fps)
        motion = motion.continuous().resample(like.fps)
    if not same_figure(motion, like):
        log.warning("retargeted the second motion to the figure of the first")
        motion = from_humanoid(on_humanoid(motion), like)
    elif set(motion.channels) == set(like.channels):
        return replace(motion.select(like.channels, like.units), skeleton=like.skeleton)
    names, turned, moved = skeleton_of(like).names, local_rotations(motion), local_translations(motion)
    joints = range(len(names))
    return continued(like[-1:], {names[i]: turned[:, i] for i in joints}, {names[i]: moved[:, i] for i in joints})


def same_figure(motion: Motion, other: Motion) -> bool:
    """Whether the joints of two motions have the same names, connections, rotation conventions and distances."""
    one, two = skeleton_of(motion), skeleton_of(other)
    told = [[(joint.name, joint.parent, joint.order, joint.axis) for joint in each.joints] for each in (one, two)]
    if told[0] != told[1]:
        return False
    apart = np.abs(one.offsets[1:] - two.offsets[1:]).max(initial=0)
    return one.metres_per_unit == two.metres_per_unit and bool(apart <= 1e-3 * two.height)


def placed_after(motion: Motion, before: Motion, seconds: float, turn: float) -> Motion | None:
    """A motion placed so that its first frame is ``seconds`` after the last one of another of the same figure.

    turn: its rotation about the vertical axis y, in radians. In between, the hips cross the ground at the mean of the
    velocities at the end of the first and, after turning, at the start of the second. None if the channels lack the
    position or rotation of the hips.
    """
    carrier = _carrier(motion)
    if carrier is None:
        return None
    last, first = (global_transforms(each)[1][0, carrier] for each in (before[-1], motion[0]))
    about = axis_to_rotmat("y", np.array(turn))
    speed = (_velocity(before, carrier, to_end=True) + about @ _velocity(motion, carrier)) / 2
    to = last + seconds * speed
    return _set_down(motion, carrier, about, first, np.array([to[0], first[1], to[2]]))


def _carrier(motion: Motion) -> int | None:
    """The joint that carries the others: the first with a translation, if it has three angles too."""
    for joint, name in enumerate(skeleton_of(motion).names):
        place, angles = ({f"{name}.{kind}{axis}" for axis in AXES} for kind in "tr")
        if place <= set(motion.channels):
            return joint if angles <= set(motion.channels) else None
    return None


def _velocity(motion: Motion, carrier: int, to_end: bool = False) -> Array:
    """Velocity (3,) of a joint, lengths per second, at the start or end of a motion; 0 for a single frame."""
    # the mean over .2 s
    frames = max(1, round(0.2 * motion.fps)) + 1
    part = motion[-frames:] if to_end else motion[:frames]
    if len(part) < 2:
        return np.zeros(3)
    places = global_transforms(part)[1][:, carrier]
    found: Array = (places[-1] - places[0]) * motion.fps / (len(part) - 1)
    return found


def _set_down(motion: Motion, carrier: int, about: Array, origin: Array, to: Array) -> Motion:
    """The motion turned about a point and moved so that the point reaches another."""
    joint = skeleton_of(motion).joints[carrier]
    turned, places = global_transforms(motion)
    frames = len(motion)
    above = turned[:, joint.parent] if joint.parent >= 0 else np.broadcast_to(np.eye(3), (frames, 3, 3))
    under = places[:, joint.parent] if joint.parent >= 0 else np.zeros((frames, 3))
    own = product(inverse(above), product(np.broadcast_to(about, above.shape), turned[:, carrier]))
    place = to + rotated(about, places[:, carrier] - origin)
    return posed(motion, {joint.name: own}, {joint.name: rotated(inverse(above), place - under)})
