"""Files that come with requests, and reading motions from them."""

import io
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any

from motet.errors import FormatError, MotetError
from motet.formats import READABLE, read_motion
from motet.motion.motion import Motion

TAKES = tuple(extension for extension in READABLE if extension != ".amc")  # whose skeleton is another file

MAX_VALUES = 2**23
"""Frames times channels of a motion: five minutes of a hundred channels at 240 fps."""


class RequestError(MotetError, ValueError):
    """A request that asks for what there is not, or in words that are none."""


class Upload(io.BytesIO):
    """A file that came with a request; errors call it by ``name``, which never leads to a file of this machine."""

    def __init__(self, content: bytes, name: str) -> None:
        super().__init__(content)
        self.name = PurePath(name.replace("\\", "/").replace("\0", "")).name or "file"


@dataclass(frozen=True)
class Bounds:
    """Of a motion in a file: its seconds, and the bytes that an .npz unpacks to."""

    seconds: float
    unpacked: int


def read_upload(file: Upload, bounds: Bounds, options: Mapping[str, Any]) -> Motion:
    """The motion of a file that came with a request; errors like :func:`motet.read`, and FormatError for one that is
    too long, or that unpacks to much more than it is. options: of :func:`motet.read`."""
    extension = PurePath(file.name).suffix.lower()
    if extension not in TAKES:
        raise FormatError(file.name, f"cannot read files of type {extension!r}; expected one of {' '.join(TAKES)}")
    if extension == ".npz" and unpacked_bytes(file) > bounds.unpacked:
        raise FormatError(file.name, f"it unpacks to more than {bounds.unpacked} bytes")
    file.seek(0)
    motion = read_motion(file, **options)
    if motion.duration > bounds.seconds:
        raise FormatError(file.name, f"it lasts {motion.duration:.0f} s: expected at most {bounds.seconds:g} s")
    if motion.values.size > MAX_VALUES:
        shape = f"{len(motion)} frames of {len(motion.channels)} channels"
        raise FormatError(file.name, f"{shape} are too many: expected at most {MAX_VALUES} values")
    return motion


def unpacked_bytes(file: Upload) -> int:
    """How many bytes a zip archive says that its files have; 0 for a damaged one, as its reader will say."""
    try:
        with zipfile.ZipFile(file) as archive:
            return sum(info.file_size for info in archive.infolist())
    except Exception:  # of a dozen types
        return 0
