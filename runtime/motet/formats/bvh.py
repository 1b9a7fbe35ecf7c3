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

import numpy as np

from motet.errors import FormatError, MotionError, quoted
from motet.files import File, place_of, write_whole
from motet.formats import text
from motet.motion.kinematics import local_rotations, local_translations, skeleton_of
from motet.motion.motion import TURN, Motion
from motet.motion.rotations import Array, rotmats_to_euler
from motet.motion.skeleton import END_SUFFIX, Joint, Skeleton

log = logging.getLogger(__name__)


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
    figures, motion_line = _hierarchy(path, lines)
    names = _figure_names(figures)
    chosen = text.chosen(path, names, figure, "figure")
    start, declared, fps = _motion_header(path, lines, motion_line)
    widths = [sum(len(node.channels) for node in nodes) for nodes in figures]
    width = sum(widths)
    # without channels nothing else confirms the number
    if not width and declared > 10**7:
        raise FormatError(path, f"the file declares {declared} frames and has no channels", start)
    if partial:  # leave out an incomplete last frame
        last = max((n for n in range(start, len(lines)) if lines[n].strip()), default=start)
        if last < len(lines) and len(lines[last].split()) != width:
            lines = lines[:last]
    values = _values(path, lines, start, width) if width else np.zeros((declared, 0))
    if len(values) < declared and not partial:
        reason = f"the file declares {declared} frames but holds {len(values)}: correct the line 'Frames:'"
        raise FormatError(path, f"{reason}, or read it with partial=True (--partial)", start)
    if len(values) < declared:
        log.info("%s: read %d of the declared %d frames", path, len(values), declared)
    elif len(values) > declared:
        log.warning("%s: it declares %d frames but holds %d: read them all", path, declared, len(values))
    nodes = figures[chosen]
    first_column = sum(widths[:chosen])
    values = values[:, first_column : first_column + widths[chosen]]
    channels = [f"{node.name}.{kind}" for node in nodes for kind in node.channels]
    units = tuple("deg" if name[-2] == "r" else "length" for name in channels)
    return Motion(values, tuple(channels), units, fps, Skeleton(tuple(_joint(path, node) for node in nodes)))


def contents(file: File) -> text.Contents:
    """The ROOTs; FormatError like :func:`read` for what precedes the line MOTION."""
    figures, _ = _hierarchy(place_of(file), text.read_text(file).split("\n"))
    return text.Contents((), dict.fromkeys(_figure_names(figures), ()))


def _figure_names(figures: "list[list[_Node]]") -> tuple[str, ...]:
    return text.part_names((nodes[0].name for nodes in figures), "figure")


@dataclass
class _Node:
    name: str
    parent: int
    line: int
    offset: text.Triple | None = None
    channels: tuple[str, ...] = ()


def _joint(path: Path, node: _Node) -> Joint:
    if node.offset is None:
        raise FormatError(path, f"joint {quoted(node.name)} has no OFFSET", node.line)
    turns = "".join(kind[1] for kind in node.channels if kind[0] == "r")
    return Joint(node.name, node.parent, node.offset, text.complete_order(turns))


def _hierarchy(path: Path, lines: list[str]) -> tuple[list[list[_Node]], int]:
    """The joints of each ROOT, and the number of the line MOTION after them."""
    figures: list[list[_Node]] = []
    nodes: list[_Node] = []
    open_nodes: list[int] = []
    names = text.Names()
    declared = False  # a joint has been named and its brace must follow
    pieces = ((line, piece.strip()) for line, content in enumerate(lines, 1) for piece in re.split("([{}])", content))
    for line, statement in ((line, piece) for line, piece in pieces if piece):
        keyword, _, rest = statement.replace("\t", " ").partition(" ")
        match keyword.lower():
            case "root" | "joint" | "end" as kind:
                if declared or bool(open_nodes) == (kind == "root"):
                    reason = f"{quoted(statement)} does not belong here: expected trees of joints"
                    raise FormatError(path, reason, line)
                if kind == "root":
                    nodes = []
                    figures.append(nodes)
                    names = text.Names()
                parent = open_nodes[-1] if open_nodes else -1
                wanted = nodes[parent].name + END_SUFFIX if kind == "end" else rest.strip() or "joint"
                nodes.append(_Node(names.unique(wanted), parent, line))
            case "{" if declared:
                open_nodes.append(len(nodes) - 1)
            case "}" if open_nodes and not declared:
                open_nodes.pop()
            case "offset" if open_nodes and not declared:
                nodes[open_nodes[-1]].offset = text.triple(rest.split(), path, line)
            case "channels" if open_nodes and not declared:
                nodes[open_nodes[-1]].channels = _channels(path, rest.split(), line)
            case "motion" if nodes and not open_nodes and not declared:
                return figures, line
            case "hierarchy" if not nodes:
                pass
            case _:
                raise FormatError(path, f"{quoted(statement)} does not belong here", line)
        declared = keyword.lower() in ("root", "joint", "end")
    raise FormatError(path, "not a BVH file, or truncated: the line MOTION is missing")


def _channels(path: Path, words: list[str], line: int) -> tuple[str, ...]:
    kinds = (("position", "t"), ("rotation", "r"))
    known = {f"{axis}{kind}": f"{letter}{axis}" for kind, letter in kinds for axis in "xyz"}
    if unknown := [word for word in words[1:] if word.lower() not in known]:
        reason = f"channel {quoted(unknown[0])}: expected one of Xposition ... Zposition, Xrotation ... Zrotation"
        raise FormatError(path, reason, line)
    channels = tuple(known[word.lower()] for word in words[1:])
    if words[:1] != [str(len(channels))] or len(set(channels)) < len(channels):
        reason = f"CHANNELS needs a count and that many different channels, not {quoted(' '.join(words))}"
        raise FormatError(path, reason, line)
    return channels


def _motion_header(path: Path, lines: list[str], motion_line: int) -> tuple[int, int, float]:
    """The number of lines before the first frame, the declared number of frames and the frame rate."""
    frames = None
    fps = None
    for line, content in enumerate(lines[motion_line:], start=motion_line + 1):
        found = re.fullmatch(r"\s*(frames|frame\s+time)\s*:\s*(\S+)\s*", content, re.IGNORECASE)
        if found and found[1].lower() == "frames" and re.fullmatch("[0-9]{1,15}", found[2]):
            frames = int(found[2])
        elif found and found[1].lower() != "frames":
            fps = _fps(path, found[2], line)
        elif content.strip():
            reason = f"expected 'Frames: N' and 'Frame Time: SECONDS', not {quoted(content.strip())}"
            raise FormatError(path, reason, line)
        if frames is not None and fps is not None:
            return line, frames, fps
    raise FormatError(path, "the file ends before 'Frames:' and 'Frame Time:'", len(lines))


def _fps(path: Path, word: str, line: int) -> float:
    seconds = text.number(word, path, line)
    if not seconds > 0:
        raise FormatError(path, f"frame time {word} s is out of range: expected more than 0", line)
    fps = text.frame_rate(1 / seconds, path, line)
    precision = 0.51 * 10.0 ** int(Decimal(word).as_tuple().exponent)
    near = [rate for rate in (round(fps) - 1, round(fps), round(fps) + 1) if rate > 0]
    whole = [rate for rate in near if abs(1 / rate - seconds) <= precision]
    return whole[0] if len(whole) == 1 else fps


def _values(path: Path, lines: list[str], start: int, width: int) -> Array:
    """The frames (T, width) after the header, one per line or not; FormatError if one is truncated."""
    words = "\n".join(lines[start:]).split()
    values = text.finite(words)
    if values is not None and len(words) % width == 0:
        return values.reshape(-1, width)
    for line, content in enumerate(lines[start:], start=start + 1):
        row = text.numbers(content.split(), path, line)
        if len(words) % width and len(row) not in (0, width):
            raise FormatError(path, f"truncated frame: a frame has {width} values, this line has {len(row)}", line)
    raise FormatError(path, f"{len(words)} values do not make complete frames of {width}")


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
    translated = {0, *(skeleton_of(motion).index(name) for name in moving)}
    motion = text.with_names(motion, names)
    lines, joints = _tree(motion, translated)
    translations = local_translations(motion)
    angles = _zyx_degrees(motion)
    blocks = [block[:, i] for i in joints for block in ((translations, angles) if i in translated else (angles,))]
    rows = np.concatenate(blocks, axis=1)
    if not np.isfinite(rows).all():
        raise MotionError("values of this motion are too large to convert")
    lines = ["HIERARCHY", *lines, "MOTION", f"Frames: {len(motion)}", f"Frame Time: {1 / motion.fps!r}"]
    write_whole(file, "\n".join([*lines, *(" ".join(map(repr, row)) for row in rows.tolist()), ""]))


def _tree(motion: Motion, translated: set[int]) -> tuple[list[str], list[int]]:
    """The lines of the hierarchy, and the joints written as ROOT or JOINT in their order; others are End Sites."""
    skeleton = skeleton_of(motion)
    moved = {channel.rpartition(".")[0] for channel in motion.channels}
    lines: list[str] = []
    joints: list[int] = []
    waiting: list[tuple[int | None, int]] = [(0, 0)]
    while waiting:
        i, depth = waiting.pop()
        indent = "\t" * min(depth, 40)  # so that a long chain of joints does not make a huge file
        if i is None:
            lines.append(indent + "}")
            continue
        joints.append(i)
        children = [skeleton.joints[child] for child in skeleton.children[i]]
        lone = [c.name for c in children if c.name.endswith(END_SUFFIX) and c.name not in moved]
        is_last = not children or (len(children) == len(lone) == 1 and not skeleton.children[skeleton.children[i][0]])
        offset = skeleton.joints[i].offset if i else (0.0, 0.0, 0.0)
        kinds = "6 Xposition Yposition Zposition" if i in translated else "3"
        kind = "JOINT" if i else "ROOT"
        channels = f"\tCHANNELS {kinds} Zrotation Yrotation Xrotation"
        start = (f"{kind} {skeleton.joints[i].name}", "{", f"\tOFFSET {text.spaced(offset)}", channels)
        lines += [indent + line for line in start]
        if is_last:
            tip = children[0].offset if children else (0.0, 0.0, 0.0)
            lines += [f"{indent}\t{line}" for line in ("End Site", "{", f"\tOFFSET {text.spaced(tip)}", "}")]
        waiting.append((None, depth))
        waiting += [(child, depth + 1) for child in reversed(skeleton.children[i]) if not is_last]
    return lines, joints


def _zyx_degrees(motion: Motion) -> Array:
    """Angles (T, J, 3) about z, y, x in degrees; unchanged if they already are."""
    skeleton = skeleton_of(motion)
    angles: Array = np.round(np.degrees(rotmats_to_euler(local_rotations(motion), "zyx")), 9).astype(np.float64)
    kept = [i for i, joint in enumerate(skeleton.joints) if joint.order == "zyx" and not any(joint.axis)]
    angles[:, kept] = 0.0
    for name, columns in motion.rotation_columns().items():
        if (joint := skeleton.index(name)) in kept:
            for column in columns:
                factor = TURN["deg"] / TURN[motion.units[column]]
                angles[:, joint, "zyx".index(motion.channels[column][-1])] = motion.values[:, column] * factor
    return angles
