"""Motions as files of other people show them: short, in place, repeated, on figures that were fitted otherwise."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from motet.motion.rotations import Array
from motet.representation.root_block import ROOT_BLOCK
from motet_train.data.batches import drawn_length

OFF = {
    "spine": 6.0,
    "chest": 6.0,
    "upperChest": 6.0,
    "neck": 6.0,
    "head": 10.0,
    "Shoulder": 5.0,
    "UpperArm": 8.0,
    "LowerArm": 8.0,
    "Hand": 15.0,
    "UpperLeg": 4.0,
    "LowerLeg": 4.0,
    "Foot": 8.0,
    "Toes": 8.0,
}
"""Degrees by which a bone of a file may point elsewhere throughout: its rest pose is not what it seems."""


@dataclass(frozen=True)
class Disguise:
    """How motions are changed.

    share: of the motions. crop: of these and of all others, how often only 1 to 4 s are seen. tempo, pace: how much
    faster or slower all goes, and how far for its steps, as the logarithm. standing: how often the root stays where it
    is. repeated: how often a loop of less than 1.6 s is seen several times. off: how much wrong rest poses count.
    """

    share: float = 0.6
    crop: float = 0.6
    tempo: float = 0.3
    pace: float = 0.4
    standing: float = 0.15
    repeated: float = 0.2
    off: float = 1.0


def seen_as(
    frames: Array,
    rng: np.random.Generator,
    how: Disguise,
    windows: tuple[int, int],
    channels: Sequence[str],
    fps: float,
) -> Array:
    """Some frames (T', D) of a motion (T, D) of ``root_angles``, perhaps disguised; of other channels only cut.

    windows: from how many to how many frames are cut out of it where that are not 1 to 4 s.
    """
    few = round(fps), round(4 * fps)
    length = drawn_length(rng, few if rng.random() < how.crop else windows)
    start = int(rng.integers(max(0, len(frames) - length) + 1))
    frames = np.asarray(frames[start : start + length], dtype=np.float64)
    if rng.random() >= how.share or not set(ROOT_BLOCK) <= set(channels):
        return frames
    frames = _paced(frames, float(np.exp(rng.uniform(-how.tempo, how.tempo))))
    frames[:, :2] *= 0.0 if rng.random() < how.standing else np.exp(rng.uniform(-how.pace, how.pace))
    frames = frames + rng.normal(size=len(channels)) * _off(tuple(channels)) * rng.uniform(0, 1.5 * how.off)
    if rng.random() < how.repeated and len(frames) < 1.6 * fps:
        frames = np.tile(frames, (-(-round(2.5 * fps) // len(frames)), 1))
    return frames


def _paced(frames: Array, tempo: float) -> Array:
    """The motion so many times slower, its first three channels, which are rates, as much smaller."""
    places = np.linspace(0, len(frames) - 1, max(5, round(len(frames) * tempo)))
    before = np.floor(places).astype(int)
    part = (places - before)[:, None]
    found: Array = frames[before] * (1 - part) + frames[np.minimum(before + 1, len(frames) - 1)] * part
    found[:, :3] /= tempo
    return found


def _off(channels: tuple[str, ...]) -> Array:
    """Standard deviations (D,) of what each channel is off: also 4 cm of the hips' height, and their tilt."""
    root = {"root.height": 0.04, "root.pitch": 6.0, "root.roll": 2.0}
    bones = (channel.partition(".")[0].removeprefix("left").removeprefix("right") for channel in channels)
    return np.array([root.get(channel, OFF.get(bone, 0.0)) for channel, bone in zip(channels, bones, strict=True)])
