"""``motet describe``: motion files in, ranked sentences out."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from motet.bundle.graph import SessionOptions
from motet.cli.options import session_options
from motet.cli.reading import Read, Source, Tries, bar, read_options, say_resampled
from motet.formats import READS
from motet.models.describe import DescribeModel, Description, Part
from motet.models.load import load_as


@click.command(
    help=f"""Describe motion files: sentences, the best first, each with its log-probability, or, with --draws, with how
    well it agrees with all sentences drawn (0 to 1). A sentence after "?" is one that the model is not sure of.

    All files are described in one batch, motions over 30 s in windows; with --timeline, motions of any length are cut
    where what is done changes. Any human figure will do. Of a file of several clips all are described, or the one of
    --clip or MOTION.glb#CLIP. Reads {READS}.
    """
)
@click.argument("motions", nargs=-1, required=True, type=Path, metavar="MOTION...")
@click.option("--bundle", default="describe", show_default=True, help="Name or path of a bundle.")
@click.option("--beams", type=click.IntRange(1, 100), help="Sentences to print. [default: the bundle's]")
@click.option(
    "--draws",
    type=click.IntRange(0, 1000),
    help="Samples for consensus (MBR) decoding; 0: beam search. [default: the bundle's; of describe: beam search]",
)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Seed of the samples.")
@click.option("--timeline", is_flag=True, help="One sentence for each part of a motion, with its times.")
@session_options
@read_options
@click.option("--json", "as_json", is_flag=True, help="Print a list: each window or part with its input and seconds.")
def describe(
    motions: tuple[Path, ...],
    bundle: str,
    beams: int | None,
    draws: int | None,
    seed: int,
    timeline: bool,
    session: SessionOptions,
    read: Read,
    as_json: bool,
) -> None:
    """Describe motion files."""
    if timeline and (beams, draws) != (None, None):
        raise click.UsageError("--timeline gives one sentence for each part: it goes with neither --beams nor --draws")
    model, tries = load_as(DescribeModel, bundle, session), Tries()
    sources = read.sources(motions, every=True)
    if timeline:
        _timelines(model, sources, read, tries, as_json)
    else:
        settings = {"beams": beams, "draws": draws or None, "decoding": "beam" if draws == 0 else None, "seed": seed}
        _hypotheses(model, sources, read, tries, settings, as_json)
    tries.finish()


def _hypotheses(
    model: DescribeModel,
    sources: Sequence[Source],
    read: Read,
    tries: Tries,
    settings: dict[str, Any],
    as_json: bool,
) -> None:
    rows, parts, rates = [], [], []
    for source in sources:
        with tries.of(source):
            motion = read(source)
            windows = [(start, part.duration, model.prepared(part)) for start, part in model.windows(motion)]
            rates.append(motion.fps)
            rows += [{"input": str(source), "start": start, "stop": start + length} for start, length, _ in windows]
            parts += [part for *_, part in windows]
    say_resampled(rates, model.fps)
    with bar("describing") as progress:
        found = model.describe(parts, progress=progress, **settings)
    _print(rows, found, as_json, several=len(sources) > 1)


def _timelines(model: DescribeModel, sources: Sequence[Source], read: Read, tries: Tries, as_json: bool) -> None:
    found: list[tuple[str, list[Part]]] = []
    rates = []
    for source in sources:
        with tries.of(source), bar(source.name) as progress:
            motion = read(source)
            found.append((str(source), model.timeline(motion, progress=progress)))
            rates.append(motion.fps)
    say_resampled(rates, model.fps)
    if as_json:
        click.echo(json.dumps([{"input": name, **part.to_json()} for name, parts in found for part in parts]))
        return
    for name, parts in found:
        if len(sources) > 1:
            click.echo(name)
        for part in parts:
            click.echo(f"{part.start:.1f}-{part.stop:.1f} s  {_told(part)}")


def _told(description: Description) -> str:
    return description.text if description.confident else f"? {description.text}"


def _print(rows: list[dict[str, Any]], found: list[list[Description]], as_json: bool, several: bool) -> None:
    if as_json:
        click.echo(
            json.dumps(
                [{**row, "hypotheses": [one.to_json() for one in of]} for row, of in zip(rows, found, strict=True)]
            )
        )
        return
    files = [row["input"] for row in rows]
    for row, descriptions in zip(rows, found, strict=True):
        if several and row["start"] == 0:
            click.echo(row["input"])
        if files.count(row["input"]) > 1:
            click.echo(f"{row['start']:.1f} to {row['stop']:.1f} s")
        for description in descriptions:
            click.echo(f"{description.score:8.2f}  {_told(description)}")
