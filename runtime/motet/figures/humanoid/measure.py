"""How a figure stands against the humanoid, measured once: its joints' axes, its legs, its unit, and which way is up.

From its rest pose, from a T-pose in the first frame, or from its frames; and what is no human's is refused.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from motet.errors import MotionError, UnitError, listed
from motet.figures.humanoid.alignment import Calibration, alignments_of_pose, axes_agree, body_frame, rests_in_motion
from motet.figures.humanoid.bones import HUMANOID, LEFT_RIGHT, LEG, SOLE, SPINE, T_POSE, leg_length, part_of, sided
from motet.figures.humanoid.joint_map import BY_THE_TREE, LIMB_BONES, NEEDED, Body, JointMap, humanoid_direction
from motet.figures.humanoid.joint_tree import map_of
from motet.motion.kinematics import skeleton_of
from motet.motion.motion import Motion
from motet.motion.rotations import UP, Array, rotated, swing, unit
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


@dataclass(frozen=True)
class Fitted:
    """A figure measured against the humanoid.

    aligned: A (J, 3, 3): a bone of the humanoid has the rotation G A where its joint has G in the world.
    leg: length of thigh and shin in the skeleton's unit.
    heights: of the joints of feet and toes over the sole, in the skeleton's unit.
    up: where y points (3,) in the rest pose, every angle 0; None where A does not come from that.
    pelvis: whether the joint of the hips turns with the legs' joints; else these tell how the pelvis is turned.
    """

    body: Body
    aligned: Array
    leg: float
    heights: dict[str, float]
    up: Array | None
    confidence: float
    notes: tuple[str, ...]
    pelvis: bool = True

    @property
    def joint_map(self) -> JointMap:
        """Which joint is which bone."""
        return self.body.joint_map

    def soles(self, bones: dict[str, Array], places: Array) -> Array:
        """Points (T, P, 3) of soles from rotations (T, 3, 3) of the humanoid's feet and toes, and positions (T, J,
        3)."""
        scale = self.leg / leg_length()
        points = []
        for bone, height in self.heights.items():
            for x, _, z in SOLE[part_of(bone)]:
                point = np.array([x * scale, -height, z * scale])
                points.append(places[:, self.body.joints[bone]] + rotated(bones[bone], point))
        return np.stack(points, axis=1)


def fit(skeleton: Skeleton, joint_map: JointMap, rotations: Array, places: Array) -> Fitted:
    """Measure a figure, from rotations (T, J, 3, 3) and positions (T, J, 3) of its frames; MotionError if it cannot."""
    fitted = _fit(Body(skeleton, joint_map), rotations, places)
    if not len(places):
        return fitted
    hips = joint_map.joints["hips"]
    left = rotated(rotations[:, hips], fitted.aligned[hips][:, 0])
    cosine = np.sum(left * unit(fitted.body.to_left(places, "UpperLeg")), axis=-1)
    apart = float(np.degrees(np.arccos(np.clip(np.median(cosine), -1, 1))))
    if apart <= 30:  # degrees: more, and the hips' joint does not tell how the pelvis is turned
        return fitted
    name = skeleton.names[hips]
    note = f"the legs' joints lie {apart:.0f} degrees off the turn of {name!r}: the pelvis is turned as they lie"
    return replace(fitted, pelvis=False, notes=(*fitted.notes, note))


def _fit(body: Body, rotations: Array, places: Array) -> Fitted:
    skeleton = body.skeleton
    joint_map = body.joint_map
    rest = body.skeleton.rest_positions
    leg = leg_of(body, places[0] if len(places) else rest)
    stands = body_frame(rest, body)
    moving = len(places) > 1 and rests_in_motion(body)
    if stands is not None and not moving:
        points = {bone: unit(np.array(at)) for bone, at in joint_map.points.items()}
        known = joint_map.rest is not None and _agreement(body, rest, stands, points) > np.cos(np.radians(4))
        body = body if known or joint_map.rest is None else Body(skeleton, replace(joint_map, rest=None))
        aligned = alignments_of_pose(body, np.tile(np.eye(3), (len(rest), 1, 1)), rest, stands)
        notes = ("the rest pose is one that the convention knows, which was made up for",) if known else ()
        up = stands[:, 1]
        return Fitted(body, aligned, leg, _heights(body, leg, rest @ up), up, 1.0, notes)
    known = bool(len(places)) and axes_agree(body, rotations, places)
    body = body if known or not joint_map.axes else Body(skeleton, replace(joint_map, axes={}))
    first = body_frame(places[0], body, exact=True) if len(places) and not known else None
    limbs = {bone: humanoid_direction(bone) for limb in LIMB_BONES for bone in limb[:2] if body.aims[bone]}
    # a T-pose is within 16 degrees of the humanoid's
    t_pose = first is not None and min(_agreement(body, places[0], first, limbs), float(first[1, 1])) > 0.96
    if first is not None and (len(places) == 1 or t_pose):
        aligned = alignments_of_pose(body, rotations[0], places[0], first)
        note = "the rest pose is not a standing body: the first frame's pose was used in its place"
        return Fitted(body, aligned, leg, _heights(body, leg, places[0] @ first[:, 1]), None, 0.95, (note,))
    if not known:
        if len(places) < 2:
            remedy = "use a file of this figure that rests in a T-pose (to read a motion, as its rest=, --rest)"
            raise MotionError(f"the rest pose is not a standing body: {remedy}")
        check_stance(body, places)
        check_frames(body, places, dict.fromkeys(LEFT_RIGHT, unit(body.to_left(places, "UpperLeg"))))
    how, confidence = ("known by the convention", 0.95) if known else ("found from the frames", 0.85)
    note = f"the rest pose is not a standing body: how the joints stand was {how}"
    if moving and not known:
        note = (
            "the rest pose is out of a motion: how the joints stand was guessed from the frames, to 10 or 20 degrees; "
            "give a file of this figure that rests in a T-pose (rest=, --rest)"
        )
        confidence = 0.7
    aligned = Calibration(body, rotations, places, along_axes=known or not moving).aligned
    hips = joint_map.joints["hips"]
    carrier = joint_map.carrier(skeleton)
    aligned[carrier] = rotations[0, carrier].T @ rotations[0, hips] @ aligned[hips]
    return Fitted(body, aligned, leg, _heights(body, leg, None), None, confidence, (note,))


def _agreement(body: Body, pose: Array, frame: Array, points: dict[str, Array]) -> float:
    """The least cosine between where bones point in a pose (J, 3), seen in a frame, and where they are said to."""
    return min((float(body.direction(pose, bone) @ frame @ along) for bone, along in points.items()), default=1.0)


def _heights(body: Body, leg: float, rise: Array | None) -> dict[str, float]:
    """Heights of feet and toes over the sole: over the lowest joint at rest (rise (J)), else as the humanoid's."""
    scale = leg / leg_length()
    heights = {}
    for bone in (bone for side in LEFT_RIGHT for part in SOLE if (bone := sided(side, part)) in body.joints):
        joint = body.joints[bone]
        usual = -SOLE[part_of(bone)][0][1] * scale
        hanging = list(body.skeleton.subtree(body.skeleton.names[joint]))
        below = 0.0 if rise is None else float(rise[joint] - rise[hanging].min())
        heights[bone] = below if below > 0.3 * usual or bone.endswith("Toes") else usual
    return heights


def leg_of(body: Body, pose: Array) -> float:
    """Length of thigh and shin in the skeleton's unit, the mean of both sides; MotionError for bones without length."""
    bones = [bone for bone in NEEDED if bone not in ("hips", "spine") and body.aims[bone]]
    lengths = {bone: float(np.linalg.norm(body.along(pose, bone))) for bone in bones}
    leg = sum(lengths[sided(side, part)] for side in LEFT_RIGHT for part in LEG[:2]) / 2
    short = [body.skeleton.names[body.joints[bone]] for bone, length in lengths.items() if length <= 0.02 * leg]
    if short or not leg > 0:
        remedy = "a human's limbs have lengths: export the skeleton with its offsets"
        raise MotionError(f"bones of length zero: {listed(short)}; {remedy}")
    return leg


class Unit(NamedTuple):
    """A length unit in metres, None where it is not known, and what there is to say about it."""

    metres: float | None
    note: str | None


def unit_of(skeleton: Skeleton, leg: float) -> Unit:
    """The skeleton's unit as it says, or else as the length of its legs tells; MotionError for giants and dwarfs."""
    # the unit in which legs are nearest to an adult's 0.82 m, of those in which they are 0.55 to 1.1 m
    likely = [name for name, metres in LENGTH_UNITS.items() if 0.55 < leg * metres < 1.1]
    guess = min(likely, key=lambda name: abs(np.log(leg * LENGTH_UNITS[name] / 0.82)), default=None)
    stated, (shortest, longest) = skeleton.metres_per_unit, (0.2, 1.6)  # metres of a human's thigh and shin
    if stated is not None:
        if shortest < leg * stated < longest:
            return Unit(stated, None)
        looks = f"; its lengths look like {guess}" if guess else ""
        remedy = "give the right unit, or where the file says its own, scale the figure at its source"
        raise UnitError(f"legs of {leg * stated:.3g} m: a human's are {shortest:g} to {longest:g} m{looks}: {remedy}")
    if guess is None:
        return Unit(None, "unit not known: the figure is taken to be an adult's size")
    metres = LENGTH_UNITS[guess]
    return Unit(metres, f"unit taken to be {guess} from the length of the legs, {leg * metres:.2f} m")


def unit_by_legs(motion: Motion) -> Unit:
    """The unit of a skeleton by the length of its legs at rest; MotionError as :func:`unit_of`, and for no human's."""
    skeleton = skeleton_of(motion)
    return unit_of(skeleton, leg_of(Body(skeleton, map_of(motion)), skeleton.rest_positions))


def height_of(fitted: Fitted) -> float:
    """Height of a figure that stands straight, in the skeleton's unit: of legs and back as they are long, and of what
    joints do not tell, soles and crown, as the humanoid's."""

    def back(skeleton: Skeleton, hips: int, joint: int) -> float:
        chain = skeleton.ancestors(joint)
        return sum(float(np.linalg.norm(skeleton.offsets[i])) for i in chain[: chain.index(hips)])

    joint_map = fitted.joint_map
    skeleton = fitted.body.skeleton
    top = "head" if "head" in joint_map.joints else "neck" if joint_map.neck else SPINE[-1]
    joint = joint_map.joints.get("head", (*joint_map.spine, *joint_map.neck)[-1])
    usual = back(HUMANOID, 0, HUMANOID.index(top))
    rest = (float(T_POSE[:, 1].max()) - leg_length() - usual) * fitted.leg / leg_length()
    return fitted.leg + back(skeleton, joint_map.carrier(skeleton), joint) + rest


def check_stance(body: Body, positions: Array) -> None:
    """Refuse frames (T, J, 3) of a figure on four legs: asked where its rest pose is not a standing body.

    A human who sits has the trunk beside the legs, too; known names tell one who sits upright from an animal.
    """
    trunk = body.trunk_up(positions)
    beside = np.quantile(np.sum(trunk * body.legs_up(positions), axis=-1), 0.95) < 0.3
    sits = body.joint_map.convention != BY_THE_TREE and np.median(trunk[:, 1]) > 0.5
    if beside and not sits:
        raise MotionError(
            "the trunk never stands above the legs: this looks like a figure on four legs, not like a human's; "
            "where joints were mistaken, give a map"
        )


def check_frames(body: Body, positions: Array, hinges: dict[str, Array]) -> None:
    """Refuse frames (T, J, 3) that no human's body goes through: inside out, with feet or knees the other way.

    hinges: of each side the axis (T, 3) about which the knee bends, to the left, however the thigh is turned. A knee
    bends the wrong way where the pelvis says so, too: recorded thighs can be twisted by much.
    """
    toes = []
    wrong = 0
    bent = 0
    left = body.to_left(positions, "UpperLeg")
    for side, hinge in hinges.items():
        bones = [bone for bone in (sided(side, part) for part in LEG[:3]) if body.aims[bone]]
        thigh, shin, *foot = (body.direction(positions, bone) for bone in bones)
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


def upright(fitted: Fitted, places: Array) -> tuple[Array, str | None]:
    """The rotation (3, 3) of the world that makes y point up, and what there is to say about it.

    The identity where y points up, or nothing tells. A figure stands along another axis where its rest pose and most
    of its frames (T, J, 3) say so, or where the frames alone do and it walks about: a body that lies down does not.
    """
    still = np.eye(3)
    if not len(places):
        return still, None
    trunk = fitted.body.trunk_up(places)
    if fitted.up is not None and fitted.up[1] <= 0.5:
        stands = float(np.median(trunk @ fitted.up)) > 0.7
        return (swing(fitted.up, UP), "turned upright: the figure does not stand along y") if stands else (still, None)
    mean = np.median(trunk, axis=0)
    axis = int(np.argmax(np.abs(mean)))
    up = np.sign(mean[axis]) * np.eye(3)[axis]
    along = 0.82  # the cosine from which on a body stands along an axis
    standing = trunk @ up > along
    if axis == 1 or np.mean(standing) < 0.5 or np.mean(trunk[:, 1] > along) > 0.1:
        return still, None
    if np.median(fitted.body.legs_up(places) @ up) < along:
        return still, None
    # a figure walks that goes its leg's length and more across that direction, and not along it
    path = fitted.body.middle(places[standing], "UpperLeg")
    rise = float(np.ptp(path @ up))
    if np.linalg.norm(np.ptp(path - (path @ up)[:, None] * up, axis=0)) > max(fitted.leg, 2 * rise):
        return swing(up, UP), f"turned upright: the frames stand along {'xyz'[axis]}, the rest pose along y"
    name = "xyz"[axis]
    return still, f"the body lies along {name} in most frames: if it stands there, export the file with y up"
