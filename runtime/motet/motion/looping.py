"""Loops: the part of a motion that repeats seamlessly, as game engines need for walks and runs.

A loop begins and ends with the same pose, ignoring position and heading, at the same velocity. All pairs of frames are
compared by the root mean square over the joints; of loops nearly as good, such as one, two and three strides, the
longest is taken. A part in which the figure hardly moves beside the rest is none: a pause repeats best, and shows
nothing. The remaining difference is spread over the loop: rotations by rotation vectors, all else linearly.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from motet.errors import MotionError
from motet.motion.kinematics import (
    channels_of,
    global_transforms,
    local_rotations,
    local_translations,
    posed,
    skeleton_of,
)
from motet.motion.motion import TURN, Motion
from motet.motion.rotations import (
    UP,
    Array,
    inverse,
    product,
    rotated,
    rotmat_to_rotvec,
    rotvec_to_rotmat,
    twist,
)

FARTHEST_ENDS = 0.04
"""Largest difference of a loop's ends, as a share of the figure's height. Of 40 recorded walks, on the humanoid at 30
fps, nine in ten repeat within 0.03 of the height, steady strides within 0.01 to 0.02; half of the running takes, which
are short and turn or leap, repeat only within 0.06."""


def looped(motion: Motion, shortest: float = 0.7) -> Motion:
    """The part of the motion that can be repeated: its last frame is one frame before its first pose in every joint.

    Position and heading advance by the same amount in each repetition.
    shortest: minimum length of the loop in seconds. MotionError for a motion without a skeleton, one that is too short,
    and one without a repetition.
    """
    skeleton = skeleton_of(motion)
    hips = _hips(motion)
    start, stop = _repetition(motion, hips, shortest)
    part = motion[start : stop + 1]
    # a share from -1/2 to 1/2 of the difference of the ends is taken off, so that both ends change equally
    share = np.linspace(-0.5, 0.5, len(part))[:, None]
    world = global_transforms(part)[0]
    above = world[:, skeleton.parents[hips]] if hips else np.broadcast_to(np.eye(3), world[:, 0].shape)

    # joints with all three angles turn; all other channels change by their differences, but those of the hips' path
    rotations = _closed_rotations(part, hips, world[:, hips], above, share)
    hips_name = skeleton.names[hips]
    closed = replace(part, values=part.values - share * _difference(part, hips_name, rotations))
    return posed(closed, rotations, {hips_name: _level_translation(part, hips, above, share)})[:-1]


def _level_translation(part: Motion, hips: int, above: Array, share: Array) -> Array:
    """Translations (T, 3) of the hips that end at the height at which they begin, as :func:`_closed_rotations`."""
    translation = local_translations(part)[:, hips]
    height = rotated(above, translation)[:, 1:2]
    rise = rotated(inverse(above), share * (height[-1] - height[0]) * UP)
    return translation - rise


def _closed_rotations(part: Motion, hips: int, hips_world: Array, above: Array, share: Array) -> dict[str, Array]:
    """By joint local rotations (T, 3, 3) that end as they begin, of joints with all three angles.

    hips_world, above: rotations (T, 3, 3) in the world of the hips and of the joint above. share: (T, 1), the part of
    the difference of the ends that is taken off in each frame.
    """
    local = local_rotations(part)
    columns = part.rotation_columns()
    rotations = {}
    for i, name in enumerate(skeleton_of(part).names):
        if len(columns.get(name, ())) != 3:
            continue
        if i == hips:  # the heading stays: only the tilt of the hips is made to repeat
            heading = twist(hips_world, UP)
            tilt = _closed(product(inverse(heading), hips_world), share)
            rotations[name] = product(inverse(above), product(heading, tilt))
        else:
            rotations[name] = _closed(local[:, i], share)
    return rotations


def _difference(part: Motion, hips: str, turning: Iterable[str]) -> Array:
    """How much each channel (D,) differs at the end from the beginning, up to whole turns; 0 for the path and heading
    of the hips and the angles of joints that turn."""
    # angles that differ by whole turns do not differ
    turns = np.array([TURN.get(unit, np.inf) for unit in part.units])
    difference: Array = part.values[-1] - part.values[0]
    angles = np.isfinite(turns)
    difference[angles] -= np.round(difference[angles] / turns[angles]) * turns[angles]
    left_open = {*channels_of(hips, "t"), f"{hips}.ry"}
    for name in turning:
        left_open.update(channels_of(name, "r"))
    difference[[name in left_open for name in part.channels]] = 0
    return difference


def _hips(motion: Motion) -> int:
    """The joint that carries the others: the first that moves, since some figures' hips are below a static root."""
    moving = np.ptp(motion.values, axis=0) > 1e-9 if len(motion) else []
    names = {name.rpartition(".")[0] for name, moves in zip(motion.channels, moving, strict=False) if moves}
    return next((i for i, name in enumerate(skeleton_of(motion).names) if name in names), 0)


def _closed(rotations: Array, share: Array) -> Array:
    """Rotations (T, 3, 3) adjusted by a share (T, 1) of the difference so that the last equals the first."""
    # the turn from the last to the first, of which each frame takes its share
    difference = rotmat_to_rotvec(product(rotations[:1], inverse(rotations[-1:])))
    return product(rotvec_to_rotmat(share * difference), rotations)


def _repetition(motion: Motion, hips: int, shortest: float) -> tuple[int, int]:
    """The first frame of the loop and the frame that repeats it."""
    if not 0 < shortest < np.inf:
        raise MotionError(f"a loop must be longer than 0 seconds, not {shortest}")
    least = max(1, int(np.ceil(shortest * motion.fps - 1e-9)))
    if len(motion) <= least:
        raise MotionError(
            f"a motion of {motion.duration:.2g} s is too short for a loop of {shortest:g} s: use a longer one"
        )
    # first among every few frames, then among all frames near the best pair
    poses = _poses(motion, hips)
    # at most 1500 frames are compared pairwise: of longer motions every second or third
    step = -(-len(motion) // 1500)
    start, stop = _coarse_repetition(poses, least, step)
    start, stop = _nearest_pair(poses, start, stop, least, step)
    difference = float(np.linalg.norm(poses[start] - poses[stop]))
    if difference > FARTHEST_ENDS:
        raise MotionError(
            f"no loop found: the closest pair, {start / motion.fps:.2f} s and {stop / motion.fps:.2f} s, differs by "
            f"{difference:.1%} of the figure's height, more than {FARTHEST_ENDS:.0%}; cut the motion to repeating "
            f"parts, or use a longer one of two strides or more"
        )
    return start, stop


def _coarse_repetition(poses: Array, least: int, step: int) -> tuple[int, int]:
    """The first and last frame of the longest loop nearly as good as the best, among every ``step``-th frame."""
    # for each length of a loop the best difference of its ends, where the loop is lively
    lengths = range(-(-least // step), -(-len(poses) // step))
    distances = _distances(poses[::step], poses[::step])
    energy = _energy(poses)[::step]
    by_start = []
    for length in lengths:
        # a loop has at least 0.6 of the mean energy of the whole motion
        is_lively = _means(energy, length) >= 0.6
        by_start.append(np.where(is_lively, distances.diagonal(length), np.inf))
    best = np.array([values.min() for values in by_start])

    longest = _longest_of_best(best)
    start = int(by_start[longest].argmin()) * step
    return start, start + lengths[longest] * step


def _longest_of_best(best: Array) -> int:
    """Of lengths with the best differences (L,) of ends the index of the longest that is nearly as good as the best.

    Nearly is 1.25 times the best difference, or 0.01 of the height, the variation of a steady walk. It is better than
    those beside it; the ends do not count as minima.
    """
    is_minimum = np.zeros(len(best), dtype=bool)
    is_minimum[1:-1] = (best[1:-1] <= best[:-2]) & (best[1:-1] <= best[2:])
    is_minimum[best.argmin()] = True
    return int(np.flatnonzero(is_minimum & (best <= max(1.25 * best.min(), 0.01)))[-1])


def _nearest_pair(poses: Array, start: int, stop: int, least: int, step: int) -> tuple[int, int]:
    """The two frames with the nearest poses less than ``step`` frames from two frames, at least ``least`` apart."""
    first = np.arange(max(0, start - step + 1), min(len(poses), start + step))
    last = np.arange(max(0, stop - step + 1), min(len(poses), stop + step))
    is_long = last - first[:, None] >= least
    distances = np.where(is_long, _distances(poses[first], poses[last]), np.inf)
    i, j = np.unravel_index(distances.argmin(), distances.shape)
    return int(first[i]), int(last[j])


def _energy(poses: Array) -> Array:
    """The squared speed (T,) of rows as :func:`_poses` makes them, relative to its mean."""
    speeds = poses[:, poses.shape[1] // 2 :]
    squares = (speeds**2).sum(axis=1)
    return np.asarray(squares / max(float(squares.mean()), 1e-12))


def _means(values: Array, length: int) -> Array:
    """The means (T - length,) of ``length`` values each of (T,)."""
    sums = np.cumsum(np.insert(values, 0, 0.0))
    return (sums[length:-1] - sums[: -length - 1]) / length


def _distances(rows: Array, others: Array) -> Array:
    """Distances (T, S) between rows (T, D) and others (S, D)."""
    squares = (rows**2).sum(axis=1)[:, None] + (others**2).sum(axis=1) - 2 * rows @ others.T
    return np.asarray(np.sqrt(np.maximum(squares, 0)))


def _poses(motion: Motion, hips: int) -> Array:
    """Rows (T, D) of joints' positions and velocities seen from the hips without their heading: their distance is the
    root mean square over the joints, as a share of the figure's height.
    """
    skeleton = skeleton_of(motion)
    # seen from the hips: position and heading do not count
    rotations, places = global_transforms(motion)
    to_facing = inverse(twist(rotations[:, hips], UP))[:, None]
    ground = places[:, [hips]] * (1 - UP)
    places = places[:, skeleton.below(hips)]
    # velocities count by how far they diverge in a tenth of a second
    velocities = np.gradient(places, axis=0, edge_order=2 if len(motion) > 2 else 1) * motion.fps * 0.1
    points = np.concatenate([rotated(to_facing, places - ground), rotated(to_facing, velocities)], axis=1)
    return np.asarray(points.reshape(len(motion), -1) / (np.sqrt(places.shape[1]) * skeleton.height))
