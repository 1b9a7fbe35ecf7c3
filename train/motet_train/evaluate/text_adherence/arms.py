"""Rules on arms and hands: raising, waving, punching, reaching. Each says whether a track does it.

side: "left", "right", or "both", and where it says so "either".
"""

import numpy as np

from motet.motion.humanoid import HUMANOID, LEFT_RIGHT
from motet.motion.rotations import Array
from motet_train.evaluate.text_adherence.track import RATE, Flags, Track, calm, longest, pair, spells, swings

HANDS = pair("Hand")


def raises(track: Track, side: str, above: float, seconds: float = 0.3) -> bool:
    """A hand is so many metres above the head's joint, about the mouth, for a while; "both": at the same time."""
    up = [hand - track.height("head") >= above for hand in track.heights("Hand")]
    return longest(_hands(up, side)) >= seconds


def waves(track: Track, count: int) -> bool:
    """A raised hand, above its elbow and about shoulder height, goes from side to side so many times, by 10 cm."""
    parts = zip(track.bodies("Hand"), track.heights("LowerArm"), track.heights("UpperArm"), strict=True)
    return any(
        swings(hand[start:stop, 0], 0.1) >= count
        for hand, elbow, shoulder in parts
        for start, stop in spells(hand[:, 1] > np.maximum(elbow, shoulder - 0.1))
    )


def punches(track: Track, side: str, speed: float = 2.5, count: int = 1) -> bool:
    """A hand shoots forward or up from the chest at a speed, m/s, so many times; "both": each does. Asked for one side,
    it is half as fast again as the other hand."""
    thrust = dict(zip(LEFT_RIGHT, (_thrust(track, name) for name in HANDS), strict=True))
    if side in LEFT_RIGHT:
        own = thrust.pop(side)
        (other,) = thrust.values()
        if own.max() < 1.5 * other.max():
            return False
        thrust = {side: own}
    return all(len(spells(one >= speed)) >= count for one in thrust.values())


def reaches_down(track: Track, most: float, side: str = "either") -> bool:
    """A hand comes as near to the ground as so many metres, for a moment."""
    return longest(_hands([hand <= most for hand in track.heights("Hand")], side)) >= 0.1


def wipes(track: Track, count: int) -> bool:
    """A hand, in front and above the chest for a third of the time, goes up and down or sideways so many times, by 20
    cm."""

    def found(hand: Array) -> bool:
        there = (hand[:, 1] > track.height("upperChest")) & (hand[:, 2] > 0.2)
        moves = max(sum(swings(hand[a:b, i], 0.2) for a, b in spells(there)) for i in (0, 1))
        return bool(there.mean() >= 0.3) and moves >= count

    return any(map(found, track.bodies("Hand")))


def to_mouth(track: Track) -> bool:
    """One hand is at the mouth for half a second, the other one lower than the chest."""
    near = [np.linalg.norm(track.joint(name) - track.joint("head"), axis=1) < 0.42 for name in HANDS]
    low = [hand < track.height("chest") + 0.05 for hand in track.heights("Hand")]
    return max(longest(near[0] & low[1]), longest(near[1] & low[0])) >= 0.5


def on_guard(track: Track, share: float = 0.5) -> bool:
    """Both hands are in front of the chest, between its height and the mouth, for a share of the time."""
    low, high = track.height("chest") - 0.1, track.height("head") + 0.05
    up = [(hand[:, 1] > low) & (hand[:, 1] < high) & (hand[:, 2] > 0.1) for hand in track.bodies("Hand")]
    return bool((up[0] & up[1]).mean() >= share)


def hands_together(track: Track, most: float, share: float = 0.5) -> bool:
    """The hands are no farther than so many metres apart for a share of the time."""
    return bool((_between_hands(track) <= most).mean() >= share)


def arms_out(track: Track) -> bool:
    """The arms are spread, the hands 90 cm apart or more, for a while."""
    return longest(_between_hands(track) >= 0.9) >= 0.3


def arms_ahead(track: Track) -> bool:
    """Both arms are stretched out to the front at about shoulder height for half of the time."""
    arm = sum(np.linalg.norm(HUMANOID.offsets[HUMANOID.index(name)]) for name in ("leftLowerArm", "leftHand"))
    away = [hand - shoulder for hand, shoulder in zip(track.bodies("Hand"), track.bodies("UpperArm"), strict=True)]
    out = [(one[:, 2] > 0.6 * arm) & (np.abs(one[:, 1]) < 0.3) for one in away]
    return bool((out[0] & out[1]).mean() >= 0.5)


def swings_arms(track: Track, count: int, metres: float = 0.2) -> bool:
    """Both hands, relative to the hips, go to and fro by so many metres so many times, or both from side to side."""
    hands = track.bodies("Hand")
    return any(min(swings(hand[:, axis], metres) for hand in hands) >= count for axis in (0, 1, 2))


def hands_still(track: Track, most: float) -> bool:
    """The hands move relative to the hips by no more than so many m/s, on the whole: they do not swing."""
    return all(track.motion_of(name).mean() <= most for name in HANDS)


def hands_move(track: Track, least: float, most: float = np.inf) -> bool:
    """The mean speed of the hands relative to the chest is from least to most, m/s."""
    return bool(least <= np.mean([track.motion_of(name, "upperChest").mean() for name in HANDS]) <= most)


def hands_fast(track: Track, least: float) -> bool:
    """A hand reaches a speed relative to the chest, m/s."""
    return bool(max(track.motion_of(name, "upperChest").max() for name in HANDS) >= least)


def _between_hands(track: Track) -> Array:
    """The distance (T,) between the wrists, metres."""
    left, right = map(track.joint, HANDS)
    found: Array = np.linalg.norm(left - right, axis=1)
    return found


def _thrust(track: Track, hand: str) -> Array:
    """How fast (T,) a hand goes forward and up relative to the chest, m/s; 0 where it comes back."""
    speed = np.maximum(np.diff(track.body(hand) - track.body("chest"), axis=0) * RATE, 0)
    return np.concatenate([[0.0], calm(np.hypot(speed[:, 2], speed[:, 1]), 0.1)])


def _hands(flags: list[Flags], side: str) -> Flags:
    """Frames in which a hand, one of both, or both do what each of them does in ``flags``."""
    if side in LEFT_RIGHT:
        return flags[LEFT_RIGHT.index(side)]
    return flags[0] | flags[1] if side == "either" else flags[0] & flags[1]
