"""Predictions of recorded motions: how far each joint is from where it really was, in trials that were held out."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from motet.models.predict import PredictModel
from motet.motion.kinematics import positions
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet.representation import named
from motet_train.data.errors import DataError
from motet_train.data.store import Entry, Store
from motet_train.evaluate.predict import mocap_floors
from motet_train.evaluate.predict.error_rows import REPORTED
from motet_train.evaluate.predict.mocap_floors import Decays, Windows, apart, places
from motet_train.evaluate.tables import Report

Distances = dict[str, dict[str, Array]]
"""System -> measure -> mean distance (N,) in centimetres at each predicted frame."""

PLACE, POSE = "place_cm", "pose_cm"
"""Of joints in the world, and of joints relative to the root's place."""


@dataclass(frozen=True, eq=False)
class Measured:
    """The distances of all systems in each window, floors first, and the window's recording by name.

    distances: system -> measure -> (W, N) in centimetres. seeds: the frames given, of each window.
    """

    names: tuple[str, ...]
    distances: Mapping[str, Mapping[str, Array]]
    seeds: tuple[Motion, ...]

    def mean(self, among: Collection[str] | None = None) -> Distances:
        """The mean over all windows, or over those of some recordings; DataError where these have none."""
        picked = self.windows(among)
        if not len(picked):
            raise DataError("these recordings have no window")
        return {
            name: {measure: values[picked].mean(axis=0) for measure, values in measures.items()}
            for name, measures in self.distances.items()
        }

    def windows(self, among: Collection[str] | None = None) -> Array:
        """The numbers of the windows of some recordings, or of all."""
        return np.array([n for n, name in enumerate(self.names) if among is None or name in among], dtype=np.intp)


def held_out(models: Mapping[str, PredictModel], store: Store) -> dict[Entry, Motion]:
    """The records of a store that all models held out, and their motions; DataError where none of them is there."""
    tests = [set(model.manifest.training.get("data", {}).get("test", ())) for model in models.values()]
    test = set.intersection(*tests)
    found = {entry: number for number, entry in enumerate(store.records) if entry.name in test}
    if not found:
        raise DataError("none of the trials held out in training was found")
    playable = named(store.representation).motion
    return {entry: playable(store.motion(number)) for entry, number in found.items()}


def chosen_decays(models: Mapping[str, PredictModel], store: Store) -> Decays:
    """The decays of damped velocity, from the motions that no model holds out for its test."""
    first = next(iter(models.values()))
    test = {name for model in models.values() for name in model.manifest.training.get("data", {}).get("test", ())}
    return mocap_floors.chosen(store, sorted(test), first.fps, first.horizon)


def measured(models: Mapping[str, PredictModel], motions: Mapping[str, Motion], decays: Decays) -> Measured:
    """All systems in the windows that begin every ``horizon`` frames, floors first.

    Models must have the same frame rate, seed and horizon; DataError where the motions are too short.
    """
    first = next(iter(models.values()))
    given, horizon = first.seed_frames, first.horizon
    whole = {name: motion.resample(first.fps, to_end=True) for name, motion in motions.items()}
    cut = [
        (name, motion[start : start + given + horizon])
        for name, motion in whole.items()
        for start in range(0, len(motion) - given - horizon + 1, horizon)
    ]
    if not cut:
        raise DataError(f"the motions are shorter than {given + horizon} frames at the model's rate")
    windows, seeds = Windows.of([window for _, window in cut], horizon), [window[:given] for _, window in cut]
    found = mocap_floors.floors(windows, decays)
    for name, model in models.items():
        found[name] = np.stack([places(one) for one in model.predict(seeds, frames=horizon)])
    distances = {
        name: dict(zip((PLACE, POSE), apart(predicted, windows.truth), strict=True))
        for name, predicted in found.items()
    }
    return Measured(tuple(name for name, _ in cut), distances, tuple(seeds))


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


def to_json(found: Distances, name: str) -> Report:
    """The distances of one system: measure -> "frame_1" and so on."""
    return {
        measure: {f"frame_{frame}": round(float(error[frame]), 4) for frame in REPORTED}
        for measure, error in found[name].items()
    }
