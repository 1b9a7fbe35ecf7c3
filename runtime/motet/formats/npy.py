"""Arrays from an untrusted .npz file: sizes are checked before use, and nothing is unpickled."""

import io
import math
import zipfile
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

NPY_MAX_BYTES = 2**29
"""Bytes of an unpacked array: over an hour of a hundred channels at 120 fps."""


def array(archive: zipfile.ZipFile, name: str, kinds: str) -> NDArray[Any]:
    """One array of the given kinds of dtype; its declared size is checked against the archive before allocation.

    KeyError if there is none of that name, ValueError if it is too large, of another type or does not fit its size;
    a damaged archive makes zipfile and its unpackers raise errors of a dozen types.
    """
    info = archive.getinfo(f"{name}.npy")
    if info.file_size > NPY_MAX_BYTES:
        raise ValueError(f"array {name!r} has {info.file_size} bytes: expected at most {NPY_MAX_BYTES}")
    content = archive.read(info)
    stream = io.BytesIO(content)
    headers = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}
    shape, by_columns, dtype = headers[npy.read_magic(stream)](stream)
    size = len(content) - stream.tell()
    if dtype.kind not in kinds or math.prod(shape) * dtype.itemsize != size:
        raise ValueError(f"array {name!r} of {dtype} {shape} does not fit {size} bytes, or is of the wrong type")
    if dtype.kind == "U" and not _is_text(np.frombuffer(content, f"{dtype.byteorder}u4", offset=stream.tell())):
        raise ValueError(f"array {name!r} holds invalid characters")
    return np.frombuffer(content, dtype, offset=stream.tell()).reshape(shape, order="F" if by_columns else "C")


def _is_text(points: NDArray[np.uint32]) -> bool:
    """Whether all are code points of Unicode: numpy makes strings of others too, but they cannot be printed."""
    return bool(((points < 0xD800) | ((points > 0xDFFF) & (points <= 0x10FFFF))).all())
