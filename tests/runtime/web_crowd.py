"""Calls of twelve figures' session by which runtime/web is held to Python: they reach most numbers of steering.

Figures cross a circle and keep apart, go to points nearby, take gaits, stop, jump, act, look and reach all around, go
over uneven ground, and stand before a wall of others. Numbers are spread by formulas, so that they are the same with
every version of numpy.
"""

from itertools import cycle, islice
from typing import Any

import numpy as np

from motet.figures.humanoid import BONES
from motet.steering.styles import STYLE_NAMES

FIGURES = 12

Calls = dict[str, Any]

GAITS = ("walk", "run", "walk", "skip", "run", "walk", "zombie", "walk")


def spread(seed: int, low: float, high: float) -> list[float]:
    """A number for each figure between two, other ones for each seed."""
    shares = (np.arange(FIGURES) * 0.618034 + (seed + 40) * 0.7548777) % 1
    found: list[float] = rounded(low + (high - low) * shares)
    return found


def angles(seed: int) -> list[float]:
    return spread(seed, -180, 180)


def speeds(seed: int, high: float) -> list[float]:
    return spread(seed, 0.2, high)


def gaits(first: int) -> list[str]:
    return [GAITS[(5 * figure + first) % len(GAITS)] for figure in range(FIGURES)]


def styles(first: int) -> list[str]:
    return list(STYLE_NAMES[first : first + FIGURES])


def rounded(values: Any) -> Any:
    return np.round(values, 2).tolist()


def circle(first: int) -> Any:
    """Places near a circle of 4 m, no two of which are as far from a third."""
    turns = 2 * np.pi * (np.arange(FIGURES) + first) / FIGURES
    aside = np.stack([spread(39 + first, -0.2, 0.2), spread(50 + first, -0.2, 0.2)], axis=1)
    return 4 * np.stack([np.sin(turns), np.cos(turns)], axis=1) + aside


def before(x: Any, y: Any, z: Any) -> Any:
    """A point before each figure that stands on a grid and faces along z."""
    figures = np.arange(FIGURES)
    places = np.stack([2 * (figures % 4), 0 * figures, 2 * (figures // 4)], axis=1)
    moves = np.broadcast_arrays(x, y, z, figures)[:3]
    return rounded(places + np.stack(moves, axis=1))


def wall(*gaps: float) -> Any:
    """Places of three figures, and of three others close together before each."""
    places = []
    for x, aside, gap in zip((0, 8, 16), (0.0, 0.2, 0.1), gaps, strict=True):
        places.append([x + aside, -1.5, 0])
        places += [[x + at * gap, -0.3 * abs(at) * gap, 180] for at in (-1, 0, 1)]
    return rounded(places)


def rest(count: int) -> list[Calls]:
    return [{} for _ in range(count)]


def control(first: int, seed: int, high: float, **more: Any) -> Calls:
    """Each takes a gait and goes somewhere."""
    return {"control": {"gait": gaits(first), "speed": speeds(seed, high), "direction": angles(seed + 1), **more}}


STOP: Calls = {"control": {"gait": "walk", "speed": 0}}
ALONG = np.linspace(0, 1, FIGURES)
BEHIND = np.radians(130 + 42 * ALONG)
ENDS = circle(6)
BEHIND_WALLS: Calls = {"go_to": {"ids": [0, 4, 8], "points": [[0, 3], [8, 3], [16, 3]]}}
RUNNERS = [0, 4, 6, 10]

CROWD: list[Calls] = [
    # across a circle, some at a run, and to points nearby
    {
        "put": rounded(np.column_stack([circle(0), angles(1)])),
        "keep_apart": 0.8,
        "go_to": {"points": rounded(ENDS), "facing": angles(2), "gait": "walk"},
    },
    {"go_to": {"points": rounded(ENDS[RUNNERS]), "gait": "run", "ids": RUNNERS}},
    *rest(11),
    {
        "go_to": {
            "points": rounded(ENDS + np.stack([spread(3, -0.6, 0.6), spread(4, -0.6, 0.6)], axis=1)),
            "facing": angles(5),
            "gait": "walk",
        }
    },
    *rest(5),
    # gaits and directions change, and figures stop
    {"keep_apart": None, **control(0, 6, 4)},
    *rest(2),
    control(3, 8, 3, facing=angles(10)),
    {},
    control(1, 11, 5),
    {},
    {"jump": {}},
    *rest(2),
    {"control": {"gait": "jump", "speed": 0}},
    *rest(2),
    STOP,
    {},
    control(2, 21, 3),
    control(6, 23, 3, facing=angles(24)),
    STOP,
    {},
    control(4, 32, 3),
    control(1, 34, 3),
    {},
    control(6, 36, 2, facing=angles(38)),
    {},
    control(7, 25, 3),
    STOP,
    {},
    # on a grid: acts, looks behind and at what is near, reaches for what is near and far, to the limits of each
    {"put": before(0, 0, 0), **STOP},
    {},
    {"lowers": {}, "look_at": {"points": before(3, 1.6, -1)}},
    {"twist": {}, "look_at": {"points": before(-3 * np.sin(BEHIND), 1.6, 3 * np.cos(BEHIND))}},
    *rest(2),
    {
        "look_at": {"points": before(0.02, 1.62, 0.2 + 0.26 * ALONG)},
        "reach": {"hand": "left", "points": before(0.18, 1.42, 0.06 + 0.24 * ALONG)},
    },
    {"reach": {"hand": "right", "points": before(-0.16, 1.3, 0.52 + 0.2 * ALONG)}},
    *rest(2),
    {"spin": {}, "reach": {"hand": "left", "points": None}},
    {"reach": {"hand": "left", "points": before(spread(29, 0.1, 0.5), spread(30, 1, 1.6), spread(31, 0.1, 0.5))}},
    {},
    {
        "control": {"facing": angles(13)},
        "reach": {"hand": "left", "points": before(spread(14, 0.05, 0.5), 1.5, spread(15, -0.5, 0.5))},
    },
    *rest(2),
    {"fold": {}, "reach": {"hand": "left", "points": None}},
    *rest(2),
    # over uneven ground
    {**control(4, 16, 3), "set_ground": "stairs"},
    *rest(3),
    control(6, 44, 2),
    STOP,
    {},
    {"control": {"speed": speeds(26, 1.4), "direction": angles(27)}, "set_ground": "hills"},
    {},
    {"reach": {"hand": "right", "points": None}, **control(5, 18, 3, facing=angles(20)), "set_ground": "ridges"},
    *rest(2),
    # held up by others
    {"put": wall(0.7, 0.8, 0.75), **STOP, "set_ground": None},
    *rest(2),
    {"keep_apart": 0.8, **BEHIND_WALLS},
    *rest(4),
    {"put": wall(0.65, 0.73, 0.85), **STOP},
    *rest(2),
    BEHIND_WALLS,
    *rest(4),
    # in styles
    {"keep_apart": None, **control(0, 52, 3, style=styles(1))},
    {},
    {"control": {"style": styles(5)}},
    {},
]
"""Calls one after the other; after each three quarters of a second pass."""


def posed(turns: dict[str, tuple[int, float]], facing: float = 0, height: float = 0.95) -> list[float]:
    """A frame of an act: bones turned about one of their axes by twice so many radians."""
    frame = np.tile([0.0, 0.0, 0.0, 1.0], (len(BONES), 1))
    for bone, (axis, half) in turns.items():
        at = BONES.index(bone)
        frame[at, axis] = np.sin(half)
        frame[at, 3] = np.cos(half)
    found: list[float] = rounded([*np.ravel(frame), 0, 0, facing, height])
    return found


def swell(frames: int, highest: float = 1) -> list[float]:
    """Shares that grow from none and fade."""
    found: list[float] = np.round(highest * np.sin(np.pi * np.arange(frames) / (frames - 1)) ** 2, 4).tolist()
    return found


STAND = posed({})
WAVE = posed({"leftUpperArm": (2, 0.6), "rightUpperArm": (1, 0.5)})
BENT = {"leftUpperLeg": (0, -1.0), "rightUpperLeg": (0, -1.0), "leftLowerLeg": (0, 1.15), "rightLowerLeg": (0, 1.15)}
TURNED = {"spine": (1, 0.75), "chest": (1, 0.6), "leftShoulder": (2, 0.5), "rightShoulder": (1, 0.4)}
LEGS = {"leftToes": (0, -1.2), "rightToes": (0, -1.3), "leftLowerLeg": (0, -0.17), "rightLowerLeg": (0, -0.2)}
FOLDED = {"leftUpperLeg": (0, -1.1), "rightUpperLeg": (0, -1.1), "leftLowerLeg": (0, 1.35), "rightLowerLeg": (0, 1.35)}
ARMS = {"leftUpperArm": (0, 1.5), "rightUpperArm": (1, 1.5)}

ACTS: dict[str, dict[str, Any]] = {
    # lower and lower, farther around, feet higher and higher: which are acts of the legs
    **{f"low {drop}": {"last": posed({}, height=0.35), "shares": swell(12, drop)} for drop in (0.35, 0.385)},
    **{f"around {turn}": {"last": posed({}, facing=turn), "shares": swell(12)} for turn in (2.5, 2.7)},
    **{f"high {share}": {"last": posed(BENT), "shares": swell(12, share)} for share in (0.55, 0.6, 0.65, 0.7, 0.75)},
    # slower and slower: how much of them rests
    **{f"wave {frames}": {"last": WAVE, "shares": swell(frames)} for frames in (32, 34, 36, 38, 44)},
    **{f"slow {frames}": {"last": WAVE, "shares": swell(frames, 0.5)} for frames in (75, 90, 120)},
    # what figures do: one that is begun late, one that turns joints faster than people do, legs that fold farther than
    # knees can bend, and arms that go around
    "lowers": {"last": WAVE, "shares": np.round(np.exp(-np.arange(60) / 8), 4).tolist()},
    "twist": {"last": posed(TURNED | LEGS), "shares": list(islice(cycle([0, 0, 0, 0, 1, 1, 1, 1]), 40))},
    "fold": {"last": posed(FOLDED, height=0.2), "shares": swell(60)},
    "spin": {"last": posed(ARMS), "shares": np.round(np.tan(-1.4 + 2.8 * (np.arange(60) / 40 % 1)), 2).tolist()},
}
"""Acts by name, each of frames so far on the way from standing to a pose."""
