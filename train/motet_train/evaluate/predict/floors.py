"""Floors: predictions that nobody had to train, which every predictor has to beat.

The last pose held; its last step repeated (constant velocity); and repeated ever smaller (damped velocity). All three
are one: after k frames the last step has been gone ``d + d^2 + ... + d^k`` times, with a decay d of 0, of 1, and, for
each k, of what is best on training data. In recorded motions steps are those of rotations and the root's path, or of
joints' positions. Letters in shapes: W windows, N predicted frames, J joints. Lengths are centimetres.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from motet.motion.kinematics import chained, local_rotations, local_translations, positions, skeleton_of
from motet.motion.motion import Motion
from motet.motion.rotations import Array, inverse, product, rotmat_to_rotvec, rotvec_to_rotmat
from motet.motion.skeleton import Skeleton
from motet.representation.contract import named
from motet_train.data.errors import DataError
from motet_train.data.store import Store
from motet_train.evaluate.positions import length

ZERO, CONSTANT, DAMPED = "zero velocity", "constant velocity", "damped velocity"
OF_JOINTS = " of joints"
"""What follows the name of a floor whose velocities are those of joints' positions, not of rotations and the root."""

FLOORS = (ZERO, CONSTANT, DAMPED, CONSTANT + OF_JOINTS, DAMPED + OF_JOINTS)

DECAYS = np.linspace(0.0, 1.0, 21)
"""Those that are tried."""

REPORTED = (1, 3, 7, 9, 13, 24)
"""Output frames of which errors are reported, from 0: those of the protocol of Martinez et al. 2017."""

Decays = Mapping[str, tuple[Array, Array]]
"""Damped floor -> decays (N,) of the root's path, and of everything relative to it."""


def key(floor: str) -> str:
    """The name of a floor as JSON has it."""
    return floor.replace(" ", "_")


def reach(decays: Array | float, frames: int) -> Array:
    """How many times the last step has been gone after each frame (N,); decays: one, or one for each frame (N,)."""
    powers = np.broadcast_to(decays, frames)[:, None] ** np.arange(1.0, frames + 1)
    return np.cumsum(powers, axis=1).diagonal()


def gone_on(last_two: Array, steps: Array) -> Array:
    """The last two vectors (W, 2, ...) to those (W, N, ...) that go on by ``steps`` (N,) times the last step."""
    step = last_two[:, 1] - last_two[:, 0]
    found: Array = last_two[:, 1, None] + step[:, None] * steps.reshape(-1, *[1] * (step.ndim - 1))
    return found


def turned_on(last_two: Array, steps: Array) -> Array:
    """Rotations (W, 2, J, 3, 3) to those (W, N, J, 3, 3) that turn on by ``steps`` (N,) times the last turn, about its
    axis."""
    step = rotmat_to_rotvec(product(last_two[:, 1], inverse(last_two[:, 0])))
    turns = rotvec_to_rotmat(step[:, None] * steps[:, None, None])
    return product(turns, np.broadcast_to(last_two[:, 1, None], turns.shape))


def best(errors: Sequence[Array]) -> Array:
    """The decay (N,) with the smallest error at each frame; errors (N,) are those of each of :data:`DECAYS`."""
    found: Array = DECAYS[np.argmin(errors, axis=0)]
    return found


def by_frame(errors: Array) -> dict[str, float]:
    """Errors (N,) at the reported frames, "frame_1" and so on."""
    return {f"frame_{frame}": float(errors[frame]) for frame in REPORTED}


def cells(figures: Mapping[str, float], digits: int) -> list[str]:
    """Figures by frame as text; nothing for a NaN."""
    return [f"{value:.{digits}f}" if np.isfinite(value) else "" for value in figures.values()]


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
            np.stack([local_translations(last) * skeleton_of(last).unit_factor(0.01) for last in lasts]),
            np.stack([places(last) for last in lasts]),
            np.stack([places(motion[len(motion) - frames :]) for motion in windows]),
        )

    def path(self, decays: Array | float) -> Array:
        """Places (W, N, 1, 3) of a root that goes on."""
        return gone_on(self.given[:, :, :1], reach(decays, self.truth.shape[1]))

    def turned(self, decays: Array | float) -> Array:
        """Places (W, N, J, 3) relative to the root's of joints whose rotations, and the root's, turn on."""
        frames = self.truth.shape[1]
        turned = turned_on(self.rotations, reach(decays, frames))
        bones = np.repeat(self.translations[:, 1:], frames, axis=1)
        bones[:, :, 0] = 0.0
        flat = turned.reshape(-1, *turned.shape[2:]), bones.reshape(-1, *bones.shape[2:])
        return chained(self.skeleton, *flat)[1].reshape(bones.shape)

    def moved(self, decays: Array | float) -> Array:
        """As :meth:`turned`, of joints whose places relative to the root's go on in a line."""
        return gone_on(self.given - self.given[:, :, :1], reach(decays, self.truth.shape[1]))


RELATIVE: Mapping[str, Callable[[Windows, Array | float], Array]] = {"": Windows.turned, OF_JOINTS: Windows.moved}
"""End of a floor's name -> what it says of joints relative to the root."""


def places(motion: Motion) -> Array:
    """Places (T, J, 3) of joints in centimetres."""
    return positions(motion) * skeleton_of(motion).unit_factor(0.01)


def apart(found: Array, truth: Array) -> tuple[Array, Array]:
    """Mean distances (..., T) of joints (..., T, J, 3) in the world, and relative to the root."""
    difference = found - truth
    return length(difference).mean(axis=-1), length(difference - difference[..., :1, :]).mean(axis=-1)


def floors(windows: Windows, decays: Decays) -> dict[str, Array]:
    """What each floor predicts: places (W, N, J, 3)."""
    found = {ZERO: windows.moved(0.0) + windows.path(0.0)}
    for end, relative in RELATIVE.items():
        path, rest = decays[DAMPED + end]
        found[CONSTANT + end] = relative(windows, 1.0) + windows.path(1.0)
        found[DAMPED + end] = relative(windows, rest) + windows.path(path)
    return {name: found[name] for name in FLOORS}


def chosen(store: Store, held_out: Sequence[str], fps: float, frames: int) -> dict[str, tuple[Array, Array]]:
    """The decays that are best on windows of a store's training motions, those that are not ``held_out``.

    Those of what is relative to the root are chosen first, by the distances relative to it, then those of its path.
    DataError where no training motion is long enough.
    """
    windows, found = Windows.of(training_windows(store, held_out, fps, frames), frames), {}
    for end, relative in RELATIVE.items():
        rest = best([apart(relative(windows, decay), windows.truth)[1].mean(axis=0) for decay in DECAYS])
        there = relative(windows, rest)
        path = best([apart(there + windows.path(decay), windows.truth)[0].mean(axis=0) for decay in DECAYS])
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
