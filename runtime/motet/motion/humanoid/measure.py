"""How a figure stands against the humanoid, measured once: its joints' axes, its legs, its unit, and which way is up.

From its rest pose, from a T-pose in the first frame, or from its frames; and what is no human's is refused.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from motet.errors import MotionError, listed
from motet.motion.humanoid.bones import HUMANOID, LEFT_RIGHT, LEG, SOLE, SPINE, T_POSE, leg_length, sided
from motet.motion.humanoid.calibrate import alignments_of_frames, axes_agree
from motet.motion.humanoid.joint_map import BY_THE_TREE, NEEDED, JointMap
from motet.motion.humanoid.joint_tree import map_of
from motet.motion.humanoid.rest_pose import (
    LIMB_BONES,
    Aims,
    aims_of,
    alignments_of_pose,
    body_frame,
    direction,
    humanoid_direction,
    legs_up,
    middle,
    moves,
    to_left,
    trunk_up,
)
from motet.motion.kinematics import skeleton_of
from motet.motion.motion import Motion
from motet.motion.rotations import UP, Array, product, rotated, swing, unit
from motet.motion.skeleton import Skeleton

LENGTH_UNITS = {
    "metres": 1.0,
    "decimetres": 0.1,
    "CMU's unit": 0.0254 / 0.45,
    "inches": 0.0254,
    "centimetres": 0.01,
    "millimetres": 0.001,
}
"""Units that skeletons are written in, with their length in metres."""

POSSIBLE_LEG = (0.2, 1.6)
"""Metres of a human's thigh and shin together."""


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
    if apart <= 30:  # degrees: more, and the hips' joint does not tell how the pelvis is turned
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
    aims, rest = aims_of(skeleton, joint_map), skeleton.rest_positions
    leg = leg_of(skeleton, joint_map, aims, places[0] if len(places) else rest)
    still = np.tile(np.eye(3), (len(skeleton.joints), 1, 1))
    body = body_frame(rest, joint_map, aims)
    moving = len(places) > 1 and moves(rest, joint_map, aims)
    if body is not None and not moving:
        if joint_map.rest is not None and not _rests_as_known(rest, body, joint_map, aims):
            joint_map = replace(joint_map, rest=None)
        aligned = alignments_of_pose(skeleton, (still, rest), body, joint_map, aims)
        heights = _heights(skeleton, joint_map, leg, rest @ body[:, 1])
        notes = ("the rest pose is one that the convention knows, which was made up for",)
        known_rest = joint_map.rest is not None
        return Fitted(joint_map, aims, aligned, leg, heights, body[:, 1], True, 1.0, notes if known_rest else ())
    known = bool(len(places)) and axes_agree(rotations, places, joint_map, aims)
    joint_map = joint_map if known else replace(joint_map, axes={})
    first = body_frame(places[0], joint_map, aims, exact=True) if len(places) and not known else None
    if first is not None and (len(places) == 1 or _is_t_pose(places[0], first, joint_map, aims)):
        aligned = alignments_of_pose(skeleton, (rotations[0], places[0]), first, joint_map, aims)
        heights = _heights(skeleton, joint_map, leg, places[0] @ first[:, 1])
        note = "the rest pose is not a standing body: the first frame's pose was used in its place"
        return Fitted(joint_map, aims, aligned, leg, heights, None, True, 0.95, (note,))
    if len(places) < 2 and not known:
        raise MotionError("the rest pose is not a standing body: give a motion of this skeleton instead")
    if not known:
        check_stance(places, joint_map)
        check_frames(places, joint_map, aims, dict.fromkeys(LEFT_RIGHT, unit(to_left(places, joint_map, "UpperLeg"))))
    aligned = alignments_of_frames(rotations, places, joint_map, aims, along_axes=known or not moving)
    hips, carrier = joint_map.joints["hips"], joint_map.carrier(skeleton)
    aligned[carrier] = rotations[0, carrier].T @ rotations[0, hips] @ aligned[hips]
    heights = _heights(skeleton, joint_map, leg, None)
    if moving and not known:
        note = (
            "the rest pose is out of a motion: how the joints stand was guessed from the frames, to 10 or 20 degrees; "
            "give a file of this figure that rests in a T-pose (rest=, --rest)"
        )
        return Fitted(joint_map, aims, aligned, leg, heights, None, True, 0.7, (note,))
    how = "known by the convention" if known else "found from the frames"
    note = f"the rest pose is not a standing body: how the joints stand was {how}"
    return Fitted(joint_map, aims, aligned, leg, heights, None, True, 0.95 if known else 0.85, (note,))


def _rests_as_known(rest: Array, body: Array, joint_map: JointMap, aims: Aims) -> bool:
    """Whether bones point in the rest pose (J, 3) where the convention says, within 4 degrees."""
    return all(
        float(unit(direction(rest, joint_map.joints[bone], aims[bone])) @ body @ unit(np.array(points)))
        > np.cos(np.radians(4))
        for bone, points in joint_map.points.items()
    )


def _is_t_pose(pose: Array, body: Array, joint_map: JointMap, aims: Aims) -> bool:
    """Whether the bones of arms and legs point where the humanoid's do in its T-pose, within 16 degrees."""
    bones = [bone for limb in LIMB_BONES for bone in limb[:2] if aims[bone]]
    along = [
        float(unit(direction(pose, joint_map.joints[bone], aims[bone])) @ body @ humanoid_direction(bone))
        for bone in bones
    ]
    return min(*along, float(body[1, 1])) > 0.96


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


class Unit(NamedTuple):
    """A length unit in metres, None where it is not known, and what there is to say about it."""

    metres: float | None
    note: str | None


def leg_of(skeleton: Skeleton, joint_map: JointMap, aims: Aims, rest: Array) -> float:
    """Length of thigh and shin in the skeleton's unit, the mean of both sides; MotionError for bones without length."""
    lengths = {
        bone: float(np.linalg.norm(direction(rest, joint_map.joints[bone], aims[bone])))
        for bone in NEEDED
        if bone not in ("hips", "spine") and aims[bone]
    }
    leg = sum(lengths[sided(side, part)] for side in LEFT_RIGHT for part in LEG[:2]) / 2
    short = [skeleton.names[joint_map.joints[bone]] for bone, length in lengths.items() if length <= 0.02 * leg]
    if short or not leg > 0:
        remedy = "a human's limbs have lengths: export the skeleton with its offsets"
        raise MotionError(f"bones of length zero: {listed(short)}; {remedy}")
    return leg


def unit_of(skeleton: Skeleton, leg: float) -> Unit:
    """The skeleton's unit as it says, or else as the length of its legs tells; MotionError for giants and dwarfs."""
    stated = skeleton.metres_per_unit
    if stated is not None:
        if POSSIBLE_LEG[0] < leg * stated < POSSIBLE_LEG[1]:
            return Unit(stated, None)
        guess = _guess(leg)
        looks = f"; its lengths look like {guess}" if guess else ""
        remedy = (
            "give the right unit (motet's --unit-in), or where the file says its own, scale the figure at its source"
        )
        raise MotionError(
            f"legs of {leg * stated:.3g} m: a human's are {POSSIBLE_LEG[0]:g} to {POSSIBLE_LEG[1]:g} m{looks}: {remedy}"
        )
    guess = _guess(leg)
    if guess is None:
        return Unit(None, "unit not known: the figure is taken to be an adult's size")
    metres = LENGTH_UNITS[guess]
    return Unit(metres, f"unit taken to be {guess} from the length of the legs, {leg * metres:.2f} m")


def unit_by_legs(motion: Motion) -> Unit:
    """The unit of a motion's skeleton by the length of its legs at rest; MotionError as :func:`unit_of`, and for what
    is no human's."""
    skeleton, joint_map = skeleton_of(motion), map_of(motion)
    return unit_of(skeleton, leg_of(skeleton, joint_map, aims_of(skeleton, joint_map), skeleton.rest_positions))


def height_of(skeleton: Skeleton, joint_map: JointMap, leg: float) -> float:
    """Height of a figure that stands straight, in the skeleton's unit: of legs and back as they are long, and of what
    joints do not tell, soles and crown, as the humanoid's."""
    top = "head" if "head" in joint_map.joints else "neck" if joint_map.neck else SPINE[-1]
    joint = joint_map.joints.get("head", (*joint_map.spine, *joint_map.neck)[-1])
    own = _back(skeleton, joint_map.carrier(skeleton), joint)
    usual = _back(HUMANOID, 0, HUMANOID.index(top))
    return leg + own + (float(T_POSE[:, 1].max()) - leg_length() - usual) * leg / leg_length()


def _back(skeleton: Skeleton, hips: int, joint: int) -> float:
    """How far a joint is from the hips, along the bones."""
    length = 0.0
    while joint != hips:
        length += float(np.linalg.norm(skeleton.offsets[joint]))
        joint = skeleton.joints[joint].parent
    return length


def _guess(leg: float) -> str | None:
    """The unit in which legs are nearest to an adult's 0.82 m, of those in which they are 0.55 to 1.1 m."""
    likely = [name for name, metres in LENGTH_UNITS.items() if 0.55 < leg * metres < 1.1]
    return min(likely, key=lambda name: abs(np.log(leg * LENGTH_UNITS[name] / 0.82)), default=None)


def check_stance(positions: Array, joint_map: JointMap) -> None:
    """Refuse frames (T, J, 3) of a figure on four legs: asked where its rest pose is not a standing body.

    A human who sits all through a file has the trunk beside the legs, too; names that are known tell one who sits
    upright from an animal.
    """
    trunk = trunk_up(positions, joint_map)
    beside = np.quantile(np.sum(trunk * legs_up(positions, joint_map), axis=-1), 0.95) < 0.3
    sits = joint_map.convention != BY_THE_TREE and np.median(trunk[:, 1]) > 0.5
    if beside and not sits:
        raise MotionError(
            "the trunk never stands above the legs: this looks like a figure on four legs, not like a human's; "
            "where joints were mistaken, give a map"
        )


def check_frames(positions: Array, joint_map: JointMap, aims: Aims, hinges: dict[str, Array]) -> None:
    """Refuse frames (T, J, 3) that no human's body goes through: inside out, with feet or knees the other way.

    hinges: of each side the axis (T, 3) about which the knee bends, to the left, however the thigh is turned. A knee
    bends the wrong way where the pelvis says so, too: recorded thighs can be twisted by much.
    """
    toes, wrong, bent = [], 0, 0
    left = to_left(positions, joint_map, "UpperLeg")
    for side, hinge in hinges.items():
        bones = [bone for bone in (sided(side, part) for part in LEG[:3]) if aims[bone]]
        thigh, shin, *foot = (unit(direction(positions, joint_map.joints[bone], aims[bone])) for bone in bones)
        toes += [np.sum(np.cross(hinge, -shin) * along, axis=-1) for along in foot]
        bend = np.cross(thigh, shin)
        is_bent = np.linalg.norm(bend, axis=-1) > 0.3  # the sine of the knee's angle
        bent += int(is_bent.sum())
        wrong += int((is_bent & (np.sum(bend * hinge, axis=-1) < 0) & (np.sum(bend * left, axis=-1) < 0)).sum())
    if toes and np.median(toes) < -0.3:
        raise MotionError(
            "the feet point backwards: left and right are swapped, or the frames turn inside out: name the joints in a "
            "map, or export the file anew"
        )
    if bent >= 0.1 * len(positions) and wrong > 0.6 * bent:
        raise MotionError(
            "the knees bend forwards: the frames turn inside out (a wrong order of rotations?), or this is no human: "
            "export the file anew"
        )


class Up(NamedTuple):
    """The rotation (3, 3) of the world that makes y point up, and what there is to say about it."""

    turn: Array
    note: str | None


STANDS_UP = Up(np.eye(3), None)
"""What stands along y, or of which nothing tells."""


def upright(fitted: Fitted, places: Array) -> Up:
    """The rotation (3, 3) of the world that makes y point up, and what there is to say about it.

    The identity where y points up, or nothing tells. A figure stands along another axis where its rest pose and most
    of its frames (T, J, 3) say so, or where the frames alone do and it walks about: a body that lies down does not.
    """
    if not len(places):
        return STANDS_UP
    if fitted.up is None or fitted.up[1] > 0.5:
        return _turned_frames(fitted, places)
    stands = float(np.median(trunk_up(places, fitted.joint_map) @ fitted.up)) > 0.7
    return Up(swing(fitted.up, UP), "turned upright: the figure does not stand along y") if stands else STANDS_UP


def _turned_frames(fitted: Fitted, places: Array) -> Up:
    """The same where the frames may stand along another axis than the rest pose, which has y up."""
    trunk, legs = trunk_up(places, fitted.joint_map), legs_up(places, fitted.joint_map)
    mean = np.median(trunk, axis=0)
    axis = int(np.argmax(np.abs(mean)))
    up = np.sign(mean[axis]) * np.eye(3)[axis]
    along = 0.82  # the cosine from which on a body stands along an axis
    stands = trunk @ up > along
    if axis == 1 or np.mean(stands) < 0.5 or np.mean(trunk[:, 1] > along) > 0.1 or np.median(legs @ up) < along:
        return STANDS_UP
    name = "xyz"[axis]
    if not _walks(fitted, places[stands], up):
        return Up(
            np.eye(3), f"the body lies along {name} in most frames: if it stands there, export the file with y up"
        )
    return Up(swing(up, UP), f"turned upright: the frames stand along {name}, the rest pose along y")


def _walks(fitted: Fitted, places: Array, up: Array) -> bool:
    """Whether a figure goes its leg's length and more across a direction (3,), and not along it."""
    path = middle(places, fitted.joint_map, "UpperLeg")
    along = float(np.ptp(path @ up))
    across = float(np.linalg.norm(np.ptp(path - (path @ up)[:, None] * up, axis=0)))
    return across > max(fitted.leg, 2 * along)
