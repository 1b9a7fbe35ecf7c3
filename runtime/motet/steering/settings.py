"""The tuned numbers of the loop ``matching``, which a bundle holds under ``settings.steering``."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

from motet.settings import Range, Settings

HalfLife = Annotated[float, Range(0.01, 10, "s")]
Radians = Annotated[float, Range(0, 3.15, "rad")]
Share = Annotated[float, Range(0, 1)]
Factor = Annotated[float, Range(0, 100)]
Count = Annotated[int, Range(0, 10_000, "rows")]


@dataclass(frozen=True)
class SteeringSettings(Settings):
    """Settings of a figure steered by motion matching.

    The desired trajectory:
        velocity, facing: half-lives of the springs by which target velocity and facing are approached.
        horizon: how far ahead rows are compared with it, at each third. half_speed: the speed that is half way from
        standing to any speed, on the scale on which speeds are compared.

    The search:
        search_every: ticks between searches. lag: the cost of each metre by which a row covers less than half the
        desired displacement within the horizon (others start, or turn aside, if not as smoothly). lasting: the fewest
        rows left after a jump target. jump_back, jump_ahead: jumps within this window are ignored, or playback would
        loop on the spot. continuing: what is played is left only for rows that cost less by more than this, or
        playback would go from one beginning to the next; by anything where it creeps. prepares: so many rows before a
        flight of rows without a speed, a leap, are no jump targets. row_step: one in so many rows is a jump target.
        stands: the least contact of a foot in rows that are jumped to and from, so flights are played to their end.

    The step:
        blend: half-life of the inertialization offset. slowest, fastest: limits of the playback rate. shortest,
        longest: limits of the stride, relative to the recorded one. idle: speed below which a row is played as it is.
        creep: slower velocities are searched for as if they were as fast, and played at no less than a rate of
        creep_slowest, with strides as short as it takes (stride warping).
        turn: half-life of the error of the facing; turn_still, turn_moving, turn_turning: limits of its correction, in
        rad/s at a standstill, for each m/s up to turn_speed, and for each rad/s of the recorded turn.
        warp: the largest turn of hips and legs towards the direction of travel, while the shoulders stay (orientation
        warping); there is none towards what is more than a right angle off.
        veer: the largest correction of the direction of travel that is left, of the root alone; veer_within: it is made
        where the cosine of the angle is above this share of its sine.

    What gaits can do:
        aside, back: angles from the facing at which going sideways and going backwards begin. ahead: how far from its
        facing a gait goes that goes neither way.
    """

    FEATURE: ClassVar[str] = "steering"

    velocity: HalfLife = 0.22
    facing: HalfLife = 0.18
    horizon: Annotated[float, Range(0.1, 10, "s")] = 1.0
    half_speed: Annotated[float, Range(0.01, 100, "m/s")] = 0.7
    search_every: Annotated[int, Range(1, 60, "ticks")] = 6
    lag: Annotated[float, Range(0, 1e6, "per metre")] = 50.0
    lasting: Count = 20
    jump_back: Count = 20
    jump_ahead: Count = 5
    continuing: Annotated[float, Range(0, 1e6)] = 2.0
    prepares: Count = 9
    row_step: Annotated[int, Range(1, 100, "rows")] = 2
    stands: Share = 0.1
    blend: HalfLife = 0.13
    slowest: Annotated[float, Range(0.1, 1)] = 0.8
    fastest: Annotated[float, Range(1, 10)] = 1.15
    shortest: Annotated[float, Range(0.1, 1)] = 0.8
    longest: Annotated[float, Range(1, 10)] = 1.25
    idle: Annotated[float, Range(0.01, 100, "m/s")] = 0.4
    creep: Annotated[float, Range(0.01, 100, "m/s")] = 0.67
    creep_slowest: Annotated[float, Range(0.1, 1)] = 0.5
    turn: HalfLife = 0.15
    turn_still: Factor = 0.1
    turn_moving: Factor = 1.0
    turn_speed: Annotated[float, Range(0, 100, "m/s")] = 1.5
    turn_turning: Factor = 0.5
    warp: Radians = 1.0
    veer: Radians = 0.35
    veer_within: Factor = 0.4
    aside: Radians = 1.0471975511965976
    back: Radians = 2.0943951023931953
    ahead: Radians = 0.5235987755982988
