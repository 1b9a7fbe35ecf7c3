"""What steered characters look at and reach for, and where they are to arrive."""

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
from motet.steering.look_layer import Look
from motet.steering.matching import Rows
from motet.steering.pose import Pose
from motet.steering.reach_layer import Reach

LARGEST_COMMAND = 1e6  # number of a command: metres, m/s, degrees

Who = int | Sequence[int] | None
"""Characters by their numbers from 0, or all."""


LONGEST_PATH = 10_000
"""Points of a path."""


@dataclass(frozen=True, eq=False)
class Guidance:
    """What B characters are told besides commands; replaced, never written into. room: metres that they keep apart, 0
    for none."""

    look: Look
    hands: tuple[Reach, Reach]
    going: Going
    room: float = 0.0

    @staticmethod
    def none(characters: int) -> "Guidance":
        """Of characters that are told nothing."""
        hands = Reach.idle(0, characters), Reach.idle(1, characters)
        return Guidance(Look.ahead(characters), hands, Going.nowhere(characters))

    def ended(self) -> "Guidance":
        """Without any way to go."""
        return replace(self, going=Going.nowhere(len(self.going.goes))) if self.going.goes.any() else self

    def after(self, pose: Pose, seconds: float) -> tuple["Guidance", Pose]:
        """A tick later, and its pose with heads and arms as they are told."""
        look, pose = self.look.after(pose, seconds)
        left, pose = self.hands[0].after(pose, seconds)
        right, pose = self.hands[1].after(pose, seconds)
        rests = look is self.look and (left, right) == self.hands
        return self if rests else replace(self, look=look, hands=(left, right)), pose


class Guided(ABC):
    """The part of a session that is told points. ``who``: the numbers of the characters that are meant, from 0; by
    default all."""

    def __init__(self, characters: int) -> None:
        self.characters = characters
        self._guidance = Guidance.none(characters)

    @abstractmethod
    def _start_of(self, gait: str | None, speed: Any, who: Rows) -> tuple[Array, Rows, Array]:
        """Where characters (n,) are (n, 2), the gait in which they are to go (n,), and their speeds (n,)."""

    def go_to(
        self,
        points: ArrayLike | None,
        facing: ArrayLike | None = None,
        *,
        gait: str | None = None,
        speed: ArrayLike | None = None,
        who: Who = None,
    ) -> None:
        """Let characters go to points on the ground and stand there, or None: stand where they are.

        points: (2,) or one for each (n, 2), x and z in metres. facing: in degrees, how they are to face there, one or
        one for each; by default as they come. gait: by default the one that they have. speed: m/s, by default the
        gait's usual one. They slow down to the end, and :attr:`arrived` tells when they are there; :meth:`control` ends
        it. ControlError for values that are not numbers or do not fit, and for a gait that goes nowhere; nothing has
        changed then.
        """
        numbers = self._who(who)
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
        who: Who = None,
    ) -> None:
        """Let characters go along a path on the ground, from where they are to its first point, and so on to its last,
        where they stand. Everything else is like :meth:`go_to`.

        points: a path (P, 2) for all, or one for each (n, P, 2), x and z in metres, of up to 10,000 points.
        """
        numbers = self._who(who)
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
        self, paths: Sequence[Array], facing: ArrayLike | None, gait: str | None, speed: ArrayLike | None, who: Rows
    ) -> None:
        faces = np.full(len(who), np.nan)
        if facing is not None:
            faces = np.radians(self._numbers("facing needs a number", facing, count=len(who)))
        paces = None if speed is None else self._numbers("speed needs a number", speed, count=len(who))
        if paces is not None and not (paces > 0).all():
            raise ControlError("speed must be above 0 m/s; points of None let characters stand")
        here, gaits, paces = self._start_of(gait, paces, who)
        whole = [np.concatenate([start[None], path]) for start, path in zip(here, paths, strict=True)]
        going = self._guidance.going.sent(who, whole, facing=wrapped(faces), gait=gaits, speed=paces)
        self._guidance = replace(self._guidance, going=going)

    def _stand(self, who: Rows) -> None:
        here, _, _ = self._start_of(None, None, who)
        self._send(list(here[:, None]), None, None, None, who)

    @property
    def arrived(self) -> NDArray[np.bool_]:
        """Which characters (characters,) stand, within 8 cm and 8 degrees, where they were told to go last."""
        return self._guidance.going.arrived.copy()

    def keep_apart(self, room: float | None = 0.8) -> None:
        """Let the characters of the session that move keep ``room`` metres from all others, 0.1 to 5, by going around
        them, as far as there is room; None lets them go through each other. ControlError for another number."""
        if room is not None and not (isinstance(room, int | float) and 0.1 <= room <= 5):
            raise ControlError(f"characters keep 0.1 to 5 m apart, or None, not {room!r}")
        self._guidance = replace(self._guidance, room=room or 0.0)

    def look_at(self, points: ArrayLike | None, *, who: Who = None) -> None:
        """Let characters look at points in the world from now on, or None: ahead again, as they are recorded.

        points: (3,) or one for each (n, 3), x, y and z in metres. Head, neck and upper spine share the turn, up to 85
        degrees aside and 50 up or down; a point nearer to the eyes than 20 cm is not looked at. It may move: steps of
        the gaze of up to 10 degrees a tick are followed at once, others within half a second. ControlError for values
        that are not numbers or do not fit; nothing has changed then.
        """
        look, numbers = self._guidance.look, self._who(who)
        self._guidance = replace(self._guidance, look=replace(look, points=self._given(look.points, points, numbers)))

    def reach(self, hand: Literal["left", "right"], points: ArrayLike | None, *, who: Who = None) -> None:
        """Let a hand of characters be at points in the world from now on, or None: as it is recorded.

        points: (3,) or one for each (n, 3), x, y and z in metres, for the middle of the hand. Only the arm moves. A
        point that is too far, or behind the back, is out of reach: the hand goes as near as it can, and
        :attr:`out_of_reach` tells. ControlError like :meth:`look_at`.
        """
        if hand not in LEFT_RIGHT:
            raise ControlError(f"unknown hand {hand!r}; expected left or right")
        hands, side, numbers = list(self._guidance.hands), LEFT_RIGHT.index(hand), self._who(who)
        hands[side] = replace(hands[side], points=self._given(hands[side].points, points, numbers))
        self._guidance = replace(self._guidance, hands=(hands[0], hands[1]))

    @property
    def out_of_reach(self) -> NDArray[np.bool_]:
        """Whether what the left and the right hand reach for was out of reach in the last tick (characters, 2)."""
        return np.stack([hand.beyond for hand in self._guidance.hands], axis=1)

    def _given(self, before: Array, points: ArrayLike | None, who: Rows) -> Array:
        """Points (B, 3) with new ones for some, NaN for None."""
        found = before.copy()
        found[who] = np.nan if points is None else self._numbers("points need x, y and z", points, 3, count=len(who))
        return found

    def _who(self, who: Who) -> Rows:
        """The numbers of characters."""
        if who is None:
            return np.arange(self.characters)
        found = np.atleast_1d(np.array(who))
        fits = found.ndim == 1 and found.dtype.kind in "iu" and len(found)
        if not (fits and (found >= 0).all() and (found < self.characters).all() and len(set(found)) == len(found)):
            raise ControlError(
                f"who must be numbers of characters from 0 to {self.characters - 1}, none twice, not {who!r}"
            )
        return found.astype(np.int64)

    def _numbers(self, needed: str, values: Any, *columns: int, count: int | None = None) -> Array:
        """Numbers for all characters or for each, as a new (count, *columns); by default for all of the session."""
        count = self.characters if count is None else count
        try:
            found = np.array(values, dtype=np.float64)
            if found.shape not in (columns, (1, *columns), (count, *columns)):
                raise ValueError(found.shape)
        except (TypeError, ValueError) as error:
            one = ", for all or" if columns else " or one"
            raise ControlError(f"{needed}{one} for each of {count} characters") from error
        if not (np.abs(found) <= LARGEST_COMMAND).all():
            raise ControlError(
                f"{needed.partition(' need')[0]} must be finite numbers, no larger than {LARGEST_COMMAND:g}"
            )
        return np.array(np.broadcast_to(found, (count, *columns)))
