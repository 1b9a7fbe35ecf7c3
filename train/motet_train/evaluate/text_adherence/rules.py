"""The rules of prompts: each public function takes a :class:`Track` and says whether it does something.

side: "left", "right", or "both", and where it says so "either".
"""

import numpy as np

from motet.figures.humanoid import HUMANOID, LEFT_RIGHT, T_POSE, sided
from motet.motion.rotations import Array
from motet_train.evaluate.positions import Flags, length, spells
from motet_train.evaluate.text_adherence.track import RATE, Track, calm, direction, longest, pair, swings

WAYS = {"forward": (0, 1), "backward": (0, -1), "left": (1, 1), "right": (1, -1)}
"""Way -> the column of the velocity, and its sign."""

CLEAR = 0.1
"""Metres: both feet higher than this are off the ground; feet in runs are not, for more than a moment."""

HANDS = pair("Hand")


def goes(track: Track, way: str, least: float, most: float = np.inf, metres: float = 0.0) -> bool:
    """Goes one way at a typical velocity from least to most, m/s, and comes so many metres that way in all.

    A quarter of the frames has more than the typical velocity, so that standing at the ends does not matter.
    """
    column, sign = WAYS[way]
    there = sign * track.velocity[:, column]
    return bool(least <= np.percentile(there, 75) <= most and there.sum() / RATE >= metres)


def sidesteps(track: Track, side: str, metres: float) -> bool:
    """Comes so many metres to one side of where it faces, and not as far forward or back."""
    ahead, left = track.velocity.sum(axis=0) / RATE
    return bool(WAYS[side][1] * left >= max(metres, abs(ahead)))


def travels(track: Track, metres: float) -> bool:
    """Ends so many metres or more away from where it started."""
    return bool(np.linalg.norm(track.path[-1] - track.path[0]) >= metres)


def wanders(track: Track) -> bool:
    """Goes two metres over the ground or more, and ends less than half of its way from where it started."""
    way = float(track.pace.sum() / RATE)
    return way >= 2.0 and not travels(track, way / 2)


def turns(track: Track, least: float, most: float = np.inf) -> bool:
    """Turns by least to most degrees from start to end, to the left where they are above 0."""
    return least <= track.turn <= most


def turned_about(track: Track, least: float, most: float = np.inf) -> bool:
    """Turns by least to most degrees, no matter to which side: between the two headings that are farthest apart."""
    return bool(least <= np.ptp(calm(track.facing, 0.3)) <= most)


def straight(track: Track, most: float = 30.0) -> bool:
    """Heads where it headed at first, within so many degrees."""
    return abs(track.turn) <= most


def starts(track: Track, least: float = 0.0, most: float = np.inf) -> bool:
    """Moves at a speed from least to most, m/s, in the first 0.4 s."""
    return bool(least <= np.median(track.pace[: round(0.4 * RATE)]) <= most)


def ends(track: Track, least: float = 0.0, most: float = np.inf) -> bool:
    """Moves at a speed from least to most, m/s, in the last 0.4 s."""
    return bool(least <= np.median(track.pace[-round(0.4 * RATE) :]) <= most)


def reaches(track: Track, least: float = 0.0, most: float = np.inf) -> bool:
    """The highest speed, but for a tenth of the time, is from least to most, m/s."""
    return bool(least <= np.percentile(track.pace, 90) <= most)


def stays(track: Track, most: float) -> bool:
    """Is never farther than so many metres from where it was at first."""
    return bool(length(track.path - track.path[0]).max() <= most)


def strides(track: Track, least: int = 2, most: float = np.inf) -> bool:
    """One foot is moved past the other, by 20 cm, from least to most times."""
    left, right = track.bodies("Foot")
    return least <= swings(left[:, 2] - right[:, 2], 0.2) <= most


def bobs(track: Track, metres: float) -> bool:
    """The hips move up and down by so many metres in the typical half second."""
    window = min(round(0.5 * RATE), len(track))
    return bool(np.median(np.ptp(np.lib.stride_tricks.sliding_window_view(track.height("hips"), window), 1)) >= metres)


def rises_and_falls(track: Track, metres: float, count: int) -> bool:
    """The hips go up or down by so many metres at least so many times."""
    return swings(track.height("hips"), metres) >= count


def hips(track: Track, least: float = -np.inf, most: float = np.inf) -> bool:
    """The hips are always from least to most metres above the ground, but for single frames."""
    low, high = np.percentile(track.height("hips"), [2, 98])
    return bool(least <= low and high <= most)


def jumps(track: Track, rise: float, count: int = 1, metres: float = 0.0, most_metres: float = np.inf) -> bool:
    """Jumps at least so many times, the hips rising so many metres above where they are in standing.

    A jump: both feet are off the ground between two frames in which one is on it. Shorter flights than 0.12 s are
    running steps, longer ones than 0.9 s stand on something. metres, most_metres: how far each goes over the ground.
    """
    hips, path, standing = track.height("hips"), track.path, T_POSE[HUMANOID.index("hips"), 1]
    found = [
        hips[start:stop].max() - standing >= rise
        and metres <= np.linalg.norm(path[stop] - path[start - 1]) <= most_metres
        for start, stop in spells(track.soles.min(axis=1) > CLEAR)
        if start > 0 and stop < len(track) and 0.12 <= (stop - start) / RATE <= 0.9
    ]
    return sum(map(bool, found)) >= count


def hops(track: Track) -> bool:
    """Hops on one foot at least twice: while the other foot is held up, the hips rise and fall by a few centimetres."""
    hips = track.height("hips")
    return any(swings(hips[a:b], 0.06) >= 4 for sole in track.soles.T for a, b in spells(sole > CLEAR))


def kicks(track: Track, side: str, height: float, speed: float = 4.0) -> bool:
    """The foot of a side or "either" swings up to a height, metres, at a speed, m/s, the other foot on the ground."""
    for one in LEFT_RIGHT if side == "either" else (side,):
        foot = sided(one, "Foot")
        fast = track.motion_of(foot)
        up = (track.height(foot) >= height) & (track.soles[:, 1 - LEFT_RIGHT.index(one)] < 2 * CLEAR)
        if any(fast[max(0, start - round(0.3 * RATE)) : stop].max() >= speed for start, stop in spells(up)):
            return True
    return False


def on_one_leg(track: Track, seconds: float) -> bool:
    """Stands in place on one leg for so many seconds, the other foot 20 cm higher or more."""
    raised = np.abs(track.soles[:, 0] - track.soles[:, 1]) >= 0.2
    return longest(raised & (track.pace < 0.3)) >= seconds


def jumping_jacks(track: Track, count: int) -> bool:
    """At least so many times the feet are half a metre apart sideways while both hands are above the shoulders."""
    left, right = track.bodies("Foot")
    up = np.greater(track.heights("Hand"), track.heights("UpperArm")).all(axis=0)
    return len(spells((np.abs(left[:, 0] - right[:, 0]) >= 0.5) & up)) >= count


def lifts_feet(track: Track, height: float) -> bool:
    """Each foot is lifted to a height, metres, at least once."""
    return bool((track.soles.max(axis=0) >= height).all())


def steps_a_second(track: Track, least: float) -> bool:
    """Feet are lifted, by 3 cm, so many times a second or more, both together."""
    return sum(len(spells(sole > 0.03)) for sole in track.soles.T) >= least * track.seconds


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
    steps = [np.maximum(np.diff(track.body(hand) - track.body("chest"), axis=0) * RATE, 0) for hand in HANDS]
    thrust = [np.concatenate([[0.0], calm(np.hypot(step[:, 2], step[:, 1]), 0.1)]) for step in steps]
    if side in LEFT_RIGHT:
        own = thrust.pop(LEFT_RIGHT.index(side))
        if own.max() < 1.5 * thrust[0].max():
            return False
        thrust = [own]
    return all(len(spells(one >= speed)) >= count for one in thrust)


def reaches_down(track: Track, most: float, side: str = "either") -> bool:
    """A hand comes as near to the ground as so many metres, for a moment."""
    return longest(_hands([hand <= most for hand in track.heights("Hand")], side)) >= 0.1


def wipes(track: Track, count: int) -> bool:
    """A hand, in front and above the chest for a third of the time, goes up and down or sideways so many times, by 20
    cm."""
    for hand in track.bodies("Hand"):
        there = (hand[:, 1] > track.height("upperChest")) & (hand[:, 2] > 0.2)
        moves = max(sum(swings(hand[a:b, i], 0.2) for a, b in spells(there)) for i in (0, 1))
        if there.mean() >= 0.3 and moves >= count:
            return True
    return False


def to_mouth(track: Track) -> bool:
    """One hand is at the mouth for half a second, the other one lower than the chest."""
    near = [length(track.joint(name) - track.joint("head")) < 0.42 for name in HANDS]
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


def lies(track: Track, when: str) -> bool:
    """Head and hips are near the ground for a while."""
    part = _part(track, when)
    return _for_a_while((part.height("hips") < 0.42) & (part.height("head") < 0.55))


def crouches(track: Track, when: str = "any", hips: float = 0.65) -> bool:
    """The hips are lower than so many metres on knees bent to less than 110 degrees for a while, the head over them."""
    part = _part(track, when)
    low = (part.height("hips") < hips) & (part.height("head") > part.height("hips") + 0.25)
    cosines = []
    for side in LEFT_RIGHT:
        hip, knee, foot = (part.joint(sided(side, joint)) for joint in ("UpperLeg", "LowerLeg", "Foot"))
        cosines.append((direction(hip - knee) * direction(foot - knee)).sum(axis=-1))
    return _for_a_while(low & (np.maximum(*cosines) > np.cos(np.radians(110))))


def upright(track: Track, when: str = "any") -> bool:
    """Stands or goes upright for a while: the hips high, the head well above them."""
    part = _part(track, when)
    hips = part.height("hips")
    return _for_a_while((hips > 0.8) & (part.height("head") > hips + 0.4))


def prone(track: Track, share: float) -> bool:
    """Hips and head are low, as in lying or on hands and knees, for a share of the time."""
    return bool(((track.height("hips") < 0.6) & (track.height("head") < 0.75)).mean() >= share)


def comes_up(track: Track, metres: float) -> bool:
    """The hips are so many metres higher at the end than at the start; a negative number for lower ones."""
    hips = track.height("hips")
    count = max(1, len(hips) // 10)
    gain = float(np.median(hips[-count:]) - np.median(hips[:count]))
    return gain >= metres if metres > 0 else gain <= metres


def sits(track: Track) -> bool:
    """Sits on a seat for a second, at rest: the thighs within 50 degrees of level, the hips behind a foot."""
    there: Flags = (track.height("hips") > 0.45) & (track.pace < 0.3)
    ahead = np.full(len(track), -np.inf)
    for hip, knee, foot in zip(*(track.bodies(part) for part in ("UpperLeg", "LowerLeg", "Foot")), strict=True):
        there &= np.abs(hip[:, 1] - knee[:, 1]) < np.sin(np.radians(50)) * 0.42
        ahead = np.maximum(ahead, foot[:, 2] - hip[:, 2])
    return longest(there & (ahead > 0.2)) >= 1.0


def bends(track: Track, degrees: float, seconds: float) -> bool:
    """The trunk leans by so many degrees for so long."""
    return longest(_tilt(track) >= degrees) >= seconds


def bows(track: Track) -> bool:
    """Standing on straight legs, the trunk leans by 25 degrees or more, once, and comes up again."""
    lean = calm(_tilt(track), 0.2)
    there = lean >= 25
    stands = bool(track.pace[there].max(initial=0.0) < 0.6) and track.height("hips")[there].min(initial=1.0) > 0.8
    return stands and len(spells(there)) == 1 and bool(max(lean[0], lean[-1]) < 12)


def upside_down(track: Track) -> bool:
    """The hips are above the head, and a foot above the hips."""
    hips = track.height("hips")
    return longest((hips > track.height("head")) & (np.maximum(*track.heights("Foot")) > hips)) > 0.05


def rolls(track: Track) -> bool:
    """Goes over the head near the ground: the hips above the head, which is no higher than a knee."""
    return longest((track.height("hips") > track.height("head")) & (track.height("head") < 0.5)) > 0.05


def ducks(track: Track, metres: float = 0.2, most: float = 1.35) -> bool:
    """The head goes down by so many metres to less than most above the ground and comes up again."""
    head = track.height("head")
    lowest = int(head.argmin())
    before, after = head[: lowest + 1].max(), head[lowest:].max()
    return bool(head[lowest] <= most and min(before, after) - head[lowest] >= metres)


def still(track: Track) -> bool:
    """The joints move by no more than 8 cm/s on average, for four fifths of the time."""
    steps = length(np.diff(track.points, axis=0)).mean(axis=1) * RATE
    return bool(len(steps)) and bool((calm(steps, 0.3) < 0.08).mean() >= 0.8)


def sways(track: Track, count: int, metres: float = 0.1) -> bool:
    """The trunk goes from side to side above the feet so many times, by so many metres."""
    feet = np.mean(track.bodies("Foot"), axis=0)[:, 0]
    return swings(calm(track.body("upperChest")[:, 0] - feet, 0.2), metres) >= count


def twists(track: Track, count: int, degrees: float = 40.0) -> bool:
    """The shoulders turn against the hips about y, to and fro by so many degrees, so many times."""
    across = [np.subtract(*map(track.joint, pair(part))) for part in ("UpperLeg", "UpperArm")]
    hips, shoulders = (np.arctan2(-one[:, 2], one[:, 0]) for one in across)
    return swings(np.degrees(np.unwrap(shoulders - hips)), degrees) >= count


def climbs(track: Track, metres: float) -> bool:
    """Both feet are so many metres above the ground for a second or more, on something."""
    return longest(track.soles.min(axis=1) >= metres) >= 1.0


def feet_stay(track: Track, most: float = 0.15) -> bool:
    """Each foot stays within so many metres of its typical place on the ground."""
    feet = [track.joint(name)[:, [0, 2]] for name in pair("Foot")]
    return all(np.percentile(length(foot - np.median(foot, axis=0)), 95) <= most for foot in feet)


def lasts(track: Track, seconds: float) -> bool:
    """Takes so many seconds or more."""
    return track.seconds >= seconds


def _between_hands(track: Track) -> Array:
    """The distance (T,) between the wrists, metres."""
    return length(np.subtract(*map(track.joint, HANDS)))


def _hands(flags: list[Flags], side: str) -> Flags:
    """Frames in which a hand, one of both, or both do what each of them does in ``flags``."""
    if side in LEFT_RIGHT:
        return flags[LEFT_RIGHT.index(side)]
    return flags[0] | flags[1] if side == "either" else flags[0] & flags[1]


def _part(track: Track, when: str) -> Track:
    return track.part(*{"any": (0.0, 1.0), "start": (0.0, 0.2), "end": (0.8, 1.0)}[when])


def _for_a_while(flags: Flags) -> bool:
    """For 0.2 s, or as long as the part is."""
    return longest(flags) >= min(0.2, len(flags) / RATE)


def _tilt(track: Track) -> Array:
    """The angle (T,) between trunk and vertical, degrees."""
    trunk = direction(track.joint("neck") - track.joint("hips"))
    found: Array = np.degrees(np.arccos(np.clip(trunk[:, 1], -1, 1)))
    return found
