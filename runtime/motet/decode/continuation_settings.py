"""The numbers by which a motion is continued; they were tuned on people who are not in the figures of docs/alive.md."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

from motet.settings import Range, Settings


@dataclass(frozen=True)
class ContinuationSettings(Settings):
    """What a motion shows, how it continues, and how the continuation is joined to it.

    context: of a motion's end that becomes codes. context_steps: of these the last steps by which it is found what the
        motion shows, each of which counts ``context_fading`` of the one after it.
    actions: drawn by exp(-distance / action_scale), the distance of the place of theirs that is nearest.
    rows, moment: rows that are drawn for each moment, of which the one that keeps the pace best goes on.
    speed_cost: what a speed that is off by the factor e adds to the distance of a place; speed_floor: speeds are not
        told apart under it. turn_scale: an angle beside the course that is as bad as a speed off by the factor e.
        straight: a motion that turns by no more in the time that is looked at goes straight; going: a motion that is
        slower has no course.
    pace_seen: of a motion's end whose pace is kept; pace_recent: before a moment, counts like it.
    tempo: the largest factor by which what is off the pace is played quicker or slower; tempo_reach: before and after
        a frame, by which its speed is found.
    half_life: of what the motion's last frame is beside its codes.
    ground_seen: of a motion's end that says where its ground is; ground_reach: before and after a frame, more than a
        stride, by which its own ground is found; ground_limit: what is off by more is no other floor but a jump.
    anchor: of the start of a stance, more than one of a walk takes, that says where the foot stands.
    """

    FEATURE: ClassVar = "continuation"
    context: Annotated[float, Range(0.5, 10, "s")] = 4.0
    context_steps: Annotated[int, Range(1, 100)] = 12
    context_fading: Annotated[float, Range(0, 1)] = 0.85
    actions: Annotated[int, Range(1, 100)] = 4
    action_scale: Annotated[float, Range(0.001, 100)] = 0.3
    rows: Annotated[int, Range(2, 100)] = 12
    moment: Annotated[float, Range(0.1, 10, "s")] = 0.8
    speed_cost: Annotated[float, Range(0, 100)] = 1.0
    speed_floor: Annotated[float, Range(0.001, 10, "m/s")] = 0.25
    turn_scale: Annotated[float, Range(0.01, 100, "rad")] = math.radians(200)
    straight: Annotated[float, Range(0, math.pi, "rad")] = math.radians(30)
    going: Annotated[float, Range(0, 10, "m/s")] = 0.5
    pace_seen: Annotated[float, Range(0.1, 10, "s")] = 2.0
    pace_recent: Annotated[float, Range(0.1, 10, "s")] = 2.2
    tempo: Annotated[float, Range(1, 2)] = 1.15
    tempo_reach: Annotated[float, Range(0.1, 10, "s")] = 1.5
    half_life: Annotated[float, Range(0.01, 1, "s")] = 0.1
    ground_seen: Annotated[float, Range(0.1, 10, "s")] = 1.0
    ground_reach: Annotated[float, Range(0.1, 10, "s")] = 0.7
    ground_limit: Annotated[float, Range(0, 1, "m")] = 0.1
    anchor: Annotated[float, Range(0.1, 10, "s")] = 1.0
