"""A relaxed hand for figures whose fingers no motion moves: fingers bend a little, more from index to little finger.

The fingers are found by their names below the hand, the side of the palm from where the knuckles of index and other
fingers lie. Fingers bend in the plane of themselves and the palm's normal, the thumb towards the other fingers, too.
What is bent at rest already counts.
"""

import re
from collections.abc import Iterator, Mapping
from itertools import pairwise

import numpy as np

from motet.motion.humanoid.bones import LEFT_RIGHT, sided
from motet.motion.kinematics import chained
from motet.motion.rotations import Array, rotvec_to_rotmat, unit
from motet.motion.skeleton import Skeleton

FINGER_BEND = (15.0, 25.0, 15.0)
"""Degrees by which the three joints of a finger are bent in a hand at rest."""

FINGER_SHARES = {"thumb": 0.5, "index": 0.8, "mid": 1.0, "ring": 1.15, "pinky|little": 1.3}
"""What the names of a finger's joints hold, and how far it is bent, times :data:`FINGER_BEND`."""

PALM = "meta|carpal|palm|inhand"
"""What the names of bones within the palm hold."""

Chains = dict[str, list[int]]
"""A finger out of :data:`FINGER_SHARES` -> its joints, from the knuckle on."""


def relaxed(skeleton: Skeleton, still: Array, bones: Mapping[str, int]) -> Array:
    """Local rotations (J, 3, 3) of a pose with its hands relaxed; those of hands without such fingers stay.

    bones: of the humanoid's bones the joints; "leftHand" and "rightHand" count.
    """
    turns, places = chained(skeleton, still[None].copy(), skeleton.offsets[None].copy())
    bent = still.copy()
    for side, sign in zip(LEFT_RIGHT, (-1.0, 1.0), strict=True):
        hand = bones.get(sided(side, "Hand"))
        chains = {} if hand is None else _chains(skeleton, hand)
        knuckles = {finger: places[0, joints[0]] for finger, joints in chains.items() if finger != "thumb"}
        if hand is None or "index" not in knuckles or len(knuckles) < 2:
            continue
        along = unit(np.mean(list(knuckles.values()), axis=0) - places[0, hand])
        across = unit(knuckles[list(knuckles)[-1]] - knuckles["index"])
        palm = unit(sign * np.cross(along, across))
        for finger, joints in chains.items():
            thumb = finger == "thumb"
            pointing = _bones(places[0], joints)
            start = pointing[0] if thumb else along
            axis = np.cross(start, palm + across if thumb else palm)
            for joint, turn in zip(joints, _bends([start, *pointing], axis, FINGER_SHARES[finger]), strict=False):
                bent[joint] = bent[joint] @ rotvec_to_rotmat(turns[0, joint].T @ turn)
    return bent


def _bones(places: Array, joints: list[int]) -> list[Array]:
    """Directions (3,) of the bones of a finger; that of the last joint, where it has no tip, is the one before it."""
    bones = [unit(places[after] - places[joint]) for joint, after in pairwise(joints)]
    return [*bones, *bones[-1:]] or [np.zeros(3)]


def _bends(bones: list[Array], axis: Array, share: float) -> Iterator[Array]:
    """Rotation vectors (3,) that bend each bone against the one before it, about what of the axis is across it."""
    for before, bone, degrees in zip(bones, bones[1:], FINGER_BEND, strict=False):
        across = unit(axis - (axis @ bone) * bone)
        now = np.arctan2(np.cross(before, bone) @ across, before @ bone - (before @ across) * (bone @ across))
        yield max(0.0, np.radians(degrees) * share - float(now)) * across


def _chains(skeleton: Skeleton, hand: int) -> Chains:
    """The fingers of a hand by the names of its joints."""
    chains: Chains = {}
    for joint in skeleton.subtree(skeleton.names[hand]):
        name = skeleton.names[joint].lower()
        finger = next((words for words in FINGER_SHARES if re.search(words, name)), None)
        if joint == hand or finger is None or (finger != "thumb" and re.search(PALM, name)):
            continue
        chain = chains.setdefault(finger, [joint])
        if skeleton.joints[joint].parent == chain[-1]:
            chain.append(joint)
    return {finger: chains[finger] for finger in FINGER_SHARES if finger in chains}
