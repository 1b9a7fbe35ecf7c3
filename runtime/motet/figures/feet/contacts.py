"""Which feet stand: the one definition used for planting and holding feet and for measuring foot sliding; and the root
translation that follows from it.

A point of a foot stands if it is low and slow. Only the bounds depend on the points and the source of the motion.

A foot that carries weight stays in place, so the root moves against it. Every point of the feet votes for a velocity; a
vote counts more the nearer its point is to the ground and the better it agrees with others around it in time: robust
regression by iteratively reweighted least squares (Beaton and Tukey 1974). Votes that are too slow count less, because
the joints of a foot rolling from heel to toe do move forward. Between steps of a run nothing agrees, and the velocity
of the last and the next step carries through. Where the root falls faster than gravity while the lowest point of the
feet is held at the ground, the figure has jumped, and flies along a parabola until its feet reach the ground again.

On level ground with feet that do not slide, in 42 of CMU's trials that had no part in the choice of the constants, the
end is off by 5 % of the path on average in walking (at most 8) and by 6 % in running (at most 15, in a leap), nearly
always too near. Stairs, sitting, lying and walking on hands are beyond it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from motet.errors import MotionError
from motet.motion.kinematics import channels_of, positions, skeleton_of, with_channels
from motet.motion.motion import Motion
from motet.motion.rotations import Array, Mask
from motet.motion.skeleton import Skeleton, partners_of

GROUND_PERCENT = 10
"""Percentage of frames whose lowest point of the feet is below ground."""

VOTING_HEIGHT = 0.07
"""Metres above the ground from which on a point has no vote on where the root goes."""

VOTE_DECAY_SECONDS = 0.05
"""Seconds by which votes apart in time count e times less for each other."""
VOTING_SECONDS = 1.0
"""Seconds beyond which votes do not count for each other."""

ALLOWED = (3 * 0.2, 0.2)
"""Metres a second by which a vote may be off before it counts a quarter: one that is too fast, one that is too slow."""

REWEIGHTINGS = 10
"""Rounds of reweighting: later ones change nothing that is seen."""

TREMBLE = 0.015
"""Seconds, the standard deviation of the window that removes the noise of recorded feet."""


GRAVITY = 9.81
"""Metres per second squared."""

RISE_SPAN = 0.05
"""Seconds over which the upward velocity is measured with which a flight begins."""

ADULT_HEIGHT = 1.7
"""Metres of a figure whose length unit is unknown: those of an adult."""


@dataclass(frozen=True)
class ContactSettings:
    """Up to the first bound a point surely stands, from the second it does not at all; equal bounds are a threshold."""

    heights: tuple[float, float] = (0.02, 0.05)
    """Metres above the ground."""

    speeds: tuple[float, float] = (0.3, 0.9)
    """Metres a second over the ground."""

    calm: float = TREMBLE
    """Seconds, the standard deviation of the window that a speed is smoothed by."""


SOLES = ContactSettings()
"""For the points of soles."""

TREMBLING = ContactSettings(speeds=(0.7, 3.0), calm=0.06)
"""For soles that tremble and slide, as of models that output only joint angles: contact is measured over a longer time,
and may slide faster."""


def contacts(heights: Array, speeds: Array | None, settings: ContactSettings) -> Array:
    """Ground contact of points, 0 to 1, from heights in m and speeds in m/s of one shape, None if only heights
    count."""
    low = 1 - rise(heights, *settings.heights)
    return low if speeds is None else low * (1 - rise(speeds, *settings.speeds))


def standing(heights: Array, speeds: Array | None, settings: ContactSettings) -> Mask:
    """Which points surely stand, as in :func:`contacts`."""
    return np.equal(contacts(heights, speeds, settings), 1)


def contacts_of(points: Array, fps: float, settings: ContactSettings = SOLES) -> Array:
    """Contact of points (T, K, 3), over ground at 0, from each frame to the next, (T - 1, K) from 0 to 1."""
    calm = smoothed(points, settings.calm, fps)
    return contacts((points[1:, :, 1] + points[:-1, :, 1]) / 2, ground_speeds(calm, fps), settings)


def ground_speeds(points: Array, fps: float) -> Array:
    """Speeds (..., T - 1, K) over the ground of points (..., T, K, 3), per frame."""
    return np.asarray(np.linalg.norm(np.diff(points[..., [0, 2]], axis=-3), axis=-1) * fps)


def rise(values: Array, start: float, end: float) -> Array:
    """Smoothly from 0 at ``start`` to 1 at ``end`` (Perlin's "smootherstep", 2002)."""
    # no division by 0 where start and end are the same: a threshold
    part = np.clip((values - start) / max(end - start, 1e-12), 0, 1)
    return part**3 * (10 - 15 * part + 6 * part**2)


def smoothed(points: Array, calm: float, fps: float) -> Array:
    """Points (T, ..., ...) smoothed by a Gaussian window of ``calm`` seconds deviation, extrapolated at both ends."""
    reach = round(3 * calm * fps)
    if len(points) < 2 or not reach:
        return points
    window = np.exp(-0.5 * (np.arange(-reach, reach + 1) / (calm * fps)) ** 2)
    weights = window / window.sum()
    # beyond the ends the points go on as their mirror images in them
    padded = np.pad(points, ((reach, reach), (0, 0), (0, 0)), mode="reflect", reflect_type="odd")
    return np.asarray(sum(weight * padded[i : i + len(points)] for i, weight in enumerate(weights)))


def windows(values: Array, reach: int) -> Array:
    """For each of the values (T,) those from ``reach`` before to ``reach`` after it, (T, 2 reach + 1); the first and
    last value are repeated beyond the ends."""
    return np.lib.stride_tricks.sliding_window_view(np.pad(values, reach, mode="edge"), 2 * reach + 1)


def bell(reach: int) -> Array:
    """Weights (2 reach + 1,) of a window that fades to both sides, which sum up to 1 (Hann)."""
    weights = np.hanning(2 * reach + 3)[1:-1]
    return np.asarray(weights / weights.sum())


def feet_of(skeleton: Skeleton) -> list[int]:
    """Indices of the joints of both feet, the low ones at rest; MotionError if no joints are paired."""
    if not has_feet(skeleton):
        raise MotionError("no left-right pairs of joints to find the feet among: name the joints of the feet")
    paired = _paired(skeleton)
    height = skeleton.rest_positions[:, 1]
    # joints of the feet are within a tenth of the figure's height
    return [i for i in paired if height[i] <= height[paired].min() + 0.1 * skeleton.height]


def has_feet(skeleton: Skeleton) -> bool:
    """Whether there are left-right pairs of joints to find the feet among."""
    return bool(_paired(skeleton))


def _paired(skeleton: Skeleton) -> list[int]:
    return [i for i, partner in enumerate(partners_of(skeleton.names)) if partner != i]


def ground_of(heights: Array) -> float:
    """The height of the ground under feet at ``heights`` (T, K)."""
    return float(np.percentile(heights.min(axis=1), GROUND_PERCENT))


def lay_root_path(
    motion: Motion,
    feet: tuple[Sequence[str], Sequence[str]] | None = None,
    tremble: float = TREMBLE,
) -> Motion:
    """The motion with root channels tx, ty, tz in "length" units, derived from the feet's contact with the ground.

    The path begins at x = z = 0; y is such that the lowest joint of the feet touches the ground, y = 0, within
    millimetres, but in flight. A translation that the motion has already is replaced.
    feet: the names of the joints of each foot, toes included; by default the lowest left-right pairs of joints.
        MotionError for a motion without skeleton or without such joints.
    tremble: seconds over which the feet are smoothed, by default 0.015 s; recorded motions need little, generated ones
        0.06 s, and 0 smooths nothing.
    """
    if not 0 <= tremble < np.inf:
        raise MotionError(f"the smoothing time of feet must be 0 or more seconds, not {tremble}")
    skeleton = skeleton_of(motion)
    joints = feet_of(skeleton) if feet is None else [skeleton.index(name) for name in (*feet[0], *feet[1])]
    metres = _metres_per_unit(skeleton)
    places = positions(motion)
    points_from_root = (places[:, joints] - places[:, :1]) * metres

    # the height of the root puts the lowest joint on the ground, but in jumps
    height = _height_with_flight(-points_from_root[..., 1].min(axis=1), motion.fps)

    # over the ground, the root moves against the feet that stand
    plane = smoothed(points_from_root[..., [0, 2]], tremble, motion.fps)
    velocity = velocity_by_feet(plane, points_from_root[..., 1] + height[:, None], motion.fps)
    return led_along(motion, velocity, height, metres)


def _metres_per_unit(skeleton: Skeleton) -> float:
    """Of a skeleton that does not say it those that make it an adult; MotionError where it has no height."""
    if skeleton.height <= 0:
        raise MotionError("the skeleton has no height: all its joints are at one place")
    return skeleton.metres_per_unit or ADULT_HEIGHT / skeleton.height


def _height_with_flight(standing: Array, fps: float) -> Array:
    """Heights (T,) of the root in metres, smoothed, from those (T,) at which the feet are on the ground."""
    # a jump up forward in time is a fall backward: only frames on which both agree are flight
    forward = _with_flight(standing, fps)
    backward = _with_flight(standing[::-1], fps)[::-1]
    return smoothed(np.minimum(forward, backward)[:, None, None], TREMBLE, fps)[:, 0, 0]


def led_along(motion: Motion, velocity: Array, height: Array, metres: float) -> Motion:
    """The motion with its root led by velocities (T - 1, 2) in m/s, from x = z = 0, at heights (T,) in m."""
    # velocities add up over the ground, and the height is as it is
    path = np.zeros((len(motion), 3))
    path[1:, [0, 2]] = np.cumsum(velocity, axis=0) / motion.fps
    path[:, 1] = height
    return with_channels(
        motion,
        channels_of(skeleton_of(motion).names[0], "t"),
        path / metres,
        ("length",) * 3,
    )


def _with_flight(standing: Array, fps: float) -> Array:
    """Heights (T,) of the root in metres, from those at which the feet are on the ground, where it falls freely."""
    heights = standing.tolist()
    speed = 0.0
    span = max(1, round(RISE_SPAN * fps))
    for t in range(1, len(heights)):
        falling = heights[t - 1] + speed / fps - 0.5 * GRAVITY / fps**2
        if falling > heights[t]:
            # in flight: the feet would have to go down faster than it falls
            heights[t] = falling
            speed -= GRAVITY / fps
        else:
            # on the ground, where the next flight begins with the speed of the last frames
            start = max(0, t - span)
            speed = (heights[t] - heights[start]) * fps / (t - start)
    return np.array(heights)


def velocity_by_feet(
    points: Array,
    above: Array,
    fps: float,
    guess: Array | float = 0.0,
    trust: float = 1e-12,
) -> Array:
    """Velocity (T - 1, 2) in m/s of the root, from points of the feet (T, K, 2) and their heights (T, K).

    guess: (T - 1, 2) in m/s, a vote of weight ``trust`` that always counts.
    """
    if len(points) < 2:
        return np.zeros((0, 2))
    # each point votes for the velocity that keeps it in place; a vote counts less the higher its point is
    votes = -np.diff(points, axis=0) * fps
    heights = (above[1:] + above[:-1]) / 2
    nearness = contacts(heights, None, ContactSettings(heights=(0.0, VOTING_HEIGHT)))

    # and votes count less for each other the farther apart in time they are
    reach = round(VOTING_SECONDS * fps)
    window = np.exp(-np.abs(np.arange(-reach, reach + 1)) / (VOTE_DECAY_SECONDS * fps))

    # the mean of all votes first, then means in which votes count less that disagree with the mean before
    velocity = _mean_vote(votes, nearness, window, trust, guess)
    for _ in range(REWEIGHTINGS):
        velocity = _mean_vote(votes, nearness / _disagreement(votes, velocity), window, trust, guess)
    return velocity


def _disagreement(votes: Array, velocity: Array) -> Array:
    """By how much the weights (T, K) of votes (T, K, 2) are divided, 1 or more, the more they differ from a velocity
    (T, 2): Tukey's biweight, without its end (Beaton and Tukey 1974)."""
    off = votes - velocity[:, None]
    is_faster = (off * velocity[:, None]).sum(axis=-1) > 0
    allowed = np.where(is_faster, *ALLOWED)
    return np.asarray((1 + (off**2).sum(axis=-1) / allowed**2) ** 2)


def _mean_vote(votes: Array, weights: Array, window: Array, trust: float, guess: Array | float) -> Array:
    """The mean (T, 2) over points and a window in time of votes (T, K, 2) with weights (T, K); without any vote within
    reach, the guess."""
    reach = len(window) // 2
    # sums over the points first, of the weights and of the weighted votes, then over the window
    columns = [
        weights.sum(axis=1),
        *np.moveaxis((weights[..., None] * votes).sum(axis=1), 1, 0),
    ]
    total, x, z = (np.convolve(column, window)[reach : reach + len(votes)] for column in columns)
    return (np.stack([x, z], axis=1) + trust * guess) / (total + trust)[:, None]
