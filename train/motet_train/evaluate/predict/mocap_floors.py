"""Floors of recorded motions: constant and damped velocity of rotations and the root's path, and of joints' positions.

Letters in shapes: W windows, N predicted frames, J joints. Lengths are centimetres.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from motet.motion.kinematics import chained, local_rotations, local_translations, positions, skeleton_of
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet.motion.skeleton import Skeleton
from motet.representation.contract import named
from motet_train.data.errors import DataError
from motet_train.data.store import Store
from motet_train.evaluate.predict.floors import (
    CONSTANT,
    DAMPED,
    DECAYS,
    FLOORS,
    OF_JOINTS,
    ZERO,
    best,
    gone_on,
    reach,
    turned_on,
)

Decays = Mapping[str, tuple[Array, Array]]
"""Damped floor -> decays (N,) of the root's path, and of everything relative to it."""


@dataclass(frozen=True, eq=False)
class Windows:
    """Parts of motions of figures with the same joints: the last two frames that are given, and what follows.

    rotations (W, 2, J, 3, 3) and translations (W, 2, J, 3) relative to the parents; given (W, 2, J, 3) and truth
    (W, N, J, 3): places in the world.
    """

    skeleton: Skeleton
    rotations: Array
    translations: Array
    given: Array
    truth: Array

    @staticmethod
    def of(windows: Sequence[Motion], frames: int) -> "Windows":
        """Of motions that end with what is to be predicted, ``frames`` of each; DataError where there is none."""
        if not windows:
            raise DataError("no motion is long enough for a window")
        lasts = [motion[: len(motion) - frames][-2:] for motion in windows]
        return Windows(
            skeleton_of(windows[0]),
            np.stack([local_rotations(last) for last in lasts]),
            np.stack([local_translations(last) * centimetres(last) for last in lasts]),
            np.stack([places(last) for last in lasts]),
            np.stack([places(motion[len(motion) - frames :]) for motion in windows]),
        )

    @property
    def frames(self) -> int:
        """N."""
        return int(self.truth.shape[1])


def centimetres(motion: Motion) -> float:
    """How many of them the skeleton's unit of length has."""
    return skeleton_of(motion).unit_factor(0.01)


def places(motion: Motion) -> Array:
    """Places (T, J, 3) of joints in centimetres."""
    return positions(motion) * centimetres(motion)


def apart(found: Array, truth: Array) -> tuple[Array, Array]:
    """Mean distances (..., T) of joints (..., T, J, 3) in the world, and relative to the root."""
    difference = found - truth
    world: Array = np.linalg.norm(difference, axis=-1).mean(axis=-1)
    return world, np.linalg.norm(difference - difference[..., :1, :], axis=-1).mean(axis=-1)


def floors(windows: Windows, decays: Decays) -> dict[str, Array]:
    """What each floor predicts: places (W, N, J, 3)."""
    same = np.ones(windows.frames), np.ones(windows.frames)
    found = {ZERO: _of_joints(windows, 0.0) + _path(windows, 0.0)}
    for end, relative in RELATIVE.items():
        for name, (path, rest) in {CONSTANT: same, DAMPED: decays[DAMPED + end]}.items():
            found[name + end] = relative(windows, rest) + _path(windows, path)
    return {name: found[name] for name in FLOORS}


def _path(windows: Windows, decays: Array | float) -> Array:
    """Places (W, N, 1, 3) of the root."""
    return gone_on(windows.given[:, :, :1], reach(decays, windows.frames))


def _of_rotations(windows: Windows, decays: Array | float) -> Array:
    """Places (W, N, J, 3) relative to the root's of joints whose rotations, and the root's, turn on."""
    turned = turned_on(windows.rotations, reach(decays, windows.frames))
    bones = np.repeat(windows.translations[:, 1:], windows.frames, axis=1)
    bones[:, :, 0] = 0.0
    flat = turned.reshape(-1, *turned.shape[2:]), bones.reshape(-1, *bones.shape[2:])
    return chained(windows.skeleton, *flat)[1].reshape(bones.shape)


def _of_joints(windows: Windows, decays: Array | float) -> Array:
    """As :func:`_of_rotations`, of joints whose places relative to the root's go on in a line."""
    return gone_on(windows.given - windows.given[:, :, :1], reach(decays, windows.frames))


RELATIVE: Mapping[str, Callable[[Windows, Array | float], Array]] = {"": _of_rotations, OF_JOINTS: _of_joints}
"""End of a floor's name -> what it says of joints relative to the root."""


def chosen(store: Store, held_out: Sequence[str], fps: float, frames: int) -> dict[str, tuple[Array, Array]]:
    """The decays that are best on windows of a store's training motions, those that are not ``held_out``.

    Those of what is relative to the root are chosen first, by the distances relative to it, then those of its path.
    DataError where no training motion is long enough.
    """
    windows, found = Windows.of(training_windows(store, held_out, fps, frames), frames), {}
    for end, relative in RELATIVE.items():
        rest = best([apart(relative(windows, decay), windows.truth)[1].mean(axis=0) for decay in DECAYS])
        there = relative(windows, rest)
        path = best([apart(there + _path(windows, decay), windows.truth)[0].mean(axis=0) for decay in DECAYS])
        found[DAMPED + end] = path, rest
    return found


def training_windows(store: Store, held_out: Sequence[str], fps: float, frames: int, most: int = 512) -> list[Motion]:
    """About ``most`` evenly spaced windows of training motions at ``fps``: two frames and ``frames`` to come."""
    playable, test = named(store.representation).motion, set(held_out)
    long = int(np.ceil((frames + 1) * store.fps / fps)) + 1
    starts = [
        (number, start)
        for number, entry in enumerate(store.records)
        if entry.name not in test
        for start in range(0, entry.spans[0][1] - entry.spans[0][0] - long + 1, long)
    ]
    return [
        playable(store.motion(number)[start : start + long]).resample(fps, to_end=True)[-frames - 2 :]
        for number, start in starts[:: max(1, len(starts) // most)]
    ]
