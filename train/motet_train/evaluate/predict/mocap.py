"""Predictions of recorded motions: how far each joint is from where it really was, in trials that were held out."""

from collections.abc import Mapping, Sequence

import numpy as np

from motet.models.predict import PredictModel
from motet.motion.kinematics import positions, skeleton_of
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet.representation import named
from motet_train.data.errors import DataError
from motet_train.data.store import Store
from motet_train.evaluate.predict.curves import ZERO
from motet_train.evaluate.predict.protocol import REPORTED
from motet_train.evaluate.predict.protocol_table import error_row, frame_heads
from motet_train.evaluate.tables import Report, aligned

Distances = dict[str, dict[str, Array]]
"""System -> measure -> mean distance (N,) in centimetres at each predicted frame."""

PLACE, POSE = "place_cm", "pose_cm"
"""Of joints in the world, and of joints relative to the root's place."""


def held_out(model: PredictModel, store: Store) -> dict[str, Motion]:
    """By name the motions of a store that the model did not see in training; DataError where none of them is there."""
    test = set(model.manifest.training.get("data", {}).get("test", ()))
    found = {entry.name: number for number, entry in enumerate(store.records) if entry.name in test}
    if not found:
        raise DataError("none of the trials held out in training was found")
    playable = named(store.representation).motion
    return {name: playable(store.motion(number)) for name, number in found.items()}


def distances(models: Mapping[str, PredictModel], motions: Sequence[Motion]) -> Distances:
    """The mean over windows that begin every ``horizon`` frames, of all systems, zero velocity first.

    Models must have the same frame rate, seed and horizon; DataError where the motions are too short.
    """
    first = next(iter(models.values()))
    found: dict[str, list[tuple[Array, Array]]] = {ZERO: [], **{name: [] for name in models}}
    for motion in motions:
        whole = motion.resample(first.fps, to_end=True)
        for start in range(0, len(whole) - first.seed_frames - first.horizon + 1, first.horizon):
            seed = whole[start : start + first.seed_frames]
            truth = _places(whole[start + first.seed_frames :][: first.horizon])
            found[ZERO].append(_distance(_places(seed)[-1:], truth))
            for name, model in models.items():
                found[name].append(_distance(_places(model.predict(seed, frames=first.horizon)), truth))
    if not found[ZERO]:
        raise DataError(f"the motions are shorter than {first.seed_frames + first.horizon} frames at the model's rate")
    means = {name: np.mean(windows, axis=0) for name, windows in found.items()}
    return {name: {PLACE: mean[0], POSE: mean[1]} for name, mean in means.items()}


def _places(motion: Motion) -> Array:
    """Positions (T, J, 3) in centimetres."""
    return positions(motion) * skeleton_of(motion).unit_factor(0.01)


def _distance(found: Array, truth: Array) -> tuple[Array, Array]:
    """Mean distances (T,) of joints in the world and relative to the root."""
    relative = (found - found[:, :1]) - (truth - truth[:, :1])
    world: Array = np.linalg.norm(found - truth, axis=-1).mean(axis=-1)
    return world, np.linalg.norm(relative, axis=-1).mean(axis=-1)


def strips(models: Mapping[str, PredictModel], motion: Motion, every: int) -> dict[str, Array]:
    """One horizon from the middle of a motion: the truth, and each model's prediction, one frame in ``every``.

    Places (K, J, 3) as :func:`motet_train.evaluate.predict.plots.strips_drawing` takes them: the root moves up and down
    only. Models are as above.
    """
    first = next(iter(models.values()))
    whole = motion.resample(first.fps, to_end=True)
    middle = max(first.seed_frames, (len(whole) - first.horizon) // 2)
    found = {"truth": whole[middle:][: first.horizon]}
    found |= {name: model.predict(whole[:middle], frames=first.horizon) for name, model in models.items()}
    return {name: _in_place(positions(predicted)[::every]) for name, predicted in found.items()}


def _in_place(points: Array) -> Array:
    result: Array = points - points[:, :1] * [1, 0, 1]
    return result


def distance_table(found: Distances, fps: float) -> str:
    """The distances as text, one block for each measure."""
    rows = [*frame_heads(), ("milliseconds", *(f"{(frame + 1) / fps * 1000:.0f}" for frame in REPORTED))]
    for measure, title in ((PLACE, "joints in the world, cm"), (POSE, "joints relative to the root, cm")):
        rows += [(title,), *(error_row(name, values[measure], digits=1) for name, values in found.items())]
    return aligned(rows)


def to_json(found: Distances, name: str) -> Report:
    """The distances of one system: measure -> "frame_1" and so on."""
    return {
        measure: {f"frame_{frame}": round(float(error[frame]), 4) for frame in REPORTED}
        for measure, error in found[name].items()
    }
