"""Finding the bones of the humanoid by the tree of joints alone, where no convention knows the names.

A human's skeleton forks twice into two limbs that are alike: at the hips into legs, and higher up into arms. Within a
limb lengths tell which joint is which. Left and right come from the halves of names, else from the side on which a
limb lies when the feet point forward.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, pairwise, permutations

import numpy as np

from motet.errors import MotionError
from motet.figures.humanoid.bones import ARM, LEFT_RIGHT, LEG, sided
from motet.figures.humanoid.joint_map import (
    BY_THE_TREE,
    HalfKnownError,
    JointMap,
    check_map,
    map_by_names,
    without_numbers,
)
from motet.motion.kinematics import local_translations, positions, skeleton_of
from motet.motion.motion import Motion
from motet.motion.rotations import Array, unit
from motet.motion.skeleton import (
    END_SUFFIX,
    LEFT,
    RIGHT,
    Skeleton,
    partners_of,
    sides_of,
)

NO_HUMAN = "this skeleton is no human's: expected hips with two legs, and a back with two arms"

WORN = re.compile(
    "hair|braid|bangs|skirt|cape|cloak|ribbon|scarf|backpack|髪|スカート|マント|リボン",
    re.IGNORECASE,
)
"""What names of chains of joints contain that are no limbs."""

Limbs = list[dict[str, int]]
"""Of both limbs of a pair the joint of each part."""


@dataclass(frozen=True)
class _Fork:
    """A joint and two similar limbs below it."""

    joint: int
    """Index of the joint that carries both limbs."""

    limbs: tuple[int, int]
    """The first joints of the limbs."""

    length: float
    """Length of the longer limb."""

    is_named: bool
    """Whether the names of the limbs are partners."""

    unlike: float
    """How unlike the limbs are, 0 for equal ones; less where names are partners."""


class _Tree:
    """A skeleton with the length of the bone to each joint (J) and the length of the longest path from each joint."""

    def __init__(self, motion: Motion) -> None:
        self.skeleton = skeleton_of(motion)
        self.names = without_numbers(self.skeleton.names)
        self.partners = partners_of(self.names)
        # from the first frame, as some files move joints that rest at the root
        self.lengths = np.linalg.norm(
            local_translations(motion)[0] if len(motion) else self.skeleton.offsets,
            axis=1,
        )
        self.lengths[0] = 0.0
        self.reach = np.zeros(len(self.lengths))
        for i in range(len(self.lengths) - 1, 0, -1):
            parent = self.skeleton.joints[i].parent
            self.reach[parent] = max(self.reach[parent], self.lengths[i] + self.reach[i])

    def longest(self, joints: list[int] | tuple[int, ...]) -> int:
        """Of some joints of one parent the joint with the longest path from that parent."""
        return max(joints, key=lambda joint: float(self.lengths[joint] + self.reach[joint]))

    def path(self, joint: int) -> list[int]:
        """The joints of the longest path down from a joint, without a tip."""
        path = [joint]
        while children := self.skeleton.children[path[-1]]:
            path.append(self.longest(children))
        return path[:-1] if self.skeleton.names[path[-1]].endswith(END_SUFFIX) and len(path) > 1 else path

    def forks(self, joint: int) -> list[_Fork]:
        """The pairs of branches of a joint that are alike and have three joints and more, the most alike first."""
        branches = [child for child in self.skeleton.children[joint] if not WORN.search(self.names[child])]
        branches = [child for child in branches if len(self.path(child)) >= 3]
        # of many, such as strands of hair, the longest: every pair is compared
        branches = sorted(sorted(branches, key=lambda child: -self.lengths[child] - self.reach[child])[:60])
        pairs = [self._fork(joint, pair) for pair in combinations(branches, 2)]
        return sorted((fork for fork in pairs if fork), key=lambda fork: fork.unlike)

    def _fork(self, joint: int, pair: tuple[int, int]) -> _Fork | None:
        shorter, longer = sorted(float(self.lengths[i] + self.reach[i]) for i in pair)
        # two limbs of a pair may differ in length by 15 %
        if not longer or 1 - shorter / longer > 0.15:
            return None
        is_named = self.partners[pair[0]] == pair[1]
        difference = abs(len(self.path(pair[0])) - len(self.path(pair[1])))
        unlike = 1 - shorter / longer + 0.1 * difference - (1.0 if is_named else 0.0)
        return _Fork(joint, pair, longer, is_named, unlike)

    def legs_and_arms(self) -> tuple[_Fork, _Fork]:
        """The two forks with the longest limbs, named ones if there are any, the one nearer to the root first."""
        # of each joint the pair that is most alike, the longest limbs first
        forks = []
        for joint in range(len(self.lengths)):
            forks += self.forks(joint)[:1]
        forks.sort(key=lambda fork: -fork.length)
        limbs = self._apart([fork for fork in forks if fork.is_named])
        if len(limbs) < 2 or limbs[1].length < 0.3 * forks[0].length:
            limbs = self._apart(forks)
        if len(limbs) < 2 or limbs[1].length < 0.3 * limbs[0].length:
            pairs = f"one pair of limbs, at {self.skeleton.names[limbs[0].joint]!r}" if limbs else "no pair of limbs"
            raise MotionError(f"{NO_HUMAN}; found {pairs}")
        # legs hang nearer to the root than arms
        first, second = sorted(limbs[:2], key=lambda fork: len(self.skeleton.ancestors(fork.joint)))
        return first, second

    def _apart(self, forks: list[_Fork]) -> list[_Fork]:
        """The forks that are not on the limbs of one before them."""
        limbs = []
        taken: set[int] = set()
        for fork in forks:
            if taken.isdisjoint(self.skeleton.ancestors(fork.joint)):
                limbs.append(fork)
                taken.update(fork.limbs)
        return limbs

    def mirrored_legs_and_arms(self) -> Iterator[tuple[_Fork, _Fork]]:
        """Other choices of legs and arms, the longest first: pairs of limbs whose bones are equally long one by one."""
        forks = []
        for joint in range(len(self.lengths)):
            forks += [fork for fork in self.forks(joint) if self._is_mirrored(fork)]
        forks.sort(key=lambda fork: -fork.length)
        forks = forks[:12]  # of many strands of hair the longest
        for legs, arms in sorted(permutations(forks, 2), key=lambda pair: -pair[0].length - pair[1].length):
            above = self.skeleton.ancestors(arms.joint)
            is_above = legs.joint in above[1:] and not {*legs.limbs} & {*above}
            if is_above and arms.length > 0.3 * legs.length:
                yield legs, arms

    def _is_mirrored(self, fork: _Fork) -> bool:
        left, right = (self.lengths[self.path(limb)] for limb in fork.limbs)
        return len(left) == len(right) and bool(np.abs(left - right).max() < 0.02 * fork.length)

    def pair(self, fork: _Fork) -> tuple[list[list[int]], list[float]]:
        """The paths of two limbs, as long as the shorter, and how far down their joints are, the mean of both."""
        # both limbs joint by joint, as far as both go
        paths = [self.path(limb) for limb in fork.limbs]
        shortest = min(map(len, paths))
        paths = [path[:shortest] for path in paths]
        ends = []
        for path in paths:
            ends.append([0.0, *np.cumsum(self.lengths[path[1:]]).tolist(), self.reach[path[0]]])
        return paths, np.mean(ends, axis=0).tolist()

    def legs(self, fork: _Fork) -> Limbs:
        """Thighs, shins, feet and toes: the ankle leaves the foot's length, the knee halves the leg above it."""
        paths, places = self.pair(fork)
        last = len(places) - 2
        # the part of a leg below the ankle is within these limits
        feet = [k for k in range(2, last + 1) if 0.08 <= 1 - places[k] / places[-1] <= 0.35] or [last]
        thigh, shin, foot = _two_bones(places, feet)
        return _limbs(paths, {"UpperLeg": thigh, "LowerLeg": shin, "Foot": foot, "Toes": foot + 1})

    def arms(self, fork: _Fork) -> Limbs:
        """Clavicles, upper arms, forearms and hands: the hand is where fingers fork or begins them; the elbow halves.

        An arm that ends in one long bone has no joint for the hand: its tip is the wrist.
        """
        paths, places = self.pair(fork)
        start, elbow, hand = _two_bones(places, self._wrists(paths, places))
        parts = {"UpperArm": start, "LowerArm": elbow, "Hand": hand}
        if start:
            parts["Shoulder"] = 0
        return _limbs(paths, parts)

    def _wrists(self, paths: list[list[int]], places: list[float]) -> list[int]:
        """Where on an arm the hand may begin."""
        last = len(places) - 2
        forks = [k for k, joint in enumerate(paths[0]) if k >= 2 and len(self.skeleton.children[joint]) >= 2]
        # the part of an arm beyond the wrist is within this limit
        near = [k for k in range(2, last + 1) if 1 - places[k] / places[-1] <= 0.35]
        is_leaf = not any(self.skeleton.children[path[last]] for path in paths)
        # a leaf that is near to the joint before it is the hand's end
        if is_leaf and len(near) > 1 and places[-1] - places[last - 1] < 0.25 * places[-1]:
            near = near[:-1]
        return forks[:1] or near or [last + 1]

    def neck(self, arms: _Fork) -> tuple[tuple[int, ...], int | None]:
        """The joints between the arms and the head, and the head's, where there are."""
        # what else hangs where the arms do, if it has a length
        branches = [child for child in self.skeleton.children[arms.joint] if child not in arms.limbs]
        branches = [child for child in branches if self.reach[child] + self.lengths[child] > 0]
        if not branches:
            return (), None
        path = self.path(self.longest(branches))
        named = [k for k, joint in enumerate(path) if "head" in self.skeleton.names[joint].lower()]
        head = named[0] if named else min(1, len(path) - 1)
        return tuple(path[:head]), path[head]


def _limbs(paths: list[list[int]], parts: dict[str, int]) -> Limbs:
    """For both paths the joint of each part, from its place on them, where they are that long."""
    limbs = []
    for path in paths:
        limbs.append({part: path[k] for part, k in parts.items() if k < len(path)})
    return limbs


def map_of(motion: Motion) -> JointMap:
    """Which joint of the motion's skeleton is which bone: by names, else by the tree; MotionError if it is not human.

    Where names fit in part, and the tree does not help either, the error lists the bones that the names lack.
    """
    try:
        return map_by_names(skeleton_of(motion)) or map_by_tree(motion)
    except HalfKnownError as half:
        try:
            joint_map = map_by_tree(motion)
        except MotionError:
            raise half from None
        if not half.agreed.items() <= joint_map.joints.items():
            raise
        return joint_map


def map_by_tree(motion: Motion) -> JointMap:
    """The map by lengths, forks and sides; MotionError where the tree is not that of a human."""
    tree = _Tree(motion)
    skeleton = skeleton_of(motion)
    frames = positions(motion) if len(motion) else skeleton.rest_positions[None]
    try:
        return _mapped(tree, frames, *tree.legs_and_arms())
    except MotionError as error:
        # clothes and tools can be longer than limbs; animals do not stand with their backs upright
        for legs, arms in tree.mirrored_legs_and_arms():
            if _stands(skeleton.rest_positions, tree.legs(legs), arms):
                try:
                    return _mapped(tree, frames, legs, arms)
                except MotionError:
                    continue
        raise error


def _mapped(tree: _Tree, frames: Array, legs: _Fork, arms: _Fork) -> JointMap:
    """The map by the tree with known legs and arms, in frames (T, J, 3)."""
    skeleton = tree.skeleton
    # the back goes from the legs' joint up to the arms'
    hips_up = skeleton.ancestors(legs.joint)
    back = [joint for joint in skeleton.ancestors(arms.joint) if joint not in hips_up]
    if not back:
        raise MotionError(f"{NO_HUMAN}; there is no back between {skeleton.names[legs.joint]!r} and the arms")
    joints = {"hips": legs.joint}
    limbs, named = _sided_limbs(tree, frames, tree.legs(legs), arms)
    joints |= limbs
    neck, head = tree.neck(arms)
    if head is not None:
        joints["head"] = head
    _check_straight(skeleton, frames, joints)
    return check_map(
        skeleton,
        JointMap(joints, tuple(back[::-1]), neck, BY_THE_TREE, 0.8 if named else 0.6),
    )


def _sided_limbs(tree: _Tree, frames: Array, legs: Limbs, arms: _Fork) -> tuple[dict[str, int], bool]:
    """For each bone of legs and arms its joint, and whether names show sides."""
    # legs that are folded or crossed do not show sides, as they do at rest where the figure stands there
    rest = tree.skeleton.rest_positions
    poses = rest[None] if _stands(rest, legs, arms) else frames
    to_left = _to_left(poses, legs, tree.skeleton)
    joints = {}
    named = False
    for pair, parts, first in (
        (legs, LEG, "UpperLeg"),
        (tree.arms(arms), ARM, "UpperArm"),
    ):
        left_first, by_name = _left_first(tree, poses, to_left, [limb[first] for limb in pair])
        named = named or by_name
        for side, limb in zip(LEFT_RIGHT, pair if left_first else pair[::-1], strict=True):
            for part in parts:
                if part in limb:
                    joints[sided(side, part)] = limb[part]
    return joints, named


def _two_bones(places: list[float], ends: list[int]) -> tuple[int, int, int]:
    """Where on a limb two bones begin, meet and end: those nearest to one length and most of the limb."""

    def unlike(choice: tuple[int, int, int]) -> float:
        start, middle, end = choice
        upper = places[middle] - places[start]
        lower = places[end] - places[middle]
        first = start + 1
        whole = upper + lower
        # a bone begins with at least .15 of its limb: hips and buttocks often have a short one before the thigh
        begins = places[first] - places[start] > 0.15 * whole > 0
        return abs(upper - lower) / whole - 0.1 * whole / places[-1] if begins else np.inf

    choices = []
    for end in ends:
        choices += [(start, middle, end) for start, middle in combinations(range(end), 2)]
    return min(choices, key=unlike)


def _check_straight(skeleton: Skeleton, frames: Array, joints: dict[str, int]) -> None:
    """Refuse limbs whose bones are not straight from joint to joint in most frames (T, J, 3)."""
    for side in LEFT_RIGHT:
        for part, next_part in (*pairwise(LEG[:3]), *pairwise(ARM[1:])):
            if sided(side, next_part) not in joints:
                continue
            upper = joints[sided(side, part)]
            lower = joints[sided(side, next_part)]
            # joints that take a bone's twist lie in line with it; limbs of animals have more bones, and bend at them
            if _is_bent(skeleton, frames, upper, lower):
                bent = f"this one is bent between {skeleton.names[upper]!r} and {skeleton.names[lower]!r}"
                raise MotionError(f"a human's bones are straight, {bent}: if it is human all the same, give a map")


def _is_bent(skeleton: Skeleton, frames: Array, upper: int, lower: int) -> bool:
    """Whether the way from joint to joint is longer than the straight line by a tenth in most frames (T, J, 3)."""
    above = skeleton.ancestors(lower)
    between = above[: above.index(upper) + 1]
    pieces = sum(np.linalg.norm(frames[:, low] - frames[:, high], axis=-1) for low, high in pairwise(between))
    straight = np.linalg.norm(frames[:, upper] - frames[:, lower], axis=-1)
    return bool(np.median(pieces) > 1.1 * np.median(straight))


def _stands(pose: Array, legs: Limbs, arms: _Fork) -> bool:
    """Whether in a pose (J, 3) both legs are straight, and the arms above them."""
    # legs point down, seen from the trunk
    thighs = unit(np.array([pose[leg["UpperLeg"]] - pose[leg["LowerLeg"]] for leg in legs]))
    shins = unit(np.array([pose[leg["LowerLeg"]] - pose[leg["Foot"]] for leg in legs]))
    trunk = unit(pose[list(arms.limbs)].mean(axis=0) - pose[[leg["UpperLeg"] for leg in legs]].mean(axis=0))
    return bool(min(*(thighs @ trunk), *(shins @ trunk)) > 0.75)


def _to_left(frames: Array, legs: Limbs, skeleton: Skeleton) -> Array:
    """Directions (T, 3) to the figure's left, as its feet show."""
    forward = np.zeros(frames[:, 0].shape)
    up = np.zeros(frames[:, 0].shape)
    for leg in legs:
        ends = [
            *([leg["Toes"]] if "Toes" in leg else []),
            *skeleton.children[leg["Foot"]],
        ]
        forward += unit(frames[:, ends[0]] - frames[:, leg["Foot"]]) if ends else 0.0
        up += unit(frames[:, leg["UpperLeg"]] - frames[:, leg["Foot"]])
    return np.cross(up, forward)


def _left_first(tree: _Tree, frames: Array, to_left: Array, pair: list[int]) -> tuple[bool, bool]:
    """Whether the first of two joints is the left one, and whether their names say so."""
    # names first, then which of both lies to the left of the feet's direction
    sides = [sides_of(tree.names)[joint] for joint in pair]
    if sorted(sides) == sorted((LEFT, RIGHT)):
        return sides[0] == LEFT, True
    across = np.mean(np.sum((frames[:, pair[0]] - frames[:, pair[1]]) * to_left, axis=-1))
    if not across:
        names = " and ".join(repr(tree.skeleton.names[joint]) for joint in pair)
        raise MotionError(f"left and right of {names} cannot be told apart by names or feet; give a map")
    return bool(across > 0), False
