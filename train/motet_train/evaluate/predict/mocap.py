"""Predictions of recorded motions: how far each joint is from where it really was, in trials that were held out."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motet.models.predict import PredictModel
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet.representation.contract import named
from motet_train.data.errors import DataError
from motet_train.data.store import Entry, Store
from motet_train.evaluate.predict import mocap_floors
from motet_train.evaluate.predict.calibration import calibration, calibration_rows
from motet_train.evaluate.predict.floors import FLOORS, key
from motet_train.evaluate.predict.frames import REPORTED, by_frame, cells
from motet_train.evaluate.predict.kinds import by_kind
from motet_train.evaluate.predict.mocap_floors import Decays, Windows, apart, places
from motet_train.evaluate.tables import aligned

TITLES = {"place_cm": "joints in the world, cm", "pose_cm": "joints relative to the root, cm"}
"""Measures, and what tables call them."""

PLACE, POSE = TITLES

COUNTS = ("people", "recordings", "windows")


@dataclass(frozen=True, eq=False)
class Measured:
    """The distances of all systems in each window, floors first, and the window's recording by name.

    distances: system -> measure -> (W, N) in centimetres. seeds: the frames given, of each window.
    """

    names: tuple[str, ...]
    distances: Mapping[str, Mapping[str, Array]]
    seeds: tuple[Motion, ...]

    def windows(self, entries: Collection[Entry]) -> NDArray[np.intp]:
        """The numbers of the windows of some recordings."""
        among = {entry.name for entry in entries}
        return np.array([n for n, name in enumerate(self.names) if name in among], dtype=np.intp)

    def part(self, name: str, entries: Sequence[Entry]) -> dict[str, Any]:
        """The figures of a system, and of floors by their names, in the windows of some recordings."""
        own = self.windows(entries)

        def means(system: str) -> dict[str, Any]:
            return {measure: by_frame(errors[own].mean(axis=0)) for measure, errors in self.distances[system].items()}

        counts = dict(zip(COUNTS, (len({entry.subject for entry in entries}), len(entries), len(own)), strict=True))
        return {**counts, **means(name), **{key(floor): means(floor) for floor in FLOORS}}


def mocap_report(models: Mapping[str, PredictModel], found: Measured, trials: Sequence[Entry]) -> dict[str, Any]:
    """The figures of each model: mean distances of joints in the world, "place_cm", and relative to the root,
    "pose_cm", in all windows, of floors by their names, by "kinds" of motions; and the "calibration" of one that knows
    its errors."""
    kinds = by_kind([entry for entry in trials if entry.name in found.names])
    reports: dict[str, Any] = {}
    for name, model in models.items():
        reports[name] = found.part(name, trials)
        reports[name]["kinds"] = {kind: found.part(name, members) for kind, members in kinds.items()}
        if model.knows_errors:
            expected, own = model.expected_errors(found.seeds), found.distances[name][PLACE]
            windows = {kind: found.windows(members) for kind, members in kinds.items()}
            reports[name]["calibration"] = calibration(expected.astype(np.float64), own, windows)
    return reports


def mocap_text(reports: Mapping[str, Any], fps: float) -> str:
    """The distances of all motions and of each kind, and the calibration of those that know their errors."""
    first = next(iter(reports.values()))
    times = [f"{(frame + 1) / fps * 1000:.0f}" for frame in REPORTED]
    rows = [["output frame", *map(str, REPORTED)], ["milliseconds", *times]]
    for kind in ("all", *first["kinds"]):
        parts = {name: report["kinds"].get(kind, report) for name, report in reports.items()}
        beside = next(iter(parts.values()))
        rows.append([f"{kind}: " + ", ".join(f"{beside[count]} {count}" for count in COUNTS)])
        for measure, title in TITLES.items() if kind == "all" else [(PLACE, TITLES[PLACE])]:
            rows.append([title])
            rows += [[f"  {floor}", *cells(beside[key(floor)][measure], 1)] for floor in FLOORS]
            rows += [[f"  {name}", *cells(part[measure], 1)] for name, part in parts.items()]
    for name, report in reports.items():
        rows += [[name], *calibration_rows(report["calibration"])] if "calibration" in report else []
    return aligned(rows)


def held_out(models: Mapping[str, PredictModel], store: Store) -> dict[Entry, Motion]:
    """The records of a store that all models held out, and their motions; DataError where none of them is there."""
    test = set.intersection(*(_tested(model) for model in models.values()))
    found = {entry: number for number, entry in enumerate(store.records) if entry.name in test}
    if not found:
        raise DataError("none of the trials held out in training was found")
    playable = named(store.representation).motion
    return {entry: playable(store.motion(number)) for entry, number in found.items()}


def chosen_decays(models: Mapping[str, PredictModel], store: Store) -> Decays:
    """The decays of damped velocity, from the motions that no model holds out for its test."""
    first = next(iter(models.values()))
    test = set.union(*(_tested(model) for model in models.values()))
    return mocap_floors.chosen(store, sorted(test), first.fps, first.horizon)


def _tested(model: PredictModel) -> set[str]:
    return set(model.manifest.training.get("data", {}).get("test", ()))


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
        name: dict(zip(TITLES, apart(predicted, windows.truth), strict=True)) for name, predicted in found.items()
    }
    return Measured(tuple(name for name, _ in cut), distances, tuple(seeds))


def shown(models: Mapping[str, PredictModel], motion: Motion) -> dict[str, Motion]:
    """One horizon from the middle of a motion: the truth, and each model's prediction. Models are as above."""
    first = next(iter(models.values()))
    whole = motion.resample(first.fps, to_end=True)
    middle = max(first.seed_frames, (len(whole) - first.horizon) // 2)
    found = {name: model.predict(whole[:middle], frames=first.horizon) for name, model in models.items()}
    return {"truth": whole[middle:][: first.horizon], **found}
