"""Motions of any human figure onto the humanoid, and the humanoid's onto any figure.

A bone of the humanoid has the rotation of its joint in the world, times a constant that makes up for the rest pose
(:mod:`motet.motion.humanoid.measure`). Back and neck share their turns out among their joints; what a figure lacks
stays at rest. Paths are scaled by the lengths of the legs and laid so that the feet are on the ground.
"""

import logging
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from motet.errors import MotionError
from motet.motion.humanoid import bones
from motet.motion.humanoid.bones import HUMANOID, LEFT_RIGHT, NECK, PARENTS, SPINE, leg_length, sided
from motet.motion.humanoid.fingers import relaxed
from motet.motion.humanoid.joint_map import BY_THE_TREE, JointMap
from motet.motion.humanoid.joint_tree import map_of
from motet.motion.humanoid.measure import Fitted, check_frames, fit, height_of, unit_of, upright
from motet.motion.humanoid.mmm_figure import is_mmm, with_figure
from motet.motion.humanoid.rest_pose import middle, to_left
from motet.motion.kinematics import (
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
        return Figure(fitted, example[:1], upright(fitted, transforms[1]).turn)

    def to_humanoid(self, motion: Motion) -> Motion:
        """Another motion of the skeleton on the humanoid."""
        motion = with_figure(motion) if is_mmm(motion) else motion
        return self._grounded(*self._on_humanoid(*global_transforms(motion)), motion.fps)[0]

    def _on_humanoid(self, rotations: Array, places: Array) -> tuple[Array, Array]:
        """Rotations (T, J, 3, 3) in the world and positions (T, J, 3) of the humanoid, over no ground yet."""
        turned = product(self.turn, _humanoid_rotations(rotations, places, self.fitted))
        legs = middle(places, self.fitted.joint_map, "UpperLeg") @ self.turn.T * (leg_length() / self.fitted.leg)
        found = places_of(HUMANOID, turned)
        return turned, found + (legs - found[:, HIPS].mean(axis=1))[:, None]

    def _grounded(self, turned: Array, places: Array, fps: float) -> tuple[Motion, "Figure"]:
        """The motion of rotations and positions of the humanoid laid on the ground, and the figure that knows it."""
        ground = bones.ground_under(bones.sole_points(turned, places)) if self.ground is None else self.ground
        root = places[:, 0] - (0.0, ground, 0.0)
        return motion_of(HUMANOID, turned, {0: root}, fps), replace(self, ground=ground)

    @cached_property
    def posture(self) -> tuple[Skeleton, Array]:
        """The skeleton with its unit, where that is known, and local rotations (J, 3, 3) of joints that are no bones:
        at rest, or as in the first frame, but for fingers, which bend as in a relaxed hand."""
        skeleton, still = _still(self.first, self.fitted)
        if skeleton.metres_per_unit is None:
            skeleton = replace(skeleton, metres_per_unit=unit_of(skeleton, self.fitted.leg).metres)
        return skeleton, relaxed(skeleton, still, self.fitted.joint_map.joints)


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
    check_frames(places, joint_map, fitted.aims, _hinges(rotations, fitted))
    unit, up = unit_of(skeleton, fitted.leg), upright(fitted, places)
    figure = Figure(fitted, motion[:1], up.turn)
    found, figure = figure._grounded(*figure._on_humanoid(rotations, places), motion.fps)
    notes = [note for note in (*fitted.notes, unit.note, up.note) if note]
    if joint_map.joints["hips"]:
        notes.append(f"the joint {skeleton.names[0]!r} above the hips is folded in")
    return Humanoid(
        found,
        joint_map.names(skeleton),
        joint_map.convention,
        round(joint_map.confidence * fitted.confidence, 2),
        unit.metres,
        None if unit.metres is None else fitted.leg * unit.metres,
        None if unit.metres is None else height_of(skeleton, joint_map, fitted.leg) * unit.metres,
        tuple(notes),
        figure,
    )


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


def _hinges(rotations: Array, fitted: Fitted) -> dict[str, Array]:
    """Of each side the axis (T, 3) about which the knee bends, to the left: that of the thigh."""
    thighs = {side: fitted.joint_map.joints[sided(side, "UpperLeg")] for side in LEFT_RIGHT}
    return {side: rotated(rotations[:, i], fitted.aligned[i][:, 0]) for side, i in thighs.items()}


def _humanoid_rotations(rotations: Array, places: Array, fitted: Fitted) -> Array:
    """Rotations in the world (T, J, 3, 3) of the humanoid's joints, from those (T, J, 3, 3) and the positions
    (T, J, 3) of the figure's."""
    joint_map, own = fitted.joint_map, product(rotations, fitted.aligned)
    turned = {bone: own[:, joint] for bone, joint in joint_map.joints.items()}
    if not fitted.pelvis:
        to_legs = swing(turned["hips"][:, :, 0], to_left(places, joint_map, "UpperLeg"))
        turned["hips"] = product(to_legs, turned["hips"])
    spine, neck = ([own[:, joint] for joint in chain] for chain in (joint_map.spine, joint_map.neck))
    neck += [turned["head"]] if "head" in turned else []
    turned |= _shared_out([turned["hips"], *spine], SPINE)
    turned |= _shared_out([spine[-1], *neck], NECK) if neck else {}
    for bone, parent in PARENTS.items():
        turned.setdefault(bone, turned[parent])
    return side_by_side([turned[name.removesuffix(END_SUFFIX)] for name in HUMANOID.names], len(rotations))


def _shared_out(chain: list[Array], names: tuple[str, ...]) -> dict[str, Array]:
    shared = spread(side_by_side(chain, len(chain[0])), len(names))
    return {name: shared[:, i] for i, name in enumerate(names)}


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
    skin: joint -> points (P, 3) of the figure's mesh, from the joint where every angle is 0; those of the feet are the
        soles that stand on the ground. ahead: the motion's z becomes the way that the figure faces at rest.
    MotionError for a motion that is not the humanoid's, or a skeleton that is no human's.
    """
    if motion.skeleton != HUMANOID:
        raise MotionError("this motion is not on the humanoid: convert it with to_humanoid first")
    figure = like if isinstance(like, Figure) else Figure.of(like, joint_map)
    fitted, (skeleton, still) = figure.fitted, figure.posture
    source, places = global_transforms(motion)
    if ahead:
        front = _front(fitted)
        source, places = product(front, source), rotated(front, places)
    turned = _figure_rotations(source, fitted, skeleton, still)
    moved = _moved(fitted, skeleton, (source, places), turned, skin or {})
    return motion_of(skeleton, turned, {fitted.joint_map.carrier(skeleton): moved}, motion.fps)


def _moved(
    fitted: Fitted, skeleton: Skeleton, source: tuple[Array, Array], turned: Array, skin: Mapping[int, Array]
) -> Array:
    """Translations (T, 3) of a figure's carrier in its parent's frame, from rotations and positions of the humanoid's
    joints and its own rotations (T, J, 3, 3): its path is scaled, its feet are as high over the ground."""
    scale, joint_map = fitted.leg / leg_length(), fitted.joint_map
    figure = places_of(skeleton, turned)
    moved: Array = source[1][:, HIPS].mean(axis=1) * scale - middle(figure, joint_map, "UpperLeg")
    soles = _soles(fitted, skeleton, source[0], (turned, figure + moved[:, None]), skin)
    moved[:, 1] += scale * bones.ground_under(bones.sole_points(*source)) - bones.ground_under(soles)
    carrier = joint_map.carrier(skeleton)
    if carrier:
        above = skeleton.joints[carrier].parent
        from_above = figure[:, carrier] + moved - figure[:, above] - skeleton.offsets[0]
        moved = rotated(inverse(turned[:, above]), from_above)
    return moved


def _front(fitted: Fitted) -> Array:
    """The turn (3, 3) about y from z to where a figure faces at rest; none where it faces up or down."""
    x, _, z = fitted.aligned[fitted.joint_map.joints["hips"]][:, 2]
    return axis_to_rotmat("y", angle_of(x, z)) if np.hypot(x, z) > 0.5 else np.eye(3)


def _soles(
    fitted: Fitted, skeleton: Skeleton, source: Array, figure: tuple[Array, Array], skin: Mapping[int, Array]
) -> Array:
    """Points (T, P, 3) of the soles of a figure, from its rotations and positions: of its mesh, else as they are
    measured on the humanoid, whose rotations are ``source``."""
    turned, places = figure
    feet = [fitted.joint_map.joints[sided(side, "Foot")] for side in LEFT_RIGHT]
    own = [joint for foot in feet for joint in skeleton.subtree(skeleton.names[foot]) if joint in skin]
    if own:
        return np.concatenate(
            [places[:, joint, None] + rotated(turned[:, joint, None], skin[joint]) for joint in own], 1
        )
    bones = {bone: source[:, HUMANOID.index(bone)] for bone in fitted.heights}
    return fitted.soles(bones, places)


def _still(example: Motion, fitted: Fitted) -> tuple[Skeleton, Array]:
    """The skeleton and local rotations (J, 3, 3) of joints that are no bones: at rest, or as in the first frame."""
    skeleton = skeleton_of(example)
    if fitted.at_rest:
        return skeleton, np.tile(np.eye(3), (len(skeleton.joints), 1, 1))
    first = example[:1]
    offsets = local_translations(first)[0].tolist()
    offsets[0] = skeleton.joints[0].offset
    joints = [replace(joint, offset=tuple(offset)) for joint, offset in zip(skeleton.joints, offsets, strict=True)]
    return Skeleton(tuple(joints), skeleton.metres_per_unit), local_rotations(first)[0]


def _figure_rotations(source: Array, fitted: Fitted, skeleton: Skeleton, still: Array) -> Array:
    """Rotations in the world (T, J, 3, 3) of a figure's joints, from those of the humanoid's."""
    joint_map = fitted.joint_map
    wanted = {joint: source[:, HUMANOID.index(bone)] for bone, joint in joint_map.joints.items()}
    back = [source[:, HUMANOID.index(bone)] for bone in ("hips", *SPINE)]
    wanted |= dict(zip(joint_map.spine, _chain(back, len(joint_map.spine)), strict=True))
    neck = [source[:, HUMANOID.index(bone)] for bone in (SPINE[-1], *NECK)]
    # the head is the last of the chain, whether the figure has a joint for it or not
    shared = _chain(neck, len(joint_map.neck) + ("head" in joint_map.joints))
    wanted |= dict(zip(joint_map.neck, shared, strict=False))
    wanted.setdefault(joint_map.carrier(skeleton), wanted[joint_map.joints["hips"]])
    # a joint between forearm and hand, as CMU's wrists, takes the hand's twist
    hands = {joint_map.joints.get(sided(side, "Hand")) for side in LEFT_RIGHT} - {None}
    turned = frames_last((len(source), len(skeleton.joints), 3, 3))
    bones = list(wanted)
    turned[:, bones] = product(side_by_side(list(wanted.values()), len(source)), inverse(fitted.aligned[bones]))
    for i, joint in enumerate(skeleton.joints):
        if i not in wanted:
            turned[:, i] = product(turned[:, joint.parent], still[i]) if i else still[0]
            hand = next((k for k in skeleton.children[i] if k in hands), None)
            if hand is not None:
                to_hand = product(inverse(turned[:, i]), turned[:, hand])
                turned[:, i] = product(turned[:, i], twist(to_hand, skeleton.offsets[hand]))
    return turned


def _chain(chain: list[Array], count: int) -> list[Array]:
    return list(np.moveaxis(spread(side_by_side(chain, len(chain[0])), count), 1, 0)) if count else []


def spread(chain: Array, count: int) -> Array:
    """World rotations (T, count, 3, 3) of another chain with the same ends, from those of a chain (T, N + 1, 3, 3).

    The first rotation is that of the joint that carries the chain and is not among the result; the last of both
    chains is the same. Between joints rotations go the shortest way, by how far up the chain they are.
    """
    last = chain.shape[1] - 1
    places = np.arange(1, count + 1) * last / count
    below = np.ceil(places).astype(int) - 1
    part = places - below
    shared: Array = chain[:, below + 1]
    inner = np.flatnonzero(part < 1)
    if len(inner):
        lower = chain[:, below[inner]]
        turn = rotmat_to_rotvec(product(inverse(lower), shared[:, inner]))
        shared[:, inner] = product(lower, rotvec_to_rotmat(turn * part[inner, None]))
    return shared
