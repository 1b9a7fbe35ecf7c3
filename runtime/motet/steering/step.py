"""The loop of a steered figure: recorded frames are played in turn and matched with the target.

The target, a velocity and a facing, is approached by critically damped springs. Recordings are played a little slower
or faster, with shorter or longer strides, to go as fast as the springs, and hips and legs are turned
(:mod:`motet.steering.warping`), to go where they do. Letters as in :mod:`motet.steering.matching`, which searches what
is played; and J bones, P = 4 J + 1 numbers of a pose.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from motet.bundle.graph import Floats
from motet.decode.loop import Loop
from motet.motion.rotations import Array
from motet.motion.scalar_or_batch import (
    Part,
    Vector,
    clipped,
    computed,
    joined,
    larger,
    parts,
    single,
    smaller,
    where,
    wrapped,
)
from motet.motion.scalar_or_batch import root as root_of
from motet.motion.springs import damped, damping_of
from motet.steering.matching import LEAST_PACE, Matcher, Playback, Rows
from motet.steering.pose import Pose
from motet.steering.settings import SteeringSettings
from motet.steering.warping import strided, warped

BLOCK = 64
"""Poses of a product: few enough that OpenBLAS starts no threads, which on a busy machine wait for each other."""


@dataclass(frozen=True, eq=False)
class PoseCodes:
    """Poses in few numbers: quaternions and the hips' height are a linear map of codes. Both float64."""

    mean: Array
    """(P,) the pose whose codes are 0."""
    basis: Array
    """(K, P) what each code adds to it, of float16."""

    def decode(self, codes: Array) -> tuple[Floats, Floats]:
        """Codes (B, K) to unit quaternions (B, J, 4) and the hips' height (B,) in metres, both float32. In memory the
        figures are last, along which all that follows is computed."""
        # rounded to make sums exact, and a pose the same alone and in a block: the basis has multiples of 2^-24
        codes = np.rint(codes * 2**20) / 2**20
        values = np.empty((len(self.mean), len(codes)))
        for start in range(0, len(codes), BLOCK):
            block = slice(start, start + BLOCK)
            np.matmul(self.basis.T, codes[block].T, out=values[:, block])
        values += self.mean[:, None]
        quats = values[:-1].reshape(-1, 4, len(codes))
        quats /= np.sqrt(np.maximum((quats * quats).sum(axis=1, keepdims=True), 1e-12))
        return quats.astype(np.float32).transpose(2, 0, 1), values[-1].astype(np.float32)

    def encode(self, rotations: Floats, height: Floats) -> Array:
        """The codes (B, K) whose poses are nearest to quaternions (B, J, 4) and heights (B,)."""
        mean = self.mean[:-1].reshape(-1, 4)
        nearer = np.where((rotations * mean).sum(axis=2, keepdims=True) < 0, -rotations, rotations)
        values = np.concatenate([nearer.reshape(len(nearer), -1), height[:, None]], axis=1)
        codes: Array = np.matmul((values - self.mean)[:, None], self._inverse)[:, 0]
        return codes

    @cached_property
    def _inverse(self) -> Array:
        return np.linalg.pinv(self.basis).astype(np.float64)


class Recorded(NamedTuple):
    """What figures play, relative to their facing."""

    forward: Part
    """Velocity forward, m/s."""
    left: Part
    """Velocity to the left, m/s."""
    turn: Part
    """Turn to the left, rad/s."""
    speed: Part
    """m/s, 0 for what has its own rate, such as a jump."""
    way: Part
    """The angle from the facing to where the recording goes."""
    slow_walk: Part
    """Whether they go more slowly than recordings do."""


class Springs(NamedTuple):
    """Where the springs that approach the target are."""

    x: Part
    """Velocity along x, m/s."""
    z: Part
    """Velocity along z, m/s."""
    facing: Part
    """Radians."""
    pace: Part
    """How fast that velocity is, m/s."""


class Moved(NamedTuple):
    """A figure after a tick."""

    root: Vector
    rate: Part
    """The playback rate."""
    stride_goal: Part
    """The strides that the legs are to make, relative to the recorded ones."""


def tick(matcher: Matcher, poses: PoseCodes, playback: Playback, target: Array, gait: Rows) -> Pose:
    """The next pose, 1 / fps seconds later; ``playback`` moves on.

    target: (B, 3) velocity over the ground along x and z, and facing. gait: (B,) numbers.
    """
    dt = 1 / matcher.fps
    # search: jump to another row where one fits better
    matcher.search(playback, target, gait)
    # playback: go on by the playback rate
    _advance(playback)
    played, _ = matcher.table.at(playback)
    # the springs approach the target, and the root follows them
    spring = _spring_update(playback, parts(target), matcher.settings, dt)
    recorded = _recorded(matcher, playback, played, target, gait)
    _follow(playback, recorded, spring, matcher.settings, dt)
    # inertialization: the offset of the last jumps fades
    playback.offset, playback.offset_rate = matcher.inertializer.update(playback.offset, playback.offset_rate, dt)
    # the pose, warped
    rotations, height = body(poses, playback, played)
    return Pose(playback.root, rotations, height, played[:, -2:].astype(np.float32))


def _advance(playback: Playback) -> None:
    """Go on by the playback rate."""
    whole, playback.part = np.divmod(playback.part + playback.rate, 1)
    playback.row = playback.row + whole.astype(np.int64)


def _recorded(matcher: Matcher, playback: Playback, played: Array, target: Array, gait: Rows) -> Recorded:
    """How the frames (B, K + 6) that figures play go."""
    way = matcher.table.way[playback.mirror, playback.row]
    forward, left, turn, speed = parts(played[:, -6:-2])
    slow_walk = single(matcher.is_slow_walk(target, gait)) & (speed > 0)  # what has no speed has its own rate
    # who comes to rest goes no faster than the springs, or would lurch as recorded
    slow_walk = slow_walk | (single(matcher.comes_to_rest(playback, target, gait)) & (speed > single(playback.pace)))
    return Recorded(forward, left, turn, speed, single(way), slow_walk)


def body(poses: PoseCodes, playback: Playback, played: Array) -> tuple[Floats, Floats]:
    """Rotations and height of figures that play frames (B, K + 6) of the table, with their inertialization offset,
    strides and warp."""
    rotations, height = poses.decode(played[:, :-6] + playback.offset)
    rotations = strided(rotations, played[:, -2:].astype(np.float32), playback.stride)
    return warped(rotations, playback.warp), height


def _spring_update(playback: Playback, target: Vector, settings: SteeringSettings, dt: float) -> Springs:
    """The springs a tick later."""
    spring_x, spring_z, spring_facing = parts(playback.spring)
    rate_x, rate_z, rate_facing = parts(playback.spring_rate)
    target_x, target_z, target_facing = target
    # critically damped towards the target: velocity along x and z, and facing
    velocity_damping = damping_of(settings.velocity)
    facing_damping = damping_of(settings.facing)
    error_x, rate_x = damped(spring_x - target_x, rate_x, velocity_damping, dt)
    error_z, rate_z = damped(spring_z - target_z, rate_z, velocity_damping, dt)
    error_facing, rate_facing = damped(wrapped(spring_facing - target_facing), rate_facing, facing_damping, dt)
    x = target_x + error_x
    z = target_z + error_z
    facing = target_facing + error_facing
    # kept for the next tick
    playback.spring = joined((x, z, facing))
    playback.spring_rate = joined((rate_x, rate_z, rate_facing))
    return Springs(x, z, facing, computed(np.hypot, x, z))


def _follow(playback: Playback, recorded: Recorded, spring: Springs, settings: SteeringSettings, dt: float) -> None:
    """Move figures on as their recordings go, warped to go where the springs do."""
    root = parts(playback.root)
    damping = damping_of(settings.blend)
    # orientation warping: the legs turn towards the direction of travel
    warp_goal = _warp(recorded, spring, root[2], settings)
    warp_error = single(playback.warp) - warp_goal
    warp_error, warp_rate = damped(warp_error, single(playback.warp_rate), damping, dt)
    warp = warp_goal + warp_error
    # the root goes as the warped legs do
    moved = _moved(root, warp, single(playback.rate), recorded, spring, settings, dt)
    # stride warping: the legs reach as far as the root goes
    stride_error = single(playback.stride) - moved.stride_goal
    stride_error, stride_rate = damped(stride_error, single(playback.stride_rate), damping, dt)
    stride = moved.stride_goal + stride_error
    playback.root = joined(moved.root)
    values = joined((moved.rate, warp, warp_rate, stride, stride_rate)).T
    playback.rate, playback.warp, playback.warp_rate, playback.stride, playback.stride_rate = values


def _warp(recorded: Recorded, spring: Springs, facing: Part, settings: SteeringSettings) -> Part:
    """Warp angle from the recorded to the desired direction of travel; 0 when idle or more than 90 degrees off."""
    angle = wrapped(computed(np.arctan2, spring.x, spring.z) - facing - recorded.way)
    moves = smaller(recorded.speed, spring.pace) > settings.idle
    warps = moves & (abs(angle) <= np.pi / 2)
    return where(warps, clipped(angle, -settings.warp, settings.warp), 0.0)


def _moved(
    root: Vector, warp: Part, rate: Part, recorded: Recorded, spring: Springs, settings: SteeringSettings, dt: float
) -> Moved:
    """The root a tick later, the next playback rate and the strides to be made. rate: the present playback rate."""
    slow_walk = recorded.slow_walk
    moving = slow_walk | (smaller(recorded.speed, spring.pace) > settings.idle)
    speed_ratio = spring.pace / larger(recorded.speed, where(slow_walk, LEAST_PACE, settings.idle))
    # turn as recorded, and a little more towards the facing of the springs
    x, z, facing = root
    turned = facing + recorded.turn * (rate * dt)
    next_facing = wrapped(turned + _facing_correction(root, rate, recorded, spring, settings, dt))
    # stride: what the playback rate does not make up for of the speed
    shortest = where(slow_walk, 0.0, settings.shortest)
    stride = where(moving, clipped(speed_ratio / rate, shortest, settings.longest), 1.0)
    # the step over the ground as recorded, turned as the legs are, and then towards the velocity of the springs
    step_x, step_z = _step(recorded, facing + warp, stride, rate * dt)
    correction = where(moving, _heading_correction(step_x, step_z, spring, settings), 0.0)
    # a slow walk goes exactly as the springs do, whose ways recordings lack
    next_x = x + where(slow_walk, spring.x * dt, step_x + correction * step_z)
    next_z = z + where(slow_walk, spring.z * dt, step_z - correction * step_x)
    # the next playback rate is as fast as the springs; the legs' strides of a slow walk are shorter
    playback_rate = where(moving, _playback_rate(speed_ratio, slow_walk, settings), 1.0)
    stride_goal = where(slow_walk, smaller(stride, 1.0), 1.0)
    return Moved((next_x, next_z, next_facing), playback_rate, stride_goal)


def _step(recorded: Recorded, direction: Part, stride: Part, played_seconds: Part) -> tuple[Part, Part]:
    """The step along x and z as recorded in some seconds, times a stride, of a figure that goes to a direction."""
    forward = recorded.forward * played_seconds
    left = recorded.left * played_seconds
    sin = computed(np.sin, direction) * stride
    cos = computed(np.cos, direction) * stride
    return sin * forward + cos * left, cos * forward - sin * left


def _playback_rate(speed_ratio: Part, slow_walk: Part, settings: SteeringSettings) -> Part:
    """The playback rate that is as fast as the springs; a slow walk shares the slowness between rate and stride."""
    slowest = where(slow_walk, settings.creep_slowest, settings.slowest)
    return clipped(where(slow_walk, root_of(speed_ratio), speed_ratio), slowest, settings.fastest)


def _facing_correction(
    root: Vector, rate: Part, recorded: Recorded, spring: Springs, settings: SteeringSettings, dt: float
) -> Part:
    """How much more than recorded figures turn in a tick, towards the facing of the springs."""
    error = wrapped(spring.facing - root[2])
    recorded_turn = recorded.turn * (rate * dt)
    most_turn_rate = settings.turn_still + settings.turn_moving * smaller(spring.pace, settings.turn_speed)
    most = most_turn_rate * dt + settings.turn_turning * abs(recorded_turn)
    return clipped(error * (1 - 0.5 ** (dt / settings.turn)), -most, most)


def _heading_correction(step_x: Part, step_z: Part, spring: Springs, settings: SteeringSettings) -> Part:
    """The angle from a step to the velocity of the springs, 0 where the two go apart."""
    along = step_x * spring.x + step_z * spring.z
    across = step_z * spring.x - step_x * spring.z
    near = along > settings.veer_within * abs(across)
    angle = computed(np.arctan, across / larger(along, 1e-6))
    return where(near, clipped(angle, -settings.veer, settings.veer), 0.0)


LOOPS: Mapping[str, Loop] = {"matching": Loop(tick, {}, {})}
