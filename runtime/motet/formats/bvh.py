"""BVH: skeleton and motion in one text file (Biovision). Angles are degrees; lengths have no stated unit.

The reader accepts the variants in use: rotations in any order and before or after the position, one axis or none, six
channels on any joint (the position then replaces OFFSET, as for the root), names with blanks or colons, duplicate names
(the second "Hand" becomes "Hand_2"), braces anywhere, every line ending. An "End Site" becomes a joint ``PARENT_end``.
The writer sticks to what every reader accepts.
"""

import logging
import re
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from typing import NamedTuple

import numpy as np

from motet.errors import MotionError, quoted
from motet.files import File, place_of, write_whole
from motet.formats import text
from motet.motion.kinematics import local_rotations, local_translations, skeleton_of
from motet.motion.motion import TURN, Motion
from motet.motion.rotations import Array, rotmats_to_euler
from motet.motion.skeleton import END_SUFFIX, Joint, Names, Skeleton, Triple

log = logging.getLogger(__name__)

CHANNEL_NAMES = {f"{axis}position": f"t{axis}" for axis in "xyz"} | {f"{axis}rotation": f"r{axis}" for axis in "xyz"}
"""Channels in small letters -> their names in a motion."""


@text.names_file
def read(file: File, partial: bool = False, figure: text.Figure = None) -> Motion:
    """Read a BVH file: channels in the file's order, units "deg" and "length".

    A frame time is read as a whole number of frames per second if its digits allow only one: 0.0083333 is 120 fps,
    but 0.03, which could mean 29 to 40, is 33.33.
    partial: read the complete frames of a file that is truncated or holds fewer than it declares instead of refusing
        it. If it holds more, all are read, with a warning in the log.
    figure: one of several ROOTs, by its name or its number from 1; by default the first, with a warning in the log.
    FormatError names file and line.
    """
    path = place_of(file)
    lines = text.read_text(file).split("\n")
    # the skeletons, each from a ROOT
    figures, motion_line = _hierarchy(lines)
    number = text.chosen(path, _figure_names(figures), figure, "figure")
    # the number of frames and their rate
    header = _motion_header(lines, motion_line)
    # a line holds the channels of all figures, one after the other
    widths = [len(_channel_names(nodes)) for nodes in figures]
    frames = _frames(lines, header, sum(widths), partial)
    _check_count(path, len(frames), header, partial)
    first_column = sum(widths[:number])
    values = frames[:, first_column : first_column + widths[number]]
    return _motion(figures[number], values, header.fps)


def _motion(nodes: "list[_Node]", values: Array, fps: float) -> Motion:
    """The motion of one figure with the values (T, D) of its channels."""
    channels = _channel_names(nodes)
    joints = tuple(_joint(node) for node in nodes)
    return Motion(values, channels, text.units_of(channels, "deg"), fps, Skeleton(joints))


def _channel_names(nodes: "list[_Node]") -> Names:
    """The channels of a figure, such as "Hips.tx", in the order of the file."""
    channels = []
    for node in nodes:
        channels += [f"{node.name}.{kind}" for kind in node.channels]
    return tuple(channels)


def _frames(lines: list[str], header: "_Header", width: int, partial: bool) -> Array:
    """The values (T, width) of all frames; FormatError where they are not those that the file declares."""
    if not width:
        # without channels nothing else confirms the number
        if header.frames > 10**7:
            reason = f"the file declares {header.frames} frames and has no channels"
            raise text.ContentError(reason, header.line)
        return np.zeros((header.frames, 0))
    if partial:
        lines = _complete_lines(lines, header.line, width)
    return _values(lines, header.line, width)


def _complete_lines(lines: list[str], start: int, width: int) -> list[str]:
    """The lines without a last frame that has not all of its values."""
    # blank lines at the end do not count
    last = len(lines) - 1
    while last > start and not lines[last].strip():
        last -= 1
    is_cut = len(lines) > last and len(lines[last].split()) != width
    return lines[:last] if is_cut else lines


def _check_count(path: Path, held: int, header: "_Header", partial: bool) -> None:
    """FormatError where fewer frames are held than declared, unless ``partial``; other differences are logged."""
    declared = header.frames
    if held > declared:
        log.warning("%s: it declares %d frames but holds %d: read them all", path, declared, held)
    elif held < declared and partial:
        log.info("%s: read %d of the declared %d frames", path, held, declared)
    elif held < declared:
        reason = f"the file declares {declared} frames but holds {held}: correct the line 'Frames:'"
        raise text.ContentError(f"{reason}, or read it with partial=True (--partial)", header.line)


@text.names_file
def contents(file: File) -> text.Contents:
    """The ROOTs; FormatError like :func:`read` for what precedes the line MOTION."""
    figures, _ = _hierarchy(text.read_text(file).split("\n"))
    return text.Contents((), dict.fromkeys(_figure_names(figures), ()))


def _figure_names(figures: "list[list[_Node]]") -> Names:
    return text.part_names((nodes[0].name for nodes in figures), "figure")


@dataclass
class _Node:
    name: str
    parent: int
    line: int
    offset: Triple | None = None
    channels: Names = ()


def _joint(node: _Node) -> Joint:
    if node.offset is None:
        raise text.ContentError(f"joint {quoted(node.name)} has no OFFSET", node.line)
    turns = "".join(kind[1] for kind in node.channels if kind[0] == "r")
    return Joint(node.name, node.parent, node.offset, text.complete_order(turns))


def _hierarchy(lines: list[str]) -> tuple[list[list[_Node]], int]:
    """The joints of each ROOT, and the number of the line MOTION after them."""
    hierarchy = _Hierarchy()
    for line, content in enumerate(lines, 1):
        # braces may stand beside other statements: each becomes a piece of its own
        for piece in content.replace("{", "\n{\n").replace("}", "\n}\n").split("\n"):
            if not (statement := piece.strip()):
                continue
            if hierarchy.is_complete() and statement.lower().split()[0] == "motion":
                return hierarchy.figures, line
            hierarchy.take(statement, line)
    raise text.ContentError("not a BVH file, or truncated: the line MOTION is missing")


class _Hierarchy:
    """The joints of the statements that were taken, one after the other.

    figures: the joints of each ROOT. open_nodes: of the last one, those whose brace is open. is_declared: whether a
    joint has been named and its brace must follow.
    """

    def __init__(self) -> None:
        self.figures: list[list[_Node]] = []
        self.open_nodes: list[int] = []
        self.is_declared = False
        self.names = text.UniqueNames()

    def is_complete(self) -> bool:
        """Whether the line MOTION may follow."""
        return bool(self.figures) and not self.open_nodes and not self.is_declared

    def take(self, statement: str, line: int) -> None:
        """Take a statement or brace; FormatError if it does not belong here."""
        keyword, _, rest = statement.replace("\t", " ").partition(" ")
        # each keyword where it may stand; a brace opens the node that was declared last
        match keyword.lower():
            case "root" | "joint" | "end" as kind:
                self._add(kind, rest.strip(), statement, line)
                return
            case "{" if self.is_declared:
                self.open_nodes.append(len(self.figures[-1]) - 1)
            case "}" if self.open_nodes and not self.is_declared:
                self.open_nodes.pop()
            case "offset" if self.open_nodes and not self.is_declared:
                self._open_node().offset = text.triple(rest.split(), line)
            case "channels" if self.open_nodes and not self.is_declared:
                self._open_node().channels = _channels(rest.split(), line)
            case "hierarchy" if not self.figures:
                pass
            case _:
                raise text.ContentError(f"{quoted(statement)} does not belong here", line)
        self.is_declared = False

    def _open_node(self) -> _Node:
        return self.figures[-1][self.open_nodes[-1]]

    def _add(self, kind: str, name: str, statement: str, line: int) -> None:
        """Add a joint, or the end of one."""
        if self.is_declared or bool(self.open_nodes) == (kind == "root"):
            reason = f"{quoted(statement)} does not belong here: expected trees of joints"
            raise text.ContentError(reason, line)
        # a ROOT begins another figure, whose names are its own
        if kind == "root":
            self.figures.append([])
            self.names = text.UniqueNames()
        parent = self.open_nodes[-1] if self.open_nodes else -1
        if kind == "end":
            name = self._open_node().name + END_SUFFIX
        self.figures[-1].append(_Node(self.names.unique(name or "joint"), parent, line))
        self.is_declared = True


def _channels(words: list[str], line: int) -> Names:
    """The channels after their count, as "tx" ... "rz"; FormatError for others, or another count."""
    channels = []
    for word in words[1:]:
        if word.lower() not in CHANNEL_NAMES:
            expected = "expected one of Xposition ... Zposition, Xrotation ... Zrotation"
            raise text.ContentError(f"channel {quoted(word)}: {expected}", line)
        channels.append(CHANNEL_NAMES[word.lower()])
    if words[:1] != [str(len(channels))] or len(set(channels)) < len(channels):
        reason = f"CHANNELS needs a count and that many different channels, not {quoted(' '.join(words))}"
        raise text.ContentError(reason, line)
    return tuple(channels)


class _Header(NamedTuple):
    """What the lines after MOTION state. line: the number of the last one, after which the frames begin."""

    line: int
    frames: int
    fps: float


def _motion_header(lines: list[str], motion_line: int) -> _Header:
    """The lines "Frames:" and "Frame Time:", in either order; FormatError for any other before both."""
    frames = None
    fps = None
    for line, content in enumerate(lines[motion_line:], start=motion_line + 1):
        entry = re.fullmatch(r"\s*(frames|frame\s+time)\s*:\s*(\S+)\s*", content, re.IGNORECASE)
        if entry and entry[1].lower() == "frames" and re.fullmatch("[0-9]{1,15}", entry[2]):
            frames = int(entry[2])
        elif entry and entry[1].lower() != "frames":
            fps = _fps(entry[2], line)
        elif content.strip():
            reason = f"expected 'Frames: N' and 'Frame Time: SECONDS', not {quoted(content.strip())}"
            raise text.ContentError(reason, line)
        if frames is not None and fps is not None:
            return _Header(line, frames, fps)
    raise text.ContentError("the file ends before 'Frames:' and 'Frame Time:'", len(lines))


def _fps(word: str, line: int) -> float:
    """The frame rate of a frame time: whole if its digits allow only one whole number."""
    seconds = text.number(word, line)
    if not seconds > 0:
        raise text.ContentError(f"frame time {word} s is out of range: expected more than 0", line)
    fps = text.frame_rate(1 / seconds, line)
    # half a unit of the last digit that is written, and a little more
    precision = 0.51 * 10.0 ** int(Decimal(word).as_tuple().exponent)
    possible = []
    for rate in (round(fps) - 1, round(fps), round(fps) + 1):
        if rate > 0 and abs(1 / rate - seconds) <= precision:
            possible.append(rate)
    return possible[0] if len(possible) == 1 else fps


def _values(lines: list[str], start: int, width: int) -> Array:
    """The frames (T, width) after the header, one per line or not; FormatError if one is truncated."""
    frames = lines[start:]
    # nearly all files have a frame in each line, which numpy reads at once
    values = text.table(frames)
    if values is None:
        words = "\n".join(frames).split()
        values = text.finite(words)
    if values is not None and values.size % width == 0:
        return values.reshape(-1, width)
    # a fault: line by line, to name the place
    count = sum(len(content.split()) for content in frames)
    for line, content in enumerate(frames, start=start + 1):
        row = text.numbers(content.split(), line)
        if count % width and len(row) not in (0, width):
            raise text.ContentError(f"truncated frame: a frame has {width} values, this line has {len(row)}", line)
    raise text.ContentError(f"{count} values do not make complete frames of {width}")


def write(file: File, motion: Motion) -> None:
    """Write a BVH file that every reader accepts; OutputError if it cannot be written.

    The root's OFFSET is 0 and the root alone has six channels; all rotations are Z Y X in degrees; names are plain
    and unique; every last joint has an End Site. Angles in that order are lossless, others accurate to 1e-9 degrees.
    A joint whose translation varies gets six channels too. A motion without root translation stays at the skeleton's
    origin.
    FormatError for channels other than Euler angles and translations; MotionError for a motion without skeleton.
    """
    motion, moving = text.with_still_offsets(place_of(file), motion)
    # some readers fail on blanks and colons in names
    names = text.plain_names(skeleton_of(motion).names, r"[^\w.-]")
    translated = {0, *map(skeleton_of(motion).index, moving)}
    motion = text.with_names(motion, names)
    # the hierarchy gives the order of joints in every frame
    lines, joints = _tree(motion, translated)
    rows = _rows(motion, joints, translated)
    head = ["HIERARCHY", *lines, "MOTION", f"Frames: {len(motion)}", f"Frame Time: {1 / motion.fps!r}"]
    frames = [" ".join(map(repr, row)) for row in rows.tolist()]
    write_whole(file, "\n".join([*head, *frames, ""]))


def _rows(motion: Motion, joints: list[int], translated: set[int]) -> Array:
    """The values (T, D) of joints in the file's order, translations before rotations."""
    translations = local_translations(motion)
    angles = _zyx_degrees(motion)
    blocks = []
    for i in joints:
        if i in translated:
            blocks.append(translations[:, i])
        blocks.append(angles[:, i])
    rows = np.concatenate(blocks, axis=1)
    if not np.isfinite(rows).all():
        raise MotionError("values of this motion are too large to convert")
    return rows


def _tree(motion: Motion, translated: set[int]) -> tuple[list[str], list[int]]:
    """The lines of the hierarchy, and the joints written as ROOT or JOINT in their order; others are End Sites."""
    skeleton = skeleton_of(motion)
    lines = []
    joints = []
    waiting: list[tuple[int | None, int]] = [(0, 0)]  # joints, or None for a closing brace, and their depth
    while waiting:
        i, depth = waiting.pop()
        indent = "\t" * min(depth, 40)  # so that a long chain of joints does not make a huge file
        if i is None:
            lines.append(indent + "}")
            continue
        joints.append(i)
        is_last = _is_last(motion, i)
        joint_text = _joint_text(skeleton, i, i in translated, is_last)
        lines += [indent + line for line in joint_text.split("\n")]
        # of what waits, the last comes next: the joints below, and then the brace
        waiting.append((None, depth))
        if not is_last:
            waiting += [(child, depth + 1) for child in reversed(skeleton.children[i])]
    return lines, joints


def _is_last(motion: Motion, i: int) -> bool:
    """Whether a joint has an End Site instead of joints below it."""
    skeleton = skeleton_of(motion)
    children = skeleton.children[i]
    if len(children) != 1:
        return not children
    child = skeleton.joints[children[0]]
    is_moved = any(channel.rpartition(".")[0] == child.name for channel in motion.channels)
    return child.name.endswith(END_SUFFIX) and not is_moved and not skeleton.children[children[0]]


def _joint_text(skeleton: Skeleton, i: int, is_translated: bool, is_last: bool) -> str:
    """The lines of a joint, without its closing brace."""
    joint = skeleton.joints[i]
    children = skeleton.children[i]
    positions = "6 Xposition Yposition Zposition" if is_translated else "3"
    text_of_joint = f"""\
{"JOINT" if i else "ROOT"} {joint.name}
{{
\tOFFSET {text.spaced(joint.offset if i else text.NOWHERE)}
\tCHANNELS {positions} Zrotation Yrotation Xrotation"""
    if not is_last:
        return text_of_joint
    tip = skeleton.joints[children[0]].offset if children else text.NOWHERE
    return f"""{text_of_joint}
\tEnd Site
\t{{
\t\tOFFSET {text.spaced(tip)}
\t}}"""


def _zyx_degrees(motion: Motion) -> Array:
    """Angles (T, J, 3) about z, y, x in degrees; unchanged if they already are."""
    skeleton = skeleton_of(motion)
    angles: Array = np.round(np.degrees(rotmats_to_euler(local_rotations(motion), "zyx")), 9).astype(np.float64)
    # angles that already are about z, y and x are kept to the last bit
    kept = [i for i, joint in enumerate(skeleton.joints) if joint.order == "zyx" and not any(joint.axis)]
    angles[:, kept] = 0.0
    for name, columns in motion.rotation_columns().items():
        if (joint := skeleton.index(name)) in kept:
            for column in columns:
                factor = TURN["deg"] / TURN[motion.units[column]]
                angles[:, joint, "zyx".index(motion.channels[column][-1])] = motion.values[:, column] * factor
    return angles
