"""NPZ: all of a motion, without loss, as numpy arrays. Nothing in it is pickled.

Arrays: ``values`` (T, D) float64, ``channels`` (D,) and ``units`` (D,) text, ``fps`` float64, and ``skeleton``, the
text of the JSON object of :meth:`motet.motion.skeleton.Skeleton.to_json`, empty for a motion without skeleton.
"""

import io
import json
import math
import zipfile
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from motet.errors import FormatError
from motet.files import File, place_of, write_whole
from motet.formats.lines import frame_rate, read_bytes
from motet.motion.motion import Motion
from motet.motion.skeleton import Skeleton

KINDS = {"values": "fiu", "channels": "U", "units": "U", "fps": "fiu", "skeleton": "U"}
"""Array -> the kinds of dtype that it may have."""

MAX_BYTES = 2**29
"""Of an array, unpacked: an hour of a hundred channels at 120 frames a second, and more."""


def read(file: File) -> Motion:
    """Read a motion that :func:`write` wrote; FormatError for any other file."""
    path, content = place_of(file), read_bytes(file)
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            values, channels, units, fps, skeleton = (_array(archive, name) for name in KINDS)
        names, kinds, text = map(str, channels.tolist()), map(str, units.tolist()), str(skeleton)
        bones = Skeleton.from_json(json.loads(text)) if text else None
        return Motion(values, tuple(names), tuple(kinds), frame_rate(float(fps), path), bones)
    except FormatError:
        raise
    # a damaged archive makes zipfile, its unpackers, numpy and json raise errors of a dozen types
    except Exception as error:
        raise FormatError(path, f"not a motion that motet wrote as .npz: {str(error)[:200]}") from error


def _array(archive: zipfile.ZipFile, name: str) -> NDArray[Any]:
    """One array, whose size is known to be what the archive holds before any memory is taken for it."""
    info = archive.getinfo(f"{name}.npy")
    if info.file_size > MAX_BYTES:
        raise ValueError(f"array {name!r} has {info.file_size} bytes, and at most {MAX_BYTES} are read")
    content = archive.read(info)
    stream = io.BytesIO(content)
    headers = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}
    shape, by_columns, dtype = headers[npy.read_magic(stream)](stream)
    size = len(content) - stream.tell()
    if dtype.kind not in KINDS[name] or math.prod(shape) * dtype.itemsize != size:
        raise ValueError(f"array {name!r} of {dtype} {shape} does not fit {size} bytes, or is of the wrong type")
    return np.frombuffer(content, dtype, offset=stream.tell()).reshape(shape, order="F" if by_columns else "C")


def write(file: File, motion: Motion) -> None:
    """Write a motion; FormatError if it is too long to be read again, OutputError if it cannot be written."""
    if motion.values.nbytes >= MAX_BYTES:
        raise FormatError(place_of(file), f"{motion.values.nbytes} bytes of values are too many for one file: cut it")
    content = io.BytesIO()
    skeleton = "" if motion.skeleton is None else json.dumps(motion.skeleton.to_json())
    np.savez_compressed(
        content,
        values=motion.values,
        channels=np.array(motion.channels, dtype=np.str_),
        units=np.array(motion.units, dtype=np.str_),
        fps=np.float64(motion.fps),
        skeleton=np.str_(skeleton),
    )
    write_whole(file, content.getvalue())
