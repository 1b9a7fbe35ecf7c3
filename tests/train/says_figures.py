"""Made-up figures whose doings are known: positions of the humanoid's joints, 30 frames a second."""

import numpy as np

from motet.figures.humanoid.bones import HUMANOID, T_POSE
from motet_train.evaluate.text_adherence.track import RATE

INDEX = HUMANOID.index
HIPS = 0.98
"""Height of the hips in standing, metres."""


def times(seconds: float) -> np.ndarray:
    return np.arange(round(seconds * RATE) + 1) / RATE


def hanging() -> np.ndarray:
    """The rest pose (J, 3) with the arms down."""
    points = T_POSE.copy()
    for side in ("left", "right"):
        shoulder = points[INDEX(f"{side}UpperArm")]
        for part, length in (("LowerArm", 0.28), ("Hand", 0.53), ("Hand_end", 0.71)):
            points[INDEX(f"{side}{part}")] = shoulder - [0, length, 0]
    return points


def standing(seconds: float = 2.0) -> np.ndarray:
    """Points (T, J, 3) of a figure that does not move."""
    return np.repeat(hanging()[None], len(times(seconds)), axis=0)


def part(name: str) -> list[int]:
    """The joints whose names contain something."""
    return [i for i, joint in enumerate(HUMANOID.names) if name in joint]


def shifted(points: np.ndarray, name: str, x: object = 0, y: object = 0, z: object = 0) -> np.ndarray:
    """Points with some joints moved by so much, numbers or (T,), in metres."""
    found = points.copy()
    for axis, value in enumerate((x, y, z)):
        found[:, part(name), axis] += np.broadcast_to(value, len(points))[:, None]
    return found


def led(points: np.ndarray, speed: object, turn: float = 0.0, way: float = 0.0) -> np.ndarray:
    """Points led over the ground at a speed, m/s, a number or (T,), while turning by so many degrees in all.

    way: where it goes as seen from where it faces, degrees to the left.
    """
    facing = np.radians(turn) * np.linspace(0, 1, len(points))
    step = np.broadcast_to(speed, len(points)) / RATE
    there = facing + np.radians(way)
    path = np.cumsum(np.stack([step * np.sin(there), step * np.cos(there)], axis=1), axis=0)
    c, s = np.cos(facing)[:, None], np.sin(facing)[:, None]
    found = points.copy()
    found[..., 0] = points[..., 0] * c + points[..., 2] * s + path[:, :1]
    found[..., 2] = points[..., 2] * c - points[..., 0] * s + path[:, 1:]
    return found


def stepping(seconds: float, stride: float = 0.3, rate: float = 1.0) -> np.ndarray:
    """Points of a figure whose feet go to and fro by so many metres about the hips, lifted on the way to the front."""
    points, phase = standing(seconds), 2 * np.pi * rate * times(seconds)
    for side, sign in (("left", 1), ("right", -1)):
        for joints in (f"{side}Foot", f"{side}Toes"):
            lifted = 0.1 * np.maximum(sign * np.cos(phase), 0)
            points = shifted(points, joints, z=sign * stride * np.sin(phase), y=lifted)
    return points


def walking(speed: float = 1.2, turn: float = 0.0, seconds: float = 4.0, way: float = 0.0) -> np.ndarray:
    return led(stepping(seconds), speed, turn, way)


def leaping(rise: float = 0.4, metres: float = 0.0, jumps: int = 1) -> np.ndarray:
    """Points of jumps: half a second of flight after each half second on the ground."""
    time = times(jumps + 0.5)
    flight = np.maximum(time % 1 - 0.5, 0) * (time < jumps)  # 0 to 0.5
    height = rise * (1 - (4 * flight - 1) ** 2) * (flight > 0)
    return led(shifted(standing(jumps + 0.5), "", y=height), 2 * metres * (flight > 0))


LOWER = ("Leg", "Foot", "Toes", "hips")


def tipped(degrees: object, seconds: float = 2.0) -> np.ndarray:
    """Points of a figure whose trunk, head and arms lean forward by so many degrees, a number or (T,)."""
    points = standing(seconds)
    upper = [i for i in range(len(HUMANOID.names)) if not any(name in HUMANOID.names[i] for name in LOWER)]
    points[:, upper] = _tilted(points[:, upper], np.broadcast_to(degrees, len(points)))
    return points


def whole_tipped(degrees: float, height: float, seconds: float = 2.0) -> np.ndarray:
    """Points of a figure that leans forward as a whole, its hips at a height."""
    points = standing(seconds)
    return shifted(_tilted(points, np.broadcast_to(degrees, len(points))), "", y=height - HIPS)


def _tilted(points: np.ndarray, degrees: np.ndarray) -> np.ndarray:
    """Points (T, K, 3) turned about the axis from side to side through the hips."""
    angle = np.radians(degrees)[:, None]
    y, z = points[..., 1] - HIPS, points[..., 2]
    turned = (HIPS + y * np.cos(angle) - z * np.sin(angle), y * np.sin(angle) + z * np.cos(angle))
    return np.stack([points[..., 0], *turned], axis=-1)
