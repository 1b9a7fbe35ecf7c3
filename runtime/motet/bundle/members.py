"""The files of a folder or zip, read within limits: nothing unannounced is unpacked, unpickled or executed."""

import io
import math
import re
import stat
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from motet.errors import BundleError

MAX_FILES = 64
MAX_SIZE = 256 << 20
"""Files of a bundle, and bytes of all of them together."""

NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,127}")
"""A plain file name on every system."""


_DAMAGE = (zipfile.BadZipFile, zlib.error, struct.error, OSError, EOFError, RuntimeError, ValueError, OverflowError)
"""What reading a damaged file raises."""


class Folder:
    """The files of a folder; BundleError where something in it is not a plain file, or too much."""

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            # no member is followed or opened before all are known to be plain files
            states = {member.name: member.lstat() for member in path.iterdir()}
        except OSError as error:
            raise BundleError(f"cannot read the folder: {error.strerror}") from error
        _check({name: state.st_size for name, state in states.items()})
        for name, state in states.items():
            if not stat.S_ISREG(state.st_mode):
                raise BundleError(f"{name!r} is not a plain file")
        self.names = frozenset(states)

    def read(self, name: str, limit: int) -> bytes:
        """One file's bytes, the first ``limit`` + 1 of them where it is longer; BundleError where it cannot be read."""
        try:
            with (self._path / name).open("rb") as file:
                return file.read(limit + 1)
        except OSError as error:
            raise BundleError(f"cannot read {name!r}: {error.strerror}") from error


class Archive:
    """The files of a zip, given by its path or as bytes; BundleError if it is damaged or unsafe."""

    def __init__(self, source: Path | bytes) -> None:
        self._source = source
        # the table of contents is checked before any member is unpacked
        infos = self._contents()
        _check({info.orig_filename: info.file_size for info in infos})
        for info in infos:
            _check_member(info)
        self._infos = {info.filename: info for info in infos}
        if len(self._infos) != len(infos):
            raise BundleError("the zip contains a file twice")
        self.names = frozenset(self._infos)

    def _contents(self) -> list[zipfile.ZipInfo]:
        """The table of contents; BundleError before it is read if it is that of more files than a bundle has."""
        try:
            with self._file() as file:
                file.seek(max(0, file.seek(0, io.SEEK_END) - 42))
                end = file.read()
                if end[-22:-18] != b"PK\x05\x06" or end[:4] == b"PK\x06\x07":
                    raise zipfile.BadZipFile("its end is not that of a plain zip")
                # the end says how many bytes the table of contents has
                if int.from_bytes(end[-10:-6], "little") <= MAX_FILES * 1024:
                    return zipfile.ZipFile(file).infolist()
        except _DAMAGE as error:
            raise BundleError(f"not a zip that can be read ({error})") from error
        raise BundleError(f"it holds too many files; a bundle has at most {MAX_FILES}")

    def read(self, name: str, limit: int) -> bytes:
        """As :meth:`Folder.read`; the limit holds whatever size the zip announces."""
        try:
            with self._file() as source, zipfile.ZipFile(source) as archive, archive.open(self._infos[name]) as file:
                return file.read(limit + 1)
        except _DAMAGE as error:
            raise BundleError(f"cannot read {name!r}: {error}") from error

    def _file(self) -> BinaryIO:
        return io.BytesIO(self._source) if isinstance(self._source, bytes) else self._source.open("rb")


def _check_member(info: zipfile.ZipInfo) -> None:
    """BundleError for a link or a device, another compression than deflate, and for a bomb."""
    if stat.S_IFMT(info.external_attr >> 16) not in {0, stat.S_IFREG}:
        raise BundleError(f"{info.filename!r} is not a plain file")
    if info.compress_type not in {zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED} or info.flag_bits & 1:
        raise BundleError(f"{info.filename!r} is encrypted, or not compressed with deflate")
    if info.file_size > max(1 << 20, 100 * info.compress_size):  # weights hardly shrink; a bomb does by 1000
        raise BundleError(f"{info.filename!r} unpacks to more than 100 times its size")


def _check(sizes: Mapping[str, int]) -> None:
    if len(sizes) > MAX_FILES:
        raise BundleError(f"it holds {len(sizes)} files; a bundle has at most {MAX_FILES}")
    for name in sizes:
        if not NAME.fullmatch(name):
            raise BundleError(f"{name[:80]!r} is not a plain file name")
    if sum(sizes.values()) > MAX_SIZE:
        raise BundleError(f"its files total more than {MAX_SIZE} bytes")


def array_of(content: bytes, name: str, dtypes: Collection[str]) -> NDArray[Any]:
    """The array of a .npy file called ``name``, read-only; the dtypes that it may have are named as in "float32".

    BundleError for another version or dtype, Fortran order, a header of more than 10,000 bytes, or bytes that are
    lacking or left over.
    """
    file = io.BytesIO(content)
    try:
        # the bytes after the header must be those that it announces
        version = np.lib.format.read_magic(file)
        shape, fortran, dtype = np.lib.format.read_array_header_1_0(file)
        start = file.tell()
        known = dtype.name in dtypes and dtype.isnative
        if version != (1, 0) or fortran or not known or math.prod(shape) * dtype.itemsize != len(content) - start:
            raise ValueError(f"expected {' or '.join(dtypes)} in C order, and nothing after it")
        return np.frombuffer(content, dtype, offset=start).reshape(shape)
    except (*_DAMAGE, SyntaxError, TypeError, tokenize.TokenError, MemoryError) as error:
        raise BundleError(f"{name!r} is not a plain array: {error}") from error


def array_bytes(array: NDArray[Any]) -> bytes:
    """An array as a .npy file."""
    buffer = io.BytesIO()
    np.lib.format.write_array(buffer, np.ascontiguousarray(array), (1, 0), allow_pickle=False)
    return buffer.getvalue()
