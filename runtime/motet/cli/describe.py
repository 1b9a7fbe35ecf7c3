"""``motet describe``: motion files in, ranked sentences out."""

import json
from dataclasses import asdict
from pathlib import Path

import click

from motet.bundle.session import SessionOptions
from motet.cli.notes import read_for, unit_option
from motet.cli.options import session_options
from motet.models.describe import DescribeModel
from motet.models.load import load_as


@click.command()
@click.argument("motions", nargs=-1, required=True, type=Path)
@click.option("--bundle", default="cmu-describe", show_default=True, help="Name or path of a bundle.")
@click.option("--beams", type=int, help="Hypotheses that are kept, and printed. [default: the bundle's]")
@click.option(
    "--draws", type=int, help="Sentences that are drawn to agree on one; 0: beam search. [default: the bundle's]"
)
@unit_option
@session_options
@click.option("--json", "as_json", is_flag=True, help="Print a list with input and hypotheses of each motion.")
def describe(
    motions: tuple[Path, ...],
    bundle: str,
    beams: int | None,
    draws: int | None,
    unit_in: str | None,
    as_json: bool,
    session: SessionOptions,
) -> None:
    """Describe the motion files MOTIONS: sentences with their log-probabilities, the best first.

    Reads .amc (with its .asf) .bvh .npz .csv. All files are described in one batch.
    """
    model = load_as(DescribeModel, bundle, session)
    found = model.describe(read_for(model, motions, unit_in), beams, draws)
    if as_json:
        rows = zip(motions, found, strict=True)
        click.echo(json.dumps([{"input": str(path), "hypotheses": list(map(asdict, row))} for path, row in rows]))
        return
    for path, row in zip(motions, found, strict=True):
        if len(motions) > 1:
            click.echo(f"{path}")
        for description in row:
            click.echo(f"{description.log_probability:8.2f}  {description.text}")
