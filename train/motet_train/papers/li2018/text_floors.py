"""Floors of the protocol's text files: all rotations, and the root's translation, go on as they did."""

from collections.abc import Mapping

import numpy as np

from motet.motion.rotations import Array, rotmat_to_rotvec, rotvec_to_rotmat
from motet_train.data.errors import DataError
from motet_train.evaluate.predict.floors import CONSTANT, DAMPED, DECAYS, ZERO, best, gone_on, reach, turned_on
from motet_train.papers.li2018.expmap_files import ExpmapCorpus, Files, Scaling, scaling_of
from motet_train.papers.li2018.material import STRIDE
from motet_train.papers.li2018.protocol import (
    OUTPUT_FRAMES,
    PROTOCOL_WINDOW,
    SEED_FRAMES,
    Continuation,
    euler_errors,
    euler_frames,
    zero_velocity,
)

TEXT_FLOORS = (ZERO, CONSTANT, DAMPED)

EACH = 8
"""Windows of each training file, evenly spaced, by which the decays of damped velocity are chosen."""


def text_floors(corpus: ExpmapCorpus) -> dict[str, Continuation]:
    """Zero, constant and damped velocity; the decays of the last are chosen on the corpus's training files."""
    return {ZERO: zero_velocity, CONSTANT: velocity(1.0), DAMPED: velocity(chosen(corpus))}


def velocity(decays: Array | float) -> Continuation:
    """Seed frames (W, L, C) to the frames (W, 25, C) in which their last step goes on; decays: one, or (25,).

    Exact on rotations: each joint's last turn is repeated about its own axis. Frames are the text files'.
    """
    steps = reach(decays, OUTPUT_FRAMES)

    def go_on(seed: Array) -> Array:
        last = seed[:, -2:]
        matrices = turned_on(rotvec_to_rotmat(last[..., 3:].reshape(*last.shape[:-1], -1, 3)), steps)
        vectors = rotmat_to_rotvec(matrices)
        turned = vectors.reshape(*vectors.shape[:2], -1)
        return np.concatenate([gone_on(last[..., :3], steps), turned], axis=-1)

    return go_on


def chosen(corpus: ExpmapCorpus) -> Array:
    """The decays (25,) with the smallest Euler error on windows of training files, each action as much as another."""
    measured = {group: files for group, files in corpus.train.items() if group in corpus.test} or corpus.train
    windows = training_windows(measured, scaling_of(corpus.train))
    if not windows:
        raise DataError(
            f"no training file has a window of {PROTOCOL_WINDOW} frames, by which damped velocity is chosen"
        )
    angles = {group: euler_frames(truth) for group, truth in windows.items()}
    return best([_error(velocity(decay), windows, angles) for decay in DECAYS])


def _error(system: Continuation, windows: Mapping[str, Array], angles: Mapping[str, Array]) -> Array:
    """Error (25,): the mean over groups."""
    found = [euler_errors(system(windows[group][:, :SEED_FRAMES]), angles[group]).mean(axis=0) for group in windows]
    return np.asarray(np.mean(found, axis=0))


def training_windows(train: Files, scaling: Scaling) -> dict[str, Array]:
    """Group -> windows (W, 75, C), :data:`EACH` of each file that is long enough; a group without any is left out."""
    found = {}
    for group, files in train.items():
        # a file's first frame can be a T-pose that was added
        long = [frames[1::STRIDE] for frames in files.values() if len(frames[1::STRIDE]) >= PROTOCOL_WINDOW]
        if long:
            found[group] = scaling.with_constants(np.concatenate([_spread(frames) for frames in long]))
    return found


def _spread(frames: Array) -> Array:
    starts = np.linspace(0, len(frames) - PROTOCOL_WINDOW, EACH).astype(int)
    return np.stack([frames[start : start + PROTOCOL_WINDOW] for start in starts])
