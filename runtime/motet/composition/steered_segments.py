"""Walks and runs that are steered from place to place in time, as parts of compositions."""

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from motet.errors import MotionError
from motet.motion.kinematics import local_translations
from motet.motion.motion import Motion
from motet.motion.rotations import Array, wrapped
from motet.representation.root_sixd import facing
from motet.steering.model import SteerModel
from motet.steering.pose import Pose
from motet.steering.session import SteerSession
from motet.text.clauses import FUNCTION_WORDS, stem

GAIT_STEMS = {
    "walk": "walk",
    "stroll": "walk",
    "go": "walk",
    "run": "run",
    "jog": "run",
    "skip": "skip",
    "zombi": "zombie",
}
"""Stems of words -> the gait that they mean."""

EASY = {stem("forward"), stem("straight"), stem("ahead"), stem("slowly"), stem("quickly"), stem("fast"), stem("like")}
"""Stems of words that a place makes superfluous: it says where and how fast to go."""

GOAL = re.compile(r"\b(to|towards?|into|past|around|across|along)\s+(a|an|the|his|her|their)\s+\w+")
"""The destination in words, which a place replaces."""

BACKWARD_STEMS = {stem("backward"), stem("backwards")}


START = 0.3
"""Seconds until a standing figure is on its way."""


ARRIVAL_DISTANCE = 0.05
"""Metres within which a figure is at a place."""

AGAIN = 0.2
"""Seconds between two commands."""


class Gait(NamedTuple):
    """A gait of a steered figure, its slowest, usual and fastest speed in m/s, and whether it goes backwards."""

    name: str
    low: float
    usual: float
    high: float
    back: bool


class Leg(NamedTuple):
    """The place at a frame, metres (2,), and the facing there, radians; each may be None."""

    frame: int
    place: Array | None
    facing: float | None


class Walk(NamedTuple):
    """A prompt for a gait, the frames in which it is shown, and its legs. halts: whether another act follows."""

    text: str
    start: int
    stop: int
    gait: Gait
    legs: Sequence[Leg]
    halts: bool


def gait_of(text: str, model: SteerModel) -> Gait | None:
    """The gait of a prompt for walking or running and nothing else, such as "a person walks slowly"; else None."""
    words = [stem(word) for word in re.findall(r"\w+", GOAL.sub("", text.lower())) if word not in FUNCTION_WORDS]
    named = [GAIT_STEMS[word] for word in words if GAIT_STEMS.get(word) in model.gaits]
    if not named or not all(word in GAIT_STEMS or word in EASY or word in BACKWARD_STEMS for word in words):
        return None
    # backwards has a top speed of its own
    back = not BACKWARD_STEMS.isdisjoint(words)
    low, usual, ahead, _, backwards = model.abilities.speeds[model.abilities.number(named[-1])].tolist()
    high = backwards if back else ahead
    return Gait(named[-1], min(low, high), min(usual, high), high, back) if high > 0 else None


def walked(model: SteerModel, walk: Walk, after: Motion | None) -> Motion:
    """The motion of a walk that continues another one, in the same channels; from the origin without one. It ends near
    its places, not at them. MotionError for a place that is out of reach, with the time it takes."""
    session = model.start(walk.gait.name)
    ground = np.zeros(3) if after is None else _take_over(session, model, after)
    _check(walk, ground, model.fps)
    poses = _ticked(session, walk, ground, model.fps)
    poses.insert(0, replace(poses[0], ground=ground[None]))
    return model.contract.motion(session.frames_of(poses)[0, 1:], after=after, plant=False)


def _ticked(session: SteerSession, walk: Walk, ground: Array, fps: float) -> list[Pose]:
    """The poses of a walk, of which each leg is commanded again and again; ground: x, z and facing (3,) before."""
    ticks_between = round(AGAIN * fps)
    poses: list[Pose] = []
    for now in range(walk.start, walk.stop):
        leg = next((leg for leg in walk.legs if leg.frame >= now), walk.legs[-1])
        if (now - walk.start) % ticks_between == 0:
            place = poses[-1].ground[0] if poses else ground
            _command(session, walk, leg, (leg.frame + 1 - now) / fps, place)
        poses.append(session.tick())
    return poses


def _take_over(session: SteerSession, model: SteerModel, motion: Motion) -> Array:
    """Put a session's figure where a motion ends, in its pose and at its speed; returns x, z and facing (3,)."""
    # place and facing of the last frame
    x, z = local_translations(motion[-6:])[:, 0, [0, 2]].T
    ground = np.array([x[-1], z[-1], facing(motion[-60:])[-1]])
    session.take(model.pose_of(motion[-60:]))
    session.put((x[-1], z[-1], math.degrees(ground[2])))
    # the speed over the last five frames
    direction = np.array([np.sign(x[-1] - x[0]), np.sign(z[-1] - z[0])])
    session.push(np.array([np.ptp(x), np.ptp(z)]) * direction * model.fps / 5)
    return ground


def _command(session: SteerSession, walk: Walk, leg: Leg, left: float, ground: Array) -> None:
    """Command a session to go to a place in the seconds left, but no slower than the gait, and to stand there."""
    gait = walk.gait
    backwards = math.pi * gait.back
    # no place: go on the way of the facing
    if leg.place is None and leg.facing is not None:
        _go(session, gait, gait.usual, leg.facing + backwards)
        return
    # the place, and the seconds that are left once it is turned to
    gap = np.zeros(2) if leg.place is None else leg.place - ground[:2]
    distance = float(np.hypot(*gap))
    direction = float(np.arctan2(*gap))
    left -= _pause(walk, leg, direction)
    if distance < ARRIVAL_DISTANCE or left <= 0:
        session.control(speed=0, facing=None if leg.facing is None else math.degrees(leg.facing))
        return
    # as fast as it takes to be there in time
    speed = float(np.clip(distance / max(left, AGAIN), gait.low, gait.high))
    _go(session, gait, speed, direction)


def _go(session: SteerSession, gait: Gait, speed: float, direction: float) -> None:
    """Command a gait at a speed in m/s and a direction in radians, facing that way or, backwards, away from it."""
    degrees = math.degrees(direction)
    session.control(gait=gait.name, speed=speed, direction=degrees, facing=degrees + 180 * gait.back)


def _pause(walk: Walk, leg: Leg, way: float) -> float:
    """Seconds that a figure stands at a place: before another act, and to turn; it walks through all others."""
    ahead = way + math.pi * walk.gait.back
    turn = 0.0 if leg.facing is None else abs(float(wrapped(np.array(leg.facing - ahead))))
    # it walks on through a place if its facing there is within 30 degrees of its way
    turn = turn if turn > math.radians(30) else 0.0
    stands = walk.halts and leg is walk.legs[-1]
    # a figure stops in half a second, and turns by a quarter, standing, in 0.8 s
    return 0.5 * (stands or turn > 0) + 0.8 * turn / (math.pi / 2)


def _check(walk: Walk, ground: Array, fps: float) -> None:
    """MotionError for a place that is out of reach."""
    place = ground[:2]
    now = walk.start / fps
    for leg in walk.legs:
        if leg.place is None:
            continue
        # how long the way takes at the gait's top speed, with starting and turning
        gap = leg.place - place
        far = float(np.hypot(*gap))
        then = (leg.frame + 1) / fps
        starting = START * min(1.0, then - now) if leg is walk.legs[0] else 0.0
        # half of the time to stop and turn is needed at least
        pause = 0.5 * _pause(walk, leg, float(np.arctan2(*gap)))
        need = far / walk.gait.high + pause + starting
        if far > ARRIVAL_DISTANCE and need > then - now:
            raise MotionError(
                f"{walk.text!r} cannot be at the place of {then:.3g} s in time: {far:.1f} m at up to "
                f"{walk.gait.high:g} m/s take {need:.1f} s, so be there at {now + need:.1f} s, or go faster"
            )
        place = leg.place
        now = then
