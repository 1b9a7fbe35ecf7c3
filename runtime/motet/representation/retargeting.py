"""Motions of other figures: retargeted to a model's figure by way of the humanoid, and their continuations back."""

import logging
from collections.abc import Iterable
from dataclasses import replace
from functools import lru_cache

import numpy as np

from motet.errors import MotionError, UnitError, listed
from motet.figures.humanoid import HUMANOID, Figure, from_humanoid, is_mmm, map_of, on_humanoid, unit_by_legs
from motet.motion.kinematics import (
    AXES,
    continued,
    euler_of,
    eulers_of,
    local_rotations,
    local_translations,
    skeleton_of,
    with_channels,
)
from motet.motion.motion import TURN, Motion
from motet.motion.rotations import inverse, product, rotmat_to_rotvec, rotvec_to_rotmat
from motet.motion.skeleton import Skeleton

log = logging.getLogger(__name__)


def foreign(motion: Motion, skeleton: Skeleton, joints: Iterable[str]) -> str | None:
    """Why a motion's angles do not mean the same on a skeleton, of which some joints count; None where they do."""
    if motion.skeleton is None:
        return "it has no skeleton of its own" if is_mmm(motion) else None
    own = motion.skeleton
    lacking = [name for name in joints if name not in own.places]
    if lacking:
        return f"this motion lacks joints of the model's figure: {listed(lacking)}"
    return _apart(own, skeleton)[0]


@lru_cache(maxsize=256)
def _apart(own: Skeleton, other: Skeleton) -> tuple[str | None, tuple[str, ...]]:
    """Why angles mean other poses in another skeleton: a bone points elsewhere; None if they do not. And names of the
    joints of both that turn about other axes."""
    turned = []
    for name in own.names:
        if name not in other.places:
            continue
        one = own.joints[own.places[name]]
        two = other.joints[other.places[name]]
        if two.parent >= 0 and (parent := other.names[two.parent]) in own.places:
            ends = [(at.rest_positions[at.places[name]], at.rest_positions[at.places[parent]]) for at in (own, other)]
            bones = [end - start for end, start in ends]
            lengths = [float(np.linalg.norm(bone)) for bone in bones]
            cosine = bones[0] @ bones[1] / max(lengths[0] * lengths[1], 1e-12)
            apart = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
            # the bones of 16 of CMU's subjects, measured one by one, lie up to 24 degrees apart
            if min(lengths) >= 1e-6 and apart > 45:
                reason = (
                    f"the bone to {name!r} points {apart:.0f} degrees away from its direction in the model's rest "
                    "pose: the same angles mean different poses"
                )
                return reason, ()
        # entries of two frames that are the same axes, written differently, differ by less
        if one.order != two.order or not np.allclose(one.frame, two.frame, rtol=0, atol=1e-3):
            turned.append(name)
    return None, tuple(turned)


def in_known_unit(motion: Motion, figure: Skeleton) -> Motion:
    """A motion whose file does not say its length unit in the one that its skeleton tells: that of a figure with the
    same bones, or else by the length of its legs; as it is where neither tells."""
    own = motion.skeleton
    if own is None or own.metres_per_unit is not None:
        return motion
    shared = [name for name in own.names[1:] if name in figure.places]
    if figure.metres_per_unit is not None and shared:
        apart = [own.offsets[own.places[name]] - figure.offsets[figure.places[name]] for name in shared]
        if float(np.abs(apart).max()) < 1e-5 * figure.height:  # files round lengths
            return motion.with_unit(figure.metres_per_unit)
    try:
        unit = unit_by_legs(motion)
    except MotionError:  # it is no human's
        return motion
    log.info("%s", unit.note)
    return motion if unit.metres is None else motion.with_unit(unit.metres)


def to_model_figure(motion: Motion, pose: Motion, reason: str, figure: Figure | None = None) -> Motion:
    """A motion of another human figure on the model's, which is that of a pose.

    pose: one frame; joints of which the humanoid says nothing, such as thumbs, stand as in it.
    reason: why the motion is not taken as it is, for the MotionError where one of the figures is no human's.
    figure: the motion's, where it is measured already.
    """
    skeleton = skeleton_of(pose)
    try:
        found = figure.to_humanoid(motion) if figure else on_humanoid(motion)
        if skeleton == HUMANOID:
            return found
        found = from_humanoid(found, skeleton)
        said = map_of(pose).names(skeleton).values()
    except UnitError:  # it is a human's
        raise
    except MotionError as error:
        raise MotionError(f"{error}; and it cannot be used as it is: {reason}") from error
    for name in frozenset(found.rotation_columns()).difference(skeleton.names[:1], *said):
        if np.abs(found.values[:, found.rotation_columns()[name]]).max(initial=0) > 1e-6:  # degrees, of rounding
            continue
        place = skeleton.index(name)
        angles = np.degrees(euler_of(local_rotations(pose, [place])[:, 0], skeleton.joints[place]))
        channels = tuple(f"{name}.r{axis}" for axis in AXES)
        found = with_channels(found, channels, np.repeat(angles, len(found), axis=0), ("deg",) * 3)
    return found


def from_model_figure(found: Motion, own: Motion, ends: Motion, figure: Figure | None = None) -> Motion | None:
    """What follows a frame of a motion, or lies between two, on the motion's own skeleton and in its channels.

    found: (1 + N or 1 + N + 1 frames) on a human figure, such as the model's, or on the motion's own, at the motion's
    frame rate; with the frame before, and the one after where there is one. own: the motion. ends: these one or two
    frames of it. figure: the motion's, where it is measured already. Given back are the N frames.
    Each joint keeps the turn by which it differs at the ends from what comes back, from that of the one to that of the
    other; so joints of which the humanoid says nothing stay as they are, or go straight from one end to the other, and
    so do other channels. None, which is logged, where the file has no skeleton or no channels for the path, or the
    motion's own world is another than the model's.
    """
    if own.skeleton is None:
        log.info("the new frames use the model's figure: the file has no skeleton")
        return None
    skeleton = own.skeleton
    at = [0, -1][: len(ends)]
    back = found if found.skeleton == skeleton else from_humanoid(on_humanoid(found), figure or own)
    turned = local_rotations(back)
    moved = local_translations(back)
    turns = product(inverse(turned[at]), local_rotations(ends))
    off = local_translations(ends) - moved[at]
    carrier = next(name.rpartition(".")[0] for name in back.channels if name.endswith(".tx"))
    # the hips and all above them
    joint = skeleton.index(carrier)
    above = []
    while joint >= 0:
        above.append(joint)
        joint = skeleton.joints[joint].parent
    # they come back within a degree where y is up in both worlds
    alike = (np.degrees(np.linalg.norm(rotmat_to_rotvec(turns[:, above]), axis=-1)) < 1.0).all()
    if not {f"{carrier}.t{axis}" for axis in AXES} <= set(own.channels) or not alike:
        log.info("the new frames use the model's figure: the file's own turns or moves its hips in another way")
        return None
    part = np.linspace(0, 1, len(found))[:, None]
    between = rotmat_to_rotvec(product(inverse(turns[:1]), turns[-1:])) * part[..., None]
    rotations = product(turned, product(np.repeat(turns[:1], len(found), axis=0), rotvec_to_rotmat(between)))
    moved = moved + off[:1] + part[..., None] * (off[-1:] - off[:1])
    by_name = ({name: part[:, joint] for joint, name in enumerate(skeleton.names)} for part in (rotations, moved))
    whole = continued(ends[:1], *by_name)
    others = [column for column, name in enumerate(own.channels) if name.rpartition(".")[0] not in skeleton.places]
    values = np.array(whole.values)
    values[:, others] = (ends.values[:1] + part * (ends.values[-1:] - ends.values[:1]))[:, others]
    return replace(whole, values=values)[1 : len(found) + 1 - len(ends)]


def in_joints_of(motion: Motion, skeleton: Skeleton | None) -> Motion:
    """The motion with Euler angles in the order and axes that joints of the same name have in another skeleton.

    Joints that have them already keep their angles to the bit; without a skeleton of its own or another the motion
    comes back as it is. MotionError where a bone points elsewhere at rest.
    """
    if motion.skeleton is None or skeleton is None or motion.skeleton == skeleton:
        return motion
    reason, turned = _apart(motion.skeleton, skeleton)
    if reason:
        raise MotionError(reason)
    own = motion.skeleton
    columns = motion.rotation_columns()
    turned = tuple(name for name in turned if name in columns)
    if not turned:
        return motion
    places = [own.places[name] for name in turned]
    joints = list(own.joints)
    wanted = [skeleton.joints[skeleton.places[name]] for name in turned]
    units = [motion.units[columns[name][0]] for name in turned]
    turns = np.array([TURN[unit] for unit in units])[:, None]
    angles = eulers_of(local_rotations(motion, places), wanted) * turns / (2 * np.pi)
    for place, like in zip(places, wanted, strict=True):
        joints[place] = replace(own.joints[place], order=like.order, axis=like.axis)
    # a joint's new channels stand before all others, as where the joints are taken one by one
    names = tuple(f"{name}.r{axis}" for name in turned[::-1] for axis in AXES)
    values = angles[:, ::-1].reshape(len(motion), len(names))
    found = with_channels(motion, names, values, tuple(np.repeat(units[::-1], 3).tolist()))
    return replace(found, skeleton=replace(own, joints=tuple(joints)))
