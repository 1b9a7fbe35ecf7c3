"""Writing files whole or not at all, and what stands for a file: a path, or an open binary file."""

import shutil
import uuid
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

from motet.errors import OutputError

File = str | Path | BinaryIO
"""A path, or a file object of bytes."""

Json = dict[str, Any]
"""A JSON object."""


def place_of(file: File) -> Path:
    """The path of a file, or the name by which errors call a file object."""
    if isinstance(file, str | Path):
        return Path(file)
    name = getattr(file, "name", None)
    return Path(name) if isinstance(name, str) else Path("<file object>")


def files_in(folder: Path, extensions: Collection[str]) -> list[Path]:
    """The files of some types in a folder and all below it, sorted, but for hidden ones."""
    visible = folder.rglob("[!.]*")
    return sorted(path for path in visible if path.suffix.lower() in extensions and path.is_file())


def check_place(path: str | Path) -> Path:
    """``path`` as a Path; OutputError if a file cannot be there: no such folder, or a folder or device of that name."""
    path = Path(path)
    try:
        if not path.parent.is_dir():
            raise OutputError(f"cannot write {path}: the folder {path.parent} does not exist")
        if path.is_dir():
            raise OutputError(f"cannot write {path}: it is a folder")
        if path.exists() and not path.is_file():
            raise OutputError(f"cannot write {path}: it is not a regular file")
    except OSError as error:
        raise _refusal(path, error) from error
    return path


def write_whole(file: File, content: str | bytes) -> None:
    """Write atomically: to a temporary sibling, then rename. A link is followed, the mode of a replaced file is kept.
    OutputError if the file cannot be written. A file object just gets the content."""
    try:
        # a file object is the caller's to close and to place
        data = content.encode() if isinstance(content, str) else content
        if not isinstance(file, str | Path):
            file.write(data)
            return
        with replacing(file) as temporary:
            temporary.write_bytes(data)
    except (OSError, ValueError) as error:
        raise _refusal(place_of(file), error) from error


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """A temporary sibling to write, which takes the place of ``path`` in the end, as :func:`write_whole` says; after an
    exception nothing is left of it. OutputError if it cannot be written."""
    try:
        path = check_place(path).resolve()
        temporary = temporary_beside(path)
        try:
            yield temporary
            # the mode of the file that is replaced
            if path.exists():
                shutil.copymode(path, temporary)
            temporary.replace(path)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        raise _refusal(Path(path), error) from error


@contextmanager
def new_folder(path: str | Path) -> Iterator[Path]:
    """A new folder to write into, which becomes ``path`` in the end; after an exception nothing is left of it. Missing
    parents are made. OutputError if there is something at ``path``, or it cannot be written."""
    path = Path(path)
    temporary = temporary_beside(path)
    try:
        # a link that leads nowhere does not exist, but is in the way
        if path.exists() or path.is_symlink():
            raise OutputError(f"cannot write {path}: it exists; remove it first or choose another folder")
        temporary.mkdir(parents=True)
        yield temporary
        temporary.rename(path)
    except OSError as error:
        raise _refusal(path, error) from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def temporary_beside(path: Path) -> Path:
    """A new name in the same folder, ``.NAME.HEX.partial``, short enough where the name itself is long. A killed
    program may leave such a file behind; nothing reads it."""
    stem = path.name.encode(errors="replace")[:200].decode(errors="ignore")
    return path.with_name(f".{stem}.{uuid.uuid4().hex}.partial")


def _refusal(path: Path, error: Exception) -> OutputError:
    if isinstance(error, OutputError):
        return error
    reason = error.strerror if isinstance(error, OSError) and error.strerror else error
    return OutputError(f"cannot write {path}: {reason}")
