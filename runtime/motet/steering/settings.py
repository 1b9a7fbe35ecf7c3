"""The tuned numbers of the loop ``matching``, which a bundle holds under ``settings.steering``."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

from motet.settings import Range, Settings

HalfLife = Annotated[float, Range(0.01, 10, "s")]
Radians = Annotated[float, Range(0, 3.15, "rad")]
Share = Annotated[float, Range(0, 1)]
Factor = Annotated[float, Range(0, 100)]
Count = Annotated[int, Range(0, 10_000, "rows")]
Metres = Annotated[float, Range(0, 100, "m")]
Speed = Annotated[float, Range(0, 100, "m/s")]
Seconds = Annotated[float, Range(0.01, 100, "s")]


@dataclass(frozen=True)
class SteeringSettings(Settings):
    """Settings of a figure steered by motion matching: the desired trajectory, the search, the step and what gaits can
    do, in this order."""

    FEATURE: ClassVar[str] = "steering"

    # the desired trajectory
    velocity: HalfLife = 0.22
    """Half-life of the spring by which the target velocity is approached."""
    facing: HalfLife = 0.18
    """Half-life of the spring by which the target facing is approached."""
    horizon: Annotated[float, Range(0.1, 10, "s")] = 1.0
    """How far ahead rows are compared with the desired trajectory, at each third."""
    half_speed: Annotated[float, Range(0.01, 100, "m/s")] = 0.7
    """The speed half way from standing to any speed, on the scale on which speeds are compared."""

    # the search
    search_every: Annotated[int, Range(1, 60, "ticks")] = 6
    """Ticks between searches."""
    lag: Annotated[float, Range(0, 1e6, "per metre")] = 50.0
    """Cost of each metre by which a row covers less than half the desired displacement within the horizon: other rows
    start or turn aside, if less smoothly."""
    lasting: Count = 20
    """Fewest rows that follow a jump target in its recording."""
    jump_back: Count = 20
    """Jumps back by no more rows than this are ignored, or playback would loop on the spot."""
    jump_ahead: Count = 5
    """Jumps ahead by no more rows than this are ignored."""
    continuing: Annotated[float, Range(0, 1e6)] = 2.0
    """A row must cost less than the current one by more than this to be jumped to, or playback would go from one
    beginning to the next; a slow walk jumps to any row that costs less."""
    prepares: Count = 9
    """The rows before a leap, which is a flight of rows without a speed, that are no jump targets."""
    row_step: Annotated[int, Range(1, 100, "rows")] = 2
    """One row in this number is a jump target."""
    stands: Share = 0.1
    """Least contact of a foot in rows that are jumped to and from, so that flights are played to their end."""

    # the step
    blend: HalfLife = 0.13
    """Half-life of the inertialization offset."""
    slowest: Annotated[float, Range(0.1, 1)] = 0.8
    """Lowest playback rate."""
    fastest: Annotated[float, Range(1, 10)] = 1.15
    """Highest playback rate."""
    shortest: Annotated[float, Range(0.1, 1)] = 0.8
    """Shortest stride, relative to the recorded one."""
    longest: Annotated[float, Range(1, 10)] = 1.25
    """Longest stride, relative to the recorded one."""
    idle: Annotated[float, Range(0.01, 100, "m/s")] = 0.4
    """Speed below which a row is played as it is recorded."""
    creep: Annotated[float, Range(0.01, 100, "m/s")] = 0.67
    """Slow walk: velocities below this are searched for as if they were as fast as this."""
    creep_slowest: Annotated[float, Range(0.1, 1)] = 0.5
    """Lowest playback rate of a slow walk; its strides are as short as it takes (stride warping)."""
    turn: HalfLife = 0.15
    """Half-life of the error of the facing."""
    turn_still: Factor = 0.1
    """Limit of the facing's correction at a standstill, rad/s."""
    turn_moving: Factor = 1.0
    """What each m/s adds to this limit, rad/m, up to ``turn_speed``."""
    turn_speed: Speed = 1.5
    """Speed above which the limit of the facing's correction rises no more."""
    turn_turning: Factor = 0.5
    """What each rad/s of the recorded turn adds to this limit."""
    warp: Radians = 1.0
    """Largest turn of hips and legs towards the direction of travel, while the shoulders stay (orientation warping);
    there is none if the direction is more than a right angle away."""
    veer: Radians = 0.35
    """Largest heading correction: the part of the error of the direction of travel that warping leaves, made by the
    root alone."""
    veer_within: Factor = 0.4
    """The heading correction is made where the cosine of the error is above this share of its sine."""

    # what gaits can do
    aside: Radians = 1.0471975511965976
    """Angle from the facing at which going sideways begins."""
    back: Radians = 2.0943951023931953
    """Angle from the facing at which going backwards begins."""
    ahead: Radians = 0.5235987755982988
    """Largest angle from the facing at which a gait goes that has no sideways and backwards."""
