"""Writing files whole or not at all."""

import shutil
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from motet.errors import MotetError, OutputError


def check_place(path: str | Path) -> Path:
    """``path`` as a Path; OutputError if a file cannot be there: no such folder, or a folder of that name."""
    path = Path(path)
    if not path.parent.is_dir():
        raise OutputError(f"cannot write {path}: the folder {path.parent} does not exist")
    if path.is_dir():
        raise OutputError(f"cannot write {path}: it is a folder")
    return path


def write_whole(path: str | Path, content: str | bytes) -> None:
    """Write a file beside its place and move it there, so that nobody ever sees half of it."""
    path = check_place(path)
    temporary = path.with_name(f".{path.name}.{uuid.uuid4().hex}")
    try:
        temporary.write_bytes(content.encode() if isinstance(content, str) else content)
        temporary.replace(path)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        raise OutputError(f"cannot write {path}: {error.strerror}") from error


@contextmanager
def new_folder(path: str | Path) -> Iterator[Path]:
    """A new folder to write into, which becomes ``path`` in the end; after an exception nothing is left of it.

    Missing parents are made. OutputError if there is something at ``path``, or it cannot be written.
    """
    path = Path(path)
    if path.exists() or path.is_symlink():
        raise OutputError(f"cannot write {path}: it exists; remove it first or choose another folder")
    temporary = path.with_name(f".{path.name}.{uuid.uuid4().hex}")
    try:
        temporary.mkdir(parents=True)
        yield temporary
        temporary.rename(path)
    except MotetError:
        raise
    except OSError as error:
        raise OutputError(f"cannot write {path}: {error}") from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
