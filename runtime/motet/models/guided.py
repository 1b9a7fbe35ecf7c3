"""What steered characters look at and reach for, and where they are to arrive."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motet.errors import ControlError
from motet.motion.humanoid import LEFT_RIGHT
from motet.motion.looking import Look
from motet.motion.pose import Pose
from motet.motion.reaching import Reach
from motet.motion.rotations import Array

LARGEST_COMMAND = 1e6  # number of a command: metres, m/s, degrees

Who = int | Sequence[int] | None
"""Characters by their numbers from 0, or all."""


@dataclass(frozen=True, eq=False)
class Guidance:
    """What B characters are told besides commands; replaced, never written into."""

    look: Look
    hands: tuple[Reach, Reach]

    @staticmethod
    def none(characters: int) -> "Guidance":
        """Of characters that are told nothing."""
        return Guidance(Look.ahead(characters), (Reach.idle(0, characters), Reach.idle(1, characters)))

    def after(self, pose: Pose, seconds: float) -> tuple["Guidance", Pose]:
        """A tick later, and its pose with heads and arms as they are told."""
        look, pose = self.look.after(pose, seconds)
        left, pose = self.hands[0].after(pose, seconds)
        right, pose = self.hands[1].after(pose, seconds)
        return replace(self, look=look, hands=(left, right)), pose


class Guided:
    """The part of a session that is told points. ``who``: the numbers of the characters that are meant, from 0; by
    default all."""

    def __init__(self, characters: int) -> None:
        self.characters = characters
        self._guidance = Guidance.none(characters)

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

    def _given(self, before: Array, points: ArrayLike | None, who: NDArray[np.int64]) -> Array:
        """Points (B, 3) with new ones for some, NaN for None."""
        found = before.copy()
        found[who] = np.nan if points is None else self._numbers("points need x, y and z", points, 3, count=len(who))
        return found

    def _who(self, who: Who) -> NDArray[np.int64]:
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
