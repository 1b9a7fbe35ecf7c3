"""The loop of a steered figure: recorded frames are played in turn and matched with the target.

What is asked, a velocity and a facing, is approached by critically damped springs. Recordings are played a little
slower or faster, with shorter or longer strides, to go as fast as the springs, and hips and legs are turned
(:mod:`motet.steering.warping`), to go where they do. Letters as in :mod:`motet.steering.matching`, which says what is
played; and J bones, P = 4 J + 1 numbers of a pose.
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
    minus,
    parts,
    plus,
    single,
    smaller,
    times,
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
"""Poses of a product: so few that OpenBLAS starts no threads, which on a busy machine wait for each other."""


@dataclass(frozen=True, eq=False)
class PoseCodes:
    """Poses in few numbers: quaternions and the hips' height are a linear map of codes.

    mean: (P,) the pose whose codes are 0. basis: (K, P) what each code adds to it, of float16; both float64.
    """

    mean: Array
    basis: Array

    def decode(self, codes: Array) -> tuple[Floats, Floats]:
        """Codes (B, K) to unit quaternions (B, J, 4) and the hips' height (B,) in metres, both float32. In memory the
        figures are last, along which all that follows is computed."""
        # so that sums are exact, and a pose is the same alone as in a block: the basis has multiples of 2^-24
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
        found: Array = np.matmul((values - self.mean)[:, None], self._inverse)[:, 0]
        return found

    @cached_property
    def _inverse(self) -> Array:
        return np.linalg.pinv(self.basis).astype(np.float64)


def tick(matcher: Matcher, poses: PoseCodes, playback: Playback, target: Array, gait: Rows) -> Pose:
    """The next pose, 1 / fps seconds later; ``playback`` moves on.

    target: (B, 3) velocity over the ground along x and z, and facing. gait: (B,) which.
    """
    how, dt, table = matcher.settings, 1 / matcher.fps, matcher.table
    matcher.search(playback, target, gait)
    part = playback.part + playback.rate
    whole = np.floor(part)
    playback.part, playback.row = part - whole, playback.row + whole.astype(np.int64)
    played, _ = table.at(playback)
    way = table.way[playback.mirror, playback.row]
    forward, left, turn, speed = parts(played[:, -6:-2])
    creeps = single(matcher.creeping(target, gait)) & (speed > 0)  # what has no speed, a jump, has its own rate
    recorded = Recorded(forward, left, turn, speed, single(way), creeps)
    _go(playback, recorded, _sprung(playback, parts(target), how, dt), how, dt)
    playback.offset, playback.offset_rate = damped(playback.offset, playback.offset_rate, damping_of(how.blend), dt)
    rotations, height = body(poses, playback, played)
    return Pose(playback.root, rotations, height, played[:, -2:].astype(np.float32))


def body(poses: PoseCodes, playback: Playback, played: Array) -> tuple[Floats, Floats]:
    """Rotations and height of figures that play numbers (B, K + 6) of the table, with their offset, turned and with
    strides as they go."""
    rotations, height = poses.decode(played[:, :-6] + playback.offset)
    strides = strided(rotations, played[:, -2:].astype(np.float32), playback.stride)
    return warped(strides, playback.warp), height


class Recorded(NamedTuple):
    """What figures play: velocities forward and to the left, turn and speed, m/s and rad/s; the angle from the facing
    to where the recording goes; and whether they creep."""

    forward: Part
    left: Part
    turn: Part
    speed: Part
    way: Part
    creeps: Part


class Springs(NamedTuple):
    """Where springs are: velocity along x and z, facing, and how fast that velocity is."""

    x: Part
    z: Part
    facing: Part
    pace: Part


def _sprung(playback: Playback, asked: Vector, how: SteeringSettings, dt: float) -> Springs:
    """The springs, as they have come nearer to what is asked."""
    off_x, off_z, off_facing = minus(parts(playback.spring), asked)
    offs, half_lives = (off_x, off_z, wrapped(off_facing)), (how.velocity, how.velocity, how.facing)
    each = zip(offs, parts(playback.spring_rate), map(damping_of, half_lives), strict=True)
    (x, rate_x), (z, rate_z), (facing, turn) = (damped(off, rate, damping, dt) for off, rate, damping in each)
    x, z, facing = spring = plus(asked, (x, z, facing))
    playback.spring, playback.spring_rate = joined(spring), joined((rate_x, rate_z, turn))
    return Springs(x, z, facing, computed(np.hypot, x, z))


def _go(playback: Playback, recorded: Recorded, spring: Springs, how: SteeringSettings, dt: float) -> None:
    """Move figures on as what they play goes, turned and with strides to go where the springs do."""
    root, calm = parts(playback.root), damping_of(how.blend)
    goal = _warp(recorded, spring, root[2], how)
    off, warp_rate = damped(single(playback.warp) - goal, single(playback.warp_rate), calm, dt)
    warp = goal + off
    root, rate, goal = _moved(root, warp, single(playback.rate), recorded, spring, how, dt)
    off, stride_rate = damped(single(playback.stride) - goal, single(playback.stride_rate), calm, dt)
    playback.root, values = joined(root), joined((rate, warp, warp_rate, goal + off, stride_rate)).T
    playback.rate, playback.warp, playback.warp_rate, playback.stride, playback.stride_rate = values


def _warp(recorded: Recorded, spring: Springs, facing: Part, how: SteeringSettings) -> Part:
    """By how many radians rows are to be turned to go where the springs do; 0 for those that stand, or go elsewhere
    until the next search."""
    angle = wrapped(computed(np.arctan2, spring.x, spring.z) - facing - recorded.way)
    warps = (smaller(recorded.speed, spring.pace) > how.idle) & (abs(angle) <= np.pi / 2)
    return where(warps, clipped(angle, -how.warp, how.warp), 0.0)


def _moved(
    root: Vector, warp: Part, rate: Part, recorded: Recorded, spring: Springs, how: SteeringSettings, dt: float
) -> tuple[Vector, Part, Part]:
    """The next root and playback rate, and by how much legs are to make shorter strides."""
    (x, z, facing), (velocity_x, velocity_z, faces, pace), creeps = root, spring, recorded.creeps
    moving = creeps | (smaller(recorded.speed, pace) > how.idle)
    ratio = pace / larger(recorded.speed, where(creeps, LEAST_PACE, how.idle))
    forward, left, turn = times((recorded.forward, recorded.left, recorded.turn), rate * dt)
    error = wrapped(faces - facing)
    most = (how.turn_still + how.turn_moving * smaller(pace, how.turn_speed)) * dt + how.turn_turning * abs(turn)
    turned = wrapped(facing + turn + clipped(error * (1 - 0.5 ** (dt / how.turn)), -most, most))
    stride = where(moving, clipped(ratio / rate, where(creeps, 0.0, how.shortest), how.longest), 1.0)
    sin, cos = computed(np.sin, facing + warp) * stride, computed(np.cos, facing + warp) * stride
    step_x, step_z = sin * forward + cos * left, cos * forward - sin * left
    # turned towards the velocity by a small angle, where the two do not go apart
    along, across = step_x * velocity_x + step_z * velocity_z, step_z * velocity_x - step_x * velocity_z
    veers = moving & (along > how.veer_within * abs(across))
    angle = where(veers, clipped(computed(np.arctan, across / larger(along, 1e-6)), -how.veer, how.veer), 0.0)
    slowest, rate = where(creeps, how.creep_slowest, how.slowest), where(creeps, root_of(ratio), ratio)
    rate = where(moving, clipped(rate, slowest, how.fastest), 1.0)
    moved = x + (step_x + angle * step_z), z + (step_z - angle * step_x), turned
    return moved, rate, where(creeps, smaller(stride, 1.0), 1.0)


LOOPS: Mapping[str, Loop] = {"matching": Loop(tick, {}, {})}
