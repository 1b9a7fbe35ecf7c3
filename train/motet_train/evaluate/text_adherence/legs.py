"""Rules on legs and feet: jumping, hopping, kicking, standing on one leg. Each says whether a track does it."""

import numpy as np

from motet.motion.humanoid.bones import LEFT_RIGHT, sided
from motet.motion.rotations import Array
from motet_train.evaluate.text_adherence.going import STANDING
from motet_train.evaluate.text_adherence.track import RATE, Track, longest, spells, swings

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
    return len([one for one in found if one]) >= count


def hops(track: Track) -> bool:
    """Hops on one foot at least twice: while the other foot is held up, the hips rise and fall by a few centimetres."""
    hips = track.height("hips")
    held = [spells(track.soles[:, i] > CLEAR) for i in range(2)]
    return any(swings(hips[start:stop], 0.06) >= 4 for start, stop in held[0] + held[1])


def kicks(track: Track, side: str, height: float, speed: float = 4.0) -> bool:
    """The foot of a side ("left", "right", "either") swings up to a height, metres, at a speed, m/s, the other foot on
    the ground."""
    window = round(0.3 * RATE)
    for one in LEFT_RIGHT if side == "either" else (side,):
        foot = track.height(sided(one, "Foot"))
        fast = track.motion_of(sided(one, "Foot"))
        up = (foot >= height) & (track.soles[:, 1 - LEFT_RIGHT.index(one)] < 2 * CLEAR)
        if any(fast[max(0, start - window) : stop].max() >= speed for start, stop in spells(up)):
            return True
    return False


def on_one_leg(track: Track, seconds: float) -> bool:
    """Stands in place on one leg for so many seconds, the other foot 20 cm higher or more."""
    raised = np.abs(track.soles[:, 0] - track.soles[:, 1]) >= 0.2
    return longest(raised & (track.pace < 0.3)) >= seconds


def jumping_jacks(track: Track, count: int) -> bool:
    """At least so many times the feet are half a metre apart sideways while both hands are above the shoulders."""
    apart = np.abs(track.body("leftFoot")[:, 0] - track.body("rightFoot")[:, 0]) >= 0.5
    up = [track.height(sided(side, "Hand")) > track.height(sided(side, "UpperArm")) for side in LEFT_RIGHT]
    return len(spells(apart & up[0] & up[1])) >= count


def lifts_feet(track: Track, height: float) -> bool:
    """Each foot is lifted to a height, metres, at least once."""
    return bool((track.soles.max(axis=0) >= height).all())


def steps_a_second(track: Track, least: float) -> bool:
    """Feet are lifted, by 3 cm, so many times a second or more, both together."""
    return sum(len(spells(track.soles[:, i] > 0.03)) for i in range(2)) >= least * track.seconds


def flights(track: Track) -> list[tuple[int, int]]:
    """Frames (start, stop) in which both feet are off the ground, between two in which one is on it."""
    found = spells(track.soles.min(axis=1) > CLEAR)
    least, most = FLIGHT
    return [(a, b) for a, b in found if a > 0 and b < len(track) and least <= (b - a) / RATE <= most]


def knee(track: Track, side: str) -> Array:
    """The angle (T,) of a knee, degrees: 180 is straight."""
    return track.angle(*(sided(side, part) for part in ("UpperLeg", "LowerLeg", "Foot")))
