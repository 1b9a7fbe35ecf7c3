"""The plain files of a zip, by name and within limits: no name in it is ever used as a path of this machine."""

import io
import logging
import stat
import struct
import zipfile
import zlib
from contextlib import AbstractContextManager, ExitStack
from pathlib import Path
from typing import IO

from motet.errors import FormatError

log = logging.getLogger(__name__)

MAX_TABLE = 16 << 20
"""Bytes of a zip's table of contents, which is read whole: of some 150,000 files."""

MAX_FILE = 512 << 20
"""Bytes of a file, unpacked."""

MAX_RATIO = 100
SMALL_FILE = 16 << 20
"""How many times its packed size a file may be, unpacked, if it is not small; motions as text shrink to a tenth."""

ARCHIVE_ERRORS = (
    zipfile.BadZipFile,
    zlib.error,
    struct.error,
    OSError,
    EOFError,
    RuntimeError,
    ValueError,
)
"""What reading a damaged, encrypted or strangely packed file raises."""


class _Bounded(io.BufferedReader):
    """A zip's bytes. zipfile reads a table of contents in one piece, whose size it takes from one of three places: what
    is refused is a piece that is too long, wherever its size was stated."""

    def read(self, size: int | None = -1, /) -> bytes:
        if size is not None and size > MAX_TABLE:
            more = f"{size} bytes, more than {MAX_TABLE}"
            raise zipfile.BadZipFile(f"it holds too many files: unpack it (its table of contents has {more})")
        return super().read(size)


class ZipFiles(AbstractContextManager["ZipFiles"]):
    """The files of a zip: names in their order, and each unpacked alone. FormatError for a zip that is damaged or holds
    too much.

    Left out are folders, links, hidden files, and files whose names are no plain relative paths: absolute ones, and
    those with "..", a drive, a backslash or a control character. Of two files of one name the last counts. A zip in the
    zip is a file like any other and is not opened.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        with ExitStack() as stack:
            try:
                file = stack.enter_context(_Bounded(io.FileIO(path)))
                self._zip = stack.enter_context(zipfile.ZipFile(file))
            except ARCHIVE_ERRORS as error:
                raise FormatError(path, f"not a readable zip file: {error}") from error
            self._open = stack.pop_all()
        members = {info.orig_filename: info for info in self._zip.infolist()}
        self._members = {name: info for name, info in members.items() if _is_plain(info)}
        self.names = tuple(sorted(name for name in self._members if not _is_hidden(name)))
        if strange := [name for name in members if name not in self._members and not name.endswith("/")]:
            log.warning("%s: left out %d files that are no plain files, such as %.80r", path, len(strange), strange[0])

    def __exit__(self, *_: object) -> None:
        self._open.close()

    def unpack(self, name: str, folder: Path) -> Path:
        """The place of one file, unpacked below a folder. FormatError for a name that is not there, or a file that is
        damaged or unpacks to too much."""
        shown = self.path / name
        info = self._members.get(name)
        if info is None:
            raise FormatError(shown, "cannot be unpacked: there is no plain file of this name in the zip")
        limit = min(MAX_FILE, max(SMALL_FILE, MAX_RATIO * info.compress_size))
        too_large = FormatError(
            shown, f"cannot be unpacked: it has more than {limit} bytes, too many for its packed size"
        )
        if info.file_size > limit:
            raise too_large
        place = folder.joinpath(*name.split("/"))
        try:
            place.parent.mkdir(parents=True, exist_ok=True)
            with self._zip.open(info) as packed, place.open("wb") as file:
                copied = copy_bounded(packed, file, limit)
        except ARCHIVE_ERRORS as error:
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
    mode = stat.S_IFMT(info.external_attr >> 16)
    return is_plain_path(info.orig_filename) and mode in {0, stat.S_IFREG}


def is_plain_path(name: str) -> bool:
    """Whether a name is a relative path that stays below wherever it is put, on every system."""
    # also "a//b", "a/./b" and "/a", which would be second names of a file, have a part that is none
    plain = not {"", ".", ".."} & set(name.split("/"))
    return plain and name.isprintable() and "\\" not in name and ":" not in name


def _is_hidden(name: str) -> bool:
    return any(part.startswith((".", "__MACOSX")) for part in name.split("/"))
