"""How a figure's joints stand against the humanoid, from its rest pose, from a T-pose in front, or from its frames."""

from dataclasses import dataclass, replace

import numpy as np

from motet.errors import MotionError
from motet.motion.humanoid.bones import LEFT_RIGHT, SOLE, leg_length, sided
from motet.motion.humanoid.calibrate import alignments_of_frames, axes_agree
from motet.motion.humanoid.figure_checks import check_frames, check_stance, leg_of
from motet.motion.humanoid.joint_map import JointMap
from motet.motion.humanoid.rest_pose import (
    LIMBS,
    Aims,
    aims_of,
    alignments_of_pose,
    body_frame,
    direction,
    humanoid_direction,
    moves,
    to_left,
)
from motet.motion.rotations import Array, product, rotated, unit
from motet.motion.skeleton import Skeleton

ALONG = 0.96
"""Cosine above which a bone counts as standing as in a T-pose."""

SAME = np.cos(np.radians(4))
"""Cosine above which a bone points where a convention says."""

TWISTED = 30.0
"""Degrees from which on the hips' joint does not tell how the pelvis is turned: the joints of the legs do."""

KNOWN_REST = "the convention's rest pose, which is no straight T-pose, was made up for"

OUT_OF_A_MOTION = (
    "the rest pose is out of a motion: how the joints stand was guessed from the frames, to 10 or 20 degrees; "
    "give a file of this figure that rests in a T-pose (rest=, --rest)"
)


@dataclass(frozen=True)
class Fitted:
    """A figure measured against the humanoid.

    aligned: A (J, 3, 3): a bone of the humanoid has the rotation G A where its joint has G in the world.
    leg: length of thigh and shin in the skeleton's unit.
    heights: of the joints of feet and toes over the sole, in the skeleton's unit.
    up: where y points (3,) in the rest pose, None where that was not used.
    pelvis: whether the joint of the hips turns with the legs' joints; else these tell how the pelvis is turned.
    """

    joint_map: JointMap
    aims: Aims
    aligned: Array
    leg: float
    heights: dict[str, float]
    up: Array | None
    pelvis: bool
    confidence: float
    notes: tuple[str, ...]

    @property
    def at_rest(self) -> bool:
        """Whether A comes from the rest pose, every angle 0."""
        return self.up is not None

    def bones(self, rotations: Array) -> dict[str, Array]:
        """Rotations (T, 3, 3) of the humanoid's feet and toes, from those of the joints in the world (T, J, 3, 3)."""
        joints = self.joint_map.joints
        return {bone: product(rotations[:, joints[bone]], self.aligned[joints[bone]]) for bone in self.heights}

    def soles(self, bones: dict[str, Array], places: Array) -> Array:
        """Points (T, P, 3) of the soles, from the rotations of :meth:`bones` and positions (T, J, 3) of joints."""
        scale, points = self.leg / leg_length(), []
        for bone, height in self.heights.items():
            for x, _, z in SOLE[bone.removeprefix("left").removeprefix("right")]:
                point = np.array([x * scale, -height, z * scale])
                points.append(places[:, self.joint_map.joints[bone]] + rotated(bones[bone], point))
        return np.stack(points, axis=1)


def fit(skeleton: Skeleton, joint_map: JointMap, rotations: Array, places: Array) -> Fitted:
    """Measure a figure, from rotations (T, J, 3, 3) and positions (T, J, 3) of its frames; MotionError if it cannot."""
    fitted = _fit(skeleton, joint_map, rotations, places)
    apart = _legs_apart(rotations, places, fitted)
    if apart <= TWISTED:
        return fitted
    hips = skeleton.names[joint_map.joints["hips"]]
    note = f"the legs' joints lie {apart:.0f} degrees off the turn of {hips!r}: the pelvis is turned as they lie"
    return replace(fitted, pelvis=False, notes=(*fitted.notes, note))


def _legs_apart(rotations: Array, places: Array, fitted: Fitted) -> float:
    """Degrees between the left of the hips and where the left leg's joint lies from the right one's, the median."""
    if not len(places):
        return 0.0
    hips = fitted.joint_map.joints["hips"]
    left = rotated(rotations[:, hips], fitted.aligned[hips][:, 0])
    cosine = np.sum(left * unit(to_left(places, fitted.joint_map, "UpperLeg")), axis=-1)
    return float(np.degrees(np.arccos(np.clip(np.median(cosine), -1, 1))))


def _fit(skeleton: Skeleton, joint_map: JointMap, rotations: Array, places: Array) -> Fitted:
    aims = aims_of(skeleton, joint_map)
    leg = leg_of(skeleton, joint_map, aims, places[0] if len(places) else skeleton.rest_positions)
    still = np.tile(np.eye(3), (len(skeleton.joints), 1, 1))
    body = body_frame(skeleton.rest_positions, joint_map, aims)
    moving = len(places) > 1 and moves(skeleton.rest_positions, joint_map, aims)
    if body is not None and not moving:
        if joint_map.rest is not None and not _rests_as_known(skeleton.rest_positions, body, joint_map, aims):
            joint_map = replace(joint_map, rest=None)
        aligned = alignments_of_pose(skeleton, (still, skeleton.rest_positions), body, joint_map, aims)
        heights = _heights(skeleton, joint_map, leg, skeleton.rest_positions @ body[:, 1])
        notes = (
            () if joint_map.rest is None else ("the rest pose is one that the convention knows, which was made up for",)
        )
        return Fitted(joint_map, aims, aligned, leg, heights, body[:, 1], True, 1.0, notes)
    known = bool(len(places)) and axes_agree(rotations, places, joint_map, aims)
    joint_map = joint_map if known else replace(joint_map, axes={})
    first = body_frame(places[0], joint_map, aims, exact=True) if len(places) and not known else None
    if first is not None and (len(places) == 1 or _is_t_pose(places[0], first, joint_map, aims)):
        aligned = alignments_of_pose(skeleton, (rotations[0], places[0]), first, joint_map, aims)
        heights = _heights(skeleton, joint_map, leg, places[0] @ first[:, 1])
        note = "the rest pose is not a standing body: the first frame's pose was used in its place"
        return Fitted(joint_map, aims, aligned, leg, heights, None, True, 0.95, (note,))
    if len(places) < 2 and not known:
        raise MotionError("the rest pose is not a standing body: give a motion of this skeleton, whose frames show how")
    if not known:
        left = unit(to_left(places, joint_map, "UpperLeg"))
        check_stance(places, joint_map)
        check_frames(places, joint_map, aims, dict.fromkeys(LEFT_RIGHT, left))
    aligned = alignments_of_frames(rotations, places, joint_map, aims, along_axes=known or not moving)
    hips, carrier = joint_map.joints["hips"], joint_map.carrier(skeleton)
    aligned[carrier] = rotations[0, carrier].T @ rotations[0, hips] @ aligned[hips]
    heights = _heights(skeleton, joint_map, leg, None)
    if moving and not known:
        return Fitted(joint_map, aims, aligned, leg, heights, None, True, 0.7, (OUT_OF_A_MOTION,))
    how = "known by the convention" if known else "found from the frames"
    note = f"the rest pose is not a standing body: how the joints stand was {how}"
    return Fitted(joint_map, aims, aligned, leg, heights, None, True, 0.95 if known else 0.85, (note,))


def _rests_as_known(rest: Array, body: Array, joint_map: JointMap, aims: Aims) -> bool:
    """Whether bones point in the rest pose (J, 3) where the convention says, within some degrees."""
    return all(
        float(unit(direction(rest, joint_map.joints[bone], aims[bone])) @ body @ unit(np.array(points))) > SAME
        for bone, points in joint_map.points.items()
    )


def _is_t_pose(pose: Array, body: Array, joint_map: JointMap, aims: Aims) -> bool:
    """Whether the bones of arms and legs point where the humanoid's do in its T-pose."""
    bones = [bone for limb in LIMBS for bone in limb[:2] if aims[bone]]
    along = [
        float(unit(direction(pose, joint_map.joints[bone], aims[bone])) @ body @ humanoid_direction(bone))
        for bone in bones
    ]
    return min(along) > ALONG and float(body[1, 1]) > ALONG


def _heights(skeleton: Skeleton, joint_map: JointMap, leg: float, rise: Array | None) -> dict[str, float]:
    """Heights of feet and toes over the sole: over the lowest joint at rest (rise (J)), else as the humanoid's."""
    scale = leg / leg_length()
    heights = {}
    for bone in (sided(side, part) for side in LEFT_RIGHT for part in SOLE if sided(side, part) in joint_map.joints):
        joint = joint_map.joints[bone]
        usual = -SOLE[bone.removeprefix("left").removeprefix("right")][0][1] * scale
        below = 0.0 if rise is None else float(rise[joint] - rise[list(skeleton.subtree(skeleton.names[joint]))].min())
        heights[bone] = below if below > 0.3 * usual or bone.endswith("Toes") else usual
    return heights
