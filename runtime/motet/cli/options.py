"""What all commands share: the options of running a model, what is said on stderr, and inputs that are tried."""

import functools
import logging
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, cast

import click

from motet.bundle.graph import MAX_THREADS, SessionOptions, provider_of
from motet.corpus.answers import Answer, named
from motet.errors import (
    ControlWarning,
    MotetError,
    MotionError,
    TextWarning,
    TravelWarning,
    collected,
    each_once,
    quoted,
)
from motet.models.load import Kind, load_as
from motet.settings import Progress, silent

log = logging.getLogger("motet")

Command = Callable[..., Any]
"""What a command does, or what makes options of it."""


def bundle_option(default: str) -> Command:
    """The option ``--bundle`` of a command that has a model by default."""
    return click.option("--bundle", default=default, show_default=True, help="Name or path of a bundle.")


def seed_option(help_text: str) -> Command:
    """The option ``--seed`` of a command."""
    return click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help=help_text)


def json_option(help_text: str) -> Command:
    """The flag ``--json`` of a command, which gets it as ``as_json``."""
    return click.option("--json", "as_json", is_flag=True, help=help_text)


def clips_option(command: Command) -> Command:
    """Give a command of steered figures ``--clips``, for :func:`steered`."""
    help_text = "Folder of motion files, named walk_*, run_*, idle_*, to steer a figure by instead of a bundle."
    return click.option("--clips", type=click.Path(path_type=Path), help=help_text)(command)


def steered(kind: Callable[..., Kind], bundle: str, clips: Path | None, session: SessionOptions) -> Kind:
    """The model of a bundle, or the one that is made of clips."""
    if clips is None:
        return load_as(kind, bundle, session)
    from motet.steering.model import SteerModel  # here, as other commands do not need it

    return cast(Kind, SteerModel.from_clips(clips))


def session_options(command: Command) -> Command:
    """Give a command ``--threads`` and ``--provider``; it gets them as ``session``, a SessionOptions."""

    @click.option(
        "--threads",
        type=click.IntRange(1, MAX_THREADS),
        default=1,
        show_default=True,
        help="Threads within a graph call.",
    )
    @click.option(
        "--provider",
        "providers",
        multiple=True,
        metavar="NAME",
        help="Execution provider of ONNX Runtime, such as CUDA; may be given several times.  [default: CPU]",
    )
    @functools.wraps(command)
    def with_session(*args: Any, threads: int, providers: tuple[str, ...], **kwargs: Any) -> Any:
        session = SessionOptions(threads, tuple(map(provider_of, providers))) if providers else SessionOptions(threads)
        return command(*args, session=session, **kwargs)

    return with_session


@contextmanager
def noted() -> Iterator[None]:
    """Log what motet warns of, words that are not known and speeds that a gait does not have, each once."""
    with collected(TextWarning, ControlWarning) as notes:
        yield
    for text in each_once(notes):
        log.warning(text)


@contextmanager
def warned(source: object) -> Iterator[list[Warning]]:
    """Log what motet warns of a motion, each once, with what was given."""
    with collected(TravelWarning) as notes:
        yield notes
    for text in each_once(notes):
        log.warning("%s: %s", source, text)


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


class Tries:
    """Tries one input after the other: failures are named on stderr, and in the end make exit code 1."""

    def __init__(self) -> None:
        self.failed = 0

    @contextmanager
    def of(self, source: object) -> Iterator[list[Warning]]:
        """What is done for one file or text; motet's own errors end only this. What it was warned of meanwhile is said,
        once, of the file."""
        try:
            with warned(source) as caught:
                yield caught
        except MotetError as error:
            self.failed += 1
            click.echo(f"motet: {named(source, error)}", err=True)

    def say(self, answer: Answer) -> None:
        """Name an answer's failure, and what was warned of."""
        for text in answer.warned:
            log.warning("%s: %s", answer.source, text)
        if answer.error:
            self.failed += 1
            click.echo(f"motet: {answer.error}", err=True)

    def usable(self, texts: Mapping[int, str], check: Callable[[str], object]) -> dict[int, str]:
        """The texts that pass a check."""
        valid = {}
        for index, text in texts.items():
            with self.of(quoted(text)):
                check(text)
                valid[index] = text
        return valid

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
        raise error if path is None else MotionError(named(path, error)) from error
