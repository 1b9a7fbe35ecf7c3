"""How a skeleton's joints stand against the humanoid: from a pose that is a standing body, or from frames.

Every joint that is a bone gets a constant rotation A, so that the bone's rotation on the humanoid is G A with G
the joint's rotation in the world. Where the rest pose of a skeleton is a body that stands (T, A, arms down; facing
anywhere), A turns the humanoid's T-pose into it: trunk and shoulders as a whole, the bones of limbs by the shortest
turn to where they point, each carried along by the one before it, so that no twist is added; feet by their heading
alone, as soles are flat in a rest pose whatever the slope of the line from ankle to toes.

Many files rest with all bones in one line instead, each along an axis of its own joint. Frames then show it: legs
and arms hang at the sides of the trunk, knees and elbows are hinges. All is averaged in the frame of each joint over
all frames; results near axes are taken to be exactly these, so that every take of a skeleton gets the same alignment.
"""

from collections.abc import Sequence
from itertools import permutations

import numpy as np

from motet.figures.humanoid.bones import ARM, LEFT_RIGHT, LEG, SIDES, limb_of, sided
from motet.figures.humanoid.joint_map import LIMB_BONES, Body, humanoid_direction
from motet.motion.rotations import (
    Array,
    frames_last,
    identities,
    product,
    rotvec_to_rotmat,
    swing,
    unit,
)


def _axes_turns() -> Array:
    """The rotations (24, 3, 3) that turn coordinate axes into coordinate axes."""
    directions = np.kron(np.eye(3), [[1.0], [-1.0]])
    turns = []
    for x, y in permutations(directions, 2):
        if not np.dot(x, y):
            turns.append(np.stack([x, y, np.cross(x, y)], axis=1))
    return np.array(turns)


AXES_TURNS = _axes_turns()
"""The rotations (24, 3, 3) that turn coordinate axes into coordinate axes."""


def frame(left: Array, up: Array, upright: bool = True) -> Array:
    """Rotations (..., 3, 3) whose columns are left, up and forward: up as passed, or left, the other square to it."""
    if upright:
        up = unit(up)
        left = _square_to(left, up)
    else:
        left = unit(left)
        up = _square_to(up, left)
    rotations = frames_last((*up.shape, 3))
    rotations[..., 0] = left
    rotations[..., 1] = up
    rotations[..., 2] = np.cross(left, up)
    return rotations


def _square_to(vectors: Array, axis: Array) -> Array:
    """The directions (..., 3) of vectors' parts at right angles to unit vectors (..., 3)."""
    return unit(vectors - np.sum(vectors * axis, axis=-1, keepdims=True) * axis)


def body_frame(pose: Array, body: Body, exact: bool = False) -> Array | None:
    """Left, up and forward (3, 3) of a pose (J, 3) that is a standing body, else None.

    A body stands where both legs point one way and the trunk the other, feet forward, and left is left. Axes near
    those of the coordinates, as they are in every rest pose that somebody made, are taken to be exactly these.
    """
    # legs decide: across them is left, along them is up
    across = body.to_left(pose, "UpperLeg")
    up = body.legs_up(pose)
    if not np.linalg.norm(across) or abs(float(np.dot(unit(across), up))) > 0.9:
        return None
    axes = frame(across, up)
    if not exact:
        axes = _near_axes(axes, 15)
    return axes if _stands(pose, body, axes) else None


def _stands(pose: Array, body: Body, axes: Array) -> bool:
    """Whether a pose (J, 3) stands, seen from axes (3, 3) left, up and forward: legs down, trunk up, feet forward, and
    the left arm on the left."""
    for side in LEFT_RIGHT:
        for part in LEG[:2]:
            if not (axes.T @ body.direction(pose, sided(side, part)))[1] < -0.75:
                return False
        foot = sided(side, "Foot")
        if body.aims[foot] and not (axes.T @ body.direction(pose, foot))[2] > 0.2:
            return False
    if not float(body.trunk_up(pose) @ axes[:, 1]) > 0.85:
        return False
    return all(float((axes.T @ body.to_left(pose, part))[0]) > 0 for part in ("UpperArm", "LowerArm"))


def rests_in_motion(body: Body) -> bool:
    """Whether the rest pose is one out of a motion: limbs of left and right differ, and are not along axes."""
    # limbs seen from the body, of both sides
    rest = body.skeleton.rest_positions
    axes = frame(body.to_left(rest, "UpperLeg"), body.trunk_up(rest))
    parts = [part for part in (*LEG[:2], *ARM[1:3]) if body.aims[sided("left", part)]]
    left = np.array([body.direction(rest, sided("left", part)) for part in parts])
    right = np.array([body.direction(rest, sided("right", part)) for part in parts])
    mirrored_cosine = np.sum((left @ axes) * (right @ axes) * [-1.0, 1.0, 1.0], axis=-1)
    along = np.abs([left, right]).max(axis=-1)
    # limbs that rest mirror each other within 6 degrees; bones within 18 of axes are in line as nobody has posed them
    return bool(mirrored_cosine.min() < np.cos(np.radians(6)) and along.min() < np.cos(np.radians(18)))


def _near_axes(rotation: Array, degrees: float) -> Array:
    """The nearest of :data:`AXES_TURNS` to a rotation (3, 3) if it is within ``degrees`` of it, else the rotation."""
    # the trace of the product is largest for the nearest rotation, and gives the angle to it
    nearest: Array = AXES_TURNS[int(np.argmax(np.sum(AXES_TURNS * rotation, axis=(1, 2))))]
    angle = np.arccos(np.clip((np.sum(rotation * nearest) - 1) / 2, -1, 1))
    return nearest if np.degrees(angle) < degrees else rotation


def alignments_of_pose(body: Body, rotations: Array, pose: Array, axes: Array) -> Array:
    """A (J, 3, 3) for all joints that are bones, the identity for others, from a pose that is a standing body.

    rotations: (J, 3, 3) and pose: positions (J, 3) of the joints in that pose; axes: its left, up and forward (3, 3).
    """
    # how the humanoid's bones are turned in that pose: known of the convention, or as the limbs point
    joint_map = body.joint_map
    if joint_map.rest is None:
        turns = _turns_of_pose(body, pose, axes)
    else:
        turns = {}
        for bone in (*joint_map.joints, "spine", "neck"):
            known = joint_map.rest.get(bone, (0.0, 0.0, 0.0))
            turns[bone] = axes @ rotvec_to_rotmat(np.radians(known))

    # A is what is left between a joint's rotation and its bone's
    wanted = {joint: turns[bone] for bone, joint in joint_map.joints.items()}
    wanted[joint_map.carrier(body.skeleton)] = turns["hips"]
    wanted |= dict.fromkeys(joint_map.spine, turns.get("spine", axes))
    wanted |= dict.fromkeys(joint_map.neck, turns.get("neck", axes))
    aligned = identities(len(pose))
    for joint, turn in wanted.items():
        aligned[joint] = rotations[joint].T @ turn
    return aligned


def _turns_of_pose(body: Body, pose: Array, axes: Array) -> dict[str, Array]:
    """Rotations (3, 3) of the humanoid's bones that make its limbs point where those of the pose do."""
    turns = dict.fromkeys(("hips", "head", *(sided(side, "Shoulder") for side in LEFT_RIGHT)), axes)
    for limb in LIMB_BONES:
        carried = axes  # the rotation of the bone before
        for bone in limb:
            if bone not in body.joints:
                continue
            if body.aims[bone] and not bone.endswith("Toes"):
                target = body.direction(pose, bone)
                start = carried @ humanoid_direction(bone)
                if bone.endswith("Foot"):
                    carried = _foot_turn(target, axes, carried)
                elif not bone.endswith("Hand") or float(start @ target) > 0.8:
                    carried = swing(start, target) @ carried
            turns[bone] = carried
    return turns


def _foot_turn(target: Array, body: Array, leg: Array) -> Array:
    """A foot's rotation: its heading turned to the target's, rolled with the leg where it lies in the leg's plane.

    Where legs are spread at rest, some figures stand on flat soles and others have feet that are at right angles to
    the legs, as those of ASF files; the latter lie in the plane of leg and forward direction.
    """
    # which of both the foot goes with
    base = leg if abs(float(leg[:, 0] @ target)) < abs(float(body[:, 0] @ target)) - 1e-3 else body
    x, y, z = base.T @ target
    if z < 0.5 * np.hypot(x, y) and z < 0.5:
        return swing(base @ humanoid_direction("leftFoot"), target) @ base
    return base @ swing(np.array([0.0, 0.0, 1.0]), np.array([x, 0.0, z]))


def axes_agree(body: Body, rotations: Array, positions: Array) -> bool:
    """Whether a skeleton has the axes that its convention states: bones of limbs point along them, and left is left.

    Other skeletons can have the same names. rotations (T, J, 3, 3) and positions (T, J, 3) are those of frames.
    """
    joint_map = body.joint_map
    # for each joint a direction of the humanoid's bone, and the same of the figure's in all frames
    directions = {}
    for bone, ends in body.aims.items():
        if ends:
            directions[body.joints[bone]] = (
                humanoid_direction(bone),
                body.along(positions, bone),
            )
    to_left = np.array([1.0, 0.0, 0.0])
    directions[body.joints["hips"]] = (to_left, body.to_left(positions, "UpperLeg"))
    directions[joint_map.spine[-1]] = (to_left, body.to_left(positions, "UpperArm"))

    # seen from the joints they have to be the same directions
    known = [joint for joint in directions if joint in joint_map.axes]
    for joint in known:
        of_humanoid, in_frames = directions[joint]
        in_joint = _mean_direction(rotations[:, joint], in_frames)
        if not in_joint @ _known_axes(joint_map.axes[joint]) @ of_humanoid > 0.7:
            return False
    return bool(known)


def _mean_direction(rotations: Array, along: Array) -> Array:
    """The mean direction (3,) in a joint's frame of vectors (T, 3), with the joint's rotations (T, 3, 3)."""
    return unit(np.einsum("tji,tj->i", rotations, unit(along)))


def _known_axes(axes: str) -> Array:
    """The rotation (3, 3) with columns such as "-z x -y": the joint's axes that are left, up and forward."""
    columns = [np.eye(3)["xyz".index(word[-1])] * (-1 if word[0] == "-" else 1) for word in axes.split()]
    return np.stack(columns, axis=1)


class Calibration:
    """A (J, 3, 3), as ``aligned``, of all joints that are bones, from rotations (T, J, 3, 3) and positions (T, J, 3) of
    frames.

    along_axes: whether joints have axes along bones and hinges, as in files that rest with all bones in one line.
    """

    HINGE = 0.05
    """The weight of a limb's shortest turn beside its hinge, which counts by the sine of its bend."""

    def __init__(self, body: Body, rotations: Array, positions: Array, along_axes: bool) -> None:
        self.body = body
        self.rotations = rotations
        self.positions = positions
        self.along_axes = along_axes
        self.aligned = identities(rotations.shape[1])
        # each stage builds on the joints settled before: trunk, then legs from the hips, and arms from the chest
        self._trunk()
        for side, sign in SIDES:
            self._leg(limb_of(side, LEG))
            self._arm(limb_of(side, ARM), sign)

    def _turns(self, joint: int) -> Array:
        """Rotations (T, 3, 3) of the humanoid's bone for a joint whose A is settled."""
        return product(self.rotations[:, joint], self.aligned[joint])

    def _direction(self, bone: str) -> Array:
        """Directions (T, 3) in which a bone points."""
        return self.body.direction(self.positions, bone)

    def _settle(self, joint: int, turns: Array) -> None:
        """Set A of a joint from estimates (T, 3, 3) of its bone's rotation: as its convention states, or near axes."""
        known = self.body.joint_map.axes.get(joint)
        if known:
            self.aligned[joint] = _known_axes(known)
            return
        # the rotation nearest to all from the joint's to its bone's (Kabsch 1976)
        u, _, v = np.linalg.svd(np.einsum("tji,tjk->ik", self.rotations[:, joint], turns))
        mean: Array = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ v))]) @ v
        self.aligned[joint] = _near_axes(mean, 30) if self.along_axes else mean

    def _settle_limb(self, bone: str, along: Array, turns: Array) -> None:
        """The same for a bone of a limb, which then also points along its real direction (T, 3)."""
        joint = self.body.joints[bone]
        self._settle(joint, turns)
        local = _mean_direction(self.rotations[:, joint], along)
        # a cosine: feet count that lie along an axis of their joint
        if not bone.endswith(("Foot", "Toes")) or np.abs(local).max() > 0.995:
            start = self.aligned[joint] @ humanoid_direction(bone)
            self.aligned[joint] = swing(start, local) @ self.aligned[joint]

    def _trunk(self) -> None:
        """Hips and back: up towards the arms, the joint that carries the arms and those above: up towards the head."""
        body = self.body
        back = [
            body.joints["hips"],
            *body.joint_map.spine,
            *body.joint_map.neck_and_head,
        ]
        chest = len(body.joint_map.spine)
        legs_left = unit(body.to_left(self.positions, "UpperLeg"))
        arms_left = unit(body.to_left(self.positions, "UpperArm"))
        for i, joint in enumerate(back):
            # left goes over from that of the legs to that of the arms
            left = legs_left * (1 - i / chest) + arms_left * (i / chest) if i < chest else arms_left
            self._settle(joint, frame(left, self._up(i, back, chest)))

    def _up(self, i: int, back: list[int], chest: int) -> Array:
        """Vectors (T, 3) up from the i-th joint of the back; from the joint below to the last."""
        positions = self.positions
        if i == len(back) - 1:
            return positions[:, back[i]] - positions[:, back[max(i - 1, chest - 1)]]
        start = self.body.middle(positions, "UpperLeg") if i == 0 else positions[:, back[i]]
        end = self.body.middle(positions, "UpperArm") if i < chest else positions[:, back[-1]]
        return end - start

    def _leg(self, bones: Sequence[str]) -> None:
        """Knees are hinges that bend backwards; feet and toes have the hinge's axis."""
        joints = self.body.joints
        upper_leg, lower_leg, *foot_and_toes = bones
        thigh = self._direction(upper_leg)
        shin = self._direction(lower_leg)
        hinge = np.cross(thigh, shin) + self.HINGE * self._turns(joints["hips"])[:, :, 0]
        self._settle_limb(upper_leg, thigh, frame(hinge, -thigh))
        self._settle_limb(lower_leg, shin, frame(hinge, -shin))
        for bone in foot_and_toes:
            if bone in joints:
                self._foot(bone, self._turns(joints[lower_leg]))

    def _foot(self, bone: str, shin_turns: Array) -> None:
        """A foot, or toes, slopes against the level as the humanoid's does; without a direction it turns with the shin
        (T, 3, 3)."""
        if not self.body.aims[bone]:
            self._settle(self.body.joints[bone], shin_turns)
            return
        along = self._direction(bone)
        to_left = shin_turns[:, :, 0]
        level = frame(to_left, np.cross(along, to_left))
        slope = swing(np.array([0.0, 0.0, 1.0]), humanoid_direction(bone))
        self._settle_limb(bone, along, level @ slope.T)

    def _arm(self, bones: Sequence[str], sign: float) -> None:
        """Elbows are hinges that bend forwards with the arms out to the sides; hands are in line with the forearms."""
        joints = self.body.joints
        shoulder, upper_arm, forearm, hand = bones
        chest_turns = self._turns(self.body.joint_map.spine[-1])
        if shoulder in joints:
            self._settle(joints[shoulder], chest_turns)

        # up is the hinge's axis, and where the arm is straight that of the shortest turn from the chest
        upper = self._direction(upper_arm)
        lower = self._direction(forearm) if self.body.aims[forearm] else upper
        shortest = swing(chest_turns @ humanoid_direction(upper_arm), upper) @ chest_turns
        up = -sign * np.cross(upper, lower) + self.HINGE * shortest[:, :, 1]
        self._settle_limb(upper_arm, upper, frame(sign * upper, up, upright=False))
        self._settle_limb(forearm, lower, frame(sign * lower, up, upright=False))
        if hand in joints:
            self._hand(hand, self._turns(joints[forearm]), sign)

    def _hand(self, hand: str, forearm_turns: Array, sign: float) -> None:
        """A hand without fingers turns with the forearm (T, 3, 3); another points along its fingers."""
        if not self.body.aims[hand]:
            self._settle(self.body.joints[hand], forearm_turns)
            return
        along = self._direction(hand)
        self._settle_limb(hand, along, frame(sign * along, forearm_turns[:, :, 1], upright=False))
