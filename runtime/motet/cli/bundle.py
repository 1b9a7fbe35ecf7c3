"""``motet bundle``: list, describe, verify and pack bundles."""

import json
from pathlib import Path
from typing import Any

import click

from motet.bundle.bundle import Bundle, list_bundles

_NAME = click.argument("name")


@click.group()
def bundle() -> None:
    """Look at bundles: the models that motet runs. NAME is a default bundle's name, or a folder or zip."""


@bundle.command("list")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def list_(as_json: bool) -> None:
    """List the bundles that come with motet."""
    rows = [_row(Bundle.open(path)) for path in list_bundles().values()]
    if as_json:
        click.echo(json.dumps(rows))
        return
    for row in rows:
        click.echo(f"{row['name']:<16} {row['verb']:<10} {row['size'] / 1e6:6.2f} MB  {row['licence']}")


def _row(bundle: Bundle) -> dict[str, Any]:
    manifest = bundle.manifest
    size = sum(entry["size"] for entry in manifest["files"].values())
    licence = manifest.get("licence", {}).get("weights", "unknown")
    return {"name": bundle.name, "verb": manifest["verb"], "model": manifest["model"], "size": size, "licence": licence}


@bundle.command()
@_NAME
@click.option("--json", "as_json", is_flag=True, help="Print the whole manifest.")
def info(name: str, as_json: bool) -> None:
    """Describe a bundle: what it takes and gives, its licence, parity and quality."""
    manifest = Bundle.open(name).manifest
    if as_json:
        click.echo(json.dumps(manifest, indent=1))
        return
    motion = manifest["motion"]
    click.echo(f"{manifest['name']}: {manifest['verb']} by {manifest['model']}")
    click.echo(f"{len(motion['channels'])} channels at {motion['fps']:g} fps")
    for key in ("control", "defaults", "licence", "training", "quality", "parity"):
        if key in manifest:
            click.echo(f"\n{key}")
            _tree({k: v for k, v in manifest[key].items() if k != "starts"})


def _tree(values: dict[str, Any], indent: str = "  ") -> None:
    for key, value in values.items():
        if isinstance(value, dict):
            click.echo(f"{indent}{key}")
            _tree(value, indent + "  ")
        else:
            click.echo(f"{indent}{key}: {value}")


@bundle.command()
@_NAME
def verify(name: str) -> None:
    """Check every file of a bundle against its manifest, and every graph against its contract."""
    opened = Bundle.open(name)
    click.echo(f"{opened.path}: {len(opened.verify())} files are as the manifest lists them")


@bundle.command()
@_NAME
@click.option("-o", "--out", required=True, type=Path, help="The .zip to write.")
def pack(name: str, out: Path) -> None:
    """Pack a bundle into one zip: the same bytes for the same bundle."""
    if out.suffix != ".zip":
        raise click.UsageError(f"a packed bundle is a .zip, not {out.name!r}")
    Bundle.open(name).pack(out)
    click.echo(str(out))
