"""``motet check``: what motion files hold and how they are understood."""

import json
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, groupby, islice, repeat
from pathlib import Path
from typing import Any

import click

from motet import checked
from motet.checked import Checked
from motet.cli.reading import Read, Source, places, read_options
from motet.cli.writing import size
from motet.errors import FormatError, MotetError
from motet.files import files_in
from motet.formats import CLIPPED, MOCAP, READS, html
from motet.formats.lines import MARK
from motet.motion.humanoid import LENGTH_UNITS, to_humanoid
from motet.motion.motion import Motion

HEAD = ("figure", "sure", "tall m", "seconds", "fps", "facing", "ground m", "travel m", "notes")
COLUMNS = "{:<26}{:>6}{:>8}{:>9}{:>7}{:>11}{:>10}{:>10}{:>7}"
"""Columns of the table, after the name."""

KINDS = tuple(dict.fromkeys((*MOCAP, *CLIPPED)))
"""Types of files that are looked at in a folder."""

NAMES = 12, 48
"""Letters that the table has for the names of files."""


@dataclass(frozen=True)
class Row:
    """What was found of a file or clip, or why nothing was."""

    source: Source
    found: Checked | None
    fault: str | None = None
    page: Path | None = None

    @property
    def verdict(self) -> str:
        """One word."""
        if self.found is None:
            return "unreadable"
        return "refused" if self.found.refused else "understood" if self.found.sure else "unsure"

    @property
    def reason(self) -> str | None:
        """Why it is unreadable or refused."""
        return self.fault if self.found is None else self.found.refused

    def to_json(self) -> dict[str, Any]:
        """What was found, or "file", "clip" and "error"."""
        if self.found is None:
            return {"file": str(self.source.path), "clip": self.source.clip, "error": self.fault}
        return self.found.to_json()


@click.command(
    help=f"""Look at motion files: which figure each has and how sure that is, its size, length, facing, ground, travel.

    A folder, several files and a file of several clips give a table; a single motion gives all that was found, and what
    was assumed. Exit code 1 if anything cannot be read or is no human's motion. Reads {READS}.
    """
)
@click.argument("files", nargs=-1, required=True, type=Path, metavar="FILE|FOLDER...")
@click.option("-o", "--out", type=Path, help="Page (.html) that plays the figure of the file beside the humanoid.")
@read_options
@click.option("--json", "as_json", is_flag=True, help="Print a list of objects, one for each clip.")
def check(files: tuple[Path, ...], out: Path | None, read: Read, as_json: bool) -> None:
    """Look at motion files."""
    if out is not None and out.suffix.lower() != ".html":
        raise click.UsageError(f"-o is a page: expected a name that ends in .html, not {out.name!r}")
    paths = list(_paths(files))
    sources = (source for path in paths for source in read.sources([path], every=True))
    pages: Iterator[Path | None] = repeat(None)
    if out is not None:
        known = list(sources)
        sources, pages = (source for source in known), iter(places(out, known))
    rows = (_row(source, page, read) for source, page in zip(sources, pages, strict=False))
    counts = _print_json(rows) if as_json else _print_text(rows, paths)
    if counts["unreadable"] or counts["refused"]:
        sys.exit(1)


def _paths(files: Sequence[Path]) -> Iterator[Path]:
    for path in files:
        if path.is_dir():
            found = files_in(path, KINDS)
            if not found:
                raise FormatError(path, f"no motion files ({' '.join(KINDS)}) are in it")
            yield from found
        else:
            yield path


def _row(source: Source, page: Path | None, read: Read) -> Row:
    try:
        found = checked.check(source.path, clip=source.clip, **read.options)
        if page is not None:
            _write_page(page, read(source), found)
        return Row(source, found, page=page)
    except MotetError as error:
        return Row(source, None, str(error).removeprefix(f"{source.path}: ").removeprefix(f"{source.path}, "))


def _write_page(page: Path, motion: Motion, found: Checked) -> None:
    figures = {"as in the file": motion}
    if found.refused is None:
        figures["as the humanoid"] = to_humanoid(motion).motion
    title = Path(found.file).name + (f"{MARK}{found.clip}" if found.clip else "")
    html.write_many(page, list(figures.values()), list(figures), title)


def _print_json(rows: Iterator[Row]) -> Counter[str]:
    """The list, one line for each row as it is found."""
    counts: Counter[str] = Counter()
    for row in rows:
        click.echo(("," if counts.total() else "[") + json.dumps(row.to_json()))
        counts[row.verdict] += 1
    click.echo("]" if counts else "[]")
    return counts


def _print_text(rows: Iterator[Row], paths: Sequence[Path]) -> Counter[str]:
    """A report of one row, a table of several, line by line as they are found."""
    first = list(islice(rows, 2))
    if len(first) < 2:
        for row in first:
            click.echo("\n".join(_report(row)))
        return Counter(row.verdict for row in first)
    counts: Counter[str] = Counter()
    width = min(max(NAMES[0], *(len(str(path)) for path in paths)) + 2, NAMES[1])
    click.echo(f"{'file':<{width}}{COLUMNS.format(*HEAD)}")
    for file, of_file in groupby(chain(first, rows), key=lambda row: row.source.path):
        last = None
        for row in of_file:
            if row.source.clip is not None and last is None:
                click.echo(str(file))
            name = str(file) if row.source.clip is None else f"  #{row.source.clip}"
            said = f"{row.verdict}, as above" if row.reason and last and last.reason == row.reason else _line(row)
            click.echo(f"{name:<{width - 2}}  {said}")
            counts[row.verdict] += 1
            last = row
    click.echo(f"{counts.total()} motions: " + ", ".join(f"{count} {word}" for word, count in counts.items()))
    return counts


def _line(row: Row) -> str:
    found = row.found
    if found is None or found.refused:
        return f"{row.verdict}: {row.reason}"
    figure = f"{found.convention}" if found.sure else f"? {found.convention}"
    return COLUMNS.format(
        figure if len(figure) < 26 else f"{figure[:24]}…",
        f"{found.confidence:.2f}",
        "?" if found.height is None else f"{found.height:.2f}",
        f"{found.seconds:.2f}",
        f"{found.fps:g}",
        _facing(found),
        _metres(found.ground),
        "in place" if found.in_place else _metres(found.travel),
        len(found.notes) or "",
    )


def _report(row: Row) -> Iterator[str]:
    found = row.found
    yield str(row.source)
    if found is None:
        yield from _entry(row.verdict, f"{row.fault}")
        return
    if found.clips:
        yield from _entry("clip", f"{found.clip}, {found.clips.index(found.clip or '') + 1} of {len(found.clips)}")
    yield from _entry("refused", found.refused) if found.refused else _understood(found)
    yield from _entry("length", size(found.frames, found.fps))
    yield from _entry("assumed", *found.notes)
    if row.page is not None:
        yield from _entry("page", str(row.page))


def _understood(found: Checked) -> Iterator[str]:
    unsure = "" if found.sure else ": look at it, or give a map (motet convert --map)"
    yield from _entry("figure", f"{found.convention}, confidence {found.confidence:.2f}{unsure}")
    yield from _entry("size", "not known" if found.height is None else f"{found.height:.2f} m tall{_unit(found)}")
    yield from _entry("facing", f"{_facing(found)} in the first frame; ahead is +z")
    yield from _entry("ground", f"soles stand at {_metres(found.ground)} m; lowest point {_metres(found.lowest)} m")
    yield from _entry("travel", "in place" if found.in_place else f"{_metres(found.travel)} m")


def _entry(name: str, *lines: str) -> Iterator[str]:
    """Lines with a name before the first."""
    return (f"  {name if number == 0 else '':<9} {line}" for number, line in enumerate(lines))


def _facing(found: Checked) -> str:
    if found.facing is None:
        return "up or down"
    degrees = round(abs(found.facing))
    return f"{degrees}° {'left' if found.facing > 0 else 'right'}" if degrees else "ahead"


def _metres(value: float | None) -> str:
    return "" if value is None else f"{round(value, 2) + 0.0:.2f}"  # -0.0 is 0.0


def _unit(found: Checked) -> str:
    near = [name for name, metres in LENGTH_UNITS.items() if found.unit and abs(found.unit / metres - 1) < 1e-3]
    return f"; lengths are in {near[0] if near else f'units of {found.unit:g} m'}"
