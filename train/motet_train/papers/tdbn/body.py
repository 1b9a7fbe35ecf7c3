"""Body parts of a skeleton: limbs in pairs and the trunk, found from the joints' names and places."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motet.motion.skeleton import LEFT, MIDDLE, Skeleton, sides_of

TRUNK_PART = "trunk"


@dataclass(frozen=True, eq=False)
class BodyParts:
    """names: the parts that have channels, a limb by its topmost joint. of_channel (D,): which part a channel is of.

    legs: the parts of the left and the right leg; empty where no two limbs go down.
    """

    names: tuple[str, ...]
    of_channel: NDArray[np.intp]
    legs: tuple[int, ...]


def body_parts(skeleton: Skeleton, channels: tuple[str, ...]) -> BodyParts:
    """Divide channels ("JOINT.rx") among the trunk and the limbs (thesis 4.1, figure 4.2).

    A limb begins at a joint of the left or the right side whose parent is in the middle. CMU's skeleton gives the
    thesis' five parts: trunk with head, two legs, two arms. Channels of no joint, which say where the root goes, are
    the trunk's.
    """
    sides = sides_of(skeleton.names)
    limb_of = [TRUNK_PART] * len(skeleton.joints)
    for i, joint in enumerate(skeleton.joints[1:], start=1):
        limb_of[i] = limb_of[joint.parent] if limb_of[joint.parent] != TRUNK_PART or sides[i] == MIDDLE else joint.name
    limbs = dict(zip(skeleton.names, limb_of, strict=True))
    of_joint = [limbs.get(channel.rpartition(".")[0], TRUNK_PART) for channel in channels]
    names = tuple(dict.fromkeys(of_joint))
    legs = [names.index(limb) for limb in _legs(skeleton, limb_of, sides) if limb in names]
    return BodyParts(names, np.array([names.index(limb) for limb in of_joint]), tuple(legs) if len(legs) == 2 else ())


def _legs(skeleton: Skeleton, limb_of: list[str], sides: tuple[str, ...]) -> list[str]:
    """The limbs of the lowest tip on each side at rest, left first."""
    lowest: dict[str, tuple[float, str]] = {}
    for limb, side, (_, height, _) in zip(limb_of, sides, skeleton.rest_positions, strict=True):
        if limb != TRUNK_PART:
            lowest[side] = min(lowest.get(side, (np.inf, "")), (float(height), limb))
    return [limb for _, (_, limb) in sorted(lowest.items(), key=lambda item: item[0] != LEFT)]
