"""A foot lock for live figures: standing feet stay in place, without look-ahead.

Contacts come from the table being played, by :func:`motet.motion.feet.contacts.contacts_of` of the recordings. While a
foot stands, the movement of its lowest point over the ground is removed, tick by tick; when it lifts off, the
correction fades. Hip, knee and ankle follow (:class:`motet.motion.feet.hold.Leg`). The offline twin, which knows how
long a foot will stand, is :mod:`motet.motion.feet.hold`.
"""

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np

from motet.motion.feet.hold import Leg
from motet.motion.humanoid import BONES, HUMANOID, LEFT_RIGHT, LEG, SOLE, sided
from motet.motion.pose import Floats, Pose, damped, damping_of
from motet.motion.rotations import Array, conjugate, quat_product, quat_rotated, rotmat_to_quat
from motet.settings import Range, Settings


@dataclass(frozen=True)
class FootLockSettings(Settings):
    """fade: half-life in which a released foot comes back to where it is played. farthest: largest correction; beyond
    it the foot is released. swings: above this speed a foot is swinging, even if a clip that was just jumped to marks a
    contact. stands: contact above which a foot stands."""

    FEATURE: ClassVar[str] = "foot_lock"

    fade: Annotated[float, Range(0.001, 10, "s")] = 0.06
    farthest: Annotated[float, Range(0, 1, "m")] = 0.2
    swings: Annotated[float, Range(0, 100, "m/s")] = 1.0
    stands: Annotated[float, Range(0, 1)] = 0.5


LEG_BONES = np.array([[BONES.index(sided(side, part)) for part in LEG] for side in LEFT_RIGHT])
"""Bones (2, 4) of both legs among the humanoid's."""

LEG_OFFSETS = HUMANOID.offsets[[[HUMANOID.index(BONES[bone]) for bone in leg] for leg in LEG_BONES.T]]
"""Where they begin in their parents' frames (4, 2, 3), the hips' for the first."""

POINTS = np.array([place for places in SOLE.values() for place in places], dtype=np.float32)
CARRIERS = [LEG.index(part) for part, places in SOLE.items() for _ in places]
"""Points (3, 3) of a sole, and which joint of a leg carries each."""


@dataclass(eq=False)
class FootLock:
    """The lock of B characters. dt: seconds of a tick.

    shift, drift: (B, 2, 2) by how much each foot is moved along x and z, and how fast that changes. soles: (B, 2, 3, 3)
    where the points of the soles were, None before the first tick. All float64; they are replaced, never written into.
    """

    characters: int
    dt: float
    settings: FootLockSettings = FootLockSettings()
    shift: Array | None = None
    drift: Array | None = None
    soles: Array | None = None

    def held(self, pose: Pose) -> Pose:
        """The next pose, one tick later, with standing feet held in place and above ground."""
        how, (hips, turned, places) = self.settings, _legs(pose)
        soles = places[:, :, CARRIERS] + quat_rotated(turned[:, :, CARRIERS], POINTS)
        if self.soles is None or self.shift is None or self.drift is None:
            self.shift = self.drift = np.zeros((*soles.shape[:2], 2))
            self.soles = soles
        lowest = soles[..., 1].argmin(axis=2)[..., None, None]
        moved = np.take_along_axis(soles - self.soles, lowest, axis=2)[:, :, 0, ::2]
        faded, slower = damped(self.shift, self.drift, damping_of(how.fade), self.dt)
        held = self.shift - moved
        stands = pose.contacts[..., None] > how.stands
        stands &= np.linalg.norm(held, axis=-1, keepdims=True) < how.farthest
        stands &= np.linalg.norm(moved, axis=-1, keepdims=True) < how.swings * self.dt
        self.drift, self.shift, self.soles = np.where(stands, 0, slower), np.where(stands, held, faded), soles
        lift = np.maximum(-soles[..., 1].min(axis=2), 0)
        if not self.shift.any() and not lift.any():
            return pose
        target = places[:, :, 2] + np.stack([self.shift[..., 0], lift, self.shift[..., 1]], axis=-1)
        return replace(pose, rotations=_reached(pose.rotations, hips, turned, places, target))


def _legs(pose: Pose) -> tuple[Floats, Floats, Array]:
    """World rotations of the hips (B, 4), and rotations (B, 2, 4, 4) and places (B, 2, 4, 3) of the legs' joints."""
    hips = quat_product(pose.heading, pose.rotations[:, 0])
    place = pose.place[:, None]
    place[..., 1] = pose.height[:, None]
    local, above = pose.rotations[:, LEG_BONES], hips[:, None]
    turned, places = np.empty_like(local), np.empty((*local.shape[:3], 3))
    for joint, offset in enumerate(LEG_OFFSETS.astype(np.float32)):
        place = place + quat_rotated(above, offset)
        above = quat_product(above, local[:, :, joint])
        turned[:, :, joint], places[:, :, joint] = above, place
    return hips, turned, places


def _reached(rotations: Floats, hips: Floats, turned: Floats, places: Array, target: Array) -> Floats:
    """Rotations (B, J, 4) with ankles at targets (B, 2, 3), from those of :func:`_legs`."""
    hip, knee, ankle, goal = (p.reshape(-1, 3) for p in (*np.moveaxis(places[:, :, :3], 2, 0), target))
    thigh, shin, foot = (turned[:, :, joint] for joint in range(3))
    hinge = quat_rotated(shin, np.array([1, 0, 0], dtype=np.float32)).reshape(-1, 3).astype(np.float64)
    leg = Leg(hip, knee, ankle, hinge)
    turns = leg.turns(leg.eased(goal))
    new_thigh, new_shin = (
        quat_product(rotmat_to_quat(turn).astype(np.float32).reshape(-1, 2, 4), before)
        for turn, before in zip(turns, (thigh, shin), strict=True)
    )
    found = rotations.copy()
    found[:, LEG_BONES[:, 0]] = quat_product(conjugate(hips)[:, None], new_thigh)
    found[:, LEG_BONES[:, 1]] = quat_product(conjugate(new_thigh), new_shin)
    found[:, LEG_BONES[:, 2]] = quat_product(conjugate(new_shin), foot)
    return found
