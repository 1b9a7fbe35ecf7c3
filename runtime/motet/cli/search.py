"""``motet search``: the motions of a folder that are nearest to a sentence or a motion."""

import json
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import click

from motet.bundle.graph import SessionOptions
from motet.cli.many import jobs_option
from motet.cli.options import bar, bundle_option, json_option, noted, session_options, warned
from motet.cli.reading import unit_option
from motet.errors import FormatError, TextWarning, collected
from motet.formats import names_motion, read_motion
from motet.jobs import Shard
from motet.models.load import load_as
from motet.search.model import INDEX_FILE, Hit, Index, SearchModel


def _indexes(folder: Path) -> list[Path]:
    files = sorted(folder.glob("*.npz")) if folder.is_dir() else [folder]
    if not files:
        raise FormatError(folder, "no indexes of shards (.npz) are in it")
    return files


@click.command()
@click.argument("query")
@click.argument("folder", type=Path)
@click.option("--count", type=click.IntRange(1, 1000), help="Motions to print. [default: the bundle's]")
@bundle_option("search")
@click.option("--index", "file", type=Path, help=f"File for the vectors. [default: {INDEX_FILE} in FOLDER]")
@click.option("--shard", metavar="I/N", help="With --index: index every N-th file from the I-th, such as 3/16.")
@click.option(
    "--merge", multiple=True, type=Path, metavar="FOLDER", help="Take vectors from the indexes (.npz) of shards there."
)
@unit_option
@jobs_option
@session_options
@json_option("Print a list with path, clip, times, score, in_place and like of each.")
def search(
    query: str,
    folder: Path,
    count: int | None,
    bundle: str,
    file: Path | None,
    shard: str | None,
    merge: tuple[Path, ...],
    unit_in: str | None,
    jobs: int | None,
    session: SessionOptions,
    as_json: bool,
) -> None:
    """Find the motions in FOLDER that are nearest to QUERY, a sentence or a motion file; FOLDER may be an index file.

    Each is printed with how near it is (1 is the same) and the seconds in which it is so; of files of several clips,
    each clip is a motion of its own. Those after "?" are the nearest, but not like it. The first search reads and
    embeds all motion files, and later ones those that are new or have changed.
    """
    if shard is not None and file is None:
        raise click.UsageError("--shard writes an index of a part: give --index FILE")
    part = None if shard is None else Shard.parse(shard)
    parts = []
    for path in merge:
        parts += _indexes(path)
    model = load_as(SearchModel, bundle, session)
    motion = read_motion(query, unit=unit_in) if names_motion(query) else None
    if motion is None:
        with noted():
            model.ids(query)  # refused before all motions are read
    with bar("embedding") as progress:
        index = Index.open(folder, model, file, unit=unit_in, jobs=jobs, shard=part, merge=parts, progress=progress)
    with collected(TextWarning), warned(query):  # words are said already
        hits = index.search(query if motion is None else motion, count)
    _told(hits, as_json)
    if not hits[0].like:
        click.echo(f"motet: nothing like {query!r} is in {folder}", err=True)
    for failed, fault in index.failed.items():
        click.echo(f"motet: {failed}: {fault}", err=True)
    sys.exit(1 if index.failed else 0)


def _told(hits: Sequence[Hit], as_json: bool) -> None:
    """Print hits."""
    if as_json:
        click.echo(json.dumps([{**asdict(hit), "path": str(hit.path)} for hit in hits]))
    else:
        for hit in hits:
            note = ", in place: compared with the path that its feet imply" if hit.in_place else ""
            doubt = "" if hit.like else "? "
            click.echo(f"{hit.score:6.2f}  {doubt}{hit.place}  {hit.start:.1f} to {hit.stop:.1f} s{note}")
