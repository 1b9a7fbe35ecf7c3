"""Rules on how a figure goes over the ground. Each takes a :class:`Track` and says whether it is so."""

import numpy as np

from motet_train.evaluate.text_adherence.track import RATE, Track, calm, swings

WAYS = {"forward": (0, 1), "backward": (0, -1), "left": (1, 1), "right": (1, -1)}
"""Way -> the column of the velocity, and its sign."""


def goes(track: Track, way: str, least: float, most: float = np.inf, metres: float = 0.0) -> bool:
    """Goes one way at a typical velocity from least to most, m/s, and comes so many metres that way in all.

    A quarter of the frames has more than the typical velocity, so that standing at the ends does not matter.
    """
    column, sign = WAYS[way]
    there = sign * track.velocity[:, column]
    return bool(least <= np.percentile(there, 75) <= most and there.sum() / RATE >= metres)


def sidesteps(track: Track, side: str, metres: float) -> bool:
    """Comes so many metres to one side of where it faces, and not as far forward or back."""
    column, sign = WAYS[side]
    gone = track.velocity.sum(axis=0) / RATE
    return bool(sign * gone[column] >= max(metres, abs(gone[0])))


def travels(track: Track, metres: float) -> bool:
    """Ends so many metres or more away from where it started."""
    return bool(np.linalg.norm(track.path[-1] - track.path[0]) >= metres)


def wanders(track: Track) -> bool:
    """Goes two metres over the ground or more, and ends less than half of its way from where it started."""
    way = float(track.pace.sum() / RATE)
    return way >= 2.0 and bool(np.linalg.norm(track.path[-1] - track.path[0]) < way / 2)


def turns(track: Track, least: float, most: float = np.inf) -> bool:
    """Turns by least to most degrees from start to end, to the left where they are above 0."""
    return least <= track.turn <= most


def turned_about(track: Track, least: float, most: float = np.inf) -> bool:
    """Turns by least to most degrees, no matter to which side: between the two headings that are farthest apart."""
    return bool(least <= np.ptp(calm(track.facing, 0.3)) <= most)


def straight(track: Track, most: float = 30.0) -> bool:
    """Heads where it headed at first, within so many degrees."""
    return abs(track.turn) <= most


def starts(track: Track, least: float = 0.0, most: float = np.inf) -> bool:
    """Moves at a speed from least to most, m/s, in the first moments."""
    return bool(least <= np.median(track.pace[: _moment(track)]) <= most)


def ends(track: Track, least: float = 0.0, most: float = np.inf) -> bool:
    """Moves at a speed from least to most, m/s, in the last moments."""
    return bool(least <= np.median(track.pace[-_moment(track) :]) <= most)


def reaches(track: Track, least: float = 0.0, most: float = np.inf) -> bool:
    """The highest speed, but for a tenth of the time, is from least to most, m/s."""
    return bool(least <= np.percentile(track.pace, 90) <= most)


def stays(track: Track, most: float) -> bool:
    """Is never farther than so many metres from where it was at first."""
    return bool(np.linalg.norm(track.path - track.path[0], axis=1).max() <= most)


def strides(track: Track, least: int = 2, most: float = np.inf) -> bool:
    """One foot is moved past the other, by 20 cm, from least to most times."""
    left, right = track.bodies("Foot")
    return least <= swings(left[:, 2] - right[:, 2], 0.2) <= most


def bobs(track: Track, metres: float) -> bool:
    """The hips move up and down by so many metres in the typical half second."""
    window = round(0.5 * RATE)
    hips = track.height("hips")
    spans = [np.ptp(hips[i : i + window]) for i in range(max(1, len(hips) - window + 1))]
    return bool(np.median(spans) >= metres)


def rises_and_falls(track: Track, metres: float, count: int) -> bool:
    """The hips go up or down by so many metres at least so many times."""
    return swings(track.height("hips"), metres) >= count


def hips(track: Track, least: float = -np.inf, most: float = np.inf) -> bool:
    """The hips are always from least to most metres above the ground, but for single frames."""
    low, high = np.percentile(track.height("hips"), [2, 98])
    return bool(least <= low and high <= most)


def _moment(track: Track) -> int:
    """Frames of the first or the last 0.4 s."""
    return min(round(0.4 * RATE), len(track))
