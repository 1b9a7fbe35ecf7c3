"""Rules on legs and feet: jumping, hopping, kicking, standing on one leg. Each says whether a track does it."""

import numpy as np

from motet.motion.humanoid import LEFT_RIGHT, sided
from motet.motion.rotations import Array
from motet_train.evaluate.says.going import STANDING
from motet_train.evaluate.says.track import RATE, Track, longest, spells, swings

CLEAR = 0.1
"""Metres: both feet higher than this are off the ground; feet in runs are not, for more than a moment."""

FLIGHT = (0.12, 0.9)
"""Seconds that a jump's flight takes: what is shorter is a running step, what is longer stands on something."""


def jumps(track: Track, rise: float, count: int = 1, metres: float = 0.0, most_metres: float = np.inf) -> bool:
    """Jumps at least so many times, the hips rising so many metres above where they are in standing.

    metres, most_metres: how far each jump goes over the ground.
    """
    hips, path = track.height("hips"), track.joint("hips")[:, [0, 2]]
    found = [
        hips[start:stop].max() - STANDING >= rise
        and metres <= np.linalg.norm(path[stop] - path[start - 1]) <= most_metres
        for start, stop in flights(track)
    ]
    return sum(found) >= count


def hops(track: Track, count: int = 2, metres: float = 0.06) -> bool:
    """Hops on one foot at least so many times: one foot is held up, and the hips rise and fall by so many metres."""
    hips = track.height("hips")
    held = [spells(track.soles[:, i] > CLEAR) for i in range(2)]
    return any(swings(hips[start:stop], metres) >= 2 * count for start, stop in held[0] + held[1])


def kicks(track: Track, side: str, height: float, speed: float = 4.0, count: int = 1) -> bool:
    """The foot of a side swings up to a height, metres, at a speed, m/s, the other foot on the ground."""
    found = 0
    for one in LEFT_RIGHT if side == "either" else (side,):
        foot = track.height(sided(one, "Foot"))
        fast = track.motion_of(sided(one, "Foot"))
        up = (foot >= height) & (track.soles[:, 1 - LEFT_RIGHT.index(one)] < 2 * CLEAR)
        window = round(0.3 * RATE)
        found += sum(fast[max(0, start - window) : stop].max() >= speed for start, stop in spells(up))
    return found >= count


def on_one_leg(track: Track, seconds: float, height: float = 0.2) -> bool:
    """Stands in place on one leg for so many seconds, the other foot so much higher, metres."""
    raised = np.abs(track.soles[:, 0] - track.soles[:, 1]) >= height
    return longest(raised & (track.pace < 0.3)) >= seconds


def jumping_jacks(track: Track, count: int, metres: float = 0.5) -> bool:
    """At least so many times the feet are so many metres apart sideways while both hands are above the shoulders."""
    apart = np.abs(track.body("leftFoot")[:, 0] - track.body("rightFoot")[:, 0]) >= metres
    up = [track.height(sided(side, "Hand")) > track.height(sided(side, "UpperArm")) for side in LEFT_RIGHT]
    return len(spells(apart & up[0] & up[1])) >= count


def lifts_feet(track: Track, count: int, height: float, most_pace: float = np.inf) -> bool:
    """Each foot is lifted to a height, metres, at least so many times, while the figure is slower than most_pace."""
    slow = track.pace <= most_pace
    found = [len(spells((track.soles[:, i] >= height) & slow)) for i in range(2)]
    return min(found) >= count


def steps_a_second(track: Track, least: float, most: float = np.inf) -> bool:
    """Feet are lifted by 3 cm from least to most times a second, both together."""
    found = sum(len(spells(track.soles[:, i] > 0.03)) for i in range(2))
    return least <= found / track.seconds <= most


def flights(track: Track) -> list[tuple[int, int]]:
    """Frames (start, stop) in which both feet are off the ground, between two in which one is on it."""
    found = spells(track.soles.min(axis=1) > CLEAR)
    least, most = FLIGHT
    return [(a, b) for a, b in found if 0 < a and b < len(track) and least <= (b - a) / RATE <= most]


def knee(track: Track, side: str) -> Array:
    """The angle (T,) of a knee, degrees: 180 is straight."""
    return track.angle(*(sided(side, part) for part in ("UpperLeg", "LowerLeg", "Foot")))
