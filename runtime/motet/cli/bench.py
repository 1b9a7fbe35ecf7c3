"""``motet bench``: how fast the models run on this machine."""

import importlib
import importlib.util
import json
from dataclasses import asdict
from pathlib import Path

import click

from motet.bench import Row, figures, rows
from motet.bundle.graph import SessionOptions
from motet.cli.options import session_options
from motet.models.load import load


@click.command()
@click.option("--bundle", default="control", show_default=True, help="Name or path of a bundle.")
@click.option("--motion", type=Path, help="Motion file to describe.  [default: a generated one of 2.8 s]")
@click.option("--seconds", default=1.0, show_default=True, help="How long to measure each row.")
@click.option("--torch/--no-torch", default=True, help="Measure torch too, if it is installed.  [default: --torch]")
@session_options
@click.option("--json", "as_json", is_flag=True, help="Print a list of rows.")
def bench(
    bundle: str, motion: Path | None, seconds: float, torch: bool, as_json: bool, session: SessionOptions
) -> None:
    """Measure a bundle's speed, and torch's where it is installed."""
    model = load(bundle, session)
    found = figures(model, seconds, motion)
    baseline = None
    if torch and model.graphs and importlib.util.find_spec("torch"):
        # by name: the runtime does not depend on the training package
        eager = importlib.import_module("motet_train.runs").eager_model(model.manifest, session.threads)
        baseline = figures(eager, seconds, motion)
    table = rows(found, baseline)
    if as_json:
        click.echo(json.dumps([asdict(row) for row in table]))
        return
    providers = ", ".join(model.providers) or "numpy"
    click.echo("\n".join([f"on {providers}, threads: {session.threads}", *map(_line, table)]))


def _line(row: Row) -> str:
    text = f"{row.name:<28} {row.value:>12,.1f} {row.unit:<10}"
    return text if row.baseline is None else f"{text} torch eager {row.baseline:>12,.1f}" + _ratio(row)


def _ratio(row: Row) -> str:
    return "" if row.ratio is None else f"  x{row.ratio:.2f}"
