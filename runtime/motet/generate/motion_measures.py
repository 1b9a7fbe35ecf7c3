"""Measures of a generated motion, in the units of the numbers of sentences, and motions fitted to such numbers.

A motion is cut between two acts or strides, its path is turned, and it is played faster or slower, each within bounds;
a motion that is still short is drawn again by its caller. Frames are those of the representation ``root_sixd``: T
frames, first the root's velocity forward and to the left and its turn to the left, per second, seen from itself.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from motet.decode.loop import Flags
from motet.figures.feet.contacts import smoothed
from motet.figures.humanoid import HUMANOID, LEFT_RIGHT, T_POSE, sided
from motet.motion.kinematics import positions
from motet.motion.rotations import Array
from motet.representation.contract import MotionContract
from motet.text.numeric_phrases import Kind, Quantities

NUMBER_TOLERANCES: Mapping[Kind, tuple[float, float]] = {
    "degrees": (0.1, 0.0),
    "metres": (0.1, 0.0),
    "steps": (0.0, 1.0),
    "times": (0.0, 0.0),
    "seconds": (0.0, 0.1),
}
"""Tolerances of a number: a share of it, and an amount. A pace is always kept."""

QUICKEST = 1.5
"""Largest factor by which a motion is played faster or slower."""

LARGEST_TURN_RATE = 100.0
"""Largest correction of a turn, degrees per second."""

LARGEST_STRETCH = 1.4
"""Largest factor by which a motion is made to go farther than drawn."""

Spans = list[tuple[int, int]]
"""Pairs of a first frame and the one after the last, in the order in which they end."""


@dataclass(frozen=True, eq=False)
class Seen:
    """A motion (T, J, 3) of the humanoid's joints in metres, y up, and its frame rate."""

    points: Array
    fps: float

    @staticmethod
    def of(contract: MotionContract, frames: Array) -> "Seen":
        """The motion of frames (T, D), as drawn."""
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
        across = np.zeros((len(self.points), 3))
        for part in parts:
            left, right = (self.points[:, HUMANOID.index(sided(side, part))] for side in LEFT_RIGHT)
            pair = left - right
            across = across + pair / np.maximum(np.linalg.norm(pair[:, ::2], axis=1), 1e-9)[:, None]
        heading: Array = np.degrees(np.unwrap(np.arctan2(-across[:, 2], across[:, 0])))
        heading -= heading[0]
        return heading

    @property
    def settled(self) -> int:
        """The number of frames to keep, all but the last 0.6 s or less, so that the hips sway against the whole figure
        at the end as at the start: in a stride they sway by ten degrees."""
        whole = smoothed(self._heading("UpperLeg", "UpperArm")[:, None, None], 0.15, self.fps)[:, 0, 0]
        sway = self.heading - whole
        length = len(self.points)
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
        distance: Array = np.linalg.norm(path - path[0], axis=1)
        return distance

    @cached_property
    def soles(self) -> Array:
        """Heights (T, 2) of the lowest joint of each foot above where they are in standing."""
        joints = []
        for part in ("Foot", "Toes"):
            standing = T_POSE[HUMANOID.index(sided("left", part)), 1]
            joints.append(self.pair(part)[..., 1] - standing)
        soles: Array = np.minimum(*joints)
        return soles - min(0.0, float(np.percentile(soles.min(axis=1), 5)))

    @cached_property
    def steps(self) -> Spans:
        """When a foot is moved over the ground by 15 cm or more, at 0.4 m/s or, as one that runs never rests, an eighth
        of its highest speed."""
        feet = self.pair("Foot")[..., ::2]
        steps: Spans = []
        for foot in np.moveaxis(feet, 1, 0):
            speeds = np.linalg.norm(np.diff(foot, axis=0), axis=1) * self.fps
            for start, stop in spells(np.asarray(speeds > speeds.max(initial=3.2) / 8)):
                if np.linalg.norm(foot[stop] - foot[start]) >= 0.15:
                    steps.append((start, stop))
        return sorted(steps, key=lambda span: span[1])

    def done(self, act: str) -> Spans:
        """When an act is done, a value of :data:`motet.text.numeric_phrases.COUNTED_ACTS`."""
        to_and_fro = {"waves": self._waves, "nods": self._nods, "claps": self._claps, "pushups": self._pushups}
        if act in to_and_fro:
            return sorted(to_and_fro[act](), key=lambda span: span[1])
        flags: Flags = getattr(self, f"_{act}")
        spans: Spans = []
        for column in flags.reshape(len(flags), -1).T:
            spans += spells(column)
        return sorted(spans, key=lambda span: span[1])

    @property
    def _jumps(self) -> Flags:
        """Flights of 0.1 to 0.9 s with the hips not lower than in standing, without those that are low beside the
        highest: steps of a walk or a run."""
        low = self.soles.min(axis=1)
        hips = self.joint("hips")[:, 1] - T_POSE[HUMANOID.index("hips"), 1]
        flights = []
        for start, stop in spells(low > 0.05):
            if 0.1 <= (stop - start) / self.fps <= 0.9 and hips[start:stop].max() > -0.02:
                flights.append((start, stop))
        highest = max((low[start:stop].max() for start, stop in flights), default=0.0)
        flags = np.zeros(len(low), dtype=np.bool_)
        for start, stop in flights:
            flags[start:stop] = low[start:stop].max() >= 0.4 * highest
        return flags

    @property
    def _jacks(self) -> Flags:
        up = np.greater(self.pair("Hand")[..., 1], self.pair("UpperArm")[..., 1])
        return np.asarray(up.all(axis=1))

    @property
    def _kicks(self) -> Flags:
        return np.asarray(self.soles >= 0.45)

    @property
    def _punches(self) -> Flags:
        out = np.linalg.norm((self.pair("Hand") - self.joint("chest")[:, None])[..., ::2], axis=2)
        return np.asarray(np.gradient(out, axis=0) * self.fps >= 2.0)

    @property
    def _dips(self) -> Flags:
        return np.asarray(self.joint("hips")[:, 1] < T_POSE[HUMANOID.index("hips"), 1] - 0.2)

    @property
    def _bows(self) -> Flags:
        trunk = self.joint("neck") - self.joint("hips")
        return np.asarray(np.degrees(np.arctan2(np.linalg.norm(trunk[:, ::2], axis=1), trunk[:, 1])) >= 25)

    def _waves(self) -> Spans:
        """A hand, higher than its elbow and about as high as the shoulder, goes to one side by 10 cm and back."""
        hands, elbows, shoulders = map(self.pair, ("Hand", "LowerArm", "UpperArm"))
        across = np.subtract(*np.moveaxis(self.pair("UpperLeg"), 1, 0))[:, None]
        beside = ((hands - elbows) * across).sum(axis=2) / np.linalg.norm(across, axis=2)
        up = hands[..., 1] > np.maximum(elbows[..., 1], shoulders[..., 1] - 0.1)
        waves: Spans = []
        for side, high in zip(beside.T, up.T, strict=True):
            for first, last in spells(high):
                for start, stop in strokes(side[first:last], 0.1):
                    waves.append((first + start, first + stop))
        return waves

    def _nods(self) -> Spans:
        """The head is bent forward by 10 degrees, beside the chest, and raised again."""
        head = self.joint("head_end") - self.joint("head")
        chest = self.joint("neck") - self.joint("chest")
        across = np.subtract(*np.moveaxis(self.pair("UpperArm"), 1, 0))
        ahead = np.cross(across, chest)
        along_ahead = np.linalg.norm(ahead, axis=1)
        along_chest = np.linalg.norm(chest, axis=1)
        bent = []
        for up in (head, chest):
            forward = (up * ahead).sum(axis=1) / along_ahead
            upward = (up * chest).sum(axis=1) / along_chest
            bent.append(np.arctan2(forward, upward))
        return strokes(-np.degrees(bent[0] - bent[1]), 10.0)

    def _claps(self) -> Spans:
        """The hands are brought together by 10 cm, to 25 cm or less between the wrists, and apart again."""
        apart = np.linalg.norm(np.subtract(*np.moveaxis(self.pair("Hand"), 1, 0)), axis=1)
        return [(i, j) for i, j in strokes(apart, 0.1) if apart[i:j].min() < 0.25]

    def _pushups(self) -> Spans:
        """The chest sinks by 6 cm and rises again, over hands on the ground and as low as the hips but for 50 cm.

        Recorded push-ups sink by 22 cm, of which codes keep 14 at most.
        """
        chest = self.joint("chest")[:, 1]
        hands = self.pair("Hand")[..., 1].max(axis=1)
        level = (hands < 0.3) & (np.abs(chest - self.joint("hips")[:, 1]) < 0.5)
        return [(i, j) for i, j in strokes(chest, 0.06) if level[i:j].all()]

    @cached_property
    def unrest(self) -> Array:
        """How fast (T,) the joints move on average, m/s."""
        steps = np.gradient(smoothed(self.points, 0.05, self.fps), axis=0) * self.fps
        speed: Array = np.linalg.norm(steps, axis=2).mean(axis=1)
        return speed

    def measured(self, kind: Kind, act: str = "") -> float:
        """The amount of a kind; NaN for the times of an act that is not counted, and for a pace."""
        if kind == "degrees":
            return float(self.heading[-1])
        if kind == "steps":
            return float(len(self.steps))
        if kind == "times":
            return float(len(self.done(act))) if act else np.nan
        if kind == "metres":
            return float(self.away[-1])
        return len(self.points) / self.fps if kind == "seconds" else np.nan


def spells(flags: Flags) -> Spans:
    """The frames from which to which flags (T,) are true."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]))).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))


def strokes(values: Array, least: float) -> Spans:
    """From which frame to which one values (T,) fall by ``least`` or more from the highest before, and rise by as much
    again; the last need not rise."""
    spans: Spans = []
    high = -np.inf
    low = np.inf
    start = 0  # the frame of the highest value before
    falling = False
    for i, value in enumerate(values.tolist()):
        if falling:
            low = min(low, value)
            if value - low >= least:
                spans.append((start, i + 1))
                high = value
                start = i
                falling = False
        elif value >= high:
            high = value
            start = i
        elif high - value >= least:
            low = value
            falling = True
    if falling:
        spans.append((start, len(values)))
    return spans


def enough(seen: Seen, numbers: Quantities) -> bool:
    """Whether a motion has as much as the numbers of a sentence, or can be cut, turned and stretched to have it."""
    amounts = numbers.amounts
    seconds = len(seen.points) / seen.fps
    turn = abs(amounts.get("degrees", 0.0))
    if turn > max(LARGEST_STRETCH * abs(seen.measured("degrees")), LARGEST_TURN_RATE * (seconds - 0.6)):
        return False
    # A jump can be stretched.
    stretch = LARGEST_STRETCH if "jumps" in numbers.act else 1.0
    if float(seen.away.max()) < amounts.get("metres", 0.0) / stretch:
        return False
    if len(seen.steps) < amounts.get("steps", 0.0):
        return False
    return not numbers.act or len(seen.done(numbers.act)) >= amounts.get("times", 0.0)


def fitted(contract: MotionContract, frames: Array, numbers: Quantities) -> Array:
    """Frames (T', D) of a motion that is cut, turned and played to fit the numbers of a sentence."""
    seen = Seen.of(contract, frames)
    frames = frames[: min(cut(seen, numbers, kind) for kind in ("metres", "steps", "times", "degrees"))]
    if "degrees" in numbers.amounts:
        seen = Seen.of(contract, frames)
        frames = turned(seen, frames, turn_to_make(seen, numbers))
    pace = numbers.amounts.get("pace", 1.0)
    if "seconds" in numbers.amounts:
        pace = len(frames) / (numbers.amounts["seconds"] * contract.fps)
    return played(frames, float(np.clip(pace, 1 / QUICKEST, QUICKEST)))


def cut(seen: Seen, numbers: Quantities, kind: Kind) -> int:
    """The number of frames of a motion that show as much of a kind as a sentence says: all, if they show no more."""
    amount = numbers.amounts.get(kind, np.inf)
    if kind == "degrees":
        return _cut_turn(seen, amount)
    if kind == "metres":
        return _cut_path(seen, amount)
    spans: Spans = []
    if kind == "steps":
        spans = seen.steps
    elif numbers.act:
        spans = seen.done(numbers.act)
    if len(spans) <= amount:
        return len(seen.points)
    last = spans[int(amount) - 1][1]
    following = spans[int(amount)][0]
    if following <= last:  # strides of a run overlap
        return min(last + 1, len(seen.points))
    return last + int(seen.unrest[last : following + 1].argmin()) + 1


def _cut_turn(seen: Seen, degrees: float) -> int:
    """The frame after a turn, for a motion that turns on and on; else all."""
    over = np.flatnonzero(np.abs(seen.heading) >= abs(degrees) + seen.brief)
    wild = abs(seen.measured("degrees")) > 2 * abs(degrees) + 60
    return int(over[0]) + 1 if len(over) and wild else len(seen.points)


def _cut_path(seen: Seen, metres: float) -> int:
    """The frame with the lowest feet near the one at which a distance is reached: between two strides."""
    reached = np.flatnonzero(seen.away >= metres)
    if not len(reached):
        return len(seen.points)
    off = np.abs(seen.away - metres)
    near = np.flatnonzero(off <= max(0.05 * metres, abs(seen.away[reached[0]] - metres)))
    first = near[: np.flatnonzero(np.diff(near, append=np.inf) > 1)[0] + 1]
    return max(2, int(first[seen.soles.max(axis=1)[first].argmin()]) + 1)


def turn_to_make(seen: Seen, numbers: Quantities) -> float:
    """The degrees of a sentence, to the side to which a motion turns already if either will do."""
    degrees = numbers.amounts["degrees"]
    return -degrees if numbers.either and seen.measured("degrees") < 0 else degrees


def turned(seen: Seen, frames: Array, degrees: float, *, begins: bool = True, ends: bool = True) -> Array:
    """Frames (T, D) that turn by some degrees: the correction is made where the motion turns or goes already.

    begins, ends: whether the motion begins or ends with these frames; then it does not turn there. Of a motion that
    goes on, the first frame is the last one before, which stays as it is.
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
    """Frames played faster by a factor; their velocity and their turn are scaled."""
    if pace == 1 or len(frames) < 2:
        return frames
    count = max(2, round(len(frames) / pace))
    at = np.linspace(0, len(frames) - 1, count)
    low = np.minimum(at.astype(int), len(frames) - 2)
    between: Array = frames[low] + (at - low)[:, None] * (frames[low + 1] - frames[low])
    between[:, :3] *= len(frames) / count
    return between


def short(wanted: Mapping[str, float], measured: Mapping[str, float], either: bool) -> list[Kind]:
    """The kinds whose measured amount is off by more than :data:`NUMBER_TOLERANCES`. either: a turn may go either
    way."""
    kinds: list[Kind] = []
    for kind, (share, amount) in NUMBER_TOLERANCES.items():
        if kind not in measured:
            continue
        has = abs(measured[kind]) if either and kind == "degrees" else measured[kind]
        if abs(has - wanted[kind]) > share * abs(wanted[kind]) + amount + 1e-9:
            kinds.append(kind)
    return kinds
