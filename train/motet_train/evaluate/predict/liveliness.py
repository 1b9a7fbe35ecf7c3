"""What is predicted for half a minute: whether who walked walks on, as fast, as lively, and on feet that stand.

It is asked of recordings, held out in training of predictor and writer, whose end **goes**: in no half second of their
last GIVEN seconds the root's mean speed over the ground is under SLOWEST; those from RUNNING on are runs, the others
walks. The whole recording is given. What follows is measured over SPANS of seconds:

speed: the root's mean speed over the ground, relative to that of the given motion's last GIVEN seconds.
energy: the mean speed of all joints as seen from the root, relative to the same.
slide: how far the balls of the feet slide in a stance (:mod:`motet_train.evaluate.feet`), centimetres.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np
from tqdm import tqdm

from motet.errors import MotionError
from motet.models.generate_codes import CodesModel
from motet.models.predict import PredictModel
from motet.motion.humanoid import HUMANOID, on_humanoid
from motet.motion.kinematics import positions
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet_train.evaluate.feet import slide, stances
from motet_train.evaluate.tables import Report, aligned
from motet_train.evaluate.text_adherence.measures import BALLS

GIVEN = 2.0
"""Seconds of a recording's end by which its pace is known; or all of it, where it is shorter."""

SLOWEST, RUNNING, LEAST = 0.5, 2.0, 1.0
"""m/s; m/s; and seconds that a recording takes at least."""

SPANS = ((0, 1), (1, 5), (5, 30))
"""Seconds after the recording's end."""

NEAR = 0.15
"""The speed is kept where it is within so much of what it was."""

SAMPLES = 3
"""Futures that are compared."""

RECORDED, STILL, ALONE, BEYOND = "recorded", "still", "alone", "beyond"
"""The recordings themselves, standing still, the predictor alone, and with what goes on beyond its horizon."""

TITLES = {
    RECORDED: "the recordings",
    STILL: "standing still",
    ALONE: "{name}, alone",
    BEYOND: "{name}, then the writer",
}

SHOWN = (("speed", ".2f"), ("kept", "4.0%"), ("energy", ".2f"), ("slide_cm", "4.1f"))
"""Figures of the table, and how they are written."""

APART = ("place", "pose")

Figures = dict[str, Report]
"""Group of recordings -> system -> its figures, see :func:`figures`; "samples" is among the systems."""


@dataclass(frozen=True)
class Seen:
    """Positions (T, J, 3) of the humanoid's joints, metres, at so many frames a second."""

    points: Array
    fps: float

    @staticmethod
    def of(motion: Motion) -> "Seen":
        """MotionError for a figure that is no human's."""
        return Seen(positions(motion if motion.skeleton == HUMANOID else on_humanoid(motion)), motion.fps)

    def part(self, start: float, stop: float) -> "Seen":
        """The part between two times in seconds, and the frame before it, where there is one."""
        first, last = round(start * self.fps), round(stop * self.fps)
        return Seen(self.points[max(0, first - 1) : last], self.fps)

    @property
    def paces(self) -> Array:
        """The root's speeds (T - 1,) over the ground, m/s."""
        speeds: Array = np.linalg.norm(np.diff(self.points[:, 0][:, [0, 2]], axis=0), axis=-1) * self.fps
        return speeds

    @property
    def energy(self) -> float:
        """The mean speed of all joints as seen from the root, m/s."""
        moved = np.diff(self.points - self.points[:, :1], axis=0)
        return float(np.linalg.norm(moved, axis=-1).mean() * self.fps)

    @property
    def stances(self) -> list[Array]:
        """Where the balls of the feet are in each of their stances."""
        return stances(self.points[:, BALLS], self.points[:, 0], self.fps)

    def last(self, seconds: float) -> "Seen":
        """The last seconds."""
        return Seen(self.points[-round(seconds * self.fps) - 1 :], self.fps)


def gait(seen: Seen) -> str | None:
    """ "walks" or "runs" for a recording whose end goes, else None."""
    paces = seen.last(GIVEN).paces
    if len(paces) < round(LEAST * seen.fps) - 1:
        return None
    halves = np.array_split(paces, max(1, round(len(paces) / seen.fps / 0.5)))
    if min(half.mean() for half in halves) < SLOWEST:
        return None
    return "runs" if paces.mean() >= RUNNING else "walks"


def going(trials: Mapping[str, Motion], writer: CodesModel) -> dict[str, dict[str, Motion]]:
    """Of "walks" and of "runs" the recordings that go, but for those that the writer was trained on.

    Where the writer says which motions it was tested on, others are left out; pieces count as the whole they are of.
    """
    divided = writer.manifest.training.get("split", {})
    unseen = {name.partition(".")[0] for name in divided.get("test", ())}
    found: dict[str, dict[str, Motion]] = {"walks": {}, "runs": {}}
    for name, motion in trials.items():
        if not unseen or name.partition(".")[0] in unseen:
            kind = gait(Seen.of(motion))
            if kind is not None:
                found[kind][name] = motion
    return found


def measured(model: PredictModel, writer: CodesModel, trials: Mapping[str, Motion]) -> Figures:
    """The figures of the recordings that go; empty where none does, or where none is of a human."""
    try:
        groups = going(trials, writer)
    except MotionError:
        return {}
    return {kind: _group(model, writer, list(motions.values())) for kind, motions in groups.items() if motions}


def _group(model: PredictModel, writer: CodesModel, motions: Sequence[Motion]) -> Report:
    found: dict[str, list[tuple[Seen, Seen]]] = {STILL: [], ALONE: [], BEYOND: []}
    apart, seconds = list[Report](), SPANS[-1][1]
    for motion in tqdm(motions, unit=" motions", disable=None, leave=False):
        whole = motion.resample(model.fps, to_end=True)
        given, count = Seen.of(whole), round(seconds * model.fps)
        alone, beyond = (model.predict(whole, frames=count, beyond=one) for one in (None, writer))
        still = np.repeat(given.points[-1:], count, axis=0)
        for system, points in ((STILL, still), (ALONE, Seen.of(alone).points), (BEYOND, Seen.of(beyond).points)):
            found[system].append((given, Seen(np.concatenate([given.points[-1:], points]), model.fps)))
        apart.append(_apart(model, writer, whole))
    recorded = [(given, given) for given, _ in found[STILL]]
    report = {RECORDED: {"recordings": float(len(motions)), "slide_cm": _slide([given for given, _ in recorded])}}
    report |= {system: figures(pairs) for system, pairs in found.items()}
    report["samples"] = {key: float(np.mean([one["apart"][key] for one in apart])) for key in apart[0]["apart"]}
    return report


def figures(pairs: Sequence[tuple[Seen, Seen]]) -> dict[str, float]:
    """For given motions and what follows each, its first frame the last one given: medians of the speeds and energies
    of each span, the share of motions that keep their speed, and slides."""
    found = {}
    for start, stop in SPANS:
        parts = [(given.last(GIVEN), following.part(start, stop)) for given, following in pairs]
        speeds = np.array([part.paces.mean() / given.paces.mean() for given, part in parts])
        key = f"{start}_{stop}_s"
        found[f"speed_{key}"] = float(np.median(speeds))
        found[f"kept_{key}"] = float(np.mean(np.abs(speeds - 1) <= NEAR))
        found[f"energy_{key}"] = float(np.median([part.energy / given.energy for given, part in parts]))
        found[f"slide_cm_{key}"] = _slide([part for _, part in parts])
    return found


def _slide(parts: Sequence[Seen]) -> float:
    """The mean over all stances, centimetres; NaN without any."""
    return 100 * slide(stance for part in parts for stance in part.stances)


def _apart(model: PredictModel, writer: CodesModel, motion: Motion) -> Report:
    """How far apart joints of different futures are, centimetres, in the world and as seen from the root, at the end of
    the first two spans."""
    seconds = [stop for _, stop in SPANS[:2]]
    frames = round(seconds[-1] * model.fps)
    futures = [Seen.of(one).points for one in model.futures(motion, frames=frames, beyond=writer, samples=SAMPLES)]
    found = {}
    for stop in seconds:
        poses = [points[round(stop * model.fps) - 1] for points in futures]
        for key, seen in zip(APART, (poses, [pose - pose[:1] for pose in poses]), strict=True):
            far = [np.linalg.norm(one - other, axis=-1).mean() for one, other in combinations(seen, 2)]
            found[f"{key}_cm_{stop}_s"] = 100 * float(np.mean(far))
    return {"apart": found}


def alive_table(found: Mapping[str, Figures]) -> str:
    """The figures of several models, by name, as text; "" where there are none."""
    rows: list[tuple[str, ...]] = []
    for kind in dict.fromkeys(kind for figures in found.values() for kind in figures):
        reports = {name: figures[kind] for name, figures in found.items() if kind in figures}
        rows += [*([()] if rows else []), *_rows(kind, reports)]
    return aligned([row or ("",) for row in rows])


def _rows(kind: str, reports: Mapping[str, Report]) -> list[tuple[str, ...]]:
    first = next(iter(reports.values()))
    spans = ", ".join(f"{start}-{stop}" for start, stop in SPANS)
    rows: list[tuple[str, ...]] = [
        (f"{first[RECORDED]['recordings']:.0f} {kind} gone on with; after {spans} s",),
        ("", "speed / given", f"within {NEAR:.0%}", "energy / given", "slide, cm"),
        (f"  {TITLES[RECORDED]}", "", "", "", f"{first[RECORDED]['slide_cm']:.1f}"),
    ]
    for name, report in reports.items():
        for system in (STILL, ALONE, BEYOND) if report is first else (ALONE, BEYOND):
            cells = [_spans(report[system], *one) for one in SHOWN]
            rows.append((f"  {TITLES[system].format(name=Path(name).name)}", *cells))
    for name, report in reports.items():
        far = [", ".join(f"{report['samples'][f'{key}_cm_{stop}_s']:.0f}" for _, stop in SPANS[:2]) for key in APART]
        ends = ", ".join(str(stop) for _, stop in SPANS[:2])
        said = f"{far[0]} in the world, {far[1]} seen from the root"
        rows.append((f"  {Path(name).name}: joints of different futures are apart after {ends} s, cm: {said}",))
    return rows


def _spans(figures: Mapping[str, float], key: str, how: str) -> str:
    return "  ".join(format(figures[f"{key}_{start}_{stop}_s"], how) for start, stop in SPANS)
