"""``motet export`` and ``motet parity``."""

import json
from pathlib import Path
from typing import Any

import click

from motet.bundle.bundle import Bundle
from motet.bundle.graph import SessionOptions
from motet.cli.options import session_options
from motet.files import new_folder
from motet.models.load import KINDS
from motet_export.bundles import export_run, halve_bundle, parity_of
from motet_export.restored import restored
from motet_train.runs import MANIFEST, Run


@click.command()
@click.argument("run", type=Path)
@click.option(
    "-o", "--out", required=True, type=Path, help="Bundle to write: a .zip, or a new folder; of runs, a folder."
)
@click.option("--int8", is_flag=True, help="8-bit weights: a quarter of the size; reports changes.")
@click.option("--half", is_flag=True, help="16-bit weights, computed with in 32 bits: half the size.")
@click.option("--back", is_flag=True, help="RUN is a bundle: write a training run with its weights, to train on from.")
def export(run: Path, out: Path, int8: bool, half: bool, back: bool) -> None:
    """Export the training run RUN to ONNX as a bundle, if ONNX Runtime computes what torch does.

    RUN may be the folder that `motet train all` wrote: then OUT gets a bundle of each run that is a model by itself.
    With --half, RUN may be a bundle, too: it is written anew with its weights rounded.
    """
    if back:
        with new_folder(out) as folder:
            restored(Bundle.open(run)).save(folder)
        click.echo(str(out))
        return
    if half and run.suffix == ".zip":
        for name, value in halve_bundle(Bundle.open(run), out).items():
            click.echo(f"half {name:<20} {value:.3g}")
        click.echo(str(out))
        return
    found = {one.parent.name: Run.load(one.parent) for one in sorted(run.glob(f"*/{MANIFEST}"))}
    verbs = {kind.VERB for kind in KINDS}
    runs = {out / f"{name}.zip": one for name, one in found.items() if one.manifest["verb"] in verbs}
    if (run / MANIFEST).is_file() or not runs:
        runs = {out: Run.load(run)}
    else:
        out.mkdir(parents=True, exist_ok=True)
    for path, one in runs.items():
        report = export_run(one, path, int8, half)
        click.echo(_lines(report))
        for name, value in report.get("int8", {}).items():
            click.echo(f"int8 {name:<20} {value:.3g}")
        click.echo(str(path))


@click.command()
@click.argument("run", type=Path)
@click.argument("bundle")
@session_options
@click.option("--json", "as_json", is_flag=True, help="Print the report as JSON.")
def parity(run: Path, bundle: str, session: SessionOptions, as_json: bool) -> None:
    """Check that BUNDLE computes what the training run RUN computes in torch."""
    report = parity_of(Run.load(run), Bundle.open(bundle), session)
    click.echo(json.dumps(report) if as_json else _lines(report))


def _lines(report: dict[str, Any]) -> str:
    rungs = {name: rung for name, rung in report.items() if isinstance(rung, dict) and "bound" in rung}
    return "\n".join(
        f"parity {name:<18} {rung['error']:.1e} (bound {rung['bound']:.0e})" for name, rung in rungs.items()
    )
