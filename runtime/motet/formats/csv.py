"""CSV: a table of channels for spreadsheets and other programs. The skeleton is not kept.

A comment ``# motet motion, fps 120.0``, a header ``time,root.tx [length],root.rx [deg],...`` and one row per frame, its
time in seconds first. Other programs' tables need the header and, without such a comment, evenly spaced times.
"""

import csv
import io
import re
from pathlib import Path

import numpy as np

from motet.errors import FormatError
from motet.files import File, place_of, write_whole
from motet.formats.lines import frame_rate, number, numbers, read_text
from motet.motion.motion import Motion

TIME = "time"
COMMENT = "# motet motion, fps "


def read(file: File) -> Motion:
    """Read a table: values unchanged, no skeleton. FormatError names the file and line at fault."""
    path, text = place_of(file), read_text(file)
    fps, header, rows = None, None, []
    reader = csv.reader(io.StringIO(text))
    try:
        for row in reader:
            if not row or row[0].startswith("#"):
                fps = _said_fps(path, ",".join(row), reader.line_num) or fps
            elif header is None:
                header = row
            elif len(row) == len(header):
                rows.append(numbers(row, path, reader.line_num))
            else:
                raise FormatError(path, f"expected {len(header)} values, not {len(row)}", reader.line_num)
    except csv.Error as error:
        raise FormatError(path, f"not a table: {error}", reader.line_num) from error
    names, units = _columns(path, header or [])
    table = np.array(rows).reshape(len(rows), 1 + len(names))
    return Motion(table[:, 1:], names, units, fps or _fps_of(path, table[:, 0]))


def _said_fps(path: Path, text: str, line: int) -> float | None:
    if not text.startswith(COMMENT):
        return None
    return frame_rate(number(text.removeprefix(COMMENT), path, line), path, line)


def _columns(path: Path, header: list[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    found = [re.fullmatch(r"(.+) \[(.+)\]", title) for title in header[1:]]
    if header[:1] != [TIME] or None in found:
        raise FormatError(path, "the header must be 'time,CHANNEL [UNIT],...', as in 'time,root.tx [length]'")
    return tuple(match[1] for match in found if match), tuple(match[2] for match in found if match)


def _fps_of(path: Path, times: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> float:
    steps = np.diff(times)
    if not len(steps) or steps.min() <= 0 or np.ptp(steps) > 0.01 * steps.mean():
        raise FormatError(path, f"times are not evenly spaced: add a comment line '{COMMENT}30'")
    return frame_rate(float(1 / steps.mean()), path)


def write(file: File, motion: Motion) -> None:
    """Write a table; values are kept exactly, the skeleton is not. OutputError if it cannot be written."""
    text = io.StringIO()
    text.write(f"{COMMENT}{motion.fps!r}\n")
    writer = csv.writer(text, lineterminator="\n")
    titles = (f"{name} [{unit}]" for name, unit in zip(motion.channels, motion.units, strict=True))
    writer.writerow([TIME, *titles])
    for frame, row in enumerate(motion.values.tolist()):
        writer.writerow([repr(frame / motion.fps), *map(repr, row)])
    write_whole(file, text.getvalue())
