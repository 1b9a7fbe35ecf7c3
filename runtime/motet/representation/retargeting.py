"""Motions of other figures: brought onto a model's figure by way of the humanoid, and what follows them back."""

import logging
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from motet.errors import MotionError, listed
from motet.motion.humanoid import HUMANOID, Figure, from_humanoid, is_mmm, map_of, on_humanoid
from motet.motion.humanoid.figure_checks import leg_of, unit_of
from motet.motion.humanoid.rest_pose import aims_of
from motet.motion.humanoid.retarget import figure_like, poses_on
from motet.motion.kinematics import (
    AXES,
    continued,
    euler_of,
    local_of,
    local_rotations,
    local_translations,
    skeleton_of,
    with_channels,
)
from motet.motion.motion import Motion
from motet.motion.rotations import Array, inverse, product, rotmat_to_rotvec, rotvec_to_rotmat
from motet.motion.skeleton import Skeleton
from motet.representation.figure import other_bones

log = logging.getLogger(__name__)

AT_REST = 1e-6
"""Degrees of rounding."""

ROUNDED = 1e-5
"""Of a figure's height: what files round lengths to."""

CLEAN = 1.0
"""Degrees by which hips that were brought to the humanoid and back may be turned: more, and the figure's own world is
another, as where z is up."""


def foreign(motion: Motion, skeleton: Skeleton, joints: Iterable[str]) -> str | None:
    """Why a motion's angles do not mean the same on a skeleton, of which some joints count; None where they do."""
    if motion.skeleton is None:
        return "it has no skeleton of its own" if is_mmm(motion) else None
    own = motion.skeleton
    lacking = [name for name in joints if name not in own.places]
    if lacking:
        return f"the model's figure has joints that this motion lacks: {listed(lacking)}"
    return other_bones(own, skeleton)


def in_known_unit(motion: Motion, figure: Skeleton) -> Motion:
    """A motion whose file does not say its length unit in the one that its skeleton tells: that of a figure with the
    same bones, or else by the length of its legs; as it is where neither tells."""
    own = motion.skeleton
    if own is None or own.metres_per_unit is not None:
        return motion
    if figure.metres_per_unit is not None and _same_bones(own, figure):
        return motion.with_unit(figure.metres_per_unit)
    try:
        joint_map = map_of(motion)
        unit = unit_of(own, leg_of(own, joint_map, aims_of(own, joint_map), own.rest_positions))
    except MotionError:  # it is no human's
        return motion
    log.info("%s", unit.note)
    return motion if unit.metres is None else motion.with_unit(unit.metres)


def _same_bones(own: Skeleton, figure: Skeleton) -> bool:
    """Whether the joints that both skeletons have are as far from their parents, but for what a file rounds."""
    shared = [name for name in own.names[1:] if name in figure.places]
    apart = [own.offsets[own.places[name]] - figure.offsets[figure.places[name]] for name in shared]
    return bool(shared) and float(np.abs(apart).max()) < ROUNDED * figure.height


def brought(motion: Motion, pose: Motion, reason: str, measured: Figure | None = None) -> Motion:
    """A motion of another human figure on the figure of a pose.

    pose: one frame; joints of which the humanoid says nothing, such as thumbs, stand as in it.
    reason: why the motion is not taken as it is, for the MotionError where one of the figures is no human's.
    measured: the motion's figure, where it is known already.
    """
    skeleton = skeleton_of(pose)
    try:
        found = measured.brought(motion) if measured else on_humanoid(motion)
        if skeleton == HUMANOID:
            return found
        found = from_humanoid(found, skeleton)
        said = map_of(pose).names(skeleton).values()
    except MotionError as error:
        raise MotionError(f"{error}; and it cannot be taken as it is: {reason}") from error
    for name in frozenset(found.rotation_columns()).difference(skeleton.names[:1], *said):
        if np.abs(found.values[:, found.rotation_columns()[name]]).max(initial=0) > AT_REST:
            continue
        place = skeleton.index(name)
        angles = np.degrees(euler_of(local_rotations(pose, [place])[:, 0], skeleton.joints[place]))
        channels = tuple(f"{name}.r{axis}" for axis in AXES)
        found = with_channels(found, channels, np.repeat(angles, len(found), axis=0), ("deg",) * 3)
    return found


def carried_back(following: Motion, figure: Motion, own: Motion, measured: Figure | None = None) -> Motion | None:
    """What follows a motion that was brought onto a model's figure, on the motion's own skeleton and in its channels.

    following: on the model's figure, from the end of ``figure`` on; figure: ``own``, brought there; all at one frame
    rate. measured: the figure of ``own``, where it is known already. What comes back begins where ``own`` ends: each
    joint keeps the turn by which it differs there, and joints of which the humanoid says nothing stay as they are.
    None, which is logged, where the file has no skeleton or no channels for the path, or the figure's own world is
    another than the model's.
    """
    if own.skeleton is None:
        log.info("the prediction stays on the model's figure: the file has no skeleton")
        return None
    last, skeleton = own[-1:], own.skeleton
    both = np.concatenate([figure.values[-1:], following.select(figure.channels, figure.units).values])
    world, moved = poses_on(measured or figure_like(own), on_humanoid(replace(figure, values=both)))
    turned, then = local_of(skeleton, world), local_rotations(last)[0]
    turns = product(inverse(turned[0]), then)
    ((joint, path),) = moved.items()
    carrier = skeleton.names[joint]
    if not _clean(turns, skeleton, carrier) or not {f"{carrier}.t{axis}" for axis in "xyz"} <= set(own.channels):
        log.info("the prediction stays on the model's figure: the file's own turns or moves its hips in another way")
        return None
    places, rotations = local_translations(last)[0], product(turned[1:], turns)
    paths = {name: np.repeat(places[i : i + 1], len(following), axis=0) for i, name in enumerate(skeleton.names)}
    paths[carrier] = places[joint] + path[1:] - path[0]
    return continued(last, {name: rotations[:, i] for i, name in enumerate(skeleton.names)}, paths)


def carried_between(found: Motion, own: Motion, ends: Motion) -> Motion | None:
    """What lies between two frames, on the skeleton and in the channels of a motion that was brought onto the humanoid.

    found: (N + 2 frames) on the humanoid, at the motion's frame rate, both ends included; or already on the motion's
    own skeleton. own: the motion, as it was brought there. ends: the two frames of it. Given back are the N frames.
    Each joint keeps the turn by which it differs at the ends from what comes back, going from that of the one to that
    of the other; so joints of which the humanoid says nothing go straight from one end to the other, and so do other
    channels. None where the file has no skeleton, the motion's own world is another, or its channels do not say where
    it goes.
    """
    if own.skeleton is None:
        return None
    skeleton = own.skeleton
    back = found if found.skeleton == skeleton else from_humanoid(found, own)
    turned, then = local_rotations(back), local_rotations(ends)
    turns = product(inverse(turned[[0, -1]]), then)
    carrier = next(name.rpartition(".")[0] for name in back.channels if name.endswith(".tx"))
    if not {f"{carrier}.t{axis}" for axis in AXES} <= set(own.channels):
        return None
    if not all(_clean(turn, skeleton, carrier) for turn in turns):
        return None
    part = np.linspace(0, 1, len(found))[:, None]
    between = rotmat_to_rotvec(product(inverse(turns[:1]), turns[1:])) * part[..., None]
    rotations = product(turned, product(np.repeat(turns[:1], len(found), axis=0), rotvec_to_rotmat(between)))
    moved = local_translations(back)
    off = local_translations(ends) - moved[[0, -1]]
    moved = moved + off[:1] + part[..., None] * (off[1:] - off[:1])
    names = {name: joint for joint, name in enumerate(skeleton.names)}
    whole = continued(ends[:1], *({n: all_[:, i] for n, i in names.items()} for all_ in (rotations, moved)))
    others = [column for column, name in enumerate(own.channels) if name.rpartition(".")[0] not in names]
    values = np.array(whole.values)
    values[:, others] = (ends.values[:1] + part * (ends.values[1:] - ends.values[:1]))[:, others]
    return replace(whole, values=values)[1:-1]


def _clean(turns: Array, skeleton: Skeleton, carrier: str) -> bool:
    """Whether hips and all above them come back as they were."""
    joint, above = skeleton.index(carrier), []
    while joint >= 0:
        above.append(joint)
        joint = skeleton.joints[joint].parent
    return bool((np.degrees(np.linalg.norm(rotmat_to_rotvec(turns[above]), axis=-1)) < CLEAN).all())
