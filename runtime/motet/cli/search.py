"""``motet search``: a sentence or a motion file in, the nearest motions of a folder out."""

import json
import sys
import warnings
from dataclasses import asdict
from pathlib import Path

import click

from motet.bundle.graph import SessionOptions
from motet.cli.notes import noted
from motet.cli.options import session_options
from motet.cli.reading import bar, unit_option
from motet.errors import TextWarning
from motet.formats import names_motion, read_motion
from motet.models.load import load_as
from motet.models.search import NAME, Hit, Index, SearchModel


@click.command()
@click.argument("query")
@click.argument("folder", type=Path)
@click.option("--count", type=click.IntRange(1, 1000), help="Motions to print. [default: the bundle's]")
@click.option("--bundle", default="search", show_default=True, help="Name or path of a bundle.")
@click.option("--index", "file", type=Path, help=f"File for the vectors. [default: {NAME} in FOLDER]")
@unit_option
@session_options
@click.option("--json", "as_json", is_flag=True, help="Print a list with path, clip, start, stop and score of each.")
def search(
    query: str,
    folder: Path,
    count: int | None,
    bundle: str,
    file: Path | None,
    unit_in: str | None,
    session: SessionOptions,
    as_json: bool,
) -> None:
    """Find the motions in FOLDER that are nearest to QUERY, a sentence or a motion file; FOLDER may be an index file.

    Each is printed with how near it is (1 is the same) and the seconds in which it is so; of files of several clips,
    each clip is a motion of its own. The first search reads and embeds all motion files, and later ones those that are
    new or have changed.
    """
    model = load_as(SearchModel, bundle, session)
    motion = read_motion(query, unit=unit_in) if names_motion(query) else None
    if motion is None:
        with noted():
            model.ids(query)  # refused before all motions are read
    with bar("embedding") as progress:
        index = Index.open(folder, model, file, unit=unit_in, progress=progress)
    with warnings.catch_warnings(action="ignore", category=TextWarning):  # said already
        hits = index.search(query if motion is None else motion, count)
    _print(hits, as_json)
    for path, fault in index.failed.items():
        click.echo(f"motet: {path}: {fault}", err=True)
    sys.exit(1 if index.failed else 0)


def _print(hits: list[Hit], as_json: bool) -> None:
    if as_json:
        click.echo(json.dumps([{**asdict(hit), "path": str(hit.path)} for hit in hits]))
        return
    for hit in hits:
        click.echo(f"{hit.score:6.2f}  {hit.place}  {hit.start:.1f} to {hit.stop:.1f} s")
