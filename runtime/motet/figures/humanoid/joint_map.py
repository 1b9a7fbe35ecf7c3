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
from itertools import chain, pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from motet.errors import FormatError, MotionError
from motet.figures.humanoid.bones import (
    ARM,
    BONES,
    HUMANOID,
    LEFT_RIGHT,
    LEG,
    NECK,
    SPINE,
    limb_of,
    sided,
)
from motet.motion.rotations import Array, unit
from motet.motion.skeleton import END_SUFFIX, Names, Skeleton, Triple, repeated

LIMB_PARTS = (*LEG[:3], *ARM[1:3])
NEEDED = ("hips", "spine", *limb_of("left", LIMB_PARTS), *limb_of("right", LIMB_PARTS))
"""Bones without which a figure is not taken for a human's; the others stay at rest where it lacks them."""

PARTNERS: dict[str, str] = {}
"""For each bone of one side its partner."""

for _left, _right in zip(limb_of("left", LEG + ARM), limb_of("right", LEG + ARM), strict=True):
    PARTNERS[_left] = _right
    PARTNERS[_right] = _left

LIMB_BONES = (
    limb_of("left", LEG),
    limb_of("left", ARM[1:]),
    limb_of("right", LEG),
    limb_of("right", ARM[1:]),
)
"""Legs and arms without shoulders of both sides, each from the trunk outwards."""

UNSIDED = ("hips", "head", "spine", "neck")
"""Keys of tables that have no side."""

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
    """The joints of a skeleton that are bones of the humanoid."""

    joints: Mapping[str, int]
    """Bone -> index of its joint, for the hips, the head and the limbs."""

    spine: tuple[int, ...]
    """The joints between the hips and the arms, upwards; any number."""

    neck: tuple[int, ...]
    """The joints between the arms and the head, upwards; any number."""

    convention: str
    """The name of the convention, "by the tree" or the name of the user's file."""

    confidence: float
    """From 0 to 1, how certain the assignment of joints is."""

    rest: Mapping[str, Triple] | None = None
    """Where the convention is known to rest in a pose of its own: bone -> the rotation vector in degrees by which the
    humanoid's bone is turned in that pose; a bone that is not named is not turned."""

    points: Mapping[str, Triple] = field(default_factory=dict)
    """Bone -> the direction (3), left, up and forward, in that pose: a skeleton that rests otherwise is another."""

    axes: Mapping[int, str] = field(default_factory=dict)
    """Where the convention is known to rest in no body's pose: joint -> its axes that point to the humanoid's left, up
    and forward in a T-pose, such as "-z x -y"."""

    def carrier(self, skeleton: Skeleton) -> int:
        """The joint that carries legs and back: the hips, or their ancestor where the back is not theirs."""
        joint = self.joints["hips"]
        while self.spine[0] not in skeleton.below(joint):
            joint = skeleton.joints[joint].parent
        return joint

    @property
    def neck_and_head(self) -> tuple[int, ...]:
        """The joints of the neck and the head's, where there is one."""
        return self.neck + tuple(joint for bone, joint in self.joints.items() if bone == "head")

    def names(self, skeleton: Skeleton) -> dict[str, Names]:
        """For each bone ("spine" and "neck" for all of the back and of the neck) the names of its joints."""
        joints = {bone: (joint,) for bone, joint in self.joints.items()}
        names = {}
        for bone, places in {**joints, "spine": self.spine, "neck": self.neck}.items():
            names[bone] = tuple(skeleton.names[joint] for joint in places)
        return names


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
                    is_last = after not in self.joints
                    self.aims[bone] = self._ends(self.joints[bone]) if is_last else (self.joints[after],)
        for side in LEFT_RIGHT:
            foot = sided(side, "Foot")
            if self.aims.get(foot) and sided(side, "Toes") not in self.joints and self._continues_shin(side):
                self.aims[foot] = ()

    def _continues_shin(self, side: str) -> bool:
        """Whether a foot continues the shin at rest within 15 degrees, as in old files, so that it has no direction."""
        rest = self.skeleton.rest_positions
        cosine = self.direction(rest, sided(side, "LowerLeg")) @ self.direction(rest, sided(side, "Foot"))
        return bool(cosine > np.cos(np.radians(15)))

    def _ends(self, joint: int) -> tuple[int, ...]:
        """The nearest joints below one that lie apart from it, without thumbs."""
        # joints at the same place point nowhere: those after them do
        children = [i for i in self.skeleton.children[joint] if "thumb" not in self.skeleton.names[i].lower()]
        apart = tuple(child for child in children if np.any(self.skeleton.offsets[child]))
        if apart:
            return apart
        for child in children:
            ends = self._ends(child)
            if ends:
                return ends
        return ()

    def along(self, positions: Array, bone: str) -> Array:
        """Vectors (..., 3) from the joint of a bone to the middle of the joints that it points to."""
        vectors: Array = positions[..., list(self.aims[bone]), :].mean(axis=-2) - positions[..., self.joints[bone], :]
        return vectors

    def direction(self, positions: Array, bone: str) -> Array:
        """Directions (..., 3) in which a bone points."""
        return unit(self.along(positions, bone))

    def middle(self, positions: Array, part: str) -> Array:
        """The middle (..., 3) between a joint of the left and its partner."""
        left = self._position(positions, "left", part)
        right = self._position(positions, "right", part)
        return (left + right) / 2

    def to_left(self, positions: Array, part: str) -> Array:
        """Vectors (..., 3) from a joint of the right to its partner on the left."""
        return self._position(positions, "left", part) - self._position(positions, "right", part)

    def trunk_up(self, positions: Array) -> Array:
        """Directions (..., 3) from the middle of the legs' joints to that of the arms'."""
        return unit(self.middle(positions, "UpperArm") - self.middle(positions, "UpperLeg"))

    def legs_up(self, positions: Array) -> Array:
        """Directions (..., 3) from the feet to the legs' joints, the mean of both sides."""
        directions = []
        for side in LEFT_RIGHT:
            leg = self._position(positions, side, "UpperLeg") - self._position(positions, side, "Foot")
            directions.append(unit(leg))
        return unit(directions[0] + directions[1])

    def _position(self, positions: Array, side: str, part: str) -> Array:
        """Positions (..., 3) of the joint of a bone."""
        return positions[..., self.joints[sided(side, part)], :]


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
    for limb, joints in _chains(joint_map).items():
        for upper, lower in pairwise(joints):
            if lower not in skeleton.below(upper) or lower == upper:
                names = f"{skeleton.names[lower]!r} does not hang on {skeleton.names[upper]!r}"
                raise MotionError(f"the joints of the {limb} are out of order: {names}")
    return joint_map


def _chains(joint_map: JointMap) -> dict[str, tuple[int, ...]]:
    """Back, neck, legs and arms, each as joints of which every next one hangs on the one before."""
    back = joint_map.spine[0]
    # the joint that carries the legs may hang beside the back, below an ancestor of both
    chains = {"back": joint_map.spine, "neck": (back, *joint_map.neck)}
    for side in LEFT_RIGHT:
        for limb, first, parts in (
            ("leg", joint_map.joints["hips"], LEG),
            ("arm", back, ARM),
        ):
            bones = [bone for bone in limb_of(side, parts) if bone in joint_map.joints]
            chains[f"{side} {limb}"] = (
                first,
                *(joint_map.joints[bone] for bone in bones),
            )
    return chains


def missing_reason(missing: list[str], joint_map: JointMap) -> str:
    """A sentence naming the bones a skeleton lacks."""
    remedy = "export them, too, or name them in a map"
    if {bone for bone in NEEDED if bone.endswith(("Leg", "Foot"))} <= set(missing):
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
    try:
        places = _joints_of_entries(path, skeleton)
        spine = places.pop("spine", ())
        neck = places.pop("neck", ())
        longer = [bone for bone, joints in places.items() if len(joints) != 1]
        if longer:
            raise MotionError(f"{longer[0]}: expected one joint; only spine and neck take a list")
        joints = {bone: joint for bone, (joint,) in places.items()}
        return check_map(skeleton, JointMap(joints, spine, neck, path.name, 1.0))
    except MotionError as error:
        raise FormatError(path, str(error)) from error


def _joints_of_entries(path: Path, skeleton: Skeleton) -> dict[str, tuple[int, ...]]:
    """For each bone of a user's map its joints, each of them one bone's."""
    # the spine and the neck may have any number of joints
    known = [bone for bone in BONES if bone not in (*SPINE[1:], *NECK[:1])] + ["neck"]
    places = {}
    for bone, names in _entries(path).items():
        if bone not in known:
            raise MotionError(f"{bone!r} is not a bone of the humanoid: expected {', '.join(known)}")
        try:
            places[bone] = tuple(skeleton.index(name) for name in names)
        except MotionError as error:
            raise MotionError(f"{bone}: {error}") from error
    # each joint is one bone's
    twice = repeated(skeleton.names[joint] for joint in chain.from_iterable(places.values()))
    if twice:
        raise MotionError(f"a joint can be only one bone; named twice: {', '.join(twice)}")
    return places


def _entries(path: Path) -> dict[str, list[str]]:
    """A user's map as it is written: for each bone the names of its joints."""
    try:
        content: Any = json.loads(path.read_text("utf-8"), object_pairs_hook=_unique_keys)
    except OSError as error:
        raise MotionError(f"cannot be read: {error.strerror}") from error
    except (ValueError, RecursionError) as error:
        raise MotionError(f"not a joint map in JSON: {error}") from error
    if not isinstance(content, dict):
        raise MotionError("not a joint map: expected an object of bones and joints")
    entries = {bone: [names] if isinstance(names, str) else names for bone, names in content.items()}
    for bone, names in entries.items():
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
            raise MotionError(f"{bone}: expected the name of a joint or a list of names")
    return entries


def _unique_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """A JSON object; ValueError where a key appears twice, which json takes silently."""
    twice = repeated(key for key, _ in pairs)
    if twice:
        raise ValueError(f"{', '.join(twice)} appears twice")
    return dict(pairs)


@dataclass(frozen=True)
class Convention:
    """A convention of joint names, with one of its ways to write the sides. A plain name is one as :func:`_plain` makes
    it."""

    title: str
    """The name of the convention."""

    names: dict[str, Names]
    """For each bone the plain names that its joint can have."""

    spelled: frozenset[str]
    """Names of bones as files write them."""

    aside: frozenset[str]
    """Plain names of joints that are no bones."""

    marks: frozenset[str]
    """Plain names of which each file has at least one; empty if there are none."""

    optional: frozenset[str]
    """Bones that only some files have."""

    prefixes: Names
    """Regular expressions of prefixes that every name can have."""

    rest: dict[str, Triple] | None
    """As :attr:`JointMap.rest`."""

    points: dict[str, Triple]
    """As :attr:`JointMap.points`."""

    axes: dict[str, str]
    """Plain name of a joint -> its axes, as in :attr:`JointMap.axes`."""


@cache
def conventions() -> tuple[Convention, ...]:
    """All tables; one with several ways to write the sides comes once for each."""
    # in the order of their files' names, which decides between equals
    tables = sorted(
        (files("motet.figures.humanoid") / "conventions").iterdir(),
        key=lambda table: table.name,
    )
    all_conventions = []
    for table in tables:
        content = json.loads(table.read_text("utf-8"))
        for sides in content["sides"]:
            all_conventions.append(_convention(content, sides))
    return tuple(all_conventions)


def _convention(content: dict[str, Any], sides: Sequence[str]) -> Convention:
    names, spelled, optional = _bones(content, sides)
    return Convention(
        content["title"],
        names,
        spelled,
        _of_both_sides(content.get("aside", []), sides),
        _of_both_sides(content.get("marks", []), sides),
        optional,
        tuple(content.get("prefixes", ())),
        _both_sides(content["rest"], (1, -1, -1)) if "rest" in content else None,
        _both_sides(content.get("points", {}), (-1, 1, 1)),
        {_plain(name): known for name, known in content.get("axes", {}).items()},
    )


def _of_both_sides(names: Sequence[str], sides: Sequence[str]) -> frozenset[str]:
    """Plain names of both sides."""
    plain = set()
    for name in names:
        for word in sides:
            plain.add(_plain(name.replace("{s}", word)))
    return frozenset(plain)


def _bones(content: dict[str, Any], sides: Sequence[str]) -> tuple[dict[str, Names], frozenset[str], frozenset[str]]:
    """For each bone the plain names, all names as they are written, and the bones that only some files have."""
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
    vectors = {}
    for bone, (x, y, z) in of_left.items():
        if bone in UNSIDED:
            vectors[bone] = (x, y, z)
        else:
            vectors[sided("left", bone)] = (x, y, z)
            vectors[sided("right", bone)] = (signs[0] * x, signs[1] * y, signs[2] * z)
    return vectors


@lru_cache(maxsize=2**12)  # names of joints recur from file to file
def _without_prefix(name: str, prefix: str = NO_PREFIX) -> str:
    """A name without prefixes (a regular expression) and the namespace before a colon or a bar."""
    name = re.sub(f"^(?:{prefix})(?=.)", "", name, flags=re.IGNORECASE)
    return re.split("[:|]", name)[-1]


@lru_cache(maxsize=2**12)
def _plain(name: str) -> str:
    """A name without the differences between files: case, separators, and the encoding of letters."""
    return re.sub(r"[\W_]", "", unicodedata.normalize("NFKC", name).lower())


class _Match(NamedTuple):
    """The map that a convention makes of a skeleton's names, and how well it fits."""

    score: tuple[int, int, int]
    """The number of joints that the convention has names for, of those spelled as it spells them, and less the number
    of its bones that are absent."""

    joint_map: JointMap


@lru_cache(maxsize=256)
def map_by_names(skeleton: Skeleton) -> JointMap | None:
    """The map by the convention that fits best, None where none does.

    HalfKnownError where a convention fits but for bones that are missing or out of order; MotionError where two joints
    are the hips.
    """
    # every way to read the names by every convention, the best score first
    matches = []
    for names in _written(skeleton.names):
        for convention in conventions():
            matches.append(_match(convention, skeleton, names))
    matches.sort(key=lambda match: match.score, reverse=True)

    # the fullest map, where only bones of one side are missing; else the fullest with all bones
    fullest = matches[0].joint_map
    one_sided = missing_on_one_side(missing_bones(fullest), fullest)
    whole = [match for match in matches if not missing_bones(match.joint_map)]
    best = matches[0] if one_sided or not whole else whole[0]
    # a convention that knows half of the names is no accident
    missing = missing_bones(best.joint_map)
    joints = best.joint_map.joints
    if missing:
        if len(joints) >= 6 and best.score[0] > 0.5 * len(skeleton.names):
            raise HalfKnownError(missing_reason(missing, best.joint_map), joints if one_sided else None)
        return None
    try:
        return check_map(skeleton, best.joint_map)
    except MotionError as error:
        raise HalfKnownError(str(error)) from error


def _written(names: Names) -> list[Names]:
    """Names without words that nearly all begin with: with numbers at their ends, without them, without two."""
    bare = without_numbers(names)
    kinds = dict.fromkeys((names, bare, without_numbers(bare)))
    return [_without_first_words(kind) for kind in kinds]


def _commonest(words: Sequence[str]) -> tuple[str, int]:
    """The word that is there most often, and how often."""
    return next(iter(Counter(words).most_common(1)), ("", 0))


def _nearly_all(count: int, names: Sequence[str]) -> bool:
    return count > 0.8 * len(names)


def without_numbers(names: Names) -> Names:
    """Names without the numbers that programs add at their ends: of nearly all names ("LeftArm_07", "hand.L.001"), or
    the one digit that nearly all end in ("Hips1", "Spine11"), or of names that no other is like without them."""
    # numbers after a separator, that nearly all names have
    bare = tuple(re.sub(r"(?<=.)[ ._-]+[0-9]+$", "", name) for name in names)
    if _nearly_all(sum(map(str.__ne__, bare, names)), names):
        return bare
    # one digit that nearly all names end in
    last, count = _commonest([name[-1:] for name in names])
    if last in set("0123456789") and _nearly_all(count, names):
        return tuple(name.removesuffix(last) if len(name) > 1 else name for name in names)
    # else the number goes where the name stays unlike all others
    counts = Counter(bare)
    return tuple(short if counts[short] == 1 else name for short, name in zip(bare, names, strict=True))


def _without_first_words(names: Names) -> Names:
    """Names without the words, or numbers, with which nearly all begin."""
    while True:
        first = [re.match(r"(?:[0-9]+[ _:.|-]*|[^\W\d_][^\W_]*[ _:.|-]+)(?=.)", name) for name in names]
        common, count = _commonest([match[0] for match in first if match])
        if not common or not _nearly_all(count, names):
            return names
        names = tuple(name.removeprefix(common) or name for name in names)


def _absent_in_chain(convention: Convention, chain: str, names: Set[str]) -> int:
    """The number of bones of back or neck that are absent, and one more if none is there."""
    known = convention.names.get(chain, ())
    absent = sum(name not in names for name in known)
    if absent < len(known):
        return absent
    return 0 if chain in convention.optional or not known else 1 + absent


def _match(convention: Convention, skeleton: Skeleton, written: Names) -> _Match:
    """The map that a convention makes of a skeleton's names, as they are written."""
    bare = _without_prefixes(convention, written)
    names = [_plain(name) for name in bare]
    _check_hips(convention, skeleton, names)

    # the first joint of each name that a bone can have; of back and neck all joints
    places = dict(zip(reversed(names), reversed(range(len(names))), strict=True))
    joints = _limb_joints(convention, places)
    score = _score(convention, names, bare, joints)

    # other makers' figures of these names have joints besides, or rest in another pose
    count, _, minus_absent = score
    is_whole = count >= sum(not name.endswith(END_SUFFIX) for name in skeleton.names)
    joint_map = JointMap(
        joints=joints,
        spine=_chain(convention, "spine", places),
        neck=_chain(convention, "neck", places),
        convention=convention.title,
        confidence=round(1.0 + 0.3 * minus_absent / max(count - minus_absent, 1), 2),
        rest=convention.rest if is_whole else None,
        points=convention.points,
        axes=_known_axes(convention, names),
    )
    return _Match(score, joint_map)


def _without_prefixes(convention: Convention, names: Sequence[str]) -> list[str]:
    """Names without the prefixes that a convention's names can have."""
    pattern = "|".join(f"(?:{prefix})[ _:.-]*" for prefix in convention.prefixes) or NO_PREFIX
    return [_without_prefix(name, pattern) for name in names]


def _known_axes(convention: Convention, names: Sequence[str]) -> dict[int, str]:
    """For each joint by plain names the axes that the convention states (:attr:`JointMap.axes`)."""
    return {i: convention.axes[name] for i, name in enumerate(names) if name in convention.axes}


CHAINS = ("spine", "neck")
"""Keys of tables that stand for any number of joints."""


def _limb_joints(convention: Convention, places: Mapping[str, int]) -> dict[str, int]:
    """For each bone but back and neck its joint, from the joint of each plain name."""
    joints = {}
    for bone, known in convention.names.items():
        present = [name for name in known if name in places]
        if bone not in CHAINS and present:
            joints[bone] = places[present[0]]
    return joints


def _check_hips(convention: Convention, skeleton: Skeleton, names: Sequence[str]) -> None:
    """MotionError where two joints with plain names are hips that carry three joints and more."""
    hips = []
    for i, name in enumerate(names):
        if name == convention.names["hips"][0] and len(skeleton.children[i]) >= 3:
            hips.append(repr(skeleton.names[i]))
    if len(hips) > 1:
        raise MotionError(f"this file has two hips, {' and '.join(hips)}: put each figure in a file of its own")


def _chain(convention: Convention, chain: str, places: Mapping[str, int]) -> tuple[int, ...]:
    """The joints of back or neck, in the skeleton's order, from the joint of each plain name."""
    return tuple(sorted(places[name] for name in convention.names.get(chain, ()) if name in places))


def _score(
    convention: Convention,
    names: Sequence[str],
    bare: Sequence[str],
    joints: Mapping[str, int],
) -> tuple[int, int, int]:
    """How well a convention fits (:attr:`_Match.score`) plain names, written ones without prefixes, and the joints
    of limbs."""
    # without a mark these names are another convention's
    known = convention.aside.union(*convention.names.values())
    is_marked = not convention.marks or not convention.marks.isdisjoint(names)
    count = sum(name in known for name in names) if is_marked else 0
    spelled = sum(name in convention.spelled for name in bare)
    # bones that the convention has and this skeleton lacks
    absent = sum(_absent_in_chain(convention, chain, set(names)) for chain in CHAINS)
    for bone in convention.names:
        if bone not in CHAINS and bone not in joints and bone not in convention.optional:
            absent += 1
    return count, spelled, -absent
