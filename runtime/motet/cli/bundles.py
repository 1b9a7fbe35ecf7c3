"""``motet bundle``: bundles listed, described, verified and packed."""

import json
from pathlib import Path

import click

from motet.bundle.bundle import Bundle, list_bundles
from motet.bundle.graph import SessionOptions
from motet.cli.options import json_option, session_options
from motet.files import Json
from motet.models.load import verify as verify_bundle


@click.group()
def bundle() -> None:
    """List, inspect, verify and pack models (bundles). NAME is the name of a bundle, or its folder or zip."""


@bundle.command("list")
@json_option("Print JSON.")
def list_(as_json: bool) -> None:
    """List the installed bundles."""
    rows: list[Json] = []
    for opened in map(Bundle.open, list_bundles().values()):
        manifest = opened.manifest
        size = sum(entry.size for entry in opened.manifest.files.values())
        about = {"name": opened.name, "version": manifest.version, "verb": manifest.verb, "model": manifest.model}
        rows.append({**about, "size": size, "licence": manifest.licence.get("weights")})
    if as_json:
        click.echo(json.dumps(rows))
        return
    for row in rows:
        megabytes = row["size"] / 1e6
        licence = row["licence"] or "not stated"
        click.echo(f"{row['name']:<16} {row['version']:<6} {row['verb']:<10} {megabytes:6.2f} MB  {licence}")


@bundle.command()
@click.argument("name")
@json_option("Print the whole manifest.")
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


def _tree(values: Json, indent: str = "  ") -> None:
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
    verified = verify_bundle(opened, session)
    worst = max(verified.errors, key=verified.errors.__getitem__)
    click.echo(f"{opened.path}: {len(verified.files)} files match the manifest")
    click.echo(f"the model runs on {', '.join(verified.providers) or 'numpy alone'}")
    click.echo(
        f"golden vectors: the largest difference is {verified.errors[worst]:.1e} ({worst}), "
        f"tolerance {verified.tolerance:g}"
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
