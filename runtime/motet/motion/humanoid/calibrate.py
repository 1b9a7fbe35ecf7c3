"""How a skeleton's joints stand against the humanoid where its rest pose is no body: found from the frames.

Many files rest with all bones in one line, each along an axis of its own joint. What the rest pose does not tell is
then told by what bodies do: legs and arms hang at the sides of the trunk, knees and elbows are hinges. All is averaged
in the frame of each joint over all frames, and as the axes of joints lie along bones and hinges in such files, what
comes near those is taken to be just these, so that every take of a skeleton gets the same alignment.
"""

from dataclasses import dataclass

import numpy as np

from motet.motion.humanoid.bones import ARM, LEFT_RIGHT, LEG, sided
from motet.motion.humanoid.joint_map import JointMap
from motet.motion.humanoid.rest_pose import (
    Aims,
    direction,
    frame,
    humanoid_direction,
    middle,
    nearest_axes,
    to_left,
    with_columns,
)
from motet.motion.rotations import Array, angle_between, product, swing, unit

SWING_WEIGHT = 0.05
"""The weight of a limb's shortest turn beside its hinge, which counts by the sine of its bend."""


@dataclass(frozen=True)
class _Frames:
    """Rotations (T, J, 3, 3) and positions (T, J, 3) of joints, which are bones, and what is found: A (J, 3, 3).

    along_axes: whether the joints' axes are along bones and hinges.
    """

    rotations: Array
    positions: Array
    joint_map: JointMap
    aims: Aims
    aligned: Array
    along_axes: bool

    def turns(self, joint: int) -> Array:
        """Rotations (T, 3, 3) of the humanoid's bone for a joint whose A is found."""
        return product(self.rotations[:, joint], self.aligned[joint])

    def toward(self, bone: str) -> Array:
        """Directions (T, 3) in which a bone points."""
        return unit(direction(self.positions, self.joint_map.joints[bone], self.aims[bone]))

    def settle(self, joint: int, turns: Array) -> None:
        """A of a joint from estimates (T, 3, 3) of its bone's rotation: what the convention says, or near the axes."""
        known = self.joint_map.axes.get(joint)
        mean = _mean(self.rotations[:, joint], turns)
        self.aligned[joint] = _known(known) if known else _near_axes(mean) if self.along_axes else mean

    def settle_limb(self, bone: str, along: Array, turns: Array) -> None:
        """The same for a bone of a limb, which then also points where it really does, along (T, 3)."""
        joint = self.joint_map.joints[bone]
        self.settle(joint, turns)
        local = _mean_direction(self.rotations[:, joint], along)
        # a cosine: feet count that lie along an axis of their joint
        if not bone.endswith(("Foot", "Toes")) or np.abs(local).max() > 0.995:
            start = self.aligned[joint] @ humanoid_direction(bone)
            self.aligned[joint] = swing(start, local) @ self.aligned[joint]


def axes_agree(rotations: Array, positions: Array, joint_map: JointMap, aims: Aims) -> bool:
    """Whether the axes that a convention says fit a skeleton: bones of limbs point along them, and left is left.

    Other skeletons can have the same names. rotations (T, J, 3, 3) and positions (T, J, 3) are those of frames.
    """
    bones = {bone: joint_map.joints[bone] for bone, ends in aims.items() if ends}
    expected = {joint: humanoid_direction(bone) for bone, joint in bones.items()}
    seen = {joint: direction(positions, joint, aims[bone]) for bone, joint in bones.items()}
    for joint, part in ((joint_map.joints["hips"], "UpperLeg"), (joint_map.spine[-1], "UpperArm")):
        expected[joint], seen[joint] = np.array([1.0, 0.0, 0.0]), to_left(positions, joint_map, part)
    known = [joint for joint in seen if joint in joint_map.axes]
    return bool(known) and all(
        _mean_direction(rotations[:, joint], seen[joint]) @ _known(joint_map.axes[joint]) @ expected[joint] > 0.7
        for joint in known
    )


def alignments_of_frames(
    rotations: Array, positions: Array, joint_map: JointMap, aims: Aims, along_axes: bool = True
) -> Array:
    """A (J, 3, 3) for all joints that are bones, from rotations (T, J, 3, 3) and positions (T, J, 3) of frames.

    along_axes: whether joints have axes along bones and hinges, as in files that rest with all bones in one line.
    """
    still = np.tile(np.eye(3), (rotations.shape[1], 1, 1))
    frames = _Frames(rotations, positions, joint_map, aims, still, along_axes)
    _trunk(frames)
    for side in LEFT_RIGHT:
        _leg(frames, side)
        _arm(frames, side)
    return frames.aligned


def _trunk(frames: _Frames) -> None:
    """Hips and back: up towards the arms, the joint that carries the arms and those above: up towards the head."""
    positions, joint_map = frames.positions, frames.joint_map
    legs, arms = (unit(to_left(positions, joint_map, part)) for part in ("UpperLeg", "UpperArm"))
    above = [*joint_map.neck, *([joint_map.joints["head"]] if "head" in joint_map.joints else [])]
    back = [joint_map.joints["hips"], *joint_map.spine, *above]
    chest, shoulders = len(joint_map.spine), middle(positions, joint_map, "UpperArm")
    for i, joint in enumerate(back):
        left = legs * (1 - i / chest) + arms * (i / chest) if i < chest else arms
        start = middle(positions, joint_map, "UpperLeg") if i == 0 else positions[:, joint]
        end = shoulders if i < chest else positions[:, back[-1]]
        if i == len(back) - 1:
            start, end = positions[:, back[max(i - 1, chest - 1)]], positions[:, joint]
        frames.settle(joint, frame(left, end - start))


def _leg(frames: _Frames, side: str) -> None:
    """Knees are hinges that bend backwards; feet and toes have the hinge's axis."""
    joints, bones = frames.joint_map.joints, [sided(side, part) for part in LEG]
    thigh, shin = (frames.toward(bone) for bone in bones[:2])
    hinge = np.cross(thigh, shin) + SWING_WEIGHT * frames.turns(joints["hips"])[:, :, 0]
    frames.settle_limb(bones[0], thigh, frame(hinge, -thigh))
    frames.settle_limb(bones[1], shin, frame(hinge, -shin))
    shins = frames.turns(joints[bones[1]])
    for bone in (bone for bone in bones[2:] if bone in joints):
        if not frames.aims[bone]:
            frames.settle(joints[bone], shins)
            continue
        along = frames.toward(bone)
        level = frame(shins[:, :, 0], np.cross(along, shins[:, :, 0]))
        slope = swing(np.array([0.0, 0.0, 1.0]), humanoid_direction(bone))
        frames.settle_limb(bone, along, level @ slope.T)


def _arm(frames: _Frames, side: str) -> None:
    """Elbows are hinges that bend forwards with the arms out to the sides; hands are in line with the forearms."""
    joints, bones = frames.joint_map.joints, [sided(side, part) for part in ARM]
    chest = frames.turns(frames.joint_map.spine[-1])
    if bones[0] in joints:
        frames.settle(joints[bones[0]], chest)
    sign = 1.0 if side == "left" else -1.0
    upper = frames.toward(bones[1])
    lower = frames.toward(bones[2]) if frames.aims[bones[2]] else upper
    plain = swing(chest @ humanoid_direction(bones[1]), upper) @ chest
    up = -sign * np.cross(upper, lower) + SWING_WEIGHT * plain[:, :, 1]
    frames.settle_limb(bones[1], upper, _arm_frame(sign * upper, up))
    frames.settle_limb(bones[2], lower, _arm_frame(sign * lower, up))
    if bones[3] in joints:
        forearm = frames.turns(joints[bones[2]])
        if frames.aims[bones[3]]:
            along = frames.toward(bones[3])
            frames.settle_limb(bones[3], along, _arm_frame(sign * along, forearm[:, :, 1]))
        else:
            frames.settle(joints[bones[3]], forearm)


def _arm_frame(left: Array, up: Array) -> Array:
    left = unit(left)
    up = unit(up - np.sum(up * left, axis=-1, keepdims=True) * left)
    return with_columns(left, up)


def _mean_direction(rotations: Array, along: Array) -> Array:
    """The mean direction (3,) in a joint's frame of vectors (T, 3), with the joint's rotations (T, 3, 3)."""
    return unit(np.einsum("tji,tj->i", rotations, unit(along)))


def _known(axes: str) -> Array:
    """The rotation (3, 3) with columns such as "-z x -y": the joint's axes that are left, up and forward."""
    words = axes.split()
    return np.stack([np.eye(3)["xyz".index(word[-1])] * (-1 if word[0] == "-" else 1) for word in words], axis=1)


def _near_axes(rotation: Array) -> Array:
    nearest = nearest_axes(rotation)
    # within 30 degrees the axes are along bones and hinges
    return nearest if angle_between(rotation, nearest) < 30 else rotation


def _mean(rotations: Array, turns: Array) -> Array:
    """The rotation (3, 3) nearest to all G^T H of rotations G and H (T, 3, 3)."""
    u, _, v = np.linalg.svd(np.einsum("tji,tjk->ik", rotations, turns))
    nearest: Array = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ v))]) @ v
    return nearest
