"""Rules on the whole body: lying, sitting, crouching, bending, turning over. Each says whether a track does it."""

import numpy as np

from motet.motion.humanoid import LEFT_RIGHT, sided
from motet.motion.rotations import Array
from motet_train.evaluate.text_adherence.track import RATE, Flags, Track, calm, longest, pair, spells, swings

WHEN = {"any": (0.0, 1.0), "start": (0.0, 0.2), "end": (0.8, 1.0)}
"""When something is to be -> the part of the motion, shares of its time."""


def lies(track: Track, when: str) -> bool:
    """Head and hips are near the ground for a while."""
    part = track.part(*WHEN[when])
    return _for_a_while(part, (part.height("hips") < 0.42) & (part.height("head") < 0.55))


def crouches(track: Track, when: str = "any", hips: float = 0.65) -> bool:
    """The hips are lower than so many metres on bent knees for a while, the head over them."""
    part = track.part(*WHEN[when])
    knees = [part.angle(*(sided(side, joint) for joint in ("UpperLeg", "LowerLeg", "Foot"))) for side in LEFT_RIGHT]
    low = (part.height("hips") < hips) & (part.height("head") > part.height("hips") + 0.25)
    return _for_a_while(part, low & (np.minimum(*knees) < 110))


def upright(track: Track, when: str = "any") -> bool:
    """Stands or goes upright for a while: the hips high, the head well above them."""
    part = track.part(*WHEN[when])
    hips = part.height("hips")
    return _for_a_while(part, (hips > 0.8) & (part.height("head") > hips + 0.4))


def prone(track: Track, share: float) -> bool:
    """Hips and head are low, as in lying or on hands and knees, for a share of the time."""
    return bool(((track.height("hips") < 0.6) & (track.height("head") < 0.75)).mean() >= share)


def comes_up(track: Track, metres: float) -> bool:
    """The hips are so many metres higher at the end than at the start; a negative number for lower ones."""
    hips = track.height("hips")
    count = max(1, len(hips) // 10)
    gain = float(np.median(hips[-count:]) - np.median(hips[:count]))
    return gain >= metres if metres > 0 else gain <= metres


def sits(track: Track) -> bool:
    """Sits on a seat for a second, at rest: the thighs within 50 degrees of level, the hips behind a foot."""
    there: Flags = (track.height("hips") > 0.45) & (track.pace < 0.3)
    ahead = np.full(len(track), -np.inf)
    for hip, knee, foot in zip(*(track.bodies(part) for part in ("UpperLeg", "LowerLeg", "Foot")), strict=True):
        there &= np.abs(hip[:, 1] - knee[:, 1]) < np.sin(np.radians(50)) * 0.42
        ahead = np.maximum(ahead, foot[:, 2] - hip[:, 2])
    return longest(there & (ahead > 0.2)) >= 1.0


def bends(track: Track, degrees: float, seconds: float) -> bool:
    """The trunk leans by so many degrees for so long."""
    return longest(_tilt(track) >= degrees) >= seconds


def bows(track: Track) -> bool:
    """Standing on straight legs, the trunk leans by 25 degrees or more, once, and comes up again."""
    lean = calm(_tilt(track), 0.2)
    there = lean >= 25
    stands = bool(track.pace[there].max(initial=0.0) < 0.6) and track.height("hips")[there].min(initial=1.0) > 0.8
    return stands and len(spells(there)) == 1 and bool(max(lean[0], lean[-1]) < 12)


def upside_down(track: Track) -> bool:
    """The hips are above the head, and a foot above the hips."""
    hips = track.height("hips")
    return longest((hips > track.height("head")) & (np.maximum(*track.heights("Foot")) > hips)) > 0.05


def rolls(track: Track) -> bool:
    """Goes over the head near the ground: the hips above the head, which is no higher than a knee."""
    return longest((track.height("hips") > track.height("head")) & (track.height("head") < 0.5)) > 0.05


def ducks(track: Track, metres: float = 0.2, most: float = 1.35) -> bool:
    """The head goes down by so many metres to less than most above the ground and comes up again."""
    head = track.height("head")
    lowest = int(head.argmin())
    before, after = head[: lowest + 1].max(), head[lowest:].max()
    return bool(head[lowest] <= most and min(before, after) - head[lowest] >= metres)


def still(track: Track) -> bool:
    """The joints move by no more than 8 cm/s on average, for four fifths of the time."""
    steps = np.linalg.norm(np.diff(track.points, axis=0), axis=-1).mean(axis=1) * RATE
    return bool(len(steps)) and bool((calm(steps, 0.3) < 0.08).mean() >= 0.8)


def sways(track: Track, count: int, metres: float = 0.1) -> bool:
    """The trunk goes from side to side above the feet so many times, by so many metres."""
    feet = np.mean(track.bodies("Foot"), axis=0)[:, 0]
    return swings(calm(track.body("upperChest")[:, 0] - feet, 0.2), metres) >= count


def twists(track: Track, count: int, degrees: float = 40.0) -> bool:
    """The shoulders turn against the hips about y, to and fro by so many degrees, so many times."""
    across = [np.subtract(*map(track.joint, pair(part))) for part in ("UpperLeg", "UpperArm")]
    hips, shoulders = (np.arctan2(-one[:, 2], one[:, 0]) for one in across)
    return swings(np.degrees(np.unwrap(shoulders - hips)), degrees) >= count


def climbs(track: Track, metres: float) -> bool:
    """Both feet are so many metres above the ground for a second or more, on something."""
    return longest(track.soles.min(axis=1) >= metres) >= 1.0


def feet_stay(track: Track, most: float = 0.15) -> bool:
    """Each foot stays within so many metres of its typical place on the ground."""
    feet = [track.joint(name)[:, [0, 2]] for name in pair("Foot")]
    return all(np.percentile(np.linalg.norm(foot - np.median(foot, axis=0), axis=1), 95) <= most for foot in feet)


def lasts(track: Track, seconds: float) -> bool:
    """Takes so many seconds or more."""
    return track.seconds >= seconds


def _for_a_while(part: Track, flags: Flags) -> bool:
    """For 0.2 s, or as long as the part is."""
    return longest(flags) >= min(0.2, part.seconds)


def _tilt(track: Track) -> Array:
    """The angle (T,) between trunk and vertical, degrees."""
    trunk = track.joint("neck") - track.joint("hips")
    found: Array = np.degrees(np.arccos(np.clip(trunk[:, 1] / np.maximum(np.linalg.norm(trunk, axis=1), 1e-9), -1, 1)))
    return found
