"""Two-bone inverse kinematics: thigh and shin turn to move the ankle to a target."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from motet.motion.rotations import Array, product, rotated, rotvec_to_rotmat, swing, unit

MOST_BENT = -0.95
"""The cosine of the largest bend of a knee, 162 degrees: targets beyond it are not reached."""

EASED_SHARE = 0.5
"""The largest lengthening of a leg, as a share of the length left until it is straight."""

GIVES = (0.012, 0.006)
"""Shares of the length of a straight leg: 1 cm, how much too long it stays when it has to bend; and 5 mm short of
straight, or a knee bent by 12 degrees, where that is e times less."""


@dataclass(frozen=True, eq=False)
class Leg:
    """A thigh and a shin: positions of hip, knee and ankle (T, 3), and the knee's axis (T, 3), about which the shin
    turns back when the knee bends. Any unit of length."""

    hip: Array
    knee: Array
    ankle: Array
    hinge: Array

    def eased(self, target: Array) -> Array:
        """The position (T, 3) near ``target`` (T, 3), on the line to the hip, that the ankle reaches without a snap.

        Near straight, a knee bends or straightens infinitely fast relative to the leg's length. So a leg lengthens less
        the straighter it gets, and a straight one bends only softly.
        """
        away = target - self.hip
        now, wanted = _length(self.ankle - self.hip), _length(away)
        left = np.maximum(self._longest - now, 1e-9)
        longer = -EASED_SHARE * left * np.expm1(-np.maximum(wanted - now, 0) / (EASED_SHARE * left))
        less = np.maximum(now - wanted, 0)
        give, fade = (part * self._longest for part in GIVES)
        shorter = less**2 / np.maximum(less + give * np.exp(-left / fade), 1e-12)
        found: Array = self.hip + away * ((now + longer - shorter) / np.maximum(wanted, 1e-12))
        return found

    def turns(self, target: Array) -> tuple[Array, Array]:
        """World rotations (T, 3, 3) of thigh and shin that bring the ankle to ``target`` (T, 3), or as near as
        possible.

        The knee turns about its axis, as far as that is square to the thigh, until the leg is as long as it has to be,
        bent back, as knees are, even where it was bent forward;
        then thigh and shin turn together the shortest way. What of the shin stands out of the plane of the bend stays.
        """
        upper, lower = self._upper, self._lower
        cosine = (_length(target - self.hip) ** 2 - upper**2 - lower**2) / (2 * upper * lower * self._in_plane)
        bent = self._bent
        after = np.arccos(np.clip(cosine, MOST_BENT, 1.0))
        bend = rotvec_to_rotmat(self._axis * (after - bent))
        ankle = self.knee - self.hip + rotated(bend, self.ankle - self.knee)
        turn = swing(ankle, target - self.hip)
        return turn, product(turn, bend)

    @cached_property
    def _upper(self) -> Array:
        return _length(self.knee - self.hip)

    @cached_property
    def _lower(self) -> Array:
        return _length(self.ankle - self.knee)

    @cached_property
    def _axis(self) -> Array:
        along = self.knee - self.hip
        return unit(self.hinge - _dot(self.hinge, along) / _dot(along, along) * along)

    @cached_property
    def _bent(self) -> Array:
        """The knee's bend in radians (T, 1), negative if forward."""
        along, down = self.knee - self.hip, self.ankle - self.knee
        found: Array = np.arctan2(_dot(np.cross(along, down), self._axis), _dot(along, down))
        return found

    @cached_property
    def _in_plane(self) -> Array:
        """The part of the shin in the plane of the bend."""
        out = _dot(unit(self.ankle - self.knee), self._axis)
        return np.sqrt(np.maximum(1 - out**2, 1e-12))

    @cached_property
    def _longest(self) -> Array:
        upper, lower = self._upper, self._lower
        return np.sqrt(upper**2 + lower**2 + 2 * upper * lower * self._in_plane)


def _dot(one: Array, other: Array) -> Array:
    found: Array = (one * other).sum(axis=-1, keepdims=True)
    return found


def _length(vectors: Array) -> Array:
    found: Array = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return found
