"""What was said to figures, step by step: each begins when the one before is over."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from motet.errors import ControlWarning, collected
from motet.motion.rotations import Array
from motet.steering.acts import Act
from motet.steering.repertoire import entries
from motet.steering.spoken import Step
from motet.steering.styles import NO_STYLE, PACES, style_number

if TYPE_CHECKING:
    from motet.steering.model import SteerModel
    from motet.steering.session import SteerSession

GOING_SECONDS = 3.0
"""Seconds that a figure goes before the next step."""

TURN_SECONDS = 1.5
"""Seconds that a turn, a change of pace or a stop lasts before the next step."""

SECONDS_OF_DEGREE = 0.008
"""And more for each degree of a turn."""

NEARER_DISTANCE = 2.5
"""Metres that a figure comes towards the camera of a page."""


class Saying:
    """The steps of a sentence, and which of them has begun. here: x and z in metres, where "come here" leads."""

    def __init__(self, steps: Sequence[Step], here: tuple[float, float]) -> None:
        last = steps[-1]
        # what lasts for some seconds ends in standing
        self.steps = (*steps, Step("stop")) if last.seconds else tuple(steps)
        self.here = here
        self.at = -1
        self.ticks = 0

    def copy(self) -> "Saying":
        """A copy that goes on independently."""
        other = Saying(self.steps, self.here)
        other.steps = self.steps
        other.at = self.at
        other.ticks = self.ticks
        return other

    @property
    def is_over(self) -> bool:
        """Whether its last step has begun and needs nothing more."""
        return self.at + 1 == len(self.steps) and not self.steps[-1].curve

    def tick(self, session: "SteerSession") -> None:
        """Begin the next steps where those before are over, and lead a circle on."""
        self.ticks += 1
        while self.at + 1 < len(self.steps) and self._is_done(session):
            self.at += 1
            self.ticks = 0
            self._begin(self.steps[self.at], session)
        curve = self.steps[self.at].curve
        if curve and self.ticks:
            facing = np.degrees(session.target[:, 2]) + curve / session.model.fps
            session.control(direction=facing, facing=facing)

    def _is_done(self, session: "SteerSession") -> bool:
        if self.at < 0:
            return True
        step = self.steps[self.at]
        following = self.steps[self.at + 1]
        is_alone = following.kind == "act" and not entries()[following.name].arms
        if following.together and not is_alone:
            return True
        if step.kind == "act":
            return self.ticks > 1 and not any(session.acting)
        if step.kind == "here":
            return bool(session.arrived.all())
        return self.ticks >= round(_seconds(step) * session.model.fps)

    def _begin(self, step: Step, session: "SteerSession") -> None:
        if step.kind == "act":
            session.act(act_of(step, session))
        elif step.kind == "stop":
            session.act(None)
            session.control(speed=0.0)
        elif step.kind == "here":
            session.go_to(self.here)
        elif step.kind == "away":
            away = session.places[:, :2] - self.here
            walk = session.model.gaits[0]
            direction = np.degrees(np.arctan2(away[:, 0], away[:, 1]))
            session.control(gait=walk, speed=session.model.usual[walk], direction=direction)
        else:
            go(step, session)


def go(step: Step, session: "SteerSession") -> None:
    """Let figures go, turn, or change their pace, as fast as their gaits allow."""
    with collected(ControlWarning):
        _go(step, session)


def _go(step: Step, session: "SteerSession") -> None:
    model = session.model
    # from where they are to face, even if they have not come to it yet
    facing = np.degrees(session.target[:, 2])
    facing = facing if step.aside else facing + step.way
    direction = facing + step.way if step.aside else facing
    speeds = np.hypot(*session.target[:, :2].T)
    if step.name:
        low, high = model.speeds[step.name]
        style = step.style or NO_STYLE
        speed = step.pace * PACES[style_number(style)] * model.usual[step.name]
        session.control(
            gait=step.name, speed=min(max(speed, low), high), direction=direction, facing=facing, style=style
        )
    elif step.change == 1:
        session.control(speed=speeds, direction=direction, facing=facing)
    else:
        _change_pace(session, speeds, step.change)


def _change_pace(session: "SteerSession", speeds: Array, change: float) -> None:
    paces = [_changed(session.model, gait, speed, change) for gait, speed in zip(session.gaits, speeds, strict=True)]
    session.control(gait=[gait for gait, _ in paces], speed=[speed for _, speed in paces])


def _changed(model: "SteerModel", gait: str, speed: float, change: float) -> tuple[str, float]:
    """The gait and the speed of a figure that goes faster or slower; one that stands begins to go."""
    speed = change * (speed or model.usual[gait])
    walk = model.gaits[0]
    fastest = max(model.gaits, key=lambda name: model.usual[name])
    if gait == walk and speed > model.speeds[walk][1]:
        gait = fastest
    elif gait == fastest and speed < model.speeds[fastest][0]:
        gait = walk
    low, high = model.speeds[gait]
    return gait, min(max(speed, low), high)


def act_of(step: Step, session: "SteerSession") -> Act | str:
    """What a session acts for a step: the name of a gait that is done once, or an act of the repertoire."""
    plain = not step.side and step.tempo == 1 and step.count == 1
    if plain and step.name in session.model.takes:
        return step.name
    return session.model.act_named(step.name, step.side, step.tempo, step.count)


def _seconds(step: Step) -> float:
    """How long a step lasts before the next one."""
    if step.seconds:
        return step.seconds
    if step.kind == "go" and step.name:
        return GOING_SECONDS
    return TURN_SECONDS + SECONDS_OF_DEGREE * abs(step.way)
