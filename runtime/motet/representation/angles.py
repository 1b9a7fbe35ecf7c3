"""``angles``: Euler angles of joints, and whatever other channels a model has, as they are in motions.

They do not say where a figure goes: its path is laid by what its feet do, and what then still slides is held.
"""

import numpy as np

from motet.errors import MotionError
from motet.motion.feet.contacts import has_feet
from motet.motion.feet.hold import hold_feet
from motet.motion.feet.root_path import lay_root_path
from motet.motion.mirroring import mirror
from motet.motion.motion import Motion
from motet.representation.base import FrameMirror, in_units


class Angles:
    """See :class:`motet.representation.base.Representation`."""

    name = "angles"
    required: tuple[str, ...] = ()

    def features(self, motion: Motion, like: Motion | None = None) -> Motion:
        """The channels of ``like``, or all but the root's."""
        if like is not None:
            return motion.select(like.channels, like.units)
        root = "root" if motion.skeleton is None else motion.skeleton.names[0]
        kept = tuple(name for name in motion.channels if name.rpartition(".")[0] != root)
        return in_units(motion.select(kept), str)

    def planted(self, features: Motion) -> Motion:
        """With the root's translation, found from the feet's contact with the ground; a human's feet stay there."""
        if features.skeleton is None or not has_feet(features.skeleton):
            return features
        laid = lay_root_path(features, tremble=0.06)
        try:
            return hold_feet(laid, trembling=True)
        except MotionError:  # not a human: what its legs are is not known
            return laid

    def motion(self, features: Motion, after: Motion | None = None) -> Motion:
        """The features themselves: what they do not tell is not taken from another motion either."""
        return features

    def mirror(self, features: Motion) -> FrameMirror:
        """By :mod:`motet.motion.mirroring`."""
        # each column of a probe frame holds its own number: where mirroring puts it, and with which sign, can be read
        count = len(features.channels)
        probe = Motion(np.arange(1.0, count + 1)[None], features.channels, features.units, 1.0, features.skeleton)
        mirrored = mirror(probe)
        found = np.abs(mirrored.values[0])
        if mirrored.channels != probe.channels or not np.array_equal(np.sort(found), probe.values[0]):
            raise MotionError("left and right joints turn about different axes: frames cannot be mirrored by columns")
        return FrameMirror(found.astype(np.intp) - 1, np.sign(mirrored.values[0]).astype(np.float32))
