"""A foot lock for live figures: standing feet stay in place, without look-ahead.

Contacts come from the table being played, by :func:`motet.figures.feet.contacts.contacts_of` of the recordings. While a
foot stands, the movement of its lowest point over the ground is removed, tick by tick; when it lifts off, or its leg is
too short, the correction fades, unless its steps are planned (:mod:`motet.steering.stepping`). Hip, knee and ankle
follow (:class:`motet.figures.two_bones.TwoBones`). The offline twin, which knows how long a foot will stand, is
:mod:`motet.figures.feet.hold`.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np

from motet.figures.humanoid import LEG, SOLE, leg_length
from motet.figures.legs import Limb, joints_of, limbs, reached_by, with_legs
from motet.motion.rotations import Array
from motet.motion.scalar_or_batch import (
    Part,
    Quaternion,
    Vector,
    larger,
    length,
    minus,
    parts,
    plus,
    rotated,
    single,
    smaller,
    where,
    yawed,
)
from motet.motion.springs import Inertializer
from motet.settings import Range, Settings
from motet.steering.pose import Floats, Pose, hips_of
from motet.steering.settings import Share
from motet.steering.stepping import FREE, Footing, Move, Plan, Step, distance_of, lift_of, stepped


@dataclass(frozen=True)
class FootLockSettings(Settings):
    """Settings of the foot lock."""

    FEATURE: ClassVar[str] = "foot_lock"

    fade: Annotated[float, Range(0.001, 10, "s")] = 0.1
    """Half-life in which a released foot returns to where it is played."""
    farthest: Annotated[float, Range(0, 1, "m")] = 0.2
    """Largest correction; beyond it the foot is released."""
    stretches: Annotated[float, Range(0.1, 10)] = 1.01
    """Distance from the hip, in lengths of a leg, beyond which it is released, as it would leave the ground."""
    swings: Annotated[float, Range(0.01, 100, "m/s")] = 1.0
    """Above this speed a foot swings, even if a clip that was just jumped to marks a contact."""
    stands: Annotated[float, Range(0, 1)] = 0.5
    """Contact above which a foot stands."""
    bears: Annotated[float, Range(0, 1, "m")] = 0.03
    """How much lower than the ball the heel or the tip must be to bear the foot."""
    low: Annotated[float, Range(0, 1, "m")] = 0.5
    """Height of the hips below which no foot is held: who squats or kneels turns on it."""
    steps: Annotated[float, Range(0, 1, "m")] = 0.08
    """How high a foot is lifted that swings while its contact is 1; a slower foot is lifted less."""
    leaves: Share = 0.1
    """Contact below which a foot is off the ground,"""
    clears: Annotated[float, Range(0, 1, "m")] = 0.06
    """and so high if it is no faster than ``swings``: after a jump to another row it would drag."""
    lifts: Annotated[float, Range(0.001, 10, "s")] = 0.035
    """Half-life in which a foot is lifted and let down: at once, the knee of a straight leg would pop forward."""


LEG_LENGTH = leg_length()
"""Metres of a thigh and a shin."""

LEFT_THEN_RIGHT = np.array([[True], [False]])
"""Which of both feet in arrays is the left one."""

HEEL, BALL = SOLE[LEG[2]]
(TIP,) = SOLE[LEG[3]]
SOLE_POINTS = [(2, HEEL), (2, BALL), (3, TIP)]
"""Points of a sole, heel, ball and tip, and which joint of a leg carries each."""


@dataclass(frozen=True, eq=False)
class FootLock:
    """The lock of B characters; replaced, never written into."""

    feet: Array
    """(B, 2, 19) of the left and the right foot: what :class:`motet.steering.stepping.Step` has, its offset over the
    ground, x and z in metres, and how fast that changes first of all; how high it steps, and how fast that changes; 1
    where it was released before its contact ended, else 0; and where heel, ball and tip of its sole were in the last
    tick, x, y and z each, infinite before the first."""

    @staticmethod
    def none(characters: int) -> "FootLock":
        """Feet that have not been held yet."""
        feet = np.zeros((characters, 2, 19))
        feet[:, :, 6] = FREE
        feet[:, :, 10:] = math.inf
        return FootLock(feet)

    def update(
        self, pose: Pose, settings: FootLockSettings, seconds: float, plan: Plan | None = None
    ) -> tuple["FootLock", Pose]:
        """A tick later, and the pose of that tick with standing feet held in place and above ground. plan: which
        figures have their steps planned, None for none of them."""
        hips = _hips(pose)
        place = hips_of(pose)
        feet = list[list[Part]]()
        legs = list[list[Quaternion]]()
        # what is played, and which feet take planned steps
        played = list(limbs(pose.rotations, pose.contacts))
        stepping = _stepping(self._feet, played, plan, settings.stands)
        for foot_before, limb, step in zip(self._feet, played, stepping, strict=True):
            foot, leg = _held(foot_before, limb, hips, place, Tick(step, settings, seconds))
            feet.append(foot)
            legs.append(leg)
        # both feet of each character, as :attr:`feet` has them
        numbers: Array = np.array(feet)
        lock = FootLock(numbers[None] if len(pose) == 1 else numbers[0].transpose(2, 1, 0))
        return lock, replace(pose, rotations=with_legs(pose.rotations, legs), contacts=lock._shown(pose.contacts, plan))

    def _shown(self, played: Floats, plan: Plan | None) -> Floats:
        """Contacts (B, 2) as they are shown, from those that are played: a released foot does not stand, and a planned
        one stands unless it is lifted."""
        contacts = np.where(self.feet[:, :, 9] > 0, 0.0, played)
        if plan is not None:
            lifted = np.minimum(self.feet[:, :, 7] / plan.settings.lowest, 1.0)
            contacts = np.where(self.feet[:, :, 6] == FREE, contacts, 1 - lifted)
        return contacts.astype(np.float32)

    @property
    def _feet(self) -> Any:
        """The two feet of one character in floats; those of several as one foot, in arrays (2, B)."""
        return self.feet[0].tolist() if len(self.feet) == 1 else [self.feet.transpose(2, 1, 0)]


def _hips(pose: Pose) -> Quaternion:
    """Rotation of the hips in the world."""
    half_facing = (pose.ground[:, 2] / 2).astype(np.float32)
    sine = single(np.sin(half_facing))
    cosine = single(np.cos(half_facing))
    return yawed(parts(pose.rotations[:, 0]), sine, cosine)


class Stepping(NamedTuple):
    """What a planned step depends on."""

    footing: Footing
    other: Footing
    """Of the other foot."""
    plan: Plan


class Tick(NamedTuple):
    """What a foot's correction in a tick depends on besides its pose."""

    stepping: Stepping | None
    settings: FootLockSettings
    seconds: float


def _stepping(
    feet: Sequence[Sequence[Part]], played: Sequence[Limb], plan: Plan | None, stands: float
) -> Sequence[Stepping | None]:
    """What the planned steps of feet depend on, which are as :attr:`FootLock._feet` has them; None without a plan.
    stands: contact above which a foot does."""
    if plan is None:
        return [None] * len(feet)
    # each foot knows the other: only one is lifted at a time
    sides: Sequence[Part] = (True, False) if len(feet) == 2 else (LEFT_THEN_RIGHT,)
    each = list[Footing]()
    for foot, limb, is_left in zip(feet, played, sides, strict=True):
        each.append(Footing(distance_of(foot[0], foot[1]), foot[6], limb.contact > stands, is_left))
    others = each[::-1] if len(each) == 2 else [Footing(*(part[::-1] for part in each[0]))]
    return [Stepping(footing, other, plan) for footing, other in zip(each, others, strict=True)]


def _held(
    foot_before: Sequence[Part], limb: Limb, hips: Quaternion, place: Vector, tick: Tick
) -> tuple[list[Part], list[Quaternion]]:
    """A foot a tick later, and the rotations of thigh, shin and foot in their parents' frames."""
    # the foot as it is played, and how it is corrected
    turned, places = joints_of(limb, hips, place)
    sole = sole_points(turned, places)
    is_released = _is_released(foot_before, limb.contact, places, tick.settings)
    foot = _corrected(foot_before, sole, limb.contact, is_released, place[1], tick)
    correction = (foot[0], _lift(foot, sole), foot[1])
    moves = (correction[0] != 0) | (correction[1] != 0) | (correction[2] != 0)
    if moves is False:
        return foot, limb.local[:3]
    # the leg reaches for the corrected ankle
    reached = reached_by(hips, turned, places, plus(places[2], correction))
    if moves is True or moves.all():
        return foot, reached
    # of several, the legs of those that are not corrected stay as they are, to the bit
    return foot, list(np.where(moves, reached, limb.local[:3]))


def _lift(foot: Sequence[Part], sole: Sequence[Vector]) -> Part:
    """By how much a foot is lifted, so that no point of its sole is below the ground, and that of a planned one is
    where it is to be."""
    lift = foot[7] - _lowest(sole)
    return where(foot[6] == FREE, larger(lift, 0.0), lift)


def _is_released(
    foot_before: Sequence[Part], contact: Part, places: Sequence[Vector], settings: FootLockSettings
) -> Part:
    """Whether a foot is released before its contact ends, as its leg does not reach where it is held."""
    held = plus(places[2], (foot_before[0], 0.0, foot_before[1]))
    is_too_far = length(minus(held, places[0])) > settings.stretches * LEG_LENGTH
    return (contact > settings.stands) & (is_too_far | (foot_before[9] > 0))


def _corrected(
    foot_before: Sequence[Part],
    sole: Sequence[Vector],
    contact: Part,
    is_released: Part,
    hips_height: Part,
    tick: Tick,
) -> list[Part]:
    """The correction of a foot a tick later, as :attr:`FootLock.feet` has it."""
    settings = tick.settings
    before = Step(*foot_before[:7])
    height, rise, _, *sole_before = foot_before[7:]
    move = _sole_move(sole, sole_before, settings.bears)
    is_high = hips_height > settings.low
    # hold: a foot that stands stays where it was, and the offset of one that swings returns to 0
    held_contact = where(is_released, 0.0, where(is_high, contact, 0.0))
    step, stands = _free(before, move, held_contact, settings, tick.seconds)
    share = _swing_share(before, step, move, settings, tick.seconds)
    drags = (held_contact < settings.leaves) & (share < 1)
    goal = contact * share * settings.steps + where(drags, settings.clears, 0.0)
    goal = where(is_high, goal, 0.0)
    # step: a foot of a figure that goes slowly does so by plan, once it stands
    if tick.stepping is not None:
        plan = tick.stepping.plan
        can_step = is_high & plan.plans
        is_planned = can_step & (before.clock >= 0)
        planned = stepped(before, tick.stepping.footing, tick.stepping.other, move, plan, tick.seconds)
        step = step._replace(clock=where(can_step & stands, 0.0, step.clock))
        step = Step(*(where(is_planned, *pair) for pair in zip(planned, step, strict=True)))
        goal = where(is_planned, lift_of(planned, plan), goal)
    # lift: softly
    error, rise = Inertializer(settings.lifts).update(height - goal, rise, tick.seconds)
    height = goal + error
    # a planned foot comes down from where its recording has it
    if tick.stepping is not None:
        follows = (step.clock > 0) | ((step.clock == 0) & (before.clock == FREE))
        height = where(follows, larger(height, _lowest(sole)), height)
    return [*step, height, rise, where(is_released, 1.0, 0.0), *chain.from_iterable(sole)]


def _free(before: Step, move: Move, contact: Part, settings: FootLockSettings, seconds: float) -> tuple[Step, Part]:
    """A foot without planned steps a tick later, and whether it stands. move: how far it has been moved along x and z
    since the last tick."""
    # the move of a foot that stands is taken from its offset
    held_x = before.shift_x - move[0]
    held_z = before.shift_z - move[1]
    slow = distance_of(*move) < settings.swings * seconds
    stands = slow & (contact > settings.stands) & (distance_of(held_x, held_z) < settings.farthest)
    fade = Inertializer(settings.fade)
    shift_x, drift_x = _held_or_faded(stands, held_x, before.shift_x, before.drift_x, fade, seconds)
    shift_z, drift_z = _held_or_faded(stands, held_z, before.shift_z, before.drift_z, fade, seconds)
    nothing = 0.0 * shift_x
    return Step(shift_x, shift_z, drift_x, drift_z, nothing, nothing, nothing + FREE), stands


def _swing_share(before: Step, step: Step, move: Move, settings: FootLockSettings, seconds: float) -> Part:
    """How fast a foot moves over the ground as a share of the speed above which it swings, at most 1."""
    moved = distance_of(step.shift_x - (before.shift_x - move[0]), step.shift_z - (before.shift_z - move[1]))
    return smaller(moved / (settings.swings * seconds), 1.0)


def _held_or_faded(
    stands: Part, held: Part, shift: Part, drift: Part, fade: Inertializer, seconds: float
) -> tuple[Part, Part]:
    """A foot's offset along an axis, and its rate: where it is held, or on its way back to where it is played."""
    faded, fade_rate = fade.update(shift, drift, seconds)
    return where(stands, held, faded), where(stands, 0.0, fade_rate)


def _sole_move(sole: Sequence[Vector], sole_before: Sequence[Part], bears: float) -> Move:
    """How far the point that bears a foot has moved over the ground since the last tick, along x and z."""
    # the point that bears the foot: its move is what the lock takes away, so heel and toes may turn about it
    heel, ball, tip = sole
    # the ball bears the foot, unless the heel or the tip is lower by ``bears``
    move_x = ball[0] - sole_before[3]
    move_z = ball[2] - sole_before[5]
    bearing_height = ball[1] - bears
    for point, point_before in ((heel, sole_before[:3]), (tip, sole_before[6:])):
        is_bearing = point[1] < bearing_height
        bearing_height = where(is_bearing, point[1], bearing_height)
        move_x = where(is_bearing, point[0] - point_before[0], move_x)
        move_z = where(is_bearing, point[2] - point_before[2], move_z)
    # before the first tick a foot has not moved
    is_new = sole_before[0] == math.inf
    return where(is_new, 0.0, move_x), where(is_new, 0.0, move_z)


def sole_points(turned: Sequence[Quaternion], places: Sequence[Vector]) -> list[Vector]:
    """Where the points of a sole are, of rotations and places of a leg's joints."""
    return [plus(places[joint], rotated(turned[joint], point)) for joint, point in SOLE_POINTS]


def _lowest(sole: Sequence[Vector]) -> Part:
    """The height of the lowest point of a sole."""
    heel, ball, tip = sole
    return smaller(smaller(ball[1], heel[1]), tip[1])
