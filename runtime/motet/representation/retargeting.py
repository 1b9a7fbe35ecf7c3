"""Motions of other figures: retargeted to a model's figure by way of the humanoid, and their continuations back."""

import logging
from collections.abc import Iterable
from dataclasses import replace
from functools import lru_cache

import numpy as np

from motet.errors import MotionError, UnitError, listed
from motet.figures.humanoid import (
    HUMANOID,
    Figure,
    from_humanoid,
    is_mmm,
    map_of,
    on_humanoid,
    with_unit_by_legs,
)
from motet.motion.kinematics import (
    by_name,
    channels_of,
    continued,
    euler_of,
    eulers_of,
    has_channels,
    local_rotations,
    local_translations,
    skeleton_of,
    with_channels,
)
from motet.motion.motion import TURN, Motion
from motet.motion.rotations import (
    Array,
    inverse,
    product,
    rotmat_to_rotvec,
    rotvec_to_rotmat,
)
from motet.motion.skeleton import Names, Skeleton

log = logging.getLogger(__name__)


FARTHEST_BONES = 45.0
"""Degrees from which on the same angles mean different poses: the bones of 16 of CMU's subjects, measured individually,
lie up to 24 degrees apart."""

SHORTEST_BONE = 1e-6
"""Length, in the skeleton's unit, below which a bone points nowhere."""


def foreign(motion: Motion, skeleton: Skeleton, joints: Iterable[str]) -> str | None:
    """Why a motion's angles do not mean the same on a skeleton, whose listed joints count; None where they do."""
    if motion.skeleton is None:
        return "it has no skeleton of its own" if is_mmm(motion) else None
    lacking = [name for name in joints if name not in motion.skeleton.places]
    if lacking:
        return f"this motion lacks joints of the model's figure: {listed(lacking)}"
    return _differences(motion.skeleton, skeleton)[0]


@lru_cache(maxsize=256)
def _differences(skeleton: Skeleton, other: Skeleton) -> tuple[str | None, Names]:
    """Why angles mean other poses in another skeleton: a bone points elsewhere; None if they do not. And names of the
    joints of both that turn about other axes."""
    turned = []
    for name in skeleton.names:
        if name not in other.places:
            continue
        angle = _bone_angle(skeleton, other, name)
        if angle > FARTHEST_BONES:
            reason = (
                f"the bone to {name!r} points {angle:.0f} degrees away from its direction in the model's rest "
                "pose: the same angles mean different poses"
            )
            return reason, ()
        joint = skeleton.joints[skeleton.places[name]]
        other_joint = other.joints[other.places[name]]
        # entries of two frames that are the same axes, written differently, differ by less
        same_axes = np.allclose(joint.frame, other_joint.frame, rtol=0, atol=1e-3)
        if joint.order != other_joint.order or not same_axes:
            turned.append(name)
    return None, tuple(turned)


def _bone_angle(skeleton: Skeleton, other: Skeleton, name: str) -> float:
    """Degrees between the bone to a joint at rest and the same of another skeleton; 0 for bones without length."""
    parent_index = other.joints[other.places[name]].parent
    parent = other.names[parent_index]
    if parent_index < 0 or parent not in skeleton.places:
        return 0.0
    bone = _rest_bone(skeleton, name, parent)
    other_bone = _rest_bone(other, name, parent)
    length = float(np.linalg.norm(bone))
    other_length = float(np.linalg.norm(other_bone))
    if min(length, other_length) < SHORTEST_BONE:
        return 0.0
    cosine = bone @ other_bone / max(length * other_length, 1e-12)
    return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))


def _rest_bone(skeleton: Skeleton, name: str, parent: str) -> Array:
    """The vector (3,) from one joint to another at rest."""
    places = skeleton.places
    return np.asarray(skeleton.rest_positions[places[name]] - skeleton.rest_positions[places[parent]])


def in_known_unit(motion: Motion, figure: Skeleton) -> Motion:
    """A motion whose file does not state its length unit, with the unit of a figure with the same bones, or else by the
    length of its legs; as it is where neither helps."""
    skeleton = motion.skeleton
    if skeleton is None or skeleton.metres_per_unit is not None:
        return motion
    # the same bones are in the same unit
    shared = [name for name in skeleton.names[1:] if name in figure.places]
    if figure.metres_per_unit is not None and shared:
        offsets = np.array([skeleton.offsets[skeleton.places[name]] for name in shared])
        figure_offsets = np.array([figure.offsets[figure.places[name]] for name in shared])
        if float(np.abs(offsets - figure_offsets).max()) < 1e-5 * figure.height:  # files round lengths
            return motion.with_unit(figure.metres_per_unit)
    # else the unit that gives the legs a human length
    return with_unit_by_legs(motion)


def to_model_figure(motion: Motion, pose: Motion, reason: str, figure: Figure | None = None) -> Motion:
    """A motion of another human figure on the model's, which is that of a pose.

    pose: one frame; joints that the humanoid lacks, such as thumbs, stand as in it.
    reason: why the motion is not taken as it is, for the MotionError where one of the figures is not human.
    figure: the motion's, where it is measured already.
    """
    skeleton = skeleton_of(pose)
    try:
        on_model = figure.to_humanoid(motion) if figure else on_humanoid(motion)
        if skeleton == HUMANOID:
            return on_model
        on_model = from_humanoid(on_model, skeleton)
        bones = map_of(pose).names(skeleton).values()
    except UnitError:  # the figure is human
        raise
    except MotionError as error:
        raise MotionError(f"{error}; and it cannot be used as it is: {reason}") from error
    # joints that the humanoid says nothing of stay at rest on the way, but for rounding
    for name in frozenset(on_model.rotation_columns()).difference(skeleton.names[:1], *bones):
        degrees = on_model.values[:, on_model.rotation_columns()[name]]
        if np.abs(degrees).max(initial=0) <= 1e-6:
            angles = _angles_of(pose, name)
            held = np.repeat(angles, len(on_model), axis=0)
            on_model = with_channels(on_model, channels_of(name, "r"), held, ("deg",) * 3)
    return on_model


def _angles_of(pose: Motion, name: str) -> Array:
    """The angles (1, 3) in degrees of a joint in a pose of one frame."""
    skeleton = skeleton_of(pose)
    place = skeleton.index(name)
    return np.degrees(euler_of(local_rotations(pose, [place])[:, 0], skeleton.joints[place]))


def from_model_figure(generated: Motion, motion: Motion, ends: Motion, figure: Figure | None = None) -> Motion | None:
    """The frames that follow a frame of a motion, or lie between two, on the motion's own skeleton and in its channels.

    generated: (1 + N or 1 + N + 1 frames) on a human figure, such as the model's, or on the motion's own, at the
    motion's frame rate; with the frame before, and the one after where there is one. ends: these one or two frames of
    the motion. figure: the motion's, where it is measured already. Returns the N frames.
    Each joint keeps the turn by which it differs at the ends from the generated frames, from that of the first to that
    of the last; so joints that the humanoid lacks stay as they are, or go straight from one end to the other, and so do
    other channels. None, which is logged, where the file has no skeleton or no channels for the path, or the motion's
    own world is another than the model's.
    """
    if motion.skeleton is None:
        log.info("the new frames use the model's figure: the file has no skeleton")
        return None
    back = generated
    if generated.skeleton != motion.skeleton:
        back = from_humanoid(on_humanoid(generated), figure or motion)

    # what each joint's rotation lacks at the ends
    rotations = local_rotations(back)
    turns = product(inverse(_ends_of(rotations, ends)), local_rotations(ends))
    if not _same_world(back, motion, turns):
        log.info("the new frames use the model's figure: the file's own turns or moves its hips in another way")
        return None

    # is added to all frames, from one end to the other, and so is what its translation lacks
    part = np.linspace(0, 1, len(generated))[:, None]
    followed = continued(
        ends[:1],
        by_name(motion.skeleton, product(rotations, _turns_between(turns, part))),
        by_name(motion.skeleton, _translations_between(back, ends, part)),
    )
    return _with_others_between(followed, ends, part)[1 : len(generated) + 1 - len(ends)]


def _ends_of(values: Array, ends: Motion) -> Array:
    """The first, or the first and the last of values (T, ...), one for each end."""
    return values[[0, -1][: len(ends)]]


def _translations_between(back: Motion, ends: Motion, part: Array) -> Array:
    """Translations (T, J, 3) of a motion moved to those at the ends, by parts (T, 1) of the way between them."""
    translations = local_translations(back)
    offsets = local_translations(ends) - _ends_of(translations, ends)
    return translations + offsets[:1] + part[..., None] * (offsets[-1:] - offsets[:1])


def _turns_between(turns: Array, part: Array) -> Array:
    """Turns (T, J, 3, 3) from the first to the last of turns (E, J, 3, 3), the shortest way, by parts (T, 1) of it."""
    between = rotmat_to_rotvec(product(inverse(turns[:1]), turns[-1:])) * part[..., None]
    return product(np.repeat(turns[:1], len(part), axis=0), rotvec_to_rotmat(between))


def _same_world(back: Motion, motion: Motion, turns: Array) -> bool:
    """Whether a motion has channels for its path, and its hips and all above them turn as those of the frames that come
    back: by turns (E, J, 3, 3) of less than a degree, as where y is up in both worlds."""
    skeleton = skeleton_of(motion)
    carrier = next(name.rpartition(".")[0] for name in back.channels if name.endswith(".tx"))
    above = skeleton.ancestors(skeleton.index(carrier))
    angles = np.degrees(np.linalg.norm(rotmat_to_rotvec(turns[:, above]), axis=-1))
    return bool((angles < 1.0).all()) and has_channels(motion, carrier, "t")


def _with_others_between(motion: Motion, ends: Motion, part: Array) -> Motion:
    """The motion with channels of no joint going straight from one end to the other, by parts (T, 1) of the way."""
    joints = skeleton_of(motion).places
    others = [column for column, name in enumerate(motion.channels) if name.rpartition(".")[0] not in joints]
    values = np.array(motion.values)
    values[:, others] = (ends.values[:1] + part * (ends.values[-1:] - ends.values[:1]))[:, others]
    return replace(motion, values=values)


def in_joints_of(motion: Motion, skeleton: Skeleton | None) -> Motion:
    """The motion with Euler angles in the order and axes that joints of the same name have in another skeleton.

    Joints that have them already keep their angles to the bit; without a skeleton of its own or another the motion
    comes back as it is. MotionError where a bone points elsewhere at rest.
    """
    if motion.skeleton is None or skeleton is None or motion.skeleton == skeleton:
        return motion
    reason, differing = _differences(motion.skeleton, skeleton)
    if reason:
        raise MotionError(reason)
    names = [name for name in differing if name in motion.rotation_columns()]
    return _converted(motion, skeleton, names) if names else motion


def _converted(motion: Motion, skeleton: Skeleton, names: list[str]) -> Motion:
    """The motion with the named joints in the order and axes of another skeleton's."""
    # units of angles; the last joint comes first, as its channels come to stand first
    units: dict[str, str] = {}
    for name in reversed(names):
        unit = motion.units[motion.rotation_columns()[name][0]]
        units |= dict.fromkeys(channels_of(name, "r"), unit)

    # the same rotations in the other order and axes
    figure = _with_axes_of(skeleton_of(motion), skeleton, names)
    places = [figure.places[name] for name in reversed(names)]
    angles = eulers_of(local_rotations(motion, places), [figure.joints[place] for place in places])
    turns = [TURN[unit] for unit in units.values()]
    values = angles.reshape(len(motion), len(units)) * turns / (2 * np.pi)
    return replace(
        with_channels(motion, tuple(units), values, tuple(units.values())),
        skeleton=figure,
    )


def _with_axes_of(skeleton: Skeleton, other: Skeleton, names: list[str]) -> Skeleton:
    """A skeleton whose named joints have the order and axes of another skeleton's."""
    joints = list(skeleton.joints)
    for name in names:
        place = skeleton.places[name]
        like = other.joints[other.places[name]]
        joints[place] = replace(joints[place], order=like.order, axis=like.axis)
    return replace(skeleton, joints=tuple(joints))
