"""The protocol by which motion prediction has been measured since Martinez et al. 2017, and its floors.

50 frames in, 25 out, of every second frame of a file. Letters in shapes: W windows, T frames, C columns of a file.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

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
    CMU_LAYOUT,
    CONSTANT_STD,
    OUTPUT_FRAMES,
    PROTOCOL_WINDOW,
    ROOT_COLUMNS,
    SEED_FRAMES,
    STRIDE,
    ExpmapCorpus,
    Layout,
    Scaling,
    scaling_of,
)

Continuation = Callable[[Array], Array]
"""Seed frames (W, 50, C) in the columns of the files to predicted ones (W, 25, C)."""

Predictions = Mapping[str, tuple[Array, Array]]
"""Action -> predicted frames (W, 25, C) and whole true windows (W, 75, C) of all its motions."""


def true_times(fps: float) -> tuple[float, ...]:
    """The times of the reported frames in milliseconds after the last seed frame, for files of ``fps``."""
    return tuple((frame + 1) * STRIDE / fps * 1000 for frame in REPORTED)


def rotmat_to_protocol_euler(matrix: Array) -> Array:
    """Matrices (..., 3, 3) to the protocol's Euler angles (..., 3): Slabaugh's formula on the transposed matrix.

    They are the negative angles of order "xyz" of :func:`motet.motion.rotations.rotmat_to_euler`. At gimbal lock, where
    the last angle is 0 and the first follows from the matrix, the first is 0 or pi, as in the papers' code.
    """
    # at gimbal lock the formula divides by 0
    sin = np.clip(matrix[..., 0, 2], -1.0, 1.0)
    locked = np.abs(sin) >= 1.0
    cos = np.where(locked, 1.0, np.sqrt(1.0 - sin**2))
    first = np.arctan2(matrix[..., 1, 2] / cos, matrix[..., 2, 2] / cos)
    last = np.arctan2(matrix[..., 0, 1] / cos, matrix[..., 0, 0] / cos)
    first = np.where(locked, np.arctan2(matrix[..., 0, 1], matrix[..., 0, 2]), first)
    return np.stack([first, -np.arcsin(sin), np.where(locked, 0.0, last)], axis=-1)


def euler_frames(frames: Array) -> Array:
    """Frames (..., C) of exponential maps to frames (..., C) of Euler angles; the root's six columns become 0."""
    angles = rotmat_to_protocol_euler(rotvec_to_rotmat(_vectors(frames))).reshape(*frames.shape[:-1], -1)
    result = np.zeros(frames.shape)
    result[..., ROOT_COLUMNS:] = angles[..., 3:]
    return result


def _vectors(frames: Array, first: int = 3) -> Array:
    """The exponential maps (..., J, 3) of frames (..., C) from a column on, by default with the root's."""
    return frames[..., first:].reshape(*frames.shape[:-1], -1, 3)


def window_starts(
    lengths: Sequence[int], count: int = 8, first: int = 0, room: int = PROTOCOL_WINDOW
) -> list[tuple[int, int]]:
    """The test windows of an action: the number of a motion of it, and where the window starts.

    One generator draws them from the motions in turn, as all papers since Jain et al. 2016 do (``find_indices_srnn`` of
    their code). lengths: of the motions, in sub-sampled frames. first, room: see
    :class:`motet_train.papers.li2018.expmap.Layout`. DataError for a motion that is too short.
    """
    generator = np.random.RandomState(1234567890)
    starts: list[tuple[int, int]] = []
    for length in lengths:
        if length <= first + room:
            raise DataError(f"a test motion of {length} frames is too short: windows need more than {first + room}")
    for number in range(count):
        motion = number % len(lengths)
        starts.append((motion, int(generator.randint(first, lengths[motion] - room))))
    return starts


def windows(motions: Sequence[Array], count: int = 8, layout: Layout = CMU_LAYOUT) -> Array:
    """The test windows (W, 75, C) of the motions (T, C) of an action, which are at the frame rate of their files."""
    frames = [motion[::STRIDE] for motion in motions]
    starts = window_starts([len(motion) for motion in frames], count, layout.first, layout.room)
    return np.stack([frames[motion][start : start + PROTOCOL_WINDOW] for motion, start in starts])


def window_errors(predicted: Array, truth: Array) -> Array:
    """Euler error (W, 25) of predicted frames (W, 25, C) against whole windows (W, 75, C)."""
    return _euler_errors(predicted, euler_frames(truth))


def _euler_errors(predicted: Array, angles: Array) -> Array:
    # angles that are constant in a window do not count
    counted = angles.std(axis=1, keepdims=True) > CONSTANT_STD
    difference = np.where(counted, euler_frames(predicted) - angles[:, SEED_FRAMES:], 0.0)
    return np.asarray(np.linalg.norm(difference, axis=-1))


def rotation_errors(predicted: Array, truth: Array) -> Array:
    """Angles in degrees (W, 25) between predicted and true rotations: the mean over the joints that move in a window.

    Not part of the protocol, but without the leaps of Euler errors where a joint passes gimbal lock. Arguments as in
    :func:`window_errors`.
    """
    true_vectors = _vectors(truth, ROOT_COLUMNS)
    moving = (true_vectors.std(axis=1, keepdims=True) > CONSTANT_STD).any(axis=-1)
    # the Frobenius norm of the difference of two matrices is sqrt(8) sin(angle / 2)
    difference = rotvec_to_rotmat(_vectors(predicted, ROOT_COLUMNS)) - rotvec_to_rotmat(true_vectors[:, SEED_FRAMES:])
    half_sin = np.linalg.norm(difference, axis=(-2, -1)) / np.sqrt(8)
    angles = 2 * np.degrees(np.arcsin(np.minimum(half_sin, 1.0)))
    return np.asarray((angles * moving).sum(axis=-1) / np.maximum(moving.sum(axis=-1), 1))


def predictions(
    system: Continuation,
    test: Mapping[str, Sequence[Array]],
    scaling: Scaling,
    count: int = 8,
    layout: Layout = CMU_LAYOUT,
) -> Predictions:
    """The predictions for ``count`` windows of each action, which has motions (T, C)."""
    by_action = {}
    for action, motions in test.items():
        truth = scaling.with_constants(windows(motions, count, layout))
        by_action[action] = system(truth[:, :SEED_FRAMES]), truth
    return by_action


def errors(by_action: Predictions, measure: Callable[[Array, Array], Array] = window_errors) -> dict[str, Array]:
    """Error (25,) of each action: the mean over windows."""
    return {action: measure(predicted, truth).mean(axis=0) for action, (predicted, truth) in by_action.items()}


def predictor(name: str, model: PredictModel, corpus: ExpmapCorpus) -> Continuation:
    """A model's predictions for windows of a corpus; DataError if it is a model of other data."""
    if len(model.contract.channels) != corpus.layout.columns or model.contract.skeleton is not None:
        raise DataError(f"{name} is not a model of these files: it has {len(model.contract.channels)} channels")
    return lambda seed: model.next_frames(seed[:, -model.seed_frames :], OUTPUT_FRAMES).astype(np.float64)


def text_floors(corpus: ExpmapCorpus) -> dict[str, Continuation]:
    """Zero, constant and damped velocity; the decays of the last are chosen on the training files."""
    return {ZERO: zero_velocity, CONSTANT: velocity(1.0), DAMPED: velocity(chosen_decays(corpus))}


def zero_velocity(seed: Array) -> Array:
    """The last seed frame, held (W, 25, C): the papers' floor."""
    return np.repeat(seed[:, -1:], OUTPUT_FRAMES, axis=1)


def velocity(decays: Array | float) -> Continuation:
    """Continue the last step of seed frames (W, L, C) as frames (W, 25, C); decays: one, or (25,).

    Exact for rotations: each joint's last turn is repeated about its own axis.
    """
    steps = reach(decays, OUTPUT_FRAMES)

    def go_on(seed: Array) -> Array:
        last = seed[:, -2:]
        vectors = rotmat_to_rotvec(turned_on(rotvec_to_rotmat(_vectors(last)), steps))
        return np.concatenate([gone_on(last[..., :3], steps), vectors.reshape(*vectors.shape[:2], -1)], axis=-1)

    return go_on


def chosen_decays(corpus: ExpmapCorpus) -> Array:
    """The decays (25,) with the smallest Euler error on windows of training files, all actions weighted equally."""
    truths = training_windows(corpus)
    if not truths:
        raise DataError(
            f"no training file has a window of {PROTOCOL_WINDOW} frames, by which damped velocity is chosen"
        )
    angles = [euler_frames(truth) for truth in truths]
    mean_errors = []
    for decay in DECAYS:
        run = velocity(decay)
        by_group = []
        for truth, truth_angles in zip(truths, angles, strict=True):
            by_group.append(_euler_errors(run(truth[:, :SEED_FRAMES]), truth_angles).mean(axis=0))
        mean_errors.append(np.mean(by_group, axis=0))
    return best(mean_errors)


def training_windows(corpus: ExpmapCorpus) -> list[Array]:
    """For each group windows (W, 75, C), eight evenly spaced ones of each training file that is long enough."""
    scaling = scaling_of(corpus.train)
    by_group = []
    for files in corpus.measured().values():
        group_windows = []
        for motion in files.values():
            frames = motion[1::STRIDE]  # a file's first frame can be a T-pose that was added
            if len(frames) >= PROTOCOL_WINDOW:
                starts = np.linspace(0, len(frames) - PROTOCOL_WINDOW, 8).astype(int)
                group_windows.append(frames[starts[:, None] + np.arange(PROTOCOL_WINDOW)])
        if group_windows:
            by_group.append(scaling.with_constants(np.concatenate(group_windows)))
    return by_group
