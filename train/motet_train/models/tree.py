"""The joints of a figure by their depth, for forward kinematics that turns all joints of one depth together."""

from collections.abc import Sequence


def levels(parents: Sequence[int]) -> list[list[int]]:
    """The joints but the root, those of one depth together. parents: of each joint, before it; -1 for the root."""
    depth = [0] * len(parents)
    for joint, parent in enumerate(parents):
        depth[joint] = depth[parent] + 1 if parent >= 0 else 0
    return [[joint for joint in range(len(parents)) if depth[joint] == level] for level in range(1, max(depth) + 1)]
