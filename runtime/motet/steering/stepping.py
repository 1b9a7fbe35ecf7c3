"""Steps that are planned: of figures that go slowly, turn on the spot or have just stopped.

Recordings have hardly any slow side steps, and shortened strides shuffle. So below the pace of a slow walk a foot is
held where it stands until its recording swings it, or until the pose wants it too far from there, and only while the
other foot stands. Then it is lifted and led to where the pose will want it half a stance later, by how fast the foot
has drifted from the pose so far. A foot of a figure that has stopped steps until it is under the body as recorded: so
a stop ends in balance. :mod:`motet.steering.foot_lock` has the state, and turns the leg.
"""

from dataclasses import dataclass
from typing import Annotated, ClassVar, NamedTuple

from motet.motion.rotations import Array
from motet.motion.scalar_or_batch import Part, larger, root, smaller, where
from motet.settings import Range, Settings
from motet.steering.matching import Flags, Matcher, Playback, Rows
from motet.steering.settings import Share

Move = tuple[Part, Part]
StepLength = Annotated[float, Range(0.001, 1, "m")]


@dataclass(frozen=True)
class StepSettings(Settings):
    """Settings of planned steps."""

    FEATURE: ClassVar[str] = "stepping"

    swing: Annotated[float, Range(0.05, 5, "s")] = 0.4
    """Time in which a foot is led to its goal; it comes down then, or later if its recording still swings it."""
    lowest: StepLength = 0.045
    """How high the sole of a foot is lifted for the shortest step."""
    highest: StepLength = 0.07
    """How high for a step of ``longest`` or more."""
    longest: StepLength = 0.4
    """Length of a step from which on a foot is lifted no higher."""
    stray: StepLength = 0.15
    """Distance of a standing foot from where the pose wants it, above which it steps."""
    settles: StepLength = 0.03
    """The same of a figure that has come to rest."""
    leads: Annotated[float, Range(0, 5, "s")] = 0.4
    """How far ahead of the pose a foot is put down: half a stance."""
    lead: StepLength = 0.1
    """The largest distance by which it is put down ahead."""
    mean: Annotated[float, Range(0.001, 10, "s")] = 0.2
    """Half-life of the mean of a foot's drift."""
    rests: Share = 0.5
    """Share of rest above which a figure has come to rest."""


FREE = -1.0
"""The clock of a foot whose steps are not planned."""


class Plan(NamedTuple):
    """What is planned for figures in a tick."""

    settings: StepSettings
    plans: Part
    """Whether their steps are planned."""
    settled: Part
    """Whether they have come to rest."""


class Step(NamedTuple):
    """A planned foot. Offsets are over the ground, from where it is played to where it is shown, in metres."""

    shift_x: Part
    shift_z: Part
    drift_x: Part
    """The mean of how fast the offset changes while the foot stands, m/s."""
    drift_z: Part
    anchor_x: Part
    """The offset that would bring it to where it stood last."""
    anchor_z: Part
    clock: Part
    """Seconds since it was lifted, 0 while it stands, ``FREE`` while it is not planned."""


class Footing(NamedTuple):
    """What decides whether a foot is lifted: as it was a tick ago, but for its contact."""

    distance: Part
    """From where the pose wants it, in metres."""
    clock: Part
    stands: Part
    """Whether its recording stands in this tick."""
    is_left: Part


def planned(matcher: Matcher, playback: Playback, target: Array, gait: Rows) -> tuple[Flags, Flags]:
    """Whether figures (B,) walk so slowly that their steps are planned, and whether they come to rest, stand or turn on
    the spot.

    target: (B, 3) velocity along x and z, and facing. gait: (B,).
    """
    creeps = matcher.is_slow_walk(target, gait) & (playback.pace < matcher.settings.creep)
    return creeps, matcher.comes_to_rest(playback, target, gait)


def stepped(before: Step, footing: Footing, other: Footing, move: Move, plan: Plan, seconds: float) -> Step:
    """A planned foot a tick later. move: how far the pose has moved it along x and z since the last tick."""
    settings = plan.settings
    # it is lifted, and comes down where its recording stands
    lifts = (before.clock > 0) | _lifts(footing, other, plan)
    clock = where(lifts, before.clock + seconds, before.clock)
    lands = (clock >= settings.swing) & (footing.stands | plan.settled)
    # while it swings, it is led from where it stood to its goal
    anchor_x, anchor_z = _anchor(before, move)
    goal_x, goal_z = _goal(before, plan)
    share = where(lifts, _eased(smaller(clock / settings.swing, 1.0)), 0.0)
    shift_x = anchor_x + share * (goal_x - anchor_x)
    shift_z = anchor_z + share * (goal_z - anchor_z)
    # while it stands, its drift is averaged
    kept = where(lifts, 1.0, 0.5 ** (seconds / settings.mean))
    drift_x, drift_z = _drift(before, move, kept, seconds)
    return Step(shift_x, shift_z, drift_x, drift_z, anchor_x, anchor_z, where(lands, 0.0, clock))


def _drift(before: Step, move: Move, kept: Part, seconds: float) -> Move:
    """The mean drift along x and z, of which a part is kept from the tick before."""
    x = kept * before.drift_x - (1 - kept) * move[0] / seconds
    z = kept * before.drift_z - (1 - kept) * move[1] / seconds
    return x, z


def _anchor(before: Step, move: Move) -> Move:
    """The offset along x and z that keeps a foot where it stood, after a move of the pose."""
    swung = before.clock > 0
    x = where(swung, before.anchor_x, before.shift_x) - move[0]
    z = where(swung, before.anchor_z, before.shift_z) - move[1]
    return x, z


def lift_of(step: Step, plan: Plan) -> Part:
    """How high a planned foot is to be above the ground, in metres."""
    settings = plan.settings
    goal_x, goal_z = _goal(step, plan)
    distance = distance_of(step.anchor_x - goal_x, step.anchor_z - goal_z)
    share = smaller(distance / settings.longest, 1.0)
    return where(step.clock > 0, settings.lowest + share * (settings.highest - settings.lowest), 0.0)


def _lifts(footing: Footing, other: Footing, plan: Plan) -> Part:
    """Whether a foot that stands is lifted in this tick, as its recording swings it, or as it is too far from where the
    pose wants it."""
    both_alike = footing.stands == other.stands
    is_farther = (footing.distance > other.distance) | ((footing.distance == other.distance) & footing.is_left)
    strays = is_farther & (footing.distance > where(plan.settled, plan.settings.settles, plan.settings.stray))
    return (footing.clock == 0) & (other.clock <= 0) & where(both_alike, strays, other.stands)


def _goal(step: Step, plan: Plan) -> Move:
    """The offset along x and z that a foot is led to: ahead, against its drift."""
    settings = plan.settings
    ahead = where(plan.settled, 0.0, -settings.leads)
    length = distance_of(step.drift_x, step.drift_z) * settings.leads
    ahead = ahead * smaller(settings.lead / larger(length, settings.lead), 1.0)
    return ahead * step.drift_x, ahead * step.drift_z


def _eased(share: Part) -> Part:
    """From 0 to 1, with neither speed nor acceleration at either end."""
    return share * share * share * (10 + share * (6 * share - 15))


def distance_of(x: Part, z: Part) -> Part:
    """The length of a vector over the ground."""
    return root(x * x + z * z)
