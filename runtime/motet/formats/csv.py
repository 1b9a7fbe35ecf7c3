"""CSV: a table of channels for spreadsheets and other programs. The skeleton is not kept.

A comment ``# motet motion, fps 120.0``, a header ``time,root.tx [length],root.rx [deg],...`` and one row per frame, its
time in seconds first. Other programs' tables need the header and, without such a comment, evenly spaced times.
"""

import csv
import io
import re

import numpy as np

from motet.errors import FormatError
from motet.files import File, place_of, write_whole
from motet.formats.text import frame_rate, number, numbers, read_text
from motet.motion.motion import Motion

COMMENT = "# motet motion, fps "


def read(file: File) -> Motion:
    """Read a table: values unchanged, no skeleton. FormatError names the file and line at fault."""
    path, fps, rows = place_of(file), None, []
    header: list[str] = []
    reader = csv.reader(io.StringIO(read_text(file)))
    try:
        for row in reader:
            if not row or row[0].startswith("#"):
                comment, line = ",".join(row), reader.line_num
                if comment.startswith(COMMENT):
                    fps = frame_rate(number(comment.removeprefix(COMMENT), path, line), path, line)
            elif not header:
                header = row
            elif len(row) == len(header):
                rows.append(numbers(row, path, reader.line_num))
            else:
                raise FormatError(path, f"expected {len(header)} values, not {len(row)}", reader.line_num)
    except csv.Error as error:
        raise FormatError(path, f"not a table: {error}", reader.line_num) from error
    found = [match for title in header[1:] if (match := re.fullmatch(r"(.+) \[(.+)\]", title))]
    if header[:1] != ["time"] or len(found) < len(header) - 1:
        raise FormatError(path, "the header must be 'time,CHANNEL [UNIT],...', as in 'time,root.tx [length]'")
    table = np.array(rows).reshape(len(rows), len(header))
    if fps is None:
        steps = np.diff(table[:, 0])
        if not len(steps) or steps.min() <= 0 or np.ptp(steps) > 0.01 * steps.mean():
            raise FormatError(path, f"times are not evenly spaced: add a comment line '{COMMENT}30'")
        fps = frame_rate(float(1 / steps.mean()), path)
    return Motion(table[:, 1:], tuple(match[1] for match in found), tuple(match[2] for match in found), fps)


def write(file: File, motion: Motion) -> None:
    """Write a table; values are kept exactly, the skeleton is not. OutputError if it cannot be written."""
    text = io.StringIO()
    text.write(f"{COMMENT}{motion.fps!r}\n")
    writer = csv.writer(text, lineterminator="\n")
    titles = (f"{name} [{unit}]" for name, unit in zip(motion.channels, motion.units, strict=True))
    writer.writerow(["time", *titles])
    for frame, row in enumerate(motion.values.tolist()):
        writer.writerow([repr(frame / motion.fps), *map(repr, row)])
    write_whole(file, text.getvalue())
