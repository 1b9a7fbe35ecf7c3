"""AMC motion with its ASF skeleton (Acclaim), the format of the CMU motion capture database."""

import logging
import re
from collections.abc import Iterator, Mapping
from itertools import islice
from pathlib import Path

import numpy as np

from motet.errors import FormatError, quoted
from motet.files import File, check_place, place_of, write_whole
from motet.formats.asf import ASF_ROOT, CMU_METRES, Asf, read_skeleton, write_skeleton
from motet.formats.lines import frame_rate, number, numbers, plain_names, read_text
from motet.formats.words import Words
from motet.formats.writable import ANGLE_KINDS, TRANSLATION_KINDS, with_names, with_still_offsets
from motet.motion.kinematics import skeleton_of
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet.motion.skeleton import Joint

log = logging.getLogger(__name__)

FPS_COMMENT = "# fps "
EACH_LINE = r".+\n?|\n"
"""Finds lines one by one, so reading the first lines does not split the whole file."""

Layout = list[tuple[str, int]]


def read(file: File, asf: str | Path | None = None, fps: float | None = None, partial: bool = False) -> Motion:
    """Read an AMC file and the ASF file of its skeleton.

    asf: the skeleton; if not given, the file of the same stem, else of the same subject (``39.asf`` for
        ``39_14.amc``), else the only ASF file, looked for beside the motion and then in ``../asf``.
    fps: AMC does not state it. Default: the file's comment ``# fps 60`` (motet writes one), else 120, the rate of
        nearly all of CMU. A comment that contradicts it is an error.
    partial: read the complete frames of a file whose last frame is truncated instead of refusing it.
    Channels come in the file's order of bones, units "length" for translations, "deg" or "rad" as in the file.
    FormatError names the file, and the line where it is cut or wrong.
    """
    path, text = place_of(file), read_text(file)
    if asf is None and not isinstance(file, str | Path):
        raise FormatError(path, "a file object has no folder to find the skeleton in: pass it as asf")
    skeleton = read_skeleton(asf if asf is not None else _find_asf(path))
    header, unit, said_fps = _header(path, text, skeleton)
    layout = _layout(path, _frame_lines(text, header), skeleton.dofs)
    values = _values(path, text, header, layout, partial)
    channels = [(bone, dof) for bone, _ in layout for dof in skeleton.dofs[bone]]
    names = tuple(f"{bone}.{dof}" for bone, dof in channels)
    units = tuple("length" if dof[0] == "t" else unit for _, dof in channels)
    return Motion(values, names, units, _rate(path, said_fps, fps), skeleton.skeleton)


def _rate(path: Path, said: float | None, given: float | None) -> float:
    if said is not None and given is not None and abs(said - given) > 1e-6 * said:
        raise FormatError(path, f"the file states {said:g} fps, but {given:g} was given")
    # CMU's files state none: theirs is 120
    return frame_rate(120.0 if said is None and given is None else said or given or 0.0, path)


def _find_asf(path: Path) -> Path:
    stems = list(dict.fromkeys([path.stem, path.stem.split("_")[0]]))
    for folder in (path.parent, path.parent.parent / "asf"):
        try:
            found = sorted(folder.iterdir()) if folder.is_dir() else []
        except OSError as error:
            raise FormatError(path, f"cannot look for a skeleton in {folder}: {error.strerror}") from error
        by_stem = {file.stem: file for file in found if file.suffix.lower() == ".asf"}
        for stem in stems:
            if stem in by_stem:
                return by_stem[stem]
        if len(by_stem) == 1:
            return next(iter(by_stem.values()))
    names = " or ".join(f"{stem}.asf" for stem in stems)
    raise FormatError(path, f"no skeleton found: expected {names}, or a single .asf, beside it or in ../asf")


def _header(path: Path, text: str, asf: Asf) -> tuple[int, str, float | None]:
    """The number of lines before the first frame, the angle unit, and the frame rate if a comment states it."""
    unit, fps, line = asf.angle, None, -1
    for line, content in enumerate(re.finditer(EACH_LINE, text)):
        word = content[0].strip().lower()
        if word in (":degrees", ":radians"):
            unit = word[1:4]
        elif word.startswith(FPS_COMMENT):
            fps = frame_rate(number(word.removeprefix(FPS_COMMENT), path, line + 1), path, line + 1)
        elif word and word[0] not in "#:":
            return line, unit, fps
    return line + 1, unit, fps


def _frame_lines(text: str, header: int) -> Iterator[tuple[int, list[str]]]:
    """Every non-empty line after the header, and its number."""
    for line, content in enumerate(re.finditer(EACH_LINE, text), start=1):
        words = content[0].split("#")[0].split()
        if words and line > header:
            yield line, words


def _layout(path: Path, lines: Iterator[tuple[int, list[str]]], dofs: Mapping[str, tuple[str, ...]]) -> Layout:
    """The first frame's bones, each with its number of values; those of the skeleton if there is no frame."""
    line, words = next(lines, (0, [""]))
    if not words[0]:
        return [(bone, len(names)) for bone, names in dofs.items()]
    if not _is_frame_number(words):
        reason = f"expected a frame number alone on its line, not {quoted(' '.join(words))}"
        raise FormatError(path, reason, line)
    layout: dict[str, int] = {}
    for line, words in lines:
        if _is_frame_number(words):
            break
        if words[0] in layout:
            raise FormatError(path, f"bone {quoted(words[0])} appears twice in a frame", line)
        if words[0] not in dofs:
            raise FormatError(path, f"bone {quoted(words[0])} has no degrees of freedom in the skeleton file", line)
        layout[words[0]] = len(dofs[words[0]])
    return list(layout.items())


def _is_frame_number(words: list[str]) -> bool:
    return len(words) == 1 and words[0].isdigit()


def _values(path: Path, text: str, header: int, layout: Layout, partial: bool) -> Array:
    values = _values_at_once(text, header, layout)
    if values is not None:
        return values
    try:
        return _values_by_line(path, _frame_lines(text, header), layout)
    except FormatError:
        frames = [match.start() for match in re.finditer(r"^\d+\s*$", text, re.MULTILINE)]
        if not (partial and frames):
            raise
    log.info("%s: the last frame is truncated and was left out", path)
    return _values_by_line(path, _frame_lines(text[: frames[-1]], header), layout)


def _values_at_once(text: str, header: int, layout: Layout) -> Array | None:
    """All values (T, D) if all frames have the same layout, else None: several times faster than line by line."""
    try:
        words = Words("".join(text.split("\n", header)[header:]))
    except UnicodeEncodeError:
        return None
    width = 1 + sum(1 + count for _, count in layout)
    frames, rest = divmod(len(words), width)
    if rest or not words.are_digits(slice(0, None, width)):
        return None
    is_value, here = np.zeros(width, dtype=bool), 1
    for bone, count in layout:
        if not words.are(slice(here, None, width), bone):
            return None
        is_value[here + 1 : here + 1 + count] = True
        here += 1 + count
    values = words.numbers(np.tile(is_value, frames))
    return None if values is None else values.reshape(frames, -1)


def _values_by_line(path: Path, lines: Iterator[tuple[int, list[str]]], layout: Layout) -> Array:
    """All values (T, D), with every line checked against the first frame."""
    rows: list[list[float]] = []
    expected: Layout = []
    line = 0
    for line, words in lines:
        if _is_frame_number(words):
            _refuse_rest(path, expected, line)
            expected = layout[::-1]
            rows.append([])
            continue
        if not expected or words[0] != expected[-1][0]:
            wanted = f"bone {expected[-1][0]!r}" if expected else "a frame number"
            raise FormatError(path, f"expected {wanted}, as in the first frame, not {quoted(words[0])}", line)
        bone, count = expected.pop()
        if len(words) - 1 != count:
            raise FormatError(path, f"bone {bone!r} needs {count} values, not {len(words) - 1}", line)
        rows[-1].extend(numbers(words[1:], path, line))
    _refuse_rest(path, expected, line)
    return np.array(rows).reshape(len(rows), sum(count for _, count in layout))


def _refuse_rest(path: Path, expected: Layout, line: int) -> None:
    if expected:
        raise FormatError(path, f"truncated frame: bone {expected[-1][0]!r} is missing", line)


def write(file: File, motion: Motion) -> None:
    """Write ``file``, a path, and beside it the ASF file of the same stem; existing ones are replaced.

    The frame rate goes into a comment that :func:`read` understands. The root becomes "root"; characters not allowed
    in the format become ``_``. Values are lossless, translations in the skeleton's unit; a skeleton with a known unit
    is written in CMU's, the only one the format can name.

    FormatError for channels other than Euler angles and translations, and for a joint other than the root whose
    translation varies; MotionError for a motion without skeleton.
    """
    if not isinstance(file, str | Path):
        raise FormatError(place_of(file), "AMC consists of two files, so it cannot be written to one file object")
    path = check_place(file)
    motion, moving = with_still_offsets(path, motion)
    if moving:
        raise FormatError(path, f"only the root can move in an AMC file, not {', '.join(moving)}")
    if skeleton_of(motion).metres_per_unit not in (None, CMU_METRES):
        motion = motion.scaled(CMU_METRES)
    # a bone's name has no blanks or comments, and is neither a number nor a keyword
    names = plain_names([ASF_ROOT, *skeleton_of(motion).names[1:]], r"[\s#]|^(?=\d+$)|^(?=:)")
    motion = with_names(motion, names)
    joints = skeleton_of(motion).joints
    asf = Asf(skeleton_of(motion), {joint.name: dofs for joint in joints if (dofs := _dofs(motion, joint))}, "deg")
    text = _text(motion, asf.dofs)
    write_skeleton(path.with_suffix(".asf"), asf)
    write_whole(path, text)


def _dofs(motion: Motion, joint: Joint) -> tuple[str, ...]:
    """The joint's channels in the motion's order if the rotation order allows it: the first one turns first."""
    prefix = f"{joint.name}."
    dofs = tuple(name.removeprefix(prefix) for name in motion.channels if name.rpartition(".")[0] == joint.name)
    turns = [f"r{axis}" for axis in reversed(joint.order) if f"r{axis}" in dofs]
    if [dof for dof in dofs if dof in ANGLE_KINDS] == turns:
        return dofs
    return (*(dof for dof in dofs if dof in TRANSLATION_KINDS), *turns)


def _text(motion: Motion, dofs: Mapping[str, tuple[str, ...]]) -> str:
    bones = list(dict.fromkeys(channel.rpartition(".")[0] for channel in motion.channels))
    unit = "rad" if "rad" in motion.units and "deg" not in motion.units else "deg"
    channels = tuple(f"{bone}.{dof}" for bone in bones for dof in dofs[bone])
    values = motion.select(channels, tuple("length" if name[-2] == "t" else unit for name in channels)).values
    lines = [f"{FPS_COMMENT}{motion.fps!r}", ":FULLY-SPECIFIED", ":RADIANS" if unit == "rad" else ":DEGREES"]
    for frame, row in enumerate(values.tolist(), start=1):
        words = map(repr, row)
        lines.append(str(frame))
        lines += [" ".join([bone, *islice(words, len(dofs[bone]))]) for bone in bones]
    return "\n".join([*lines, ""])
