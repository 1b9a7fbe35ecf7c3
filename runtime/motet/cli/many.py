"""How commands go over many motions: on all cores or a cluster, with progress, each answer in order and each failure
named; and in parts, which other processes and machines write beside this one."""

import functools
import sys
from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import click

from motet.cli.options import Command, Tries, bar
from motet.cli.reading import Read
from motet.corpus import parts as corpus_parts
from motet.corpus import ray_engine
from motet.corpus.answers import Answer, Hashed, Verb
from motet.corpus.parts import Part, digest, failures
from motet.corpus.sources import Source, files_of
from motet.errors import FormatError, OutputError
from motet.jobs import Shard, in_batches
from motet.settings import silent

jobs_option = click.option(
    "--jobs", type=click.IntRange(1, 256), metavar="N", help="Processes for many files. [default: one for each core]"
)


@dataclass(frozen=True)
class Many:
    """What the options of a command over many motions say."""

    read: Read
    jobs: int | None = None
    parts: Path | None = None
    shard: Shard = field(default_factory=Shard)
    engine: str = "processes"
    address: str | None = None
    tries: Tries = field(default_factory=Tries)

    def sources(self, paths: Sequence[Path], every: bool = True) -> list[Source]:
        """The motions of this shard that files, folders, zips and patterns name. every: all clips where nothing says
        which."""
        files = self.shard.of(list(enumerate(files_of(paths))))
        sources = []
        for number, file in files:
            for source in self.read.sources([file], every):
                sources.append(replace(source, number=number))
        return sources

    def answers(self, verb: Verb, sources: Sequence[Source], label: str, named: bool = True) -> Iterator[Answer]:
        """The answers in order, with progress where they are not printed as they come. named: failures are said."""
        if self.engine == "ray":
            answered = ray_engine.answers(verb, sources, self.jobs, self.address)
        else:
            answered = in_batches(verb, sources, self.jobs, verb.most)
        with nullcontext(silent) if sys.stdout.isatty() and self.parts is None else bar(label) as progress:
            for done, answer in enumerate(answered, start=1):
                progress(done, len(sources))
                if named:
                    self.tries.say(answer)
                if answer.fps is not None:
                    self.read.rates.append(answer.fps)
                yield answer

    def write_part(self, verb: Verb, sources: Sequence[Source], paths: Sequence[Path], label: str) -> None:
        """Write the part of this shard, or what is missing of it, into the folder of ``--parts``."""
        assert self.parts is not None
        files = files_of(paths)
        corpus = {"files": len(files), "corpus": digest(files)}
        part = Part(self.parts, {"motet": version("motet"), **verb.about(), **corpus, "shard": str(self.shard)})
        before = part.complete()
        if not before:
            part.write(sources, partial(self._while_it_stays, part, verb, paths, label))
        count, failed = failures(part.path)
        note = "was complete already: " if before else ""
        click.echo(f"{part.path}: {note}{count} motions, {failed} failed")
        sys.exit(1 if failed else 0)

    def _while_it_stays(
        self, part: Part, verb: Verb, paths: Sequence[Path], label: str, rest: Sequence[Source]
    ) -> Iterator[Answer]:
        """The answers for a part; OutputError in the end where the corpus is no longer that with which it began."""
        yield from self.answers(Hashed(verb.reading, verb), rest, label)
        if digest(files_of(paths)) != part.about["corpus"]:
            reason = "the files that it is of changed while it was written: remove it, and run the same command again"
            raise OutputError(f"cannot complete {part.path}: {reason} on files that stay")


def many_options(command: Command) -> Command:
    """Gives a command ``many``, with the ``read`` of :func:`motet.cli.reading.read_options`, which stands above it."""

    @jobs_option
    @click.option("--parts", type=Path, metavar="FOLDER", help="Write the answers there, or what is missing of them.")
    @click.option("--shard", metavar="I/N", help="With --parts: every N-th file from the I-th, such as 3/16.")
    @click.option(
        "--engine",
        type=click.Choice(["processes", "ray"]),
        default="processes",
        show_default=True,
        help="What runs it; ray: a Ray cluster, of this machine or at --address.",
    )
    @click.option("--address", help="Of the Ray cluster, such as auto or ray://host:10001.")
    @functools.wraps(command)
    def with_many(
        read: Read,
        jobs: int | None,
        parts: Path | None,
        shard: str | None,
        engine: str,
        address: str | None,
        **options: Any,
    ) -> None:
        if shard is not None and parts is None:
            raise click.UsageError("--shard writes a part: give --parts FOLDER")
        if address is not None and engine != "ray":
            raise click.UsageError("--address is that of a Ray cluster: give --engine ray")
        many = Many(read, jobs, parts, Shard() if shard is None else Shard.parse(shard), engine, address)
        command(many=many, **options)

    return with_many


@click.command()
@click.argument("parts", nargs=-1, required=True, type=Path, metavar="FOLDER|PART...")
@click.option("-o", "--out", required=True, type=Path, help="The .jsonl, .parquet or, of embed, .npy to write.")
def merge(parts: tuple[Path, ...], out: Path) -> None:
    """Merge the parts that --parts and --shard wrote, in the order of the files: the bytes are those of one part.

    Parts that are missing, cut or changed are named, and nothing is written; then the exit code is 1.
    """
    try:
        count = corpus_parts.merge(parts, out)
    except FormatError as error:
        click.echo(f"motet: {error}", err=True)
        sys.exit(1)
    click.echo(f"{out}: {count} answers")


def print_list(rows: Iterator[str]) -> None:
    """Print JSON objects as one list, a line for each as it comes."""
    empty = True
    for row in rows:
        click.echo(("[" if empty else ",") + row)
        empty = False
    click.echo("[]" if empty else "]")
