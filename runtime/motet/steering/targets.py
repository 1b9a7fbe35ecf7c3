"""Targets of steered characters: points that they look at, reach for and go to."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motet.errors import ControlError
from motet.figures.humanoid import LEFT_RIGHT
from motet.motion.rotations import Array, wrapped
from motet.steering.arrival import Going
from motet.steering.look_layer import LookLayer
from motet.steering.matching import Rows
from motet.steering.reach_layer import ReachLayer

LARGEST_COMMAND = 1e6  # number of a command: metres, m/s, degrees

CharacterIds = int | Sequence[int] | None
"""Characters by their numbers from 0, or all."""

LONGEST_PATH = 10_000
"""Points of a path."""


@dataclass(frozen=True, eq=False)
class Guidance:
    """The targets of B characters besides commands; replaced, never written into."""

    look: LookLayer
    hands: tuple[ReachLayer, ReachLayer]
    """The left and the right ones."""
    going: Going
    room: float = 0.0
    """Metres that they keep apart, 0 for none."""

    @staticmethod
    def none(characters: int) -> "Guidance":
        """Characters without targets."""
        hands = ReachLayer.idle(0, characters), ReachLayer.idle(1, characters)
        return Guidance(LookLayer.ahead(characters), hands, Going.nowhere(characters))

    def ended(self) -> "Guidance":
        """Without any path."""
        return replace(self, going=Going.nowhere(len(self.going.goes))) if self.going.goes.any() else self


class Guided(ABC):
    """The part of a session that takes points. ``who``: the numbers of the characters that are meant, from 0; by
    default all."""

    def __init__(self, characters: int) -> None:
        self.characters = characters
        self._guidance = Guidance.none(characters)

    @abstractmethod
    def _start_of(self, gait: str | None, speed: Any, characters: Rows) -> tuple[Array, Rows, Array]:
        """Where characters (n,) are (n, 2), the gait in which they are to go (n,), and their speeds (n,)."""

    def go_to(
        self,
        points: ArrayLike | None,
        facing: ArrayLike | None = None,
        *,
        gait: str | None = None,
        speed: ArrayLike | None = None,
        who: CharacterIds = None,
    ) -> None:
        """Let characters go to points on the ground and stand there, or None: stand where they are.

        points: (2,) or one for each (n, 2), x and z in metres. facing: in degrees, how they are to face there, one or
        one for each; by default as they come. gait: by default the one that they have. speed: m/s, by default the
        gait's usual one. They slow down to the end, and :attr:`arrived` tells when they are there; :meth:`control` ends
        it. ControlError for values that are not numbers or do not fit, and for a gait that goes nowhere; nothing has
        changed then.
        """
        numbers = self._chosen(who)
        if points is None:
            self._stand(numbers)
            return
        ends = self._numbers("points need x and z", points, 2, count=len(numbers))
        self._send(list(ends[:, None]), facing, gait, speed, numbers)

    def go_along(
        self,
        points: ArrayLike,
        facing: ArrayLike | None = None,
        *,
        gait: str | None = None,
        speed: ArrayLike | None = None,
        who: CharacterIds = None,
    ) -> None:
        """Let characters go along a path on the ground, from where they are to its first point, and so on to its last,
        where they stand. Everything else is like :meth:`go_to`.

        points: a path (P, 2) for all, or one for each (n, P, 2), x and z in metres, of up to 10,000 points.
        """
        numbers = self._chosen(who)
        try:
            paths = np.array(points, dtype=np.float64)
            paths = np.broadcast_to(paths, (len(numbers), *paths.shape[-2:])) if paths.ndim in (2, 3) else paths[None]
        except (TypeError, ValueError) as error:
            raise ControlError(f"a path needs points of x and z, for all or for each of {len(numbers)}") from error
        if paths.ndim != 3 or paths.shape[2] != 2 or not 1 <= paths.shape[1] <= LONGEST_PATH:
            raise ControlError(f"a path needs 1 to {LONGEST_PATH} points of x and z, not an array {np.shape(points)}")
        if not (np.abs(paths) <= LARGEST_COMMAND).all():
            raise ControlError(f"points of a path must be finite numbers, no larger than {LARGEST_COMMAND:g}")
        self._send(list(paths), facing, gait, speed, numbers)

    def _send(
        self,
        paths: Sequence[Array],
        facing: ArrayLike | None,
        gait: str | None,
        speed: ArrayLike | None,
        characters: Rows,
    ) -> None:
        count = len(characters)
        facings = np.full(count, np.nan)
        if facing is not None:
            facings = np.radians(self._numbers("facing needs a number", facing, count=count))
        speeds = None if speed is None else self._numbers("speed needs a number", speed, count=count)
        if speeds is not None and not (speeds > 0).all():
            raise ControlError("speed must be above 0 m/s; points of None let characters stand")
        here, gaits, speeds = self._start_of(gait, speeds, characters)
        whole = [np.concatenate([start[None], path]) for start, path in zip(here, paths, strict=True)]
        going = self._guidance.going.sent(characters, whole, facing=wrapped(facings), gait=gaits, speed=speeds)
        self._guidance = replace(self._guidance, going=going)

    def _stand(self, characters: Rows) -> None:
        here, _, _ = self._start_of(None, None, characters)
        self._send(list(here[:, None]), None, None, None, characters)

    @property
    def arrived(self) -> NDArray[np.bool_]:
        """Which characters (characters,) stand, within 8 cm and 8 degrees, where they were last sent."""
        return self._guidance.going.arrived.copy()

    def keep_apart(self, room: float | None = 0.8) -> None:
        """Let the characters of the session that move keep ``room`` metres from all others, 0.1 to 5, by going around
        them, as far as there is room; None lets them go through each other. ControlError for another number."""
        if room is not None and not (isinstance(room, int | float) and 0.1 <= room <= 5):
            raise ControlError(f"characters keep 0.1 to 5 m apart, or None, not {room!r}")
        self._guidance = replace(self._guidance, room=room or 0.0)

    def look_at(self, points: ArrayLike | None, *, who: CharacterIds = None) -> None:
        """Let characters look at points in the world from now on, or None: ahead again, as they are recorded.

        points: (3,) or one for each (n, 3), x, y and z in metres. Head, neck and upper spine share the turn, up to 85
        degrees aside and 50 up or down; a point nearer to the eyes than 20 cm is not looked at. It may move: steps of
        the gaze of up to 10 degrees a tick are followed at once, others within half a second. ControlError for values
        that are not numbers or do not fit; nothing has changed then.
        """
        look = self._guidance.look
        look = replace(look, points=self._with_points(look.points, points, self._chosen(who)))
        self._guidance = replace(self._guidance, look=look)

    def reach(self, hand: Literal["left", "right"], points: ArrayLike | None, *, who: CharacterIds = None) -> None:
        """Let a hand of characters be at points in the world from now on, or None: as it is recorded.

        points: (3,) or one for each (n, 3), x, y and z in metres, for the middle of the hand. Only the arm moves. A
        point that is too far, or behind the back, is out of reach: the hand goes as near as it can, and
        :attr:`out_of_reach` tells. ControlError like :meth:`look_at`.
        """
        if hand not in LEFT_RIGHT:
            raise ControlError(f"unknown hand {hand!r}; expected left or right")
        left, right = self._guidance.hands
        layer = left if hand == "left" else right
        layer = replace(layer, points=self._with_points(layer.points, points, self._chosen(who)))
        hands = (layer, right) if hand == "left" else (left, layer)
        self._guidance = replace(self._guidance, hands=hands)

    @property
    def out_of_reach(self) -> NDArray[np.bool_]:
        """Whether what the left and the right hand reach for was out of reach in the last tick (characters, 2)."""
        return np.stack([hand.beyond for hand in self._guidance.hands], axis=1)

    def _with_points(self, before: Array, points: ArrayLike | None, characters: Rows) -> Array:
        """Points (B, 3) with new ones for some characters (n,), NaN for None."""
        after = before.copy()
        if points is None:
            after[characters] = np.nan
        else:
            after[characters] = self._numbers("points need x, y and z", points, 3, count=len(characters))
        return after

    def _chosen(self, ids: CharacterIds) -> Rows:
        """The numbers of characters."""
        if ids is None:
            return np.arange(self.characters)
        numbers = np.atleast_1d(np.array(ids))
        are_whole = numbers.ndim == 1 and numbers.dtype.kind in "iu" and len(numbers) > 0
        exist = are_whole and (numbers >= 0).all() and (numbers < self.characters).all()
        if not exist or len(set(numbers)) < len(numbers):
            raise ControlError(
                f"who must be numbers of characters from 0 to {self.characters - 1}, none twice, not {ids!r}"
            )
        return numbers.astype(np.int64)

    def _numbers(self, needed: str, values: Any, *columns: int, count: int | None = None) -> Array:
        """Numbers for all characters or for each, as a new (count, *columns); by default for all of the session."""
        count = self.characters if count is None else count
        try:
            numbers = np.array(values, dtype=np.float64)
            if numbers.shape not in (columns, (1, *columns), (count, *columns)):
                raise ValueError(numbers.shape)
        except (TypeError, ValueError) as error:
            alternatives = ", for all or" if columns else " or one"
            raise ControlError(f"{needed}{alternatives} for each of {count} characters") from error
        if not (np.abs(numbers) <= LARGEST_COMMAND).all():
            raise ControlError(
                f"{needed.partition(' need')[0]} must be finite numbers, no larger than {LARGEST_COMMAND:g}"
            )
        return np.array(np.broadcast_to(numbers, (count, *columns)))
