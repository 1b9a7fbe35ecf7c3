"""An act of key poses, and how it is laid over a motion."""

from dataclasses import dataclass

import numpy as np

from motet.errors import DecodingError, MotionError
from motet.figures.humanoid import BONES, HUMANOID, on_humanoid
from motet.keyed.draw import Drawn, drawn
from motet.keyed.hands import with_hands
from motet.keyed.keys import Key, Repeat, Span
from motet.keyed.trunk import Figure, with_feet, with_trunk
from motet.motion.kinematics import heading, local_rotations, local_translations, posed
from motet.motion.motion import Motion
from motet.motion.rotations import axis_to_rotmat
from motet.settings import Seed, seeds_of

ACT_FPS = 30.0
"""Frames a second of what acts give, as of everything on the humanoid."""


@dataclass(frozen=True)
class KeyedAct:
    """An act of key poses.

    says: sentences for it. ease: seconds in which a part comes from the base to its first key, and goes back after its
    last. speed, amplitude: of each draw; the amplitude is of all numbers, but not of where hands go. mirrored: whether
    a draw may have left and right exchanged. over: what the figure does below the act, "stand" or "walk", at ``pace``
    times its usual speed.
    """

    name: str
    says: tuple[str, ...]
    keys: tuple[Key, ...]
    repeat: Repeat | None = None
    ease: Span = (0.4, 0.4)
    speed: Span = (0.92, 1.08)
    amplitude: Span = (0.9, 1.1)
    mirrored: bool = False
    over: str = "stand"
    pace: float = 1.0

    def motion(self, base: Motion, seed: Seed = 0, strict: bool = True) -> Motion:
        """The act laid over the begin of a base, such as a person who stands.

        base: of any human figure; it must last as long as the act. The result is on the humanoid, at 30 frames a
            second, and ends when the act does.
        seed: of times, sizes and counts.
        strict: refuse a place that a hand does not reach on this base; else the hand comes as near as it can.
        MotionError for a base that is too short or not of a human, and for a key that no body can take. DecodingError
        for a negative seed.
        """
        (number,) = seeds_of(seed, 1, DecodingError)
        return laid_over(base, drawn(self, np.random.default_rng(number), ACT_FPS), self.name, strict)

    def seconds(self, seed: Seed = 0) -> float:
        """How long the motion of a seed lasts."""
        (number,) = seeds_of(seed, 1, DecodingError)
        return drawn(self, np.random.default_rng(number), ACT_FPS).frames / ACT_FPS


def laid_over(base: Motion, act: Drawn, name: str, strict: bool = True) -> Motion:
    """A drawn act over the begin of a base; MotionError as of :meth:`KeyedAct.motion`."""
    motion = on_humanoid(base).continuous().resample(ACT_FPS)
    if len(motion) < act.frames:
        raise MotionError(
            f"{name} lasts {act.frames / ACT_FPS:.1f} s, the motion that it is laid over "
            f"{len(motion) / ACT_FPS:.1f} s: give a longer one"
        )
    motion = motion[: act.frames]
    figure = _figure_of(motion)

    # from the ground up: legs under the hips, the trunk on them, and arms on the trunk
    figure = with_feet(figure, act)
    figure = with_trunk(figure, act)
    if any(act.hands.values()):
        figure = with_hands(figure, act, name if strict else "")
    rotations = {bone: figure.local[:, index] for index, bone in enumerate(BONES)}
    return posed(motion, rotations, {BONES[0]: figure.root})


def _figure_of(motion: Motion) -> Figure:
    """The figure of a motion on the humanoid, seen along the way that it faces."""
    joints = [HUMANOID.index(bone) for bone in BONES]
    root = local_translations(motion)[:, 0]
    facing = axis_to_rotmat("y", heading(motion))
    return Figure(local_rotations(motion, joints), root, facing, root * [1, 0, 1])
