"""BVH: skeleton and motion in one text file (Biovision). Angles are degrees; lengths have no stated unit.

The reader takes what programs write: rotations in any order and before or after the position, one axis or none,
six channels on any joint (the position then takes the place of OFFSET, as it does for the root), names with blanks
or colons, equal names (the second "Hand" becomes "Hand_2"), braces anywhere, every line ending. An "End Site"
becomes a joint ``PARENT_end``. The writer writes what every reader takes.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path

import numpy as np

from motet.errors import FormatError
from motet.files import check_place, write_whole
from motet.formats.lines import complete_order, numbers, plain_names, read_text, unique_name
from motet.formats.writable import with_names, with_still_offsets
from motet.motion.kinematics import local_rotations, local_translations, skeleton_of
from motet.motion.motion import TURN, Motion
from motet.motion.rotations import Array, rotmats_to_euler
from motet.motion.skeleton import END_SUFFIX, Joint, Skeleton

ORDER = "zyx"
POSITION, ROTATION = "Xposition Yposition Zposition", "Zrotation Yrotation Xrotation"
FORBIDDEN = r"[^\w.-]"
"""What the writer keeps out of names: readers stumble over blanks and colons."""


def read(path: str | Path, partial: bool = False) -> Motion:
    """Read a BVH file: channels in the file's order, units "deg" and "length".

    A frame time that is a whole number of frames per second as far as its digits tell is read as that rate:
    0.0083333 is 120 fps.
    partial: take the whole frames of a file that breaks off or declares another number, which is refused otherwise.
    FormatError names file and line.
    """
    path = Path(path)
    lines = read_text(path).split("\n")
    nodes, motion_line = _hierarchy(path, lines)
    start, declared, fps = _motion_header(path, lines, motion_line)
    channels = [f"{node.name}.{kind}" for node in nodes for kind in node.channels]
    kept = _without_broken_end(lines, start, len(channels)) if partial else lines
    values = _values(path, kept, start, len(channels)) if channels else np.zeros((declared, 0))
    if len(values) != declared and not partial:
        reason = f"the file declares {declared} frames and holds {len(values)}: correct the line 'Frames:'"
        raise FormatError(path, f"{reason}, or read it as partial", start)
    units = tuple("deg" if name[-2] == "r" else "length" for name in channels)
    return Motion(values, tuple(channels), units, fps, Skeleton(tuple(_joint(node) for node in nodes)))


@dataclass
class _Node:
    name: str
    parent: int
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    channels: tuple[str, ...] = ()


def _joint(node: _Node) -> Joint:
    turns = "".join(kind[1] for kind in node.channels if kind[0] == "r")
    return Joint(node.name, node.parent, node.offset, complete_order(turns))


def _hierarchy(path: Path, lines: list[str]) -> tuple[list[_Node], int]:
    """The joints, and the number of the line MOTION behind them."""
    nodes: list[_Node] = []
    open_nodes: list[int] = []
    declared = False  # a joint has been named and its brace must come now
    for line, statement in _statements(lines):
        keyword, _, rest = statement.replace("\t", " ").partition(" ")
        match keyword.lower():
            case "root" | "joint" | "end" as kind:
                if declared or bool(open_nodes) == (kind == "root") or (nodes and not open_nodes):
                    raise FormatError(
                        path, f"{statement!r} does not belong here: a file holds one tree of joints", line
                    )
                nodes.append(_Node(_name(kind, rest.strip(), nodes, open_nodes), open_nodes[-1] if open_nodes else -1))
            case "{" if declared:
                open_nodes.append(len(nodes) - 1)
            case "}" if open_nodes and not declared:
                open_nodes.pop()
            case "offset" if open_nodes and not declared:
                nodes[open_nodes[-1]].offset = _offset(path, rest.split(), line)
            case "channels" if open_nodes and not declared:
                nodes[open_nodes[-1]].channels = _channels(path, rest.split(), line)
            case "motion" if nodes and not open_nodes and not declared:
                return nodes, line
            case "hierarchy" if not nodes:
                pass
            case _:
                raise FormatError(path, f"{statement!r} does not belong here", line)
        declared = keyword.lower() in ("root", "joint", "end")
    raise FormatError(path, "this is no whole BVH file: the line MOTION is missing")


def _statements(lines: list[str]) -> Iterator[tuple[int, str]]:
    for line, text in enumerate(lines, start=1):
        for piece in re.split("([{}])", text):
            if piece.strip():
                yield line, piece.strip()


def _name(kind: str, name: str, nodes: list[_Node], open_nodes: list[int]) -> str:
    wanted = nodes[open_nodes[-1]].name + END_SUFFIX if kind == "end" else name or "joint"
    return unique_name(wanted, [node.name for node in nodes])


def _offset(path: Path, words: list[str], line: int) -> tuple[float, float, float]:
    values = numbers(words, path, line)
    if len(values) != 3:
        raise FormatError(path, f"OFFSET needs three numbers, not {len(values)}", line)
    return values[0], values[1], values[2]


def _channels(path: Path, words: list[str], line: int) -> tuple[str, ...]:
    kinds = [re.fullmatch("([xyz])(position|rotation)", word.lower()) for word in words[1:]]
    channels = tuple(("t" if kind[2] == "position" else "r") + kind[1] for kind in kinds if kind)
    if len(channels) < len(kinds):
        unknown = next(word for word, kind in zip(words[1:], kinds, strict=True) if not kind)
        raise FormatError(
            path, f"channel {unknown!r}: known are Xposition ... Zposition, Xrotation ... Zrotation", line
        )
    if words[:1] != [str(len(channels))] or len(set(channels)) < len(channels):
        raise FormatError(path, f"CHANNELS is a number and as many different channels, not {' '.join(words)!r}", line)
    return channels


def _motion_header(path: Path, lines: list[str], motion_line: int) -> tuple[int, int, float]:
    """The number of lines before the first frame, the declared number of frames and the frame rate."""
    frames, time = None, None
    for line, text in enumerate(lines[motion_line:], start=motion_line + 1):
        found = re.fullmatch(r"\s*(frames|frame\s+time)\s*:\s*(\S+)\s*", text, re.IGNORECASE)
        if found and found[1].lower() == "frames" and found[2].isdigit():
            frames = int(found[2])
        elif found and found[1].lower() != "frames":
            time = _fps(path, found[2], line)
        elif text.strip():
            raise FormatError(path, f"{text.strip()!r} where 'Frames: N' and 'Frame Time: SECONDS' should be", line)
        if frames is not None and time is not None:
            return line, frames, time
    raise FormatError(path, "the file ends before 'Frames:' and 'Frame Time:'", len(lines))


def _fps(path: Path, word: str, line: int) -> float:
    seconds = numbers([word], path, line)[0]
    if not 0 < seconds < np.inf:
        raise FormatError(path, f"a frame cannot take {word} seconds", line)
    last_digit = 10.0 ** int(Decimal(word).as_tuple().exponent)
    whole = max(1, round(1 / seconds))
    return whole if abs(1 / whole - seconds) <= 0.51 * last_digit else 1 / seconds


def _without_broken_end(lines: list[str], start: int, width: int) -> list[str]:
    """The lines without a last frame of which values are missing."""
    last = max((n for n in range(start, len(lines)) if lines[n].strip()), default=start)
    whole = last < len(lines) and len(lines[last].split()) == width
    return lines if whole else lines[:last]


def _values(path: Path, lines: list[str], start: int, width: int) -> Array:
    """The frames (T, width) behind the header, one to a line or not; FormatError where one breaks off."""
    text = "\n".join(lines[start:])
    words = text.split()
    try:
        values = np.fromiter(map(float, words), np.float64, len(words))
        if len(words) % width == 0 and "_" not in text and np.isfinite(values).all():
            return values.reshape(-1, width)
    except ValueError:
        pass
    found = [
        (line, numbers(content.split(), path, line)) for line, content in enumerate(lines[start:], start=start + 1)
    ]
    line, short = next((line, row) for line, row in found if len(row) not in (0, width))
    raise FormatError(path, f"the frame breaks off: a frame has {width} values, this line {len(short)}", line)


def write(path: str | Path, motion: Motion) -> None:
    """Write a BVH file that every reader accepts; OutputError if it cannot be written.

    The root's OFFSET is 0 and the root alone has six channels; all rotations are Z Y X in degrees; names are plain
    and different; every last joint has an End Site. Angles in that order come through without loss, others to
    1e-9 degrees. A joint that really moves within its parent's frame gets six channels too, rather than lose that.
    A motion without translation of the root stays at the skeleton's origin.
    FormatError for channels other than Euler angles and translations; MotionError for a motion without skeleton.
    """
    path = check_place(path)
    motion, moving = with_still_offsets(path, motion)
    names = plain_names(skeleton_of(motion).names, FORBIDDEN)
    translated = {names[0], *(names[skeleton_of(motion).index(name)] for name in moving)}
    motion = with_names(motion, names)
    joints = _jointed(motion)
    lines = ["HIERARCHY", *_tree(skeleton_of(motion), 0, joints, translated), "MOTION"]
    lines += [f"Frames: {len(motion)}", f"Frame Time: {1 / motion.fps!r}"]
    lines += [" ".join(map(repr, row)) for row in _rows(motion, joints, translated).tolist()]
    write_whole(path, "\n".join([*lines, ""]))


def _jointed(motion: Motion) -> list[int]:
    """The joints that are written as such, in the file's order; the others are the End Sites."""
    skeleton = skeleton_of(motion)
    moved = {channel.rpartition(".")[0] for channel in motion.channels}
    order, waiting = [], [0]
    while waiting:
        i = waiting.pop()
        joint = skeleton.joints[i]
        alone = joint.parent != -1 and skeleton.children[joint.parent] == (i,)
        if not (alone and joint.name.endswith(END_SUFFIX) and not skeleton.children[i] and joint.name not in moved):
            order.append(i)
        waiting.extend(reversed(skeleton.children[i]))
    return order


def _tree(skeleton: Skeleton, i: int, joints: list[int], translated: set[str], indent: str = "") -> list[str]:
    joint = skeleton.joints[i]
    keyword, offset = ("JOINT", joint.offset) if i else ("ROOT", (0.0, 0.0, 0.0))
    channels = f"CHANNELS 6 {POSITION} {ROTATION}" if joint.name in translated else f"CHANNELS 3 {ROTATION}"
    lines = [f"{keyword} {joint.name}", "{", f"\tOFFSET {_text(offset)}", f"\t{channels}"]
    for child in skeleton.children[i]:
        if child in joints:
            lines += _tree(skeleton, child, joints, translated, "\t")
    if not any(child in joints for child in skeleton.children[i]):
        tip = skeleton.joints[skeleton.children[i][0]].offset if skeleton.children[i] else (0.0, 0.0, 0.0)
        lines += ["\tEnd Site", "\t{", f"\t\tOFFSET {_text(tip)}", "\t}"]
    return [indent + line for line in [*lines, "}"]]


def _text(values: tuple[float, float, float]) -> str:
    return " ".join(repr(float(value)) for value in values)


def _rows(motion: Motion, joints: list[int], translated: set[str]) -> Array:
    """The file's values (T, D)."""
    skeleton = skeleton_of(motion)
    translations, angles = local_translations(motion), _zyx_degrees(motion)
    blocks = []
    for i in joints:
        blocks += [translations[:, i]] if skeleton.joints[i].name in translated else []
        blocks.append(angles[:, i])
    return np.concatenate(blocks, axis=1)


def _zyx_degrees(motion: Motion) -> Array:
    """Angles (T, J, 3) about z, y, x in degrees, as they are where they are of this kind already."""
    skeleton = skeleton_of(motion)
    converted = rotmats_to_euler(local_rotations(motion), ORDER)
    angles: Array = np.round(np.degrees(converted), 9).astype(np.float64)
    kept = [i for i, joint in enumerate(skeleton.joints) if joint.order == ORDER and not any(joint.axis)]
    angles[:, kept] = 0.0
    for joint, columns in motion.rotation_columns().items():
        if skeleton.index(joint) in kept:
            for column in columns:
                factor = TURN["deg"] / TURN[motion.units[column]]
                place = ORDER.index(motion.channels[column][-1])
                angles[:, skeleton.index(joint), place] = motion.values[:, column] * factor
    return angles
