"""Files of motion: one module per format, chosen by the extension.

A module that reads has ``read(path) -> Motion``, one that writes has ``write(path, motion)``; both raise motet's
errors and leave nothing half-written.
"""

from importlib import import_module
from pathlib import Path
from types import ModuleType

from motet.errors import FormatError
from motet.files import check_place
from motet.motion.motion import Motion

MODULES = {
    ".amc": "amc",
    ".bvh": "bvh",
    ".npz": "npz",
    ".csv": "csv",
    ".xml": "mmm",
    ".html": "html",
    ".gif": "gif",
    ".glb": "glb",
}
"""Extension -> name of the module in this package."""

BROKEN = (".amc", ".bvh")
"""Formats whose files break off in practice; their ``read`` takes ``partial``."""

READABLE = (".amc", ".bvh", ".npz", ".csv", ".xml")
WRITABLE = (".amc", ".bvh", ".npz", ".csv", ".html", ".gif", ".glb")


def read_motion(path: str | Path, partial: bool = False) -> Motion:
    """Read a motion file; FormatError for an unknown extension, a missing file or one that is no motion.

    partial: take the whole frames of a file that breaks off, which is refused otherwise.
    """
    path = Path(path)
    module = _module(path, READABLE, "read")
    if not path.is_file():
        raise FormatError(path, "no such file")
    options = {"partial": True} if partial and path.suffix.lower() in BROKEN else {}
    motion: Motion = module.read(path, **options)
    return motion


def write_motion(path: str | Path, motion: Motion) -> None:
    """Write a motion in the format of the extension; FormatError or OutputError if that is not possible."""
    check_writable(path)
    _module(Path(path), WRITABLE, "write").write(Path(path), motion)


def check_writable(path: str | Path) -> None:
    """Refuse a place that cannot be written to, or an unknown extension, before long work starts."""
    _module(Path(path), WRITABLE, "write")
    check_place(path)


def _module(path: Path, allowed: tuple[str, ...], verb: str) -> ModuleType:
    extension = path.suffix.lower()
    if extension not in allowed:
        raise FormatError(path, f"cannot {verb} files of type {extension or 'none'!r}; known are {' '.join(allowed)}")
    return import_module(f"motet.formats.{MODULES[extension]}")
