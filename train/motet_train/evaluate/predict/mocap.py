"""Predictions of recorded motions: the distance of each joint from its recorded position, in held-out trials, by kind
of motion; and whether a predictor's errors are as large as it expects.

Letters in shapes: W windows, N predicted frames.
"""

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import spearmanr

from motet.bundle.fields import Json
from motet.motion.motion import Motion
from motet.motion.rotations import Array, Indices
from motet.predict.model import PredictModel
from motet.representation.contract import named
from motet_train.data.errors import DataError
from motet_train.data.store import Entry, Store
from motet_train.evaluate.positions import length
from motet_train.evaluate.predict.floors import (
    FLOORS,
    REPORTED,
    ZERO,
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
from motet_train.evaluate.predict.plain_mlp import (
    PLAIN_BONES,
    PLAIN_MLP,
    PlainMLP,
    positions_after,
    trained,
    training_clips,
    with_bones,
)
from motet_train.evaluate.tables import aligned

TITLES = {
    "place_cm": "joints in the world, cm",
    "pose_cm": "joints relative to the root, cm",
    "bones_cm": "change of the bones' lengths, cm",
}
"""Measure -> its title in tables."""

PLACE, POSE, BONES = TITLES

RIVALS = (*FLOORS, PLAIN_MLP, PLAIN_BONES)
"""What models are compared with, in the order of tables."""

Models = Mapping[str, PredictModel]

MOTION_KINDS: Mapping[str, str] = {
    "boxing": "boxing|boxers?|punch|punches|punching|jabs?",
    "dance": "dance|dances|dancing|dancer|charleston|salsa|lambada|macarena|ballet",
    "climbing": "climb|climbs|climbing|climber|ladder",
    "walks and runs": "walk|walks|walking|run|runs|running|jog|jogs|jogging",
}
"""Kind -> its words, fixed before anything was measured by them. An action belongs to the first kind that has a word in
it before its first comma. A record without an action belongs to the first kind with a word in half of its sentences."""

EVERYTHING_ELSE = "everything else"

GOING = 0.5
"""Mean speed of the hips through the seed, m/s, above which a figure is going somewhere."""

ANIMALS = "29"
"""The person of CMU who acts like animals, on the spot or nearly."""


def kind_of(entry: Entry) -> str:
    """The kind of a record of a store, :data:`EVERYTHING_ELSE` if no word matches."""
    # the action if there is one, else what most sentences say
    texts = [entry.action.partition(",")[0]] if entry.action else entry.sentences
    if not texts:
        return EVERYTHING_ELSE
    words = [re.findall(r"[a-z]+", text.lower()) for text in texts]
    for kind, pattern in MOTION_KINDS.items():
        matching = [text_words for text_words in words if any(map(re.compile(pattern).fullmatch, text_words))]
        if 2 * len(matching) >= len(texts):
            return kind
    return EVERYTHING_ELSE


def by_kind(entries: Sequence[Entry]) -> dict[str, list[Entry]]:
    """The records of each kind that has any, in the order of :data:`MOTION_KINDS`, everything else last."""
    kinds = {}
    for kind in (*MOTION_KINDS, EVERYTHING_ELSE):
        members = [entry for entry in entries if kind_of(entry) == kind]
        if members:
            kinds[kind] = members
    return kinds


@dataclass(frozen=True, eq=False)
class Measured:
    """The distances of all systems in each window, floors first.

    names: each window's recording. distances: system -> measure -> (W, N) in centimetres; the floors, and the plain MLP
    if it was trained, before the models. seeds: each window's input. speeds: (W,) of the hips through it on average,
    m/s.
    """

    names: tuple[str, ...]
    distances: Mapping[str, Mapping[str, Array]]
    seeds: tuple[Motion, ...]
    speeds: Array

    def windows(self, entries: Collection[Entry]) -> Indices:
        """The indices of the windows of some recordings."""
        return np.flatnonzero(np.isin(self.names, [entry.name for entry in entries]))

    def by_going(self, entries: Sequence[Entry]) -> dict[str, Indices]:
        """The indices of the windows that begin on the way somewhere, of the others by :data:`ANIMALS`, and of the
        rest; only those that there are."""
        going = self.speeds > GOING
        animal = np.isin(self.names, [entry.name for entry in entries if entry.subject == ANIMALS])
        parts = {"going": going, "animals": animal & ~going, "others": ~animal & ~going}
        return {name: np.flatnonzero(part) for name, part in parts.items() if part.any()}

    def part(self, name: str, entries: Sequence[Entry], windows: Indices) -> Json:
        """The figures of a system, and of floors by their names, in some windows of recordings."""
        # how much is measured, then the system and the floors
        names = {self.names[window] for window in windows.tolist()}
        people = {entry.subject for entry in entries if entry.name in names}
        counts = {"people": len(people), "recordings": len(names), "windows": len(windows)}
        figures: dict[str, Any] = {**counts, **self._means(name, windows)}
        for floor in RIVALS:
            if floor in self.distances:
                figures[key(floor)] = self._means(floor, windows)
        # and how often standing still is nearer in the end
        last = self.distances[name][PLACE][windows, REPORTED[-1]]
        figures["behind_standing"] = (last > self.distances[ZERO][PLACE][windows, REPORTED[-1]]).mean()
        return figures

    def _means(self, system: str, windows: Indices) -> Json:
        """Measure -> a system's mean distances at the reported frames in some windows."""
        return {measure: by_frame(errors[windows].mean(axis=0)) for measure, errors in self.distances[system].items()}


def mocap_report(models: Models, results: Measured, trials: Sequence[Entry]) -> Json:
    """The figures of each model: mean distances of joints in the world, "place_cm", and relative to the root,
    "pose_cm", in all windows, those of the floors, and both by "kinds" of motions; and for models that predict their
    errors the "calibration"."""
    # the kinds of trials that have windows, and those of windows
    kinds = by_kind([entry for entry in trials if entry.name in results.names])
    kind_windows = {kind: results.windows(members) for kind, members in kinds.items()} | results.by_going(trials)
    reports: dict[str, Any] = {}
    for name, model in models.items():
        reports[name] = results.part(name, trials, results.windows(trials))
        parts = {kind: results.part(name, trials, windows) for kind, windows in kind_windows.items()}
        reports[name]["kinds"] = parts
        if model.knows_errors:
            expected = model.expected_errors(results.seeds).astype(np.float64)
            true = results.distances[name][PLACE]
            reports[name]["calibration"] = calibration(expected, true, kind_windows)
    return reports


def calibration(expected: Array, true: Array, kinds: Mapping[str, Indices]) -> Json:
    """Expected and measured errors (W, N) in centimetres, compared at the reported frames.

    "ratio": measured over expected, ideally 1, in "all" windows and in each of ``kinds``, kind -> indices of its
    windows. "rank_correlation": Spearman's, NaN where one of the two is constant.
    """
    ratios = {}
    for kind, windows in {"all": np.arange(len(true)), **kinds}.items():
        ratios[kind] = by_frame(true[windows].mean(axis=0) / expected[windows].mean(axis=0))
    return {"ratio": ratios, "rank_correlation": by_frame(_rank_correlations(expected, true))}


def _rank_correlations(expected: Array, true: Array) -> Array:
    """Spearman's correlation (N,) at each frame of two errors (W, N), NaN where one of the two is constant."""
    correlations = []
    for errors in zip(expected.T, true.T, strict=True):
        varies = np.ptp(errors, axis=1).all()
        correlations.append(spearmanr(*errors).statistic if varies else np.nan)
    return np.array(correlations)


def calibration_rows(figures: Json) -> list[list[str]]:
    """Rows of a table, after a head with the frames."""
    # ratios by kind, and ranks
    rows = [["measured mean error over the expected one, joints in the world"]]
    for kind, ratio in figures["ratio"].items():
        rows.append([f"  {kind}", *cells(ratio, 2)])
    rows.append(["correlation of the ranks of expected and measured errors (Spearman)"])
    rows.append(["  all windows", *cells(figures["rank_correlation"], 2)])
    return rows


def mocap_text(reports: Json, fps: float) -> str:
    """The distances in all motions and in each kind, and the calibration of models that predict their errors."""
    # the head: frames and their times
    milliseconds = [f"{(frame + 1) / fps * 1000:.0f}" for frame in REPORTED]
    rows = [["output frame", *map(str, REPORTED)], ["milliseconds", *milliseconds]]

    first = next(iter(reports.values()))
    for kind in ("all", *first["kinds"]):
        parts = {name: report["kinds"].get(kind, report) for name, report in reports.items()}
        rows += _kind_rows(kind, parts)

    # whether models know their errors
    for name, report in reports.items():
        if "calibration" in report:
            rows += [[name], *calibration_rows(report["calibration"])]
    return aligned(rows)


def _kind_rows(kind: str, parts: Json) -> list[list[str]]:
    """The rows of a kind of motions; floors and counts are the same for all models."""
    first = next(iter(parts.values()))
    counts = ", ".join(f"{first[count]} {count}" for count in ("people", "recordings", "windows"))
    # measure after measure: floors, then models
    rows = [[f"{kind}: {counts}"]]
    for measure in TITLES if kind == "all" else (PLACE,):
        rows.append([TITLES[measure]])
        for floor in RIVALS:
            if key(floor) in first:
                rows.append([f"  {floor}", *cells(first[key(floor)][measure], 1)])
        for name, part in parts.items():
            rows.append([f"  {name}", *cells(part[measure], 1)])
    for name, part in parts.items():
        rows.append([f"  windows in which {name} ends behind standing still: {part['behind_standing']:.0%}"])
    return rows


def held_out(models: Models, store: Store) -> dict[Entry, Motion]:
    """The records of a store that all models held out, and their motions; DataError if the store has none of them."""
    test = set.intersection(*map(_tested, models.values()))
    playable = named(store.representation).motion
    motions = {entry: playable(store.motion(i)) for i, entry in enumerate(store.records) if entry.name in test}
    if not motions:
        raise DataError("none of the trials held out in training was found")
    return motions


def chosen_decays(models: Models, store: Store) -> Decays:
    """The decays of damped velocity, chosen on the motions that no model holds out for its test."""
    first = next(iter(models.values()))
    test = set.union(*map(_tested, models.values()))
    return chosen(store, sorted(test), first.fps, first.horizon)


def _tested(model: PredictModel) -> set[str]:
    return set(model.manifest.training.get("data", {}).get("test", ()))


def plain_mlp(models: Models, store: Store) -> PlainMLP:
    """The plain MLP, trained on the motions of a store that no model holds out, for the seed and horizon of the
    first."""
    first = next(iter(models.values()))
    held = set.union(*map(_held, models.values()))
    if store.fps != first.fps:
        raise DataError(f"the plain MLP needs data at {first.fps:g} fps, as the model, not {store.fps:g}")
    return trained(training_clips(store, sorted(held)), first.seed_frames, first.horizon)


def _held(model: PredictModel) -> set[str]:
    return _tested(model) | set(model.manifest.training.get("data", {}).get("validation", ()))


def measured(
    models: Models,
    motions: Mapping[str, Motion],
    decays: Decays,
    rival: PlainMLP | None = None,
) -> Measured:
    """All systems in the windows that begin every ``horizon`` frames, floors first, then the plain MLP if there is one.

    All models must have the same frame rate, seed and horizon; DataError if the motions are too short.
    """
    first = next(iter(models.values()))
    # floors and models predict the same windows
    names, windows = _cut(motions, first)
    seeds = [window[: first.seed_frames] for window in windows]
    recorded = Windows.of(windows, first.horizon)
    predictions = floors(recorded, decays)
    if rival is not None:
        predictions |= _by_plain_mlp(rival, seeds)
    for name, model in models.items():
        predictions[name] = np.stack([places(motion) for motion in model.predict(seeds, frames=first.horizon)])

    parents = recorded.skeleton.parents
    distances = {name: distances_of(predicted, recorded.truth, parents) for name, predicted in predictions.items()}
    return Measured(tuple(names), distances, tuple(seeds), _speeds(seeds))


def _by_plain_mlp(rival: PlainMLP, seeds: Sequence[Motion]) -> dict[str, Array]:
    """Its predictions (W, N, J, 3) in centimetres, as they are and with bones at their lengths."""
    seed_places = np.stack(list(map(places, seeds)))
    points = positions_after(rival, seed_places / 100)
    return {PLAIN_MLP: 100 * points, PLAIN_BONES: 100 * with_bones(points)}


def distances_of(predicted: Array, truth: Array, parents: Indices) -> dict[str, Array]:
    """How far predicted joints (W, N, J, 3) are from recorded ones, by measure."""
    in_world, relative = apart(predicted, truth)
    bones = _lengths(predicted, parents) - _lengths(truth, parents)
    return {PLACE: in_world, POSE: relative, BONES: abs(bones).mean(axis=-1)}


def _lengths(joints: Array, parents: Indices) -> Array:
    """The lengths (..., J - 1) of the bones between joints (..., J, 3)."""
    return length(joints[..., 1:, :] - joints[..., parents[1:], :])


def _speeds(seeds: Sequence[Motion]) -> Array:
    """The mean speeds (W,) of the hips through seeds, m/s."""
    steps = [places(seed[:: len(seed) - 1])[:, 0] for seed in seeds]
    seconds = (len(seeds[0]) - 1) / seeds[0].fps
    return length(np.diff(steps, axis=1)[:, 0]) / 100 / seconds


def _cut(motions: Mapping[str, Motion], model: PredictModel) -> tuple[list[str], list[Motion]]:
    """The windows of a model's seed and horizon in motions, one every horizon, and the motion of each."""
    frames = model.seed_frames + model.horizon
    names = []
    windows = []
    for name, motion in motions.items():
        whole = motion.resample(model.fps, to_end=True)
        for start in range(0, len(whole) - frames + 1, model.horizon):
            names.append(name)
            windows.append(whole[start : start + frames])
    if not windows:
        raise DataError(f"the motions are shorter than {frames} frames at the model's rate")
    return names, windows


def shown(models: Models, motion: Motion) -> dict[str, Motion]:
    """One horizon from the middle of a motion: the truth, and each model's prediction, with models as in
    :func:`measured`."""
    first = next(iter(models.values()))
    whole = motion.resample(first.fps, to_end=True)
    middle = max(first.seed_frames, (len(whole) - first.horizon) // 2)
    motions = {"truth": whole[middle:][: first.horizon]}
    for name, model in models.items():
        motions[name] = model.predict(whole[:middle], frames=first.horizon)
    return motions
