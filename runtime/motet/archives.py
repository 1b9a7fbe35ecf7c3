"""The plain files of a zip, by name and within limits: no name in it is ever used as a path of this machine."""

import logging
import stat
import struct
import zipfile
import zlib
from contextlib import AbstractContextManager
from pathlib import Path, PurePosixPath
from typing import IO, BinaryIO

from motet.errors import FormatError

log = logging.getLogger(__name__)

MAX_TABLE = 32 << 20
"""Bytes of a zip's table of contents, which is read whole: of some 300,000 files."""

MAX_FILE = 512 << 20
"""Bytes of a file, unpacked."""

MAX_RATIO, SMALL = 100, 16 << 20
"""How many times its packed size a file may be, unpacked, if it is not small; motions as text shrink to a tenth."""

DAMAGE = (
    zipfile.BadZipFile,
    zlib.error,
    struct.error,
    OSError,
    EOFError,
    RuntimeError,
    NotImplementedError,
    ValueError,
)
"""What reading a damaged, encrypted or strangely packed file raises."""


class ZipFiles(AbstractContextManager["ZipFiles"]):
    """The files of a zip: names in their order, and each unpacked alone. FormatError for a zip that is damaged or holds
    too much.

    Left out are folders, links, hidden files, and files whose names are no plain relative paths: absolute ones, and
    those with "..", a drive, a backslash or a control character. Of two files of one name the last counts. A zip in the
    zip is a file like any other and is not opened.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            with path.open("rb") as file:
                table = _size_of_table(file)
            if table > MAX_TABLE:
                raise FormatError(path, f"it holds too many files: its table of contents has {table} bytes")
            self._zip = zipfile.ZipFile(path)
        except DAMAGE as error:
            if isinstance(error, FormatError):
                raise
            raise FormatError(path, f"not a readable zip file: {error}") from error
        members = {info.orig_filename: info for info in self._zip.infolist()}
        self._members = {name: info for name, info in members.items() if _is_plain(info)}
        self.names = tuple(sorted(name for name in self._members if not _is_hidden(name)))
        if strange := [name for name, info in members.items() if name not in self._members and not info.is_dir()]:
            log.warning("%s: left out %d files that are no plain files, such as %.80r", path, len(strange), strange[0])

    def __exit__(self, *_: object) -> None:
        self._zip.close()

    def unpack(self, name: str, folder: Path) -> Path:
        """The place of one file, unpacked below a folder. FormatError for a name that is not there, or a file that is
        damaged or unpacks to too much."""
        shown = self.path / name
        info = self._members.get(name)
        if info is None:
            raise FormatError(shown, "cannot be unpacked: there is no plain file of this name in the zip")
        limit = min(MAX_FILE, max(SMALL, MAX_RATIO * info.compress_size))
        too_large = FormatError(
            shown, f"cannot be unpacked: it has more than {limit} bytes, too many for its packed size"
        )
        if info.file_size > limit:
            raise too_large
        place = folder.joinpath(*PurePosixPath(name).parts)
        try:
            place.parent.mkdir(parents=True, exist_ok=True)
            with self._zip.open(info) as packed, place.open("xb") as file:
                copied = copy_bounded(packed, file, limit)
        except DAMAGE as error:
            raise FormatError(shown, f"cannot be unpacked: {error}") from error
        if not copied:  # the zip announced less
            place.unlink()
            raise too_large
        return place


def copy_bounded(source: IO[bytes], file: IO[bytes], limit: int) -> bool:
    """Copy a stream; False, and no more than the limit is copied, where it has more bytes."""
    left = limit
    while piece := source.read(min(1 << 20, left + 1)):
        if len(piece) > left:
            return False
        file.write(piece)
        left -= len(piece)
    return True


def _is_plain(info: zipfile.ZipInfo) -> bool:
    """Whether a member is a plain file with a plain relative path."""
    name = info.orig_filename
    mode = stat.S_IFMT(info.external_attr >> 16)
    # parts are compared with the name, so that "a//b", "a/./b" and "/a" are no second names of a file
    parts = PurePosixPath(name).parts
    relative = "/".join(parts) == name and ".." not in parts
    return relative and name.isprintable() and not {"\\", ":"} & set(name) and mode in {0, stat.S_IFREG}


def _is_hidden(name: str) -> bool:
    return any(part.startswith((".", "__MACOSX")) for part in PurePosixPath(name).parts)


def _size_of_table(file: BinaryIO) -> int:
    """Bytes of a zip's table of contents, as its end states them, by which it will be read; 0 where there is no end."""
    size = file.seek(0, 2)
    start = max(0, size - (1 << 16) - 22 - 20)
    file.seek(start)
    tail = file.read()
    end = tail.rfind(b"PK\x05\x06")
    if end < 0 or len(tail) < end + 22:
        return 0
    (table,) = struct.unpack_from("<L", tail, end + 12)
    # 64-bit zips state it in a record that a locator before the end leads to
    if tail[end - 20 : end - 16] == b"PK\x06\x07" and end >= 20:
        (place,) = struct.unpack_from("<Q", tail, end - 12)
        file.seek(min(place, size))
        record = file.read(56)
        if len(record) == 56:
            table = max(table if table != 0xFFFFFFFF else 0, struct.unpack_from("<Q", record, 40)[0])
    return int(table)
