"""The bundle: a folder or zip with graphs and a manifest that says everything needed to run them.

``manifest.json`` lists every other file with size and sha256; a file is checked whenever it is read, and handed to
ONNX Runtime as bytes. Nothing in a bundle is pickled or executed. docs/bundle.md describes the format.
"""

import hashlib
import io
import json
import stat
import zipfile
from collections.abc import Mapping
from pathlib import Path, PurePosixPath
from typing import Any

from motet.bundle.graph import GraphSpec, OnnxGraph
from motet.errors import BundleError
from motet.files import write_whole

FORMAT = 1
"""Version of the bundle format that this motet writes and reads."""

MANIFEST = "manifest.json"
DEFAULT_BUNDLES = Path(__file__).parents[1] / "bundles"
MAX_FILE = 1 << 30
"""Bytes; a larger file in a bundle is refused before it is unpacked."""


class Bundle:
    """What lies on disk, read and checked.

    path: the folder or zip.
    manifest: the parsed ``manifest.json``.
    """

    def __init__(self, path: Path, members: Mapping[str, Any]) -> None:
        self.path = path
        self._members = members
        self.manifest = self._read_manifest()

    @staticmethod
    def open(name_or_path: str | Path) -> "Bundle":
        """Open a default bundle by name, or a folder or zip by path; BundleError if there is none."""
        path = find_bundle(name_or_path)
        return Bundle(path, _zip_members(path) if path.is_file() else _folder_members(path))

    @property
    def name(self) -> str:
        """The bundle's own name."""
        return str(self.manifest["name"])

    def read(self, name: str) -> bytes:
        """One file's bytes, after size and sha256 were found to be those of the manifest."""
        declared = self.manifest["files"].get(name)
        if declared is None:
            raise BundleError(f"bundle {self.path}: {name!r} is not in its manifest")
        if name not in self._members:
            raise BundleError(f"bundle {self.path}: the file {name!r} is missing")
        data = self._fetch(name)
        if len(data) != declared["size"] or hashlib.sha256(data).hexdigest() != declared["sha256"]:
            raise BundleError(f"bundle {self.path}: the file {name!r} was altered: it is not what the manifest lists")
        return data

    def graph(self, role: str, threads: int = 1) -> OnnxGraph:
        """The graph of a role ("encoder", "step"), checked against its contract."""
        entry = self.manifest["graphs"].get(role)
        if entry is None:
            raise BundleError(f"bundle {self.path} has no graph for the role {role!r}")
        try:
            return OnnxGraph(self.read(entry["file"]), GraphSpec.from_json(entry), threads)
        except (BundleError, KeyError, TypeError) as error:
            raise BundleError(f"bundle {self.path}, {role} graph: {error}") from error

    def verify(self) -> list[str]:
        """Check every file and load every graph; returns the names of the files. BundleError at the first fault."""
        extra = sorted(self._members.keys() - self.manifest["files"].keys() - {MANIFEST})
        if extra:
            raise BundleError(f"bundle {self.path}: not in its manifest: {', '.join(extra)}")
        for name in self.manifest["files"]:
            self.read(name)
        for role in self.manifest["graphs"]:
            self.graph(role)
        return sorted(self.manifest["files"])

    def pack(self, path: str | Path) -> None:
        """Write the bundle as one zip: the same bytes for the same bundle. Checks every file first."""
        write_whole(path, zip_bytes({name: self.read(name) for name in self.verify()}, self._fetch(MANIFEST)))

    def _fetch(self, name: str) -> bytes:
        member = self._members[name]
        if isinstance(member, Path):
            if member.stat().st_size > MAX_FILE:
                raise BundleError(f"bundle {self.path}: {name!r} is larger than {MAX_FILE} bytes")
            return member.read_bytes()
        try:
            with zipfile.ZipFile(self.path) as archive:
                return archive.read(member)
        except (zipfile.BadZipFile, OSError, RuntimeError) as error:
            raise BundleError(f"bundle {self.path}: cannot read {name!r}: {error}") from error

    def _read_manifest(self) -> dict[str, Any]:
        if MANIFEST not in self._members:
            raise BundleError(f"{self.path} is no bundle: it holds no {MANIFEST}")
        try:
            manifest = json.loads(self._fetch(MANIFEST))
        except ValueError as error:
            raise BundleError(f"bundle {self.path}: {MANIFEST} is no JSON: {error}") from error
        version = manifest.get("format") if isinstance(manifest, dict) else None
        if version != FORMAT:
            raise BundleError(f"bundle {self.path} has format {version!r}; this motet reads format {FORMAT}")
        lacking = {"name", "verb", "model", "files", "graphs", "motion"} - manifest.keys()
        if lacking:
            raise BundleError(f"bundle {self.path}: its manifest lacks {', '.join(sorted(lacking))}")
        return dict(manifest)


def find_bundle(name_or_path: str | Path) -> Path:
    """Path of a default bundle's name or of an existing folder or zip; BundleError lists the known names."""
    known = list_bundles()
    if str(name_or_path) in known:
        return known[str(name_or_path)]
    path = Path(name_or_path)
    if not path.exists():
        raise BundleError(f"unknown bundle {str(name_or_path)!r}: no such path, and known names are {', '.join(known)}")
    return path


def list_bundles() -> dict[str, Path]:
    """The bundles that come with motet, by name."""
    return {path.stem: path for path in sorted(DEFAULT_BUNDLES.iterdir()) if path.suffix == ".zip"}


def write_bundle(path: str | Path, manifest: Mapping[str, Any], files: Mapping[str, bytes]) -> None:
    """Write a bundle as one zip (a path that ends in .zip) or as a new folder, with sizes and sha256 filled in."""
    path = Path(path)
    entries = {name: {"sha256": hashlib.sha256(data).hexdigest(), "size": len(data)} for name, data in files.items()}
    text = json.dumps({"format": FORMAT, **manifest, "files": entries}, indent=1) + "\n"
    if path.suffix == ".zip":
        write_whole(path, zip_bytes(files, text.encode()))
        return
    if path.exists():
        raise BundleError(f"cannot write the bundle {path}: it exists; remove it first or choose another name")
    temporary = path.with_name(f".{path.name}.partial")
    temporary.mkdir(parents=True)
    for name, data in {**files, MANIFEST: text.encode()}.items():
        write_whole(temporary / name, data)
    temporary.rename(path)


def zip_bytes(files: Mapping[str, bytes], manifest: bytes) -> bytes:
    """The zip of a bundle, the manifest first, with fixed dates so that equal content gives equal bytes."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in {MANIFEST: manifest, **{name: files[name] for name in sorted(files)}}.items():
            info = zipfile.ZipInfo(name, date_time=(1980, 1, 1, 0, 0, 0))
            info.compress_type = zipfile.ZIP_DEFLATED
            info.external_attr = 0o644 << 16
            archive.writestr(info, data)
    return buffer.getvalue()


def _folder_members(path: Path) -> dict[str, Path]:
    members = {}
    for member in sorted(path.iterdir()):
        if member.is_symlink() or not member.is_file():
            raise BundleError(f"bundle {path}: {member.name!r} is not a plain file")
        members[member.name] = member
    return members


def _zip_members(path: Path) -> dict[str, zipfile.ZipInfo]:
    try:
        with zipfile.ZipFile(path) as archive:
            infos = archive.infolist()
    except (zipfile.BadZipFile, OSError) as error:
        raise BundleError(f"{path} is no bundle: not a zip that can be read ({error})") from error
    members: dict[str, zipfile.ZipInfo] = {}
    for info in infos:
        if PurePosixPath(info.filename).name != info.filename or "\\" in info.filename or info.is_dir():
            raise BundleError(f"bundle {path}: {info.filename!r} is not a plain file name")
        if stat.S_ISLNK(info.external_attr >> 16) or info.filename in members or info.file_size > MAX_FILE:
            raise BundleError(f"bundle {path}: {info.filename!r} is a link, stands there twice or is too large")
        members[info.filename] = info
    return members
