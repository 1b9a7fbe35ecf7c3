"""ASF, the skeleton file beside AMC motion (Acclaim).

A bone turns about its start and carries its children at its end, so a bone's ``direction * length`` is the offset of
its child joints, and a last bone gets a joint ``NAME_end``. The words of ``dof`` and of the root's ``order`` name a
bone's channels, first applied first: ``rx ry rz`` is R = Rz Ry Rx, and so is ``axis ... XYZ``. The root's
``orientation`` is read as its axis, its ``position`` as its offset.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from motet.errors import quoted
from motet.files import File
from motet.formats.text import (
    NOWHERE,
    ContentError,
    UniqueNames,
    complete_order,
    names_file,
    number,
    read_text,
    spaced,
    triple,
)
from motet.motion.rotations import euler_to_rotmat, rotmat_to_euler
from motet.motion.skeleton import END_SUFFIX, Joint, Names, Skeleton, Triple

CMU_METRES = 0.0254 / 0.45
"""CMU writes ``length 0.45`` for lengths in inches times 0.45. Other values have no known meaning."""

Dofs = Mapping[str, Names]
"""Of each joint with channels their names, such as "rx"."""

Line = tuple[int, list[str]]
"""The number of a line, and its words."""

Lines = list[Line]


@dataclass(frozen=True)
class Asf:
    """A skeleton; the channel names ("rx", "tx", ...) of every joint that has any; the angle unit, deg or rad.

    Shared between files of the same skeleton: do not modify.
    """

    skeleton: Skeleton
    dofs: Dofs
    angle: str


@dataclass
class _Bone:
    name: str
    reach: Triple = NOWHERE
    axis: Triple = NOWHERE
    dofs: Names = ()
    children: list[str] = field(default_factory=list)
    order: str = "XYZ"


@names_file
def read_skeleton(path: File) -> Asf:
    """Read an ASF file, without limits and masses.

    FormatError with file and line if it is not one, a bone has no direction, length or axis, or the hierarchy omits
    one.
    """
    return _skeleton(read_text(path))


@lru_cache(maxsize=16)
def _skeleton(text: str) -> Asf:
    """A folder mostly holds motions of a few people: each skeleton is parsed once."""
    # the units, which the rest is in
    sections = _sections(text)
    units = _units(sections.get("units", []))
    angle = units["angle"].lower()[:3]
    if angle not in ("deg", "rad"):
        raise ContentError(f"angles in {quoted(units['angle'])}: expected deg or rad")
    # bones, then the tree of joints that they span
    bones = _read_bones(sections, 1.0 if angle == "deg" else 180 / np.pi)
    joints = _joints(bones)
    if lost := bones.keys() - {joint.name for joint in joints}:
        raise ContentError(f"the hierarchy does not reach bone {quoted(min(lost))}")
    dofs = {bone.name: bone.dofs for bone in bones.values() if bone.dofs}
    skeleton = Skeleton(tuple(joints), CMU_METRES if units["length"] == "0.45" else None)
    return Asf(skeleton, dofs, angle)


def _units(lines: Lines) -> dict[str, str]:
    """The units by quantity, of angles degrees if the file does not say."""
    units = {"angle": "deg", "length": ""}
    for _, words in lines:
        if len(words) > 1:
            units[words[0].lower()] = words[1]
    return units


def _sections(text: str) -> dict[str, Lines]:
    """The lines of each section by its keyword; FormatError where a required one is missing."""
    sections: dict[str, Lines] = {"": []}
    section = sections[""]
    for line, words in words_of(text.split("\n")):
        if words[0].startswith(":"):
            section = sections.setdefault(words[0][1:].lower(), [])
        else:
            section.append((line, words))
    if "root" not in sections or "hierarchy" not in sections:
        raise ContentError("an ASF file needs the sections :root, :bonedata and :hierarchy")
    return sections


def _read_bones(sections: Mapping[str, Lines], factor: float) -> dict[str, _Bone]:
    """All bones with their children, by name. factor: degrees in the file's unit of angles."""
    # bones in the order of the file, and then the hierarchy, which names them
    bones = {"root": _root(sections["root"], factor)}
    for begin, block in _blocks(sections.get("bonedata", [])):
        bone = _bone(begin, block, factor)
        if not bone.name or bone.name in bones:
            raise ContentError(f"bone names must be unique and not empty, not {quoted(bone.name)}", begin)
        bones[bone.name] = bone
    _hang_children(sections["hierarchy"], bones)
    return bones


def _blocks(lines: Lines) -> Iterator[tuple[int, Lines]]:
    """The lines between each ``begin`` and ``end``, with the line of ``begin``."""
    start = 0
    block: Lines = []
    for line, words in lines:
        word = words[0].lower()
        if word in ("begin", "end") and (word == "begin") == bool(start):
            raise ContentError(f"{word!r} where {'a bone' if start else 'no bone'} has begun", line)
        if word == "begin":
            start = line
            block = []
        elif word == "end":
            yield start, block
            start = 0
        else:
            block.append((line, words))
    if start:
        raise ContentError("a bone without 'end'", start)


def _root(lines: Lines, factor: float) -> _Bone:
    """The root, with its position in place of its reach."""
    # of the lines that may be absent, these are the defaults
    entries = {"position": (0, ["", "0", "0", "0"]), "axis": (0, ["XYZ"]), "order": (0, [""])}
    entries["orientation"] = entries["position"]
    entries |= _entries(lines)
    line, position = entries["position"]
    reach = triple(position[1:], line)
    line, angles = entries["orientation"]
    _, axis_order = entries["axis"]
    axis = _axis(line, [*angles, axis_order[-1]], factor)
    line, order = entries["order"]
    dofs = _dofs(line, order, known=("tx", "ty", "tz", "rx", "ry", "rz"))
    return _Bone("root", reach, axis, dofs)


def _entries(lines: Lines) -> dict[str, Line]:
    """The number and the words of each line by its keyword, which is the first of them."""
    return {words[0].lower(): (line, words) for line, words in lines}


def _bone(begin: int, lines: Lines, factor: float) -> _Bone:
    entries = {"dof": (0, [""]), "name": (0, [""])} | _entries(lines)
    if missing := [word for word in ("direction", "length", "axis") if word not in entries]:
        raise ContentError(f"this bone has no {' or '.join(missing)}", begin)
    # the offset of its child is its direction times its length
    line, length_words = entries["length"]
    length = number((*length_words, "")[1], line)
    line, direction = entries["direction"]
    reach = [repr(value * length) for value in triple(direction[1:], line)]
    # its degrees of freedom, its name, and the axis that they turn about
    line, dof_words = entries["dof"]
    dofs = _dofs(line, dof_words, known=("rx", "ry", "rz"))
    _, name_words = entries["name"]
    line, axis_words = entries["axis"]
    axis = _axis(line, axis_words, factor)
    return _Bone(name_words[-1], triple(reach, begin), axis, dofs)


def _axis(line: int, words: list[str], factor: float) -> Triple:
    """Angles in the order of the letters that follow them, as angles about x, y, z of ``Joint.axis``."""
    order = words[-1].lower()
    if sorted(order) != ["x", "y", "z"]:
        reason = f"expected an axis of three angles and their order, such as XYZ, not {quoted(' '.join(words[1:]))}"
        raise ContentError(reason, line)
    x, y, z = triple(words[1:-1], line)
    if order == "xyz":
        return x * factor, y * factor, z * factor
    # the first letter turns first, so it is the last of the product
    frame = euler_to_rotmat(np.radians(np.array([z, y, x]) * factor), order[::-1])
    z, y, x = np.degrees(rotmat_to_euler(frame, "zyx")).tolist()
    return x, y, z


def _dofs(line: int, words: list[str], known: Names) -> Names:
    dofs = tuple(word.lower() for word in words[1:])
    if not set(dofs) <= set(known) or len(set(dofs)) < len(dofs):
        reason = f"degrees of freedom {quoted(' '.join(words[1:]))}: expected each of {' '.join(known)} at most once"
        raise ContentError(reason, line)
    return dofs


def _hang_children(lines: Lines, bones: dict[str, _Bone]) -> None:
    hung = {"root"}
    for line, words in lines:
        if len(words) == 1 and words[0].lower() in ("begin", "end"):
            continue
        if unknown := [name for name in words if name not in bones]:
            reason = f"the hierarchy names bone {quoted(unknown[0])}, which is not in :bonedata"
            raise ContentError(reason, line)
        for child in words[1:]:
            if child in hung:
                raise ContentError(f"bone {quoted(child)} has two parents", line)
            hung.add(child)
            bones[words[0]].children.append(child)


def _joints(bones: dict[str, _Bone]) -> list[Joint]:
    """The joints in the hierarchy's order, depth first."""
    joints: list[Joint] = []
    waiting = [("root", -1, bones["root"].reach)]
    while waiting:
        name, parent, offset = waiting.pop()
        bone = bones[name]
        here = len(joints)
        # the first angle is applied first, so it is the last letter of the order
        turns = "".join(dof[1] for dof in reversed(bone.dofs) if dof[0] == "r")
        joints.append(Joint(name, parent, offset, complete_order(turns), bone.axis))
        # the root's reach is where it is, not where its children start
        reach = bone.reach if parent >= 0 else NOWHERE
        waiting.extend((child, here, reach) for child in reversed(bone.children))
        if not bone.children and any(reach):
            joints.append(Joint(name + END_SUFFIX, here, reach))
    return joints


def words_of(lines: list[str], header: int = 0) -> Iterator[Line]:
    """Every non-empty line after the header: its number, and its words without a comment."""
    for line in range(header, len(lines)):
        if words := lines[line].partition("#")[0].split():
            yield line + 1, words


def asf_text(asf: Asf) -> str:
    """An ASF file, angles in degrees. The root must be called "root" and names must have no blanks."""
    root, *bones = _bones(asf)
    # one unit of length has a name in this format: CMU's
    unit = 0.45 if asf.skeleton.metres_per_unit == CMU_METRES else 1.0
    bone_data = "".join(_bone_text(bone, i) for i, bone in enumerate(bones, start=1))
    hierarchy = ""
    for bone in (root, *bones):
        if bone.children:
            hierarchy += f"    {' '.join([bone.name, *bone.children])}\n"
    return f"""\
:version 1.10
:name motet
:units
  mass 1.0
  length {unit}
  angle deg
:root
  order {" ".join(root.dofs).upper()}
  axis {root.order}
  position {spaced(root.reach)}
  orientation {spaced(root.axis)}
:bonedata
{bone_data}:hierarchy
  begin
{hierarchy}  end
"""


def _bone_text(bone: _Bone, number: int) -> str:
    """The lines of a bone in :bonedata."""
    # a bone of length 0 still needs a direction
    length = float(np.linalg.norm(bone.reach))
    direction = [value / length for value in bone.reach] if length else (0.0, 1.0, 0.0)
    dofs = f"    dof {' '.join(bone.dofs)}\n" if bone.dofs else ""
    return f"""\
  begin
    id {number}
    name {bone.name}
    direction {spaced(direction)}
    length {length!r}
    axis {spaced(bone.axis)} {bone.order}
{dofs}  end
"""


def _bones(asf: Asf) -> list[_Bone]:
    """The root, with the position in place of its reach, and all bones that the skeleton needs."""
    bones = {}
    joints = asf.skeleton.joints
    names = UniqueNames(asf.skeleton.names)
    tips = _tips(asf)
    for i, joint in enumerate(joints):
        if i in tips:
            continue
        bone = _bone_at(joint, asf.dofs.get(joint.name, ()))
        bones[joint.name] = bone
        # a bone ends where its children start, if that is one place; the root has no length, but a position
        children = asf.skeleton.children[i]
        starts = {joints[child].offset for child in children}
        end = NOWHERE
        if joint.parent == -1:
            bone.reach = joint.offset
        elif len(starts) == 1:
            end = bone.reach = starts.pop()
        for base in _add_children(bone, end, [joints[at] for at in children if at not in tips], names):
            bones[base.name] = base
    return list(bones.values())


def _add_children(bone: _Bone, end: Triple, children: list[Joint], names: UniqueNames) -> list[_Bone]:
    """Add the children of a bone with this end; those that start elsewhere hang on bones without channels that lead
    there, which are returned."""
    bases = []
    for child in children:
        name = child.name
        if child.offset != end:
            name = names.unique(f"{child.name}_base")
            bases.append(_Bone(name, child.offset, children=[child.name]))
        bone.children.append(name)
    return bases


def _bone_at(joint: Joint, dofs: Names) -> _Bone:
    """The bone of a joint, without reach and children."""
    axis = joint.axis
    # in the order of the joint's own rotation: some readers take one for the other
    if joint.order != "zyx" and any(axis):
        c, b, a = np.degrees(rotmat_to_euler(joint.frame, joint.order)).tolist()
        axis = (a, b, c)
    return _Bone(joint.name, NOWHERE, axis, dofs, [], joint.order[::-1].upper())


def _tips(asf: Asf) -> set[int]:
    """The joints that need no bone, because the reader adds them to the last bone."""
    joints = asf.skeleton.joints
    tips = set()
    for i, joint in enumerate(joints[1:], start=1):
        parent = joints[joint.parent]
        is_alone = asf.skeleton.children[joint.parent] == (i,) and not asf.skeleton.children[i]
        is_named = joint.name == parent.name + END_SUFFIX and joint.name not in asf.dofs
        if parent.parent != -1 and is_alone and is_named and any(joint.offset):
            tips.add(i)
    return tips
