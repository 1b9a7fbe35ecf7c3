"""AMC motion with its ASF skeleton (Acclaim), the format of the CMU motion capture database."""

import logging
import re
from collections.abc import Iterable, Iterator, Mapping
from itertools import compress, cycle, islice
from pathlib import Path
from typing import TypeVar

import numpy as np

from motet.errors import FormatError, quoted
from motet.files import File, check_place, place_of, write_whole
from motet.formats import text
from motet.formats.asf import CMU_METRES, Asf, Dofs, Line, asf_text, read_skeleton, words_of
from motet.motion.kinematics import skeleton_of
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet.motion.skeleton import Joint, Names

T = TypeVar("T")

log = logging.getLogger(__name__)

Layout = dict[str, int]
"""The bones of a frame in the file's order, and how many values each has."""


@text.names_file
def read(file: File, asf: str | Path | None = None, fps: float | None = None, partial: bool = False) -> Motion:
    """Read an AMC file and the ASF file of its skeleton.

    asf: the skeleton; if not given, the file of the same stem, else of the same subject (``39.asf`` for
        ``39_14.amc``), else the only ASF file, looked for beside the motion and then in ``../asf``.
    fps: AMC does not state it. Default: the file's comment ``# fps 60`` (motet writes one) or its line
        ``:SAMPLES-PER-SECOND 60``, else 120, the rate of nearly all of CMU. A comment that contradicts it is an error.
    partial: read the complete frames of a file whose last frame is truncated instead of refusing it.
    Channels come in the file's order of bones, units "length" for translations, "deg" or "rad" as in the file.
    FormatError names the file, and the line where it is cut or wrong.
    """
    path = place_of(file)
    lines = text.read_text(file).split("\n")
    if asf is None and not isinstance(file, str | Path):
        raise text.ContentError("a file object has no folder to find the skeleton in: pass it as asf")
    skeleton = read_skeleton(asf if asf is not None else _find_asf(path))
    # the lines before the first frame state the unit and the rate
    header, unit, stated_fps = _header(lines, skeleton)
    text.check_rate(stated_fps, fps)
    # the first frame says which bones every frame has
    layout = _layout(words_of(lines, header), skeleton.dofs)
    values = _frames(path, lines, header, layout, partial)
    channels = _channels(layout, skeleton.dofs)
    rates = [rate for rate in (stated_fps, fps, 120.0) if rate is not None]
    rate = text.frame_rate(rates[0])
    return Motion(values, channels, text.units_of(channels, unit), rate, skeleton.skeleton)


def skeleton_for(stem: str, skeletons: Mapping[str, T]) -> T | None:
    """Which of the skeletons of a folder, by their stems, a motion of a stem goes with: that of its own, of what stands
    before its first "_", or the only one; None for none."""
    subject = stem.split("_", maxsplit=1)[0]
    for name in (stem, subject):
        if name in skeletons:
            return skeletons[name]
    return next(iter(skeletons.values())) if len(skeletons) == 1 else None


def _find_asf(path: Path) -> Path:
    # CMU's 39_14.amc goes with 39.asf
    stems = dict.fromkeys([path.stem, path.stem.split("_")[0]])
    # beside the motion, or in the folder that CMU keeps skeletons in
    for folder in (path.parent, path.parent.parent / "asf"):
        try:
            files = sorted(folder.iterdir()) if folder.is_dir() else []
        except OSError as error:
            raise text.ContentError(f"cannot look for a skeleton in {folder}: {error.strerror}") from error
        if skeleton := skeleton_for(path.stem, {file.stem: file for file in files if file.suffix.lower() == ".asf"}):
            return skeleton
    names = " or ".join(f"{stem}.asf" for stem in stems)
    raise text.ContentError(f"no skeleton found: expected {names}, or a single .asf, beside it or in ../asf")


def _header(lines: list[str], asf: Asf) -> tuple[int, str, float | None]:
    """The number of lines before the first frame, the angle unit, and the frame rate if a comment states it."""
    unit = asf.angle
    fps = None
    for line, content in enumerate(lines):
        word = content.strip().lower()
        if word in (":degrees", ":radians"):
            unit = word[1:4]
        elif rate := re.fullmatch(r"(?:# fps|:samples-per-second)\s+(\S+)", word):
            fps = text.frame_rate(text.number(rate[1], line + 1), line + 1)
        elif word and word[0] not in "#:":
            return line, unit, fps
    return len(lines), unit, fps


def _layout(lines: Iterator[Line], dofs: Dofs) -> Layout:
    """The first frame's bones, each with its number of values; those of the skeleton if there is no frame."""
    line, words = next(lines, (0, []))
    if not words:
        return {bone: len(names) for bone, names in dofs.items()}
    if not _is_frame_number(words):
        raise text.ContentError(f"expected a frame number alone on its line, not {quoted(' '.join(words))}", line)
    layout = {}
    for line, words in lines:
        if _is_frame_number(words):
            break
        if words[0] in layout:
            raise text.ContentError(f"bone {quoted(words[0])} appears twice in a frame", line)
        if words[0] not in dofs:
            raise text.ContentError(f"bone {quoted(words[0])} has no degrees of freedom in the skeleton file", line)
        layout[words[0]] = len(dofs[words[0]])
    return layout


def _channels(bones: Iterable[str], dofs: Dofs) -> Names:
    """The channels of bones, each bone's in the order of its degrees of freedom."""
    channels = []
    for bone in bones:
        channels += [f"{bone}.{dof}" for dof in dofs[bone]]
    return tuple(channels)


def _is_frame_number(words: list[str]) -> bool:
    return len(words) == 1 and words[0].isdigit()


def _frames(path: Path, lines: list[str], header: int, layout: Layout, partial: bool) -> Array:
    """All values (T, D); if ``partial``, without a last frame that is not like the others."""
    try:
        return _values(lines, header, layout)
    except text.ContentError:
        frame_numbers = [line for line, content in enumerate(lines) if content.rstrip().isdecimal()]
        if not partial or not frame_numbers:
            raise
        values = _values(lines[: frame_numbers[-1]], header, layout)
        log.info("%s: the last frame is truncated and was left out", path)
        return values


def _values(lines: list[str], header: int, layout: Layout) -> Array:
    """All values (T, D); FormatError for a line that is not like that of the first frame."""
    values = _values_at_once(lines[header:], layout)
    if values is None:
        # a fault: line by line, to name the place
        _check_lines(lines, header, layout)
        rows = [text.numbers(words[1:], line) for line, words in words_of(lines, header)]
        values = np.concatenate(rows).reshape(-1, sum(layout.values()))
    return values


def _values_at_once(lines: list[str], layout: Layout) -> Array | None:
    """All values (T, D) of lines that are all like in the first frame, several times as fast as line by line; None for
    others, and for words that are no numbers."""
    # with an end after each line, the words of every frame are at the same places only if the lines are alike, too
    content = _with_ends(lines)
    if "#" in content:
        content = _with_ends([line.partition("#")[0] for line in lines])
    words = content.split()
    # of a frame's words: a name, an end, or None for a value; the first is the number of the frame
    kinds: list[str | None] = ["", ";"]
    for bone, count in layout.items():
        kinds += [bone, *[None] * count, ";"]
    frames, rest = divmod(len(words), len(kinds))
    if rest or not all(map(str.isdigit, words[:: len(kinds)])):
        return None
    for place, kind in enumerate(kinds):
        if kind and words[place :: len(kinds)].count(kind) < frames:
            return None
    values = text.finite(list(compress(words, cycle([kind is None for kind in kinds]))))
    return None if values is None else values.reshape(frames, kinds.count(None))


def _with_ends(lines: list[str]) -> str:
    """Lines that are not blank, a semicolon after each."""
    return " ; ".join([*filter(str.strip, lines), ""])


def _check_lines(lines: list[str], header: int, layout: Layout) -> None:
    """FormatError for the first line that is not like that of the first frame, whatever its values are."""
    frame = {"": 0} | layout  # the lines of a frame: its number, and a line for each bone
    expected = cycle(frame.items())
    bone, count = next(expected)
    line = 0
    # each line names the next bone with as many values, or a frame's number
    for line, words in words_of(lines, header):
        is_number = _is_frame_number(words)
        if bone and is_number:
            break
        is_expected = words[0] == bone if bone else is_number
        if not is_expected:
            wanted = f"bone {bone!r}" if bone else "a frame number"
            raise text.ContentError(f"expected {wanted}, as in the first frame, not {quoted(words[0])}", line)
        if len(words) - 1 != count:
            raise text.ContentError(f"bone {bone!r} needs {count} values, not {len(words) - 1}", line)
        bone, count = next(expected)
    if bone:
        raise text.ContentError(f"truncated frame: bone {bone!r} is missing", line)


def write(file: File, motion: Motion) -> None:
    """Write ``file``, a path, and beside it the ASF file of the same stem; existing ones are replaced.

    The frame rate goes into a comment that :func:`read` understands. The root becomes "root"; characters not allowed
    in the format become ``_``. Values are lossless, translations in the skeleton's unit; a skeleton with a known unit
    is written in CMU's, the only one the format can name. If the children of a joint start at different places, each
    gets a bone ``NAME_base`` without channels leading to it.

    FormatError for channels other than Euler angles and translations, and for a joint other than the root whose
    translation varies; MotionError for a motion without skeleton.
    """
    if not isinstance(file, str | Path):
        raise FormatError(place_of(file), "AMC consists of two files, so it cannot be written to one file object")
    path = check_place(file)
    motion, moving = text.with_still_offsets(path, motion)
    if moving:
        raise FormatError(path, f"only the root can move in an AMC file, not {', '.join(moving)}")
    if skeleton_of(motion).metres_per_unit not in (None, CMU_METRES):
        motion = motion.scaled(CMU_METRES)
    # a bone's name has no blanks or comments, and is neither a number nor a keyword
    names = text.plain_names(["root", *skeleton_of(motion).names[1:]], r"[\s#]|^(?=\d+$)|^(?=:)")
    motion = text.with_names(motion, names)
    dofs = {}
    for joint in skeleton_of(motion).joints:
        if dofs_of_joint := _dofs_of(motion, joint):
            dofs[joint.name] = dofs_of_joint
    frames = _frame_lines(motion, dofs)
    write_whole(path.with_suffix(".asf"), asf_text(Asf(skeleton_of(motion), dofs, "deg")))
    write_whole(path, "\n".join([*frames, ""]))


def _dofs_of(motion: Motion, joint: Joint) -> Names:
    """The joint's channels in the motion's order if the rotation order allows it: the first one turns first."""
    dofs = []
    for channel in motion.channels:
        name, _, kind = channel.rpartition(".")
        if name == joint.name:
            dofs.append(kind)
    # in the file, the first turn is applied first: the last letter of the order
    turns = [f"r{axis}" for axis in reversed(joint.order) if f"r{axis}" in dofs]
    if [dof for dof in dofs if dof[0] == "r"] != turns:
        dofs = [dof for dof in dofs if dof[0] == "t"] + turns
    return tuple(dofs)


def _frame_lines(motion: Motion, dofs: Dofs) -> list[str]:
    """The lines of an AMC file: the header, and of each frame its number and a line for each bone."""
    # bones in the order in which the motion first names them
    bones = list(dict.fromkeys(channel.rpartition(".")[0] for channel in motion.channels))
    unit = "rad" if "rad" in motion.units and "deg" not in motion.units else "deg"
    channels = _channels(bones, dofs)
    values = motion.select(channels, text.units_of(channels, unit)).values
    lines = [f"# fps {motion.fps!r}", ":FULLY-SPECIFIED", ":RADIANS" if unit == "rad" else ":DEGREES"]
    for frame, row in enumerate(values.tolist(), start=1):
        lines.append(str(frame))
        words = map(repr, row)
        for bone in bones:
            lines.append(" ".join([bone, *islice(words, len(dofs[bone]))]))
    return lines
