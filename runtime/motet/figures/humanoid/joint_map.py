"""Which joint of a skeleton is which bone of the humanoid: by the names of joints, or the user's file; and where bones
point.

There is one table for each convention of names, in the folder conventions, a JSON object: "title"; "sides", pairs of
what stands for left and right; "joints", bone -> the names it can have, with ``{s}`` in the place of the side (of
"spine" and "neck" all that are there count, upwards, of others the first); "aside", other joints that files of this
convention have and that tell it from its neighbours; "marks", joints of which each of its files has one: without, the
same names are another's; "optional", bones that only some files have; "prefixes", regular expressions of what can stand
before every name; "rest", for files that are known to rest in a T-pose of their own, what that pose is on the humanoid:
bone -> rotation vector in degrees, of the left side, and "points", where bones point there, by which such a file is
known among others of these names; "axes", for files that rest in no body's pose: name -> the joint's axes that point
left, up and forward in a T-pose. Upper and lower case and separators do not count.
"""

import json
import re
import unicodedata
from collections import Counter
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, field
from functools import cache, lru_cache
from importlib.resources import files
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from motet.errors import FormatError, MotionError
from motet.figures.humanoid.bones import ARM, BONES, HUMANOID, LEFT_RIGHT, LEG, NECK, SPINE, sided
from motet.motion.rotations import Array, unit
from motet.motion.skeleton import END_SUFFIX, Skeleton

Triple = tuple[float, float, float]

NEEDED = ("hips", "spine", *(sided(side, part) for side in LEFT_RIGHT for part in (*LEG[:3], *ARM[1:3])))
"""Bones without which a figure is not taken for a human's; the others stay at rest where it lacks them."""

PARTNERS = {
    sided(side, part): sided(other, part) for part in (*LEG, *ARM) for side, other in (LEFT_RIGHT, LEFT_RIGHT[::-1])
}
"""For each bone of one side its partner."""

LIMB_BONES = tuple(tuple(sided(side, part) for part in limb) for side in LEFT_RIGHT for limb in (LEG, ARM[1:]))

UNSIDED = ("hips", "head", "spine", "neck")

NO_PREFIX = "(?!)"
"""A pattern that nothing fits."""

BY_THE_TREE = "by the tree"
"""What stands for a convention where none was found."""


class HalfKnownError(MotionError):
    """Names of a convention that lack needed bones or are out of order: the tree may tell more.

    agreed: bone -> joint, which the tree has to agree with, where the names lack bones of one side only.
    """

    def __init__(self, message: str, agreed: Mapping[str, int] | None = None) -> None:
        super().__init__(message)
        self.agreed = agreed or {}


@dataclass(frozen=True)
class JointMap:
    """The joints of a skeleton that are bones of the humanoid.

    joints: bone -> index of its joint, for the hips, the head and the limbs.
    spine, neck: the joints between the hips and the arms, and between the arms and the head, upwards; any number.
    convention: the name of the convention, "by the tree" or the name of the user's file.
    confidence: from 0 to 1, how certain the assignment of joints is.
    rest: where the convention is known to rest in a pose of its own: bone -> the rotation vector in degrees by which
        the humanoid's bone is turned in that pose; a bone that is not named is not turned.
    points: bone -> where it points in that pose (3), left, up and forward: a skeleton that rests otherwise is another.
    axes: where the convention is known to rest in no body's pose: joint -> its axes that point to the humanoid's left,
        up and forward in a T-pose, such as "-z x -y".
    """

    joints: Mapping[str, int]
    spine: tuple[int, ...]
    neck: tuple[int, ...]
    convention: str
    confidence: float
    rest: Mapping[str, Triple] | None = None
    points: Mapping[str, Triple] = field(default_factory=dict)
    axes: Mapping[int, str] = field(default_factory=dict)

    def carrier(self, skeleton: Skeleton) -> int:
        """The joint that carries legs and back: the hips, or what they hang on where the back is not theirs."""
        joint = self.joints["hips"]
        while self.spine[0] not in skeleton.subtree(skeleton.names[joint]):
            joint = skeleton.joints[joint].parent
        return joint

    def names(self, skeleton: Skeleton) -> dict[str, tuple[str, ...]]:
        """For each bone ("spine" and "neck" for all of the back and of the neck) the names of its joints."""
        found = {bone: (joint,) for bone, joint in self.joints.items()} | {"spine": self.spine, "neck": self.neck}
        return {bone: tuple(skeleton.names[joint] for joint in joints) for bone, joints in found.items()}


class Body:
    """A skeleton and which of its joints are bones: where its bones point, of positions (..., J, 3) of its joints.

    aims: bone of a limb -> the joints whose mean place it points to: the limb's next bone, or the joints after it but
    the thumb; none if none.
    """

    def __init__(self, skeleton: Skeleton, joint_map: JointMap) -> None:
        self.skeleton = skeleton
        self.joint_map = joint_map
        self.joints = joint_map.joints
        self.aims: dict[str, tuple[int, ...]] = {}
        for limb in LIMB_BONES:
            for bone, after in zip(limb, (*limb[1:], ""), strict=True):
                if bone in self.joints:
                    ends = (self.joints[after],) if after in self.joints else self._ends(self.joints[bone])
                    self.aims[bone] = ends
        rest = skeleton.rest_positions
        for shin, foot, toes in ([sided(side, part) for part in LEG[1:]] for side in LEFT_RIGHT):
            # a foot without toes that continues the shin within 15 degrees, as in old files, has no own direction
            if self.aims.get(foot) and toes not in self.joints:
                straight = self.direction(rest, shin) @ self.direction(rest, foot) > np.cos(np.radians(15))
                self.aims[foot] = () if straight else self.aims[foot]

    def _ends(self, joint: int) -> tuple[int, ...]:
        children = [i for i in self.skeleton.children[joint] if "thumb" not in self.skeleton.names[i].lower()]
        apart = tuple(child for child in children if np.any(self.skeleton.offsets[child]))
        return apart or next((ends for child in children if (ends := self._ends(child))), ())

    def along(self, positions: Array, bone: str) -> Array:
        """Vectors (..., 3) from the joint of a bone to the middle of what it points to."""
        found: Array = positions[..., list(self.aims[bone]), :].mean(axis=-2) - positions[..., self.joints[bone], :]
        return found

    def direction(self, positions: Array, bone: str) -> Array:
        """Directions (..., 3) in which a bone points."""
        return unit(self.along(positions, bone))

    def middle(self, positions: Array, part: str) -> Array:
        """The middle (..., 3) between a joint of the left and its partner."""
        left, right = (positions[..., self.joints[sided(side, part)], :] for side in LEFT_RIGHT)
        return (left + right) / 2

    def to_left(self, positions: Array, part: str) -> Array:
        """Vectors (..., 3) from a joint of the right to its partner on the left."""
        left, right = (positions[..., self.joints[sided(side, part)], :] for side in LEFT_RIGHT)
        return left - right

    def trunk_up(self, positions: Array) -> Array:
        """Directions (..., 3) from the middle of the legs' joints to that of the arms'."""
        return unit(self.middle(positions, "UpperArm") - self.middle(positions, "UpperLeg"))

    def legs_up(self, positions: Array) -> Array:
        """Directions (..., 3) from the feet to the legs' joints, the mean of both sides."""
        legs = [[positions[..., self.joints[sided(side, part)], :] for part in LEG[:3]] for side in LEFT_RIGHT]
        return unit(unit(legs[0][0] - legs[0][2]) + unit(legs[1][0] - legs[1][2]))


def humanoid_direction(bone: str) -> Array:
    """Where a bone of the humanoid points in the T-pose (3,)."""
    return unit(HUMANOID.offsets[HUMANOID.children[HUMANOID.index(bone)][0]])


def missing_bones(joint_map: JointMap) -> list[str]:
    """The required bones that are missing, and those present on the other side only."""
    there = {*joint_map.joints, *(["spine"] if joint_map.spine else [])}
    one_sided = [bone for bone, other in PARTNERS.items() if other in there]
    return [bone for bone in dict.fromkeys((*NEEDED, *one_sided)) if bone not in there]


def missing_on_one_side(missing: list[str], joint_map: JointMap) -> bool:
    """Whether bones are missing, all of them present on the other side."""
    return bool(missing) and all(PARTNERS.get(bone) in joint_map.joints for bone in missing)


def check_map(skeleton: Skeleton, joint_map: JointMap) -> JointMap:
    """The map itself; MotionError where bones are missing or the joints do not hang on each other as bones do."""
    missing = missing_bones(joint_map)
    if missing:
        raise MotionError(missing_reason(missing, joint_map))
    back = joint_map.spine[0]
    # the joint that carries the legs may hang beside the back, below what carries both
    limbs = {"back": joint_map.spine, "neck": (back, *joint_map.neck)}
    for side in LEFT_RIGHT:
        for limb, first, parts in (("leg", joint_map.joints["hips"], LEG), ("arm", back, ARM)):
            bones = (bone for part in parts if (bone := sided(side, part)) in joint_map.joints)
            limbs[f"{side} {limb}"] = (first, *(joint_map.joints[bone] for bone in bones))
    for limb, joints in limbs.items():
        for upper, lower in pairwise(joints):
            if lower not in skeleton.subtree(skeleton.names[upper]) or lower == upper:
                names = f"{skeleton.names[lower]!r} does not hang on {skeleton.names[upper]!r}"
                raise MotionError(f"the joints of the {limb} are out of order: {names}")
    return joint_map


def missing_reason(missing: list[str], joint_map: JointMap) -> str:
    """A sentence naming the bones a skeleton lacks."""
    remedy = "export them, too, or name them in a map"
    if {sided(side, part) for side in LEFT_RIGHT for part in LEG[:3]} <= set(missing):
        return f"this skeleton has no legs: a human needs hips with two legs, a spine and two arms; {remedy}"
    if missing_on_one_side(missing, joint_map):
        there = ", ".join(PARTNERS[bone] for bone in missing)
        return f"joints are missing on one side only: {', '.join(missing)} (the other side has {there}); {remedy}"
    return f"no joint was found for {', '.join(missing)}; {remedy}"


def read_map(path: str | Path, skeleton: Skeleton) -> JointMap:
    """Read a user's map: a JSON object from bones of the humanoid to names of the skeleton's joints.

    Keys are the bones' VRM names, values names of joints; "spine" and "neck" take a list, upwards:
    ``{"hips": "Root", "spine": ["Back1", "Back2"], "leftUpperLeg": "LThigh", ...}``. FormatError names the file and
    the fault: an unknown bone or joint, a joint named twice, a required bone that is missing.
    """
    path = Path(path)
    known = (*(bone for bone in BONES if bone not in (*SPINE[1:], *NECK[:1])), "neck")
    places: dict[str, tuple[int, ...]] = {}
    for bone, names in _entries(path).items():
        if bone not in known:
            raise FormatError(path, f"{bone!r} is not a bone of the humanoid: expected {', '.join(known)}")
        unknown = [name for name in names if name not in skeleton.names]
        if unknown:
            its = ", ".join(skeleton.names)
            raise FormatError(path, f"{bone}: the skeleton has no joint {unknown[0]!r}; it has {its}")
        places[bone] = tuple(skeleton.index(name) for name in names)
    used = [joint for joints in places.values() for joint in joints]
    twice = sorted({skeleton.names[joint] for joint in used if used.count(joint) > 1})
    if twice:
        raise FormatError(path, f"a joint can be only one bone; named twice: {', '.join(twice)}")
    spine, neck = (places.pop(chain, ()) for chain in ("spine", "neck"))
    longer = [bone for bone, joints in places.items() if len(joints) != 1]
    if longer:
        raise FormatError(path, f"{longer[0]}: expected one joint; only spine and neck take a list")
    joints = {bone: joint for bone, (joint,) in places.items()}
    try:
        return check_map(skeleton, JointMap(joints, spine, neck, path.name, 1.0))
    except MotionError as error:
        raise FormatError(path, str(error)) from error


def _entries(path: Path) -> dict[str, list[str]]:
    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        keys = [key for key, _ in pairs]
        twice = sorted({key for key in keys if keys.count(key) > 1})
        if twice:
            raise ValueError(f"{', '.join(twice)} appears twice")
        return dict(pairs)

    try:
        content: Any = json.loads(path.read_text("utf-8"), object_pairs_hook=once)
    except OSError as error:
        raise FormatError(path, f"cannot be read: {error.strerror}") from error
    except (ValueError, RecursionError) as error:
        raise FormatError(path, f"not a joint map in JSON: {error}") from error
    if not isinstance(content, dict):
        raise FormatError(path, "not a joint map: expected an object of bones and joints")
    entries = {bone: [names] if isinstance(names, str) else names for bone, names in content.items()}
    for bone, names in entries.items():
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
            raise FormatError(path, f"{bone}: expected the name of a joint or a list of names")
    return entries


@dataclass(frozen=True)
class Convention:
    """One table: for each bone the plain names that its joint can have; the same of joints that are no bones.

    spelled: names of bones as files write them. marks: plain names of which each file has one, if there are any.
    optional: bones that only some files have.
    """

    title: str
    names: dict[str, tuple[str, ...]]
    spelled: frozenset[str]
    aside: frozenset[str]
    marks: frozenset[str]
    optional: frozenset[str]
    prefixes: tuple[str, ...]
    rest: dict[str, Triple] | None
    points: dict[str, Triple]
    axes: dict[str, str]


@cache
def conventions() -> tuple[Convention, ...]:
    """All tables; one with several ways to write the sides comes once for each."""
    tables = sorted((files("motet.figures.humanoid") / "conventions").iterdir(), key=lambda table: table.name)
    contents = [json.loads(table.read_text("utf-8")) for table in tables]
    return tuple(_convention(content, sides) for content in contents for sides in content["sides"])


def _convention(content: dict[str, Any], sides: Sequence[str]) -> Convention:
    def of_both(key: str) -> frozenset[str]:
        known = content.get(key, [])
        return frozenset(_plain(name.replace("{s}", word)) for name in known for word in sides)

    names, spelled, optional = _bones(content, sides)
    return Convention(
        content["title"],
        names,
        spelled,
        of_both("aside"),
        of_both("marks"),
        optional,
        tuple(content.get("prefixes", ())),
        _both_sides(content["rest"], (1, -1, -1)) if "rest" in content else None,
        _both_sides(content.get("points", {}), (-1, 1, 1)),
        {_plain(name): known for name, known in content.get("axes", {}).items()},
    )


def _bones(
    content: dict[str, Any], sides: Sequence[str]
) -> tuple[dict[str, tuple[str, ...]], frozenset[str], frozenset[str]]:
    """Of each bone the plain names, all names as they are written, and the bones that only some files have."""
    names = {}
    spelled = set()
    optional = set()
    for part, known in content["joints"].items():
        for side, word in [("", "")] if part in UNSIDED else zip(LEFT_RIGHT, sides, strict=True):
            written = [name.replace("{s}", word) for name in known]
            bone = sided(side, part)
            names[bone] = tuple(map(_plain, written))
            spelled.update(written)
            if part in content.get("optional", []):
                optional.add(bone)
    return names, frozenset(spelled), frozenset(optional)


def _both_sides(of_left: dict[str, list[float]], signs: tuple[int, int, int]) -> dict[str, Triple]:
    """Vectors of bones of both sides: those of the right are those of the left with signs, which mirror them."""
    found: dict[str, Triple] = {}
    for bone, (x, y, z) in of_left.items():
        right = (signs[0] * x, signs[1] * y, signs[2] * z)
        found |= {bone: (x, y, z)} if bone in UNSIDED else {sided("left", bone): (x, y, z), sided("right", bone): right}
    return found


@lru_cache(maxsize=2**12)  # names of joints recur from file to file
def _own(name: str, prefix: str = NO_PREFIX) -> str:
    """A name without prefixes (a regular expression) and the namespace before a colon or a bar."""
    name = re.sub(f"^(?:{prefix})(?=.)", "", name, flags=re.IGNORECASE)
    return re.split("[:|]", name)[-1]


@lru_cache(maxsize=2**12)
def _plain(name: str) -> str:
    """A name without what differs between files: case, separators, and how letters are encoded."""
    return re.sub(r"[\W_]", "", unicodedata.normalize("NFKC", name).lower())


@lru_cache(maxsize=256)
def map_by_names(skeleton: Skeleton) -> JointMap | None:
    """The map by the convention that fits best, None where none does.

    HalfKnownError where a convention fits but for bones that are missing or out of order; MotionError where two joints
    are the hips.
    """
    written = _written(skeleton.names)
    matches = [_match(convention, skeleton, names) for names in written for convention in conventions()]
    matches = sorted(matches, key=lambda match: match[0], reverse=True)
    fullest = matches[0][1]
    whole = (match for match in matches if not missing_bones(match[1]))
    one_sided = missing_on_one_side(missing_bones(fullest), fullest)
    (known, _, _), best = matches[0] if one_sided else next(whole, matches[0])
    missing = missing_bones(best)
    if missing:
        if len(best.joints) >= 6 and known > 0.5 * len(skeleton.names):
            raise HalfKnownError(missing_reason(missing, best), best.joints if one_sided else None)
        return None
    try:
        return check_map(skeleton, best)
    except MotionError as error:
        raise HalfKnownError(str(error)) from error


def _written(names: tuple[str, ...]) -> list[tuple[str, ...]]:
    """Names without words that nearly all begin with: with numbers at their ends, without them, without two."""
    bare = without_numbers(names)
    kinds = dict.fromkeys((names, bare, without_numbers(bare)))
    return [_without_first_words(kind) for kind in kinds]


def _commonest(words: Sequence[str]) -> tuple[str, int]:
    """The word that is there most often, and how often."""
    return next(iter(Counter(words).most_common(1)), ("", 0))


def _nearly_all(count: int, names: Sequence[str]) -> bool:
    return count > 0.8 * len(names)


def without_numbers(names: tuple[str, ...]) -> tuple[str, ...]:
    """Names without the numbers that programs add at their ends: of nearly all names ("LeftArm_07", "hand.L.001"), or
    the one digit that nearly all end in ("Hips1", "Spine11"), or of names that no other is like without them."""
    bare = tuple(re.sub(r"(?<=.)[ ._-]+[0-9]+$", "", name) for name in names)
    if _nearly_all(sum(map(str.__ne__, bare, names)), names):
        return bare
    last, count = _commonest([name[-1:] for name in names])
    if last in set("0123456789") and _nearly_all(count, names):
        return tuple(name.removesuffix(last) if len(name) > 1 else name for name in names)
    counts = Counter(bare)
    return tuple(short if counts[short] == 1 else name for short, name in zip(bare, names, strict=True))


def _without_first_words(names: tuple[str, ...]) -> tuple[str, ...]:
    """Names without the words, or numbers, with which nearly all begin."""
    while True:
        first = [re.match(r"(?:[0-9]+[ _:.|-]*|[^\W\d_][^\W_]*[ _:.|-]+)(?=.)", name) for name in names]
        common, count = _commonest([match[0] for match in first if match])
        if not common or not _nearly_all(count, names):
            return names
        names = tuple(name.removeprefix(common) or name for name in names)


def _absent(convention: Convention, chain: str, names: Set[str]) -> int:
    """How many bones of back or neck are absent, and one more without any."""
    known = convention.names.get(chain, ())
    absent = sum(name not in names for name in known)
    if absent < len(known):
        return absent
    return 0 if chain in convention.optional or not known else 1 + absent


def _match(
    convention: Convention, skeleton: Skeleton, written: tuple[str, ...]
) -> tuple[tuple[int, int, int], JointMap]:
    """The map that a convention makes of a skeleton's names, and how well it fits: how many joints the convention has
    names for, how many are spelled as it spells them, and less how many of its bones are absent."""
    pattern = "|".join(f"(?:{prefix})[ _:.-]*" for prefix in convention.prefixes) or NO_PREFIX
    own = [_own(name, pattern) for name in written]
    names = [_plain(name) for name in own]
    hips = [i for i, name in enumerate(names) if name == convention.names["hips"][0] and len(skeleton.children[i]) >= 3]
    if len(hips) > 1:
        both = " and ".join(repr(skeleton.names[i]) for i in hips)
        raise MotionError(f"this file has two hips, {both}: put each figure in a file of its own")
    places = {name: i for i, name in reversed(list(enumerate(names)))}
    chains = {chain: convention.names.get(chain, ()) for chain in ("spine", "neck")}
    spine, neck = (tuple(sorted(places[name] for name in chain if name in places)) for chain in chains.values())
    limbs = {bone: known for bone, known in convention.names.items() if bone not in chains}
    found = {bone: [name for name in known if name in places] for bone, known in limbs.items()}
    joints = {bone: places[there[0]] for bone, there in found.items() if there}
    known = {name for bone in convention.names.values() for name in bone} | convention.aside
    count = sum(name in known for name in names)
    if convention.marks and not convention.marks & places.keys():
        count = 0
    spelled = sum(name in convention.spelled for name in own)
    absent = sum(bone not in joints and bone not in convention.optional for bone in limbs)
    absent += sum(_absent(convention, chain, places.keys()) for chain in chains)
    # other makers' figures of these names have joints besides, or rest in another pose
    rest = convention.rest if count >= sum(not name.endswith(END_SUFFIX) for name in skeleton.names) else None
    axes = {i: convention.axes[name] for i, name in enumerate(names) if name in convention.axes}
    confidence = round(1.0 - 0.3 * absent / max(absent + count, 1), 2)
    found_map = JointMap(joints, spine, neck, convention.title, confidence, rest, convention.points, axes)
    return (count, spelled, -absent), found_map
