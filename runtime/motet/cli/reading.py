"""How commands take motion files: the options of reading, many files of which each is tried, and where results go."""

import functools
import logging
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from motet.cli.writing import FPS, Output, spare
from motet.errors import MotetError, MotionError, UnitError, quoted
from motet.files import place_of
from motet.formats import FORMATS, READABLE, WRITABLE, check_writable, clips, read_motion
from motet.formats.lines import MARK, chosen, plain_names, split_clip
from motet.models.language import LanguageModel
from motet.motion.motion import Motion
from motet.motion.skeleton import METRES
from motet.settings import Progress, silent

log = logging.getLogger(__name__)

ALL = "all"
"""What ``--clip`` says for every clip of a file."""

UNFIT = r'[<>:"/\\|?*#\x00-\x1f]|^[. ]|[. ]$'
"""What the name of a file cannot have, on one system or another."""

FIELDS = r"\{(name|clip)\}"
"""What stands in OUT for what a result is of."""


@dataclass(frozen=True)
class Source:
    """A motion file, and which clip of it; None for the first."""

    path: Path
    clip: str | None = None

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
        return plain_names(names, UNFIT)[index]

    @property
    def title(self) -> str:
        """What its result is called as a clip: the clip's name where one was asked for, else the file's."""
        names, index = self._clips()
        return self.name if self.clip is None else names[index]

    def _clips(self) -> tuple[tuple[str, ...], int]:
        """The names of the file's clips, its own where it has none, and which of them it is."""
        try:
            names = clips(self.path)
            return names, chosen(self.path, names, 1 if self.clip is None else self.clip)
        except MotetError:
            return (self.name,), 0


@dataclass(frozen=True)
class Read:
    """Reads motion files as the options of a command say. clip: a name, a number or "all", where none is in a path."""

    options: Mapping[str, Any]
    clip: str | None

    def __call__(self, given: Path | Source) -> Motion:
        """The motion of a file, of one clip of it; FormatError as :func:`motet.read`."""
        source = given if isinstance(given, Source) else self._only(given)
        return read_motion(source.path, clip=source.clip, **self.options)

    def sources(self, given: Sequence[Path], every: bool = False) -> list[Source]:
        """What files hold, as ``--clip`` says or their own names (a.glb#Walk). every: all clips where nothing does."""
        return [source for path in given for source in self._of(path, every)]

    def _of(self, given: Path, every: bool) -> list[Source]:
        file, named = split_clip(given, READABLE)
        path, asked = place_of(file), ALL if every and self.clip is None else self.clip
        if named is not None or asked != ALL:
            return [Source(path, asked if named is None else named)]
        try:
            names = clips(path)
        except MotetError:  # it is said when the file is read
            names = ()
        return [Source(path, name) for name in names] if len(names) > 1 else [Source(path)]

    def _only(self, given: Path) -> Source:
        first, *others = self._of(given, every=False)
        if others:
            raise click.UsageError(f"expected one motion, but {given} holds {len(others) + 1} clips: name one")
        return first


unit_option = click.option(
    "--unit-in", type=click.Choice(list(METRES)), help="Length unit of files that do not state theirs."
)

out_option = click.option(
    "-o", "--out", required=True, type=Path, help=f"File to write; its extension is the format: {' '.join(WRITABLE)}."
)


def read_options(command: Callable[..., None]) -> Callable[..., None]:
    """Gives a command ``read``, which reads a motion file as the options of :func:`motet.read` say."""

    @unit_option
    @click.option("--fps-in", type=FPS, help=f"Frame rate of files that have none ({_takers('fps')}).")
    @click.option("--asf", type=Path, help=f"Skeleton of the files ({_takers('asf')}). [default: found beside them]")
    @click.option("--clip", metavar="NAME|N|all", help=f"Clip of files with several ({_takers('clip')}).")
    @click.option(
        "--partial", is_flag=True, help=f"Take the complete frames of truncated files ({_takers('partial')})."
    )
    @click.option(
        "--rest",
        type=Path,
        metavar="FILE",
        help=f"File with the same joints in a T-pose ({_takers('rest')}).",
    )
    @functools.wraps(command)
    def with_read(
        unit_in: str | None,
        fps_in: float | None,
        asf: Path | None,
        partial: bool,
        clip: str | None,
        rest: Path | None,
        **options: Any,
    ) -> None:
        given = {"unit": unit_in, "fps": fps_in, "asf": asf, "partial": partial, "rest": rest}
        command(read=Read(given, clip), **options)

    return with_read


def _takers(option: str) -> str:
    return " ".join(kind.extension for kind in FORMATS if option in kind.options)


class Tries:
    """Tries one input after the other: failures are named on stderr, and in the end make exit code 1."""

    def __init__(self) -> None:
        self.failed = 0

    @contextmanager
    def of(self, given: Source | Path | str) -> Iterator[None]:
        """What is done for one file or text; motet's own errors end only this."""
        try:
            yield
        except MotetError as error:
            self.failed += 1
            click.echo(f"motet: {_named(given, error)}", err=True)

    def done(self, given: Source | Path | str, work: Callable[[], object]) -> bool:
        """Whether work for one file or text ended without an error of motet's own."""
        before = self.failed
        with self.of(given):
            work()
        return self.failed == before

    def usable(self, model: LanguageModel, texts: Sequence[str]) -> list[int]:
        """The indices of the texts that the model takes."""
        found = []
        for index, text in enumerate(texts):
            with self.of(quoted(text)):
                model.unknown(text)
                found.append(index)
        return found

    def finish(self) -> None:
        """Exit code 1 if anything failed."""
        if self.failed:
            sys.exit(1)


@contextmanager
def naming(path: Path | str | None) -> Iterator[None]:
    """Errors about a motion name the file that it came from, if there is one."""
    try:
        yield
    except MotionError as error:
        raise error if path is None else MotionError(_named(path, error)) from error


def _named(given: Source | Path | str, error: MotetError) -> str:
    hint = " (--unit-in)" if isinstance(error, UnitError) else ""
    text = str(error).removeprefix(f"{given.path}: ") if isinstance(given, Source) else str(error)
    return f"{text}{hint}" if str(given) in text else f"{given}: {text}{hint}"


@contextmanager
def bar(label: str) -> Iterator[Progress]:
    """A progress bar on stderr, if that is a terminal, as the callback of long work."""
    if not (sys.stderr.isatty() and log.isEnabledFor(logging.WARNING)):
        yield silent
        return
    with click.progressbar(length=1, label=label, file=sys.stderr) as shown:

        def progress(done: int, total: int) -> None:
            shown.length = total
            shown.update(done - shown.pos)

        yield progress


def places(out: Path, sources: Sequence[Source | str], samples: int = 1, output: Output | None = None) -> list[Path]:
    """Where results go: by ``{name}`` and ``{clip}`` in OUT, or several numbered: out-1.bvh, out-2.bvh, ...

    samples: how many results each source has, one after the other, which are numbered in any case.
    output: how they are written; a character takes all that go to one place.
    """
    if output and output.onto:
        found = [_place(out, source) for source in sources for _ in range(samples)]
    elif re.search(FIELDS, str(out)):
        found = [place for source in sources for place in _numbered(_place(out, source), samples)]
    else:
        found = _numbered(out, len(sources) * samples)
    if len(set(found)) < len(found) and not (output and output.onto):
        raise click.UsageError(
            "several results have the same name: give an OUT with {name} and, for clips, {clip}, or without both"
        )
    for place in found:
        output.check(place) if output else check_writable(place)
        spare(place, *(source.path for source in sources if isinstance(source, Source)))
    return found


def _numbered(place: Path, count: int) -> list[Path]:
    if count == 1:
        return [place]
    return [place.with_name(f"{place.stem}-{i}{place.suffix}") for i in range(1, count + 1)]


def _place(out: Path, source: Source | str) -> Path:
    def named(found: re.Match[str]) -> str:
        if isinstance(source, str):
            return source
        return source.name if found[1] == "name" else source.label

    return Path(re.sub(FIELDS, named, str(out)))


def say_resampled(rates: Sequence[float], fps: float) -> None:
    """Log in one line how many motions come at another frame rate than a model's."""
    if count := sum(abs(rate - fps) > 1e-6 for rate in rates):
        log.info("resampled %d of %d motions to %g fps", count, len(rates), fps)
