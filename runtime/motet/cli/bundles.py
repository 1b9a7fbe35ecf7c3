"""``motet bundle`` and ``motet bench``: bundles listed, described, verified and packed; and how fast they run."""

import importlib
import importlib.util
import json
import logging
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from motet.bench import Machine, Row, better, compared
from motet.bundle.bundle import Bundle, list_bundles
from motet.bundle.graph import SessionOptions
from motet.cli.options import session_options
from motet.errors import FormatError
from motet.models.base import BundleModel
from motet.models.load import load
from motet.models.load import verify as verify_bundle

log = logging.getLogger(__name__)


@click.group()
def bundle() -> None:
    """List, inspect, verify and pack models (bundles). NAME is the name of a bundle, or its folder or zip."""


@bundle.command("list")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def list_(as_json: bool) -> None:
    """List the installed bundles."""
    found: list[dict[str, Any]] = []
    for one in map(Bundle.open, list_bundles().values()):
        manifest, size = one.manifest, sum(entry.size for entry in one.manifest.files.values())
        about = {"name": one.name, "version": manifest.version, "verb": manifest.verb, "model": manifest.model}
        found.append({**about, "size": size, "licence": manifest.licence.get("weights")})
    if as_json:
        click.echo(json.dumps(found))
        return
    for row in found:
        megabytes, licence = row["size"] / 1e6, row["licence"] or "not stated"
        click.echo(f"{row['name']:<16} {row['version']:<6} {row['verb']:<10} {megabytes:6.2f} MB  {licence}")


@bundle.command()
@click.argument("name")
@click.option("--json", "as_json", is_flag=True, help="Print the whole manifest.")
def info(name: str, as_json: bool) -> None:
    """Show a bundle's inputs and outputs, licence, parity and quality."""
    manifest = Bundle.open(name).manifest
    if as_json:
        click.echo(json.dumps(manifest.source, indent=1))
        return
    click.echo(f"{manifest.name} {manifest.version}: {manifest.verb} by {manifest.model}, decoded by {manifest.loop}")
    click.echo(f"{len(manifest.motion.channels)} channels at {manifest.motion.fps:g} fps")
    for key in ("control", "defaults", "settings", "licence", "training", "quality", "parity"):
        if values := manifest.source.get(key):
            click.echo(f"\n{key}")
            _tree({k: v for k, v in values.items() if k not in ("starts", "kinds")})  # long: with --json alone


def _tree(values: dict[str, Any], indent: str = "  ") -> None:
    for key, value in values.items():
        if isinstance(value, dict):
            click.echo(f"{indent}{key}")
            _tree(value, indent + "  ")
        else:
            click.echo(f"{indent}{key}: {'not stated' if value is None else value}")


@bundle.command(short_help="Check that a bundle works here.")
@click.argument("name")
@session_options
def verify(name: str, session: SessionOptions) -> None:
    """Check that a bundle works here: its files and graphs, its model, and its golden vectors, replayed."""
    opened = Bundle.open(name)
    found = verify_bundle(opened, session)
    worst = max(found.errors, key=found.errors.__getitem__)
    click.echo(f"{opened.path}: {len(found.files)} files match the manifest")
    click.echo(f"the model runs on {', '.join(found.providers) or 'numpy alone'}")
    click.echo(
        f"golden vectors: the largest difference is {found.errors[worst]:.1e} ({worst}), tolerance {found.tolerance:g}"
    )


@bundle.command()
@click.argument("name")
@click.option("-o", "--out", required=True, type=Path, help="The .zip to write.")
def pack(name: str, out: Path) -> None:
    """Pack a bundle into one zip: the same bytes for the same bundle."""
    if out.suffix != ".zip":
        raise click.UsageError(f"a packed bundle is a .zip, not {out.name!r}")
    Bundle.open(name).pack(out)
    click.echo(str(out))


@click.command()
@click.option("--bundle", default="control", show_default=True, help="Name or path of a bundle; all: all that ship.")
@click.option("--motion", type=Path, help="Motion file to describe.  [default: a generated one of 2.8 s]")
@click.option("--seconds", default=1.0, show_default=True, help="How long to measure each row.")
@click.option("--torch/--no-torch", default=True, help="Measure torch too, if it is installed.  [default: --torch]")
@click.option("--compare", type=Path, metavar="OLD", help="What --json printed: also how much better each row is.")
@session_options
@click.option("--json", "as_json", is_flag=True, help="Print the machine and, of each bundle, a list of rows.")
def bench(
    bundle: str,
    motion: Path | None,
    seconds: float,
    torch: bool,
    compare: Path | None,
    as_json: bool,
    session: SessionOptions,
) -> None:
    """Measure a bundle's speed, and torch's where it is installed, in turn; and the machine's own ceilings."""
    old, machine = {} if compare is None else _earlier(compare), Machine.here()
    if machine.busy:
        log.warning("the machine is busy (load %.1f on %d cores): figures are too low", machine.load, machine.cores)
    for key in ("processor", "cores", "versions"):
        if old and old["machine"].get(key) != (now := getattr(machine, key)):
            log.warning("%s: another machine or version: %s %s, now %s", compare, key, old["machine"].get(key), now)
    found: dict[str, list[Row]] = {}
    for name in list_bundles() if bundle == "all" else [bundle]:
        model = load(name, session)
        found[name] = _measured(model, motion, seconds, torch, session)
        if not as_json:
            click.echo(f"{name} on {', '.join(model.providers) or 'numpy'}, threads: {session.threads}")
            _print(found[name], {row["name"]: row["value"] for row in old.get("bundles", {}).get(name, [])})
    if as_json:
        rows = {name: list(map(asdict, of)) for name, of in found.items()}
        click.echo(json.dumps({"machine": asdict(machine), "bundles": rows}))
    else:
        ceilings = f"{machine.gflops:.0f} GFLOP/s in float32 products, copies {machine.gigabytes:.1f} GB/s"
        click.echo(f"{machine.processor}, by numpy: {ceilings}")


def _measured(
    model: BundleModel, motion: Path | None, seconds: float, torch: bool, session: SessionOptions
) -> list[Row]:
    """The rows of a model, beside torch where that is wanted, installed, and has graphs to run."""
    models = [model]
    if torch and model.graphs and importlib.util.find_spec("torch"):
        # by name: the runtime does not depend on the training package
        models.append(importlib.import_module("motet_train.runs").eager_model(model.manifest, session.threads))
    return compared(models, seconds, motion)


def _print(rows: list[Row], before: dict[str, float]) -> None:
    for row in rows:
        beside = "" if row.baseline is None else f" torch eager {row.baseline:>12,.1f}"
        ratio = "" if row.ratio is None else f"  x{row.ratio:.2f}"
        gain = better(row.value / before[row.name], row.unit) if row.name in before else None
        since = "" if gain is None else f"  x{gain:.2f} of before"
        click.echo(f"{row.name:<28} {row.value:>12,.1f} {row.unit:<10}{beside}{ratio}{since}")


def _earlier(file: Path) -> dict[str, Any]:
    """What ``--json`` printed."""
    try:
        found: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
        known = [(row["name"], float(row["value"])) for rows in found["bundles"].values() for row in rows]
        if not known or not isinstance(found["machine"], dict):
            raise ValueError("no rows")
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise FormatError(file, f"not what motet bench --json prints: {error}") from error
    return found
