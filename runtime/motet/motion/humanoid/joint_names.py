"""Finding the bones of the humanoid by the names of joints: one table for each convention, in the folder conventions.

A table is a JSON object: "title"; "sides", pairs of what stands for left and right; "joints", bone -> the names it can
have, with ``{s}`` in the place of the side (of "spine" and "neck" all that are there count, upwards, of others the
first); "aside", other joints that files of this convention have and that tell it from its neighbours; "prefixes",
regular expressions of what can stand before every name; "rest", for files that are known to rest in a T-pose of their
own, what that pose is on the humanoid: bone -> rotation vector in degrees, of the left side, and "points", where bones
point there, by which such a file is known among others of these names; "axes", for files that
rest in no body's pose: name -> the joint's axes that point left, up and forward in a T-pose. Upper and lower case and
separators do not count.
"""

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from importlib.resources import files
from typing import Any

from motet.errors import MotionError
from motet.motion.humanoid.bones import LEFT_RIGHT, sided
from motet.motion.humanoid.joint_map import JointMap, Triple, check_map, missing_bones, missing_reason, one_sided
from motet.motion.skeleton import END_SUFFIX, Skeleton


class HalfKnownError(MotionError):
    """Names of a convention that lack needed bones or are out of order: the tree may tell more."""


CHAINS = ("spine", "neck")
UNSIDED = ("hips", "head", *CHAINS)


@dataclass(frozen=True)
class Convention:
    """One table: for each bone the plain names that its joint can have; the same of joints that are no bones."""

    title: str
    names: dict[str, tuple[str, ...]]
    aside: frozenset[str]
    prefixes: tuple[str, ...]
    rest: dict[str, Triple] | None
    points: dict[str, Triple]
    axes: dict[str, str]


@dataclass(frozen=True)
class Match:
    """What one convention makes of a skeleton's names.

    known: how many joints the convention has names for; absent: how many of its bones the skeleton lacks.
    """

    title: str
    joints: dict[str, int]
    chains: dict[str, tuple[int, ...]]
    known: int
    absent: int
    rest: dict[str, Triple] | None
    points: dict[str, Triple]
    axes: dict[int, str]

    def fit(self) -> tuple[int, int]:
        """What is larger the better the convention fits."""
        return self.known, -self.absent

    @property
    def missing(self) -> list[str]:
        """The bones that are missing."""
        return missing_bones(self.joints, self.chains["spine"])


@cache
def conventions() -> tuple[Convention, ...]:
    """All tables; one with several ways to write the sides comes once for each."""
    tables = sorted((files("motet.motion.humanoid") / "conventions").iterdir(), key=lambda table: table.name)
    found = []
    for table in tables:
        content = json.loads(table.read_text("utf-8"))
        found += [_convention(content, sides) for sides in content["sides"]]
    return tuple(found)


def _convention(content: dict[str, Any], sides: Sequence[str]) -> Convention:
    names = {}
    for bone, known in content["joints"].items():
        if bone in UNSIDED:
            names[bone] = tuple(map(plain, known))
        else:
            for side, word in zip(LEFT_RIGHT, sides, strict=True):
                names[sided(side, bone)] = tuple(plain(name.replace("{s}", word)) for name in known)
    aside = {plain(name.replace("{s}", word)) for name in content.get("aside", []) for word in sides}
    axes = {plain(name): known for name, known in content.get("axes", {}).items()}
    prefixes = tuple(content.get("prefixes", ()))
    rest = _of_both_sides(content["rest"], (1, -1, -1)) if "rest" in content else None
    points = _of_both_sides(content.get("points", {}), (-1, 1, 1))
    return Convention(content["title"], names, frozenset(aside), prefixes, rest, points, axes)


def _of_both_sides(of_left: dict[str, list[float]], signs: tuple[int, int, int]) -> dict[str, Triple]:
    """Vectors of bones of both sides: those of the right are those of the left with signs, which mirror them."""
    found: dict[str, Triple] = {}
    for bone, (x, y, z) in of_left.items():
        right = (signs[0] * x, signs[1] * y, signs[2] * z)
        found |= {bone: (x, y, z)} if bone in UNSIDED else {sided("left", bone): (x, y, z), sided("right", bone): right}
    return found


def plain(name: str) -> str:
    """A name without what differs between files: case, separators, and the namespace before a colon."""
    return re.sub(r"[^a-z0-9]", "", name.rsplit(":", maxsplit=1)[-1].lower())


def plain_names(names: Sequence[str], prefixes: Sequence[str] = ()) -> list[str]:
    """Plain names without the prefixes given, or without the first word where nearly all names begin with it."""
    first = [re.match(r"[A-Za-z]+[0-9]*[ _:.-]+(?=.)", name) for name in names]
    words = [match[0] for match in first if match]
    common = max(words, key=words.count, default="")
    alternatives = [re.escape(common)] if words.count(common) > 0.8 * len(names) else []
    pattern = re.compile("|".join(f"(?:{p})[ _:.-]*" for p in (*prefixes, *alternatives)) or "(?!)", re.IGNORECASE)
    stripped = [re.sub(f"^(?:{pattern.pattern})(?=.)", "", name, flags=re.IGNORECASE) for name in names]
    return [plain(name) for name in stripped]


@lru_cache(maxsize=256)
def map_by_names(skeleton: Skeleton) -> JointMap | None:
    """The map by the convention that fits best, None where none does.

    HalfKnownError where a convention fits but for bones that are missing or out of order; MotionError where the one
    that knows most of the names lacks bones of one side only, or where two joints are the hips.
    """
    matches = [_match(convention, skeleton) for convention in conventions()]
    fullest = max(matches, key=Match.fit)
    whole = [match for match in matches if not match.missing]
    best = fullest if one_sided(fullest.missing, fullest.joints) else max(whole, key=Match.fit, default=fullest)
    if best.missing:
        if len(best.joints) >= 6 and best.known > 0.5 * len(skeleton.names):
            told = one_sided(best.missing, best.joints)
            raise (MotionError if told else HalfKnownError)(missing_reason(best.missing, best.joints))
        return None
    confidence = round(1.0 - 0.3 * best.absent / (best.absent + best.known), 2)
    found = JointMap(
        best.joints,
        best.chains["spine"],
        best.chains["neck"],
        best.title,
        confidence,
        best.rest,
        best.points,
        best.axes,
    )
    try:
        return check_map(skeleton, found)
    except MotionError as error:
        raise HalfKnownError(str(error)) from error


def _match(convention: Convention, skeleton: Skeleton) -> Match:
    names = plain_names(skeleton.names, convention.prefixes)
    _refuse_two_hips(skeleton, names, convention.names["hips"])
    joints = {
        bone: names.index(found[0])
        for bone, known in convention.names.items()
        if bone not in CHAINS and (found := [name for name in known if name in names])
    }
    chains = {
        chain: tuple(sorted(names.index(name) for name in convention.names.get(chain, ()) if name in names))
        for chain in CHAINS
    }
    known = {name for bone in convention.names.values() for name in bone} | convention.aside
    absent = [bone for bone in convention.names if bone not in joints and not chains.get(bone)]
    absent += [name for chain in CHAINS for name in convention.names.get(chain, ()) if name not in names]
    axes = {i: convention.axes[name] for i, name in enumerate(names) if name in convention.axes}
    count = sum(name in known for name in names)
    # other makers' figures of these names have joints besides, or rest in another pose
    rest = convention.rest if count >= sum(not name.endswith(END_SUFFIX) for name in skeleton.names) else None
    return Match(convention.title, joints, chains, count, len(absent), rest, convention.points, axes)


def _refuse_two_hips(skeleton: Skeleton, names: list[str], hips: tuple[str, ...]) -> None:
    found = [i for i, name in enumerate(names) if name == hips[0] and len(skeleton.children[i]) >= 3]
    if len(found) > 1:
        both = " and ".join(repr(skeleton.names[i]) for i in found)
        raise MotionError(f"this file has two hips, {both}: put each figure in a file of its own")
