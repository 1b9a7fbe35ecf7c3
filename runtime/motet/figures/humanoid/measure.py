"""How a figure stands against the humanoid, measured once: its joints' axes, its legs, its unit, and which way is up.

From its rest pose, from a T-pose in the first frame, or from its frames; and what is no human's is refused.
"""

import logging
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from motet.errors import MotionError, UnitError, listed
from motet.figures.humanoid.alignment import (
    Calibration,
    alignments_of_pose,
    axes_agree,
    body_frame,
    rests_in_motion,
)
from motet.figures.humanoid.bones import (
    HUMANOID,
    LEFT_RIGHT,
    LEG,
    SOLE,
    SPINE,
    T_POSE,
    leg_length,
    limb_of,
    part_of,
    sided,
)
from motet.figures.humanoid.joint_map import (
    BY_THE_TREE,
    LIMB_BONES,
    NEEDED,
    Body,
    JointMap,
    humanoid_direction,
)
from motet.figures.humanoid.joint_tree import map_of
from motet.motion.kinematics import skeleton_of
from motet.motion.motion import Motion
from motet.motion.rotations import UP, Array, identities, rotated, swing, unit
from motet.motion.skeleton import Names, Skeleton

log = logging.getLogger(__name__)

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
    """A figure measured against the humanoid."""

    body: Body
    """The skeleton and which of its joints are bones."""

    aligned: Array
    """A (J, 3, 3): a bone of the humanoid has the rotation G A where its joint has G in the world."""

    leg: float
    """Length of thigh and shin in the skeleton's unit."""

    heights: dict[str, float]
    """Heights of the joints of feet and toes over the sole, in the skeleton's unit."""

    up: Array | None
    """The direction (3,) of y in the rest pose, every angle 0; None where A does not come from that pose."""

    confidence: float
    """From 0 to 1, how certain A is."""

    notes: Names
    """Sentences about the assumptions made."""

    pelvis: bool = True
    """Whether the joint of the hips turns with the legs' joints; else these decide how the pelvis is turned."""

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
    # in most frames, the left of the hips' joint has to be where the left leg is
    hips = joint_map.joints["hips"]
    left = rotated(rotations[:, hips], fitted.aligned[hips][:, 0])
    cosine = np.sum(left * unit(fitted.body.to_left(places, "UpperLeg")), axis=-1)
    apart = float(np.degrees(np.arccos(np.clip(np.median(cosine), -1, 1))))
    if apart <= 30:  # degrees: more, and the hips' joint does not show how the pelvis is turned
        return fitted
    name = skeleton.names[hips]
    note = f"the legs' joints lie {apart:.0f} degrees off the turn of {name!r}: the pelvis is turned as they lie"
    return replace(fitted, pelvis=False, notes=(*fitted.notes, note))


def _fit(body: Body, rotations: Array, places: Array) -> Fitted:
    """The figure from the first of four sources that shows how its joints stand."""
    # its rest pose, where that is a standing body
    rest = body.skeleton.rest_positions
    leg = leg_of(body, places[0] if len(places) else rest)
    frame_at_rest = body_frame(rest, body)
    moving = len(places) > 1 and rests_in_motion(body)
    if frame_at_rest is not None and not moving:
        return _fit_at_rest(body, leg, frame_at_rest)

    # the axes of its joints, where the convention is known to have some
    if len(places) and axes_agree(body, rotations, places):
        return _fit_in_frames(body, leg, rotations, places, known=True, moving=moving)
    if body.joint_map.axes:
        body = Body(body.skeleton, replace(body.joint_map, axes={}))
    return _fit_by_frames(body, leg, rotations, places, moving)


def _fit_by_frames(body: Body, leg: float, rotations: Array, places: Array, moving: bool) -> Fitted:
    """A figure of which nothing but its frames shows how its joints stand, as :func:`_fit_in_frames`."""
    # its first frame, where that is a T-pose or all there is
    first = body_frame(places[0], body, exact=True) if len(places) else None
    if first is not None and (len(places) == 1 or _is_t_pose(body, places[0], first)):
        return _fit_in_first_frame(body, leg, rotations[0], places[0], first)

    # what bodies do in all frames
    if len(places) < 2:
        remedy = "use a file of this figure that rests in a T-pose (to read a motion, as its rest=, --rest)"
        raise MotionError(f"the rest pose is not a standing body: {remedy}")
    check_stance(body, places)
    check_frames(body, places, dict.fromkeys(LEFT_RIGHT, unit(body.to_left(places, "UpperLeg"))))
    return _fit_in_frames(body, leg, rotations, places, known=False, moving=moving)


def _fit_at_rest(body: Body, leg: float, frame: Array) -> Fitted:
    """A figure whose rest pose is a standing body with axes (3, 3) left, up and forward."""
    rest = body.skeleton.rest_positions
    joint_map = body.joint_map
    notes: Names = ()
    if joint_map.rest is not None:
        points = {bone: unit(np.array(point)) for bone, point in joint_map.points.items()}
        if _agreement(body, rest, frame, points) > np.cos(np.radians(4)):
            notes = ("the rest pose is one that the convention knows, which was made up for",)
        else:
            body = Body(body.skeleton, replace(joint_map, rest=None))
    aligned = alignments_of_pose(body, identities(len(rest)), rest, frame)
    up = frame[:, 1]
    return Fitted(body, aligned, leg, _heights(body, leg, rest @ up), up, 1.0, notes)


def _is_t_pose(body: Body, pose: Array, frame: Array) -> bool:
    """Whether limbs in a pose (J, 3), seen in its frame, point within 16 degrees of the humanoid's, and up is up."""
    points = {}
    for limb in LIMB_BONES:
        for bone in limb[:2]:
            if body.aims[bone]:
                points[bone] = humanoid_direction(bone)
    return min(_agreement(body, pose, frame, points), float(frame[1, 1])) > 0.96


def _fit_in_first_frame(body: Body, leg: float, rotations: Array, pose: Array, frame: Array) -> Fitted:
    """A figure whose first frame, rotations (J, 3, 3) and positions (J, 3), is used as a rest pose."""
    aligned = alignments_of_pose(body, rotations, pose, frame)
    note = "the rest pose is not a standing body: the first frame's pose was used in its place"
    return Fitted(body, aligned, leg, _heights(body, leg, pose @ frame[:, 1]), None, 0.95, (note,))


def _fit_in_frames(
    body: Body,
    leg: float,
    rotations: Array,
    places: Array,
    *,
    known: bool,
    moving: bool,
) -> Fitted:
    """A figure by the movements of its frames, or by the axes of joints where its convention's are known to fit.

    moving: whether the rest pose is out of a motion, so that joints have no axes along bones.
    """
    source = "known by the convention" if known else "found from the frames"
    confidence = 0.95 if known else 0.85
    note = f"the rest pose is not a standing body: how the joints stand was {source}"
    if moving and not known:
        note = (
            "the rest pose is out of a motion: how the joints stand was guessed from the frames, to 10 or 20 degrees; "
            "give a file of this figure that rests in a T-pose (rest=, --rest)"
        )
        confidence = 0.7
    # each joint by the directions of its bones
    aligned = Calibration(body, rotations, places, along_axes=known or not moving).aligned
    # the joint that carries legs and back turns with the hips
    hips = body.joints["hips"]
    carrier = body.joint_map.carrier(body.skeleton)
    aligned[carrier] = rotations[0, carrier].T @ rotations[0, hips] @ aligned[hips]
    return Fitted(body, aligned, leg, _heights(body, leg, None), None, confidence, (note,))


def _agreement(body: Body, pose: Array, frame: Array, points: dict[str, Array]) -> float:
    """The least cosine between the directions of bones in a pose (J, 3), seen in a frame, and expected ones."""
    cosines = [float(body.direction(pose, bone) @ frame @ along) for bone, along in points.items()]
    return min(cosines, default=1.0)


def _heights(body: Body, leg: float, rise: Array | None) -> dict[str, float]:
    """Heights of feet and toes over the sole: over the lowest joint at rest (rise (J)), else as the humanoid's."""
    scale = leg / leg_length()
    heights = {}
    for side in LEFT_RIGHT:
        for part in SOLE:
            bone = sided(side, part)
            if bone not in body.joints:
                continue
            joint = body.joints[bone]
            usual = -SOLE[part][0][1] * scale
            below = 0.0 if rise is None else float(rise[joint] - rise[body.skeleton.below(joint)].min())
            heights[bone] = below if below > 0.3 * usual or part == "Toes" else usual
    return heights


def leg_of(body: Body, pose: Array) -> float:
    """Length of thigh and shin in the skeleton's unit, the mean of both sides; MotionError for bones without length."""
    # the lengths of all limbs' bones: a human has none of length 0
    bones = [bone for bone in NEEDED if bone not in ("hips", "spine") and body.aims[bone]]
    lengths = {bone: float(np.linalg.norm(body.along(pose, bone))) for bone in bones}
    leg = sum(lengths[bone] for bone in limb_of("left", LEG[:2]) + limb_of("right", LEG[:2])) / 2
    short = [body.skeleton.names[body.joints[bone]] for bone, length in lengths.items() if length <= 0.02 * leg]
    if short or not leg > 0:
        remedy = "a human's limbs have lengths: export the skeleton with its offsets"
        raise MotionError(f"bones of length zero: {listed(short)}; {remedy}")
    return leg


class Unit(NamedTuple):
    """A length unit in metres, None where it is not known, and a note about how it was determined."""

    metres: float | None
    note: str | None


ADULT_LEG = 0.82
"""Metres of an adult's thigh and shin."""

LIKELY_LEGS = (0.55, 1.1)
"""Metres between which thigh and shin are long in a unit that is guessed."""

POSSIBLE_LEGS = (0.2, 1.6)
"""Metres between which thigh and shin of any human are long."""


def unit_of(skeleton: Skeleton, leg: float) -> Unit:
    """The skeleton's unit as stated, or else as the length of its legs suggests; MotionError for giants and dwarfs."""
    # of the units that make likely legs the one that makes those nearest to an adult's
    shortest, longest = LIKELY_LEGS
    likely = [name for name, metres in LENGTH_UNITS.items() if shortest < leg * metres < longest]
    guess = min(
        likely,
        key=lambda name: abs(np.log(leg * LENGTH_UNITS[name] / ADULT_LEG)),
        default=None,
    )
    stated = skeleton.metres_per_unit
    if stated is not None:
        shortest, longest = POSSIBLE_LEGS
        if shortest < leg * stated < longest:
            return Unit(stated, None)
        looks = f"; its lengths look like {guess}" if guess else ""
        remedy = "give the right unit, or where the file says its own, scale the figure at its source"
        raise UnitError(f"legs of {leg * stated:.3g} m: a human's are {shortest:g} to {longest:g} m{looks}: {remedy}")
    if guess is None:
        return Unit(None, "unit not known: the figure is taken to be an adult's size")
    metres = LENGTH_UNITS[guess]
    return Unit(
        metres,
        f"unit taken to be {guess} from the length of the legs, {leg * metres:.2f} m",
    )


def with_unit_by_legs(motion: Motion) -> Motion:
    """A motion whose file does not state its length unit, with the one that its legs at rest suggest, which is logged;
    as it is where they suggest none, and for no human figure."""
    skeleton = skeleton_of(motion)
    try:
        unit = unit_of(skeleton, leg_of(Body(skeleton, map_of(motion)), skeleton.rest_positions))
    except MotionError:  # it is not human
        return motion
    if unit.metres is None:
        return motion
    log.info("%s", unit.note)
    return motion.with_unit(unit.metres)


def height_of(fitted: Fitted) -> float:
    """Height of a figure that stands straight, in the skeleton's unit: its legs and back are measured, its soles and
    crown are the humanoid's."""
    # up to the head, or as far as the figure has joints
    joint_map = fitted.joint_map
    skeleton = fitted.body.skeleton
    top = "head" if "head" in joint_map.joints else "neck" if joint_map.neck else SPINE[-1]
    joint = joint_map.joints.get("head", (*joint_map.spine, *joint_map.neck)[-1])
    humanoid_back = _back_length(HUMANOID, 0, HUMANOID.index(top))
    rest = (float(T_POSE[:, 1].max()) - leg_length() - humanoid_back) * fitted.leg / leg_length()
    return fitted.leg + _back_length(skeleton, joint_map.carrier(skeleton), joint) + rest


def _back_length(skeleton: Skeleton, hips: int, joint: int) -> float:
    """Length of the bones from the hips up to a joint."""
    chain = skeleton.ancestors(joint)
    return sum(float(np.linalg.norm(skeleton.offsets[i])) for i in chain[: chain.index(hips)])


BENT = 0.3
"""The sine of a knee's angle from which on it is bent."""


def check_stance(body: Body, positions: Array) -> None:
    """Refuse frames (T, J, 3) of a figure on four legs; called where its rest pose is not a standing body.

    A human who sits has the trunk beside the legs, too; known names tell one who sits upright from an animal.
    """
    # in 95 % of the frames the trunk is not above the legs
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
    bends the wrong way only where the pelvis agrees: recorded thighs can be twisted by much.
    """
    # feet point where knees bend away from
    forward_of_toes = []
    for side, hinge in hinges.items():
        foot = sided(side, "Foot")
        if body.aims[foot]:
            forward = np.cross(hinge, -body.direction(positions, sided(side, "LowerLeg")))
            forward_of_toes.append(np.sum(forward * body.direction(positions, foot), axis=-1))
    if forward_of_toes and np.median(forward_of_toes) < -0.3:
        raise MotionError(
            "the feet point backwards: left and right are swapped, or the frames turn inside out: name the joints in a "
            "map, or export the file anew"
        )

    # knees bend backwards, where they bend
    bent, wrong = _knee_frames(body, positions, hinges)
    if bent >= 0.1 * len(positions) and wrong > 0.6 * bent:
        raise MotionError(
            "the knees bend forwards: the frames turn inside out (a wrong order of rotations?), or this is no human: "
            "export the file anew"
        )


def _knee_frames(body: Body, positions: Array, hinges: dict[str, Array]) -> tuple[int, int]:
    """In how many frames of either knee it is bent, and in how many of these forwards, as :func:`check_frames`."""
    bent = 0
    wrong = 0
    left = body.to_left(positions, "UpperLeg")
    for side, hinge in hinges.items():
        thigh = body.direction(positions, sided(side, "UpperLeg"))
        bend = np.cross(thigh, body.direction(positions, sided(side, "LowerLeg")))
        is_bent = np.linalg.norm(bend, axis=-1) > BENT
        is_forward = (np.sum(bend * hinge, axis=-1) < 0) & (np.sum(bend * left, axis=-1) < 0)
        bent += int(is_bent.sum())
        wrong += int((is_bent & is_forward).sum())
    return bent, wrong


ALONG = 0.82
"""Cosine from which on a body stands along an axis: within 35 degrees."""


def upright(fitted: Fitted, places: Array) -> tuple[Array, str | None]:
    """The rotation (3, 3) of the world that makes y point up, and a note about why it is turned or lies, or None.

    The identity where y points up, or nothing else is evident. A figure stands along another axis where its rest pose
    and most of its frames (T, J, 3) do, or where the frames alone do and it walks about: a body that lies down does
    not.
    """
    still = np.eye(3)
    if not len(places):
        return still, None
    trunk = fitted.body.trunk_up(places)
    if fitted.up is not None and fitted.up[1] <= 0.5:
        if float(np.median(trunk @ fitted.up)) > 0.7:
            return swing(fitted.up, UP), "turned upright: the figure does not stand along y"
        return still, None
    up = _up_of_frames(fitted, trunk, places)
    if up is None:
        return still, None
    name = "xyz"[int(np.argmax(np.abs(up)))]
    if _walks_across(fitted, up, places[trunk @ up > ALONG]):
        return swing(up, UP), f"turned upright: the frames stand along {name}, the rest pose along y"
    return (
        still,
        f"the body lies along {name} in most frames: if it stands there, export the file with y up",
    )


def _up_of_frames(fitted: Fitted, trunk: Array, places: Array) -> Array | None:
    """The direction (3,) along x or z in which trunks (T, 3) and legs point in most frames; None where y is up."""
    # the axis that trunks are nearest to in the middle of the frames
    mean = np.median(trunk, axis=0)
    axis = int(np.argmax(np.abs(mean)))
    up: Array = np.sign(mean[axis]) * np.eye(3)[axis]
    if axis == 1 or np.mean(trunk @ up > ALONG) < 0.5 or np.mean(trunk[:, 1] > ALONG) > 0.1:
        return None
    return None if np.median(fitted.body.legs_up(places) @ up) < ALONG else up


def _walks_across(fitted: Fitted, up: Array, places: Array) -> bool:
    """Whether a figure walks: it goes its leg's length and more across ``up``, and not along it."""
    # how far it goes along the axis, and how far across it
    path = fitted.body.middle(places, "UpperLeg")
    rise = float(np.ptp(path @ up))
    extent = np.linalg.norm(np.ptp(path - (path @ up)[:, None] * up, axis=0))
    return bool(extent > max(fitted.leg, 2 * rise))
