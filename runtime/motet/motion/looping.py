"""Loops: the part of a motion that repeats seamlessly, as game engines need for walks and runs.

A loop begins and ends with the same pose, ignoring position and heading, at the same velocity. All pairs of frames are
compared by the root mean square over the joints; of loops nearly as good, such as one, two and three strides, the
longest is taken. The remaining difference is spread over the loop: rotations by rotation vectors, all else linearly.
"""

from dataclasses import replace

import numpy as np

from motet.errors import MotionError
from motet.motion.kinematics import AXES, global_transforms, local_rotations, local_translations, posed, skeleton_of
from motet.motion.motion import TURN, Motion
from motet.motion.rotations import UP, Array, inverse, product, rotated, rotmat_to_rotvec, rotvec_to_rotmat, twist

REPEATS_WITHIN = 0.04
"""Share of the figure's height: frames that differ by more do not match. Of 40 recorded walks, on the humanoid at 30
fps, nine in ten repeat within 0.03, steady strides within 0.01 to 0.02; the best match in a bend, CMU's 02_06, differs
by 0.08, and half of the running takes, which are short and turn or leap, repeat only within 0.06."""


def looped(motion: Motion, shortest: float = 0.7) -> Motion:
    """The part of the motion that can be repeated: its last frame is one frame before its first pose in every joint.

    Position and heading advance by the same amount in each repetition.
    shortest: minimum length of the loop in seconds. MotionError for a motion without a skeleton, one that is too short,
    and one without a repetition.
    """
    start, stop = _repetition(motion, shortest)
    part = motion[start : stop + 1]
    skeleton, carrier = skeleton_of(part), _carrier(motion)
    turned, local = global_transforms(part)[0], local_rotations(part)
    above = turned[:, skeleton.joints[carrier].parent] if carrier else np.broadcast_to(np.eye(3), turned[:, 0].shape)
    heading = twist(turned[:, carrier], UP)
    # the heading stays: only the tilt of the hips is made to repeat
    own = product(heading, _closed(product(inverse(heading), turned[:, carrier])))
    rotations = {
        skeleton.names[i]: product(inverse(above), own) if i == carrier else _closed(local[:, i])
        for i in map(skeleton.index, _whole(part))
    }
    moved = local_translations(part)[:, carrier]
    risen = rotated(inverse(above), _drift(rotated(above, moved)[:, 1:2]) * UP)
    name = skeleton.names[carrier]
    return posed(_closed_channels(part, name), rotations, {name: moved - risen})[:-1]


def _repetition(motion: Motion, shortest: float) -> tuple[int, int]:
    """The first frame of the loop and the one that repeats it."""
    least = max(1, int(np.ceil(shortest * motion.fps - 1e-9))) if 0 < shortest < np.inf else 0
    if not least:
        raise MotionError(f"a loop must be longer than 0 seconds, not {shortest}")
    if len(motion) <= least:
        raise MotionError(
            f"a motion of {motion.duration:.2g} s is too short for a loop of {shortest:g} s: use a longer one"
        )
    # at most 1,500 frames are compared pairwise: in longer motions every second or third, then those in between
    seen, step = _seen(motion), -(-len(motion) // 1500)
    lengths = np.arange(-(-least // step), -(-len(motion) // step))
    apart = _apart(seen[::step], seen[::step])
    along = [apart.diagonal(length) for length in lengths]
    length = _longest_of_the_best(np.array([each.min() for each in along]))
    start = int(along[length].argmin()) * step
    start, stop, off = _refined(seen, start, start + int(lengths[length]) * step, step - 1, least)
    if off > REPEATS_WITHIN:
        raise MotionError(
            f"no loop found: the closest pair, {start / motion.fps:.2f} s and {stop / motion.fps:.2f} s, differs by "
            f"{off:.1%} of the figure's height, more than {REPEATS_WITHIN:.0%}; cut the motion to repeating parts, or "
            f"use a longer one of two strides or more"
        )
    return start, stop


def _longest_of_the_best(off: Array) -> int:
    """The last of the minima nearly as low as the lowest; the ends do not count as minima."""
    low = np.zeros(len(off), dtype=bool)
    low[1:-1] = (off[1:-1] <= off[:-2]) & (off[1:-1] <= off[2:])
    low[off.argmin()] = True
    # nearly as good: 1.25 times the best difference, or .01 of the height, the variation of a steady walk
    return int(np.flatnonzero(low & (off <= max(1.25 * off.min(), 0.01)))[-1])


def _refined(seen: Array, start: int, stop: int, reach: int, least: int) -> tuple[int, int, float]:
    """The two frames within ``reach`` frames that differ least, and by how much."""
    first, last = (np.arange(max(0, at - reach), min(len(seen), at + reach + 1)) for at in (start, stop))
    apart = np.where(last - first[:, None] >= least, _apart(seen[first], seen[last]), np.inf)
    i, j = np.unravel_index(apart.argmin(), apart.shape)
    return int(first[i]), int(last[j]), float(np.linalg.norm(seen[first[i]] - seen[last[j]]))


def _apart(one: Array, other: Array) -> Array:
    """Distances (T, S) between rows (T, D) and rows (S, D)."""
    squares = (one**2).sum(axis=1)[:, None] + (other**2).sum(axis=1) - 2 * one @ other.T
    found: Array = np.sqrt(np.maximum(squares, 0))
    return found


def _seen(motion: Motion) -> Array:
    """Positions and velocities of joints (T, D), relative to the hips without their heading: the distance of two rows
    is the root mean square over the joints, as a share of the figure's height."""
    skeleton, carrier, (turned, places) = skeleton_of(motion), _carrier(motion), global_transforms(motion)
    facing = inverse(twist(turned[:, carrier], UP))[:, None]
    ground = places[:, [carrier]] * (1 - UP)
    places = places[:, skeleton.subtree(skeleton.names[carrier])]
    # velocities count by how far they diverge in .1 s
    moved = np.gradient(places, axis=0, edge_order=2 if len(motion) > 2 else 1) * motion.fps * 0.1
    points = np.concatenate([rotated(facing, places - ground), rotated(facing, moved)], axis=1)
    found: Array = points.reshape(len(motion), -1) / (np.sqrt(places.shape[1]) * skeleton.height)
    return found


def _carrier(motion: Motion) -> int:
    """The joint that carries the others: the first that moves, since some figures' hips are below a static root."""
    moving = np.ptp(motion.values, axis=0) > 1e-9 if len(motion) else []
    names = {name.rpartition(".")[0] for name, moves in zip(motion.channels, moving, strict=False) if moves}
    return next((i for i, name in enumerate(skeleton_of(motion).names) if name in names), 0)


def _whole(motion: Motion) -> list[str]:
    """The joints with all three angles."""
    places = skeleton_of(motion).places
    return [name for name, columns in motion.rotation_columns().items() if len(columns) == 3 and name in places]


def _closed(rotations: Array) -> Array:
    """Rotations (T, 3, 3) adjusted so that the last equals the first."""
    off = rotmat_to_rotvec(product(rotations[:1], inverse(rotations[-1:])))
    return product(rotvec_to_rotmat(_share(len(rotations)) * off), rotations)


def _closed_channels(motion: Motion, carrier: str) -> Motion:
    """The motion with channels whose last frame equals the first, up to whole turns; joints with all three angles, and
    the carrier's position and heading, stay."""
    stay = {f"{name}.r{axis}" for name in _whole(motion) for axis in AXES}
    stay |= {f"{carrier}.{kind}" for kind in ("tx", "ty", "tz", "ry")}
    turns = np.array([TURN.get(unit, np.inf) for unit in motion.units])
    off = motion.values[-1] - motion.values[0]
    off -= np.where(np.isfinite(turns), np.round(off / turns) * np.where(np.isfinite(turns), turns, 0), 0)
    off[[name in stay for name in motion.channels]] = 0
    return replace(motion, values=motion.values - _share(len(motion)) * off)


def _drift(values: Array) -> Array:
    """The difference between the last and the first of values (T, N), as a line about its middle."""
    drift: Array = _share(len(values)) * (values[-1] - values[0])
    return drift


def _share(frames: int) -> Array:
    """From -1/2 to 1/2 (T, 1), so both ends of the loop change equally."""
    return np.linspace(-0.5, 0.5, frames)[:, None]
