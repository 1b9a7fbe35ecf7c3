"""Floors: predictions without training, which every predictor has to beat.

The last pose is held; its last step is repeated (constant velocity); or repeated with a decay (damped velocity). All
three are one formula: after k frames the last step has been repeated ``d + d^2 + ... + d^k`` times, where the decay d
is 0, 1, or for each k the best on training data. In recorded motions a step is one of the rotations and the root's
path, or one of the joints' positions. Letters in shapes: W windows, N predicted frames, J joints. Lengths are
centimetres.
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
from motet_train.evaluate.tables import Figures

ZERO = "zero velocity"
CONSTANT = "constant velocity"
DAMPED = "damped velocity"
OF_JOINTS = " of joints"
"""Suffix of a floor that extrapolates the joints' positions, not their rotations and the root."""

FLOORS = (ZERO, CONSTANT, DAMPED, CONSTANT + OF_JOINTS, DAMPED + OF_JOINTS)

DECAYS = np.linspace(0.0, 1.0, 21)
"""The candidates for the damped floors."""

MOST_WINDOWS = 512
"""Windows on which decays are chosen."""

REPORTED = (1, 3, 7, 9, 13, 24)
"""Output frames whose errors are reported, from 0, as in the protocol of Martinez et al. 2017."""

Decays = Mapping[str, tuple[Array, Array]]
"""Damped floor -> decays (N,) of the root's path, and of the joints relative to it."""


def key(floor: str) -> str:
    """The name of a floor in JSON."""
    return floor.replace(" ", "_")


def reach(decays: Array | float, frames: int) -> Array:
    """How many times the last step has been repeated after each frame (N,). decays: one, or one for each frame (N,)."""
    # d + d^2 + ... + d^k, with the k-th decay for frame k
    powers = np.broadcast_to(decays, frames)[:, None] ** np.arange(1.0, frames + 1)
    return np.cumsum(powers, axis=1).diagonal()


def gone_on(last_two: Array, steps: Array) -> Array:
    """Extrapolate the last two vectors (W, 2, ...) to (W, N, ...) by ``steps`` (N,) times the last step."""
    step = last_two[:, 1] - last_two[:, 0]
    # a factor for each frame, whatever a vector is
    factors = steps.reshape(-1, *[1] * (step.ndim - 1))
    vectors: Array = last_two[:, 1, None] + step[:, None] * factors
    return vectors


def turned_on(last_two: Array, steps: Array) -> Array:
    """Extrapolate the last two rotations (W, 2, J, 3, 3) to (W, N, J, 3, 3), by ``steps`` (N,) times the last
    turn, about the same axis."""
    step = rotmat_to_rotvec(product(last_two[:, 1], inverse(last_two[:, 0])))
    turns = rotvec_to_rotmat(step[:, None] * steps[:, None, None])
    return product(turns, np.broadcast_to(last_two[:, 1, None], turns.shape))


def best(errors: Sequence[Array]) -> Array:
    """The decay (N,) with the smallest error at each frame. errors: (N,) for each of :data:`DECAYS`."""
    decays: Array = DECAYS[np.argmin(errors, axis=0)]
    return decays


def by_frame(errors: Array) -> Figures:
    """Errors (N,) at the reported frames, "frame_1" and so on."""
    return {f"frame_{frame}": errors[frame] for frame in REPORTED}


def cells(figures: Figures, digits: int) -> list[str]:
    """Figures by frame as text, empty for NaN."""
    return [f"{value:.{digits}f}" if np.isfinite(value) else "" for value in figures.values()]


@dataclass(frozen=True, eq=False)
class Windows:
    """Parts of motions of figures with the same joints: the last two input frames and the frames to predict.

    rotations (W, 2, J, 3, 3) and translations (W, 2, J, 3): the last two, relative to the parents. last_two (W, 2, J,
    3) and truth (W, N, J, 3): positions in the world.
    """

    skeleton: Skeleton
    rotations: Array
    translations: Array
    last_two: Array
    truth: Array

    @staticmethod
    def of(windows: Sequence[Motion], frames: int) -> "Windows":
        """From motions that end with the ``frames`` to predict; DataError without a motion."""
        if not windows:
            raise DataError("no motion is long enough for a window")
        rows = []
        for motion in windows:
            # the input's last two frames; the truth begins at ``first``
            first = len(motion) - frames
            last = motion[:first][-2:]
            translations = local_translations(last) * skeleton_of(last).unit_factor(0.01)
            rows.append((local_rotations(last), translations, places(last), places(motion[first:])))
        return Windows(skeleton_of(windows[0]), *map(np.stack, zip(*rows, strict=True)))

    @property
    def frames(self) -> int:
        """N."""
        return int(self.truth.shape[1])

    def path(self, decays: Array | float) -> Array:
        """Positions (W, N, 1, 3) of an extrapolated root."""
        return gone_on(self.last_two[:, :, :1], reach(decays, self.frames))

    def turned(self, decays: Array | float) -> Array:
        """Positions (W, N, J, 3) relative to the root of joints whose rotations, and the root's, are extrapolated."""
        # the rotations go on, the root with them, but not its place
        rotations = turned_on(self.rotations, reach(decays, self.frames))
        bones = np.repeat(self.translations[:, 1:], self.frames, axis=1)
        bones[:, :, 0] = 0.0

        # all frames of all windows as one motion
        flat_rotations = rotations.reshape(-1, *rotations.shape[2:])
        flat_bones = bones.reshape(-1, *bones.shape[2:])
        _, joints = chained(self.skeleton, flat_rotations, flat_bones)
        return joints.reshape(bones.shape)

    def moved(self, decays: Array | float) -> Array:
        """Like :meth:`turned`, for joints whose positions relative to the root are extrapolated linearly."""
        relative = self.last_two - self.last_two[:, :, :1]
        return gone_on(relative, reach(decays, self.frames))


RELATIVE: Mapping[str, Callable[[Windows, Array | float], Array]] = {"": Windows.turned, OF_JOINTS: Windows.moved}
"""Suffix of a floor -> its prediction of the joints relative to the root."""


def places(motion: Motion) -> Array:
    """Positions (T, J, 3) of joints in centimetres."""
    return positions(motion) * skeleton_of(motion).unit_factor(0.01)


def apart(predicted: Array, truth: Array) -> tuple[Array, Array]:
    """Mean distances (..., T) of joints (..., T, J, 3) in the world, and relative to the root."""
    difference = predicted - truth
    relative = difference - difference[..., :1, :]
    return length(difference).mean(axis=-1), length(relative).mean(axis=-1)


def floors(windows: Windows, decays: Decays) -> dict[str, Array]:
    """The predictions of all floors: positions (W, N, J, 3)."""
    predictions = {ZERO: windows.moved(0.0) + windows.path(0.0)}
    for suffix, relative in RELATIVE.items():
        path_decays, relative_decays = decays[DAMPED + suffix]
        predictions[CONSTANT + suffix] = relative(windows, 1.0) + windows.path(1.0)
        predictions[DAMPED + suffix] = relative(windows, relative_decays) + windows.path(path_decays)
    return {name: predictions[name] for name in FLOORS}


def chosen(store: Store, held_out: Sequence[str], fps: float, frames: int) -> Decays:
    """The decays that are best on windows of a store's training motions, those that are not ``held_out``.

    First the decays of the joints relative to the root are chosen by the distances relative to it, then those of its
    path by the distances in the world. DataError if no training motion is long enough.
    """
    windows = Windows.of(training_windows(store, held_out, fps, frames), frames)
    decays = {}
    for suffix, relative in RELATIVE.items():
        # decays of the joints relative to the root
        pose_errors = [apart(relative(windows, decay), windows.truth)[1].mean(axis=0) for decay in DECAYS]
        relative_decays = best(pose_errors)

        # decays of its path, with these joints
        joints = relative(windows, relative_decays)
        world_errors = [apart(joints + windows.path(decay), windows.truth)[0].mean(axis=0) for decay in DECAYS]
        decays[DAMPED + suffix] = best(world_errors), relative_decays
    return decays


def training_windows(store: Store, held_out: Sequence[str], fps: float, frames: int) -> list[Motion]:
    """About :data:`MOST_WINDOWS` evenly spaced windows of training motions at ``fps``: two frames and the ``frames`` to
    predict."""
    # adjacent stretches of training motions that are long enough after resampling
    frames_needed = int(np.ceil((frames + 1) * store.fps / fps)) + 1
    stretches = []
    for number, entry in enumerate(store.records):
        if entry.name in held_out:
            continue
        first, last = entry.spans[0]
        for start in range(0, last - first - frames_needed + 1, frames_needed):
            stretches.append((number, start))

    # evenly spaced ones of these, as playable motions at the wanted rate
    playable = named(store.representation).motion
    every = max(1, len(stretches) // MOST_WINDOWS)
    windows = []
    for number, start in stretches[::every]:
        stretch = store.motion(number)[start : start + frames_needed]
        windows.append(playable(stretch).resample(fps, to_end=True)[-frames - 2 :])
    return windows
