"""Clips in place, as game engines keep them: found by their feet, and given the path that their feet imply.

A foot that carries weight stays where it is, in a walk as in a dance or a march on the spot. In a clip in place it
slides back under a body that stays, as on a treadmill, while the other foot swings forward. So a clip is in place where
its feet, by turns, slide much further than its root goes. Crawling, swimming, rolling and hopping on both feet are not
found, and neither is a clip whose root goes half as far as its feet.
"""

from dataclasses import dataclass

import numpy as np

from motet.errors import MotionError, TravelWarning, warn
from motet.figures.feet.contacts import (
    ADULT_HEIGHT,
    TREMBLE,
    feet_of,
    has_feet,
    lay_root_path,
    smoothed,
    velocity_by_feet,
)
from motet.figures.humanoid import (
    HUMANOID,
    ground_under,
    is_mmm,
    leg_length,
    sole_points,
    to_humanoid,
    with_figure,
)
from motet.motion.kinematics import (
    channels_of,
    global_transforms,
    local_translations,
    positions,
    skeleton_of,
    with_channels,
)
from motet.motion.motion import Motion, motions_of
from motet.motion.rotations import Array
from motet.motion.skeleton import Skeleton

IMPLIED = "the feet stride while the root stays: models take it with the path that the feet imply"


@dataclass(frozen=True)
class TreadmillSettings:
    """What makes a clip one in place, on the humanoid."""

    room: float = 0.5
    """Metres within which the root stays."""

    share: float = 0.25
    """Largest share of the way of the feet that the root goes itself."""

    speed: float = 0.3
    """Least mean speed of the feet, metres a second."""

    stride: float = 0.15
    """Least standard deviation, in metres, of how far one foot is ahead of the other."""

    hips: float = 0.3
    """Least mean height of the hips over the feet, in metres; a body that lies or crawls has less."""

    span: float = 1.0
    """Seconds over which velocities are averaged, since feet that twist or shuffle go nowhere."""

    least: float = 0.5
    """Seconds of motion at least: in less, one blow or step looks like a stride."""

    calm: float = TREMBLE
    """Seconds, the standard deviation of the window that feet are smoothed by."""

    fps: float = 30.0
    """Frames a second at most: faster clips are examined at this rate."""


STANDARD = TreadmillSettings()
"""Those of all figures."""


def travelling(motion: Motion) -> Motion:
    """The motion, or if it is a clip in place the motion :func:`with_travel` with a TravelWarning.

    ArgumentError for anything but a motion.
    """
    motions_of([motion])
    if not is_in_place(motion):
        return motion
    warn(IMPLIED, TravelWarning)
    return with_travel(motion)


def is_in_place(motion: Motion) -> bool:
    """Whether the feet of a human figure stride while its root stays; False for a figure that is not human, and for a
    motion without a root translation."""
    skeleton = motion.skeleton
    if skeleton is None or not any(name.endswith(".tx") for name in motion.channels):
        return False
    # cheap tests first: most recordings go too far to be in place
    motion = motion.resample(min(motion.fps, STANDARD.fps))
    try:
        if len(motion) < max(3, STANDARD.least * motion.fps) or not _may_be(motion, skeleton):
            return False
        on_humanoid = _on_humanoid(motion)[0]
    except MotionError:
        return False
    return _stays(on_humanoid) and _strides(on_humanoid)


def with_travel(motion: Motion) -> Motion:
    """The motion of a human figure with the path over the ground that its feet imply added to its own, the opposite of
    :func:`motet.motion.in_place`.

    Height, turns and sway stay; the path begins where the motion does. MotionError, with the reason, for a figure that
    is not human.
    """
    motion = with_figure(motion) if is_mmm(motion) else motion
    # the path that the feet of the humanoid lay, beside the one that it has
    on_humanoid, to_file = _on_humanoid(motion)
    root = local_translations(on_humanoid)[:, 0]
    laid_root = local_translations(lay_root_path(on_humanoid))[:, 0]
    path = (laid_root - root + root[:1]) * [1, 0, 1]
    # the same path in the file's world and unit
    root_in_file = local_translations(motion)[:, 0] + path @ to_file
    return with_channels(
        motion,
        channels_of(skeleton_of(motion).names[0], "t"),
        root_in_file,
        ("length",) * 3,
    )


def _may_be(motion: Motion, skeleton: Skeleton) -> bool:
    """Whether a first look, before the figure is measured, leaves it open: most recordings end here."""
    # the root goes too far, as far as an adult's size tells
    unit = skeleton.height / ADULT_HEIGHT
    extents = np.ptp(local_translations(motion), axis=0)
    moving = extents[extents.max(axis=1) > 0]
    if len(moving) and np.hypot(*moving[0, [0, 2]]) > 1.5 * STANDARD.room * unit:  # with y up
        return False
    # or the feet do not move at all
    if not has_feet(skeleton):
        return True
    reach = np.ptp(positions(motion)[:, feet_of(skeleton)], axis=0)
    return bool(np.linalg.norm(reach, axis=1).max() > STANDARD.stride * unit)


def _on_humanoid(motion: Motion) -> tuple[Motion, Array]:
    """The motion on the humanoid, and the matrix (3, 3) that brings its paths to the file's world, as path @ matrix."""
    if motion.skeleton == HUMANOID:
        return motion, np.eye(3)
    humanoid = to_humanoid(motion)
    return humanoid.motion, humanoid.figure.turn * (humanoid.figure.fitted.leg / leg_length())


def _stays(motion: Motion) -> bool:
    """Whether the root of the humanoid stays."""
    root = local_translations(motion)[:, 0]
    return bool(np.hypot(*np.ptp(root[:, [0, 2]], axis=0)) <= STANDARD.room)


def _strides(motion: Motion) -> bool:
    """Whether the feet of the humanoid, which stands, stride further than its root goes."""
    points = sole_points(*global_transforms(motion))
    root = local_translations(motion)[:, 0]

    # the feet are fast, and the root goes less far than they do
    span = STANDARD.span * motion.fps
    foot_velocity = _averaged(_slid(motion, points), span)
    foot_speed = np.linalg.norm(foot_velocity, axis=1)
    root_velocity = _averaged(np.diff(root[:, [0, 2]], axis=0) * motion.fps, span)
    root_way = np.linalg.norm(root_velocity, axis=1).sum()
    if foot_speed.mean() < STANDARD.speed or root_way > STANDARD.share * foot_speed.sum():
        return False

    # by turns one foot is ahead of the other, and the body stands
    direction = foot_velocity / np.maximum(foot_speed, 1e-9)[:, None]
    left, right = _feet_ahead(points, root, direction)
    height = float(root[:, 1].mean() - points[..., 1].mean())
    return _swing_by_turns(left, right) and height >= STANDARD.hips


def _swing_by_turns(left: Array, right: Array) -> bool:
    """Whether feet that are ``left`` and ``right`` (T,) metres ahead of the root stride widely, each while the other
    goes back."""
    # the feet are apart, and one goes forward while the other goes back
    is_wide = (left - right).std() >= STANDARD.stride
    is_opposite = (left - left.mean()) @ (right - right.mean()) < 0
    return bool(is_wide and is_opposite)


def _feet_ahead(points: Array, root: Array, direction: Array) -> Array:
    """How far feet are ahead of the root (T, 3) along directions (T - 1, 2), from the second frame on (2, T - 1): the
    means of points (T, P, 3) of both soles."""
    by_foot = (points - root[:, None])[1:].reshape(-1, 2, len(points[0]) // 2, 3)
    return np.asarray(np.einsum("tfa,ta->ft", by_foot.mean(axis=2)[..., [0, 2]], direction))


def _slid(motion: Motion, points: Array) -> Array:
    """The velocity (T - 1, 2) in m/s that would keep points (T, P, 3) of the humanoid's soles from sliding."""
    # over the ground, without the trembling of recorded feet
    plane = smoothed(points[..., [0, 2]], STANDARD.calm, motion.fps)
    return velocity_by_feet(plane, points[..., 1] - ground_under(points), motion.fps)


def _averaged(velocity: Array, frames: float) -> Array:
    """Velocities (T, 2), each the mean over a window of that many frames around it, cut off at the ends."""
    # a sum over the window, divided by the number of frames that it has there
    window = np.ones(max(1, min(round(frames), len(velocity))))
    count = np.convolve(np.ones(len(velocity)), window, "same")
    return np.stack([np.convolve(column, window, "same") / count for column in velocity.T], axis=1)
