"""How commands take motion files: the options of reading, many files of which each is tried, and where results go."""

import functools
import logging
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click

from motet.cli.writing import FPS
from motet.errors import MotetError, MotionError, UnitError, quoted
from motet.formats import FORMATS, WRITABLE, check_writable, read_motion
from motet.models.language import LanguageModel
from motet.models.progress import Progress, silent
from motet.motion.motion import Motion
from motet.motion.units import METRES

log = logging.getLogger(__name__)

Read = Callable[[Path], Motion]

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
    @click.option(
        "--asf", type=Path, help=f"Skeleton of the files ({_takers('asf')}). [default: looked for beside them]"
    )
    @click.option(
        "--partial", is_flag=True, help=f"Take the complete frames of truncated files ({_takers('partial')})."
    )
    @functools.wraps(command)
    def with_read(unit_in: str | None, fps_in: float | None, asf: Path | None, partial: bool, **options: Any) -> None:
        read = functools.partial(read_motion, unit=unit_in, fps=fps_in, asf=asf, partial=partial)
        command(read=read, **options)

    return with_read


def _takers(option: str) -> str:
    return " ".join(kind.extension for kind in FORMATS if option in kind.options)


class Tries:
    """Tries one input after the other: failures are named on stderr, and in the end make exit code 1."""

    def __init__(self) -> None:
        self.failed = 0

    @contextmanager
    def of(self, given: Path | str) -> Iterator[None]:
        """What is done for one file or text; motet's own errors end only this."""
        try:
            yield
        except MotetError as error:
            self.failed += 1
            click.echo(f"motet: {_named(given, error)}", err=True)

    def done(self, given: Path | str, work: Callable[[], object]) -> bool:
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


def _named(path: Path | str, error: MotetError) -> str:
    hint = " (--unit-in)" if isinstance(error, UnitError) else ""
    return f"{error}{hint}" if str(path) in str(error) else f"{path}: {error}{hint}"


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


def places(out: Path, names: Sequence[str]) -> list[Path]:
    """Where results go: each ``names`` instead of ``{name}`` in OUT, or several numbered: out-1.bvh, out-2.bvh, ..."""
    if "{name}" in str(out):
        found = [Path(str(out).replace("{name}", name)) for name in names]
    elif len(names) == 1:
        found = [out]
    else:
        found = [out.with_name(f"{out.stem}-{i}{out.suffix}") for i in range(1, len(names) + 1)]
    if len(set(found)) < len(found):
        raise click.UsageError("several inputs have the same name: number the results with an OUT without {name}")
    for place in found:
        check_writable(place)
    return found


def say_resampled(rates: Sequence[float], fps: float) -> None:
    """Log in one line how many motions come at another frame rate than a model's."""
    if count := sum(abs(rate - fps) > 1e-6 for rate in rates):
        log.info("resampled %d of %d motions to %g fps", count, len(rates), fps)
