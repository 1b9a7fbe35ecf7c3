"""Motions of any human figure onto the humanoid, and the humanoid's onto any figure.

A bone of the humanoid has the rotation of its joint in the world, times a constant that makes up for the rest pose
(:mod:`motet.figures.humanoid.measure`). Back and neck share their turns out among their joints; what a figure lacks
stays at rest, but fingers, which are found by their names, bend as in a relaxed hand. Paths are scaled by the lengths
of the legs and laid so that the feet are on the ground.
"""

import logging
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from motet.errors import MotionError
from motet.figures.humanoid import bones
from motet.figures.humanoid.bones import (
    HUMANOID,
    LEFT_RIGHT,
    NECK,
    PARENTS,
    SPINE,
    is_mmm,
    leg_length,
    sided,
    with_figure,
)
from motet.figures.humanoid.joint_map import BY_THE_TREE, JointMap
from motet.figures.humanoid.joint_tree import map_of
from motet.figures.humanoid.measure import Fitted, check_frames, fit, height_of, unit_of, upright
from motet.figures.humanoid.soles import Mesh, on_own_soles
from motet.motion.kinematics import (
    chained,
    global_transforms,
    local_rotations,
    local_translations,
    motion_of,
    places_of,
    side_by_side,
    skeleton_of,
)
from motet.motion.motion import Motion
from motet.motion.rotations import (
    Array,
    angle_of,
    axis_to_rotmat,
    frames_last,
    inverse,
    product,
    rotated,
    rotmat_to_rotvec,
    rotvec_to_rotmat,
    swing,
    twist,
    unit,
)
from motet.motion.skeleton import END_SUFFIX, Skeleton

log = logging.getLogger(__name__)

SURE_OF_JOINTS = 0.75
"""Confidence from which on what was found needs no warning: less has a skeleton whose names do not even tell sides."""

HIPS = [HUMANOID.index(sided(side, "UpperLeg")) for side in LEFT_RIGHT]


@dataclass(frozen=True, eq=False)
class Figure:
    """A skeleton measured against the humanoid once, for any number of its motions.

    first: one frame of it. turn: (3, 3) stands the world of its files upright. ground: how high the ground of its files
    is in the humanoid's world, in metres; None where each motion's feet tell.
    """

    fitted: Fitted
    first: Motion
    turn: Array
    ground: float | None = None

    @staticmethod
    def of(like: Motion | Skeleton, joint_map: JointMap | None = None) -> "Figure":
        """The figure of a skeleton, or of a motion where the rest pose is not a standing body, whose frames then tell
        how its joints stand; MotionError, with the reason, where it is no human's."""
        example = like if isinstance(like, Motion) else Motion(np.zeros((1, 0)), (), (), 1.0, like)
        transforms = global_transforms(example)
        fitted = fit(skeleton_of(example), joint_map or map_of(example), *transforms)
        return Figure(fitted, example[:1], upright(fitted, transforms[1])[0])

    def to_humanoid(self, motion: Motion) -> Motion:
        """Another motion of the skeleton on the humanoid."""
        motion = with_figure(motion) if is_mmm(motion) else motion
        return self._retargeted(*global_transforms(motion), motion.fps)[0]

    def _retargeted(self, rotations: Array, places: Array, fps: float) -> tuple[Motion, "Figure"]:
        """The humanoid's motion of rotations (T, J, 3, 3) in the world and positions (T, J, 3), laid on the ground, and
        the figure that knows how high that is."""
        turned = product(self.turn, _humanoid_rotations(rotations, places, self.fitted))
        legs = self.fitted.body.middle(places, "UpperLeg") @ self.turn.T * (leg_length() / self.fitted.leg)
        found = places_of(HUMANOID, turned)
        found += (legs - found[:, HIPS].mean(axis=1))[:, None]
        ground = bones.ground_under(bones.sole_points(turned, found)) if self.ground is None else self.ground
        root = found[:, 0] - (0.0, ground, 0.0)
        return motion_of(HUMANOID, turned, {0: root}, fps), replace(self, ground=ground)

    @cached_property
    def posture(self) -> tuple[Skeleton, Array]:
        """The skeleton with its unit, where that is known, and local rotations (J, 3, 3) of joints that are no bones:
        at rest, or as in the first frame, but for fingers, which bend as in a relaxed hand."""
        skeleton = skeleton_of(self.first)
        still = np.tile(np.eye(3), (len(skeleton.joints), 1, 1))
        if self.fitted.up is None:  # measured in frames, not at rest
            still = local_rotations(self.first)[0]
            offsets = local_translations(self.first)[0].tolist()
            offsets[0] = skeleton.joints[0].offset
            zipped = zip(skeleton.joints, offsets, strict=True)
            skeleton = replace(skeleton, joints=tuple(replace(joint, offset=tuple(at)) for joint, at in zipped))
        if skeleton.metres_per_unit is None:
            skeleton = replace(skeleton, metres_per_unit=unit_of(skeleton, self.fitted.leg).metres)
        return skeleton, relaxed(skeleton, still, self.fitted.body.joints)


@dataclass(frozen=True)
class Humanoid:
    """A motion on the humanoid, and what was found on the way.

    motion: on :data:`motet.motion.HUMANOID`, at the file's frame rate, root translation in metres.
    joints: bone -> the names of the joints that it was taken from.
    convention: the convention of the joints' names, "by the tree", or the name of the user's map.
    confidence: from 0 to 1, how sure it is that every joint was taken for what it is.
    unit: metres of one unit of the file's lengths, as it says or as the legs tell; None where it is not known.
    leg: metres of the figure's thigh and shin together, None where its unit is not known.
    height: about how tall the figure stands, in metres, None where its unit is not known.
    notes: sentences about what was assumed.
    figure: the skeleton as it was measured.
    """

    motion: Motion
    joints: dict[str, tuple[str, ...]]
    convention: str
    confidence: float
    unit: float | None
    leg: float | None
    height: float | None
    notes: tuple[str, ...]
    figure: Figure

    @property
    def summary(self) -> str:
        """The findings in one line: convention, confidence and notes."""
        found = "found by the tree" if self.convention == BY_THE_TREE else f"of {self.convention}"
        return "; ".join((f"joints {found}, confidence {self.confidence:.2f}", *self.notes))

    def logged(self) -> "Humanoid":
        """The same, which is logged."""
        level = logging.INFO if self.confidence >= SURE_OF_JOINTS else logging.WARNING
        log.log(level, "brought to the humanoid: %s", self.summary)
        return self


def to_humanoid(motion: Motion, joint_map: JointMap | None = None) -> Humanoid:
    """Retarget a motion of any human skeleton to the humanoid.

    joint_map: which joint is which bone, as :func:`motet.motion.read_map` reads it; found where not given.
    The path is scaled by the ratio of the legs' lengths, and the soles' lowest points are laid on y = 0 at their 5th
    percentile. A file with z up, or whose frames alone have it, is turned upright. MotionError, with the reason, for a
    figure that is no human's.
    """
    motion = with_figure(motion) if is_mmm(motion) else motion
    skeleton = skeleton_of(motion)
    if not len(motion):
        raise MotionError("this motion has no frames to put on the humanoid")
    joint_map = joint_map or map_of(motion)
    rotations, places = global_transforms(motion)
    fitted = fit(skeleton, joint_map, rotations, places)
    # knees bend about the axis of the thigh
    thighs = {side: joint_map.joints[sided(side, "UpperLeg")] for side in LEFT_RIGHT}
    hinges = {side: rotated(rotations[:, i], fitted.aligned[i][:, 0]) for side, i in thighs.items()}
    check_frames(fitted.body, places, hinges)
    unit, (turn, note) = unit_of(skeleton, fitted.leg), upright(fitted, places)
    found, figure = Figure(fitted, motion[:1], turn)._retargeted(rotations, places, motion.fps)
    notes = [text for text in (*fitted.notes, unit.note, note) if text]
    if joint_map.joints["hips"]:
        notes.append(f"the joint {skeleton.names[0]!r} above the hips is folded in")
    confidence = round(joint_map.confidence * fitted.confidence, 2)
    leg = height = None
    if unit.metres is not None:
        leg = fitted.leg * unit.metres
        height = height_of(fitted) * unit.metres
    joints = joint_map.names(skeleton)
    convention = joint_map.convention
    return Humanoid(found, joints, convention, confidence, unit.metres, leg, height, tuple(notes), figure)


def on_humanoid(motion: Motion) -> Motion:
    """The motion of :func:`to_humanoid`, or the motion itself if it is the humanoid's; what is found is logged."""
    return motion if motion.skeleton == HUMANOID else to_humanoid(motion).logged().motion


def grounded(motion: Motion) -> Motion:
    """A motion of the humanoid laid on the ground, as :func:`to_humanoid` lays others, where it floats or sinks a
    little, as motions of models may; one that is further than 0.1 m from the ground stays as it is."""
    if "hips.ty" not in motion.channels:
        return motion
    ground = bones.ground_under(bones.sole_points(*global_transforms(motion)))
    values = np.array(motion.values)
    values[:, motion.channels.index("hips.ty")] -= ground if abs(ground) < 0.1 else 0.0
    return replace(motion, values=values)


def _humanoid_rotations(rotations: Array, places: Array, fitted: Fitted) -> Array:
    """Rotations in the world (T, J, 3, 3) of the humanoid's joints, from those (T, J, 3, 3) and the positions
    (T, J, 3) of the figure's."""
    joint_map = fitted.joint_map
    own = product(rotations, fitted.aligned)
    turned = {bone: own[:, joint] for bone, joint in joint_map.joints.items()}
    if not fitted.pelvis:
        to_legs = swing(turned["hips"][:, :, 0], fitted.body.to_left(places, "UpperLeg"))
        turned["hips"] = product(to_legs, turned["hips"])
    spine, neck = ([own[:, joint] for joint in chain] for chain in (joint_map.spine, joint_map.neck))
    neck += [turned["head"]] if "head" in turned else []
    turned |= dict(zip(SPINE, _spread([turned["hips"], *spine], len(SPINE)), strict=True))
    turned |= dict(zip(NECK, _spread([spine[-1], *neck], len(NECK)), strict=True)) if neck else {}
    for bone, parent in PARENTS.items():
        turned.setdefault(bone, turned[parent])
    return side_by_side([turned[name.removesuffix(END_SUFFIX)] for name in HUMANOID.names], len(rotations))


def _spread(chain: list[Array], count: int) -> list[Array]:
    """World rotations (T, 3, 3) of ``count`` joints of another chain with the same ends, from those of a chain.

    The first rotation is that of the joint that carries the chain and is not among the result; the last of both
    chains is the same. Between joints rotations go the shortest way, by how far up the chain they are.
    """
    stacked = side_by_side(chain, len(chain[0]))
    places = np.arange(1, count + 1) * (len(chain) - 1) / max(count, 1)
    below = np.ceil(places).astype(int) - 1
    part = places - below
    shared: Array = stacked[:, below + 1]
    inner = np.flatnonzero(part < 1)
    if len(inner):
        lower = stacked[:, below[inner]]
        turn = rotmat_to_rotvec(product(inverse(lower), shared[:, inner]))
        shared[:, inner] = product(lower, rotvec_to_rotmat(turn * part[inner, None]))
    return list(np.moveaxis(shared, 1, 0))


def from_humanoid(
    motion: Motion,
    like: Motion | Skeleton | Figure,
    joint_map: JointMap | None = None,
    *,
    skin: Mapping[int, Array] | None = None,
    ahead: bool = False,
) -> Motion:
    """Retarget a motion of the humanoid to another human skeleton, with its names, rest pose and proportions.

    like: the skeleton; where its rest pose is not a standing body, a motion of it, whose frames then tell how its
        joints stand; or it as it was measured already (:attr:`Humanoid.figure`).
    joint_map: as for :func:`to_humanoid`. Joints that are no bones keep their rest, but fingers bend as in a relaxed
    hand. The path is scaled by the ratio of the legs' lengths and the feet stay on the ground. Returns the translation
    of the hips in "length" and three angles in "deg" for each joint; the skeleton knows its unit where it did, of
    whatever size it is, or where the legs' length tells it.
    skin: joint -> points (P, 3) of the figure's mesh, from the joint where every angle is 0. It stands on those of its
        feet, and hands and head stay above the ground (:mod:`motet.figures.humanoid.soles`).
    ahead: the motion's z becomes the way that the figure faces at rest.
    MotionError for a motion that is not the humanoid's, or a skeleton that is no human's.
    """
    if motion.skeleton != HUMANOID:
        raise MotionError("this motion is not on the humanoid: convert it with to_humanoid first")
    figure = like if isinstance(like, Figure) else Figure.of(like, joint_map)
    fitted, (skeleton, still) = figure.fitted, figure.posture
    source, places = global_transforms(motion)
    x, _, z = fitted.aligned[fitted.body.joints["hips"]][:, 2]
    if ahead and np.hypot(x, z) > 0.5:  # it faces neither up nor down
        front = axis_to_rotmat("y", angle_of(x, z))
        source = product(front, source)
        places = rotated(front, places)
    turned = _figure_rotations(source, fitted, skeleton, still)
    scale = fitted.leg / leg_length()
    path = places[:, HIPS].mean(axis=1) * scale - fitted.body.middle(places_of(skeleton, turned), "UpperLeg")
    mesh = Mesh(fitted.body, skin or {})
    if mesh.has_soles() and len(motion):
        turned, raised = on_own_soles(mesh, (source, places), turned, path, scale, motion.fps)
        path[:, 1] += raised
    else:
        path[:, 1] += _rise_of_joints(fitted, (source, places), turned, path)
    moved = _from_parent(fitted, skeleton, turned, path)
    return motion_of(skeleton, turned, {fitted.joint_map.carrier(skeleton): moved}, motion.fps)


def _rise_of_joints(fitted: Fitted, source: tuple[Array, Array], turned: Array, path: Array) -> float:
    """How far a figure without a mesh is raised above its root's path (T, 3), for feet as high as the humanoid's.

    source: rotations and positions of the humanoid's joints. turned: rotations (T, J, 3, 3) of the figure's.
    """
    rotations = {bone: source[0][:, HUMANOID.index(bone)] for bone in fitted.heights}
    soles = fitted.soles(rotations, places_of(fitted.body.skeleton, turned) + path[:, None])
    ground = bones.ground_under(bones.sole_points(*source))
    return fitted.leg / leg_length() * ground - bones.ground_under(soles)


def _from_parent(fitted: Fitted, skeleton: Skeleton, turned: Array, path: Array) -> Array:
    """Translations (T, 3) of a figure's carrier in its parent's frame, from rotations (T, J, 3, 3) of its joints and
    the path (T, 3) of its root."""
    carrier = fitted.joint_map.carrier(skeleton)
    if not carrier:
        return path
    figure = places_of(skeleton, turned)
    above = skeleton.joints[carrier].parent
    from_above = figure[:, carrier] + path - figure[:, above] - skeleton.offsets[0]
    return rotated(inverse(turned[:, above]), from_above)


def _figure_rotations(source: Array, fitted: Fitted, skeleton: Skeleton, still: Array) -> Array:
    """Rotations in the world (T, J, 3, 3) of a figure's joints, from those of the humanoid's."""
    joint_map = fitted.joint_map
    wanted = {joint: source[:, HUMANOID.index(bone)] for bone, joint in joint_map.joints.items()}
    back, neck = (
        [source[:, HUMANOID.index(bone)] for bone in chain] for chain in (("hips", *SPINE), (SPINE[-1], *NECK))
    )
    wanted |= dict(zip(joint_map.spine, _spread(back, len(joint_map.spine)), strict=True))
    # the head is the last of the chain, whether the figure has a joint for it or not
    shared = _spread(neck, len(joint_map.neck) + ("head" in joint_map.joints))
    wanted |= dict(zip(joint_map.neck, shared, strict=False))
    wanted.setdefault(joint_map.carrier(skeleton), wanted[joint_map.joints["hips"]])
    # a joint between forearm and hand, as CMU's wrists, takes the hand's twist
    hands = {joint_map.joints.get(sided(side, "Hand")) for side in LEFT_RIGHT} - {None}
    turned = frames_last((len(source), len(skeleton.joints), 3, 3))
    known = list(wanted)
    turned[:, known] = product(side_by_side(list(wanted.values()), len(source)), inverse(fitted.aligned[known]))
    for i, joint in enumerate(skeleton.joints):
        if i not in wanted:
            turned[:, i] = product(turned[:, joint.parent], still[i]) if i else still[0]
            hand = next((k for k in skeleton.children[i] if k in hands), None)
            if hand is not None:
                to_hand = product(inverse(turned[:, i]), turned[:, hand])
                turned[:, i] = product(turned[:, i], twist(to_hand, skeleton.offsets[hand]))
    return turned


FINGER_BENDS = (15.0, 25.0, 15.0)
"""Degrees by which the bones of a finger of a hand at rest bend, each against the one before."""

FINGER_SHARES = {"thumb": 0.5, "index": 0.8, "mid": 1.0, "ring": 1.15, "pinky|little": 1.3}
"""What the names of a finger's joints hold, and how far it is bent in a relaxed hand, times a finger's bend."""


def relaxed(skeleton: Skeleton, still: Array, joints: Mapping[str, int]) -> Array:
    """Local rotations (J, 3, 3) of a pose with its hands relaxed; those of hands without such fingers stay.

    joints: of the humanoid's bones; "leftHand" and "rightHand" count. Fingers bend a little, more from index to little
    finger, in the plane of themselves and the palm's normal, the thumb towards the other fingers, too; the side of the
    palm is told by where the knuckles of index and other fingers lie. What is bent at rest already counts.
    """
    turns, places = chained(skeleton, still[None].copy(), skeleton.offsets[None].copy())
    bent = still.copy()
    for side, sign in zip(LEFT_RIGHT, (-1.0, 1.0), strict=True):
        hand = joints.get(sided(side, "Hand"))
        fingers = {} if hand is None else _fingers(skeleton, hand)
        knuckles = {finger: places[0, chain[0]] for finger, chain in fingers.items() if finger != "thumb"}
        if hand is None or "index" not in knuckles or len(knuckles) < 2:
            continue
        along = unit(np.mean(list(knuckles.values()), axis=0) - places[0, hand])
        across = unit(knuckles[list(knuckles)[-1]] - knuckles["index"])
        palm = unit(sign * np.cross(along, across))
        for finger, chain in fingers.items():
            pointing = [unit(places[0, after] - places[0, joint]) for joint, after in pairwise(chain)]
            # the last joint, where it has no tip, points where the one before it does
            pointing = [*pointing, *pointing[-1:]] or [np.zeros(3)]
            thumb = finger == "thumb"
            start = pointing[0] if thumb else along
            axis = np.cross(start, palm + across if thumb else palm)
            # each bone bends against the one before, about the part of the axis that is across it
            for joint, before, bone, bend in zip(chain, [start, *pointing], pointing, FINGER_BENDS, strict=False):
                aside = unit(axis - (axis @ bone) * bone)
                now = np.arctan2(np.cross(before, bone) @ aside, before @ bone - (before @ aside) * (bone @ aside))
                turn = max(0.0, np.radians(bend) * FINGER_SHARES[finger] - float(now)) * aside
                bent[joint] = bent[joint] @ rotvec_to_rotmat(turns[0, joint].T @ turn)
    return bent


def _fingers(skeleton: Skeleton, hand: int) -> dict[str, list[int]]:
    """The fingers of a hand by the names of its joints: the joints of each, from the knuckle on."""
    fingers: dict[str, list[int]] = {}
    for joint in skeleton.subtree(skeleton.names[hand]):
        name = skeleton.names[joint].lower()
        finger = next((words for words in FINGER_SHARES if re.search(words, name)), None)
        within_palm = finger != "thumb" and re.search("meta|carpal|palm|inhand", name)
        if joint == hand or finger is None or within_palm:
            continue
        chain = fingers.setdefault(finger, [joint])
        if skeleton.joints[joint].parent == chain[-1]:
            chain.append(joint)
    return {finger: fingers[finger] for finger in FINGER_SHARES if finger in fingers}
