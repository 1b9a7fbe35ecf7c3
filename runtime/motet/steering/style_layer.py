"""Styles laid over what figures play (:mod:`motet.steering.styles`): trunk and head turned, arms held, feet turned and
lifted, hips lowered, while the recorded steps go on.

Letters in shapes: B figures, n that are shown in a style, J bones.
"""

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from motet.figures.humanoid import BONES
from motet.figures.legs import Limb, joints_of, limbs_as_arrays, reached_by, with_legs
from motet.motion.rotations import Array, quat_product
from motet.motion.scalar_or_batch import Quaternion, Vector, plus, product
from motet.motion.springs import damped, damping_of
from motet.settings import Settings
from motet.steering.action_layer import Body
from motet.steering.matching import Flags, Rows
from motet.steering.pose import Floats, Pose
from motet.steering.settings import HalfLife
from motet.steering.styles import (
    ARM_TURNS,
    ARMS,
    FOOT_OFFSETS,
    FOOT_TURNS,
    HIPS_LOWER,
    POSES,
    SECONDS,
    TURNED,
    TURNS,
)

Quats = NDArray[Any]


@dataclass(frozen=True)
class StyleSettings(Settings):
    """Settings of figures that go in a style."""

    FEATURE: ClassVar[str] = "style"

    fades: HalfLife = 0.18
    """Half-life in which a style comes and goes."""
    sways: HalfLife = 0.06
    """Half-life in which it follows from one of its poses to the other."""


STYLED_TRUNK = [BONES.index(bone) for bone in TURNED]
STYLED_ARMS = [BONES.index(bone) for bone in ARMS]

LEAST_STYLE = 0.01
"""Share below which a style is invisible: then another one may come."""

UNTURNED = np.array([0.0, 0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class StyleLayer:
    """The styles of B figures; replaced, never written into."""

    wanted: Rows
    """(B,) the numbers of styles."""
    shown: Rows
    """(B,) of those that are shown, until they have gone."""
    ticks: Rows
    """(B,) since each began."""
    share: Array
    """(B, 3) how much of the style is shown by the body and by the arms, and how far it is to its second pose."""
    rate: Array
    """(B, 3) how fast these change, a second."""

    @staticmethod
    def none(figures: int) -> "StyleLayer":
        """Figures without a style."""
        nothing = np.zeros(figures, dtype=np.int64)
        return StyleLayer(nothing, nothing, nothing, np.zeros((figures, 3)), np.zeros((figures, 3)))

    @property
    def shows(self) -> bool:
        """Whether any figure goes in a style, or is about to."""
        return bool(self.wanted.any() or self.shown.any())

    def update(
        self, pose: Pose, whole: Flags, acts: Flags, settings: StyleSettings, seconds: float
    ) -> tuple["StyleLayer", Pose]:
        """A tick later, and the pose of that tick in the style of each figure.

        whole: (B,) whether an act leads the body, which then shows no style. acts: (B,) whether the arms act.
        """
        # another style comes once the one before has gone; how much of it is wanted, and which of its poses
        is_gone = self.share[:, 0] < LEAST_STYLE
        shown = np.where(is_gone, self.wanted, self.shown)
        ticks = np.where(is_gone, 0, self.ticks + 1)
        stays = (shown == self.wanted) & (shown > 0) & ~whole
        goal = np.stack([stays, stays & ~acts, _second_pose(shown, ticks * seconds, pose)], axis=1)
        # what is shown follows softly
        half_lives = np.array([settings.fades, settings.fades, settings.sways])
        error, rate = damped(self.share - goal, self.rate, damping_of(1.0) / half_lives, seconds)
        layer = StyleLayer(self.wanted, shown, ticks, goal + error, rate)
        return layer, layer._styled(pose)

    def _styled(self, pose: Pose) -> Pose:
        """A pose in the style of each figure."""
        (figures,) = (self.shown > 0).nonzero()
        if not len(figures):
            return pose
        body, arms, second = self.share[figures].T[:, :, None]
        first_pose, second_pose = POSES[self.shown[figures]].swapaxes(0, 1)
        style = (1 - second) * first_pose + second * second_pose
        shown = Body(pose.rotations, pose.height)
        played = shown.at(figures)
        rotations = _held(played.rotations, style, body, arms)
        styled = shown.put(figures, _on_legs(played, rotations, pose.contacts[figures], style, body))
        return replace(pose, rotations=styled.rotations, height=styled.height)


def _second_pose(styles: Rows, since: Array, pose: Pose) -> Array:
    """How far figures (B,) in styles are to be to the second pose: with the steps, or to and fro in the seconds since
    they began."""
    period = SECONDS[styles]
    sways = period > 0
    phase = since / np.where(sways, period, 1.0) % 1
    left, right = pose.contacts.astype(np.float64).T
    second: Array = np.where(sways, 0.5 - 0.5 * np.cos(2 * np.pi * phase), (1 + left - right) / 2)
    return second


def _held(rotations: Quats, style: Array, body: Array, arms: Array) -> Quats:
    """Rotations (n, J, 4) with trunk and head turned, and arms held, in a style (n, STYLE_WIDTH), as much as these show
    it (n, 1)."""
    styled = rotations.copy()
    turned = _between(UNTURNED, _quats(style, TURNS), body)
    styled[:, STYLED_TRUNK] = quat_product(turned, rotations[:, STYLED_TRUNK])
    styled[:, STYLED_ARMS] = _between(rotations[:, STYLED_ARMS], _quats(style, ARM_TURNS), arms)
    return styled


def _on_legs(played: Body, rotations: Quats, contacts: Floats, style: Array, share: Array) -> Body:
    """Bodies of rotations (n, J, 4) on legs that reach from lower hips for the feet of those played, in a style (n,
    STYLE_WIDTH), as much as is shown of it (n, 1). contacts: (n, 2) of the feet."""
    limb = limbs_as_arrays(played.rotations, contacts)
    foot, ankle = _feet(limb, played, style, share)
    # the legs as they hang from the hips, in the frame of the facing
    height = played.height - share[:, 0] * style[:, HIPS_LOWER]
    hips = tuple(rotations[:, 0].T)
    leg, places = joints_of(limb, hips, (0.0, height, 0.0))
    reaching = reached_by(hips, [*leg[:2], foot], places, ankle)
    return Body(with_legs(rotations.astype(np.float32), [reaching]), height)


def _feet(limb: Limb, played: Body, style: Array, share: Array) -> tuple[Quaternion, Vector]:
    """Rotations of feet and places of ankles in the frame of the facing: as they are played, turned and moved."""
    leg, places = joints_of(limb, tuple(played.rotations[:, 0].T), (0.0, played.height, 0.0))
    turns = _between(UNTURNED, _quats(style, FOOT_TURNS), share)
    left, up, forward = (share * style[:, FOOT_OFFSETS]).reshape(-1, 2, 3).transpose(2, 1, 0)
    return product(tuple(turns.transpose(2, 1, 0)), leg[2]), plus(places[2], (left, up, forward))


def _quats(style: Array, columns: slice) -> Quats:
    """Some columns of styles (n, STYLE_WIDTH) as quaternions (n, k, 4)."""
    return style[:, columns].reshape(len(style), -1, 4)


def _between(first: Quats, second: Quats, share: Array) -> Quats:
    """Unit quaternions (n, k, 4) on the way from the first ones to the second ones by shares (n, 1); where the second
    is zero, the first."""
    is_far = (first * second).sum(axis=-1, keepdims=True) < 0
    mixed = (1 - share[..., None]) * first + share[..., None] * np.where(is_far, -second, second)
    length = np.sqrt((mixed * mixed).sum(axis=-1, keepdims=True))
    return np.where(length > 1e-6, mixed / np.maximum(length, 1e-6), first)
