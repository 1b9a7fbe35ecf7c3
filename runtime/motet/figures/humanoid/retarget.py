"""Motions of any human figure onto the humanoid, and the humanoid's onto any figure.

A bone of the humanoid has the rotation of its joint in the world, times a constant that makes up for the rest pose
(:mod:`motet.figures.humanoid.measure`). Back and neck share their turns out among their joints; what a figure lacks
stays at rest, but fingers, which are found by their names, bend as in a relaxed hand. Paths are scaled by the lengths
of the legs and laid so that the feet are on the ground.
"""

import logging
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple, TypeVar

import numpy as np

from motet.errors import MotionError
from motet.figures.humanoid.bones import (
    HUMANOID,
    LEFT_RIGHT,
    NECK,
    PARENTS,
    SIDES,
    SPINE,
    ground_under,
    is_mmm,
    joint_of,
    leg_length,
    sided,
    sole_points,
    with_figure,
)
from motet.figures.humanoid.joint_map import BY_THE_TREE, JointMap
from motet.figures.humanoid.joint_tree import map_of
from motet.figures.humanoid.measure import (
    Fitted,
    check_frames,
    fit,
    height_of,
    unit_of,
    upright,
)
from motet.figures.humanoid.soles import Mesh, on_own_soles
from motet.motion.kinematics import (
    Transforms,
    by_name,
    chained,
    global_transforms,
    local_rotations,
    local_translations,
    motion_of,
    places_of,
    side_by_side,
    skeleton_of,
)
from motet.motion.motion import Motion, rest_motion
from motet.motion.rotations import (
    Array,
    angle_of,
    axis_to_rotmat,
    frames_last,
    identities,
    inverse,
    product,
    rotated,
    rotmat_to_rotvec,
    rotvec_to_rotmat,
    swing,
    twist,
    unit,
)
from motet.motion.skeleton import END_SUFFIX, Names, Skeleton

log = logging.getLogger(__name__)

SURE_OF_JOINTS = 0.75
"""Least confidence without a warning: skeletons whose names do not even show sides have less."""

HIPS = [joint_of(side, "UpperLeg") for side in LEFT_RIGHT]


@dataclass(frozen=True, eq=False)
class Figure:
    """A skeleton measured against the humanoid once, for any number of its motions."""

    fitted: Fitted
    """The skeleton's joints, axes and leg length."""

    first: Motion
    """One frame of a motion of the skeleton."""

    turn: Array
    """The rotation (3, 3) that stands the world of its files upright."""

    ground: float | None = None
    """The height of its files' ground in the humanoid's world, in metres; None where each motion's feet decide."""

    @staticmethod
    def of(like: Motion | Skeleton, joint_map: JointMap | None = None) -> "Figure":
        """The figure of a skeleton, or of a motion where the rest pose is not a standing body, whose frames then show
        how its joints stand; MotionError, with the reason, where it is not human."""
        example = like if isinstance(like, Motion) else rest_motion(like)
        transforms = global_transforms(example)
        fitted = fit(skeleton_of(example), joint_map or map_of(example), *transforms)
        return Figure(fitted, example[:1], upright(fitted, transforms[1])[0])

    def to_humanoid(self, motion: Motion) -> Motion:
        """Another motion of the skeleton on the humanoid."""
        motion = with_figure(motion) if is_mmm(motion) else motion
        return self._retargeted(*global_transforms(motion), motion.fps)[0]

    def _retargeted(self, rotations: Array, places: Array, fps: float) -> tuple[Motion, "Figure"]:
        """The humanoid's motion of rotations (T, J, 3, 3) in the world and positions (T, J, 3), laid on the ground, and
        the figure with the height of that ground."""
        # the humanoid's bones turn in the world as the figure's do
        turned = product(self.turn, _humanoid_rotations(rotations, places, self.fitted))

        # the middle between its hip joints takes the figure's path, scaled by the lengths of the legs
        legs = self.fitted.body.middle(places, "UpperLeg") @ self.turn.T * (leg_length() / self.fitted.leg)
        joints = places_of(HUMANOID, turned)
        joints += (legs - joints[:, HIPS].mean(axis=1))[:, None]

        # the ground goes to y = 0
        ground = ground_under(sole_points(turned, joints)) if self.ground is None else self.ground
        root = joints[:, 0] - (0.0, ground, 0.0)
        return motion_of(HUMANOID, turned, {0: root}, fps), replace(self, ground=ground)

    @cached_property
    def posture(self) -> tuple[Skeleton, Array]:
        """The skeleton with its unit, where that is known, and local rotations (J, 3, 3) of joints that are no bones:
        at rest, or as in the first frame, except fingers, which bend as in a relaxed hand."""
        skeleton = skeleton_of(self.first)
        still = identities(len(skeleton.joints))
        if self.fitted.up is None:  # measured in frames, not at rest
            still = local_rotations(self.first)[0]
            offsets = local_translations(self.first)[0]
            offsets[0] = skeleton.offsets[0]
            skeleton = skeleton.with_offsets(offsets)
        if skeleton.metres_per_unit is None:
            skeleton = replace(skeleton, metres_per_unit=unit_of(skeleton, self.fitted.leg).metres)
        return skeleton, relaxed(skeleton, still, self.fitted.body.joints)


@dataclass(frozen=True)
class Humanoid:
    """A motion on the humanoid, and the findings on the way there."""

    motion: Motion
    """The motion on :data:`motet.motion.HUMANOID`, at the file's frame rate, root translation in metres."""

    joints: dict[str, Names]
    """For each bone the names of the joints that it was taken from."""

    convention: str
    """The convention of the joints' names, "by the tree", or the name of the user's map."""

    confidence: float
    """From 0 to 1, how certain the assignment of joints to bones is."""

    unit: float | None
    """Metres of one unit of the file's lengths, as stated or as the legs suggest; None where it is not known."""

    leg: float | None
    """Metres of the figure's thigh and shin together, None where its unit is not known."""

    height: float | None
    """About how tall the figure stands, in metres, None where its unit is not known."""

    notes: Names
    """Sentences about the assumptions made."""

    figure: Figure
    """The skeleton as it was measured."""

    @property
    def summary(self) -> str:
        """The findings in one line: convention, confidence and notes."""
        source = "found by the tree" if self.convention == BY_THE_TREE else f"of {self.convention}"
        return "; ".join((f"joints {source}, confidence {self.confidence:.2f}", *self.notes))

    def logged(self) -> "Humanoid":
        """The same, after a line in the log: a warning where the joints are uncertain."""
        level = logging.INFO if self.confidence >= SURE_OF_JOINTS else logging.WARNING
        log.log(level, "brought to the humanoid: %s", self.summary)
        return self


def to_humanoid(motion: Motion, joint_map: JointMap | None = None) -> Humanoid:
    """Retarget a motion of any human skeleton to the humanoid.

    joint_map: which joint is which bone, as :func:`motet.motion.read_map` reads it; worked out where not given.
    The path is scaled by the ratio of the legs' lengths, and the soles' lowest points are laid on y = 0 at their 5th
    percentile. A file with z up, or whose frames alone have it, is turned upright. MotionError, with the reason, for a
    figure that is not human.
    """
    motion = with_figure(motion) if is_mmm(motion) else motion
    skeleton = skeleton_of(motion)
    if not len(motion):
        raise MotionError("this motion has no frames to put on the humanoid")
    # by names, by the tree, or as the user says
    joint_map = joint_map or map_of(motion)

    # the figure is measured, and refused where its knees bend the wrong way about the thighs' axes
    rotations, places = global_transforms(motion)
    fitted = fit(skeleton, joint_map, rotations, places)
    check_frames(fitted.body, places, _knee_hinges(rotations, fitted))

    # its frames are turned upright, brought to the humanoid and laid on the ground
    length_unit = unit_of(skeleton, fitted.leg)
    turn, turn_note = upright(fitted, places)
    retargeted, figure = Figure(fitted, motion[:1], turn)._retargeted(rotations, places, motion.fps)
    folded_note = f"the joint {skeleton.names[0]!r} above the hips is folded in" if joint_map.joints["hips"] else None
    notes = (*fitted.notes, length_unit.note, turn_note, folded_note)
    return _findings(retargeted, figure, length_unit.metres, tuple(note for note in notes if note))


def _findings(motion: Motion, figure: Figure, metres: float | None, notes: Names) -> Humanoid:
    """A motion on the humanoid with what is found about its figure. metres: of one unit of its lengths, if known."""
    fitted = figure.fitted
    joint_map = fitted.joint_map
    return Humanoid(
        motion=motion,
        joints=joint_map.names(fitted.body.skeleton),
        convention=joint_map.convention,
        confidence=round(joint_map.confidence * fitted.confidence, 2),
        unit=metres,
        leg=None if metres is None else fitted.leg * metres,
        height=None if metres is None else height_of(fitted) * metres,
        notes=notes,
        figure=figure,
    )


def _knee_hinges(rotations: Array, fitted: Fitted) -> dict[str, Array]:
    """For each side the axis (T, 3) in the world about which the knee bends: that of the thigh to the left."""
    hinges = {}
    for side in LEFT_RIGHT:
        thigh = fitted.joint_map.joints[sided(side, "UpperLeg")]
        hinges[side] = rotated(rotations[:, thigh], fitted.aligned[thigh][:, 0])
    return hinges


def on_humanoid(motion: Motion) -> Motion:
    """The motion of :func:`to_humanoid`, or the motion itself if it is the humanoid's; what is found is logged."""
    return motion if motion.skeleton == HUMANOID else to_humanoid(motion).logged().motion


def grounded(motion: Motion) -> Motion:
    """A motion of the humanoid laid on the ground, as :func:`to_humanoid` lays others, where it floats or sinks a
    little, as motions of models may; one that is further than 0.1 m from the ground stays as it is."""
    if "hips.ty" not in motion.channels:
        return motion
    ground = ground_under(sole_points(*global_transforms(motion)))
    # what is far from the ground is meant to be: stairs, a chair, a jump
    values = np.array(motion.values)
    values[:, motion.channels.index("hips.ty")] -= ground if abs(ground) < 0.1 else 0.0
    return replace(motion, values=values)


def _humanoid_rotations(rotations: Array, places: Array, fitted: Fitted) -> Array:
    """Rotations in the world (T, J, 3, 3) of the humanoid's joints, from those (T, J, 3, 3) and the positions
    (T, J, 3) of the figure's."""
    joint_map = fitted.joint_map

    # bones of limbs have the rotation of their joint, times the constant of its rest pose
    aligned = product(rotations, fitted.aligned)
    turned = {bone: aligned[:, joint] for bone, joint in joint_map.joints.items()}
    if not fitted.pelvis:
        turned["hips"] = _as_legs_lie(turned["hips"], fitted.body.to_left(places, "UpperLeg"))

    # back and neck share out the turns of as many joints as the figure has there
    spine = [aligned[:, joint] for joint in joint_map.spine]
    turned |= _spread([turned["hips"], *spine], SPINE)
    neck = [aligned[:, joint] for joint in (joint_map.spine[-1], *joint_map.neck_and_head)]
    if len(neck) > 1:
        turned |= _spread(neck, NECK)

    # bones that the figure lacks, and tips, go with their parents
    for bone, parent in PARENTS.items():
        turned.setdefault(bone, turned[parent])
    return side_by_side(
        [turned[name.removesuffix(END_SUFFIX)] for name in HUMANOID.names],
        len(rotations),
    )


def _as_legs_lie(hips: Array, to_left: Array) -> Array:
    """Rotations (T, 3, 3) of hips turned the shortest way to where the legs' joints lie, from directions (T, 3)."""
    return product(swing(hips[:, :, 0], to_left), hips)


Key = TypeVar("Key", str, int)


def _spread(chain: list[Array], others: Sequence[Key]) -> dict[Key, Array]:
    """World rotations (T, 3, 3) of the joints of another chain with the same ends, from those of a chain.

    The first rotation is that of the joint that carries both chains, which is not among the others; the last of both
    chains is the same. Between joints rotations go the shortest way, by how far up the chain they are.
    """
    # all rotations of the chain in one array, so that all shares are computed at once
    stacked = side_by_side(chain, len(chain[0]))
    # where the other joints are on the chain: after which joint, and by which part of the way to the next
    up_chain = np.arange(1, len(others) + 1) * (len(chain) - 1) / max(len(others), 1)
    below = np.ceil(up_chain).astype(int) - 1
    part = up_chain - below
    shared: Array = stacked[:, below + 1]

    # between two joints a share of the turn from the lower to the upper one
    inner = np.flatnonzero(part < 1)
    if len(inner):
        lower = stacked[:, below[inner]]
        turn = rotmat_to_rotvec(product(inverse(lower), shared[:, inner]))
        shared[:, inner] = product(lower, rotvec_to_rotmat(turn * part[inner, None]))
    return dict(zip(others, np.moveaxis(shared, 1, 0), strict=True))


def from_humanoid(
    motion: Motion,
    like: Motion | Skeleton | Figure,
    joint_map: JointMap | None = None,
    *,
    skin: Mapping[int, Array] | None = None,
    ahead: bool = False,
) -> Motion:
    """Retarget a motion of the humanoid to another human skeleton, with its names, rest pose and proportions.

    like: the skeleton; where its rest pose is not a standing body, a motion of it, whose frames then show how its
        joints stand; or it as it was measured already (:attr:`Humanoid.figure`).
    joint_map: as for :func:`to_humanoid`. Joints that are no bones keep their rest, except fingers, which bend as in a
    relaxed hand. The path is scaled by the ratio of the legs' lengths and the feet stay on the ground. Returns the
    translation of the hips in "length" and three angles in "deg" for each joint. The skeleton keeps its stated unit,
    whatever its size, or gets the one that the legs' length suggests.
    skin: joint -> points (P, 3) of the figure's mesh, from the joint where every angle is 0. It stands on those of its
        feet, and hands and head stay above the ground (:mod:`motet.figures.humanoid.soles`).
    ahead: the motion's z becomes the direction that the figure faces at rest.
    MotionError for a motion that is not the humanoid's, or a skeleton that is not human.
    """
    if motion.skeleton != HUMANOID:
        raise MotionError("this motion is not on the humanoid: convert it with to_humanoid first")
    figure = like if isinstance(like, Figure) else Figure.of(like, joint_map)
    fitted = figure.fitted
    skeleton, still = figure.posture
    source, places = _facing_as_figure(motion, fitted) if ahead else global_transforms(motion)

    # the figure's joints turn in the world as the humanoid's bones do
    turned = _figure_rotations(source, fitted, skeleton, still)

    # the middle between its hip joints takes the humanoid's path, scaled by the lengths of the legs
    path = places[:, HIPS].mean(axis=1) * (fitted.leg / leg_length())
    path -= fitted.body.middle(places_of(skeleton, turned), "UpperLeg")

    # the body is raised onto its soles
    turned, rise = _onto_soles(fitted, skin, (source, places), turned, path, motion.fps)
    path[:, 1] += rise
    return motion_of(skeleton, turned, _translations(fitted, skeleton, turned, path), motion.fps)


def _onto_soles(
    fitted: Fitted,
    skin: Mapping[int, Array] | None,
    source: Transforms,
    turned: Array,
    path: Array,
    fps: float,
) -> tuple[Array, Array | float]:
    """A figure's rotations (T, J, 3, 3), and how far (T,) it is raised above its root's path (T, 3), to stand on the
    soles of its mesh, or on soles like the humanoid's. source: rotations and positions of the humanoid's joints."""
    mesh = Mesh(fitted.body, skin or {})
    if mesh.has_soles() and len(turned):
        return on_own_soles(mesh, source, turned, path, fitted.leg / leg_length(), fps)
    return turned, _rise_of_joints(fitted, source, turned, path)


def _facing_as_figure(motion: Motion, fitted: Fitted) -> Transforms:
    """Rotations (T, J, 3, 3) and positions (T, J, 3) of a motion of the humanoid, turned so that its z becomes the
    direction that a figure faces at rest."""
    rotations, places = global_transforms(motion)
    x, _, z = fitted.aligned[fitted.body.joints["hips"]][:, 2]
    if np.hypot(x, z) <= 0.5:  # at rest it faces up or down
        return rotations, places
    front = axis_to_rotmat("y", angle_of(x, z))
    return product(front, rotations), rotated(front, places)


def _rise_of_joints(fitted: Fitted, source: Transforms, turned: Array, path: Array) -> float:
    """How far a figure without a mesh is raised above its root's path (T, 3), for feet as high as the humanoid's.

    source: rotations and positions of the humanoid's joints. turned: rotations (T, J, 3, 3) of the figure's.
    """
    # its soles would be here; they come to where the humanoid's are
    rotations = {bone: source[0][:, HUMANOID.index(bone)] for bone in fitted.heights}
    soles = fitted.soles(rotations, places_of(fitted.body.skeleton, turned) + path[:, None])
    ground = ground_under(sole_points(*source))
    return fitted.leg / leg_length() * ground - ground_under(soles)


def _translations(fitted: Fitted, skeleton: Skeleton, turned: Array, path: Array) -> dict[int, Array]:
    """Translations (T, 3) of the joint that carries legs and back in its parent's frame, by its index, from rotations
    (T, J, 3, 3) of all joints and the path (T, 3) of the root."""
    carrier = fitted.joint_map.carrier(skeleton)
    if not carrier:
        return {0: path}
    # from the joint above, whose own offset from the root is no part of the path
    figure = places_of(skeleton, turned)
    above = skeleton.joints[carrier].parent
    from_above = figure[:, carrier] + path - figure[:, above] - skeleton.offsets[0]
    return {carrier: rotated(inverse(turned[:, above]), from_above)}


def _figure_rotations(source: Array, fitted: Fitted, skeleton: Skeleton, still: Array) -> Array:
    """Rotations in the world (T, J, 3, 3) of a figure's joints, from those of the humanoid's."""
    # joints that are bones turn as the humanoid's, times the constant of their rest pose
    wanted = _bone_rotations(source, fitted.joint_map, skeleton)
    turned = frames_last((len(source), len(skeleton.joints), 3, 3))
    known = list(wanted)
    turned[:, known] = product(side_by_side(list(wanted.values()), len(source)), inverse(fitted.aligned[known]))

    # all others keep their local rotation; one between forearm and hand, as CMU's wrists, takes the hand's twist
    hands = {fitted.joint_map.joints.get(sided(side, "Hand")) for side in LEFT_RIGHT}
    for i, joint in enumerate(skeleton.joints):
        if i not in wanted:
            turned[:, i] = product(turned[:, joint.parent], still[i]) if i else still[0]
            for hand in hands.intersection(skeleton.children[i]):
                turned[:, i] = _with_twist_of(turned[:, hand], turned[:, i], skeleton.offsets[hand])
    return turned


def _with_twist_of(hand: Array, wrist: Array, axis: Array) -> Array:
    """Rotations (T, 3, 3) in the world of a joint with the hand's twist about the bone (3,) between them."""
    return product(wrist, twist(product(inverse(wrist), hand), axis))


def _bone_rotations(source: Array, joint_map: JointMap, skeleton: Skeleton) -> dict[int, Array]:
    """Joint -> rotations (T, 3, 3) of its bone, from those of the humanoid's joints (T, J, 3, 3): back and neck share
    out the turns of the humanoid's among as many joints as the figure has there, and the joint that carries legs and
    back turns with the hips."""
    turned = by_name(HUMANOID, source)
    wanted = {joint: turned[bone] for bone, joint in joint_map.joints.items()}
    wanted |= _spread([turned[bone] for bone in ("hips", *SPINE)], joint_map.spine)
    # the neck ends in the head, whether the figure has a joint for it or not
    wanted |= _spread([turned[bone] for bone in (SPINE[-1], *NECK)], joint_map.neck_and_head)
    wanted.setdefault(joint_map.carrier(skeleton), turned["hips"])
    return wanted


FINGER_BENDS = (15.0, 25.0, 15.0)
"""Degrees by which the bones of a finger of a hand at rest bend, each against the bone before."""

FINGER_SHARES = {
    "thumb": 0.5,
    "index": 0.8,
    "mid": 1.0,
    "ring": 1.15,
    "pinky|little": 1.3,
}
"""Pattern of the names of a finger's joints -> how far it bends in a relaxed hand, as a factor of FINGER_BENDS."""


def relaxed(skeleton: Skeleton, still: Array, joints: Mapping[str, int]) -> Array:
    """Local rotations (J, 3, 3) of a pose with its hands relaxed; hands without such fingers do not change.

    joints: of the humanoid's bones; "leftHand" and "rightHand" count. Fingers bend a little, more from index to little
    finger, in the plane of themselves and the palm's normal, the thumb towards the other fingers, too. The knuckles of
    index and other fingers show on which side the palm is. Bends at rest count.
    """
    # the hands at rest, in the world
    rotations, places = chained(skeleton, still[None].copy(), skeleton.offsets[None].copy())
    bent = still.copy()
    for side, sign in SIDES:
        hand = joints.get(sided(side, "Hand"))
        if hand is None:
            continue
        fingers = _fingers(skeleton, hand)
        directions = _hand_directions(fingers, places[0], hand, -sign)
        if directions is None:
            continue
        for finger, chain in fingers.items():
            start = None if finger == "thumb" else directions.along
            inwards = directions.palm + directions.across if finger == "thumb" else directions.palm
            for joint, turn in _finger_turns(places[0], chain, start, inwards, FINGER_SHARES[finger]):
                bent[joint] = bent[joint] @ rotvec_to_rotmat(rotations[0, joint].T @ turn)
    return bent


class HandDirections(NamedTuple):
    """Directions (3,) of a hand in the world."""

    along: Array
    """From the wrist to the knuckles."""

    across: Array
    """From the index to the little finger."""

    palm: Array
    """Out of the palm."""


def _hand_directions(fingers: Mapping[str, list[int]], places: Array, hand: int, sign: float) -> HandDirections | None:
    """Directions of a hand with fingers, from positions (J, 3) of all joints; None where the index finger or all others
    are missing. sign: 1 for the right hand, -1 for the left."""
    knuckles = {finger: places[chain[0]] for finger, chain in fingers.items() if finger != "thumb"}
    if "index" not in knuckles or len(knuckles) < 2:
        return None
    # index and little finger lie on a line across the palm, which tells its normal, left and right mirrored
    along = unit(np.mean(list(knuckles.values()), axis=0) - places[hand])
    across = unit(knuckles[list(knuckles)[-1]] - knuckles["index"])
    return HandDirections(along, across, unit(sign * np.cross(along, across)))


def _finger_turns(
    places: Array, chain: list[int], start: Array | None, inwards: Array, share: float
) -> Iterator[tuple[int, Array]]:
    """The joints of a finger and the rotation vectors (3,) in the world by which they bend further.

    places: positions (J, 3) of all joints. start: the direction (3,) against which the first bone bends, None for its
    own. inwards: the direction (3,) that the finger bends to. share: of the bends of a middle finger.
    """
    pointing = [unit(places[after] - places[joint]) for joint, after in pairwise(chain)]
    # the last joint, where it has no tip, points where the joint before it does
    pointing = [*pointing, *pointing[-1:]] or [np.zeros(3)]
    before = pointing[0] if start is None else start
    axis = np.cross(before, inwards)
    for joint, bone, bend in zip(chain, pointing, FINGER_BENDS, strict=False):
        # each bone bends against the bone before, about the part of the axis that is across it
        aside = unit(axis - (axis @ bone) * bone)
        yield (
            joint,
            max(0.0, np.radians(bend) * share - _bend(before, bone, aside)) * aside,
        )
        before = bone


def _bend(before: Array, bone: Array, axis: Array) -> float:
    """The angle in radians by which a bone (3,) is bent against the bone before about an axis across it."""
    sine = np.cross(before, bone) @ axis
    cosine = before @ bone - (before @ axis) * (bone @ axis)
    return float(np.arctan2(sine, cosine))


def _fingers(skeleton: Skeleton, hand: int) -> dict[str, list[int]]:
    """The fingers of a hand by the names of its joints: the joints of each, from the knuckle on."""
    fingers: dict[str, list[int]] = {}
    for joint in skeleton.below(hand):
        name = skeleton.names[joint].lower()
        # bones within the palm do not bend
        finger = next((words for words in FINGER_SHARES if re.search(words, name)), None)
        within_palm = finger != "thumb" and re.search("meta|carpal|palm|inhand", name)
        if joint == hand or finger is None or within_palm:
            continue
        chain = fingers.setdefault(finger, [joint])
        if skeleton.joints[joint].parent == chain[-1]:
            chain.append(joint)
    return {finger: fingers[finger] for finger in FINGER_SHARES if finger in fingers}
