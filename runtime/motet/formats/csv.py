"""CSV: a table of channels for spreadsheets and other programs. The skeleton is not kept.

A comment ``# motet motion, fps 120.0``, a header ``time,root.tx [length],root.rx [deg],...`` and one row per frame, its
time in seconds first. Other programs' tables need the header and, without such a comment, evenly spaced times.
"""

import csv
import io
import re
from array import array
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from motet.files import File, write_whole
from motet.formats.text import ContentError, frame_rate, names_file, number, numbers, read_text
from motet.motion.motion import Motion
from motet.motion.rotations import Array

COMMENT = "# motet motion, fps "


class Channels(NamedTuple):
    """The channels of a table, each with its unit."""

    names: list[str]
    units: list[str]


@names_file
def read(file: File) -> Motion:
    """Read a table: values unchanged, no skeleton. FormatError names the file and line at fault."""
    fps: float | None = None
    header: list[str] = []
    channels = Channels([], [])
    values = array("d")  # row after row
    # a comment with the rate, the header, then a frame in each row
    for line, row in _rows(file):
        if row[0].startswith("#"):
            fps = _stated_rate(",".join(row), line) or fps
        elif not header:
            header = row
            channels = _channels(header)
        elif len(row) == len(header):
            values.extend(numbers(row, line))
        else:
            raise ContentError(f"expected {len(header)} values, not {len(row)}", line)
    if not header:
        raise _no_header()
    table = np.array(values).reshape(-1, len(header))
    fps = fps or _rate_of_times(table[:, 0])
    return Motion(table[:, 1:], tuple(channels.names), tuple(channels.units), fps)


def _stated_rate(comment: str, line: int) -> float | None:
    """The frame rate that a comment states, if it does."""
    if not comment.startswith(COMMENT):
        return None
    return frame_rate(number(comment.removeprefix(COMMENT), line), line)


def _rows(file: File) -> Iterator[tuple[int, list[str]]]:
    """The rows that are not empty, each with the number of its line."""
    reader = csv.reader(io.StringIO(read_text(file)))
    try:
        for row in reader:
            if row:
                yield reader.line_num, row
    except csv.Error as error:
        raise ContentError(f"not a table: {error}", reader.line_num) from error


def _rate_of_times(times: Array) -> float:
    """The frame rate of times (T,) in seconds; FormatError where they are not evenly spaced."""
    # without a rate, the times must be spaced within a hundredth
    steps = np.diff(times)
    if not len(steps) or steps.min() <= 0 or np.ptp(steps) > 0.01 * steps.mean():
        raise ContentError(f"times are not evenly spaced: add a comment line '{COMMENT}30'")
    return frame_rate(float(1 / steps.mean()))


def _channels(header: Sequence[str]) -> Channels:
    """The channels of a header; FormatError for another header."""
    if header[0] == "Format Version":
        raise ContentError("this is a table of Motive, which has no skeleton: export BVH or FBX there")
    if len(header) == 1 and ";" in header[0]:
        raise ContentError("its columns are separated by semicolons: expected commas, and decimals with a point")
    channels = Channels([], [])
    for title in header[1:]:
        if channel := re.fullmatch(r"(.+) \[(.+)\]", title):
            channels.names.append(channel[1])
            channels.units.append(channel[2])
    if header[0] != "time" or len(channels.names) < len(header) - 1:
        raise _no_header()
    return channels


def _no_header() -> ContentError:
    return ContentError("the header must be 'time,CHANNEL [UNIT],...', as in 'time,root.tx [length]'")


def write(file: File, motion: Motion) -> None:
    """Write a table; values are kept exactly, the skeleton is not. OutputError if it cannot be written."""
    text = io.StringIO()
    text.write(f"{COMMENT}{motion.fps!r}\n")
    writer = csv.writer(text, lineterminator="\n")
    titles = map("{} [{}]".format, motion.channels, motion.units)
    # the header names units, so that the table reads back without loss
    writer.writerow(["time", *titles])
    for frame, row in enumerate(motion.values.tolist()):
        writer.writerow([repr(frame / motion.fps), *map(repr, row)])
    write_whole(file, text.getvalue())
