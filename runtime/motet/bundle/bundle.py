"""The bundle: a folder or zip with graphs and a manifest of everything needed to run them.

``manifest.json`` lists every other file with size and sha256; a file is checked whenever it is read, and a graph before
ONNX Runtime gets it (:mod:`motet.bundle.graph_safety`). Nothing in a bundle is pickled or executed.
docs/reference/bundle.md describes the format.
"""

import hashlib
import io
import json
import logging
import os
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from functools import partial
from importlib import resources
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from motet.bundle.fields import LARGEST_NUMBER, Json
from motet.bundle.graph import LateGraph, OnnxGraph, SessionOptions, TensorSpec
from motet.bundle.manifest import FORMAT, MANIFEST, FileEntry, Manifest
from motet.bundle.members import Archive, Folder, array_of
from motet.errors import BundleError
from motet.files import new_folder, write_whole

log = logging.getLogger(__name__)

DEFAULT_BUNDLES = Path(__file__).parents[1] / "bundles"
RENAMED = {"cmu-control": "tdbn", "cmu-generate": "language-to-motion"}
"""Names that bundles had before -> their names."""
MAX_MANIFEST = 4 << 20
"""Bytes; as JSON objects in memory they can be twenty times as many."""


class Bundle:
    """A bundle on disk, read and checked.

    path: the folder or zip, absolute.
    manifest: the contents of its ``manifest.json``.
    """

    def __init__(self, path: Path, members: Folder | Archive) -> None:
        self.path = path
        self._members = members
        if MANIFEST not in members.names:
            raise BundleError(f"{path} is not a bundle: it holds no {MANIFEST}")
        with self.named():
            self.manifest = Manifest.of_bundle(self._read(MANIFEST, MAX_MANIFEST))
            extra = sorted(members.names - self.manifest.files.keys() - {MANIFEST})
            if extra:
                raise BundleError(f"not in its manifest: {', '.join(extra)}")

    @staticmethod
    def open(name_or_path: str | Path) -> "Bundle":
        """Open a default bundle by name, or a folder or zip by path; BundleError if missing or damaged."""
        # errors name the path, once
        path = find_bundle(name_or_path)
        try:
            return Bundle(path, Folder(path) if path.is_dir() else Archive(path))
        except BundleError as error:
            raise error if str(path) in str(error) else BundleError(f"{path} is not a bundle: {error}") from error

    def __repr__(self) -> str:
        return f"Bundle({self.name!r}, {self.manifest.verb!r} by {self.manifest.loop!r}, {str(self.path)!r})"

    @property
    def name(self) -> str:
        """The bundle's own name."""
        return self.manifest.name

    def read(self, name: str) -> bytes:
        """One file's bytes, checked against the manifest's size and sha256."""
        with self.named():
            # only what the manifest lists is read
            declared = self.manifest.files.get(name)
            if declared is None:
                raise BundleError(f"{name!r} is not in its manifest")
            data = self._read(name, declared.size)
            if entry(data) != declared:
                raise BundleError(f"the file {name!r} was altered: it differs from the manifest")
            return data

    def model(self, role: str) -> bytes:
        """The ONNX model of a role that there is: its file and, behind it, that of weights which it shares with other
        graphs. As protocol buffers merge, the bytes of both are those of the whole graph."""
        return b"".join(map(self.read, self.manifest.graphs[role].files.values()))

    def graph(self, role: str, options: SessionOptions | None = None) -> OnnxGraph:
        """The graph of a role ("encoder", "step", ...), checked against its contract."""
        graph_entry = self.manifest.graphs.get(role)
        with self.named(f", {role} graph"):
            if graph_entry is None:
                raise BundleError("there is none")
            graph = OnnxGraph(self.model(role), graph_entry.spec, options)
        log.info("made the %s graph of %s on %s", role, self.path, ", ".join(graph.providers))
        return graph

    def late_graph(self, role: str, options: SessionOptions | None = None) -> LateGraph:
        """As :meth:`graph`, for a role that there is: read, checked and made when it is first called. BundleError now
        where its file is missing."""
        with self.named(f", {role} graph"):
            for name in self.manifest.graphs[role].files.values():
                self._find(name)
        return LateGraph(self.manifest.graphs[role].spec, partial(self.graph, role, options))

    def late_tables(self) -> "Tables":
        """All tables by name, each read and checked when it is first used. BundleError now where a file is missing."""
        for name, table_entry in self.manifest.tables.items():
            with self.named(f", table {name}"):
                self._find(table_entry.file)
        return Tables(self)

    def table(self, name: str) -> NDArray[Any]:
        """A table's array, read-only; BundleError if it differs from its declaration or is not finite."""
        table_entry = self.manifest.tables[name]
        with self.named(f", table {name}"):
            array = array_of(self.read(table_entry.file), table_entry.file, [table_entry.dtype])
            if array.shape != table_entry.shape:
                raise BundleError(f"its shape is {list(array.shape)}, declared as {list(table_entry.shape)}")
            if (
                array.dtype.kind == "f"
                and not -LARGEST_NUMBER <= float(array.min()) <= float(array.max()) <= LARGEST_NUMBER
            ):
                raise BundleError(f"some numbers are not between -{LARGEST_NUMBER:g} and {LARGEST_NUMBER:g}")
            return array

    def check_files(self) -> list[str]:
        """Read every file listed in the manifest and return their names; BundleError at the first fault."""
        for name in self.manifest.files:
            self.read(name)
        return sorted(self.manifest.files)

    def pack(self, path: str | Path) -> None:
        """Write the bundle as one zip: the same bytes for the same bundle. Checks every file first."""
        files = {name: self.read(name) for name in sorted(self.manifest.files)}
        write_whole(path, archive_bytes({MANIFEST: self._read(MANIFEST, MAX_MANIFEST), **files}))

    def named(self, where: str = "") -> AbstractContextManager[None]:
        """Name the bundle in every error raised within."""
        return named(self.path, where)

    def _find(self, name: str) -> None:
        if name not in self._members.names:
            raise BundleError(f"the file {name!r} is missing")

    def _read(self, name: str, limit: int) -> bytes:
        self._find(name)
        data = self._members.read(name, limit)
        if len(data) > limit:
            raise BundleError(f"the file {name!r} was altered: it has more than {limit} bytes")
        return data


class Tables(Mapping[str, NDArray[Any]]):
    """The tables of a bundle by name, read-only arrays; BundleError like :meth:`Bundle.table` at first use."""

    def __init__(self, bundle: Bundle) -> None:
        self._bundle = bundle
        self._read: dict[str, NDArray[Any]] = {}

    def __getitem__(self, name: str) -> NDArray[Any]:
        if name not in self._read:
            self._read[name] = self._bundle.table(name)
        return self._read[name]

    def __contains__(self, name: object) -> bool:
        return name in self._bundle.manifest.tables

    def __iter__(self) -> Iterator[str]:
        return iter(self._bundle.manifest.tables)

    def __len__(self) -> int:
        return len(self._bundle.manifest.tables)

    def declared(self, name: str) -> TensorSpec:
        """The shape and dtype of a table, which is not read for it; those of an array that is read are the same."""
        table_entry = self._bundle.manifest.tables[name]
        return TensorSpec(name, table_entry.shape, table_entry.dtype)


@contextmanager
def named(path: Path, where: str = "") -> Iterator[None]:
    """Name the bundle of a path in every error raised within."""
    try:
        yield
    except BundleError as error:
        names_bundle = str(error).startswith(f"bundle {path}")
        raise error if names_bundle else BundleError(f"bundle {path}{where}: {error}") from error


def find_bundle(name_or_path: str | Path) -> Path:
    """Path of an installed bundle's name or of an existing folder or zip; BundleError lists the known names."""
    name = str(name_or_path)
    # motet's own first: the others need a look through all installed packages
    known = {path.stem: path for path in DEFAULT_BUNDLES.glob("*.zip")}
    if name in known or name in (known := list_bundles()):
        return known[name]
    try:
        path = Path(os.path.abspath(name_or_path))  # noqa: PTH100 - resolve() follows links, and raises where they loop
        if path.is_dir() or path.is_file():
            return path
        fault = "neither a folder nor a file" if path.exists() else "no such path"
    except (OSError, TypeError, ValueError) as error:
        fault = str(error)
    if name in RENAMED:
        raise BundleError(f"the bundle {name!r} is {RENAMED[name]!r} now")
    raise BundleError(f"unknown bundle {name!r}: {fault}; expected one of {', '.join(known)}")


def list_bundles() -> dict[str, Path]:
    """The installed bundles by name: motet's own, and those of packages with an entry point ``motet.bundles``."""
    folders = [DEFAULT_BUNDLES]
    for point in entry_points(group="motet.bundles"):
        try:
            folders.append(Path(str(resources.files(point.value))))
        except ImportError as error:
            log.info("the bundles of %s are left out: %s", point.value, error)
    # motet's own come last, and so replace others of their names
    paths: dict[str, Path] = {}
    for folder in reversed(folders):
        for path in folder.glob("*.zip"):
            paths[path.stem] = path
    return dict(sorted(paths.items()))


def entry(data: bytes) -> FileEntry:
    """A file's entry in a manifest."""
    return FileEntry(len(data), hashlib.sha256(data).hexdigest())


def write_bundle(path: str | Path, manifest: Json, files: Mapping[str, bytes]) -> None:
    """Write a bundle as one zip (a path that ends in .zip) or as a new folder, with sizes and sha256 filled in.

    BundleError for a manifest that could not be read back.
    """
    path = Path(path)
    # in the order of names, so that equal bundles are equal bytes
    files = dict(sorted(files.items()))
    entries = {name: entry(data)._asdict() for name, data in files.items()}
    text = (json.dumps({"format": FORMAT, **manifest, "files": entries}, indent=1) + "\n").encode()
    # refuse a manifest that could not be read back
    Manifest.of_bundle(text)
    if path.suffix == ".zip":
        write_whole(path, archive_bytes({MANIFEST: text, **files}))
        return
    with new_folder(path) as folder:
        for name, data in {**files, MANIFEST: text}.items():
            write_whole(folder / name, data)


def archive_bytes(files: Mapping[str, bytes]) -> bytes:
    """A zip of files in their order, with fixed dates so that equal content gives equal bytes."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            info = zipfile.ZipInfo(name, date_time=(1980, 1, 1, 0, 0, 0))
            info.compress_type = zipfile.ZIP_DEFLATED
            info.external_attr = 0o644 << 16
            archive.writestr(info, data)
    return buffer.getvalue()
