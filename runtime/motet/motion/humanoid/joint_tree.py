"""Finding the bones of the humanoid by the tree of joints alone, where no convention knows the names.

A human's skeleton forks twice into two limbs that are alike: at the hips into legs, and higher up into arms. Within a
limb lengths tell which joint is which. Left and right come from the halves of names, else from the side on which a
limb lies when the feet point forward.
"""

from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np

from motet.errors import MotionError
from motet.motion.humanoid.bones import ARM, LEFT_RIGHT, LEG, sided
from motet.motion.humanoid.joint_map import BY_THE_TREE, JointMap, check_map
from motet.motion.humanoid.joint_names import HalfKnownError, map_by_names
from motet.motion.kinematics import local_translations, positions, skeleton_of
from motet.motion.motion import Motion
from motet.motion.rotations import Array, unit
from motet.motion.skeleton import END_SUFFIX, LEFT, RIGHT, Skeleton, partners_of, sides_of

NO_HUMAN = "this skeleton is no human's: expected hips with two legs, and a back with two arms"


@dataclass(frozen=True)
class _Tree:
    """A skeleton with the length of the bone to each joint (J) and the length of the longest path from each joint."""

    skeleton: Skeleton
    lengths: Array
    reach: Array

    def path(self, joint: int) -> list[int]:
        """The joints of the longest path down from a joint, without a tip."""
        path = [joint]
        while children := self.skeleton.children[path[-1]]:
            path.append(max(children, key=lambda child: float(self.lengths[child] + self.reach[child])))
        return path[:-1] if self.skeleton.names[path[-1]].endswith(END_SUFFIX) and len(path) > 1 else path

    def along(self, path: list[int]) -> list[float]:
        """How far each joint of a path is from the first, along the bones."""
        return [0.0, *np.cumsum(self.lengths[path[1:]]).tolist()]

    def above(self, joint: int) -> list[int]:
        """A joint and all that it hangs on, upwards to the root."""
        chain = [joint]
        while chain[-1]:
            chain.append(self.skeleton.joints[chain[-1]].parent)
        return chain


@dataclass(frozen=True)
class _Fork:
    """A joint and the two similar limbs below it, by their first joints."""

    joint: int
    limbs: tuple[int, int]
    length: float


def map_of(motion: Motion) -> JointMap:
    """Which joint of the motion's skeleton is which bone: by names, else by the tree; MotionError if it is not human.

    Where names fit in part, and the tree does not tell either, the error says which bones the names lack.
    """
    skeleton = skeleton_of(motion)
    try:
        return map_by_names(skeleton) or map_by_tree(motion)
    except HalfKnownError as half:
        try:
            return map_by_tree(motion)
        except MotionError:
            raise half from None


def map_by_tree(motion: Motion) -> JointMap:
    """The map by lengths, forks and sides; MotionError where the tree is not that of a human."""
    skeleton = skeleton_of(motion)
    tree = _tree(skeleton, _translations(motion, skeleton))
    legs, arms = _legs_and_arms(tree)
    shared = [joint for joint in tree.above(arms.joint) if joint not in tree.above(legs.joint)]
    if not shared:
        raise MotionError(f"{NO_HUMAN}; there is no back between {skeleton.names[legs.joint]!r} and the arms")
    joints = {"hips": legs.joint}
    frames = positions(motion) if len(motion) else skeleton.rest_positions[None]
    leg_pair, arm_pair = _legs(tree, legs), _arms(tree, arms)
    # legs that are folded or crossed do not tell sides, as they do at rest where the figure stands there
    shown = skeleton.rest_positions[None] if _stands(skeleton.rest_positions, leg_pair, arms) else frames
    to_left = _to_left(shown, leg_pair, tree)
    named = False
    for pair, parts, first in ((leg_pair, LEG, "UpperLeg"), (arm_pair, ARM, "UpperArm")):
        left_first, by_name = _left_first(skeleton, shown, to_left, [limb[first] for limb in pair])
        named = named or by_name
        for side, limb in zip(LEFT_RIGHT, pair if left_first else pair[::-1], strict=True):
            joints |= {sided(side, part): limb[part] for part in parts if part in limb}
    neck, head = _neck(tree, arms)
    joints |= {} if head is None else {"head": head}
    _check_straight(skeleton, frames, joints)
    found = JointMap(joints, tuple(shared[::-1]), neck, BY_THE_TREE, 0.8 if named else 0.6)
    return check_map(skeleton, found)


def _check_straight(skeleton: Skeleton, frames: Array, joints: dict[str, int]) -> None:
    """Refuse limbs whose bones are not straight from joint to joint in most frames (T, J, 3)."""
    pairs = [
        (sided(side, one), sided(side, next_))
        for side in LEFT_RIGHT
        for one, next_ in (*pairwise(LEG[:3]), *pairwise(ARM[1:]))
    ]
    for upper, lower in ((joints[one], joints[next_]) for one, next_ in pairs if next_ in joints):
        within = [lower]
        while within[-1] != upper:
            within.append(skeleton.joints[within[-1]].parent)
        pieces = sum(np.linalg.norm(frames[:, one] - frames[:, next_], axis=-1) for one, next_ in pairwise(within))
        # joints that take a bone's twist lie in line with it; limbs of beasts have more bones, and bend at them
        if np.median(pieces) > 1.1 * np.median(np.linalg.norm(frames[:, upper] - frames[:, lower], axis=-1)):
            bent = f"this one is bent between {skeleton.names[upper]!r} and {skeleton.names[lower]!r}"
            raise MotionError(f"a human's bones are straight, {bent}: if it is human all the same, give a map")


def _translations(motion: Motion, skeleton: Skeleton) -> Array:
    return local_translations(motion)[0] if len(motion) else skeleton.offsets


def _tree(skeleton: Skeleton, offsets: Array) -> _Tree:
    lengths = np.linalg.norm(offsets, axis=1)
    lengths[0] = 0.0
    reach = np.zeros(len(lengths))
    for i in range(len(lengths) - 1, 0, -1):
        parent = skeleton.joints[i].parent
        reach[parent] = max(reach[parent], lengths[i] + reach[i])
    return _Tree(skeleton, lengths, reach)


def _legs_and_arms(tree: _Tree) -> tuple[_Fork, _Fork]:
    """The two forks with the longest limbs, the one nearer to the root first."""
    forks = [fork for joint in range(len(tree.lengths)) if (fork := _fork(tree, joint))]
    forks.sort(key=lambda fork: -fork.length)
    limbs: list[_Fork] = []
    for fork in forks:
        within = any(limb in tree.above(fork.joint) for other in limbs for limb in other.limbs)
        if not within:
            limbs.append(fork)
    if len(limbs) < 2 or limbs[1].length < 0.3 * limbs[0].length:
        found = f"one pair of limbs, at {tree.skeleton.names[limbs[0].joint]!r}" if limbs else "no pair of limbs"
        raise MotionError(f"{NO_HUMAN}; found {found}")
    first, second = sorted(limbs[:2], key=lambda fork: len(tree.above(fork.joint)))
    return first, second


def _fork(tree: _Tree, joint: int) -> _Fork | None:
    """The two branches of a joint that are most alike and long enough for a limb of three joints, if there are."""
    partners = partners_of(tree.skeleton.names)
    best: tuple[float, _Fork] | None = None
    for one, other in combinations(tree.skeleton.children[joint], 2):
        longer, shorter = sorted((tree.lengths[i] + tree.reach[i] for i in (one, other)), reverse=True)
        enough = min(len(tree.path(one)), len(tree.path(other))) >= 3
        # two limbs of a pair may differ in length by 15 %
        if not enough or not longer or 1 - shorter / longer > 0.15:
            continue
        unlike = 1 - shorter / longer + 0.1 * abs(len(tree.path(one)) - len(tree.path(other)))
        unlike -= 1.0 if partners[one] == other else 0.0
        if best is None or unlike < best[0]:
            best = unlike, _Fork(joint, (one, other), float(longer))
    return best[1] if best else None


def _pair(tree: _Tree, fork: _Fork) -> tuple[list[list[int]], list[float]]:
    """The paths of two limbs, as long as the shorter of both, and how far down their joints are, the mean of both."""
    paths = [tree.path(limb) for limb in fork.limbs]
    count = min(map(len, paths))
    paths = [path[:count] for path in paths]
    places = np.mean([[*tree.along(path), tree.reach[path[0]]] for path in paths], axis=0)
    return paths, places.tolist()


def _legs(tree: _Tree, fork: _Fork) -> list[dict[str, int]]:
    """Thighs, shins, feet and toes: the ankle leaves the foot's length, the knee halves what is above it."""
    paths, places = _pair(tree, fork)
    count = len(places) - 1
    # what comes after the ankle is within these parts of a leg
    feet = [k for k in range(2, count) if 0.08 <= 1 - places[k] / places[-1] <= 0.35] or [count - 1]
    choices = [(start, knee, foot) for foot in feet for start, knee in combinations(range(foot), 2)]
    start, knee, foot = min(choices, key=lambda choice: _unlike(places, *choice))
    parts = {"UpperLeg": start, "LowerLeg": knee, "Foot": foot} | ({"Toes": foot + 1} if foot + 1 < count else {})
    return [{part: path[k] for part, k in parts.items()} for path in paths]


def _arms(tree: _Tree, fork: _Fork) -> list[dict[str, int]]:
    """Clavicles, upper arms, forearms and hands: the hand is where fingers fork or begins them; the elbow halves.

    An arm that ends in one long bone has no joint for the hand: its tip is the wrist."""
    paths, places = _pair(tree, fork)
    forks = [k for k, joint in enumerate(paths[0]) if k >= 2 and len(tree.skeleton.children[joint]) >= 2]
    count = len(places) - 1
    # what comes after the wrist is within this part of an arm
    hands = forks[:1] or [k for k in range(2, count) if 1 - places[k] / places[-1] <= 0.35] or [count]
    choices = [(start, elbow, hand) for hand in hands for start, elbow in combinations(range(hand), 2)]
    start, elbow, hand = min(choices, key=lambda choice: _unlike(places, *choice))
    parts = {"UpperArm": start, "LowerArm": elbow} | ({"Shoulder": 0} if start else {})
    parts |= {"Hand": hand} if hand < count else {}
    return [{part: path[k] for part, k in parts.items()} for path in paths]


def _unlike(places: list[float], start: int, middle: int, end: int) -> float:
    """How far two bones are from being of one length and most of the limb; a short piece does not begin a bone."""
    upper, lower = places[middle] - places[start], places[end] - places[middle]
    whole, first = upper + lower, places[start + 1] - places[start]
    # a bone begins with at least .15 of its limb: hips and buttocks often have a short one before the thigh
    return abs(upper - lower) / whole - 0.1 * whole / places[-1] if first > 0.15 * whole > 0 else np.inf


def _neck(tree: _Tree, arms: _Fork) -> tuple[tuple[int, ...], int | None]:
    """The joints between the arms and the head, and the head's, where there are."""
    branches = [child for child in tree.skeleton.children[arms.joint] if child not in arms.limbs]
    branches = [child for child in branches if tree.reach[child] + tree.lengths[child] > 0]
    if not branches:
        return (), None
    path = tree.path(max(branches, key=lambda child: float(tree.reach[child] + tree.lengths[child])))
    named = [k for k, joint in enumerate(path) if "head" in tree.skeleton.names[joint].lower()]
    head = named[0] if named else min(1, len(path) - 1)
    return tuple(path[:head]), path[head]


def _stands(pose: Array, legs: list[dict[str, int]], arms: _Fork) -> bool:
    """Whether in a pose (J, 3) both legs are straight, and the arms above them."""
    thighs, shins = (
        unit(np.array([pose[leg[one]] - pose[leg[next_]] for leg in legs])) for one, next_ in pairwise(LEG[:3])
    )
    trunk = unit(pose[list(arms.limbs)].mean(axis=0) - pose[[leg["UpperLeg"] for leg in legs]].mean(axis=0))
    return bool(min(*(thighs @ trunk), *(shins @ trunk)) > 0.75)


def _to_left(frames: Array, legs: list[dict[str, int]], tree: _Tree) -> Array:
    """Directions (T, 3) to the figure's left, told from its feet."""
    forward, up = np.zeros(frames[:, 0].shape), np.zeros(frames[:, 0].shape)
    for leg in legs:
        ends = [*([leg["Toes"]] if "Toes" in leg else []), *tree.skeleton.children[leg["Foot"]]]
        forward += unit(frames[:, ends[0]] - frames[:, leg["Foot"]]) if ends else 0.0
        up += unit(frames[:, leg["UpperLeg"]] - frames[:, leg["Foot"]])
    return np.cross(up, forward)


def _left_first(skeleton: Skeleton, frames: Array, to_left: Array, pair: list[int]) -> tuple[bool, bool]:
    """Whether the first of two joints is the left one, and whether their names say so."""
    sides = [sides_of(skeleton.names)[joint] for joint in pair]
    if sorted(sides) == sorted((LEFT, RIGHT)):
        return sides[0] == LEFT, True
    across = np.mean(np.sum((frames[:, pair[0]] - frames[:, pair[1]]) * to_left, axis=-1))
    if not across:
        names = " and ".join(repr(skeleton.names[joint]) for joint in pair)
        raise MotionError(f"left and right of {names} cannot be told apart by names or feet; give a map")
    return bool(across > 0), False
