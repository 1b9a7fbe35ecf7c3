"""The protocol by which motion prediction has been measured since Martinez et al. 2017, and its floors.

50 frames in, 25 out, of every second frame of a file. Letters in shapes: W windows, T frames, C columns of a file.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from motet.motion.rotations import Array, rotmat_to_rotvec, rotvec_to_rotmat
from motet.predict.model import PredictModel
from motet_train.data.errors import DataError
from motet_train.evaluate.predict.floors import (
    CONSTANT,
    DAMPED,
    DECAYS,
    REPORTED,
    ZERO,
    best,
    gone_on,
    reach,
    turned_on,
)
from motet_train.papers.li2018.expmap import (
    CONSTANT_STD,
    OUTPUT_FRAMES,
    PROTOCOL_WINDOW,
    ROOT_COLUMNS,
    SEED_FRAMES,
    STRIDE,
    ExpmapCorpus,
    Scaling,
    scaling_of,
)

Continuation = Callable[[Array], Array]
"""Seed frames (W, 50, C) in a file's own columns to predicted ones (W, 25, C)."""

Predictions = Mapping[str, tuple[Array, Array]]
"""Action -> predicted frames (W, 25, C) and whole true windows (W, 75, C), of all its motions."""


def true_times(fps: float) -> tuple[float, ...]:
    """The milliseconds after the last seed frame at which the reported frames lie, for files of ``fps``."""
    return tuple((frame + 1) * STRIDE / fps * 1000 for frame in REPORTED)


def rotmat_to_protocol_euler(matrix: Array) -> Array:
    """Matrices (..., 3, 3) to the protocol's Euler angles (..., 3): Slabaugh's formula on the transposed matrix.

    They are the angles of order "xyz" of :func:`motet.motion.rotations.rotmat_to_euler` with the sign changed. At
    gimbal lock, where the last one is 0 and the first should be what the matrix says, it is 0 or pi as in the papers'
    code.
    """
    sin = np.clip(matrix[..., 0, 2], -1.0, 1.0)
    locked = np.abs(sin) >= 1.0
    cos = np.where(locked, 1.0, np.sqrt(1.0 - sin**2))
    first = np.arctan2(matrix[..., 1, 2] / cos, matrix[..., 2, 2] / cos)
    last = np.arctan2(matrix[..., 0, 1] / cos, matrix[..., 0, 0] / cos)
    first = np.where(locked, np.arctan2(matrix[..., 0, 1], matrix[..., 0, 2]), first)
    return np.stack([first, -np.arcsin(sin), np.where(locked, 0.0, last)], axis=-1)


def euler_frames(frames: Array) -> Array:
    """Frames (..., C) of exponential maps to frames (..., C) of Euler angles; the root's six columns become 0."""
    result = np.zeros(frames.shape)
    result[..., ROOT_COLUMNS:] = rotmat_to_protocol_euler(_rotations(frames)).reshape(*frames.shape[:-1], -1)[..., 3:]
    return result


def _rotations(frames: Array) -> Array:
    return rotvec_to_rotmat(frames[..., 3:].reshape(*frames.shape[:-1], -1, 3))


def window_starts(length: int, count: int = 8) -> NDArray[np.int64]:
    """Starts (W,) of the test windows in a motion of ``length`` sub-sampled frames, from the protocol's generator."""
    if length <= PROTOCOL_WINDOW:
        raise DataError(f"a test motion of {length} frames is too short: windows need more than {PROTOCOL_WINDOW}")
    generator = np.random.RandomState(1234567890)
    return np.array([generator.randint(0, length - PROTOCOL_WINDOW) for _ in range(count)], dtype=np.int64)


def windows(motion: Array, count: int = 8) -> Array:
    """The test windows (W, 75, C) of a motion (T, C) at its file's frame rate."""
    frames = motion[::STRIDE]
    return _cut(frames, window_starts(len(frames), count))


def _cut(frames: Array, starts: NDArray[np.int64]) -> Array:
    return np.asarray(frames[starts[:, None] + np.arange(PROTOCOL_WINDOW)])


def window_errors(predicted: Array, truth: Array) -> Array:
    """Euler error (W, 25) of predicted frames (W, 25, C) against whole windows (W, 75, C)."""
    return _euler_errors(predicted, euler_frames(truth))


def _euler_errors(predicted: Array, angles: Array) -> Array:
    counted = angles.std(axis=1, keepdims=True) > CONSTANT_STD
    difference = np.where(counted, euler_frames(predicted) - angles[:, SEED_FRAMES:], 0.0)
    return np.asarray(np.linalg.norm(difference, axis=-1))


def rotation_errors(predicted: Array, truth: Array) -> Array:
    """Degrees (W, 25) between predicted rotations and true ones: the mean over the joints that move in a window.

    Not of the protocol: Euler errors leap where a joint passes gimbal lock, these do not. Arguments as in
    :func:`window_errors`.
    """
    vectors, said = (frames[..., ROOT_COLUMNS:].reshape(*frames.shape[:-1], -1, 3) for frames in (truth, predicted))
    moving = (vectors.std(axis=1, keepdims=True) > CONSTANT_STD).any(axis=-1)
    apart = rotvec_to_rotmat(said) - rotvec_to_rotmat(vectors[:, SEED_FRAMES:])
    half_sin = np.linalg.norm(apart, axis=(-2, -1)) / np.sqrt(8)
    angles = 2 * np.degrees(np.arcsin(np.minimum(half_sin, 1.0)))
    return np.asarray((angles * moving).sum(axis=-1) / np.maximum(moving.sum(axis=-1), 1))


def predictions(
    system: Continuation, test: Mapping[str, Sequence[Array]], scaling: Scaling, count: int = 8
) -> Predictions:
    """What is predicted of ``count`` windows of each motion (T, C) of each action."""
    found = {}
    for action, motions in test.items():
        truth = scaling.with_constants(np.concatenate([windows(motion, count) for motion in motions]))
        found[action] = system(truth[:, :SEED_FRAMES]), truth
    return found


def errors(found: Predictions, measure: Callable[[Array, Array], Array] = window_errors) -> dict[str, Array]:
    """Error (25,) of each action: mean over windows."""
    return {action: measure(predicted, truth).mean(axis=0) for action, (predicted, truth) in found.items()}


def predictor(name: str, model: PredictModel, corpus: ExpmapCorpus) -> Continuation:
    """A model's predictions for windows of a corpus; DataError where it is not one of that corpus."""
    if len(model.contract.channels) != corpus.layout.columns or model.contract.skeleton is not None:
        raise DataError(f"{name} is not a model of these files: it has {len(model.contract.channels)} channels")
    return lambda seed: model.next_frames(seed[:, -model.seed_frames :], OUTPUT_FRAMES).astype(np.float64)


def text_floors(corpus: ExpmapCorpus) -> dict[str, Continuation]:
    """Zero, constant and damped velocity; the decays of the last are chosen on the corpus's training files."""
    return {ZERO: zero_velocity, CONSTANT: velocity(1.0), DAMPED: velocity(chosen_decays(corpus))}


def zero_velocity(seed: Array) -> Array:
    """The last seed frame, held (W, 25, C): the floor that papers have."""
    return np.repeat(seed[:, -1:], OUTPUT_FRAMES, axis=1)


def velocity(decays: Array | float) -> Continuation:
    """Seed frames (W, L, C) to the frames (W, 25, C) in which their last step goes on; decays: one, or (25,).

    Exact on rotations: each joint's last turn is repeated about its own axis.
    """
    steps = reach(decays, OUTPUT_FRAMES)

    def go_on(seed: Array) -> Array:
        last = seed[:, -2:]
        vectors = rotmat_to_rotvec(turned_on(_rotations(last), steps))
        return np.concatenate([gone_on(last[..., :3], steps), vectors.reshape(*vectors.shape[:2], -1)], axis=-1)

    return go_on


def chosen_decays(corpus: ExpmapCorpus) -> Array:
    """The decays (25,) with the smallest Euler error on windows of training files, each action as much as another."""
    pairs = [(truth[:, :SEED_FRAMES], euler_frames(truth)) for truth in training_windows(corpus)]
    if not pairs:
        raise DataError(
            f"no training file has a window of {PROTOCOL_WINDOW} frames, by which damped velocity is chosen"
        )
    tried = map(velocity, DECAYS)
    return best([np.mean([_euler_errors(run(seed), a).mean(axis=0) for seed, a in pairs], axis=0) for run in tried])


def training_windows(corpus: ExpmapCorpus) -> list[Array]:
    """Of each group windows (W, 75, C), eight of each training file that is long enough, evenly spaced."""
    scaling, found = scaling_of(corpus.train), []
    for files in corpus.measured().values():
        # a file's first frame can be a T-pose that was added
        long = [cut for frames in files.values() if len(cut := frames[1::STRIDE]) >= PROTOCOL_WINDOW]
        each = [_cut(frames, np.linspace(0, len(frames) - PROTOCOL_WINDOW, 8).astype(int)) for frames in long]
        found += [scaling.with_constants(np.concatenate(each))] if long else []
    return found
