"""What is predicted for half a minute: whether who walked walks on, as fast, as lively, and on feet that stand.

It is asked of recordings, held out in training of predictor and writer, whose end **goes**: in no half second of their
last two the root's mean speed over the ground is under .5 m/s; those from 2 m/s on are runs, the others walks. The
whole recording is given. What follows is measured over :data:`SPANS`:

speed: the root's mean speed over the ground, relative to that of the given motion's last two seconds.
kept: the share of motions whose speed is within 15 % of that.
energy: the mean speed of all joints as seen from the root, relative to the same.
slide: how far the balls of the feet slide in a stance (:mod:`motet_train.evaluate.positions`), centimetres.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from tqdm import tqdm

from motet.errors import MotionError
from motet.models.generate_codes import CodesModel
from motet.models.predict import PredictModel
from motet.motion.humanoid import HUMANOID, on_humanoid
from motet.motion.kinematics import positions
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet_train.evaluate.positions import BALLS, length, slide, stances
from motet_train.evaluate.tables import Report, aligned, short_names

SPANS = ((0, 1), (1, 5), (5, 30))
"""Seconds after the recording's end."""

CONTINUED = {"still": "standing still", "alone": "{name}, alone", "beyond": "{name}, then the writer"}
"""Standing still, the predictor alone, and with what continues beyond its horizon; and what tables call them."""

Figures = dict[str, Report]
"""Group of recordings -> system -> its figures, see :func:`figures`; "recorded" and "samples" are among the systems."""


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

    def end(self) -> "Seen":
        """The last two seconds, by which the pace is known; or all of it, where it is shorter."""
        return Seen(self.points[-round(2 * self.fps) - 1 :], self.fps)

    @property
    def paces(self) -> Array:
        """The root's speeds (T - 1,) over the ground, m/s."""
        return length(np.diff(self.points[:, 0][:, [0, 2]], axis=0)) * self.fps

    @property
    def energy(self) -> float:
        """The mean speed of all joints as seen from the root, m/s."""
        return float(length(np.diff(self.points - self.points[:, :1], axis=0)).mean() * self.fps)


def gait(seen: Seen) -> str | None:
    """ "walks" or "runs" for a recording of a second at least whose end goes, else None."""
    paces = seen.end().paces
    if len(paces) < round(seen.fps) - 1:
        return None
    halves = np.array_split(paces, max(1, round(2 * len(paces) / seen.fps)))
    if min(half.mean() for half in halves) < 0.5:
        return None
    return "runs" if paces.mean() >= 2.0 else "walks"


def going(trials: Mapping[str, Motion], writer: CodesModel) -> dict[str, dict[str, Motion]]:
    """Of "walks" and of "runs" the recordings that go, but for those that the writer was trained on.

    Where the writer says which motions it was tested on, others are left out; pieces count as the whole they are of.
    """
    divided = writer.manifest.training.get("split", {})
    unseen = {name.partition(".")[0] for name in divided.get("test", ())}
    asked = {name: motion for name, motion in trials.items() if not unseen or name.partition(".")[0] in unseen}
    kinds = {name: gait(Seen.of(motion)) for name, motion in asked.items()}
    return {kind: {name: asked[name] for name in asked if kinds[name] == kind} for kind in ("walks", "runs")}


def measured(model: PredictModel, writer: CodesModel, trials: Mapping[str, Motion]) -> Figures:
    """The figures of the recordings that go; empty where none does, or where none is of a human."""
    try:
        groups = going(trials, writer)
    except MotionError:
        return {}
    return {kind: _group(model, writer, list(motions.values())) for kind, motions in groups.items() if motions}


def _group(model: PredictModel, writer: CodesModel, motions: Sequence[Motion]) -> Report:
    found: dict[str, list[tuple[Seen, Seen]]] = {system: [] for system in CONTINUED}
    samples, count = list[dict[str, float]](), round(SPANS[-1][1] * model.fps)
    for motion in tqdm(motions, unit=" motions", disable=None, leave=False):
        whole = motion.resample(model.fps, to_end=True)
        given = Seen.of(whole)
        alone, beyond = (Seen.of(model.predict(whole, frames=count, beyond=one)).points for one in (None, writer))
        still = np.repeat(given.points[-1:], count, axis=0)
        for system, points in zip(CONTINUED, (still, alone, beyond), strict=True):
            found[system].append((given, Seen(np.concatenate([given.points[-1:], points]), model.fps)))
        samples.append(_apart(model, writer, whole))
    recorded = {"recordings": float(len(motions)), "slide_cm": _slide(given for given, _ in found["still"])}
    means = {key: float(np.mean([one[key] for one in samples])) for key in samples[0]}
    return {"recorded": recorded, **{system: figures(pairs) for system, pairs in found.items()}, "samples": means}


def figures(pairs: Sequence[tuple[Seen, Seen]]) -> dict[str, float]:
    """For given motions and what follows each, its first frame the last one given: medians of the speeds and energies
    of each span, the share of motions that keep their speed, and slides."""
    found = {}
    for start, stop in SPANS:
        parts = [(given.end(), following.part(start, stop)) for given, following in pairs]
        speeds = np.array([part.paces.mean() / given.paces.mean() for given, part in parts])
        key = f"{start}_{stop}_s"
        found[f"speed_{key}"] = float(np.median(speeds))
        found[f"kept_{key}"] = float(np.mean(np.abs(speeds - 1) <= 0.15))
        found[f"energy_{key}"] = float(np.median([part.energy / given.energy for given, part in parts]))
        found[f"slide_cm_{key}"] = _slide(part for _, part in parts)
    return found


def _slide(parts: Iterable[Seen]) -> float:
    """The mean over all stances of the balls of the feet, centimetres; NaN without any."""
    stood = [stances(part.points[:, BALLS], part.points[:, 0], part.fps) for part in parts]
    return 100 * slide(stance for places in stood for stance in places)


def _apart(model: PredictModel, writer: CodesModel, motion: Motion) -> dict[str, float]:
    """How far apart joints of three futures are, centimetres, at the end of the first two spans: in the world ("place")
    and as seen from the root ("pose")."""
    frames, found = round(SPANS[1][1] * model.fps), {}
    futures = [Seen.of(one).points for one in model.futures(motion, frames=frames, beyond=writer, samples=3)]
    for _, stop in SPANS[:2]:
        poses = [points[round(stop * model.fps) - 1] for points in futures]
        for key, seen in (("place", poses), ("pose", [pose - pose[:1] for pose in poses])):
            found[f"{key}_cm_{stop}_s"] = 100 * float(np.mean([length(a - b).mean() for a, b in combinations(seen, 2)]))
    return found


def alive_table(found: Mapping[str, Figures]) -> str:
    """The figures of several models, by name, as text; "" where there are none."""
    rows: list[Sequence[str]] = []
    for kind in dict.fromkeys(kind for figures in found.values() for kind in figures):
        shown = {name: figures[kind] for name, figures in found.items() if kind in figures}
        rows += [[""]] if rows else []
        rows += _rows(kind, dict(zip(short_names(list(shown)), shown.values(), strict=True)))
    return aligned(rows)


def _rows(kind: str, reports: Mapping[str, Report]) -> list[Sequence[str]]:
    written = {"speed": ".2f", "kept": "4.0%", "energy": ".2f", "slide_cm": "4.1f"}
    recorded = next(iter(reports.values()))["recorded"]
    rows: list[Sequence[str]] = [
        [f"{recorded['recordings']:.0f} {kind} continued; after {', '.join(f'{a}-{b}' for a, b in SPANS)} s"],
        ["", "speed / given", "within 15%", "energy / given", "slide, cm"],
        ["  the recordings", "", "", "", f"{recorded['slide_cm']:.1f}"],
    ]
    for number, (name, report) in enumerate(reports.items()):
        for system in list(CONTINUED)[min(number, 1) :]:
            own = report[system]
            cells = ["  ".join(f"{own[f'{key}_{a}_{b}_s']:{how}}" for a, b in SPANS) for key, how in written.items()]
            rows.append([f"  {CONTINUED[system].format(name=name)}", *cells])
    rows.append(["  joints of different futures apart, cm: in the world, seen from the root"])
    for name, report in reports.items():
        far = [f"{report['samples'][f'{key}_cm_{stop}_s']:.0f}" for key in ("place", "pose") for _, stop in SPANS[:2]]
        rows.append([f"  {name} after {SPANS[0][1]}, {SPANS[1][1]} s", "  ".join(far[:2]), "", "  ".join(far[2:]), ""])
    return rows
