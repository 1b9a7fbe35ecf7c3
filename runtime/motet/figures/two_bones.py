"""A leg or an arm that reaches for a place: two-bone inverse kinematics, of one limb or of many at once."""

import numpy as np

from motet.motion.scalar_or_batch import (
    Part,
    Quaternion,
    Vector,
    computed,
    cross,
    dot,
    larger,
    length,
    minus,
    normalised,
    plus,
    product,
    root,
    rotated,
    smaller,
    swing,
    times,
    unit,
    where,
)


class TwoBones:
    """A thigh and a shin, or an upper arm and a forearm: positions of hip, knee and ankle, and the knee's axis, about
    which the shin turns when the knee bends; or of shoulder, elbow and hand. Any unit of length; all of them vectors
    as :mod:`motet.motion.scalar_or_batch` has them."""

    SHORTEST = -0.95
    """The cosine of the largest bend of a knee, 162 degrees: targets beyond it are not reached."""

    FORWARD = 0.97
    """The cosine of 14 degrees: a knee that is bent forward by more, as between two poses it may be, stays so."""

    EASED_SHARE = 0.5
    """The largest lengthening of a leg, as a share of the length left until it is straight."""

    GIVES = (0.012, 0.006)
    """Shares of the length of a straight leg: 1 cm, how much too long it stays when it has to bend; and 5 mm short of
    straight, or a knee bent by 12 degrees, where that is e times less."""

    def __init__(self, hip: Vector, knee: Vector, ankle: Vector, hinge: Vector) -> None:
        self.hip = hip
        self.ankle = ankle
        along = minus(knee, hip)
        down = minus(ankle, knee)
        self._along = along
        self._down = down
        # squares of both lengths
        upper = dot(along, along)
        lower = dot(down, down)
        # the knee turns about the part of the hinge that is square to the thigh
        self._axis = unit(minus(hinge, times(along, dot(hinge, along) / upper)))
        # the part of the shin in the plane of the bend
        in_plane = larger(1 - dot(down, self._axis) ** 2 / lower, 1e-12)
        self._squares = upper + lower
        self._twice = 2 * root(upper * lower * in_plane)
        self.longest = root(self._squares + self._twice)

    def eased(self, target: Vector) -> Vector:
        """The position near a target, on the line to the hip, that the ankle reaches without a snap.

        Near straight, a knee bends or straightens infinitely fast relative to the leg's length. So a leg lengthens less
        the straighter it gets, and a straight one bends only softly.
        """
        # how long the leg is now, how long the target wants it, and how much is left until it is straight
        away = minus(target, self.hip)
        now = length(minus(self.ankle, self.hip))
        wanted = length(away)
        left = larger(self.longest - now, 1e-9)
        # a leg lengthens by less and less of what is left: 1 - exp(-x), which begins as x
        longer = -self.EASED_SHARE * left * computed(np.expm1, -larger(wanted - now, 0.0) / (self.EASED_SHARE * left))
        # and it shortens by x^2 / (x + give), which begins flat where it is straight, and is x where it is bent
        less = larger(now - wanted, 0.0)
        give, fade = (part * self.longest for part in self.GIVES)
        shorter = less * less / larger(less + give * computed(np.exp, -left / fade), 1e-12)
        return plus(self.hip, times(away, (now + longer - shorter) / larger(wanted, 1e-12)))

    def turns(self, target: Vector) -> tuple[Quaternion, Quaternion]:
        """Rotations in the world of thigh and shin that bring the ankle to a target, or as near as possible.

        The knee turns about its axis, as far as that is square to the thigh, until the leg is as long as it has to be,
        bent to the side to which it was bent, back where it was nearly straight; then thigh and shin turn together the
        shortest way.
        """
        # the law of cosines gives the bend for this length; then the leg swings to the target as a whole
        away = minus(target, self.hip)
        bend = self._bend((dot(away, away) - self._squares) / self._twice)
        turn = swing(plus(self._along, rotated(bend, self._down)), away)
        return turn, product(turn, bend)

    def _bend(self, cosine: Part) -> Quaternion:
        """The turn about the axis after which the shin is bent by the angle of a cosine."""
        # the present bend; a negative sine: forward
        along_now = dot(self._along, self._down)
        aside_now = dot(cross(self._along, self._down), self._axis)
        by = 1 / larger(root(along_now * along_now + aside_now * aside_now), 1e-300)
        cosine_now = along_now * by
        sine_now = aside_now * by
        # a knee that is bent more than knees can be is bent no less for it, and keeps its side
        cosine = smaller(larger(cosine, smaller(cosine_now, self.SHORTEST)), 1.0)
        is_forward = (sine_now < 0) & (cosine_now < self.FORWARD)
        sine = root(1 - cosine * cosine)
        sine = where(is_forward, -sine, sine)
        # the cosine and sine of the difference of the angles, and half of it
        turn_cosine = cosine * cosine_now + sine * sine_now
        turn_sine = sine * cosine_now - cosine * sine_now
        half = 1 + turn_cosine
        sine = where(half > 1e-12, turn_sine, 1.0)
        x, y, z = times(self._axis, sine)
        return normalised((x, y, z, half))
