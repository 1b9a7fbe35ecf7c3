"""ASF, the skeleton file beside AMC motion (Acclaim).

A bone turns about its start and carries its children at its end, so a bone's ``direction * length`` is the offset of
its child joints, and a last bone gets a joint ``NAME_end``. The words of ``dof`` and of the root's ``order`` name a
bone's channels, first applied first: ``rx ry rz`` is R = Rz Ry Rx, and so is ``axis ... XYZ``. The root's
``orientation`` is read as its axis, its ``position`` as its offset.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

import numpy as np

from motet.errors import FormatError, MotionError, quoted
from motet.files import write_whole
from motet.formats.lines import Names, complete_order, numbers, read_text
from motet.motion.rotations import euler_to_rotmat, rotmat_to_euler
from motet.motion.skeleton import END_SUFFIX, Joint, Skeleton

CMU_LENGTH = 0.45
CMU_METRES = 0.0254 / CMU_LENGTH
"""CMU writes ``length 0.45`` for lengths in inches times 0.45. Other values have no known meaning."""

ASF_ROOT = "root"
Triple = tuple[float, float, float]
Lines = list[tuple[int, list[str]]]


@dataclass(frozen=True)
class Asf:
    """A skeleton; the channel names ("rx", "tx", ...) of every joint that has any; the angle unit, deg or rad.

    Shared between files of the same skeleton: do not modify.
    """

    skeleton: Skeleton
    dofs: Mapping[str, tuple[str, ...]]
    angle: str


@dataclass
class _Bone:
    name: str = ""
    reach: Triple = (0.0, 0.0, 0.0)
    axis: Triple = (0.0, 0.0, 0.0)
    dofs: tuple[str, ...] = ()
    children: list[str] = field(default_factory=list)
    order: str = "XYZ"


def read_skeleton(path: str | Path) -> Asf:
    """Read an ASF file, without limits and masses.

    FormatError with file and line if it is not one, a bone has no direction, length or axis, or the hierarchy omits
    one.
    """
    return _skeleton(Path(path), read_text(path))


@lru_cache(maxsize=16)
def _skeleton(path: Path, text: str) -> Asf:
    """A folder mostly holds motions of a few people: each skeleton is parsed once."""
    sections = _sections(path, text)
    units = {words[0].lower(): words[1] for _, words in sections.get("units", []) if len(words) > 1}
    angle = units.get("angle", "deg").lower()[:3]
    if angle not in ("deg", "rad"):
        raise FormatError(path, f"angles in {quoted(units['angle'])}: expected deg or rad")
    factor = 1.0 if angle == "deg" else 180 / np.pi
    root, position = _root(path, sections.get("root", []), factor)
    bones = {ASF_ROOT: root}
    for line, block in _blocks(path, sections.get("bonedata", [])):
        bone = _bone(path, line, block, factor)
        if not bone.name or bone.name in bones:
            raise FormatError(path, f"bone names must be unique and not empty, not {quoted(bone.name)}", line)
        bones[bone.name] = bone
    _hang_children(path, sections.get("hierarchy", []), bones)
    metres = CMU_METRES if units.get("length") == str(CMU_LENGTH) else None
    joints = _joints(bones, position)
    if lost := bones.keys() - {joint.name for joint in joints}:
        raise FormatError(path, f"the hierarchy does not reach bone {quoted(min(lost))}")
    try:
        skeleton = Skeleton(tuple(joints), metres)
    except MotionError as error:
        raise FormatError(path, str(error)) from error
    return Asf(skeleton, {bone.name: bone.dofs for bone in bones.values() if bone.dofs}, angle)


def _sections(path: Path, text: str) -> dict[str, Lines]:
    """The lines of each ``:section``, as line number and words, without comments."""
    sections: dict[str, Lines] = {}
    current: Lines = []
    for line, content in enumerate(text.split("\n"), start=1):
        words = content.split("#")[0].split()
        if words and words[0].startswith(":"):
            current = sections.setdefault(words[0][1:].lower(), [])
        elif words:
            current.append((line, words))
    if "root" not in sections or "hierarchy" not in sections:
        raise FormatError(path, "an ASF file needs the sections :root, :bonedata and :hierarchy")
    return sections


def _blocks(path: Path, lines: Lines) -> Iterator[tuple[int, Lines]]:
    """The lines between each ``begin`` and ``end``, with the line of ``begin``."""
    start = 0
    block: Lines = []
    for line, words in lines:
        word = words[0].lower()
        if word in ("begin", "end") and (word == "begin") == bool(start):
            raise FormatError(path, f"{word!r} where {'a bone' if start else 'no bone'} has begun", line)
        if word == "begin":
            start, block = line, []
        elif word == "end":
            yield start, block
            start = 0
        else:
            block.append((line, words))
    if start:
        raise FormatError(path, "a bone without 'end'", start)


def _root(path: Path, lines: Lines, factor: float) -> tuple[_Bone, Triple]:
    root, position, order, angles = _Bone(ASF_ROOT), (0.0, 0.0, 0.0), "XYZ", [(0, ["0", "0", "0"])]
    for line, words in lines:
        match words[0].lower():
            case "order":
                root.dofs = _dofs(path, line, words[1:], ("tx", "ty", "tz", "rx", "ry", "rz"))
            case "axis":
                order = words[-1]
            case "position":
                position = _triple(path, line, words[1:])
            case "orientation":
                angles = [(line, words[1:])]
    line, words = angles[0]
    root.axis = _axis(path, line, [*words, order], factor)
    return root, position


def _bone(path: Path, begin: int, lines: Lines, factor: float) -> _Bone:
    bone, direction, length = _Bone(), (0.0, 0.0, 0.0), 0.0
    said = {words[0].lower() for _, words in lines}
    if missing := [word for word in ("direction", "length", "axis") if word not in said]:
        raise FormatError(path, f"this bone has no {' or '.join(missing)}", begin)
    for line, words in lines:
        match words[0].lower():
            case "name":
                bone.name = words[-1]
            case "direction":
                direction = _triple(path, line, words[1:])
            case "length":
                length = numbers(words[1:2] or [""], path, line)[0]
            case "axis":
                bone.axis = _axis(path, line, words[1:], factor)
            case "dof":
                bone.dofs = _dofs(path, line, words[1:], ("rx", "ry", "rz"))
    bone.reach = _triple(path, begin, [repr(value * length) for value in direction])
    return bone


def _triple(path: Path, line: int, words: list[str]) -> Triple:
    values = numbers(words, path, line)
    if len(values) != 3:
        raise FormatError(path, f"expected three numbers, not {len(values)}", line)
    return values[0], values[1], values[2]


def _axis(path: Path, line: int, words: list[str], factor: float) -> Triple:
    """Angles in the order of the letters that follow them, as angles about x, y, z of ``Joint.axis``."""
    order = words[-1].lower() if words else ""
    if sorted(order) != ["x", "y", "z"]:
        reason = f"expected an axis of three angles and their order, such as XYZ, not {quoted(' '.join(words))}"
        raise FormatError(path, reason, line)
    x, y, z = _triple(path, line, words[:-1])
    if order == "xyz":
        return x * factor, y * factor, z * factor
    frame = euler_to_rotmat(np.radians(np.array([z, y, x]) * factor), order[::-1])
    z, y, x = np.degrees(rotmat_to_euler(frame, "zyx")).tolist()
    return x, y, z


def _dofs(path: Path, line: int, words: list[str], known: tuple[str, ...]) -> tuple[str, ...]:
    dofs = tuple(word.lower() for word in words)
    unknown = [word for word in dofs if word not in known]
    if unknown or len(set(dofs)) < len(dofs):
        reason = f"degrees of freedom {quoted(' '.join(words))}: expected each of {' '.join(known)} at most once"
        raise FormatError(path, reason, line)
    return dofs


def _hang_children(path: Path, lines: Lines, bones: dict[str, _Bone]) -> None:
    hung = {ASF_ROOT}
    for line, words in lines:
        if len(words) == 1 and words[0].lower() in ("begin", "end"):
            continue
        for name in words:
            if name not in bones:
                raise FormatError(path, f"the hierarchy names bone {quoted(name)}, which is not in :bonedata", line)
        for child in words[1:]:
            if child in hung:
                raise FormatError(path, f"bone {quoted(child)} has two parents", line)
            hung.add(child)
            bones[words[0]].children.append(child)


def _joints(bones: dict[str, _Bone], position: Triple) -> list[Joint]:
    """The joints in the hierarchy's order, depth first."""
    joints: list[Joint] = []
    waiting = [(ASF_ROOT, -1, position)]
    while waiting:
        name, parent, offset = waiting.pop()
        bone = bones[name]
        turns = "".join(dof[1] for dof in reversed(bone.dofs) if dof[0] == "r")
        joints.append(Joint(name, parent, offset, complete_order(turns), bone.axis))
        here = len(joints) - 1
        waiting.extend((child, here, bone.reach) for child in reversed(bone.children))
        if not bone.children and any(bone.reach):
            joints.append(Joint(name + END_SUFFIX, here, bone.reach))
    return joints


def write_skeleton(path: str | Path, asf: Asf) -> None:
    """Write an ASF file, angles in degrees; OutputError if it cannot be written.

    The root must be called "root" and names must have no blanks. If the children of a joint start at different places,
    each gets a bone ``NAME_base`` without channels leading to it.
    """
    root, *bones = _bones(asf)
    length = CMU_LENGTH if asf.skeleton.metres_per_unit == CMU_METRES else 1.0
    lines = [":version 1.10", ":name motet", ":units", "  mass 1.0", f"  length {length}", "  angle deg", ":root"]
    lines += [f"  order {' '.join(root.dofs).upper()}", f"  axis {root.order}"]
    lines += [f"  position {_text(root.reach)}", f"  orientation {_text(root.axis)}", ":bonedata"]
    for number, bone in enumerate(bones, start=1):
        length = float(np.linalg.norm(bone.reach))
        direction = [value / length for value in bone.reach] if length else (0.0, 1.0, 0.0)
        lines += ["  begin", f"    id {number}", f"    name {bone.name}", f"    direction {_text(direction)}"]
        lines += [f"    length {length!r}", f"    axis {_text(bone.axis)} {bone.order}"]
        lines += [f"    dof {' '.join(bone.dofs)}", "  end"] if bone.dofs else ["  end"]
    lines += [":hierarchy", "  begin"]
    lines += [f"    {' '.join([bone.name, *bone.children])}" for bone in (root, *bones) if bone.children]
    write_whole(path, "\n".join([*lines, "  end", ""]))


def _bones(asf: Asf) -> list[_Bone]:
    """The root, with the position in place of its reach, and all bones that the skeleton needs."""
    bones: dict[str, _Bone] = {}
    joints, tips, names = asf.skeleton.joints, _tips(asf), Names(asf.skeleton.names)
    for joint, children in zip(joints, asf.skeleton.children, strict=True):
        if joint.name in tips:
            continue
        order, axis = _axis_of(joint)
        bone = _Bone(joint.name, (0.0, 0.0, 0.0), axis, asf.dofs.get(joint.name, ()), [], order)
        bones[joint.name] = bone
        offsets = {joints[child].offset for child in children}
        if joint.parent == -1:
            bone.reach = joint.offset
        elif len(offsets) == 1:
            bone.reach = offsets.pop()
        for child in (joints[i] for i in children if joints[i].name not in tips):
            name = child.name
            if any(child.offset) if joint.parent == -1 else child.offset != bone.reach:
                name = names.unique(f"{child.name}_base")
                bones[name] = _Bone(name, child.offset, children=[child.name])
            bone.children.append(name)
    return list(bones.values())


def _tips(asf: Asf) -> set[str]:
    """The joints that need no bone, because the reader adds them to the last bones."""
    joints = asf.skeleton.joints
    return {
        joints[children[0]].name
        for joint, children in zip(joints, asf.skeleton.children, strict=True)
        if joint.parent != -1
        and [joints[child].name for child in children] == [joint.name + END_SUFFIX]
        and not asf.skeleton.children[children[0]]
        and joints[children[0]].name not in asf.dofs
        and any(joints[children[0]].offset)
    }


def _axis_of(joint: Joint) -> tuple[str, Triple]:
    """The joint's axis in the order of its own rotation: some readers take one for the other."""
    if joint.order == "zyx" or not any(joint.axis):
        return joint.order[::-1].upper(), joint.axis
    a, b, c = np.degrees(rotmat_to_euler(joint.frame, joint.order)).tolist()
    return joint.order[::-1].upper(), (c, b, a)


def _text(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)
