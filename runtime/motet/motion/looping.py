"""Loops: the part of a motion that repeats seamlessly, as game engines need for walks and runs.

A loop begins and ends with the same pose, ignoring position and heading, at the same velocity. All pairs of frames are
compared by the root mean square over the joints; of loops nearly as good, such as one, two and three strides, the
longest is taken. A part in which the figure hardly moves beside the rest is none: a pause repeats best, and shows
nothing. The remaining difference is spread over the loop: rotations by rotation vectors, all else linearly.
"""

from dataclasses import replace

import numpy as np

from motet.errors import MotionError
from motet.motion.kinematics import AXES, global_transforms, local_rotations, local_translations, posed, skeleton_of
from motet.motion.motion import TURN, Motion
from motet.motion.rotations import UP, Array, inverse, product, rotated, rotmat_to_rotvec, rotvec_to_rotmat, twist

LIVELY = 0.6
"""Least energy of a loop beside the mean of the whole motion's."""


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
    turned = global_transforms(part)[0]
    local = local_rotations(part)
    moved = local_translations(part)[:, hips]
    above = turned[:, skeleton.joints[hips].parent] if hips else np.broadcast_to(np.eye(3), turned[:, 0].shape)
    heading = twist(turned[:, hips], UP)
    # joints with all three angles turn, by a share from -1/2 to 1/2 of what is left, so that both ends change equally
    columns = part.rotation_columns()
    share = np.linspace(-0.5, 0.5, len(part))[:, None]
    whole = [i for i, name in enumerate(skeleton.names) if len(columns.get(name, ())) == 3]
    rotations = {skeleton.names[i]: _closed(local[:, i], share) for i in whole if i != hips}
    if hips in whole:  # the heading stays: only the tilt of the hips is made to repeat
        own = product(heading, _closed(product(inverse(heading), turned[:, hips]), share))
        rotations[skeleton.names[hips]] = product(inverse(above), own)
    height = rotated(above, moved)[:, 1:2]
    risen = rotated(inverse(above), share * (height[-1] - height[0]) * UP)
    # other channels end as they begin, up to whole turns
    stay = {f"{name}.r{axis}" for name in rotations for axis in AXES}
    stay |= {f"{skeleton.names[hips]}.{kind}" for kind in ("tx", "ty", "tz", "ry")}
    turns = np.array([TURN.get(unit, np.inf) for unit in part.units])
    off = part.values[-1] - part.values[0]
    angles = np.isfinite(turns)
    off[angles] -= np.round(off[angles] / turns[angles]) * turns[angles]
    off[[name in stay for name in part.channels]] = 0
    closed = replace(part, values=part.values - share * off)
    return posed(closed, rotations, {skeleton.names[hips]: moved - risen})[:-1]


def _hips(motion: Motion) -> int:
    """The joint that carries the others: the first that moves, since some figures' hips are below a static root."""
    moving = np.ptp(motion.values, axis=0) > 1e-9 if len(motion) else []
    names = {name.rpartition(".")[0] for name, moves in zip(motion.channels, moving, strict=False) if moves}
    return next((i for i, name in enumerate(skeleton_of(motion).names) if name in names), 0)


def _closed(rotations: Array, share: Array) -> Array:
    """Rotations (T, 3, 3) adjusted, by a share (T, 1) of what is left, so that the last equals the first."""
    off = rotmat_to_rotvec(product(rotations[:1], inverse(rotations[-1:])))
    return product(rotvec_to_rotmat(share * off), rotations)


def _repetition(motion: Motion, hips: int, shortest: float) -> tuple[int, int]:
    """The first frame of the loop and the one that repeats it."""
    if not 0 < shortest < np.inf:
        raise MotionError(f"a loop must be longer than 0 seconds, not {shortest}")
    least = max(1, int(np.ceil(shortest * motion.fps - 1e-9)))
    if len(motion) <= least:
        raise MotionError(
            f"a motion of {motion.duration:.2g} s is too short for a loop of {shortest:g} s: use a longer one"
        )
    # at most 1,500 frames are compared pairwise: in longer motions every second or third, then those in between
    seen = _seen(motion, hips)
    step = -(-len(motion) // 1500)
    lengths = range(-(-least // step), -(-len(motion) // step))
    apart = _apart(seen[::step], seen[::step])
    energy = _energy(seen)[::step]
    along = [np.where(_means(energy, length) >= LIVELY, apart.diagonal(length), np.inf) for length in lengths]
    best = np.array([each.min() for each in along])
    low = np.zeros(len(best), dtype=bool)  # the ends do not count as minima
    low[1:-1] = (best[1:-1] <= best[:-2]) & (best[1:-1] <= best[2:])
    low[best.argmin()] = True
    # nearly as good: 1.25 times the best difference, or .01 of the height, the variation of a steady walk
    length = int(np.flatnonzero(low & (best <= max(1.25 * best.min(), 0.01)))[-1])
    start = int(along[length].argmin()) * step
    ends = (start, start + lengths[length] * step)
    first, last = (np.arange(max(0, at - step + 1), min(len(seen), at + step)) for at in ends)
    apart = np.where(last - first[:, None] >= least, _apart(seen[first], seen[last]), np.inf)
    i, j = np.unravel_index(apart.argmin(), apart.shape)
    start = int(first[i])
    stop = int(last[j])
    off = float(np.linalg.norm(seen[start] - seen[stop]))
    most = 0.04
    # of 40 recorded walks, on the humanoid at 30 fps, nine in ten repeat within 0.03 of the height, steady strides
    # within 0.01 to 0.02; half of the running takes, which are short and turn or leap, repeat only within 0.06
    if off > most:
        raise MotionError(
            f"no loop found: the closest pair, {start / motion.fps:.2f} s and {stop / motion.fps:.2f} s, differs by "
            f"{off:.1%} of the figure's height, more than {most:.0%}; cut the motion to repeating parts, or use a "
            f"longer one of two strides or more"
        )
    return start, stop


def _energy(seen: Array) -> Array:
    """The squared speed (T,) of rows as :func:`_seen` gives them, beside its mean."""
    speeds = seen[:, seen.shape[1] // 2 :]
    squares = (speeds**2).sum(axis=1)
    found: Array = squares / max(float(squares.mean()), 1e-12)
    return found


def _means(values: Array, length: int) -> Array:
    """The means (T - length,) of ``length`` values each of (T,)."""
    sums = np.cumsum(np.insert(values, 0, 0.0))
    found: Array = (sums[length:-1] - sums[: -length - 1]) / length
    return found


def _apart(one: Array, other: Array) -> Array:
    """Distances (T, S) between rows (T, D) and rows (S, D)."""
    squares = (one**2).sum(axis=1)[:, None] + (other**2).sum(axis=1) - 2 * one @ other.T
    found: Array = np.sqrt(np.maximum(squares, 0))
    return found


def _seen(motion: Motion, hips: int) -> Array:
    """Rows (T, D) of joints' positions and velocities seen from the hips without their heading: their distance is the
    root mean square over the joints, as a share of the figure's height.
    """
    skeleton, (turned, places) = skeleton_of(motion), global_transforms(motion)
    facing = inverse(twist(turned[:, hips], UP))[:, None]
    ground = places[:, [hips]] * (1 - UP)
    places = places[:, skeleton.subtree(skeleton.names[hips])]
    # velocities count by how far they diverge in .1 s
    moved = np.gradient(places, axis=0, edge_order=2 if len(motion) > 2 else 1) * motion.fps * 0.1
    points = np.concatenate([rotated(facing, places - ground), rotated(facing, moved)], axis=1)
    found: Array = points.reshape(len(motion), -1) / (np.sqrt(places.shape[1]) * skeleton.height)
    return found
