"""Rules on legs and feet: jumping, hopping, kicking, standing on one leg. Each says whether a track does it."""

import numpy as np

from motet.motion.humanoid import HUMANOID, LEFT_RIGHT, T_POSE, sided
from motet_train.evaluate.text_adherence.track import RATE, Track, longest, spells, swings

CLEAR = 0.1
"""Metres: both feet higher than this are off the ground; feet in runs are not, for more than a moment."""


def jumps(track: Track, rise: float, count: int = 1, metres: float = 0.0, most_metres: float = np.inf) -> bool:
    """Jumps at least so many times, the hips rising so many metres above where they are in standing.

    A jump: both feet are off the ground between two frames in which one is on it. Shorter flights than 0.12 s are
    running steps, longer ones than 0.9 s stand on something. metres, most_metres: how far each goes over the ground.
    """
    hips, path, standing = track.height("hips"), track.path, T_POSE[HUMANOID.index("hips"), 1]
    found = [
        hips[start:stop].max() - standing >= rise
        and metres <= np.linalg.norm(path[stop] - path[start - 1]) <= most_metres
        for start, stop in spells(track.soles.min(axis=1) > CLEAR)
        if start > 0 and stop < len(track) and 0.12 <= (stop - start) / RATE <= 0.9
    ]
    return sum(map(bool, found)) >= count


def hops(track: Track) -> bool:
    """Hops on one foot at least twice: while the other foot is held up, the hips rise and fall by a few centimetres."""
    hips = track.height("hips")
    return any(swings(hips[a:b], 0.06) >= 4 for sole in track.soles.T for a, b in spells(sole > CLEAR))


def kicks(track: Track, side: str, height: float, speed: float = 4.0) -> bool:
    """The foot of a side ("left", "right", "either") swings up to a height, metres, at a speed, m/s, the other foot on
    the ground."""
    window = round(0.3 * RATE)
    for one in LEFT_RIGHT if side == "either" else (side,):
        foot = sided(one, "Foot")
        fast = track.motion_of(foot)
        up = (track.height(foot) >= height) & (track.soles[:, 1 - LEFT_RIGHT.index(one)] < 2 * CLEAR)
        if any(fast[max(0, start - window) : stop].max() >= speed for start, stop in spells(up)):
            return True
    return False


def on_one_leg(track: Track, seconds: float) -> bool:
    """Stands in place on one leg for so many seconds, the other foot 20 cm higher or more."""
    raised = np.abs(track.soles[:, 0] - track.soles[:, 1]) >= 0.2
    return longest(raised & (track.pace < 0.3)) >= seconds


def jumping_jacks(track: Track, count: int) -> bool:
    """At least so many times the feet are half a metre apart sideways while both hands are above the shoulders."""
    left, right = track.bodies("Foot")
    up = np.greater(track.heights("Hand"), track.heights("UpperArm")).all(axis=0)
    return len(spells((np.abs(left[:, 0] - right[:, 0]) >= 0.5) & up)) >= count


def lifts_feet(track: Track, height: float) -> bool:
    """Each foot is lifted to a height, metres, at least once."""
    return bool((track.soles.max(axis=0) >= height).all())


def steps_a_second(track: Track, least: float) -> bool:
    """Feet are lifted, by 3 cm, so many times a second or more, both together."""
    return sum(len(spells(sole > 0.03)) for sole in track.soles.T) >= least * track.seconds
