"""Figures that look at points: head, neck and upper spine share the turn, within what people can do.

How far the head is from where it should look is an angle to the left and one upwards, in the frame of the lower spine.
Each bone from there to the head takes its share of both, so the head looks at the point, and the back bends evenly.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from motet.figures.humanoid import BONES, HUMANOID
from motet.motion.rotations import Array
from motet.motion.scalar_or_batch import Quaternion, Vector, inverse, minus, parts, plus, product, rotated
from motet.steering.follower import Follower
from motet.steering.pose import Pose

TRUNK = ("hips", "spine")
SHARES = {"chest": 0.1, "upperChest": 0.25, "neck": 0.55, "head": 1.0}
"""Bones that turn -> the share of the turn that each and those below it make together."""

OFFSETS = {joint.name: joint.offset for joint in HUMANOID.joints}

EYES = (0.0, 0.07, 0.08)
"""Between the eyes, from the head's joint, metres."""

MOST = (np.radians(85), np.radians(50))
"""The largest angles of the gaze, to a side and up or down."""

BEHIND = np.radians(150)
"""Beyond this angle a figure goes on looking over the shoulder over which it looks."""

NEAR, UNDER = 0.2, 0.3
"""Metres: nothing nearer to the eyes is looked at; and what is less aside than this is hardly turned to."""

LEAST = 1e-4
"""Radians below which nothing is turned."""

LEAP, HALF_LIFE = np.radians(10), 0.18
"""Radians that the gaze follows in a tick at once; and the half-life, in seconds, in which it catches up with more:
300 degrees a second at the most, in a turn by 100."""


@dataclass(frozen=True, eq=False)
class Look:
    """What B figures look at: points (B, 3) in the world, NaN for nothing. turn: (B, 2) angles by which their heads
    are turned to the left and up, more than is played."""

    points: Array
    turn: Follower

    @staticmethod
    def ahead(figures: int) -> "Look":
        """Of figures that look at nothing."""
        return Look(np.full((figures, 3), np.nan), Follower.at(np.zeros((figures, 2))))

    @cached_property
    def _looks(self) -> NDArray[np.bool_] | None:
        """Which heads (B,) are turned, or about to be; None for no one's."""
        looks = ~np.isnan(self.points[:, 0]) | (np.abs(self.turn.shown) > LEAST).any(axis=1)
        return looks if looks.any() else None

    def after(self, pose: Pose, seconds: float) -> tuple["Look", Pose]:
        """A tick later, and the pose of that tick with the heads turned."""
        looks = self._looks
        if looks is None:
            return self, pose
        bones, points = _seen(pose, self.points)
        now = _angles(rotated(bones[-1], (0.0, 0.0, 1.0)))
        aim = minus(points, _eyes(_turned(bones, now[:, 0], self.turn.shown)))  # as they were turned a tick ago
        wanted = _angles(aim)
        behind = np.abs(wanted[:, 0]) > BEHIND
        before = now[:, 0] + self.turn.wanted[:, 0]
        wanted[:, 0] = np.where(behind, np.copysign(wanted[:, 0], before), wanted[:, 0])
        wanted[:, 0] *= np.minimum(np.hypot(*np.broadcast_arrays(aim[0], aim[2])) / UNDER, 1)
        far = np.sqrt(sum(np.square(part) for part in aim)) > NEAR
        wanted = np.where(np.atleast_1d(far)[:, None], wanted.clip(np.negative(MOST), MOST) - now, 0.0)
        look = replace(self, turn=self.turn.after(wanted, LEAP, HALF_LIFE, seconds))
        rotations, above = pose.rotations.copy(), (0.0, 0.0, 0.0, 1.0)
        for name, bone in zip(SHARES, _turned(bones, now[:, 0], look.turn.shown), strict=True):
            own = np.transpose(product(inverse(above), bone)).reshape(-1, 4)
            rotations[looks, BONES.index(name)], above = own[looks], bone
        return look, replace(pose, rotations=rotations)


def _seen(pose: Pose, points: Array) -> tuple[list[Quaternion], Vector]:
    """In the frame of the lower spine: rotations of the bones of :data:`SHARES`, and points (B, 3)."""
    (x, z, _), (height,) = parts(pose.ground), parts(pose.height[:, None])
    place, above = (x, height, z), parts(pose.heading)
    for bone in TRUNK:
        offset = (0.0, 0.0, 0.0) if bone == "hips" else OFFSETS[bone]
        place, above = plus(place, rotated(above, offset)), product(above, _local(pose, bone))
    turned, bones = (0.0, 0.0, 0.0, 1.0), list[Quaternion]()
    for bone in SHARES:
        turned = product(turned, _local(pose, bone))
        bones.append(turned)
    return bones, rotated(inverse(above), minus(parts(points), place))


def _eyes(bones: Sequence[Quaternion]) -> Vector:
    """Where the eyes are in the frame of the lower spine, of rotations in it."""
    place, above = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)
    for name, bone in zip(SHARES, bones, strict=True):
        place, above = plus(place, rotated(above, OFFSETS[name])), bone
    return plus(place, rotated(above, EYES))


def _local(pose: Pose, bone: str) -> Quaternion:
    found: Quaternion = parts(pose.rotations[:, BONES.index(bone)])
    return found


def _angles(way: Vector) -> Array:
    """Angles (B, 2) of directions, to the left and up."""
    x, y, z = way
    found: Array = np.stack(np.broadcast_arrays(np.arctan2(x, z), np.arctan2(y, np.hypot(x, z))), axis=-1)
    return found.reshape(-1, 2)


def _turned(bones: Sequence[Quaternion], gaze: Array, turn: Array) -> list[Quaternion]:
    """Rotations of bones in the frame of the lower spine, turned by their shares of angles (B, 2), from gazes at angles
    (B,) to the left."""
    turned = list[Quaternion]()
    for share, bone in zip(SHARES.values(), bones, strict=True):
        (left, up), (at,) = parts(share * turn), parts(gaze[:, None])
        sine, cosine, half, way = np.sin(up / 2), np.cos(up / 2), left / 2, at + left
        aside = (0.0, np.sin(half), 0.0, np.cos(half))
        turned.append(product((-np.cos(way) * sine, 0.0, np.sin(way) * sine, cosine), product(aside, bone)))
    return turned
