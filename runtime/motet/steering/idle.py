"""Figures that stand keep their place, and breathe.

Recordings of standing people sway, and each transition between two of them leaves a small displacement, so an idle
figure would drift. While one stands, the playback moves it over the ground no more, and its feet are held by the foot
lock. Its chest goes forward and up and back again, by small turns that are added to whatever is played; head and arms
stay where they are. Breaths are a wave over the ground, to keep neighbours from breathing as one. Letters in shapes: B
figures, J bones.
"""

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np

from motet.figures.humanoid import BONES, SPINE
from motet.motion.rotations import Array
from motet.motion.scalar_or_batch import (
    NO_ROTATION,
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
from motet.settings import Range, Settings
from motet.steering.matching import Flags, Playback, Rows
from motet.steering.pose import Floats, Pose
from motet.steering.settings import HalfLife, Radians, Seconds, Share, Speed

PerMetre = Annotated[float, Range(-100, 100, "rad/m")]


@dataclass(frozen=True)
class IdleSettings(Settings):
    """Settings of figures that stand."""

    FEATURE: ClassVar[str] = "idle"

    settles: HalfLife = 0.3
    """Half-life in which a figure that has stopped comes to rest and to breathe, or ceases to breathe."""
    slow: Speed = 0.1
    """A figure without a target speed stands once it is slower than this."""
    stands: Share = 0.5
    """A figure stands while the contacts of both feet are above this."""
    breath: Seconds = 4.0
    """Duration of a breath."""
    depth: Radians = 0.021
    """How far a breath turns the spine to either side."""
    wave_x: PerMetre = 2.0
    """Phase by which the breaths of figures differ along x."""
    wave_z: PerMetre = 3.0
    """Phase by which the breaths of figures differ along z."""


TRUNK_BONES = [BONES.index(bone) for bone in SPINE]
CARRIED_BONES = [BONES.index(bone) for bone in ("neck", "leftShoulder", "rightShoulder")]
BREATH_TURNS = dict(zip(TRUNK_BONES, (1.0, 0.0, -2.0), strict=True)) | dict.fromkeys(CARRIED_BONES, 1.0)
"""Bones that a breath turns about the x axis of the hips, and by how many times its depth: those of the trunk, and what
the last of them carries."""

LEAST_BREATH = 1e-3
"""Share below which a breath is invisible."""


@dataclass(frozen=True, eq=False)
class IdleLayer:
    """The rest of B figures; replaced, never written into."""

    ticks: Rows
    """(B,) ticks since each began."""
    share: Array
    """(B,) how far they have come to rest, from 0 to 1."""
    rate: Array
    """(B,) how fast the share changes, a second."""

    @staticmethod
    def none(figures: int) -> "IdleLayer":
        """Figures that have not stood yet."""
        zero = np.zeros(figures)
        return IdleLayer(zero.astype(np.int64), zero, zero)

    def update(
        self,
        pose: Pose,
        playback: Playback,
        root: Array,
        target: Array,
        acts: Flags,
        settings: IdleSettings,
        seconds: float,
    ) -> "IdleLayer":
        """A tick later; the playback's figures that stand are kept where they were before it.

        root: (B, 3) before the tick. target: (B, 3) velocity along x and z, and facing. acts: (B,) whether an act leads
        the whole body.
        """
        # figures stand without a target speed, slow, and on both feet
        stopped = (target[:, :2] == 0).all(axis=1)
        on_both_feet = (pose.contacts > settings.stands).all(axis=1)
        slow = playback.pace < settings.slow
        stands = stopped & ~acts & on_both_feet & slow
        # come to rest
        error, rate = damped(self.share - stands, self.rate, damping_of(settings.settles), seconds)
        share = stands + error
        # and stay there
        rest = np.where(stands, share, 0.0)[:, None]
        playback.root[:, :2] -= rest * (playback.root[:, :2] - root[:, :2])
        return IdleLayer(self.ticks + 1, share, rate)

    def breathe(self, pose: Pose, settings: IdleSettings, seconds: float) -> Pose:
        """A pose of the present tick, of ``seconds``, with its breath."""
        (figures,) = (self.share > LEAST_BREATH).nonzero()
        if not len(figures):
            return pose
        x, z, _ = parts(pose.ground[figures])
        (phase,) = parts(2 * np.pi * (self.ticks[figures] * seconds / settings.breath % 1)[:, None])
        wave = phase + settings.wave_x * x + settings.wave_z * z
        half_angle = computed(np.sin, wave) * single(self.share[figures]) * (settings.depth / 2)
        return replace(pose, rotations=_breathed(pose.rotations, figures, half_angle))


def _breathed(rotations: Floats, figures: Rows, half_angle: Part) -> Floats:
    """Local quaternions (B, J, 4) with the breath of figures (n,). half_angle: half the turn of the spine."""
    breathed = rotations.copy("K")
    above = NO_ROTATION
    for bone, times_depth in BREATH_TURNS.items():
        local: Quaternion = parts(rotations[figures, bone])
        if times_depth:
            x_axis = rotated_axis(inverse(above), 0)  # of the hips, as the parent has it
            half = times_depth * half_angle
            turn = (*times(x_axis, computed(np.sin, half)), computed(np.cos, half))
            breathed[figures, bone] = joined(product(turn, local))
        if bone in TRUNK_BONES:
            above = product(above, local)
    return breathed
