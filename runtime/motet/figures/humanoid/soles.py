"""A character on its own soles: shoes of any length and heads of any size stay above the ground.

The rotations of a motion are the humanoid's, whose feet are short and whose head is small. The toes of longer shoes
would dig in where a foot tips over them, and a body that is raised for these moments hovers in all others. So the body
is laid where feet stand flat, feet that would dig in while they tip are tipped less, and where soles, hands or head
would still be below the ground, the body is raised for that moment. The directions of all limbs stay as they are.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from motet.figures.feet.contacts import bell, rise, smoothed, windows
from motet.figures.humanoid.bones import (
    HUMANOID,
    LEFT_RIGHT,
    ground_under,
    sided,
    sole_points,
)
from motet.figures.humanoid.joint_map import Body
from motet.motion.kinematics import Transforms, places_of
from motet.motion.rotations import UP, Array, Mask, product, rotated, rotvec_to_rotmat, unit


@dataclass(frozen=True)
class Mesh:
    """The outermost points of a character's mesh. skin: joint -> points (P, 3), from the joint where angles are 0."""

    body: Body
    skin: Mapping[int, Array]

    def under(self, bone: str) -> list[int]:
        """The joints that are, or are below, that of a bone."""
        if bone not in self.body.joints:
            return []
        return self.body.skeleton.below(self.body.joints[bone])

    def has_soles(self) -> bool:
        """Whether a foot has points."""
        joints = self.under(sided("left", "Foot")) + self.under(sided("right", "Foot"))
        return any(joint in self.skin for joint in joints)

    def points(self, turned: Array, places: Array, joints: Iterable[int]) -> Array:
        """The points (T, P, 3) of joints, from rotations (T, J, 3, 3) and positions (T, J, 3) of all joints."""
        parts = [places[:, i, None] + rotated(turned[:, i, None], self.skin[i]) for i in joints if i in self.skin]
        return np.concatenate(parts, axis=1) if parts else np.zeros((len(turned), 0, 3))

    def lowest(self, turned: Array, places: Array) -> Array:
        """The height (T,) of the lowest point of feet, hands and head, without what hangs from the head."""
        # hair and hats may be below the ground, a head may not
        joints = self.under("head")[:1]
        for side in LEFT_RIGHT:
            joints += self.under(sided(side, "Foot")) + self.under(sided(side, "Hand"))
        return np.asarray(self.points(turned, places, joints)[..., 1].min(axis=1))


class Foot:
    """A foot of a character in T frames, whose sole may be turned towards the level: by no share of the way it is the
    humanoid's, by all of it it is flat. The toes turn by their own way, and go with their joint.

    mesh: the character's. source: rotations (T, B, 3, 3) of the humanoid's joints. turned, places: those of the
    character's joints.
    """

    def __init__(self, mesh: Mesh, side: str, source: Array, turned: Array, places: Array) -> None:
        foot_bone = sided(side, "Foot")
        toes_bone = sided(side, "Toes")
        self.toes_joints = mesh.under(toes_bone)
        self.foot_joints = [joint for joint in mesh.under(foot_bone) if joint not in self.toes_joints]
        self.tilt, self.foot_to_flat = _to_flat(source, foot_bone)
        _, self.toes_to_flat = _to_flat(source, toes_bone)

        # points from the ankle, and those of the toes from their joint
        foot_joint = mesh.body.joints[foot_bone]
        toes_joint = mesh.body.joints.get(toes_bone, foot_joint)
        from_ankle = places - places[:, [foot_joint]]
        self.ankle_height = places[:, foot_joint, 1]
        self.toes_place = from_ankle[:, toes_joint]
        self.foot_points = mesh.points(turned, from_ankle, self.foot_joints)
        self.toes_points = mesh.points(turned, places - places[:, [toes_joint]], self.toes_joints)

    def lowest(self, share: Array) -> Array:
        """The height (T,) of the lowest point where the sole is turned by shares (T,) of the way to the level."""
        # only heights count, so the middle row of each rotation is enough
        foot_up = rotvec_to_rotmat(share[:, None] * self.foot_to_flat)[:, 1, :, None]
        toes_up = rotvec_to_rotmat(share[:, None] * self.toes_to_flat)[:, 1, :, None]
        of_foot = (self.foot_points @ foot_up)[..., 0].min(axis=1, initial=np.inf)
        of_toes = (self.toes_points @ toes_up)[..., 0].min(axis=1, initial=np.inf)
        toes_height = (self.toes_place[:, None] @ foot_up)[:, 0, 0]
        return np.asarray(self.ankle_height + np.minimum(of_foot, toes_height + of_toes))

    def needed_share(self, ground: float, worth: float, fps: float) -> Array:
        """The share (T,) of the way to the level at which no point is below the ground, or which comes nearest to that.

        Less where that would raise the lowest point by less than ``worth``, so that no foot snaps for the sake of
        millimetres, and none of it where the foot neither stands nor tips; smoothed over time.
        """
        # no further up than the ground, and no further than a flat foot reaches
        as_it_is = self.lowest(np.zeros(len(self.tilt)))
        reachable = np.minimum(self.lowest(np.ones(len(self.tilt))), ground)
        # the least share that gets there, by bisection in all frames at once
        least = np.zeros(len(self.tilt))
        most = np.ones(len(self.tilt))
        # to a hundredth of a degree
        for _ in range(14):
            middle = (least + most) / 2
            above = self.lowest(middle) >= reachable
            most = np.where(above, middle, most)
            least = np.where(above, least, middle)
        # feet of a body that lies or turns over are left as they are
        # up to 75 degrees a foot stands or tips; from 95 on it is of somebody who lies or turns over
        stands_or_tips = 1 - rise(self.tilt, np.radians(75), np.radians(95))
        share = most * rise(reachable - as_it_is, 0.0, worth) * stands_or_tips
        # by a window of 0.04 s standard deviation
        return np.clip(smoothed(share[:, None, None], 0.04, fps)[:, 0, 0], 0, 1)

    def turn(self, turned: Array, share: Array) -> None:
        """Turn the foot's joints in ``turned`` by shares (T,) of the way to the level."""
        for joints, to_flat in (
            (self.foot_joints, self.foot_to_flat),
            (self.toes_joints, self.toes_to_flat),
        ):
            turn = rotvec_to_rotmat(share[:, None] * to_flat)
            for joint in joints:
                turned[:, joint] = product(turn, turned[:, joint])


def _to_flat(source: Array, bone: str) -> tuple[Array, Array]:
    """The angle (T,) between the sole's normal of a bone and the vertical, and the rotation vector (T, 3) that levels
    it, from rotations (T, B, 3, 3) of the humanoid's joints."""
    # the humanoid's sole is level at rest, so its y axis is the sole's normal
    normal = source[:, HUMANOID.index(bone), :, 1]
    tilt = np.arccos(np.clip(normal @ UP, -1, 1))
    return tilt, unit(np.cross(normal, UP)) * tilt[:, None]


def on_own_soles(
    mesh: Mesh,
    source: Transforms,
    turned: Array,
    path: Array,
    scale: float,
    fps: float,
) -> tuple[Array, Array]:
    """A character's rotations (T, J, 3, 3) with feet tipped less where they would dig in, and how far (T,) its root is
    raised above its path, in the skeleton's unit.

    source: rotations (T, B, 3, 3) and positions (T, B, 3) of the humanoid's joints, in metres. turned: rotations of the
    character's joints. path: (T, 3), where its root would be. scale: the skeleton's units for a metre of the humanoid.
    """
    places = places_of(mesh.body.skeleton, turned) + path[:, None]
    feet = [Foot(mesh, side, source[0], turned, places) for side in LEFT_RIGHT]

    # the body is laid where feet stand
    raised = _rise_to_the_ground(feet, sole_points(*source), scale, fps)

    # feet that would dig in are tipped less
    turned = turned.copy()
    for foot in feet:
        # 1.5 cm below the ground, on a figure of the humanoid's size, are well worth tipping a foot less
        foot.turn(turned, foot.needed_share(-raised, 0.015 * scale, fps))

    # where soles, hands or head would still be below the ground, the body is raised for that moment
    places = places_of(mesh.body.skeleton, turned) + path[:, None]
    # half a centimetre below the ground, on a figure of the humanoid's size, is left as it is
    depth = -0.005 * scale - raised - mesh.lowest(turned, places)
    # a tenth of a second before and after the moment
    return turned, raised + _envelope(np.maximum(depth, 0.0), 0.1 * fps)


def _rise_to_the_ground(feet: Sequence[Foot], soles: Array, scale: float, fps: float) -> float:
    """How far feet are raised so that they stand on the ground: flat, in the moments in which one stands; else, as a
    body that lies or jumps, so that the lowest point is below it in 5 % of the frames.

    soles: (T, 6, 3) of the humanoid, whose height counts where it is far from the ground.
    """
    frames = len(soles)
    # moments in which a foot stands flat
    heights, stands = _standing_feet(soles, fps)
    flat = np.stack([foot.lowest(np.ones(frames)) for foot in feet], axis=1)
    # up to this tilt a foot that stands is meant to be flat
    stands &= np.stack([foot.tilt <= np.radians(20) for foot in feet], axis=1) & np.isfinite(flat)
    # a foot that stands in a tenth of the frames tells where the ground is
    if stands.any(axis=1).mean() >= 0.1:
        ground = float(np.median(heights[stands]))
        raised = -float(np.median(flat[stands]))
    else:
        ground = ground_under(soles)
        lowest = np.min([foot.lowest(np.zeros(frames)) for foot in feet], axis=0)
        raised = -float(np.percentile(lowest, 5))
    # a motion within 0.1 m of the ground is meant to stand on it, and is laid on it
    return raised + (scale * ground if abs(ground) > 0.1 else 0.0)


def _standing_feet(soles: Array, fps: float) -> tuple[Array, Mask]:
    """The height (T, 2) of the lowest point of each foot, and whether it is the lower one and stands, from points
    (T, 6, 3) of soles: heel, ball and tip of each foot."""
    # the lower foot stands where its heel and its ball are both still
    points = soles.reshape(len(soles), 2, 3, 3)
    heights = points[..., 1].min(axis=2)
    lower = heights <= heights.min(axis=1, keepdims=True)
    if len(soles) < 2:
        return heights, lower
    speeds = np.linalg.norm(np.gradient(points[:, :, :2], axis=0), axis=-1).max(axis=2) * fps
    # metres a second below which heel and ball of a foot that stands both move
    return heights, (speeds < 0.3) & lower


def _envelope(values: Array, reach: float) -> Array:
    """A smooth curve (T,) that is nowhere below values (T,), wider than they by ``reach`` frames on either side."""
    frames = max(1, round(reach))
    highest = windows(np.pad(values, frames, mode="edge"), frames).max(axis=1)
    return np.convolve(highest, bell(frames), mode="valid")
