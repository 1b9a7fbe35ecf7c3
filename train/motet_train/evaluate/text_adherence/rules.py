"""The rules of prompts: each public function tells whether a :class:`Track` does something.

side: "left", "right" or "both", and where the rule says so "either". least, most: bounds, inclusive.
"""

import numpy as np

from motet.figures.humanoid import HUMANOID, LEFT_RIGHT, T_POSE, sided
from motet.motion.rotations import Array
from motet_train.evaluate.positions import Flags, length, spells
from motet_train.evaluate.text_adherence.track import RATE, Track, calm, direction, longest, pair, swings

VELOCITY_COLUMNS = {"forward": (0, 1), "backward": (0, -1), "left": (1, 1), "right": (1, -1)}
"""Way -> the column of the velocity, and its sign."""

CLEAR = 0.1
"""Metres above which a foot is clearly off the ground; in a run both feet are only for a moment."""

HAND_BONES = pair("Hand")


def goes(track: Track, way: str, least: float, most: float = np.inf, metres: float = 0.0) -> bool:
    """Goes one way at a typical velocity from least to most, m/s, and at least a number of metres in all.

    The typical velocity is the 75th percentile, so that standing at the ends does not matter.
    """
    column, sign = VELOCITY_COLUMNS[way]
    velocity = sign * track.velocity[:, column]
    typical = np.percentile(velocity, 75)
    return bool(least <= typical <= most and velocity.sum() / RATE >= metres)


def sidesteps(track: Track, side: str, metres: float) -> bool:
    """Moves by a number of metres to one side of its facing, and not as far forward or back."""
    ahead, left = track.velocity.sum(axis=0) / RATE
    return bool(VELOCITY_COLUMNS[side][1] * left >= max(metres, abs(ahead)))


def travels(track: Track, metres: float) -> bool:
    """Ends at least a number of metres away from its start."""
    return bool(np.linalg.norm(track.path[-1] - track.path[0]) >= metres)


def wanders(track: Track) -> bool:
    """Goes at least two metres, and ends nearer to its start than half the length of its path."""
    path_length = float(track.pace.sum() / RATE)
    return path_length >= 2.0 and not travels(track, path_length / 2)


def turns(track: Track, least: float, most: float = np.inf) -> bool:
    """Turns by least to most degrees from start to end, positive to the left."""
    return least <= track.turn <= most


def turned_about(track: Track, least: float, most: float = np.inf) -> bool:
    """Turns by least to most degrees to either side, between the two most different facings."""
    return bool(least <= np.ptp(calm(track.facing, 0.3)) <= most)


def straight(track: Track, most: float = 30.0) -> bool:
    """Keeps its initial facing within a number of degrees."""
    return abs(track.turn) <= most


def starts(track: Track, least: float = 0.0, most: float = np.inf) -> bool:
    """Moves at a speed from least to most, m/s, in the first 0.4 s."""
    return bool(least <= np.median(track.pace[: round(0.4 * RATE)]) <= most)


def ends(track: Track, least: float = 0.0, most: float = np.inf) -> bool:
    """Moves at a speed from least to most, m/s, in the last 0.4 s."""
    return bool(least <= np.median(track.pace[-round(0.4 * RATE) :]) <= most)


def reaches(track: Track, least: float = 0.0, most: float = np.inf) -> bool:
    """The 90th percentile of the speed is from least to most, m/s."""
    return bool(least <= np.percentile(track.pace, 90) <= most)


def stays(track: Track, most: float) -> bool:
    """Is never farther than a number of metres from its start."""
    return bool(length(track.path - track.path[0]).max() <= most)


def strides(track: Track, least: int = 2, most: float = np.inf) -> bool:
    """A foot passes the other by 20 cm from least to most times."""
    left, right = track.bodies("Foot")
    return least <= swings(left[:, 2] - right[:, 2], 0.2) <= most


def bobs(track: Track, metres: float) -> bool:
    """The hips move up and down by a number of metres in the median half second."""
    window = min(round(0.5 * RATE), len(track))
    windows = np.lib.stride_tricks.sliding_window_view(track.height("hips"), window)
    return bool(np.median(np.ptp(windows, 1)) >= metres)


def rises_and_falls(track: Track, metres: float, count: int) -> bool:
    """The hips go up or down by a number of metres at least ``count`` times."""
    return swings(track.height("hips"), metres) >= count


def hips(track: Track, least: float = -np.inf, most: float = np.inf) -> bool:
    """The hips are always from least to most metres above the ground, except for single frames."""
    low, high = np.percentile(track.height("hips"), [2, 98])
    return bool(least <= low and high <= most)


def jumps(track: Track, rise: float, count: int = 1, metres: float = 0.0, most_metres: float = np.inf) -> bool:
    """Jumps at least ``count`` times, the hips ``rise`` metres higher than in standing.

    In a jump both feet are off the ground between two frames in which one is on it. metres, most_metres: how far each
    jump goes over the ground.
    """
    hips = track.height("hips")
    standing_hips = T_POSE[HUMANOID.index("hips"), 1]
    jumped = 0
    # flights of both feet that begin and end on the ground
    for start, stop in spells(track.soles.min(axis=1) > CLEAR):
        seconds = (stop - start) / RATE
        lands = start > 0 and stop < len(track)
        # shorter flights are running steps, in longer ones the figure stands on something
        if not lands or not 0.12 <= seconds <= 0.9:
            continue
        high = hips[start:stop].max() - standing_hips >= rise
        distance = np.linalg.norm(track.path[stop] - track.path[start - 1])
        if high and metres <= distance <= most_metres:
            jumped += 1
    return jumped >= count


def hops(track: Track) -> bool:
    """Hops on one foot at least twice: while the other foot is raised, the hips rise and fall by a few centimetres."""
    hips = track.height("hips")
    for sole in track.soles.T:
        if any(swings(hips[start:stop], 0.06) >= 4 for start, stop in spells(sole > CLEAR)):
            return True
    return False


def kicks(track: Track, side: str, height: float, speed: float = 4.0) -> bool:
    """The foot of a side, or "either", swings up to a height, metres, at a speed, m/s, the other foot on the ground."""
    for kicking in LEFT_RIGHT if side == "either" else (side,):
        foot = sided(kicking, "Foot")
        foot_speed = track.motion_of(foot)
        other_sole = track.soles[:, 1 - LEFT_RIGHT.index(kicking)]
        up = (track.height(foot) >= height) & (other_sole < 2 * CLEAR)
        # the swing just before, and while the foot is up
        for start, stop in spells(up):
            swing_start = max(0, start - round(0.3 * RATE))
            if foot_speed[swing_start:stop].max() >= speed:
                return True
    return False


def on_one_leg(track: Track, seconds: float) -> bool:
    """Stands in place on one leg for a number of seconds, the other foot at least 20 cm higher."""
    raised = np.abs(track.soles[:, 0] - track.soles[:, 1]) >= 0.2
    return longest(raised & (track.pace < 0.3)) >= seconds


def jumping_jacks(track: Track, count: int) -> bool:
    """At least ``count`` times the feet are half a metre apart sideways while both hands are above the shoulders."""
    left, right = track.bodies("Foot")
    wide = np.abs(left[:, 0] - right[:, 0]) >= 0.5
    return len(spells(wide & track.hands_up)) >= count


def lifts_feet(track: Track, height: float) -> bool:
    """Each foot is lifted to a height, metres, at least once."""
    return bool((track.soles.max(axis=0) >= height).all())


def steps_a_second(track: Track, least: float) -> bool:
    """Both feet together are lifted by 3 cm at least ``least`` times a second."""
    lifts = sum(len(spells(sole > 0.03)) for sole in track.soles.T)
    return lifts >= least * track.seconds


def raises(track: Track, side: str, above: float, seconds: float = 0.3) -> bool:
    """A hand is a number of metres above the head's joint, at about the mouth, for a while; "both": at once."""
    up = track.heights("Hand") - track.height("head") >= above
    return longest(_hands(up, side)) >= seconds


def waves(track: Track, count: int) -> bool:
    """A raised hand, above its elbow and at about shoulder height, goes from side to side ``count`` times, by 10 cm."""
    raised = track.heights("Hand") > np.maximum(track.heights("LowerArm"), track.heights("UpperArm") - 0.1)
    for hand, hand_raised in zip(track.bodies("Hand"), raised, strict=True):
        if any(swings(hand[start:stop, 0], 0.1) >= count for start, stop in spells(hand_raised)):
            return True
    return False


def punches(track: Track, side: str, speed: float = 2.5, count: int = 1) -> bool:
    """A hand shoots forward or up from the chest at a speed, m/s, ``count`` times; "both": each does. For one side it
    is half as fast again as the other hand."""
    left, right = (_thrust(track, hand) for hand in HAND_BONES)
    if side not in LEFT_RIGHT:
        return all(len(spells(thrust >= speed)) >= count for thrust in (left, right))
    # one hand, and clearly faster than the other
    punching, other = (left, right) if side == LEFT_RIGHT[0] else (right, left)
    return bool(punching.max() >= 1.5 * other.max()) and len(spells(punching >= speed)) >= count


def _thrust(track: Track, hand: str) -> Array:
    """The speed (T,) at which a hand moves forward and up from the chest, m/s."""
    steps = np.diff(track.body(hand) - track.body("chest"), axis=0) * RATE
    outward = np.maximum(steps, 0)
    return np.concatenate([[0.0], calm(np.hypot(outward[:, 2], outward[:, 1]), 0.1)])


def reaches_down(track: Track, most: float, side: str = "either") -> bool:
    """A hand comes down to a number of metres above the ground for a moment."""
    return longest(_hands(track.heights("Hand") <= most, side)) >= 0.1


def wipes(track: Track, count: int) -> bool:
    """A hand, in front and above the chest for a third of the time, goes up and down or sideways ``count`` times, by 20
    cm."""
    for hand in track.bodies("Hand"):
        in_front = (hand[:, 1] > track.height("upperChest")) & (hand[:, 2] > 0.2)
        sideways = sum(swings(hand[start:stop, 0], 0.2) for start, stop in spells(in_front))
        up_and_down = sum(swings(hand[start:stop, 1], 0.2) for start, stop in spells(in_front))
        if in_front.mean() >= 0.3 and max(sideways, up_and_down) >= count:
            return True
    return False


def to_mouth(track: Track) -> bool:
    """A hand is at the mouth for half a second, the other one lower than the chest."""
    near = length(track.joints("Hand") - track.joint("head")) < 0.42
    low = track.heights("Hand") < track.height("chest") + 0.05
    return max(map(longest, near & low[::-1])) >= 0.5


def on_guard(track: Track, share: float = 0.5) -> bool:
    """Both hands are in front of the chest, between its height and the mouth, for a share of the time."""
    heights = track.heights("Hand")
    between = (heights > track.height("chest") - 0.1) & (heights < track.height("head") + 0.05)
    guards = between & (track.bodies("Hand")[..., 2] > 0.1)
    return bool(guards.all(axis=0).mean() >= share)


def hands_together(track: Track, most: float, share: float = 0.5) -> bool:
    """The hands are at most a number of metres apart for a share of the time."""
    return bool((_between_hands(track) <= most).mean() >= share)


def arms_out(track: Track) -> bool:
    """The arms are spread, the hands at least 90 cm apart, for a while."""
    return longest(_between_hands(track) >= 0.9) >= 0.3


def arms_ahead(track: Track) -> bool:
    """Both arms are stretched out to the front at about shoulder height for half of the time."""
    bones = [HUMANOID.offsets[HUMANOID.index(name)] for name in ("leftLowerArm", "leftHand")]
    arm_length = sum(np.linalg.norm(bone) for bone in bones)
    offsets = track.bodies("Hand") - track.bodies("UpperArm")
    stretched = (offsets[..., 2] > 0.6 * arm_length) & (np.abs(offsets[..., 1]) < 0.3)
    return bool(stretched.all(axis=0).mean() >= 0.5)


def swings_arms(track: Track, count: int, metres: float = 0.2) -> bool:
    """Both hands, relative to the hips, swing along the same axis by a number of metres ``count`` times."""
    left, right = track.bodies("Hand")
    both = [min(swings(left[:, axis], metres), swings(right[:, axis], metres)) for axis in (0, 1, 2)]
    return max(both) >= count


def hands_still(track: Track, most: float) -> bool:
    """The mean speed of both hands relative to the hips is at most ``most`` m/s: they do not swing."""
    return all(track.motion_of(name).mean() <= most for name in HAND_BONES)


def hands_move(track: Track, least: float, most: float = np.inf) -> bool:
    """The mean speed of the hands relative to the chest is from least to most, m/s."""
    speeds = [track.motion_of(name, "upperChest").mean() for name in HAND_BONES]
    return bool(least <= np.mean(speeds) <= most)


def hands_fast(track: Track, least: float) -> bool:
    """A hand reaches a speed relative to the chest, m/s."""
    return bool(max(track.motion_of(name, "upperChest").max() for name in HAND_BONES) >= least)


def lies(track: Track, when: str) -> bool:
    """Head and hips are near the ground for a while."""
    part = _part(track, when)
    low_hips = part.height("hips") < 0.42
    low_head = part.height("head") < 0.55
    return _for_a_while(low_hips & low_head)


def crouches(track: Track, when: str = "any", hips: float = 0.65) -> bool:
    """The hips are lower than a number of metres over knees bent to less than 110 degrees for a while, the head above
    them."""
    part = _part(track, when)
    hips_height = part.height("hips")
    low = (hips_height < hips) & (part.height("head") > hips_height + 0.25)
    # the angles at both knees
    knees = part.joints("LowerLeg")
    thighs = direction(part.joints("UpperLeg") - knees)
    shins = direction(part.joints("Foot") - knees)
    bent = (thighs * shins).sum(axis=-1).max(axis=0) > np.cos(np.radians(110))
    return _for_a_while(low & bent)


def upright(track: Track, when: str = "any") -> bool:
    """Stands or goes upright for a while: the hips high, the head well above them."""
    part = _part(track, when)
    hips = part.height("hips")
    return _for_a_while((hips > 0.8) & (part.height("head") > hips + 0.4))


def prone(track: Track, share: float) -> bool:
    """Hips and head are low, as in lying or on hands and knees, for a share of the time."""
    low = (track.height("hips") < 0.6) & (track.height("head") < 0.75)
    return bool(low.mean() >= share)


def comes_up(track: Track, metres: float) -> bool:
    """The hips are a number of metres higher at the end than at the start; a negative number means lower."""
    hips = track.height("hips")
    count = max(1, len(hips) // 10)
    gain = float(np.median(hips[-count:]) - np.median(hips[:count]))
    return gain >= metres if metres > 0 else gain <= metres


def sits(track: Track) -> bool:
    """Sits on a seat for a second, at rest: the thighs within 50 degrees of level, the hips behind a foot."""
    at_rest = (track.height("hips") > 0.45) & (track.pace < 0.3)
    highest_knee = np.sin(np.radians(50)) * 0.42  # metres from the hip, by the length of a thigh
    rises = np.abs(track.heights("UpperLeg") - track.heights("LowerLeg"))
    level_thighs = (rises < highest_knee).all(axis=0)
    foot_ahead = (track.bodies("Foot") - track.bodies("UpperLeg"))[..., 2].max(axis=0)
    return longest(at_rest & level_thighs & (foot_ahead > 0.2)) >= 1.0


def bends(track: Track, degrees: float, seconds: float) -> bool:
    """The trunk leans by a number of degrees for a number of seconds."""
    return longest(_tilt(track) >= degrees) >= seconds


def bows(track: Track) -> bool:
    """Standing on straight legs, the trunk leans by at least 25 degrees, once, and comes up again."""
    lean = calm(_tilt(track), 0.2)
    leaning = lean >= 25
    # the legs do not take part, and the trunk is upright before and after
    in_place = bool(track.pace[leaning].max(initial=0.0) < 0.6)
    legs_straight = bool(track.height("hips")[leaning].min(initial=1.0) > 0.8)
    upright_at_ends = bool(max(lean[0], lean[-1]) < 12)
    return in_place and legs_straight and len(spells(leaning)) == 1 and upright_at_ends


def upside_down(track: Track) -> bool:
    """The hips are above the head, and a foot above the hips."""
    hips = track.height("hips")
    highest_foot = np.maximum(*track.heights("Foot"))
    return longest((hips > track.height("head")) & (highest_foot > hips)) > 0.05


def rolls(track: Track) -> bool:
    """Goes over the head near the ground: the hips above the head, which is no higher than a knee."""
    head = track.height("head")
    return longest((track.height("hips") > head) & (head < 0.5)) > 0.05


def ducks(track: Track, metres: float = 0.2, most: float = 1.35) -> bool:
    """The head goes down by a number of metres, to ``most`` or less above the ground, and comes up again."""
    head = track.height("head")
    lowest = int(head.argmin())
    highest_before = head[: lowest + 1].max()
    highest_after = head[lowest:].max()
    depth = min(highest_before, highest_after) - head[lowest]
    return bool(head[lowest] <= most and depth >= metres)


def still(track: Track) -> bool:
    """The joints move by less than 8 cm/s on average, for four fifths of the time."""
    speeds = length(np.diff(track.points, axis=0)).mean(axis=1) * RATE
    return bool(len(speeds)) and bool((calm(speeds, 0.3) < 0.08).mean() >= 0.8)


def sways(track: Track, count: int, metres: float = 0.1) -> bool:
    """The trunk goes from side to side above the feet ``count`` times, by a number of metres."""
    # the chest, sideways from the middle of the feet
    feet = track.bodies("Foot")[..., 0].mean(axis=0)
    sideways = track.body("upperChest")[:, 0] - feet
    return swings(calm(sideways, 0.2), metres) >= count


def twists(track: Track, count: int, degrees: float = 40.0) -> bool:
    """The shoulders turn against the hips about y, to and fro by a number of degrees, ``count`` times."""
    twist = np.unwrap(_yaw(track, "UpperArm") - _yaw(track, "UpperLeg"))
    return swings(np.degrees(twist), degrees) >= count


def _yaw(track: Track, part: str) -> Array:
    """The angle (T,) about y of the line from the right to the left joint of a part, radians."""
    across = np.subtract(*track.joints(part))
    yaw: Array = np.arctan2(-across[:, 2], across[:, 0])
    return yaw


def climbs(track: Track, metres: float) -> bool:
    """Both feet are a number of metres above the ground, on something, for at least a second."""
    return longest(track.soles.min(axis=1) >= metres) >= 1.0


def feet_stay(track: Track, most: float = 0.15) -> bool:
    """Each foot stays within a number of metres of its median place on the ground."""
    feet = track.joints("Foot")[..., [0, 2]]
    distances = length(feet - np.median(feet, axis=1, keepdims=True))
    return bool((np.percentile(distances, 95, axis=1) <= most).all())


def lasts(track: Track, seconds: float) -> bool:
    """Takes at least a number of seconds."""
    return track.seconds >= seconds


def _between_hands(track: Track) -> Array:
    """The distance (T,) between the wrists, metres."""
    return length(np.subtract(*track.joints("Hand")))


def _hands(flags: Flags, side: str) -> Flags:
    """The flags (T,) of one hand, of either or of both, by those (2, T) of the left and the right one."""
    left, right = flags
    return np.asarray({"left": left, "right": right, "either": left | right, "both": left & right}[side])


def _part(track: Track, when: str) -> Track:
    shares = {"any": (0.0, 1.0), "start": (0.0, 0.2), "end": (0.8, 1.0)}
    return track.part(*shares[when])


def _for_a_while(flags: Flags) -> bool:
    """Whether flags (T,) hold for 0.2 s, or for the whole of a shorter part."""
    return longest(flags) >= min(0.2, len(flags) / RATE)


def _tilt(track: Track) -> Array:
    """The angle (T,) between trunk and vertical, degrees."""
    trunk = direction(track.joint("neck") - track.joint("hips"))
    angles: Array = np.degrees(np.arccos(np.clip(trunk[:, 1], -1, 1)))
    return angles
