"""What motions look like, in numbers: how alike two are without any model, for the floors."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from motet.motion.kinematics import positions, skeleton_of
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet.representation.root_block import ROOT_BLOCK, ROOT_BLOCK_UNITS, from_root_block
from motet_train.evaluate.language.motions import moves
from motet_train.evaluate.language.split_store import SplitStore

ROOT_PATH, ROOT_PATH_UNITS = ROOT_BLOCK[:3], ROOT_BLOCK_UNITS[:3]
"""The channels of the root block by which a figure goes over the ground and turns."""


@dataclass(frozen=True, eq=False)
class Looks:
    """The features of motions, seen from the training motions of a corpus."""

    corpus: SplitStore

    def features(self, motions: Sequence[Motion]) -> Array:
        """(N, F): mean and standard deviation over time of what is :meth:`seen` of motions, in standard deviations from
        the mean of the training motions; each array of it weighs the same in distances, however many features it has.
        """
        mean, scale = self._training
        found: Array = (self._statistics(motions) - mean) / scale
        return found

    def seen(self, motion: Motion) -> tuple[Array, ...]:
        """The joints' places seen from where the root is and faces (T, 3 J) in metres; their speeds, as seen from there
        (T, J), m/s; and how the root goes forward and left and turns (T, 3). Of a motion that does not tell this, its
        channels (T, D)."""
        if not moves(motion):
            return (self.corpus.z(motion),)
        path = motion.select(ROOT_PATH, ROOT_PATH_UNITS).values
        on_the_spot = motion.values.copy()
        on_the_spot[:, [motion.channels.index(name) for name in ROOT_PATH]] = 0
        placed = from_root_block(replace(motion, values=on_the_spot))
        places = positions(placed) * skeleton_of(motion).unit_factor(1.0)
        speeds = np.linalg.norm(np.diff(places, axis=0, prepend=places[:1]), axis=-1) * motion.fps
        return places.reshape(len(places), -1), speeds, path

    @cached_property
    def _training(self) -> tuple[Array, Array]:
        """Mean (F,), and by what features are divided (F,): at least by .001, what differs by less is the same."""
        motions = self.corpus.motions(self.corpus.parts.train)
        found = self._statistics(motions)
        sizes = [frames.shape[1] for frames in self.seen(motions[0])]
        weights = np.repeat(1 / np.sqrt(sizes), [2 * size for size in sizes])
        return found.mean(axis=0), np.maximum(found.std(axis=0), 1e-3) / weights

    def _statistics(self, motions: Sequence[Motion]) -> Array:
        """(N, F): for each array its means, then its standard deviations."""
        rows = [[np.r_[frames.mean(axis=0), frames.std(axis=0)] for frames in self.seen(motion)] for motion in motions]
        return np.array([np.concatenate(row) for row in rows])
