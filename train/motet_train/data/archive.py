"""The files of a folder or of a zip, which is never unpacked as a whole."""

import tempfile
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path, PurePosixPath
from types import TracebackType
from typing import Self

from motet.errors import MotionError
from motet_train.data.errors import DataError

BROKEN = (MotionError, DataError, OSError, zipfile.BadZipFile, zlib.error, RuntimeError)
"""What reading a damaged file can raise; RuntimeError is zipfile's for an encrypted one."""


class Archive:
    """The files of a folder or a zip by name, as "amc/01_02.amc"; a context manager.

    Hidden files are left out. DataError for a place that is neither a folder nor a zip.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._stack = ExitStack()
        self._zip: zipfile.ZipFile | None = None
        if path.is_dir():
            self._folder = path
            names = [file.relative_to(path).as_posix() for file in path.rglob("*") if file.is_file()]
        else:
            self._zip = self._stack.enter_context(_opened(path))
            self._folder = Path(self._stack.enter_context(tempfile.TemporaryDirectory(prefix="motet-")))
            names = [name for name in self._zip.namelist() if not name.endswith("/")]
        self.names = tuple(sorted(name for name in names if not _hidden(name)))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stack.close()

    def place(self, name: str) -> Path:
        """Where a file lies; one of a zip is unpacked first and stays until the archive is closed.

        A damaged one raises an error of BROKEN.
        """
        return self._folder / name if self._zip is None else Path(self._zip.extract(name, self._folder))

    def reason(self, error: Exception) -> str:
        """What an error says, with files named as in the archive."""
        return str(error).replace(f"{self._folder}/", "")

    @contextmanager
    def opened(self, name: str) -> Iterator[Path]:
        """Where a file lies as long as the context lasts."""
        place = self.place(name)
        try:
            yield place
        finally:
            if self._zip is not None:
                place.unlink()


def _opened(path: Path) -> zipfile.ZipFile:
    if not path.exists():
        raise DataError(f"no such corpus: {path}")
    try:
        return zipfile.ZipFile(path)
    except (zipfile.BadZipFile, OSError) as error:
        raise DataError(f"{path} is neither a folder nor a readable zip file: {error}") from error


def _hidden(name: str) -> bool:
    return any(part.startswith((".", "__MACOSX")) for part in PurePosixPath(name).parts)
