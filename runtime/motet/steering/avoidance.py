"""Steered figures that keep apart by reciprocal velocity obstacles (ORCA: van den Berg et al. 2011).

A place and a velocity are those of where a figure would come to rest, which changes its velocity at once. For each pair
that could meet within the next seconds there is a smallest change of their relative velocity by which they do not.
Each makes half of it, or one that passes somebody who stands makes all of it; so each pair leaves a figure half of the
plane of velocities. It takes the velocity nearest to the one wanted in all these half-planes, or as nearly in them as
it can. Two that meet head on both pass on the same side. Who is held up wishes to go
round to the left, so that a jam turns, and dissolves.

Letters in shapes: B figures, n pairs, S pairs of a figure at most.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from motet.motion.rotations import Array
from motet.settings import Settings
from motet.steering.matching import Flags
from motet.steering.settings import Count, Metres, Radians, Seconds, Share, Speed

Numbers = NDArray[np.intp]


@dataclass(frozen=True)
class AvoidanceSettings(Settings):
    """Settings of figures that keep apart."""

    FEATURE: ClassVar[str] = "avoidance"

    soon: Seconds = 2.0
    """How far ahead in time figures look."""
    parts: Seconds = 0.4
    """Seconds in which two that are too near to each other part."""
    closes: Speed = 1.0
    """How fast a gap closes at most: pairs look no farther ahead than that takes, and ``parts`` seconds."""
    sight: Metres = 5.0
    """Distance along x or z beyond which they see nobody."""
    heeds: Count = 8
    """How many others they heed, the nearest ones."""
    sweeps: Count = 8
    """How often all half-planes are gone through."""
    yields: Share = 0.3
    """How far half-planes that exclude each other yield: 0 for not at all."""
    dodges: Speed = 0.6
    """How fast slower ones may go to keep apart."""
    waits: Speed = 0.02
    """If the detour is slower than this, wait instead."""
    rejoins: Metres = 0.1
    """How far from its path a figure among others goes straight on to the next corner."""
    standing: Share = 0.7
    """Share of the room that is kept from those who stand."""
    gives_way: Radians = 0.9
    """How far to the left of where it wants to go a figure goes that is held up, and less if it only slows down."""


def kept_apart(
    places: Array, velocities: Array, wanted: Array, moves: Flags, room: float, settings: AvoidanceSettings
) -> Array:
    """Velocities (B, 2) in m/s, near to the ``wanted`` ones (B, 2), of figures at places (B, 2) with velocities (B, 2)
    that keep ``room`` metres, no faster than wanted or ``dodges``. moves: which figures go (B,), around others."""
    figure, other = _pairs(places, moves, settings.sight)
    gap = places[other] - places[figure]
    closing = velocities[figure] - velocities[other]
    # only those that come near
    meets = _nearest(gap, closing, settings.soon) < 2 * room
    figure = figure[meets]
    other = other[meets]
    gap = gap[meets]
    rooms = room * np.where(moves[other], 1.0, settings.standing)
    change, way = _changes(gap, closing[meets], rooms, settings)
    # the half-plane of each pair: velocities that go at least so fast that way
    share = np.where(moves[other], 0.5, 1.0)
    least = (velocities[figure] * way).sum(axis=1) + share * change
    # half-planes that exclude each other yield, the more the farther off the other is
    distance = np.hypot(*gap.T)
    yields = settings.yields * (distance / room - 1).clip(0.25, None)
    planes = np.column_stack([way, least, yields])
    most = np.maximum(np.hypot(*wanted.T), settings.dodges)
    by_figure = _by_figure(figure, distance, planes, len(places), settings.heeds)
    wish = _wish(wanted, velocities, settings.gives_way)
    allowed = _nearest_allowed(wish, by_figure, most, settings.sweeps)
    heeds = np.isin(np.arange(len(places)), figure)
    return np.where(heeds[:, None], allowed, wanted)


def _pairs(places: Array, moves: Flags, sight: float) -> tuple[Numbers, Numbers]:
    """All pairs (n,), (n,) of a figure that moves and another one that it sees, at places (B, 2)."""
    x, z = places.T
    near_x = np.abs(x[:, None] - x) < sight
    near_z = np.abs(z[:, None] - z) < sight
    sees = near_x & near_z & moves[:, None]
    np.fill_diagonal(sees, val=False)
    figure, other = np.nonzero(sees)
    return figure, other


def _nearest(gap: Array, closing: Array, soon: float) -> Array:
    """How near pairs (n,) come within some seconds, with gaps (n, 2) that close by velocities (n, 2)."""
    squared_speed = np.maximum((closing * closing).sum(axis=1), 1e-6)
    seconds = ((gap * closing).sum(axis=1) / squared_speed).clip(0, soon)
    nearest: Array = np.hypot(*(gap - seconds[:, None] * closing).T)
    return nearest


def _changes(gap: Array, closing: Array, room: Array, settings: AvoidanceSettings) -> tuple[Array, Array]:
    """The smallest changes (n,) of the velocities ``closing`` (n, 2), which may be negative, and their directions
    (n, 2), by which pairs with gaps (n, 2) keep rooms (n,) soon; those that are too near part."""
    apart = np.hypot(*gap.T)
    seconds = (settings.parts + np.maximum(apart - room, 0) / settings.closes).clip(None, settings.soon)
    # velocities that meet are in a cone that a circle cuts off: out of it past the circle
    from_circle = closing - gap / seconds[:, None]
    off = np.hypot(*from_circle.T)
    circle_way = directions_of(from_circle)
    circle_change = room / seconds - off
    # or over the nearer leg of the cone
    leg = np.sqrt(np.maximum(apart**2 - room**2, 0.0))
    side = np.where(_cross(gap, from_circle) > 0, 1.0, -1.0)
    across = np.stack([-gap[:, 1], gap[:, 0]], axis=1)
    leg_way = directions_of((leg * side)[:, None] * across - room[:, None] * gap)
    leg_change = -(closing * leg_way).sum(axis=1)
    # past the circle where that is nearer
    towards = (from_circle * gap).sum(axis=1)
    past_circle = (towards < 0) & (towards**2 > room**2 * off**2)
    change = np.where(past_circle, circle_change, leg_change)
    way = np.where(past_circle[:, None], circle_way, leg_way)
    # those that are too near part
    too_near = apart < room
    away = directions_of(-gap)
    change = np.where(too_near, (room - apart) / settings.parts - (closing * away).sum(axis=1), change)
    return change, np.where(too_near[:, None], away, way)


def _wish(wanted: Array, velocities: Array, gives_way: float) -> Array:
    """Velocities (B, 2) as fast as those that are wanted (B, 2), the farther to the left the less of them is in the
    velocities (B, 2) of figures."""
    squared_pace = np.maximum((wanted * wanted).sum(axis=1), 1e-9)
    angle = gives_way * (1 - (velocities * wanted).sum(axis=1) / squared_pace).clip(0, 1)
    x, z = wanted.T
    return np.stack([x * np.cos(angle) + z * np.sin(angle), z * np.cos(angle) - x * np.sin(angle)], axis=1)


def _by_figure(figure: Numbers, distance: Array, planes: Array, figures: int, most: int) -> Array:
    """The half-planes (S, 4, figures) of the nearest pairs of each figure, 0 for none: their ways, the least velocities
    that way, and how far they yield."""
    order = np.lexsort((distance, figure))
    figure = figure[order]
    slot = np.arange(len(figure)) - np.searchsorted(figure, figure)
    kept = slot < most
    slots = int(slot[kept].max(initial=-1)) + 1
    by_figure = np.zeros((slots, 4, figures))
    by_figure[slot[kept], :, figure[kept]] = planes[order][kept]
    return by_figure


def _nearest_allowed(wanted: Array, planes: Array, most: Array, sweeps: int) -> Array:
    """Velocities (B, 2) near to the wanted ones within half-planes (S, 4, B), no faster than ``most`` (B,): least
    squares of the change and of what is missing, by the method of Hildreth and Dykstra, a half-plane at a time."""
    x, z = wanted.T.copy()
    pushes = np.zeros((len(planes), len(wanted)))
    slowed_x = np.zeros_like(x)
    slowed_z = np.zeros_like(z)
    for _ in range(sweeps):
        # the nearest last, which so is kept the best
        for plane, (way_x, way_z, least, yields) in reversed(list(enumerate(planes))):
            missing = least - (x * way_x + z * way_z)
            step = np.maximum((missing - yields * pushes[plane]) / (1 + yields), -pushes[plane])
            pushes[plane] += step
            x += step * way_x
            z += step * way_z
        # no faster
        fast_x = x + slowed_x
        fast_z = z + slowed_z
        share = np.minimum(1, most / np.maximum(np.hypot(fast_x, fast_z), 1e-9))
        x = fast_x * share
        z = fast_z * share
        slowed_x = fast_x - x
        slowed_z = fast_z - z
    return np.stack([x, z], axis=1)


def _cross(first: Array, second: Array) -> Array:
    """The vertical components (n,) of cross products of vectors (n, 2) over the ground."""
    product: Array = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    return product


def directions_of(vectors: Array) -> Array:
    """Vectors (n, 2) over the ground of length 1, or less of shorter ones than a micrometre."""
    units: Array = vectors / np.maximum(np.hypot(*vectors.T), 1e-6)[:, None]
    return units
