"""Half a minute of prediction: whether a walker walks on as fast, as lively, and on feet that stand.

The measure takes recordings, held out in training of predictor and writer, that still **go** at their end: in no half
second of their last two seconds is the root's mean speed over the ground below .5 m/s. Those of 2 m/s or more are runs,
the others walks. The whole recording is the input. Its continuation is measured over :data:`SPANS`:

speed: the root's mean speed over the ground, relative to that of the last two seconds of the input.
kept: the share of motions whose speed is within 15 % of that.
energy: the mean speed of all joints relative to the root, divided by that of the last two seconds of the input.
slide: how far the balls of the feet slide in a stance (:mod:`motet_train.evaluate.positions`), centimetres.
"""

from collections.abc import Iterable, Mapping, Sequence
from itertools import chain, combinations
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from motet.errors import MotionError
from motet.figures.humanoid import HUMANOID, on_humanoid
from motet.generate.model import CodesModel
from motet.motion.kinematics import positions
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet.predict.model import PredictModel
from motet_train.evaluate.positions import BALLS, length, slide, stances
from motet_train.evaluate.tables import Figures, Report, Reports, aligned, short_names

SPANS = ((0, 1), (1, 5), (5, 30))
"""Seconds after the recording's end."""

KEPT_CHANGE = 0.15
"""Largest relative change of a speed that counts as kept."""

CONTINUED = {"still": "standing still", "alone": "{name}, alone", "beyond": "{name}, then the writer"}
"""System -> its name in tables: standing still, the predictor alone, and with a continuation beyond its horizon."""

Alive = dict[str, Report]
"""Group of recordings -> system -> its figures, see :func:`figures`; "recorded" and "samples" are among the systems."""


Rows = list[Sequence[str]]


class Trajectory(NamedTuple):
    """Positions (T, J, 3) of the humanoid's joints in metres, at ``fps`` frames a second."""

    points: Array
    fps: float

    @staticmethod
    def of(motion: Motion) -> "Trajectory":
        """The joints of a motion; MotionError for a figure that is not human."""
        on_bones = motion if motion.skeleton == HUMANOID else on_humanoid(motion)
        return Trajectory(positions(on_bones), motion.fps)

    def part(self, start: float, stop: float) -> "Trajectory":
        """The part between two times in seconds, with the frame before it if there is one."""
        first = round(start * self.fps)
        last = round(stop * self.fps)
        return Trajectory(self.points[max(0, first - 1) : last], self.fps)

    def end(self) -> "Trajectory":
        """The last two seconds, which define the pace, or all of a shorter one."""
        return Trajectory(self.points[-round(2 * self.fps) - 1 :], self.fps)

    @property
    def relative(self) -> Array:
        """The joints (T, J, 3) relative to the root."""
        return self.points - self.points[:, :1]

    @property
    def paces(self) -> Array:
        """The root's speeds (T - 1,) over the ground, m/s."""
        return length(np.diff(self.points[:, 0][:, [0, 2]], axis=0)) * self.fps

    @property
    def energy(self) -> float:
        """The mean speed of all joints relative to the root, m/s."""
        return float(length(np.diff(self.relative, axis=0)).mean() * self.fps)


def gait(trajectory: Trajectory) -> str | None:
    """ "walks" or "runs" if a recording lasts a second or more and goes at its end, else None."""
    paces = trajectory.end().paces
    if len(paces) < round(trajectory.fps) - 1:
        return None
    # mean speeds of half seconds
    halves = np.array_split(paces, max(1, round(2 * len(paces) / trajectory.fps)))
    if min(half.mean() for half in halves) < 0.5:
        return None
    return "runs" if paces.mean() >= 2.0 else "walks"


def going(trials: Mapping[str, Motion], writer: CodesModel) -> dict[str, dict[str, Motion]]:
    """The recordings that are "walks" and "runs" at their end, without those that the writer was trained on.

    If the writer names its test motions, all others are left out; a piece counts as the recording it was cut from.
    """
    # what the writer has not seen
    split = writer.manifest.training.get("split", {})
    unseen = {name.partition(".")[0] for name in split.get("test", ())}
    groups: dict[str, dict[str, Motion]] = {"walks": {}, "runs": {}}
    for name, motion in trials.items():
        if unseen and name.partition(".")[0] not in unseen:
            continue
        kind = gait(Trajectory.of(motion))
        if kind is not None:
            groups[kind][name] = motion
    return groups


def measured(model: PredictModel, writer: CodesModel, trials: Mapping[str, Motion]) -> Alive:
    """The figures of the recordings that go at their end; empty without any, or if one is not of a human."""
    try:
        groups = going(trials, writer)
    except MotionError:
        return {}
    return {kind: _group(model, writer, list(motions.values())) for kind, motions in groups.items() if motions}


def _group(model: PredictModel, writer: CodesModel, motions: Sequence[Motion]) -> Report:
    inputs = []
    continuations: dict[str, list[Trajectory]] = {system: [] for system in CONTINUED}
    samples = []
    for motion in tqdm(motions, unit=" motions", disable=None, leave=False):
        # the whole recording is the input
        whole = motion.resample(model.fps, to_end=True)
        inputs.append(Trajectory.of(whole))
        for system, trajectory in _continued(model, writer, whole).items():
            continuations[system].append(trajectory)
        samples.append(_sample_distances(model, writer, whole))

    report = {"recorded": {"recordings": float(len(motions)), "slide_cm": _slide(inputs)}}
    for system, trajectories in continuations.items():
        report[system] = figures(list(zip(inputs, trajectories, strict=True)))
    report["samples"] = {}
    for key in samples[0]:
        report["samples"][key] = float(np.mean([sample[key] for sample in samples]))
    return report


def _continued(model: PredictModel, writer: CodesModel, motion: Motion) -> dict[str, Trajectory]:
    """The last frame of a motion and what follows it by each system of :data:`CONTINUED`."""
    # to the end of the last span
    frames = round(SPANS[-1][1] * model.fps)
    last_frame = Trajectory.of(motion).points[-1:]
    alone = model.predict(motion, frames=frames, beyond=None)
    beyond = model.predict(motion, frames=frames, beyond=writer)
    points = {
        "still": np.repeat(last_frame, frames, axis=0),
        "alone": Trajectory.of(alone).points,
        "beyond": Trajectory.of(beyond).points,
    }
    return {system: Trajectory(np.concatenate([last_frame, points[system]]), model.fps) for system in CONTINUED}


def figures(pairs: Sequence[tuple[Trajectory, Trajectory]]) -> Figures:
    """Figures of pairs of an input and its continuation, whose first frame is the input's last: for each span the
    medians of relative speeds and energies, the share of motions that keep their speed, and the slide."""
    report = {}
    for start, stop in SPANS:
        # each input's last seconds, and the part of its continuation in the span
        both = [(recorded.end(), following.part(start, stop)) for recorded, following in pairs]
        speeds = np.array([part.paces.mean() / end.paces.mean() for end, part in both])
        energies = [part.energy / end.energy for end, part in both]
        span = f"{start}_{stop}_s"
        report[f"speed_{span}"] = np.median(speeds)
        report[f"kept_{span}"] = float(np.mean(np.abs(speeds - 1) <= KEPT_CHANGE))
        report[f"energy_{span}"] = np.median(energies)
        report[f"slide_cm_{span}"] = _slide(part for _, part in both)
    return report


def _slide(parts: Iterable[Trajectory]) -> float:
    """The mean over all stances of the balls of the feet, centimetres; NaN without any."""
    every_stance = []
    for part in parts:
        every_stance += stances(part.points[:, BALLS], part.points[:, 0], part.fps)
    return 100 * slide(every_stance)


def _sample_distances(model: PredictModel, writer: CodesModel, motion: Motion) -> Figures:
    """Mean distances between joints of three futures, centimetres, at the end of the first two spans: in the world
    ("place") and relative to the root ("pose")."""
    frames = round(SPANS[1][1] * model.fps)
    # the joints of three futures
    futures = model.futures(motion, frames=frames, beyond=writer, samples=3)
    trajectories = [Trajectory.of(future) for future in futures]
    distances = {}
    for _, stop in SPANS[:2]:
        # the last frame of the span
        frame = round(stop * model.fps) - 1
        places = [trajectory.points[frame] for trajectory in trajectories]
        poses = [trajectory.relative[frame] for trajectory in trajectories]
        distances[f"place_cm_{stop}_s"] = _mean_distance_cm(places)
        distances[f"pose_cm_{stop}_s"] = _mean_distance_cm(poses)
    return distances


def _mean_distance_cm(points: Sequence[Array]) -> float:
    """The mean distance, centimetres, between the same joints (J, 3) of every two of several poses in metres."""
    return 100 * float(np.mean([length(first - second).mean() for first, second in combinations(points, 2)]))


def alive_table(figures: Mapping[str, Alive]) -> str:
    """The figures of several models, by name, as text; "" without any."""
    rows: Rows = []
    for kind in dict.fromkeys(chain.from_iterable(figures.values())):
        reports = {name: groups[kind] for name, groups in figures.items() if kind in groups}
        if rows:
            rows.append([""])
        rows += _rows(kind, dict(zip(short_names(list(reports)), reports.values(), strict=True)))
    return aligned(rows)


def _rows(kind: str, reports: Reports) -> Rows:
    # the head, and the recordings
    recorded = next(iter(reports.values()))["recorded"]
    spans = ", ".join(f"{start}-{stop}" for start, stop in SPANS)
    rows: Rows = [
        [f"{recorded['recordings']:.0f} {kind} continued; after {spans} s"],
        ["", "speed / given", "within 15%", "energy / given", "slide, cm"],
        ["  the recordings", "", "", "", f"{recorded['slide_cm']:.1f}"],
    ]

    # standing still is the same for all models, so only the first has its row
    systems = list(CONTINUED)
    formats = {"speed": ".2f", "kept": "4.0%", "energy": ".2f", "slide_cm": "4.1f"}
    names = [f"{start}_{stop}" for start, stop in SPANS]
    for name, report in reports.items():
        for system in systems:
            cells = [_cell(report[system], key, form, names) for key, form in formats.items()]
            rows.append([f"  {CONTINUED[system].format(name=name)}", *cells])
        systems = systems[-2:]
    return rows + _future_rows(reports)


def _future_rows(reports: Reports) -> Rows:
    """How different several futures are."""
    stops = [str(stop) for _, stop in SPANS[:2]]
    rows: Rows = [["  joints of different futures apart, cm: in the world, seen from the root"]]
    for name, report in reports.items():
        place = _cell(report["samples"], "place_cm", ".0f", stops)
        pose = _cell(report["samples"], "pose_cm", ".0f", stops)
        rows.append([f"  {name} after {', '.join(stops)} s", place, "", pose, ""])
    return rows


def _cell(figures: Figures, key: str, form: str, spans: Sequence[str]) -> str:
    """A figure over several spans."""
    return "  ".join(f"{figures[f'{key}_{span}_s']:{form}}" for span in spans)
