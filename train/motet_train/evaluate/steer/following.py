"""Whether figures go where they are told: how soon, and how well.

All changes are measured from several phases of the stride: each figure goes on as it was told before for
:data:`SETTLE` seconds and a part of a second more, and is then told something else. What a figure does is seen in its
place over the ground and its facing.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motet.models.steer import SteerModel
from motet.models.steer_session import SteerSession
from motet.motion.pose import Pose
from motet.motion.quaternions import wrapped
from motet.motion.rotations import Array
from motet_train.evaluate.steer.standing import standing
from motet_train.evaluate.steer.track import Track

PHASES, APART = 8, 4
"""Times of a change, and ticks between them."""

SETTLE = 3.0
"""Seconds before a change."""

PACES = (0.0, 0.6, 1.0, 1.4, 1.8, 2.0, 2.5, 3.0, 3.5, 4.0)
"""Speeds in m/s between which is changed; up to :data:`WALK` it is a walk, above a run."""

WALK = 1.8

TURNS = (45, 90, 135, 180)
"""Degrees, to the left and to the right."""

TURNED = 10.0
"""Degrees: a figure goes where it is told when its direction is no farther off, and stays so."""

CALM = 0.5
"""Seconds, about a step, over which the direction of travel is a mean."""

ASIDE = {"left": 90.0, "right": -90.0, "back": 180.0}
"""Degrees from the facing to where a figure goes that does not go where it faces, ..."""

SLOWLY = 0.8
"""... in m/s."""


@dataclass(frozen=True)
class Asked:
    """What N figures are told: gaits, speeds in m/s, directions and facings in degrees."""

    gait: tuple[str, ...]
    speed: ArrayLike = 0.0
    direction: ArrayLike = 0.0
    facing: ArrayLike = 0.0

    def tell(self, session: SteerSession) -> None:
        """Tell it to all characters of a session."""
        session.control(gait=self.gait, speed=self.speed, direction=self.direction, facing=self.facing)


def responses(model: SteerModel, before: Asked, after: Asked, seconds: float, hold_feet: bool = False) -> list[Track]:
    """What N figures do from the tick of a change on, for each phase."""
    tracks = []
    for phase in range(PHASES):
        session = model.start(characters=len(before.gait), hold_feet=hold_feet)
        before.tell(session)
        poses = _ticks(session, round(SETTLE * model.fps) + APART * phase)[-1:]
        after.tell(session)
        poses += _ticks(session, round(seconds * model.fps))
        tracks.append(Track.of(poses, model.fps))
    return tracks


def _ticks(session: SteerSession, count: int) -> list[Pose]:
    return [session.tick() for _ in range(count)]


def _ground(tracks: Sequence[Track]) -> Array:
    """Places over the ground (T, B, 3), x, z and facing, of N figures of each phase."""
    return np.concatenate([track.ground for track in tracks], axis=1).astype(np.float64)


def gone(ground: Array, fps: float, start: float, stop: float) -> Array:
    """The mean velocity (B, 2) over the ground between two times, from places (T, B, 3)."""
    first, last = round(start * fps), round(stop * fps)
    found: Array = (ground[last, :, :2] - ground[first, :, :2]) * fps / (last - first)
    return found


def speed_errors(model: SteerModel) -> dict[str, float]:
    """How far the speed is off, as a share of what was asked: the mean velocity from 1 to 2 s after a change between
    all pairs of :data:`PACES`, straight on. Mean, worst, the mean for each new speed; rest: m/s where 0 was asked.
    """
    pairs = [(a, b) for a, b in product(PACES, PACES) if a != b]
    old, new = np.array(pairs).T
    before = tuple(_gait(max(a, 0.1)) if a else _gait(b) for a, b in pairs)
    after = tuple(_gait(b) if b else _gait(a) for a, b in pairs)
    ground = _ground(responses(model, Asked(before, old), Asked(after, new), 2.0))
    pace = np.linalg.norm(gone(ground, model.fps, 1.0, 2.0), axis=1).reshape(PHASES, -1)
    off = np.abs(pace - new) / np.where(new > 0, new, 1)
    moving = off[:, new > 0]
    found = {"mean": moving.mean(), "worst": moving.max(), "rest": off[:, new == 0].mean()}
    found["rest_worst"] = off[:, new == 0].max()
    found |= {f"to_{value:g}": off[:, new == value].mean() for value in PACES[1:]}
    return {name: float(value) for name, value in found.items()}


def _gait(pace: float) -> str:
    return "walk" if pace <= WALK else "run"


def turn_errors(model: SteerModel, gait: str, pace: float) -> dict[str, float]:
    """Turns by :data:`TURNS` to both sides at a speed, and the facing with it.

    s: mean seconds until the direction of travel is within :data:`TURNED` degrees and stays so for the rest of 4 s
    (infinite where one does not); worst_s. direction, facing: mean degrees off, from 2 to 3 s after the change.
    slide_cm: as :func:`standing` has it, in all turns and the seconds after them.
    """
    angles = np.array([side * turn for turn in TURNS for side in (1, -1)], dtype=np.float64)
    before = Asked((gait,) * len(angles), pace)
    tracks = responses(model, before, replace(before, direction=angles, facing=angles), 4.0 + CALM, hold_feet=True)
    ground = _ground(tracks)
    asked = np.tile(angles, PHASES)
    seconds = _seconds(ground, asked, model.fps)
    way, facing = off_way(ground, asked, model.fps, 2.0, 3.0), off_facing(ground, asked, model.fps, 2.0, 3.0)
    found = {"slide_cm": standing(tracks)["slide_cm"]}
    for turn in TURNS:
        own = np.abs(asked) == turn
        found |= {f"s_{turn}": seconds[own].mean(), f"worst_s_{turn}": seconds[own].max()}
        found |= {f"direction_{turn}": way[own].mean(), f"facing_{turn}": facing[own].mean()}
    return {name: float(value) for name, value in found.items()}


def _seconds(ground: Array, asked: Array, fps: float) -> Array:
    """Seconds (B,) until the direction of travel is what is asked (B,), in degrees."""
    half = round(CALM * fps / 2)
    steps = ground[2 * half :, :, :2] - ground[: -2 * half, :, :2]  # around ticks half, half + 1, ...
    off = np.abs(_degrees_off(np.arctan2(steps[..., 0], steps[..., 1]), asked))
    return arrival(off <= TURNED, fps) + half / fps


def off_way(ground: Array, asked: Array, fps: float, start: float, stop: float) -> Array:
    """By how many degrees (B,) figures go elsewhere than is asked (B,), between two times; 180 for none that goes."""
    velocity = gone(ground, fps, start, stop)
    off = np.abs(_degrees_off(np.arctan2(velocity[:, 0], velocity[:, 1]), asked))
    found: Array = np.where(np.linalg.norm(velocity, axis=1) > 0.05, off, 180.0)
    return found


def off_facing(ground: Array, asked: Array, fps: float, start: float, stop: float) -> Array:
    """By how many degrees (B,) figures face elsewhere than is asked (B,), in the mean between two times."""
    off = _degrees_off(ground[round(start * fps) : round(stop * fps), :, 2], asked)
    found: Array = np.abs(off.mean(axis=0))
    return found


def _degrees_off(angles: Array, asked: Array) -> Array:
    found: Array = np.degrees(wrapped(angles - np.radians(asked)))
    return found


def aside_errors(model: SteerModel) -> dict[str, float]:
    """Side steps and walking backwards at :data:`SLOWLY`, from standing and from walking: degrees that direction and
    facing are off, and the error of the speed as a share, from 2 to 4 s after the change."""
    names = tuple(ASIDE)
    ways = np.repeat([ASIDE[name] for name in names], 2)
    before = Asked(("walk",) * len(ways), np.tile([0.0, 1.4], len(names)))
    ground = _ground(responses(model, before, replace(before, speed=SLOWLY, direction=ways), 4.0))
    asked = np.tile(ways, PHASES)
    way = off_way(ground, asked, model.fps, 2.0, 4.0)
    facing = off_facing(ground, np.zeros_like(asked), model.fps, 2.0, 4.0)
    pace = np.linalg.norm(gone(ground, model.fps, 2.0, 4.0), axis=1)
    found = dict[str, float]()
    for name in names:
        own = asked == ASIDE[name]
        found |= {f"{name}_direction": way[own].mean(), f"{name}_facing": facing[own].mean()}
        found[f"{name}_speed"] = np.abs(pace[own] / SLOWLY - 1).mean()
    return {name: float(value) for name, value in found.items()}


def arrival(inside: NDArray[np.bool_], fps: float) -> Array:
    """Seconds (B,) until ``inside`` (T, B) holds until the end; infinite where it does not."""
    frames = len(inside) - np.cumprod(inside[::-1], axis=0).sum(axis=0)
    return np.where(frames < len(inside), (frames + 1) / fps, np.inf)
