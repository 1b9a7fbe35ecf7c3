"""Predictions of recorded motions: how far each joint is from where it really was, in trials that were held out, by
kinds of motions; and whether a predictor's errors are what it expects them to be.

Letters in shapes: W windows, N predicted frames.
"""

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import spearmanr

from motet.models.predict import PredictModel
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet.representation.contract import named
from motet_train.data.errors import DataError
from motet_train.data.store import Entry, Store
from motet_train.evaluate.predict.floors import (
    FLOORS,
    REPORTED,
    Decays,
    Windows,
    apart,
    by_frame,
    cells,
    chosen,
    floors,
    key,
    places,
)
from motet_train.evaluate.tables import aligned

TITLES = {"place_cm": "joints in the world, cm", "pose_cm": "joints relative to the root, cm"}
"""Measures, and what tables call them."""

PLACE, POSE = TITLES

COUNTS = ("people", "recordings", "windows")

QUARTERS = ("least expected", "second", "third", "most expected")
"""Of the windows, by what is expected at a frame."""

MOTION_KINDS: Mapping[str, str] = {
    "boxing": "boxing|boxers?|punch|punches|punching|jabs?",
    "dance": "dance|dances|dancing|dancer|charleston|salsa|lambada|macarena|ballet",
    "climbing": "climb|climbs|climbing|climber|ladder",
    "walks and runs": "walk|walks|walking|run|runs|running|jog|jogs|jogging",
}
"""Kind -> its words, fixed before anything was measured by them. An action belongs to the first kind of which a word is
in it, before its first comma; where a record names none, what counts is that half of its sentences have a word of the
kind."""

REST = "everything else"


def kind_of(entry: Entry) -> str:
    """The kind of a record of a store, :data:`REST` where no word fits."""
    texts = [entry.action.partition(",")[0]] if entry.action else entry.sentences
    words = [re.findall(r"[a-z]+", text.lower()) for text in texts]
    for kind, pattern in MOTION_KINDS.items():
        if texts and 2 * sum(any(re.fullmatch(pattern, word) for word in own) for own in words) >= len(texts):
            return kind
    return REST


def by_kind(entries: Sequence[Entry]) -> dict[str, list[Entry]]:
    """The records of each kind that has some, in the order of :data:`MOTION_KINDS`, everything else last."""
    found = {kind: [entry for entry in entries if kind_of(entry) == kind] for kind in (*MOTION_KINDS, REST)}
    return {kind: members for kind, members in found.items() if members}


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
        return np.flatnonzero(np.isin(self.names, [entry.name for entry in entries]))

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


def calibration(expected: Array, true: Array, kinds: Mapping[str, NDArray[np.intp]]) -> dict[str, Any]:
    """Of expected and measured errors (W, N) in centimetres, at the reported frames.

    "ratio": measured over expected, which ought to be 1, of "all" windows and of each of ``kinds``, kind -> numbers of
    its windows. "quarters" of the windows, those with the least expected errors first: the means of both, which ought
    to rise alike. "rank_correlation": Spearman's, NaN where one of the two does not vary.
    """
    groups = {"all": np.arange(len(true)), **kinds}
    order = np.argsort(expected, axis=0, kind="stable")
    both = {"expected_cm": expected, "measured_cm": true}
    rising = {key: np.take_along_axis(errors, order, axis=0) for key, errors in both.items()}
    parts = [part for part in np.array_split(np.arange(len(true)), len(QUARTERS)) if len(part)]
    varied = [np.ptp(one) > 0 and np.ptp(other) > 0 for one, other in zip(expected.T, true.T, strict=True)]
    ranks = [
        spearmanr(*pair).statistic if varies else np.nan
        for varies, *pair in zip(varied, expected.T, true.T, strict=True)
    ]
    return {
        "ratio": {kind: by_frame(true[own].mean(axis=0) / expected[own].mean(axis=0)) for kind, own in groups.items()},
        "quarters": [{key: by_frame(errors[part].mean(axis=0)) for key, errors in rising.items()} for part in parts],
        "rank_correlation": by_frame(np.array(ranks)),
    }


def calibration_rows(found: Mapping[str, Any]) -> list[list[str]]:
    """Rows of a table, after a head with the frames."""
    rows = [["measured mean error over the expected one, joints in the world"]]
    rows += [[f"  {kind}", *cells(ratio, 2)] for kind, ratio in found["ratio"].items()]
    rows.append(["quarters of the windows by the expected error: expected, cm; and measured, cm"])
    for words, quarter in zip(QUARTERS, found["quarters"], strict=False):
        rows += [[f"  {words}: {key.removesuffix('_cm')}", *cells(errors, 2)] for key, errors in quarter.items()]
    rows.append(["correlation of the ranks of expected and measured errors (Spearman)"])
    return [*rows, ["  all windows", *cells(found["rank_correlation"], 2)]]


def mocap_text(reports: Mapping[str, Any], fps: float) -> str:
    """The distances of all motions and of each kind, and the calibration of those that know their errors."""
    first = next(iter(reports.values()))
    times = [f"{(frame + 1) / fps * 1000:.0f}" for frame in REPORTED]
    rows = [["output frame", *map(str, REPORTED)], ["milliseconds", *times]]
    for kind in ("all", *first["kinds"]):
        parts = {name: report["kinds"].get(kind, report) for name, report in reports.items()}
        beside = next(iter(parts.values()))
        rows.append([f"{kind}: " + ", ".join(f"{beside[count]} {count}" for count in COUNTS)])
        for measure in TITLES if kind == "all" else (PLACE,):
            rows.append([TITLES[measure]])
            rows += [[f"  {floor}", *cells(beside[key(floor)][measure], 1)] for floor in FLOORS]
            rows += [[f"  {name}", *cells(part[measure], 1)] for name, part in parts.items()]
    for name, report in reports.items():
        rows += [[name], *calibration_rows(report["calibration"])] if "calibration" in report else []
    return aligned(rows)


def held_out(models: Mapping[str, PredictModel], store: Store) -> dict[Entry, Motion]:
    """The records of a store that all models held out, and their motions; DataError where none of them is there."""
    test = set.intersection(*map(_tested, models.values()))
    playable = named(store.representation).motion
    found = {entry: playable(store.motion(i)) for i, entry in enumerate(store.records) if entry.name in test}
    if not found:
        raise DataError("none of the trials held out in training was found")
    return found


def chosen_decays(models: Mapping[str, PredictModel], store: Store) -> Decays:
    """The decays of damped velocity, from the motions that no model holds out for its test."""
    first, test = next(iter(models.values())), set.union(*map(_tested, models.values()))
    return chosen(store, sorted(test), first.fps, first.horizon)


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
    found = floors(windows, decays)
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
