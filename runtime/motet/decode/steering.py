"""The loop of a steered figure: recorded frames are played in turn and matched with the target.

What is asked, a velocity and a facing, is approached by critically damped springs. Recordings are played a little
slower or faster, with shorter or longer strides, to go as fast as the springs, and hips and legs are turned
(:mod:`motet.decode.warping`), to go where they do. Letters as in :mod:`motet.decode.matching`, which says what is
played; and J bones, P = 4 J + 1 numbers of a pose.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from motet.bundle.graph import Floats
from motet.decode.matching import LEAST_PACE, Matcher, Playback, Rows
from motet.decode.steering_settings import SteeringSettings
from motet.decode.warping import strided, warped
from motet.motion.pose import Pose, damped, damping_of
from motet.motion.rotations import Array, wrapped

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
        """Codes (B, K) to unit quaternions (B, J, 4) and the hips' height (B,) in metres, both float32."""
        # so that sums are exact, and a pose is the same alone as in a block: the basis has multiples of 2^-24
        codes = np.rint(codes * 2**20) / 2**20
        values = np.empty((len(codes), len(self.mean)))
        for start in range(0, len(codes), BLOCK):
            np.matmul(codes[start : start + BLOCK], self.basis, out=values[start : start + BLOCK])
        values += self.mean
        quats = values[:, :-1].reshape(len(values), -1, 4)
        quats /= np.sqrt(np.maximum((quats * quats).sum(axis=2, keepdims=True), 1e-12))
        return quats.astype(np.float32), values[:, -1].astype(np.float32)

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
    how, dt = matcher.settings, 1 / matcher.fps
    matcher.search(playback, target, gait)
    whole, playback.part = np.divmod(playback.part + playback.rate, 1)
    playback.row = playback.row + whole.astype(np.int64)
    played, _ = matcher.table.at(playback)
    moves, recorded = played[:, -6:-3].T, played[:, -3]
    off = playback.spring - target
    off[:, 2] = wrapped(off[:, 2])
    damping = np.array([damping_of(how.velocity)] * 2 + [damping_of(how.facing)])
    off, playback.spring_rate = damped(off, playback.spring_rate, damping, dt)
    playback.spring = target + off
    calm, warp = damping_of(how.blend), _warp(playback, matcher.table.way[playback.mirror, playback.row], recorded, how)
    off, playback.warp_rate = damped(playback.warp - warp, playback.warp_rate, calm, dt)
    playback.warp = warp + off
    creeps = matcher.creeping(target, gait)
    playback.root, playback.rate, stride = _moved(playback, moves, recorded, creeps, how, dt)
    off, playback.stride_rate = damped(playback.stride - stride, playback.stride_rate, calm, dt)
    playback.stride = stride + off
    playback.offset, playback.offset_rate = damped(playback.offset, playback.offset_rate, calm, dt)
    rotations, height = body(matcher, poses, playback, played)
    return Pose(playback.root, rotations, height, played[:, -2:].astype(np.float32))


def body(matcher: Matcher, poses: PoseCodes, playback: Playback, played: Array) -> tuple[Floats, Floats]:
    """Rotations and height of figures that play numbers (B, K + 6) of the table, with their offset, turned and with
    strides as they go."""
    rotations, height = poses.decode(played[:, :-6] + playback.offset)
    way, contacts = matcher.table.way[playback.mirror, playback.row], played[:, -2:].astype(np.float32)
    return warped(strided(rotations, contacts, way, playback.stride), playback.warp), height


def _warp(playback: Playback, way: Array, recorded: Array, how: SteeringSettings) -> Array:
    """By how many radians (B,) rows that go a way (B,) from the facing, at recorded speeds (B,), are to be turned to go
    where the springs do; 0 for those that stand, or go elsewhere until the next search."""
    x, z = playback.spring[:, :2].T
    angle = wrapped(np.arctan2(x, z) - playback.root[:, 2] - way)
    warps = (np.minimum(recorded, np.hypot(x, z)) > how.idle) & (np.abs(angle) <= np.pi / 2)
    return np.where(warps, angle.clip(-how.warp, how.warp), 0.0)


def _moved(
    playback: Playback, moves: Array, recorded: Array, creeps: NDArray[np.bool_], how: SteeringSettings, dt: float
) -> tuple[Array, Array, Array]:
    """The next root (B, 3), playback rate (B,) and by how much legs are to make shorter strides (B,); of recorded moves
    (3, B) forward, left and turn, speeds (B,), and which figures creep (B,)."""
    x, z, facing = playback.root.T
    (velocity_x, velocity_z), rate = playback.spring[:, :2].T, playback.rate
    pace = np.hypot(velocity_x, velocity_z)
    moving = creeps | (np.minimum(recorded, pace) > how.idle)
    ratio = pace / np.maximum(recorded, np.where(creeps, LEAST_PACE, how.idle))
    forward, left, turn = moves * (rate * dt)
    error = wrapped(playback.spring[:, 2] - facing)
    most = (how.turn_still + how.turn_moving * np.minimum(pace, how.turn_speed)) * dt + how.turn_turning * np.abs(turn)
    turned = wrapped(facing + turn + (error * (1 - 0.5 ** (dt / how.turn))).clip(-most, most))
    stride = np.where(moving, (ratio / rate).clip(np.where(creeps, 0, how.shortest), how.longest), 1)
    sin, cos = np.sin(facing + playback.warp) * stride, np.cos(facing + playback.warp) * stride
    step_x, step_z = sin * forward + cos * left, cos * forward - sin * left
    # turned towards the velocity by a small angle, where the two do not go apart
    along, across = step_x * velocity_x + step_z * velocity_z, step_z * velocity_x - step_x * velocity_z
    veers = moving & (along > how.veer_within * np.abs(across))
    angle = np.where(veers, np.arctan(across / np.maximum(along, 1e-6)).clip(-how.veer, how.veer), 0)
    slowest, rate = np.where(creeps, how.creep_slowest, how.slowest), np.where(creeps, np.sqrt(ratio), ratio)
    rate = np.where(moving, rate.clip(slowest, how.fastest), 1)
    root = np.stack([x + (step_x + angle * step_z), z + (step_z - angle * step_x), turned], axis=1)
    return root, rate, np.where(creeps, np.minimum(stride, 1), 1)
