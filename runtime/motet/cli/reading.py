"""How commands take motion files: the options of reading, and which clips of a file are meant."""

import functools
import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import click

from motet.cli.options import Command
from motet.corpus.sources import Source, sources_of
from motet.formats import FORMATS
from motet.formats.text import FRAME_RATES
from motet.motion.motion import Motion
from motet.motion.skeleton import METRES

log = logging.getLogger(__name__)

FPS_IN = click.FloatRange(*FRAME_RATES)
"""Frame rates that files may have, as :func:`motet.formats.text.frame_rate` takes them."""

FRAME_RATE = click.FloatRange(0, 10_000, min_open=True)
"""Frame rates that a motion is resampled to."""


@dataclass(frozen=True)
class Read:
    """Reads motion files as the options of a command say. clip: a name, a number or "all", where none is in a path.
    figure: the same of a file's skeletons.

    rates: the frame rates of the motions that were read.
    """

    options: Mapping[str, Any]
    clip: str | None
    figure: str | None = None
    rates: list[float] = field(default_factory=list)

    def __call__(self, origin: Path | Source) -> Motion:
        """The motion of a file, of one clip of it; FormatError as :func:`motet.read`."""
        source, *others = [origin] if isinstance(origin, Source) else self.sources([origin])
        if others:
            raise click.UsageError(f"expected one motion, but {origin} holds {len(others) + 1} motions: name one")
        motion = source.read(**self.options)
        self.rates.append(motion.fps)
        return motion

    def sources(self, paths: Sequence[Path], every: bool = False) -> list[Source]:
        """The motions of files, as ``--clip``, ``--figure`` or their own names (a.glb#Walk) select them. every: all
        clips where nothing does."""
        sources = []
        for path in paths:
            sources += sources_of(path, self.clip, self.figure, every)
        return sources

    def say_resampled(self, rate_of: Callable[[], float]) -> None:
        """Log in one line how many of the motions that were read have another frame rate than a model's, for which a
        model may have to be loaded."""
        if not log.isEnabledFor(logging.INFO):
            return
        if count := sum(abs(rate - (fps := rate_of())) > 1e-6 for rate in self.rates):
            log.info("resampled %d of %d motions to %g fps", count, len(self.rates), fps)


unit_option = click.option(
    "--unit-in", type=click.Choice(list(METRES)), help="Length unit of files that do not state theirs."
)


def read_options(command: Command) -> Command:
    """Gives a command ``read``, which reads a motion file as the options of :func:`motet.read` say."""

    def takers(option: str) -> str:
        return " ".join(kind.extension for kind in FORMATS if option in kind.options)

    @unit_option
    @click.option("--fps-in", type=FPS_IN, help=f"Frame rate of files that have none ({takers('fps')}).")
    @click.option("--asf", type=Path, help=f"Skeleton of the files ({takers('asf')}). [default: found beside them]")
    @click.option("--clip", metavar="NAME|N|all", help=f"Clip of files with several ({takers('clip')}).")
    @click.option("--figure", metavar="NAME|N|all", help=f"Skeleton of files with several ({takers('figure')}).")
    @click.option("--partial", is_flag=True, help=f"Take the complete frames of truncated files ({takers('partial')}).")
    @click.option(
        "--rest", type=Path, metavar="FILE", help=f"File with the same joints in a T-pose ({takers('rest')})."
    )
    @functools.wraps(command)
    def with_read(
        unit_in: str | None, fps_in: float | None, clip: str | None, figure: str | None, **options: Any
    ) -> None:
        reader_options = {"unit": unit_in, "fps": fps_in}
        for name in ("asf", "partial", "rest"):
            reader_options[name] = options.pop(name)
        command(read=Read(reader_options, clip, figure), **options)

    return with_read
