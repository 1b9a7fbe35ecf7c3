"""How much a generated motion has of what a sentence asks for in numbers, and motions that are made to have that much.

A motion is cut between two acts or strides, its path is turned, and it is played faster or slower, each within bounds;
what it still lacks is drawn again by who made it. Frames are those of the representation ``root_sixd``: T frames, first
the root's velocity forward and to the left and its turn to the left, per second, seen from itself.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from motet.figures.feet.contacts import smoothed
from motet.figures.humanoid import HUMANOID, LEFT_RIGHT, T_POSE, sided
from motet.motion.kinematics import positions
from motet.motion.rotations import Array
from motet.representation.contract import MotionContract
from motet.text.numeric_phrases import Kind, Quantities

TOLERANCE: Mapping[Kind, tuple[float, float]] = {
    "degrees": (0.1, 0.0),
    "metres": (0.1, 0.0),
    "steps": (0.0, 1.0),
    "times": (0.0, 0.0),
    "seconds": (0.0, 0.1),
}
"""By how much a motion may be off: a share of what was asked, and an amount. A pace is always kept."""

QUICKEST = 1.5
"""How much faster, or slower, a motion is played at most."""

STEEPEST = 100.0
"""Degrees a second that are added to a turn at most."""

STRETCH = 1.4
"""How much farther or less far than drawn a motion goes at most."""

Spans = list[tuple[int, int]]
"""From which frame to which one something is done, in the order in which it ends."""


@dataclass(frozen=True, eq=False)
class Seen:
    """A motion (T, J, 3) of the humanoid's joints in metres, y up, and its frame rate."""

    points: Array
    fps: float

    @staticmethod
    def of(contract: MotionContract, frames: Array) -> "Seen":
        """The motion that frames (T, D) are, as drawn."""
        return Seen(positions(contract.motion(frames, plant=False)), contract.fps)

    def pair(self, part: str) -> Array:
        """Positions (T, 2, 3) of the left and the right joint of a part, calm over a tenth of a second."""
        joints = [HUMANOID.index(sided(side, part)) for side in LEFT_RIGHT]
        return smoothed(self.points[:, joints], 0.03, self.fps)

    def joint(self, name: str) -> Array:
        """Positions (T, 3) of a joint, calm like those of pairs."""
        return smoothed(self.points[:, [HUMANOID.index(name)]], 0.03, self.fps)[:, 0]

    @cached_property
    def heading(self) -> Array:
        """Degrees (T,) by which the hips have turned to the left since the first frame."""
        return self._heading("UpperLeg")

    def _heading(self, *parts: str) -> Array:
        places = [self.points[:, [HUMANOID.index(sided(side, part)) for side in LEFT_RIGHT]] for part in parts]
        pairs = [np.subtract(*np.moveaxis(one, 1, 0)) for one in places]
        across = sum(one / np.maximum(np.linalg.norm(one[:, ::2], axis=1), 1e-9)[:, None] for one in pairs)
        found: Array = np.degrees(np.unwrap(np.arctan2(-across[:, 2], across[:, 0])))
        found -= found[0]
        return found

    @property
    def settled(self) -> int:
        """How many frames to keep, of all but the last 0.6 s or more, for the hips to sway against the whole figure at
        the end as they do at the start: in a stride they sway by ten degrees."""
        whole = smoothed(self._heading("UpperLeg", "UpperArm")[:, None, None], 0.15, self.fps)[:, 0, 0]
        sway, length = self.heading - whole, len(self.points)
        first = max(length - round(0.6 * self.fps), length // 2)
        return first + int(np.abs(sway[first:] - sway[0]).argmin()) + 1

    @property
    def brief(self) -> int:
        """Frames in 0.3 s, or half of the motion if that is less."""
        return max(1, min(round(0.3 * self.fps), len(self.points) // 2))

    @cached_property
    def away(self) -> Array:
        """Metres (T,) over the ground from where the hips were at first."""
        path = self.points[:, HUMANOID.index("hips"), ::2]
        found: Array = np.linalg.norm(path - path[0], axis=1)
        return found

    @cached_property
    def soles(self) -> Array:
        """Heights (T, 2) of the lowest joint of each foot above where they are in standing."""
        feet = [self.pair(part)[..., 1] - T_POSE[HUMANOID.index(sided("left", part)), 1] for part in ("Foot", "Toes")]
        found: Array = np.minimum(*feet)
        return found - min(0.0, float(np.percentile(found.min(axis=1), 5)))

    @cached_property
    def steps(self) -> Spans:
        """When a foot is moved over the ground by 15 cm or more."""
        feet, found = self.pair("Foot")[..., ::2], []
        for foot in np.moveaxis(feet, 1, 0):
            fast = np.asarray(np.linalg.norm(np.diff(foot, axis=0), axis=1) * self.fps > 0.4)
            found += [one for one in spells(fast) if np.linalg.norm(foot[one[1]] - foot[one[0]]) >= 0.15]
        return sorted(found, key=lambda one: one[1])

    def done(self, act: str) -> Spans:
        """When an act is done, a value of :data:`motet.text.numeric_phrases.ACTS`."""
        if act in (
            to_and_fro := {"waves": self._waves, "nods": self._nods, "claps": self._claps, "pushups": self._pushups}
        ):
            return sorted(to_and_fro[act](), key=lambda one: one[1])
        flags: NDArray[np.bool_] = getattr(self, f"_{act}")
        columns = flags.reshape(len(flags), -1).T
        return sorted((one for column in columns for one in spells(column)), key=lambda one: one[1])

    @property
    def _jumps(self) -> NDArray[np.bool_]:
        """Flights of 0.1 to 0.9 s, the hips not lower than in standing, but for those that are low beside the highest:
        steps of a walk or a run."""
        low, hips = self.soles.min(axis=1), self.joint("hips")[:, 1] - T_POSE[HUMANOID.index("hips"), 1]
        found = [one for one in spells(low > 0.05) if 0.1 <= (one[1] - one[0]) / self.fps <= 0.9]
        found = [one for one in found if hips[slice(*one)].max() > -0.02]
        highest, kept = max((low[slice(*one)].max() for one in found), default=0.0), np.zeros(len(low), dtype=np.bool_)
        for one in found:
            kept[slice(*one)] = low[slice(*one)].max() >= 0.4 * highest
        return kept

    @property
    def _jacks(self) -> NDArray[np.bool_]:
        up = np.greater(self.pair("Hand")[..., 1], self.pair("UpperArm")[..., 1])
        return np.asarray(up.all(axis=1))

    @property
    def _kicks(self) -> NDArray[np.bool_]:
        return np.asarray(self.soles >= 0.45)

    @property
    def _punches(self) -> NDArray[np.bool_]:
        out = np.linalg.norm((self.pair("Hand") - self.joint("chest")[:, None])[..., ::2], axis=2)
        return np.asarray(np.gradient(out, axis=0) * self.fps >= 2.0)

    @property
    def _dips(self) -> NDArray[np.bool_]:
        return np.asarray(self.joint("hips")[:, 1] < T_POSE[HUMANOID.index("hips"), 1] - 0.2)

    @property
    def _bows(self) -> NDArray[np.bool_]:
        trunk = self.joint("neck") - self.joint("hips")
        return np.asarray(np.degrees(np.arctan2(np.linalg.norm(trunk[:, ::2], axis=1), trunk[:, 1])) >= 25)

    def _waves(self) -> Spans:
        """A hand, higher than its elbow and about as high as the shoulder, goes to one side by 10 cm and back."""
        hands, elbows, shoulders = map(self.pair, ("Hand", "LowerArm", "UpperArm"))
        across = np.subtract(*np.moveaxis(self.pair("UpperLeg"), 1, 0))[:, None]
        beside = ((hands - elbows) * across).sum(axis=2) / np.linalg.norm(across, axis=2)
        up = hands[..., 1] > np.maximum(elbows[..., 1], shoulders[..., 1] - 0.1)
        sides = zip(beside.T, up.T, strict=True)
        return [(a + i, a + j) for one, high in sides for a, b in spells(high) for i, j in strokes(one[a:b], 0.1)]

    def _nods(self) -> Spans:
        """The head is bent forward by 10 degrees, beside the chest, and raised again."""
        ups = [self.joint(top) - self.joint(foot) for top, foot in (("head_end", "head"), ("neck", "chest"))]
        across = np.subtract(*np.moveaxis(self.pair("UpperArm"), 1, 0))
        ahead = np.cross(across, ups[1])
        bent = [np.arctan2((up * ahead).sum(axis=1) / np.linalg.norm(ahead, axis=1), (up * ups[1]).sum(axis=1)
                / np.linalg.norm(ups[1], axis=1)) for up in ups]  # fmt: skip
        return strokes(-np.degrees(bent[0] - bent[1]), 10.0)

    def _claps(self) -> Spans:
        """The hands are brought together by 10 cm, to 25 cm or less between the wrists, and apart again."""
        apart = np.linalg.norm(np.subtract(*np.moveaxis(self.pair("Hand"), 1, 0)), axis=1)
        return [(i, j) for i, j in strokes(apart, 0.1) if apart[i:j].min() < 0.25]

    def _pushups(self) -> Spans:
        """The chest sinks by 12 cm and rises again, over hands on the ground and as low as the hips but for 50 cm."""
        chest, hands = self.joint("chest")[:, 1], self.pair("Hand")[..., 1].max(axis=1)
        level = (hands < 0.3) & (np.abs(chest - self.joint("hips")[:, 1]) < 0.5)
        return [(i, j) for i, j in strokes(chest, 0.12) if level[i:j].all()]

    @cached_property
    def unrest(self) -> Array:
        """How fast (T,) the joints move on average, m/s."""
        steps = np.gradient(smoothed(self.points, 0.05, self.fps), axis=0) * self.fps
        found: Array = np.linalg.norm(steps, axis=2).mean(axis=1)
        return found

    def measured(self, kind: Kind, act: str = "") -> float:
        """How much of a kind there is; NaN for the times of an act that is not counted, and for a pace."""
        if kind == "degrees":
            return float(self.heading[-1])
        if kind in ("steps", "times"):
            return float(len(self.steps if kind == "steps" else self.done(act))) if kind == "steps" or act else np.nan
        return {"metres": float(self.away[-1]), "seconds": len(self.points) / self.fps}.get(kind, np.nan)


def spells(flags: NDArray[np.bool_]) -> Spans:
    """The frames from which to which flags (T,) are true."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]))).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))


def strokes(values: Array, least: float) -> Spans:
    """From which frame to which one values (T,) fall by ``least`` or more from the highest before, and rise by as much
    again; the last need not rise."""
    found, high, low, at, falling = Spans(), -np.inf, np.inf, 0, False
    for i, value in enumerate(values.tolist()):
        if falling:
            low = min(low, value)
            if value - low >= least:
                found, high, at, falling = [*found, (at, i + 1)], value, i, False
        elif value >= high:
            high, at = value, i
        elif high - value >= least:
            low, falling = value, True
    return [*found, (at, len(values))] if falling else found


def enough(seen: Seen, asked: Quantities) -> bool:
    """Whether a motion has as much as was asked, or can be cut, turned and stretched to have it."""
    amounts, counted = asked.amounts, asked.act or "times" not in asked.amounts
    turn, seconds = abs(amounts.get("degrees", 0.0)), len(seen.points) / seen.fps
    return (
        turn <= max(STRETCH * abs(seen.measured("degrees")), STEEPEST * (seconds - 0.6))
        and float(seen.away.max()) >= amounts.get("metres", 0.0) / (STRETCH if "jumps" in asked.act else 1.0)
        and len(seen.steps) >= amounts.get("steps", 0.0)
        and (not counted or not asked.act or len(seen.done(asked.act)) >= amounts.get("times", 0.0))
    )


def fitted(contract: MotionContract, frames: Array, asked: Quantities) -> Array:
    """Frames (T', D) of a motion that is cut, turned and played to have what was asked as far as may be."""
    seen = Seen.of(contract, frames)
    frames = frames[: min(cut(seen, asked, kind) for kind in ("metres", "steps", "times", "degrees"))]
    if "degrees" in asked.amounts:
        seen = Seen.of(contract, frames)
        frames = turned(seen, frames, turn_to_make(seen, asked))
    pace = asked.amounts.get("pace", 1.0)
    if "seconds" in asked.amounts:
        pace = len(frames) / (asked.amounts["seconds"] * contract.fps)
    return played(frames, float(np.clip(pace, 1 / QUICKEST, QUICKEST)))


def cut(seen: Seen, asked: Quantities, kind: Kind) -> int:
    """How many frames of a motion show as much of a kind as was asked: all, where they show no more."""
    length, amount = len(seen.points), asked.amounts.get(kind, np.inf)
    if kind == "degrees":
        over = np.flatnonzero(np.abs(seen.heading) >= abs(amount) + seen.brief)
        wild = abs(seen.measured(kind)) > 2 * abs(amount) + 60
        return int(over[0]) + 1 if len(over) and wild else length
    if kind == "metres":
        return _cut_path(seen, amount)
    spans = seen.steps if kind == "steps" else seen.done(asked.act) if asked.act else []
    if len(spans) <= amount:
        return length
    last, following = spans[int(amount) - 1][1], spans[int(amount)][0]
    if following <= last:  # strides of a run overlap
        return min(last + 1, length)
    return last + int(seen.unrest[last : following + 1].argmin()) + 1


def _cut_path(seen: Seen, metres: float) -> int:
    """The frame near that in which so many metres are reached with the lowest feet: between two strides."""
    reached = np.flatnonzero(seen.away >= metres)
    if not len(reached):
        return len(seen.points)
    there = np.flatnonzero(np.abs(seen.away - metres) <= max(0.05 * metres, abs(seen.away[reached[0]] - metres)))
    first = there[: np.flatnonzero(np.diff(there, append=np.inf) > 1)[0] + 1]
    return max(2, int(first[seen.soles.max(axis=1)[first].argmin()]) + 1)


def turn_to_make(seen: Seen, asked: Quantities) -> float:
    """The degrees that were asked for, to the side to which a motion turns already where either will do."""
    degrees = asked.amounts["degrees"]
    return -degrees if asked.either and seen.measured("degrees") < 0 else degrees


def turned(seen: Seen, frames: Array, degrees: float, *, begins: bool = True, ends: bool = True) -> Array:
    """Frames (T, D) whose turn is made as large as asked: where the motion, as it is seen, turns or goes already.

    begins, ends: whether the motion does with these frames; then it turns neither at once nor at the end. Of a motion
    that goes on, the first frame is the last one before, which stays as it is.
    """
    rates = np.abs(smoothed(frames[:, None, :3], 0.1, seen.fps)[:, 0])
    weight = rates[:, 2] + 0.1 * np.hypot(rates[:, 0], rates[:, 1]) + 0.02
    weight[: seen.brief if begins else 1] = 0
    if ends:
        weight[-seen.brief :] = 0
    bent = frames.copy()
    lacking = np.radians(degrees - seen.measured("degrees"))
    bent[:, 2] += lacking * seen.fps * weight / max(float(weight.sum()), 1e-9)
    return bent


def played(frames: Array, pace: float) -> Array:
    """Frames played so many times as fast; how fast they go and turn follows."""
    if pace == 1 or len(frames) < 2:
        return frames
    count = max(2, round(len(frames) / pace))
    at = np.linspace(0, len(frames) - 1, count)
    low = np.minimum(at.astype(int), len(frames) - 2)
    found: Array = frames[low] + (at - low)[:, None] * (frames[low + 1] - frames[low])
    found[:, :3] *= len(frames) / count
    return found


def short(asked: Mapping[str, float], measured: Mapping[str, float], either: bool) -> list[Kind]:
    """The kinds of which a motion has not as much as was asked, within :data:`TOLERANCE`; a way that is not known is
    never short."""
    found: list[Kind] = []
    for kind, (share, amount) in TOLERANCE.items():
        if kind in measured:
            has = abs(measured[kind]) if either and kind == "degrees" else measured[kind]
            if abs(has - asked[kind]) > share * abs(asked[kind]) + amount + 1e-9:
                found.append(kind)
    return found
