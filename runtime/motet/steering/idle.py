"""Figures that stand keep their place, and breathe.

Recordings of people who stand sway, and every jump between two of them leaves a rest of that: without a hold a figure
creeps. While one stands, what is played moves it over the ground no more; its feet are held by the foot lock. Its chest
goes forward and up and back again, by small turns that are added to whatever is played; head and arms stay where they
are. Breaths are a wave over the ground, so that neighbours do not breathe as one. Letters in shapes: B figures, J
bones.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from motet.figures.humanoid import BONES, SPINE
from motet.motion.rotations import Array
from motet.motion.scalar_or_batch import (
    Part,
    Quaternion,
    computed,
    inverse,
    joined,
    parts,
    product,
    rotated_axis,
    single,
    times,
)
from motet.motion.springs import damped, damping_of
from motet.steering.matching import Playback, Rows
from motet.steering.pose import Floats, Pose

PERIOD = 4.0
"""Seconds of a breath."""

WAVE = (2.0, 3.0)
"""Radians of a breath by which figures differ that are a metre apart, along x and z."""

DEPTH = 0.021
"""Radians by which a breath turns the spine to either side."""

TRUNK = [BONES.index(bone) for bone in SPINE]
TURNS = dict(zip(TRUNK, (1.0, 0.0, -2.0), strict=True)) | {
    BONES.index(bone): 1.0 for bone in ("neck", "leftShoulder", "rightShoulder")
}
"""By how many times its depth a breath turns bones about the x axis of the hips: those of the trunk, and what the last
of them carries."""

STILL: Quaternion = (0.0, 0.0, 0.0, 1.0)

SETTLES = 0.3
"""Half-life in seconds in which a figure that has come to stand comes to rest and to breathe, or ceases to breathe."""

SLOW, STANDS = 0.1, 0.5
"""A figure stands that is told to, goes slower than this in m/s, with contacts of both feet above that."""

LEAST = 1e-3
"""Share below which nothing is seen of a breath."""


@dataclass(frozen=True, eq=False)
class Standing:
    """Of B figures; replaced, never written into. ticks: (B,) since each began. share, rate: (B,) how far they have
    come to rest, from 0 to 1, and how fast that changes."""

    ticks: Rows
    share: Array
    rate: Array

    @staticmethod
    def none(figures: int) -> "Standing":
        """Of figures that have not yet stood."""
        return Standing(np.zeros(figures, dtype=np.int64), np.zeros(figures), np.zeros(figures))

    def kept(
        self,
        playback: Playback,
        root: Array,
        contacts: Floats,
        target: Array,
        acts: NDArray[np.bool_],
        dt: float,
    ) -> "Standing":
        """A tick of dt seconds later; the playback's figures that stand are kept where they were before it.

        root: (B, 3) before the tick. contacts: (B, 2). target: (B, 3) velocity along x and z, and facing. acts: (B,)
        whether an act leads the whole body.
        """
        stands = (target[:, :2] == 0).all(axis=1) & ~acts & (contacts > STANDS).all(axis=1)
        stands &= (playback.spring[:, :2] ** 2).sum(axis=1) < SLOW**2
        off, rate = damped(self.share - stands, self.rate, damping_of(SETTLES), dt)
        share = stands + off
        rests = np.where(stands, share, 0.0)[:, None]
        playback.root[:, :2] -= rests * (playback.root[:, :2] - root[:, :2])
        return Standing(self.ticks + 1, share, rate)

    def breathed(self, pose: Pose, dt: float) -> Pose:
        """A pose after as many ticks, with its breath."""
        (who,) = (self.share > LEAST).nonzero()
        if not len(who):
            return pose
        x, z, _ = parts(pose.ground[who])
        (breath,) = parts(2 * np.pi * (self.ticks[who] * dt / PERIOD % 1)[:, None])
        wave = breath + WAVE[0] * x + WAVE[1] * z
        half = computed(np.sin, wave) * single(self.share[who]) * (DEPTH / 2)
        return replace(pose, rotations=_turned(pose.rotations, who, half))


def _turned(rotations: Floats, who: Rows, half: Part) -> Floats:
    """Local quaternions (B, J, 4) with the breath of figures (n,), of half the angle of the spine."""
    found, above = rotations.copy("K"), STILL
    for bone, by in TURNS.items():
        own: Quaternion = parts(rotations[who, bone])
        if by:
            x = rotated_axis(inverse(above), 0)  # of the hips, as the parent has it
            turn = (*times(x, computed(np.sin, by * half)), computed(np.cos, by * half))
            found[who, bone] = joined(product(turn, own))
        if bone in TRUNK:
            above = product(above, own)
    return found
