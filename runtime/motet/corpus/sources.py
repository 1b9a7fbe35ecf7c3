"""Motion files that are named one by one, by folders, patterns or zips, and the clips in them."""

import glob
import hashlib
import re
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from motet.archives import MAX_FILE, ZipFiles, copy_bounded, is_plain_path
from motet.errors import FormatError, MotetError, MotionError
from motet.files import files_in, place_of
from motet.formats import CLIPPED, MOCAP, READABLE, clips, read_motion
from motet.formats.amc import skeleton_for
from motet.formats.text import MARK, chosen, plain_names, split_clip
from motet.motion.motion import Motion

KINDS = tuple(dict.fromkeys((*MOCAP, *CLIPPED)))
"""The extensions of what is taken of a folder or zip."""


@dataclass(frozen=True)
class Source:
    """A motion file, and which clip of it; None for the first.

    path: of the file; one in a zip has the zip's path before its own: a.zip/walks/1.bvh. place: where its result is
    written, if it is written to a file of its own. number: of the file in its corpus.
    """

    path: Path
    clip: str | None = None
    place: Path | None = None
    number: int = 0

    def __str__(self) -> str:
        return str(self.path) if self.clip is None else f"{self.path}{MARK}{self.clip}"

    @property
    def name(self) -> str:
        """What stands for ``{name}`` in the names of results."""
        return self.path.stem

    @property
    def label(self) -> str:
        """What stands for ``{clip}``: the clip's name, as a file name can have it, or the file's where it has none."""
        names, index = self._clips()
        # what the name of a file cannot have, on one system or another
        return plain_names(names, r'[<>:"/\\|?*#\x00-\x1f]|^[. ]|[. ]$')[index]

    @property
    def title(self) -> str:
        """What its result is called as a clip: the clip's name where one was asked for, else the file's."""
        names, index = self._clips()
        return self.name if self.clip is None else names[index]

    def read(self, **options: Any) -> Motion:
        """The motion, with options of :func:`motet.read`; FormatError as there, and for a damaged zip."""
        with opened(self.path) as file:
            return read_motion(file, clip=self.clip, **options)

    def hash(self) -> str:
        """SHA-256 of the file, in hex; "" where it cannot be read."""
        try:
            with opened(self.path) as file, file.open("rb") as content:
                return hashlib.file_digest(content, "sha256").hexdigest()
        except (MotetError, OSError):
            return ""

    def _clips(self) -> tuple[tuple[str, ...], int]:
        """The names of the file's clips, its own where it has none, and which of them it is."""
        try:
            with opened(self.path) as file:
                names = clips(file)
            return names, chosen(self.path, names, 1 if self.clip is None else self.clip)
        except MotetError:
            return (self.name,), 0


def files_of(given: Sequence[Path]) -> list[Path]:
    """The motion files that are meant: of folders and zips all in them, of patterns what they match, each in order of
    names. FormatError for a folder, zip or pattern without any."""
    return [file for path in given for file in _files(path)]


def _files(path: Path) -> list[Path]:
    if path.is_dir():
        found, where = files_in(path, KINDS), "are in it"
    elif url := url_of(path):
        found, where = _listed(path, url), "are there"
    elif path.suffix.lower() == ".zip" and path.is_file():
        with ZipFiles(path) as archive:
            found, where = (
                [path / name for name in archive.names if PurePosixPath(name).suffix.lower() in KINDS],
                "are in it",
            )
    elif glob.has_magic(str(path)) and not place_of(split_clip(path, READABLE)[0]).exists():
        matching = sorted(Path(path.anchor).glob(str(path.relative_to(path.anchor))))
        found, where = [one for one in matching if one.suffix.lower() in KINDS], "have such names"
    else:
        return [path]
    if not found:
        raise FormatError(path, f"no motion files ({' '.join(KINDS)}) {where}")
    return found


def sources_of(file: Path, clip: str | None = None, every: bool = False) -> list[Source]:
    """What a file holds, as its own name (a.glb#Walk) or ``clip`` says: a name, a number or "all". every: all clips
    where nothing does."""
    path, named = split_clip(file, READABLE)
    path, asked = place_of(path), "all" if every and clip is None else clip
    if named is not None or asked != "all":
        return [Source(path, asked if named is None else named)]
    try:
        with opened(path) as place:
            names = clips(place)
    except MotetError:  # it is said when the file is read
        names = ()
    return [Source(path, name) for name in names] if len(names) > 1 else [Source(path)]


@contextmanager
def opened(path: Path) -> Iterator[Path]:
    """Where a file lies; one in a zip is unpacked for as long as the context lasts, with the skeleton (.asf) that an
    .amc needs. Errors name it by its path in the zip."""
    member, url = member_of(path), url_of(path)
    if member is None and (url is None or path.exists()):
        yield path
        return
    with tempfile.TemporaryDirectory(prefix="motet-") as folder:
        if member is None:
            box = path.parent
            place = _fetched(path, str(url), Path(folder))
        else:
            box, name = member
            with ZipFiles(box) as archive:
                place = archive.unpack(name, Path(folder))
                if skeleton := _skeleton_of(name, archive.names):
                    archive.unpack(skeleton, Path(folder))
        try:
            yield place
        except MotionError as error:
            line, reason = getattr(error, "line", None), getattr(error, "reason", str(error))
            raise FormatError(path, str(reason).replace(folder, str(box)), line) from error


def member_of(path: Path) -> tuple[Path, str] | None:
    """The zip that a file is in, and its name there; None for one that is in no zip."""
    for parent in path.parents:
        if parent.suffix.lower() == ".zip" and parent.is_file():
            return parent, path.relative_to(parent).as_posix()
    return None


def _skeleton_of(name: str, names: Sequence[str]) -> str | None:
    """Which of the files ``names`` is the skeleton of an .amc, by the rule of :func:`motet.formats.amc.read`."""
    path = PurePosixPath(name)
    if path.suffix.lower() != ".amc":
        return None
    for folder in (path.parent, path.parent.parent / "asf"):
        files = [PurePosixPath(other) for other in names]
        by_stem = {file.stem: str(file) for file in files if file.parent == folder and file.suffix.lower() == ".asf"}
        if skeleton := skeleton_for(path.stem, by_stem):
            return skeleton
    return None


def size_of(file: Path) -> int:
    """Bytes of a file, or of the zip that it is in; -1 where there is none."""
    try:
        if (url := url_of(file)) and not file.exists():
            system, name = _system(file, url)
            with _fetching(file):
                return int(system.size(name))
        member = member_of(file)
        return (member[0] if member else file).stat().st_size
    except (OSError, FormatError):
        return -1


def url_of(path: Path) -> str | None:
    """The URL that a path is of, as which "s3://bucket/a.bvh" and what else fsspec knows is given; None for others."""
    found = re.fullmatch(r"([a-z][a-z0-9+.-]+):/+(.*)", path.as_posix())
    return f"{found[1]}://{found[2]}" if found else None


def _system(path: Path, url: str) -> tuple[Any, str]:
    """The file system of a URL and the name there; FormatError where fsspec lacks it."""
    try:
        import fsspec

        system, name = fsspec.core.url_to_fs(url)
        return system, str(name)
    except (ImportError, ValueError) as error:
        raise FormatError(path, f"{error}; pip install 'motet[scale]', and the package of its file system") from error


def _listed(path: Path, url: str) -> list[Path]:
    """The motion files at a URL of a folder, a pattern or one file."""
    system, name = _system(path, url)
    with _fetching(path):
        if not glob.has_magic(url) and not system.isdir(name):
            return [path]
        names = system.glob(name) if glob.has_magic(url) else system.find(name)
    shown = (Path(system.unstrip_protocol(one)) for one in sorted(names))
    return [one for one in shown if one.suffix.lower() in KINDS and one.name[0] != "."]


def _fetched(path: Path, url: str, folder: Path) -> Path:
    """A file at a URL, with the skeleton (.asf) that an .amc needs, in a folder."""
    system, name = _system(path, url)
    with _fetching(path):
        above, _, own_name = name.rpartition("/")
        files = {own_name: name}
        if path.suffix.lower() == ".amc":
            beside = {PurePosixPath(file).name: file for file in system.glob(f"{above}/*.asf")}
            if skeleton := _skeleton_of(own_name, tuple(beside)):
                files[skeleton] = beside[skeleton]
        for plain, there in files.items():
            if not is_plain_path(plain):
                raise FormatError(path, f"cannot be fetched: {plain!r} is not a plain file name")
            with system.open(there, "rb") as source, (folder / plain).open("xb") as file:
                if not copy_bounded(source, file, MAX_FILE):
                    raise FormatError(path, f"cannot be fetched: it has more than {MAX_FILE} bytes")
    return folder / own_name


@contextmanager
def _fetching(path: Path) -> Iterator[None]:
    """What is done at a URL; FormatError where that fails, for whatever reason."""
    try:
        yield
    except FormatError:
        raise
    except Exception as error:  # those of file systems share no base class
        raise FormatError(path, f"cannot be fetched: {error}") from error
