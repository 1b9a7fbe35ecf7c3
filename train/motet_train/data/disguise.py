"""Vary motions as files of other sources would show them: short, in place, repeated, on badly fitted skeletons."""

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
"""Standard deviations in degrees of the constant error in a bone's direction that a wrong rest pose causes."""

ROOT_OFF = {"root.height": 0.04, "root.pitch": 6.0, "root.roll": 2.0}
"""Standard deviations of the constant error in channels of the root: metres, degrees, degrees."""


@dataclass(frozen=True)
class Disguise:
    """Settings of the variation.

    share: of the motions that are varied. crop: how often only 1 to 4 s of any motion are seen. tempo, pace: range of
    the logarithm of the factors on duration and on distance travelled. standing: how often the root stays in place.
    repeated: how often a loop of less than 1.6 s is repeated. off: factor on the errors of rest poses.
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
    disguise: Disguise,
    windows: tuple[int, int],
    channels: Sequence[str],
    fps: float,
) -> Array:
    """An excerpt (T', D) of a motion (T, D) of ``root_angles``, perhaps varied; other channels are only cropped.

    windows: shortest and longest excerpt in frames, where it is not cropped to 1 to 4 s.
    """
    frames = _cropped(frames, rng, disguise, windows, fps)
    if rng.random() >= disguise.share or not set(ROOT_BLOCK) <= set(channels):
        return frames
    return _varied(frames, rng, disguise, tuple(channels), fps)


def _varied(
    frames: Array, rng: np.random.Generator, disguise: Disguise, channels: tuple[str, ...], fps: float
) -> Array:
    """The same frames with another tempo, pace and rest pose, perhaps in place or repeated."""
    frames = _resampled(frames, float(np.exp(rng.uniform(-disguise.tempo, disguise.tempo))))
    # forward and sideways speed: in place, or shorter or longer steps
    if rng.random() < disguise.standing:
        frames[:, :2] *= 0.0
    else:
        frames[:, :2] *= np.exp(rng.uniform(-disguise.pace, disguise.pace))
    errors = rng.normal(size=len(channels)) * _deviations(channels)
    frames = frames + errors * rng.uniform(0, 1.5 * disguise.off)
    if rng.random() < disguise.repeated and len(frames) < 1.6 * fps:
        times = -(-round(2.5 * fps) // len(frames))  # rounded up
        frames = np.tile(frames, (times, 1))
    return frames


def _cropped(
    frames: Array, rng: np.random.Generator, disguise: Disguise, windows: tuple[int, int], fps: float
) -> Array:
    """An excerpt of random length and place, in float64."""
    short = (round(fps), round(4 * fps))
    length = drawn_length(rng, short if rng.random() < disguise.crop else windows)
    start = int(rng.integers(max(0, len(frames) - length) + 1))
    return np.asarray(frames[start : start + length], dtype=np.float64)


def _resampled(frames: Array, duration: float) -> Array:
    """The motion at ``duration`` times its duration; the first three channels are rates, so they change inversely."""
    places = np.linspace(0, len(frames) - 1, max(5, round(len(frames) * duration)))
    before = np.floor(places).astype(int)
    after = np.minimum(before + 1, len(frames) - 1)
    weight = (places - before)[:, None]
    resampled: Array = frames[before] * (1 - weight) + frames[after] * weight
    resampled[:, :3] /= duration
    return resampled


def _deviations(channels: tuple[str, ...]) -> Array:
    """Standard deviations (D,) of the constant error of each channel."""
    deviations = []
    for channel in channels:
        bone = channel.partition(".")[0].removeprefix("left").removeprefix("right")
        deviations.append(ROOT_OFF.get(channel, OFF.get(bone, 0.0)))
    return np.array(deviations)
