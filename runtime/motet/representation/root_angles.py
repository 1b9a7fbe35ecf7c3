"""``root_angles``: the root block, and Euler angles of the joints in degrees."""

import numpy as np

from motet.motion.motion import TURN, Motion
from motet.representation.angles import Angles
from motet.representation.base import FrameMirror, in_units, lateral_x
from motet.representation.root_block import (
    ROOT_BLOCK,
    can_be_planted,
    from_root_block,
    mirrored_signs,
    plant_feet,
    to_root_block,
)


class RootAngles:
    """See :class:`motet.representation.base.Representation`."""

    name = "root_angles"
    required: tuple[str, ...] = ROOT_BLOCK

    def features(self, motion: Motion, like: Motion | None = None) -> Motion:
        """The root block, and the joints' channels of ``like`` or all there are, angles in degrees."""
        if not set(ROOT_BLOCK) <= set(motion.channels):
            motion = to_root_block(motion)
        if like is not None:
            return motion.select(like.channels, like.units)
        return in_units(motion, lambda unit: "deg" if unit in TURN else unit)

    def planted(self, features: Motion) -> Motion:
        """By :func:`motet.representation.root_block.plant_feet`."""
        return plant_feet(features) if can_be_planted(features) else features

    def motion(self, features: Motion, after: Motion | None = None) -> Motion:
        """With the root's translation and rotation instead of the block, where there is a skeleton to move."""
        return features if features.skeleton is None else from_root_block(features, after)

    def mirror(self, features: Motion) -> FrameMirror:
        """The joints as :class:`motet.representation.angles.Angles` does it."""
        lateral_x(features)
        joints = np.flatnonzero([name not in ROOT_BLOCK for name in features.channels])
        found = Angles().mirror(features.select(tuple(features.channels[d] for d in joints)))
        columns = np.arange(len(features.channels))
        signs = mirrored_signs(features.channels).astype(np.float32)
        columns[joints], signs[joints] = joints[found.columns], found.signs
        return FrameMirror(columns, signs)
