"""How commands go over many motions: on all cores, with progress, each answer in order and each failure named."""

import functools
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import click

from motet.cli.options import Tries, bar
from motet.cli.reading import Read
from motet.corpus.answers import Answer, Verb
from motet.corpus.sources import Source, files_of
from motet.jobs import in_batches
from motet.settings import silent

jobs_option = click.option(
    "--jobs", type=click.IntRange(1, 256), metavar="N", help="Processes for many files. [default: one for each core]"
)


@dataclass(frozen=True)
class Many:
    """What the options of a command over many motions say."""

    read: Read
    jobs: int | None
    tries: Tries = field(default_factory=Tries)

    def sources(self, given: Sequence[Path], every: bool = True) -> list[Source]:
        """The motions that files, folders, zips and patterns name. every: all clips where nothing says which."""
        return self.read.sources(files_of(given), every)

    def answers(self, verb: Verb, sources: Sequence[Source], label: str, named: bool = True) -> Iterator[Answer]:
        """The answers in order, with progress where they are not printed as they come. named: failures are said."""
        with nullcontext(silent) if sys.stdout.isatty() else bar(label) as progress:
            for done, answer in enumerate(in_batches(verb, sources, self.jobs, verb.MOST), start=1):
                progress(done, len(sources))
                if named:
                    self.tries.say(answer)
                if answer.fps is not None:
                    self.read.rates.append(answer.fps)
                yield answer


def many_options(command: Callable[..., None]) -> Callable[..., None]:
    """Gives a command ``many``, with the ``read`` of :func:`motet.cli.reading.read_options`, which stands above it."""

    @jobs_option
    @functools.wraps(command)
    def with_many(read: Read, jobs: int | None, **options: Any) -> None:
        command(many=Many(read, jobs), **options)

    return with_many


def print_list(rows: Iterator[str]) -> None:
    """Print JSON objects as one list, a line for each as it comes."""
    empty = True
    for row in rows:
        click.echo(("[" if empty else ",") + row)
        empty = False
    click.echo("[]" if empty else "]")
