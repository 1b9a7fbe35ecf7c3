"""How a skeleton's joints stand against the humanoid where its rest pose is no body: found from the frames.

Many files rest with all bones in one line, each along an axis of its own joint. What the rest pose does not tell is
then told by what bodies do: legs and arms hang at the sides of the trunk, knees and elbows are hinges. All is averaged
in the frame of each joint over all frames, and as the axes of joints lie along bones and hinges in such files, what
comes near those is taken to be just these, so that every take of a skeleton gets the same alignment.
"""

import numpy as np

from motet.motion.humanoid import LEFT_RIGHT, sided
from motet.motion.joint_map import JointMap
from motet.motion.rest_pose import (
    Aims,
    angle_between,
    direction,
    frame,
    humanoid_direction,
    middle,
    nearest_axes,
    swing,
    to_left,
    unit,
)
from motet.motion.rotations import Array

NEAR_AXES = 30.0
"""Degrees within which a joint's alignment is taken to be along its axes."""

ALONG_AXIS = 0.995
"""Cosine above which a bone lies along an axis of its joint."""

SMALL = 0.05
"""The weight of a limb's shortest turn beside its hinge, which counts by the sine of its bend."""


def alignments_of_frames(rotations: Array, positions: Array, joint_map: JointMap, aims: Aims) -> Array:
    """A (J, 3, 3) for all joints that are bones, from rotations (T, J, 3, 3) and positions (T, J, 3) of frames."""
    aligned = np.tile(np.eye(3), (rotations.shape[1], 1, 1))
    _trunk(aligned, rotations, positions, joint_map)
    pelvis = rotations[:, joint_map.joints["hips"]] @ aligned[joint_map.joints["hips"]]
    chest = rotations[:, joint_map.spine[-1]] @ aligned[joint_map.spine[-1]]
    for side in LEFT_RIGHT:
        _leg(aligned, rotations, positions, (joint_map, aims, side, pelvis))
        _arm(aligned, rotations, positions, (joint_map, aims, side, chest))
    return aligned


def _trunk(aligned: Array, rotations: Array, positions: Array, joint_map: JointMap) -> None:
    """Hips and back: up towards the arms, the joint that carries the arms and those above: up towards the head."""
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
        aligned[joint] = _near_axes(_mean(rotations[:, joint], frame(left, end - start)))


def _leg(aligned: Array, rotations: Array, positions: Array, about: tuple[JointMap, Aims, str, Array]) -> None:
    joint_map, aims, side, pelvis = about
    bones = [sided(side, part) for part in ("UpperLeg", "LowerLeg", "Foot", "Toes")]
    thigh, shin = (unit(direction(positions, joint_map.joints[bone], aims[bone])) for bone in bones[:2])
    hinge = np.cross(thigh, shin) + SMALL * pelvis[:, :, 0]
    for bone, along in zip(bones[:2], (thigh, shin), strict=True):
        _limb(aligned, rotations, joint_map.joints[bone], (bone, along, frame(hinge, -along)))
    shins = rotations[:, joint_map.joints[bones[1]]] @ aligned[joint_map.joints[bones[1]]]
    for bone in bones[2:]:
        if bone in joint_map.joints:
            joint = joint_map.joints[bone]
            toward = direction(positions, joint, aims[bone]) if aims[bone] else shins[:, :, 2]
            left = shins[:, :, 0]
            level = frame(left, np.cross(toward, left))
            slope = np.arctan2(-humanoid_direction(bone)[1], humanoid_direction(bone)[2])
            down = np.array([[1, 0, 0], [0, np.cos(slope), -np.sin(slope)], [0, np.sin(slope), np.cos(slope)]])
            _limb(aligned, rotations, joint, (bone, toward, level @ down.T))


def _arm(aligned: Array, rotations: Array, positions: Array, about: tuple[JointMap, Aims, str, Array]) -> None:
    joint_map, aims, side, chest = about
    sign = 1.0 if side == "left" else -1.0
    bones = [sided(side, part) for part in ("UpperArm", "LowerArm", "Hand")]
    upper = unit(direction(positions, joint_map.joints[bones[0]], aims[bones[0]]))
    lower = unit(direction(positions, joint_map.joints[bones[1]], aims[bones[1]])) if aims[bones[1]] else upper
    plain = swing(chest @ humanoid_direction(bones[0]), upper) @ chest
    up = -sign * np.cross(upper, lower) + SMALL * plain[:, :, 1]
    for bone, along in zip(bones[:2], (upper, lower), strict=True):
        _limb(aligned, rotations, joint_map.joints[bone], (bone, along, _arm_frame(sign * along, up)))
    forearm = rotations[:, joint_map.joints[bones[1]]] @ aligned[joint_map.joints[bones[1]]]
    if bones[2] in joint_map.joints:
        joint = joint_map.joints[bones[2]]
        along = direction(positions, joint, aims[bones[2]]) if aims[bones[2]] else sign * forearm[:, :, 0]
        _limb(aligned, rotations, joint, (bones[2], along, _arm_frame(sign * along, forearm[:, :, 1])))
    shoulder = joint_map.joints.get(sided(side, "Shoulder"))
    if shoulder is not None:
        aligned[shoulder] = _near_axes(_mean(rotations[:, shoulder], chest))


def _arm_frame(left: Array, up: Array) -> Array:
    left = unit(left)
    up = unit(up - np.sum(up * left, axis=-1, keepdims=True) * left)
    return np.stack([left, up, np.cross(left, up)], axis=-1)


def _limb(aligned: Array, rotations: Array, joint: int, about: tuple[str, Array, Array]) -> None:
    """A of a bone of a limb: near the joint's axes, and the bone where it really points."""
    bone, along, turns = about
    mean = _mean(rotations[:, joint], turns)
    local = unit(np.mean(np.swapaxes(rotations[:, joint], -1, -2) @ unit(along)[..., None], axis=0)[:, 0])
    axes = _near_axes(mean)
    if bone.endswith(("Foot", "Toes")) and np.abs(local).max() < ALONG_AXIS:
        aligned[joint] = axes
        return
    aligned[joint] = swing(axes @ humanoid_direction(bone), local) @ axes


def _near_axes(rotation: Array) -> Array:
    nearest = nearest_axes(rotation)
    return nearest if angle_between(rotation, nearest) < NEAR_AXES else rotation


def _mean(rotations: Array, turns: Array) -> Array:
    """The rotation (3, 3) nearest to all G^T H of rotations G and H (T, 3, 3)."""
    total = np.sum(np.swapaxes(rotations, -1, -2) @ turns, axis=0)
    u, _, v = np.linalg.svd(total)
    nearest: Array = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ v))]) @ v
    return nearest
