"""How a skeleton's joints stand against the humanoid: from a pose that is a standing body, or from frames.

For every joint that is a bone a constant rotation A is found, so that the bone's rotation on the humanoid is G A with G
the joint's rotation in the world. Where the rest pose of a skeleton is a body that stands (T, A, arms down; facing
anywhere), A turns the humanoid's T-pose into it: trunk and shoulders as a whole, the bones of limbs by the shortest
turn to where they point, each carried along by the one before it, so that no twist is added; feet by their heading
alone, as soles are flat in a rest pose whatever the slope of the line from ankle to toes.

Many files rest with all bones in one line instead, each along an axis of its own joint. What bodies do then tells: legs
and arms hang at the sides of the trunk, knees and elbows are hinges. All is averaged in the frame of each joint over
all frames; what comes near axes is taken to be just these, so that every take of a skeleton gets the same alignment.
"""

from itertools import permutations

import numpy as np

from motet.figures.humanoid.bones import ARM, LEFT_RIGHT, LEG, sided
from motet.figures.humanoid.joint_map import LIMB_BONES, Body, humanoid_direction
from motet.motion.rotations import Array, frames_last, product, rotvec_to_rotmat, swing, unit

AXES_TURNS = np.array(
    [
        np.stack([x, y, np.cross(x, y)], axis=1)
        for x, y in permutations(np.kron(np.eye(3), [[1.0], [-1.0]]), 2)
        if not np.dot(x, y)
    ]
)
"""The rotations (24, 3, 3) that turn coordinate axes into coordinate axes."""


def frame(left: Array, up: Array, upright: bool = True) -> Array:
    """Rotations (..., 3, 3) whose columns are left, up and forward: up as given, or left, the other square to it."""
    given, other = (unit(up), left) if upright else (unit(left), up)
    other = unit(other - np.sum(other * given, axis=-1, keepdims=True) * given)
    left, up = (other, given) if upright else (given, other)
    rotations = frames_last((*up.shape, 3))
    rotations[..., 0] = left
    rotations[..., 1] = up
    rotations[..., 2] = np.cross(left, up)
    return rotations


def body_frame(pose: Array, body: Body, exact: bool = False) -> Array | None:
    """Left, up and forward (3, 3) of a pose (J, 3) that is a standing body, else None.

    A body stands where both legs point one way and the trunk the other, feet forward, and left is left. Axes near
    those of the coordinates, as they are in every rest pose that somebody made, are taken to be just these.
    """
    across = body.to_left(pose, "UpperLeg")
    up = body.legs_up(pose)
    if not np.linalg.norm(across) or abs(float(np.dot(unit(across), up))) > 0.9:
        return None
    own = frame(across, up)
    own = own if exact else _near_axes(own, 15)
    legs = [own.T @ body.direction(pose, sided(side, part)) for side in LEFT_RIGHT for part in LEG[:2]]
    feet = [own.T @ body.direction(pose, foot) for side in LEFT_RIGHT if body.aims[foot := sided(side, "Foot")]]
    arms = [float((own.T @ body.to_left(pose, part))[0]) for part in ("UpperArm", "LowerArm")]
    stands = all(leg[1] < -0.75 for leg in legs) and float(body.trunk_up(pose) @ own[:, 1]) > 0.85
    return own if stands and all(foot[2] > 0.2 for foot in feet) and min(arms) > 0 else None


def rests_in_motion(body: Body) -> bool:
    """Whether the rest pose is one out of a motion: limbs of left and right differ, and are not along axes."""
    rest = body.skeleton.rest_positions
    own = frame(body.to_left(rest, "UpperLeg"), body.trunk_up(rest))
    parts = [part for part in (*LEG[:2], *ARM[1:3]) if body.aims[sided("left", part)]]
    left, right = (np.array([body.direction(rest, sided(side, part)) for part in parts]) for side in LEFT_RIGHT)
    alike = np.sum((left @ own) * (right @ own) * [-1.0, 1.0, 1.0], axis=-1)
    along = np.abs([left, right]).max(axis=-1)
    # limbs that rest mirror each other within 6 degrees; bones within 18 of axes are in line as nobody has posed them
    return bool(alike.min() < np.cos(np.radians(6)) and along.min() < np.cos(np.radians(18)))


def _near_axes(rotation: Array, degrees: float) -> Array:
    """The nearest of :data:`AXES_TURNS` to a rotation (3, 3) if it is within some degrees of it, else the rotation."""
    nearest: Array = AXES_TURNS[int(np.argmax(np.sum(AXES_TURNS * rotation, axis=(1, 2))))]
    apart = np.arccos(np.clip((np.sum(rotation * nearest) - 1) / 2, -1, 1))
    return nearest if np.degrees(apart) < degrees else rotation


def alignments_of_pose(body: Body, rotations: Array, pose: Array, own: Array) -> Array:
    """A (J, 3, 3) for all joints that are bones, the identity for others, from a pose that is a standing body.

    rotations: (J, 3, 3) and pose: positions (J, 3) of the joints in that pose; own: its frame.
    """
    joint_map = body.joint_map
    carrier = body.joint_map.carrier(body.skeleton)
    if joint_map.rest is None:
        turns = _found_turns(body, pose, own)
    else:
        known = joint_map.rest
        bones = (*joint_map.joints, "spine", "neck")
        turns = {bone: own @ rotvec_to_rotmat(np.radians(known.get(bone, (0.0, 0.0, 0.0)))) for bone in bones}
    wanted = {joint: turns[bone] for bone, joint in joint_map.joints.items()} | {carrier: turns["hips"]}
    wanted |= {joint: turns.get("spine", own) for joint in joint_map.spine}
    wanted |= {joint: turns.get("neck", own) for joint in joint_map.neck}
    aligned = np.tile(np.eye(3), (len(pose), 1, 1))
    for joint, turn in wanted.items():
        aligned[joint] = rotations[joint].T @ turn
    return aligned


def _found_turns(body: Body, pose: Array, own: Array) -> dict[str, Array]:
    """Rotations (3, 3) of the humanoid's bones that make its limbs point where those of the pose do."""
    turns = dict.fromkeys(("hips", "head", *(sided(side, "Shoulder") for side in LEFT_RIGHT)), own)
    for limb in LIMB_BONES:
        carried = own  # the rotation of the bone before
        for bone in limb:
            if bone not in body.joints:
                continue
            if body.aims[bone] and not bone.endswith("Toes"):
                target = body.direction(pose, bone)
                start = carried @ humanoid_direction(bone)
                if bone.endswith("Foot"):
                    carried = _foot_turn(target, own, carried)
                elif not bone.endswith("Hand") or float(start @ target) > 0.8:
                    carried = swing(start, target) @ carried
            turns[bone] = carried
    return turns


def _foot_turn(target: Array, body: Array, leg: Array) -> Array:
    """A foot's rotation: its heading turned to the target's, rolled with the leg where it lies in the leg's plane.

    Where legs are spread at rest, some figures stand on flat soles and others have feet that are at right angles to
    the legs, as those of ASF files; the latter lie in the plane of leg and forward direction.
    """
    base = leg if abs(float(leg[:, 0] @ target)) < abs(float(body[:, 0] @ target)) - 1e-3 else body
    x, y, z = base.T @ target
    if z < 0.5 * np.hypot(x, y) and z < 0.5:
        return swing(base @ humanoid_direction("leftFoot"), target) @ base
    return base @ swing(np.array([0.0, 0.0, 1.0]), np.array([x, 0.0, z]))


def axes_agree(body: Body, rotations: Array, positions: Array) -> bool:
    """Whether the axes that a convention says fit a skeleton: bones of limbs point along them, and left is left.

    Other skeletons can have the same names. rotations (T, J, 3, 3) and positions (T, J, 3) are those of frames.
    """
    joint_map = body.joint_map
    bones = [bone for bone, ends in body.aims.items() if ends]
    # joint -> where the humanoid's bone points, and where the joint's does
    seen = {body.joints[bone]: (humanoid_direction(bone), body.along(positions, bone)) for bone in bones}
    for joint, part in ((body.joints["hips"], "UpperLeg"), (joint_map.spine[-1], "UpperArm")):
        seen[joint] = np.array([1.0, 0.0, 0.0]), body.to_left(positions, part)
    known = [joint for joint in seen if joint in joint_map.axes]
    return bool(known) and all(
        _mean_direction(rotations[:, joint], seen[joint][1]) @ _known_axes(joint_map.axes[joint]) @ seen[joint][0] > 0.7
        for joint in known
    )


def _mean_direction(rotations: Array, along: Array) -> Array:
    """The mean direction (3,) in a joint's frame of vectors (T, 3), with the joint's rotations (T, 3, 3)."""
    return unit(np.einsum("tji,tj->i", rotations, unit(along)))


def _known_axes(axes: str) -> Array:
    """The rotation (3, 3) with columns such as "-z x -y": the joint's axes that are left, up and forward."""
    words = axes.split()
    return np.stack([np.eye(3)["xyz".index(word[-1])] * (-1 if word[0] == "-" else 1) for word in words], axis=1)


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
        self.aligned = np.tile(np.eye(3), (rotations.shape[1], 1, 1))
        self._trunk()
        for side, sign in zip(LEFT_RIGHT, (1.0, -1.0), strict=True):
            self._leg([sided(side, part) for part in LEG])
            self._arm([sided(side, part) for part in ARM], sign)

    def _turns(self, joint: int) -> Array:
        """Rotations (T, 3, 3) of the humanoid's bone for a joint whose A is found."""
        return product(self.rotations[:, joint], self.aligned[joint])

    def _settle(self, joint: int, turns: Array) -> None:
        """A of a joint from estimates (T, 3, 3) of its bone's rotation: what the convention says, or near the axes."""
        known = self.body.joint_map.axes.get(joint)
        # the rotation nearest to all from the joint's to its bone's
        u, _, v = np.linalg.svd(np.einsum("tji,tjk->ik", self.rotations[:, joint], turns))
        mean: Array = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ v))]) @ v
        self.aligned[joint] = _known_axes(known) if known else _near_axes(mean, 30) if self.along_axes else mean

    def _settle_limb(self, bone: str, along: Array, turns: Array) -> None:
        """The same for a bone of a limb, which then also points where it really does, along (T, 3)."""
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
        positions = self.positions
        spine = self.body.joint_map.spine
        legs, arms = (unit(body.to_left(positions, part)) for part in ("UpperLeg", "UpperArm"))
        above = [*body.joint_map.neck, *([body.joints["head"]] if "head" in body.joints else [])]
        back = [body.joints["hips"], *spine, *above]
        chest = len(spine)
        shoulders = body.middle(positions, "UpperArm")
        for i, joint in enumerate(back):
            left = legs * (1 - i / chest) + arms * (i / chest) if i < chest else arms
            start = body.middle(positions, "UpperLeg") if i == 0 else positions[:, joint]
            end = shoulders if i < chest else positions[:, back[-1]]
            if i == len(back) - 1:
                start = positions[:, back[max(i - 1, chest - 1)]]
                end = positions[:, joint]
            self._settle(joint, frame(left, end - start))

    def _leg(self, bones: list[str]) -> None:
        """Knees are hinges that bend backwards; feet and toes have the hinge's axis."""
        joints = self.body.joints
        thigh, shin = (self.body.direction(self.positions, bone) for bone in bones[:2])
        hinge = np.cross(thigh, shin) + self.HINGE * self._turns(joints["hips"])[:, :, 0]
        self._settle_limb(bones[0], thigh, frame(hinge, -thigh))
        self._settle_limb(bones[1], shin, frame(hinge, -shin))
        shins = self._turns(joints[bones[1]])
        for bone in (bone for bone in bones[2:] if bone in joints):
            if not self.body.aims[bone]:
                self._settle(joints[bone], shins)
                continue
            along = self.body.direction(self.positions, bone)
            level = frame(shins[:, :, 0], np.cross(along, shins[:, :, 0]))
            slope = swing(np.array([0.0, 0.0, 1.0]), humanoid_direction(bone))
            self._settle_limb(bone, along, level @ slope.T)

    def _arm(self, bones: list[str], sign: float) -> None:
        """Elbows are hinges that bend forwards with the arms out to the sides; hands are in line with the forearms."""
        joints = self.body.joints
        body = self.body
        chest = self._turns(self.body.joint_map.spine[-1])
        if bones[0] in joints:
            self._settle(joints[bones[0]], chest)
        upper = body.direction(self.positions, bones[1])
        lower = body.direction(self.positions, bones[2]) if body.aims[bones[2]] else upper
        plain = swing(chest @ humanoid_direction(bones[1]), upper) @ chest
        up = -sign * np.cross(upper, lower) + self.HINGE * plain[:, :, 1]
        self._settle_limb(bones[1], upper, frame(sign * upper, up, upright=False))
        self._settle_limb(bones[2], lower, frame(sign * lower, up, upright=False))
        if bones[3] in joints:
            forearm = self._turns(joints[bones[2]])
            if body.aims[bones[3]]:
                along = body.direction(self.positions, bones[3])
                self._settle_limb(bones[3], along, frame(sign * along, forearm[:, :, 1], upright=False))
            else:
                self._settle(joints[bones[3]], forearm)
