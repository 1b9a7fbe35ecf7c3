"""The files of folders and zips, which are never unpacked as a whole."""

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path, PurePosixPath

from motet.corpus.archives import ZipFiles
from motet.errors import FormatError, MotionError
from motet_train.data.errors import DataError

BROKEN = (MotionError, DataError, OSError)
"""What reading a damaged file can raise."""


class Archive(ExitStack):
    """The files of folders and zips by name, such as "amc/01_02.amc", as if they were one; a context manager.

    Of two files of one name the one in the later place counts. Hidden files are left out. DataError for a place that is
    neither a folder nor a zip.
    """

    def __init__(self, *paths: Path) -> None:
        super().__init__()
        self._sources: dict[str, tuple[Path, ZipFiles | None]] = {}
        with ExitStack() as stack:
            for path in paths:
                if path.is_dir():
                    files = (file.relative_to(path).as_posix() for file in path.rglob("*") if file.is_file())
                    self._sources |= dict.fromkeys(files, (path, None))
                else:
                    opened = stack.enter_context(_opened(path))
                    self._sources |= dict.fromkeys(opened.names, (path, opened))
            self._borrowed = len(paths) == 1 and paths[0].is_dir()
            self._folder = paths[0]
            if not self._borrowed:
                self._folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="motet-")))
            self.enter_context(stack.pop_all())
        hidden = (".", "__MACOSX")
        shown = (n for n in self._sources if not any(part.startswith(hidden) for part in PurePosixPath(n).parts))
        self.names = tuple(sorted(shown))

    def origin(self, name: str) -> Path:
        """A file's path for errors, with its folder or zip."""
        return self._sources[name][0] / name

    def place(self, name: str) -> Path:
        """Where a file lies; one of a zip or of several places is copied to one folder, and stays until the end.

        A damaged one raises an error of BROKEN.
        """
        place, (path, opened) = self._folder / name, self._sources[name]
        if self._borrowed:
            return place
        if opened is not None:
            return opened.unpack(name, self._folder)
        place.parent.mkdir(parents=True, exist_ok=True)
        return Path(shutil.copyfile(path / name, place))

    def reason(self, error: Exception) -> str:
        """What an error says, with files named as in the archive."""
        return str(error).replace(f"{self._folder}/", "")

    @contextmanager
    def opened(self, name: str) -> Iterator[Path]:
        """Where a file lies, for as long as the context lasts."""
        place = self.place(name)
        try:
            yield place
        finally:
            if not self._borrowed:
                place.unlink()


def _opened(path: Path) -> ZipFiles:
    if not path.exists():
        raise DataError(f"no such corpus: {path}")
    try:
        return ZipFiles(path)
    except FormatError as error:
        raise DataError(f"{path} is neither a folder nor a readable zip file: {error.reason}") from error
