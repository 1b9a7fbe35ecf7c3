"""Which joint of a skeleton is which bone of the humanoid, and the user's file that says so."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

from motet.errors import FormatError, MotionError
from motet.motion.humanoid.bones import ARM, BONES, LEFT_RIGHT, LEG, NECK, SPINE, sided
from motet.motion.skeleton import Skeleton

Triple = tuple[float, float, float]

NEEDED = ("hips", "spine", *(sided(side, part) for side in LEFT_RIGHT for part in (*LEG[:3], *ARM[1:3])))
"""Bones without which a figure is not taken for a human's; the others stay at rest where it lacks them."""

PAIRED = tuple((sided("left", part), sided("right", part)) for part in (*LEG, *ARM))
"""Bones of the left with their partners on the right."""

PARTNERS = dict(PAIRED) | {right: left for left, right in PAIRED}
"""For each bone of one side its partner."""

MAP_KEYS = tuple(bone for bone in BONES if bone not in (*SPINE[1:], *NECK[:1]))
"""What a map can name, besides "neck": the joints of the back all go by the name "spine"."""


BY_THE_TREE = "by the tree"
"""What stands for a convention where none was found."""


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
        chains = {"spine": self.spine, "neck": self.neck}
        found = {bone: (joint,) for bone, joint in self.joints.items()} | chains
        return {bone: tuple(skeleton.names[joint] for joint in joints) for bone, joints in found.items()}


def missing_bones(found: Mapping[str, object], spine: tuple[int, ...]) -> list[str]:
    """The required bones that are missing, and those present on the other side only."""
    there = {*found, *(["spine"] if spine else [])}
    missing = [bone for bone in NEEDED if bone not in there]
    return missing + [bone for bone in _one_sided(there) if bone not in missing]


def check_map(skeleton: Skeleton, joint_map: JointMap) -> JointMap:
    """The map itself; MotionError where bones are missing or the joints do not hang on each other as bones do."""
    missing = missing_bones(joint_map.joints, joint_map.spine)
    if missing:
        raise MotionError(missing_reason(missing, joint_map.joints))
    hips = joint_map.joints["hips"]
    # the joint that carries the legs may hang beside the back, below what carries both
    limbs = {"back": joint_map.spine, "neck": (joint_map.spine[0], *joint_map.neck)}
    for side in LEFT_RIGHT:
        for limb, first, parts in (("leg", hips, LEG), ("arm", joint_map.spine[0], ARM)):
            bones = [sided(side, part) for part in parts]
            limbs[f"{side} {limb}"] = (first, *(joint_map.joints[bone] for bone in bones if bone in joint_map.joints))
    for limb, joints in limbs.items():
        for upper, lower in pairwise(joints):
            if lower not in skeleton.subtree(skeleton.names[upper]) or lower == upper:
                names = f"{skeleton.names[lower]!r} does not hang on {skeleton.names[upper]!r}"
                raise MotionError(f"the joints of the {limb} are out of order: {names}")
    return joint_map


def missing_reason(missing: list[str], found: Mapping[str, object]) -> str:
    """A sentence naming the bones a skeleton lacks."""
    legs = [sided(side, part) for side in LEFT_RIGHT for part in LEG[:3]]
    remedy = "export them, too, or name them in a map"
    if all(bone in missing for bone in legs):
        return f"this skeleton has no legs: a human needs hips with two legs, a spine and two arms; {remedy}"
    if one_sided(missing, found):
        there = ", ".join(PARTNERS[bone] for bone in missing)
        return f"joints are missing on one side only: {', '.join(missing)} (the other side has {there}); {remedy}"
    return f"no joint was found for {', '.join(missing)}; {remedy}"


def one_sided(missing: list[str], found: Mapping[str, object]) -> bool:
    """Whether bones are missing, all of them present on the other side."""
    return bool(missing) and all(PARTNERS.get(bone) in found for bone in missing)


def _one_sided(there: set[str]) -> list[str]:
    pairs = [pair for pair in PAIRED if (pair[0] in there) != (pair[1] in there)]
    return [left if right in there else right for left, right in pairs]


def read_map(path: str | Path, skeleton: Skeleton) -> JointMap:
    """Read a user's map: a JSON object from bones of the humanoid to names of the skeleton's joints.

    Keys are the bones' VRM names, values names of joints; "spine" and "neck" take a list, upwards:
    ``{"hips": "Root", "spine": ["Back1", "Back2"], "leftUpperLeg": "LThigh", ...}``. FormatError names the file and
    the fault: an unknown bone or joint, a joint named twice, a required bone that is missing.
    """
    path = Path(path)
    places: dict[str, tuple[int, ...]] = {}
    for bone, names in _entries(path).items():
        if bone not in (*MAP_KEYS, "neck"):
            expected = ", ".join((*MAP_KEYS, "neck"))
            raise FormatError(path, f"{bone!r} is not a bone of the humanoid: expected {expected}")
        unknown = [name for name in names if name not in skeleton.names]
        if unknown:
            raise FormatError(path, f"{bone}: the skeleton has no joint {unknown[0]!r}; it has {_list(skeleton)}")
        places[bone] = tuple(skeleton.index(name) for name in names)
    used = [joint for joints in places.values() for joint in joints]
    twice = sorted({skeleton.names[joint] for joint in used if used.count(joint) > 1})
    if twice:
        raise FormatError(path, f"a joint can be only one bone; named twice: {', '.join(twice)}")
    chains = {chain: places.pop(chain, ()) for chain in ("spine", "neck")}
    longer = [bone for bone, joints in places.items() if len(joints) != 1]
    if longer:
        raise FormatError(path, f"{longer[0]}: expected one joint; only spine and neck take a list")
    joints = {bone: joint for bone, (joint,) in places.items()}
    try:
        return check_map(skeleton, JointMap(joints, chains["spine"], chains["neck"], path.name, 1.0))
    except MotionError as error:
        raise FormatError(path, str(error)) from error


def _entries(path: Path) -> dict[str, list[str]]:
    try:
        content: Any = json.loads(path.read_text("utf-8"), object_pairs_hook=_once)
    except OSError as error:
        raise FormatError(path, f"cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise FormatError(path, f"not a joint map in JSON: {error}") from error
    if not isinstance(content, dict):
        raise FormatError(path, "not a joint map: expected an object of bones and joints")
    entries = {bone: [names] if isinstance(names, str) else names for bone, names in content.items()}
    for bone, names in entries.items():
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
            raise FormatError(path, f"{bone}: expected the name of a joint or a list of names")
    return entries


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    keys = [key for key, _ in pairs]
    twice = sorted({key for key in keys if keys.count(key) > 1})
    if twice:
        raise ValueError(f"{', '.join(twice)} appears twice")
    return dict(pairs)


def _list(skeleton: Skeleton) -> str:
    return ", ".join(skeleton.names)
