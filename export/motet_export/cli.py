"""``motet export`` and ``motet parity``."""

import json
from pathlib import Path

import click

from motet.bundle.bundle import Bundle
from motet.bundle.fields import Json
from motet.bundle.graph import SessionOptions
from motet.cli.options import session_options
from motet.files import new_folder
from motet.models.load import KINDS
from motet_export.bundles import export_run, halve_bundle, parity_of, renew_golden
from motet_export.restored import restored
from motet_train.runs import RUN_MANIFEST, Run


@click.command()
@click.argument("run", type=Path)
@click.option(
    "-o", "--out", required=True, type=Path, help="Bundle to write: a .zip, or a new folder; of runs, a folder."
)
@click.option("--int8", is_flag=True, help="8-bit weights: a quarter of the size; reports changes.")
@click.option("--half", is_flag=True, help="16-bit weights, computed with in 32 bits: half the size.")
@click.option("--back", is_flag=True, help="RUN is a bundle: write a training run with its weights, to train on from.")
@click.option(
    "--golden", is_flag=True, help="RUN is a bundle: copy it as today's code writes it: golden vectors, graphs."
)
@click.option(
    "--commands", type=Path, help="RUN is a bundle that generates: copy it with the plain acts of commands in a table."
)
def export(run: Path, out: Path, int8: bool, half: bool, back: bool, golden: bool, commands: Path | None) -> None:
    """Export the training run RUN to ONNX as a bundle, if ONNX Runtime computes the same as torch.

    RUN may be the folder that `motet train all` wrote: then OUT gets a bundle of each run that is a model by itself.
    With --half, RUN may also be a bundle: it is copied with rounded weights.
    """
    if back or golden or commands or (half and run.suffix == ".zip"):
        _rewrite(Bundle.open(run), out, back, golden, commands)
        return
    for path, trained in _runs(run, out).items():
        report = export_run(trained, path, int8, half)
        click.echo(_lines(report))
        _show("int8", report.get("int8", {}))
        click.echo(str(path))


def _rewrite(bundle: Bundle, out: Path, back: bool, golden: bool, commands: Path | None) -> None:
    """Write a bundle as a run, or copy it with new golden vectors or commands, or else with rounded weights."""
    if back:
        with new_folder(out) as folder:
            restored(bundle).save(folder)
    elif golden or commands:
        renew_golden(bundle, out, commands)
    else:
        _show("half", halve_bundle(bundle, out))
    click.echo(str(out))


def _runs(folder: Path, out: Path) -> dict[Path, Run]:
    """The runs to export, by the path of the bundle: a single run, or those in the subfolders that are models."""
    runs = {}
    for manifest in sorted(folder.glob(f"*/{RUN_MANIFEST}")):
        run = Run.load(manifest.parent)
        if run.manifest["verb"] in KINDS:
            runs[out / f"{manifest.parent.name}.zip"] = run
    if (folder / RUN_MANIFEST).is_file() or not runs:
        return {out: Run.load(folder)}
    out.mkdir(parents=True, exist_ok=True)
    return runs


def _show(weights: str, changes: Json) -> None:
    for name, value in changes.items():
        click.echo(f"{weights} {name:<20} {value:.3g}")


@click.command()
@click.argument("run", type=Path)
@click.argument("bundle")
@session_options
@click.option("--json", "as_json", is_flag=True, help="Print the report as JSON.")
def parity(run: Path, bundle: str, session: SessionOptions, as_json: bool) -> None:
    """Check that BUNDLE computes the same as the training run RUN in torch."""
    report = parity_of(Run.load(run), Bundle.open(bundle), session)
    click.echo(json.dumps(report) if as_json else _lines(report))


def _lines(report: Json) -> str:
    lines = []
    for name, rung in report.items():
        if isinstance(rung, dict) and "bound" in rung:
            lines.append(f"parity {name:<18} {rung['error']:.1e} (bound {rung['bound']:.0e})")
    return "\n".join(lines)
