"""``motet describe``: motion files in, ranked sentences out."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from motet.bundle.session import SessionOptions
from motet.cli.options import session_options
from motet.cli.reading import Read, Tries, bar, read_options, say_resampled
from motet.formats import READS
from motet.models.describe import DescribeModel, Description
from motet.models.load import load_as


@click.command(
    help=f"""Describe motion files: sentences, the best first, each with what it is ranked by: by default how well it
    agrees with all sentences drawn (0 to 1), with --draws 0 its log-probability.

    All files are described in one batch, motions over 30 s in windows. Any human figure will do. Reads {READS}.
    """
)
@click.argument("motions", nargs=-1, required=True, type=Path, metavar="MOTION...")
@click.option("--bundle", default="describe", show_default=True, help="Name or path of a bundle.")
@click.option("--beams", type=click.IntRange(1, 100), help="Sentences to print. [default: the bundle's]")
@click.option(
    "--draws",
    type=click.IntRange(0, 1000),
    help="Samples for consensus (MBR) decoding; 0: beam search. [default: the bundle's]",
)
@session_options
@read_options
@click.option("--json", "as_json", is_flag=True, help="Print a list with input, seconds and hypotheses of each window.")
def describe(
    motions: tuple[Path, ...],
    bundle: str,
    beams: int | None,
    draws: int | None,
    session: SessionOptions,
    read: Read,
    as_json: bool,
) -> None:
    """Describe motion files."""
    model = load_as(DescribeModel, bundle, session)
    tries, rows, parts, rates = Tries(), [], [], []
    for path in motions:
        with tries.of(path):
            motion = read(path)
            windows = [(start, part.duration, model.prepared(part)) for start, part in model.windows(motion)]
            rates.append(motion.fps)
            rows += [{"input": str(path), "start": start, "stop": start + length} for start, length, _ in windows]
            parts += [part for *_, part in windows]
    say_resampled(rates, model.fps)
    with bar("describing") as progress:
        found = model.describe(parts, beams, draws, progress=progress)
    _print(rows, found, as_json, several=len(motions) > 1)
    tries.finish()


def _print(rows: list[dict[str, Any]], found: list[list[Description]], as_json: bool, several: bool) -> None:
    if as_json:
        click.echo(
            json.dumps([{**row, "hypotheses": list(map(asdict, of))} for row, of in zip(rows, found, strict=True)])
        )
        return
    files = [row["input"] for row in rows]
    for row, descriptions in zip(rows, found, strict=True):
        if several and row["start"] == 0:
            click.echo(row["input"])
        if files.count(row["input"]) > 1:
            click.echo(f"{row['start']:.1f} to {row['stop']:.1f} s")
        for description in descriptions:
            click.echo(f"{description.score:8.2f}  {description.text}")
