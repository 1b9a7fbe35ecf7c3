"""How a skeleton's joints stand in its rest pose against the humanoid's T-pose.

For every joint that is a bone a constant rotation A is found, so that the bone's rotation on the humanoid is G A with G
the joint's rotation in the world. Where the rest pose of a skeleton is a body that stands (T, A, arms down; facing
anywhere), A turns the humanoid's T-pose into it: trunk and shoulders as a whole, the bones of limbs by the shortest
turn to where they point, each carried along by the one before it, so that no twist is added; feet by their heading
alone, as soles are flat in a rest pose whatever the slope of the line from ankle to toes.
"""

from collections.abc import Mapping

import numpy as np

from motet.motion.humanoid.bones import ARM, HUMANOID, LEFT_RIGHT, LEG, sided
from motet.motion.humanoid.joint_map import JointMap
from motet.motion.rotations import Array, angle_between, frames_last, rotvec_to_rotmat, swing, unit
from motet.motion.skeleton import Skeleton

LIMB_BONES = tuple(tuple(sided(side, part) for part in limb) for side in LEFT_RIGHT for limb in (LEG, ARM[1:]))

Aims = Mapping[str, tuple[int, ...]]
"""For a bone of a limb the joints whose mean place it points to."""


def humanoid_direction(bone: str) -> Array:
    """Where a bone of the humanoid points in the T-pose (3,)."""
    children = HUMANOID.children[HUMANOID.index(bone)]
    return unit(HUMANOID.offsets[children[0]])


def aims_of(skeleton: Skeleton, joint_map: JointMap) -> Aims:
    """What each bone of a limb points to: the limb's next bone, or the joints after it but the thumb; none if none.

    A foot without toes whose tip lies in line with the shin, as in old files, is no more than the shin's end.
    """
    aims = {}
    for limb in LIMB_BONES:
        for bone, after in zip(limb, (*limb[1:], ""), strict=True):
            if bone in joint_map.joints:
                joint = joint_map.joints[bone]
                aims[bone] = (joint_map.joints[after],) if after in joint_map.joints else _ends(skeleton, joint)
    for foot, toes, shin in (
        (sided(side, "Foot"), sided(side, "Toes"), sided(side, "LowerLeg")) for side in LEFT_RIGHT
    ):
        if aims.get(foot) and toes not in joint_map.joints:
            ends = [unit(direction(skeleton.rest_positions, joint_map.joints[i], aims[i])) for i in (shin, foot)]
            # a foot that continues the shin within 15 degrees has no direction of its own
            aims[foot] = () if ends[0] @ ends[1] > np.cos(np.radians(15)) else aims[foot]
    return aims


def _ends(skeleton: Skeleton, joint: int) -> tuple[int, ...]:
    children = [child for child in skeleton.children[joint] if "thumb" not in skeleton.names[child].lower()]
    apart = tuple(child for child in children if np.any(skeleton.offsets[child]))
    return apart or next((ends for child in children if (ends := _ends(skeleton, child))), ())


def direction(positions: Array, joint: int, aims: tuple[int, ...]) -> Array:
    """Vectors (..., 3) from a joint to the middle of what it points to, from positions (..., J, 3)."""
    middle: Array = positions[..., list(aims), :].mean(axis=-2) - positions[..., joint, :]
    return middle


def middle(positions: Array, joint_map: JointMap, part: str) -> Array:
    """The middle (..., 3) between a joint of the left and its partner."""
    left, right = (positions[..., joint_map.joints[sided(side, part)], :] for side in LEFT_RIGHT)
    between: Array = (left + right) / 2
    return between


def to_left(positions: Array, joint_map: JointMap, part: str) -> Array:
    """Vectors (..., 3) from a joint of the right to its partner on the left."""
    left, right = (positions[..., joint_map.joints[sided(side, part)], :] for side in LEFT_RIGHT)
    across: Array = left - right
    return across


def frame(left: Array, up: Array) -> Array:
    """Rotations (..., 3, 3) whose columns are left, up and forward: up as it is given, left at right angles to it."""
    up = unit(up)
    left = unit(left - np.sum(left * up, axis=-1, keepdims=True) * up)
    return with_columns(left, up)


def with_columns(left: Array, up: Array) -> Array:
    """Rotations (..., 3, 3) whose columns are left, up and forward: left and up of length 1 and at right angles."""
    rotations = frames_last((*up.shape, 3))
    rotations[..., 0], rotations[..., 1], rotations[..., 2] = left, up, np.cross(left, up)
    return rotations


def trunk_up(positions: Array, joint_map: JointMap) -> Array:
    """Directions (..., 3) from the middle of the legs' joints to that of the arms'."""
    return unit(middle(positions, joint_map, "UpperArm") - middle(positions, joint_map, "UpperLeg"))


def legs_up(positions: Array, joint_map: JointMap) -> Array:
    """Directions (..., 3) from the feet to the legs' joints, the mean of both sides."""
    legs = [
        positions[..., joint_map.joints[sided(side, "UpperLeg")], :]
        - positions[..., joint_map.joints[sided(side, "Foot")], :]
        for side in LEFT_RIGHT
    ]
    return unit(unit(legs[0]) + unit(legs[1]))


def body_frame(rest: Array, joint_map: JointMap, aims: Aims, exact: bool = False) -> Array | None:
    """Left, up and forward (3, 3) of a pose (J, 3) that is a standing body, else None.

    A body stands where both legs point one way and the trunk the other, feet forward, and left is left. Axes near
    those of the coordinates, as they are in every rest pose that somebody made, are taken to be just these.
    """
    across, up = to_left(rest, joint_map, "UpperLeg"), legs_up(rest, joint_map)
    if not np.linalg.norm(across) or abs(float(np.dot(unit(across), up))) > 0.9:
        return None
    body = frame(across, up)
    body = body if exact else _snapped(body)
    legs = [body.T @ unit(direction(rest, joint_map.joints[bone], aims[bone])) for bone in _leg_bones()]
    feet = [body.T @ unit(direction(rest, joint_map.joints[bone], aims[bone])) for bone in _feet(aims)]
    arms = [float((body.T @ to_left(rest, joint_map, part))[0]) for part in ("UpperArm", "LowerArm")]
    stands = all(leg[1] < -0.75 for leg in legs) and float(trunk_up(rest, joint_map) @ body[:, 1]) > 0.85
    return body if stands and all(foot[2] > 0.2 for foot in feet) and min(arms) > 0 else None


def moves(rest: Array, joint_map: JointMap, aims: Aims) -> bool:
    """Whether a rest pose (J, 3) is one out of a motion: limbs of left and right differ, and are not along axes."""
    body = frame(to_left(rest, joint_map, "UpperLeg"), trunk_up(rest, joint_map))
    bones = [
        (bone, sided("right", bone.removeprefix("left"))) for limb in LIMB_BONES[:2] for bone in limb[:2] if aims[bone]
    ]
    left, right = (
        np.array([unit(direction(rest, joint_map.joints[pair[side]], aims[pair[side]])) for pair in bones])
        for side in (0, 1)
    )
    alike = np.sum((left @ body) * (right @ body) * [-1.0, 1.0, 1.0], axis=-1)
    along = np.abs([left, right]).max(axis=-1)
    # limbs that rest mirror each other within 6 degrees; bones within 18 of axes are in line as nobody has posed them
    return bool(alike.min() < np.cos(np.radians(6)) and along.min() < np.cos(np.radians(18)))


def _leg_bones() -> list[str]:
    return [sided(side, part) for side in LEFT_RIGHT for part in LEG[:2]]


def _feet(aims: Aims) -> list[str]:
    return [bone for bone in (sided(side, "Foot") for side in LEFT_RIGHT) if aims[bone]]


def _snapped(body: Array) -> Array:
    nearest = nearest_axes(body)
    return nearest if angle_between(body, nearest) < 15 else body


def nearest_axes(rotation: Array) -> Array:
    """The rotation (3, 3) nearest to one given among the 24 that turn coordinate axes into coordinate axes."""
    nearest: Array = AXES_ROTATIONS[int(np.argmax(np.sum(AXES_ROTATIONS * rotation, axis=(1, 2))))]
    return nearest


def _axes_rotations() -> Array:
    signed = [sign * axis for axis in np.eye(3) for sign in (1.0, -1.0)]
    return np.array([np.stack([x, y, np.cross(x, y)], axis=1) for x in signed for y in signed if not np.dot(x, y)])


AXES_ROTATIONS = _axes_rotations()


def alignments_of_pose(
    skeleton: Skeleton, pose: tuple[Array, Array], body: Array, joint_map: JointMap, aims: Aims
) -> Array:
    """A (J, 3, 3) for all joints that are bones, the identity for others, from a pose that is a standing body.

    pose: rotations (J, 3, 3) and positions (J, 3) of the joints in that pose; body: its frame.
    """
    rotations, rest = pose
    turns = _known_turns(body, joint_map) if joint_map.rest is not None else _found_turns(rest, body, joint_map, aims)
    aligned = np.tile(np.eye(3), (len(rest), 1, 1))
    for bone, joint in joint_map.joints.items():
        aligned[joint] = rotations[joint].T @ turns[bone]
    aligned[joint_map.carrier(skeleton)] = rotations[joint_map.carrier(skeleton)].T @ turns["hips"]
    for chain, joints in (("spine", joint_map.spine), ("neck", joint_map.neck)):
        for joint in joints:
            aligned[joint] = rotations[joint].T @ turns.get(chain, body)
    return aligned


def _known_turns(body: Array, joint_map: JointMap) -> dict[str, Array]:
    """Rotations (3, 3) of the humanoid's bones in a pose that the convention says."""
    known = joint_map.rest or {}
    bones = (*joint_map.joints, "spine", "neck")
    return {bone: body @ rotvec_to_rotmat(np.radians(known.get(bone, (0.0, 0.0, 0.0)))) for bone in bones}


def _found_turns(rest: Array, body: Array, joint_map: JointMap, aims: Aims) -> dict[str, Array]:
    """Rotations (3, 3) of the humanoid's bones that make its limbs point where those of the pose do."""
    turns = dict.fromkeys(("hips", "head", *(sided(side, "Shoulder") for side in LEFT_RIGHT)), body)
    for limb in LIMB_BONES:
        carried = body
        for bone in limb:
            if bone in joint_map.joints:
                carried = turns[bone] = _turn(bone, rest, body, carried, joint_map, aims)
    return turns


def _turn(bone: str, rest: Array, body: Array, carried: Array, joint_map: JointMap, aims: Aims) -> Array:
    """The rotation (3, 3) of the humanoid's bone in this pose; ``carried`` is that of the bone before it."""
    if bone.endswith("Toes") or not aims[bone]:
        return carried
    target = unit(direction(rest, joint_map.joints[bone], aims[bone]))
    if bone.endswith("Foot"):
        return _foot_turn(target, body, carried)
    turned = swing(carried @ humanoid_direction(bone), target) @ carried
    straight = float(carried @ humanoid_direction(bone) @ target) > 0.8
    return turned if straight or not bone.endswith("Hand") else carried


def _foot_turn(target: Array, body: Array, leg: Array) -> Array:
    """A foot's rotation: its heading turned to the target's, rolled with the leg where it lies in the leg's plane.

    Where legs are spread at rest, some figures stand on flat soles and others have feet that are at right angles to
    the legs, as those of ASF files; the latter lie in the plane of leg and forward direction.
    """
    base = leg if abs(float(leg[:, 0] @ target)) < abs(float(body[:, 0] @ target)) - 1e-3 else body
    x, y, z = base.T @ target
    if z < 0.5 * np.hypot(x, y) and z < 0.5:
        return swing(base @ humanoid_direction("leftFoot"), target) @ base
    flat: Array = base @ swing(np.array([0.0, 0.0, 1.0]), np.array([x, 0.0, z]))
    return flat
