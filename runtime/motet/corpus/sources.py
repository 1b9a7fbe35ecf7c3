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

from motet.corpus.archives import MAX_FILE, ZipFiles, copy_bounded, is_plain_path
from motet.errors import FormatError, MotetError, MotionError
from motet.files import files_in, place_of
from motet.formats import OF_FOLDERS, READABLE, contents_of, read_motion, split_part
from motet.formats.amc import skeleton_for
from motet.formats.text import MARK, Clip, Contents, choice, chosen, plain_names, split_clip
from motet.motion.motion import Motion


@dataclass(frozen=True)
class Source:
    """A motion file, and which clip and figure of it; None for the format's defaults.

    path: of the file; one in a zip has the zip's path before its own: a.zip/walks/1.bvh. place: where its result is
    written, if it is written to a file of its own. number: of the file in its corpus.
    """

    path: Path
    clip: str | None = None
    figure: str | None = None
    place: Path | None = None
    number: int = 0

    def __str__(self) -> str:
        return f"{self.path}{self.part}"

    @property
    def part(self) -> str:
        """The clip and the figure as they are named after the path: "#Walk"; empty for the defaults."""
        return "".join(f"{MARK}{name}" for name in (self.clip, self.figure) if name is not None)

    @property
    def name(self) -> str:
        """What stands for ``{name}`` in the names of results."""
        return self.path.stem

    @property
    def label(self) -> str:
        """The text for ``{clip}``: the names of clip and figure as a file name can have them, or the file's name where
        it has none."""
        # what the name of a file cannot have, on one system or another
        forbidden = r'[<>:"/\\|?*#\x00-\x1f]|^[. ]|[. ]$'
        parts = self.contents()
        clip = 1 if self.clip is None and self.figure is None and parts.clips else self.clip
        figures = plain_names(parts.figures, forbidden) if len(parts.figures) > 1 else []
        return self._called(parts, clip, plain_names(parts.clips, forbidden), figures)

    @property
    def title(self) -> str:
        """What its result is called as a clip: the names of the clip and figure asked for, else the file's."""
        if not self.part:
            return self.name
        parts = self.contents()
        return self._called(parts, self.clip, parts.clips, tuple(parts.figures))

    def _called(self, parts: Contents, clip: Clip, clips: Sequence[str], figures: Sequence[str]) -> str:
        """The names of a clip and of the figure among those of all, where there are some, else the file's."""
        try:
            clip_index, figure_index = choice(self.path, parts, clip, self.figure)
        except FormatError:  # it is said when the file is read
            return self.name
        names = [] if clip_index is None else [clips[clip_index]]
        if figure_index is not None and figures:
            names.append(figures[figure_index])
        return "-".join(names) or self.name

    def read(self, **options: Any) -> Motion:
        """The motion, with options of :func:`motet.read`; FormatError as there, and for a damaged zip."""
        with opened(self.path) as file:
            return read_motion(file, clip=self.clip, figure=self.figure, **options)

    def hash(self) -> str:
        """SHA-256 of the file, in hex; "" where it cannot be read."""
        try:
            with opened(self.path) as file, file.open("rb") as content:
                return hashlib.file_digest(content, "sha256").hexdigest()
        except (MotetError, OSError):
            return ""

    def contents(self) -> Contents:
        """The clips and figures of the file; none where it cannot be read."""
        try:
            with opened(self.path) as file:
                return contents_of(file)
        except MotetError:  # it is said when the file is read
            return Contents((), {})


def files_of(places: Sequence[Path]) -> list[Path]:
    """The motion files that are meant: of folders and zips all in them, of patterns what they match, each in order of
    names. FormatError for a folder, zip or pattern without any."""
    files = []
    for path in places:
        files += _files(path)
    return files


def _files(path: Path) -> list[Path]:
    if path.is_dir():
        files = files_in(path, OF_FOLDERS)
        where = "are in it"
    elif url := url_of(path):
        files = _listed(path, url)
        where = "are there"
    elif path.suffix.lower() == ".zip" and path.is_file():
        with ZipFiles(path) as archive:
            files = [path / name for name in archive.names if PurePosixPath(name).suffix.lower() in OF_FOLDERS]
            where = "are in it"
    elif glob.has_magic(str(path)) and not place_of(split_clip(path, READABLE)[0]).exists():
        matching = sorted(Path(path.anchor).glob(str(path.relative_to(path.anchor))))
        files = [file for file in matching if file.suffix.lower() in OF_FOLDERS]
        where = "have such names"
    else:
        return [path]
    if not files:
        raise FormatError(path, f"no motion files ({' '.join(OF_FOLDERS)}) {where}")
    return files


def sources_of(file: Path, clip: str | None = None, figure: str | None = None, every: bool = False) -> list[Source]:
    """The motions of a file that its own name (a.glb#Walk), ``clip`` and ``figure`` select: a name, a number or "all".

    every: all clips where none is selected.
    """
    unnamed, named_clip, named_figure = split_part(file)
    path = place_of(unnamed)
    if named_clip is not None:
        clip = named_clip
    elif every and clip is None:
        clip = "all"
    if named_figure is not None:
        figure = named_figure
    if clip != "all" and figure != "all":
        return [Source(path, clip, figure)]
    # each clip of each figure that is meant
    parts = Source(path).contents()
    titles: list[str | None] = [figure]
    if figure == "all":
        titles = list(parts.figures) if len(parts.figures) > 1 else [None]
    sources = []
    for title in titles:
        sources += [Source(path, name, title) for name in _clips_of(parts, path, clip, title)]
    return sources


def _clips_of(parts: Contents, path: Path, clip: str | None, figure: str | None) -> list[str | None]:
    """The clips of a figure that are meant; None for a file's only one, and for one that has yet to be refused."""
    if clip != "all":
        return [clip]
    titles = tuple(parts.figures)
    try:
        names = parts.clips if figure is None else parts.figures[titles[chosen(path, titles, figure, "figure")]]
    except FormatError:  # it is said when the file is read
        names = ()
    return list(names) if len(names) > 1 else [None]


@contextmanager
def opened(path: Path) -> Iterator[Path]:
    """Where a file lies; one in a zip is unpacked for as long as the context lasts, with the skeleton (.asf) that an
    .amc needs. Errors name it by its path in the zip."""
    member = member_of(path)
    url = url_of(path)
    if member is None and (url is None or path.exists()):
        yield path
        return
    # unpacked or fetched into a folder of its own, which no message names
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
            line = getattr(error, "line", None)
            reason = getattr(error, "reason", str(error))
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
    parts = re.fullmatch(r"([a-z][a-z0-9+.-]+):/+(.*)", path.as_posix())
    return f"{parts[1]}://{parts[2]}" if parts else None


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
    shown = (Path(system.unstrip_protocol(file)) for file in sorted(names))
    return [file for file in shown if file.suffix.lower() in OF_FOLDERS and file.name[0] != "."]


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
