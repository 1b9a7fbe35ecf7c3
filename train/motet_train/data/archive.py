"""Read files from folders and zips; zips are never unpacked as a whole."""

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path, PurePosixPath

from motet.corpus.archives import ZipFiles
from motet.errors import FormatError, MotionError
from motet_train.data.errors import DataError

BROKEN = (MotionError, DataError, OSError)
"""Errors that reading a damaged file can raise."""


class Archive(ExitStack):
    """The files of several folders and zips as one tree, by relative names such as "amc/01_02.amc"; a context manager.

    A file in a later place replaces one of the same name in an earlier place. Hidden files are left out. DataError for
    a place that is neither a folder nor a zip.
    """

    def __init__(self, *paths: Path) -> None:
        super().__init__()
        self._sources: dict[str, tuple[Path, ZipFiles | None]] = {}
        # if a later place cannot be opened, the stack closes those before it
        with ExitStack() as stack:
            for path in paths:
                if path.is_dir():
                    for file in path.rglob("*"):
                        if file.is_file():
                            self._sources[file.relative_to(path).as_posix()] = (path, None)
                else:
                    zip_files = stack.enter_context(_opened(path))
                    self._sources |= dict.fromkeys(zip_files.names, (path, zip_files))
            self._borrowed = len(paths) == 1 and paths[0].is_dir()
            self._folder = paths[0]
            if not self._borrowed:
                self._folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="motet-")))
            self.enter_context(stack.pop_all())
        self.names = tuple(sorted(name for name in self._sources if not _is_hidden(name)))

    def origin(self, name: str) -> Path:
        """The path of a file, inside its folder or zip, for error messages."""
        return self._sources[name][0] / name

    def place(self, name: str) -> Path:
        """The path of a file on disk; unless the archive is a single folder, a copy that lasts as long as the archive.

        A damaged file raises one of BROKEN.
        """
        place = self._folder / name
        if self._borrowed:
            return place
        path, zip_files = self._sources[name]
        if zip_files is not None:
            return zip_files.unpack(name, self._folder)
        place.parent.mkdir(parents=True, exist_ok=True)
        return Path(shutil.copyfile(path / name, place))

    def reason(self, error: Exception) -> str:
        """The text of an error, with files named as in the archive."""
        return str(error).replace(f"{self._folder}/", "")

    @contextmanager
    def opened(self, name: str) -> Iterator[Path]:
        """The path of a file on disk; a copy is deleted at the end of the context."""
        place = self.place(name)
        try:
            yield place
        finally:
            if not self._borrowed:
                place.unlink()


def _is_hidden(name: str) -> bool:
    return any(part.startswith((".", "__MACOSX")) for part in PurePosixPath(name).parts)


def _opened(path: Path) -> ZipFiles:
    if not path.exists():
        raise DataError(f"no such corpus: {path}")
    try:
        return ZipFiles(path)
    except FormatError as error:
        raise DataError(f"{path} is neither a folder nor a readable zip file: {error.reason}") from error
