"""What makers of recordings share and people do not: markers that let every head look down, and collar bones droop.

A person's recordings are mended by the same rotations throughout, so that nods, bows and shrugs stay what they are. Of
those who are never seen walking nobody knows how they hold their heads; they are taken for the median of the others.
"""

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import replace
from tempfile import TemporaryFile

import numpy as np

from motet.figures.humanoid import HUMANOID
from motet.motion.motion import Motion
from motet.motion.rotations import Array, axis_to_rotmat, product, rotated
from motet.representation.root_sixd import SIXD_KINDS, joint_rotations, rotmat_to_sixd
from motet.steering.recorded import COLLARS, sloping, with_turned_collars
from motet_train.data.store import Store

HEAD_PITCH = 4.0
"""Degrees below the horizontal at which people who walk look; heads of well-kept recordings have 2 to 4."""

MOST_PITCH = 30.0
"""Degrees that a head is turned by at most."""

WALKS_AT = 0.5
"""Speed of the root, in m/s, from which on a person goes somewhere."""

UPRIGHT = 30.0
"""Degrees of the chest from the vertical up to which a person is upright."""

SHORTEST_WALK = 2.0
"""Seconds of walking that show how a person holds the head."""

HANGING = -0.7
"""Height of the tip of an arm of length 1, seen from the chest, below which it hangs."""


def without_habits(store: Store) -> Store:
    """A store in ``root_sixd`` with level heads and even collar bones; as it is where its figure is no humanoid.

    Its frames lie in a temporary file, which is gone with the store.
    """
    if any(skeleton != HUMANOID for skeleton in store.skeletons):
        return store
    pitches = _pitches(store)
    collars = _collars(store)
    with TemporaryFile() as file:
        frames = np.memmap(file, np.float32, "w+", shape=store.frames.shape)
    for index, record in enumerate(store.records):
        for offset, (start, stop) in enumerate(record.spans):
            features = with_turned_collars(store.motion(index, offset), collars[record.subject])
            frames[start:stop] = _with_raised_head(features, pitches[record.subject]).values
    return replace(store, frames=frames)


def _pitches(store: Store) -> dict[str, float]:
    """Degrees by which each person's head is to be raised."""
    walks = defaultdict[str, list[Array]](list)
    for index, record in enumerate(store.records):
        walks[record.subject].append(_pitches_walking(store.motion(index)))
    pitches = {}
    for person, parts in walks.items():
        walked = np.concatenate(parts)
        if len(walked) >= SHORTEST_WALK * store.fps:
            pitches[person] = float(np.clip(np.median(walked) - HEAD_PITCH, -MOST_PITCH, MOST_PITCH))
    usual = float(np.median([*pitches.values()])) if pitches else 0.0
    return {person: pitches.get(person, usual) for person in walks}


def _pitches_walking(features: Motion) -> Array:
    """How far down the head looks, in degrees, in frames in which its person walks upright."""
    local = joint_rotations(features)
    # the chest and the head, seen from the facing
    chest = local["hips"]
    for bone in ("spine", "chest", "upperChest"):
        chest = product(chest, local[bone])
    head = product(product(chest, local["neck"]), local["head"])
    # frames of walking
    forward, left = features.select(("root.forward", "root.left")).values.T
    walks = np.hypot(forward, left) >= WALKS_AT
    upright = chest[:, 1, 1] >= np.cos(np.radians(UPRIGHT))
    pitches: Array = np.degrees(np.arcsin(-head[walks & upright, 1, 2].clip(-1, 1)))
    return pitches


def _collars(store: Store) -> dict[str, dict[str, Array]]:
    """For each person and side the rotation matrix (3, 3) that evens the collar bone; none where no arm ever hangs."""
    directions = defaultdict[str, dict[str, Array]](lambda: {side: np.zeros(3) for side in COLLARS})
    for index, record in enumerate(store.records):
        local = joint_rotations(store.motion(index))
        for side in COLLARS:
            directions[record.subject][side] += _hanging_collar(local, side)
    collars = {}
    for person, sides in directions.items():
        collars[person] = {side: sloping(side, direction) for side, direction in sides.items() if direction.any()}
    return collars


def _hanging_collar(local: Mapping[str, Array], side: str) -> Array:
    """The sum (3,) of the directions of a collar bone, seen from the chest, in frames in which the arm hangs.

    local: bone -> rotation matrices (T, 3, 3) in the parent's frame.
    """
    shoulder = local[f"{side}Shoulder"]
    outwards = np.array([np.sign(COLLARS[side][0]), 0.0, 0.0])
    arm = rotated(product(shoulder, local[f"{side}UpperArm"]), outwards)
    direction: Array = rotated(shoulder, COLLARS[side])[arm[:, 1] <= HANGING].sum(axis=0)
    return direction


def _with_raised_head(features: Motion, degrees: float) -> Motion:
    """Features whose head is turned up about its own x axis."""
    raised = product(joint_rotations(features)["head"], axis_to_rotmat("x", np.radians(-degrees)))
    values = features.values.copy()
    values[:, [features.channels.index(f"head.{kind}") for kind in SIXD_KINDS]] = rotmat_to_sixd(raised)
    return replace(features, values=values)
