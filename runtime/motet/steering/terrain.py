"""Figures on a ground that is not flat: slopes, stairs, anything that has a height at each place.

A figure is steered as if on a plane; at the end of a tick each foot is raised to the height under it, tilted to the
slope, and hips and legs follow (:mod:`motet.figures.legs`). What stands is exactly as high as the ground; what swings
is lifted in time for an edge ahead, and hips sink before a foot steps down.

Letters in shapes: B figures; the first axis of feet, of 2, holds the left and the right ones. Metres, seconds, radians.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from motet.errors import ControlError
from motet.figures.legs import joints_of, limbs_as_arrays, reached_by, with_legs
from motet.motion.rotations import Array
from motet.motion.scalar_or_batch import Quaternion, Vector, length, minus, plus, product, rotated, swing
from motet.motion.springs import damped, damping_of
from motet.settings import Range, Settings
from motet.steering.foot_lock import LEG_LENGTH, sole_points
from motet.steering.matching import Flags
from motet.steering.pose import Pose, frame_of
from motet.steering.settings import HalfLife, Metres, Seconds, Share

GroundHeight = Callable[[Array, Array], ArrayLike]
"""Heights of the ground in metres at places x and z, arrays of one shape."""

HIGHEST_GROUND = 10_000.0
"""Metres above or below y = 0."""


@dataclass(frozen=True)
class TerrainSettings(Settings):
    """How figures go over ground that is not flat."""

    FEATURE: ClassVar[str] = "terrain"

    stands: Share = 0.5
    """Contact above which a foot stands."""
    feet: HalfLife = 0.015
    """Half-life in which a foot comes to its height; it is never below the ground."""
    tilt: HalfLife = 0.06
    """Half-life in which a foot is tilted to the slope under it."""
    hips: HalfLife = 0.09
    """Half-life in which the hips come to the height of the lower foot."""
    steepest: Annotated[float, Range(0, 80, "deg")] = 40.0
    """A foot is tilted to slopes up to this; what is steeper is an edge."""
    spread: Metres = 0.04
    """Distance from the middle of a foot at which the slope under it is measured."""
    climbs: Annotated[float, Range(0.01, 10)] = 0.9
    """How much a swinging foot is lifted for each metre that it goes, before an edge."""
    foresees: Seconds = 0.24
    """How far ahead a swinging foot looks for edges."""
    swings: Annotated[float, Range(1, 5)] = 1.7
    """How many times as fast as the figure a swinging foot goes."""
    half_step: Seconds = 0.35
    """A foot lands as far ahead of the hips as they go in this time."""
    straight: Share = 0.97
    """Share of its length to which a leg is stretched, if it is not straighter already."""
    uphill: Annotated[float, Range(0, 10)] = 0.7
    """How much slower a figure goes uphill: by 1 / (1 + uphill x slope)."""
    slope_span: Metres = 0.6
    """Distance over which the slope ahead is measured for that."""


GLANCES = 4
"""Places ahead of a swinging foot at which it looks for edges."""

LEAST_SQUARED_SPEED = 1e-4
"""Square of the speed in m/s below which no foot is on its way."""

UPWARDS: Vector = (0.0, 1.0, 0.0)


class Terrain:
    """A checked function for the height of the ground."""

    def __init__(self, ground: GroundHeight) -> None:
        if not callable(ground):
            raise ControlError(f"ground must be a function of x and z that gives heights in metres, not {ground!r:.60}")
        self._ground = ground

    def heights(self, x: Array, z: Array) -> Array:
        """Heights of any shape; ControlError where the function fails, or gives another shape or no heights."""
        try:
            heights = np.asarray(self._ground(x, z), dtype=np.float64)
        except Exception as error:
            raise ControlError(f"ground(x, z) failed: {type(error).__name__}: {error}") from error
        if heights.shape != x.shape:
            raise ControlError(f"ground(x, z) gave heights of shape {heights.shape} for places of {x.shape}")
        is_height = np.abs(heights) <= HIGHEST_GROUND
        if not is_height.all():
            first = np.unravel_index(int(is_height.argmin()), heights.shape)
            wrong = f"ground(x, z) gave {heights[first]:g} at x {x[first]:g}, z {z[first]:g}"
            raise ControlError(f"{wrong}: a height is a number within {HIGHEST_GROUND:g} m of 0")
        return heights

    def slowed(self, target: Array, root: Array, settings: TerrainSettings) -> Array:
        """Targets (B, 3), velocities along x and z and facings, slower where they lead uphill from roots (B, 3)."""
        speed = np.hypot(target[:, 0], target[:, 1])
        way = target[:, :2] / np.maximum(speed, 1e-9)[:, None]
        ahead = root[:, :2] + settings.slope_span * way
        places = np.stack([root[:, :2], ahead])
        here, there = self.heights(places[..., 0], places[..., 1])
        slope = np.maximum(there - here, 0.0) / settings.slope_span
        slowed = target.copy()
        slowed[:, :2] /= (1 + settings.uphill * slope)[:, None]
        return slowed


class Legs(NamedTuple):
    """Legs of B figures as they are on a plane. Joints: hips, knees, ankles and balls of the toes; (2, B) each part."""

    hips_turn: Quaternion
    """(B,) of the hips in the world."""
    turned: list[Quaternion]
    """Rotations of joints in the world."""
    places: list[Vector]
    """Where the joints are."""
    sole: list[Vector]
    """Heel, ball and tip."""
    stands: Flags
    """(2, B) whether a foot stands."""
    swung: Array
    """(2, B) the share of its swing that a foot has made, by how far it is behind or ahead of the hips."""

    @staticmethod
    def of(pose: Pose, velocity: Array, settings: TerrainSettings) -> "Legs":
        """The legs of a pose whose hips go at a velocity (B, 2) along x and z."""
        place, hips_turn = frame_of(pose, ())
        limb = limbs_as_arrays(pose.rotations, pose.contacts)
        turned, places = joints_of(limb, hips_turn, place)
        x, z = velocity.T
        along = (places[2][0] - place[0]) * x + (places[2][2] - place[2]) * z
        seconds_ahead = along / np.maximum(x * x + z * z, LEAST_SQUARED_SPEED)
        swung = np.clip(0.5 + seconds_ahead / (2 * settings.half_step), 0.0, 1.0)
        stands = limb.contact > settings.stands
        return Legs(hips_turn, turned, places, sole_points(turned, places), stands, swung)


class Feet(NamedTuple):
    """Feet turned about their balls to the slope under them; (2, B) each part."""

    tilt: Quaternion
    """What turns them, in the world."""
    sole: list[Vector]
    """Heel, ball and tip."""
    ankle: Vector

    @staticmethod
    def of(legs: Legs, slope: Array) -> "Feet":
        """The feet of legs on slopes (2, 2, B), rise along x and along z."""
        tilt = swing(UPWARDS, (-slope[0], np.ones_like(slope[0]), -slope[1]))
        ball = legs.sole[1]
        heel, tip, ankle = (
            plus(ball, rotated(tilt, minus(point, ball))) for point in (legs.sole[0], legs.sole[2], legs.places[2])
        )
        return Feet(tilt, [heel, ball, tip], ankle)


@dataclass(frozen=True, eq=False)
class TerrainLayer:
    """B figures on their ground; replaced, never written into. Of each number its value, and how fast that changes."""

    place: Array
    """(B, 2) x and z of the hips in the last tick, infinite before the first."""
    hips: Array
    """(B, 2) how much the hips are raised."""
    height: Array
    """(B, 2, 2) how much feet are raised: the values of both feet, then the rates."""
    slope: Array
    """(B, 2, 2, 2) the slopes that feet are tilted to: the values, then the rates; rise along x and along z; feet."""

    @staticmethod
    def none(characters: int) -> "TerrainLayer":
        """Figures that have not been on their ground yet."""
        place = np.full((characters, 2), math.inf)
        zero = np.zeros((characters, 2, 2, 2))
        return TerrainLayer(place, zero[:, 0, 0], zero[:, 0], zero)

    def update(
        self, pose: Pose, terrain: Terrain, settings: TerrainSettings, seconds: float
    ) -> tuple["TerrainLayer", Pose]:
        """A tick later, and the pose of that tick on the ground. ControlError of :meth:`Terrain.heights`."""
        velocity = self._velocity(pose, seconds)
        legs = Legs.of(pose, velocity, settings)
        # tilt: feet turn to the slope under them
        slope = self._follow(self.slope, _slope_under(legs.sole, terrain, settings), settings.tilt, seconds)
        feet = Feet.of(legs, slope[0])
        # feet: raised to the ground, or in time for an edge
        ways = _ways(legs, velocity, settings)
        raised = _raised(legs, feet, ways, terrain)
        height = self._heights(raised, ways, settings, seconds)
        # hips: as high as the lower foot lets them
        lower = _hips_goal(height[0], raised[-1], feet.ankle, legs, settings)
        hips = self._follow(self.hips, lower, settings.hips, seconds)
        layer = TerrainLayer(pose.ground[:, :2], *(np.moveaxis(values, -1, 0) for values in (hips, height, slope)))
        return layer, _reaching(pose, legs, feet, height[0], hips[0])

    @property
    def _is_new(self) -> Flags:
        """(B,) whether a figure has no tick before."""
        return np.isinf(self.place[:, 0])

    def _velocity(self, pose: Pose, seconds: float) -> Array:
        """How fast the hips go (B, 2) along x and z since the last tick."""
        return np.where(self._is_new[:, None], 0.0, pose.ground[:, :2] - self.place) / seconds

    def _heights(self, raised: Array, ways: Array, settings: TerrainSettings, seconds: float) -> Array:
        """How much feet are raised (2, 2, B), and how fast that changes; they are never in the ground."""
        height = self._follow(self.height, _climbing(raised, ways, settings), settings.feet, seconds)
        height[0] = np.maximum(height[0], raised[0])
        return height

    def _follow(self, before: Array, goal: Array, half_life: float, seconds: float) -> Array:
        """Values and rates (2, ..., B) a tick later, of those before (B, 2, ...), on their way to goals (..., B); new
        figures are there."""
        value, rate = np.moveaxis(before, 0, -1)
        error, rate = damped(value - goal, rate, damping_of(half_life), seconds)
        return np.where(self._is_new, [goal, np.zeros_like(goal)], [goal + error, rate])


def _slope_under(sole: Sequence[Vector], terrain: Terrain, settings: TerrainSettings) -> Array:
    """The slope (2, 2, B) under the middle of each foot, rise along x and along z; none where that is an edge."""
    heel, ball, _ = sole
    x = (heel[0] + ball[0]) / 2
    z = (heel[2] + ball[2]) / 2
    spread = settings.spread
    heights = terrain.heights(np.stack([x + spread, x - spread, x, x]), np.stack([z, z, z + spread, z - spread]))
    under = np.stack([heights[0] - heights[1], heights[2] - heights[3]]) / (2 * spread)
    is_edge = np.hypot(under[0], under[1]) > math.tan(math.radians(settings.steepest))
    return np.where(is_edge, 0.0, under)


def _ways(legs: Legs, velocity: Array, settings: TerrainSettings) -> Array:
    """Ways of feet over the ground (GLANCES + 2, 2, 2, B), along x and z: none, some ahead, and to where they land; a
    foot that stands goes nowhere."""
    swings = np.where(legs.stands, 0.0, settings.swings)
    glances = np.linspace(0.0, settings.foresees, GLANCES + 1)[:, None, None] * swings
    to_landing = swings * (1 - legs.swung) * (2 * settings.half_step)
    ways: Array = np.concatenate([glances, to_landing[None]])[:, None] * velocity.T[:, None]
    return ways


def _raised(legs: Legs, feet: Feet, ways: Array, terrain: Terrain) -> Array:
    """How much feet have to be raised (n, 2, B) after ways (n, 2, 2, B) to be as high above the ground as above the
    plane."""
    x, y, z = np.array(feet.sole).swapaxes(0, 1)
    heights = terrain.heights(ways[:, 0, None] + x, ways[:, 1, None] + z)
    clearance = np.stack([point[1] for point in legs.sole]).min(axis=0)
    raised: Array = (heights - y).max(axis=1) + clearance
    return raised


def _climbing(raised: Array, ways: Array, settings: TerrainSettings) -> Array:
    """How much feet are to be raised (2, B): as they have to be here, and before an edge in time, no more steeply than
    they climb."""
    goal: Array = raised[0]
    for height, way in zip(raised[1:-1], ways[1:-1], strict=True):
        goal = np.maximum(goal, height - settings.climbs * np.hypot(way[0], way[1]))
    return goal


def _hips_goal(height: Array, landing: Array, ankle: Vector, legs: Legs, settings: TerrainSettings) -> Array:
    """How much hips are to be raised (B,) above feet that are raised by heights (2, B)."""
    # a foot that stands lets them be as high as its leg reaches, straight at most or as it is on the plane
    standing = height + np.minimum(_spare_reach(ankle, legs.places, settings), 0.0)
    # hips sink to where a swinging foot lands, as far as it has swung
    lower_foot = np.minimum(height[0], height[1])
    sinking = lower_foot + legs.swung * np.minimum(landing - lower_foot, 0.0)
    goal: Array = np.where(legs.stands, standing, sinking).min(axis=0)
    return goal


def _spare_reach(ankle: Vector, places: Sequence[Vector], settings: TerrainSettings) -> Array:
    """How far hips could rise (2, B) until a leg that reaches for its tilted ankle is as long as it may be."""
    hip, _, ankle_on_plane = places[:3]
    reach = np.maximum(settings.straight * LEG_LENGTH, length(minus(ankle_on_plane, hip)))
    away = minus(ankle, hip)
    aside = away[0] ** 2 + away[2] ** 2
    spare: Array = away[1] + np.sqrt(np.maximum(reach**2 - aside, 0.0))
    return spare


def _reaching(pose: Pose, legs: Legs, feet: Feet, height: Array, hips: Array) -> Pose:
    """A pose whose hips are raised (B,), and whose legs reach from there for tilted feet that are raised (2, B)."""
    turned = [*legs.turned[:2], product(feet.tilt, legs.turned[2]), legs.turned[3]]
    ankle = plus(feet.ankle, (0.0, height - hips, 0.0))
    leg = reached_by(legs.hips_turn, turned, legs.places, ankle)
    rotations = with_legs(pose.rotations, [leg])
    return replace(pose, rotations=rotations, height=(pose.height + hips).astype(np.float32))
