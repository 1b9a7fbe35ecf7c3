"""The loop of a steered figure: recorded frames are played in turn and matched with the target.

What is asked, a velocity and a facing, is approached by critically damped springs. Recordings are played a little
slower or faster, with shorter or longer strides, and turned a little, to go as fast and where the springs are. The
letters are those of :mod:`motet.decode.matching`, which says what is played.
"""

import numpy as np
from numpy.typing import NDArray

from motet.decode.loop import Loop
from motet.decode.matching import Matcher
from motet.decode.playback import Playback, Rows
from motet.decode.pose_codes import PoseCodes
from motet.decode.steering_settings import SteeringSettings
from motet.motion.pose import Pose
from motet.motion.rotations import Array, wrapped
from motet.motion.springs import damped, damping_of


def tick(matcher: Matcher, poses: PoseCodes, playback: Playback, target: Array, gait: Rows) -> Pose:
    """The next pose, 1 / fps seconds later; ``playback`` moves on.

    target: (B, 3) velocity over the ground along x and z, and facing. gait: (B,) which.
    """
    how, dt = matcher.settings, 1 / matcher.fps
    matcher.search(playback, target, gait)
    whole, playback.part = np.divmod(playback.part + playback.rate, 1)
    playback.row = playback.row + whole.astype(np.int64)
    played, _ = matcher.table.at(playback)
    codes, moves, recorded = played[:, :-6], played[:, -6:-3].T, played[:, -3]
    _approach(playback, target, how, dt)
    playback.root, playback.rate = _moved(playback, moves, recorded, how, dt)
    playback.offset, playback.offset_rate = damped(playback.offset, playback.offset_rate, damping_of(how.blend), dt)
    rotations, height = poses.decode(codes + playback.offset)
    return Pose(playback.root, rotations, height, played[:, -2:].astype(np.float32))


def _approach(playback: Playback, target: Array, how: SteeringSettings, dt: float) -> None:
    """The springs of velocity and facing, a tick later."""
    off = playback.spring - target
    off[:, 2] = wrapped(off[:, 2])
    damping = np.array([damping_of(how.velocity)] * 2 + [damping_of(how.facing)])
    off, playback.spring_rate = damped(off, playback.spring_rate, damping, dt)
    playback.spring = target + off


def _moved(playback: Playback, moves: Array, recorded: Array, how: SteeringSettings, dt: float) -> tuple[Array, Array]:
    """The next root (B, 3) and playback rate (B,), of recorded moves (3, B) forward, left and turn, and speeds (B,)."""
    x, z, facing = playback.root.T
    velocity, rate = playback.spring[:, :2].T, playback.rate
    pace = np.hypot(*velocity)
    moving, ratio = np.minimum(recorded, pace) > how.idle, pace / np.maximum(recorded, how.idle)
    forward, left, turn = moves * (rate * dt)
    error = wrapped(playback.spring[:, 2] - facing)
    most = (how.turn_still + how.turn_moving * np.minimum(pace, how.turn_speed)) * dt + how.turn_turning * np.abs(turn)
    turned = wrapped(facing + turn + (error * (1 - 0.5 ** (dt / how.turn))).clip(-most, most))
    stride = np.where(moving, (ratio / rate).clip(how.shortest, how.longest), 1)
    sin, cos = np.sin(facing) * stride, np.cos(facing) * stride
    step = np.stack([sin * forward + cos * left, cos * forward - sin * left])
    step_x, step_z = _veered(step, velocity, moving, how)
    rate = np.where(moving, ratio.clip(how.slowest, how.fastest), 1)
    return np.stack([x + step_x, z + step_z, turned], axis=1), rate


def _veered(step: Array, velocity: Array, moving: NDArray[np.bool_], how: SteeringSettings) -> Array:
    """Steps (2, B) turned towards velocities (2, B) by a small angle, where they do not go apart."""
    along = (step * velocity).sum(axis=0)
    across = step[1] * velocity[0] - step[0] * velocity[1]
    veers = moving & (along > how.veer_within * np.abs(across))
    angle = np.where(veers, np.arctan(across / np.maximum(along, 1e-6)).clip(-how.veer, how.veer), 0)
    found: Array = step + angle * np.stack([step[1], -step[0]])
    return found


LOOP = Loop(tick, {}, {})
