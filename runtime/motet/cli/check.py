"""``motet check``: what motion files hold and how they are understood."""

import logging
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, groupby
from pathlib import Path
from typing import Any

import click

from motet.cli.many import Many, many_options, print_list
from motet.cli.options import json_option
from motet.cli.reading import read_options
from motet.cli.writing import places, size
from motet.corpus.answers import Answer, Check, to_json
from motet.corpus.checked import Checked
from motet.corpus.sources import Source
from motet.draw.page import write_many
from motet.figures.humanoid import LENGTH_UNITS, to_humanoid
from motet.formats import READS

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Row:
    """What was found of a file or clip, or None. reason: why it is unreadable or refused."""

    source: Source
    checked: Checked | None
    reason: str | None

    @staticmethod
    def of(answer: Answer) -> "Row":
        """What an answer of :class:`Look` says."""
        source = answer.source
        checked = next(iter(answer.rows), None)
        unread = answer.error.removeprefix(f"{source.path}: ").removeprefix(f"{source.path}, ")
        return Row(source, checked, checked.refused if checked else unread)

    @property
    def verdict(self) -> str:
        """One word."""
        if self.checked is None:
            return "unreadable"
        return "refused" if self.reason else "understood" if self.checked.sure else "unsure"


@click.command(
    help=f"""Look at motion files: which figure each has and how sure that is, its size, length, facing, ground, travel.

    A folder, several files and a file of several clips give a table; a single motion gives all that was found, and what
    was assumed. Exit code 1 if anything cannot be read or is no human's motion. Reads {READS}.
    """
)
@click.argument("files", nargs=-1, required=True, type=Path, metavar="FILE|FOLDER|ZIP...")
@click.option("-o", "--out", type=Path, help="Page (.html) that plays the figure of the file beside the humanoid.")
@read_options
@many_options
@json_option("Print a list of objects, one for each clip.")
def check(files: tuple[Path, ...], out: Path | None, many: Many, as_json: bool) -> None:
    """Look at motion files."""
    if out is not None and out.suffix.lower() != ".html":
        raise click.UsageError(f"-o is a page: expected a name that ends in .html, not {out.name!r}")
    sources = many.sources(files)
    if out is not None:
        sources = [replace(source, place=place) for source, place in zip(sources, places(out, sources), strict=True)]
    if many.parts:
        many.write_part(Check(many.read.options), sources, files, "checking")
    counts: Counter[str] = Counter()
    rows = _counted(map(Row.of, many.answers(Look(many.read.options), sources, "checking", named=False)), counts)
    if as_json:
        print_list(map(_json, rows))
    else:
        _print_text(rows, sources, counts)
    if counts["unreadable"] or counts["refused"]:
        sys.exit(1)


class Look(Check):
    """Also writes the page at a source's place."""

    def rows(self, answer: Answer) -> list[Any]:
        """The one row."""
        (checked,) = super().rows(answer)
        source = answer.source
        if source.place is not None:
            bare = "as in the file"
            figures = {bare: self.read(answer)}
            if checked.refused is None:
                figures["as the humanoid"] = to_humanoid(figures[bare]).motion
            title = source.path.name + source.part
            write_many(source.place, list(figures.values()), list(figures), title, bare=[bare])
        return [checked]


def _counted(rows: Iterable[Row], counts: Counter[str]) -> Iterator[Row]:
    for row in rows:
        counts[row.verdict] += 1
        yield row


def _json(row: Row) -> str:
    return to_json(row.checked or {"file": str(row.source.path), "clip": row.source.clip, "error": row.reason})


COLUMNS = "{:<26}{:>6}{:>8}{:>9}{:>7}{:>11}{:>10}{:>10}{:>7}"
"""Columns of the table, after the name."""


def _print_text(rows: Iterator[Row], sources: Sequence[Source], counts: Mapping[str, int]) -> None:
    """A report of one row, a table of several, line by line as they are found and counted."""
    if len(sources) < 2:
        for row in rows:
            click.echo("\n".join(_report(row)))
        return
    width = min(max(12, *(len(str(source.path)) for source in sources)) + 2, 48)  # letters for the names of files
    head = ("figure", "sure", "tall m", "seconds", "fps", "facing", "ground m", "travel m", "notes")
    click.echo(f"{'file':<{width}}{COLUMNS.format(*head)}")
    for file, of_file in groupby(rows, key=lambda row: row.source.path):
        _print_file(file, of_file, width)
    click.echo(f"{len(sources)} motions: " + ", ".join(f"{count} {word}" for word, count in counts.items()))


def _print_file(file: Path, rows: Iterable[Row], width: int) -> None:
    """The lines of one file in the table, below its name where it has several clips."""
    last = None
    for row in rows:
        if row.source.part and last is None:
            click.echo(str(file))
        name = f"  {row.source.part}" if row.source.part else str(file)
        is_as_above = row.reason and last and last.reason == row.reason
        line = f"{row.verdict}, as above" if is_as_above else _line(row)
        click.echo(f"{name:<{width - 2}}  {line}")
        last = row


def _line(row: Row) -> str:
    checked = row.checked
    if checked is None or checked.refused:
        return f"{row.verdict}: {row.reason}"
    figure = f"{checked.convention}" if checked.sure else f"? {checked.convention}"
    return COLUMNS.format(
        figure if len(figure) < 26 else f"{figure[:24]}…",
        f"{checked.confidence:.2f}",
        "?" if checked.height is None else f"{checked.height:.2f}",
        f"{checked.seconds:.2f}",
        f"{checked.fps:g}",
        _facing(checked),
        _metres(checked.ground),
        "in place" if checked.in_place else _metres(checked.travel),
        len(checked.notes) or "",
    )


def _report(row: Row) -> Iterator[str]:
    """All that was found of one motion, as lines."""
    checked = row.checked
    if checked is None:
        return iter((str(row.source), f"  {row.verdict:<9} {row.reason}"))
    facts = _parts_of_file(checked)
    facts += [("refused", checked.refused)] if checked.refused else _understood(checked)
    facts.append(("length", size(checked.frames, checked.fps)))
    facts += [("" if number else "assumed", note) for number, note in enumerate(checked.notes)]
    if row.source.place is not None:
        facts.append(("page", str(row.source.place)))
    return chain([str(row.source)], (f"  {name:<9} {text}" for name, text in facts))


def _parts_of_file(checked: Checked) -> list[tuple[str, str]]:
    """Which clip and figure of the file it is, where there are several."""
    facts = []
    if checked.clips:
        number = checked.clips.index(checked.clip or "") + 1
        facts.append(("clip", f"{checked.clip}, {number} of {len(checked.clips)}"))
    if len(checked.figures) > 1:
        names = ", ".join(checked.figures)
        figure = "the default" if checked.figure is None else checked.figure
        facts.append(("figures", f"{figure}, of {len(checked.figures)}: {names} (--figure)"))
    return facts


def _understood(checked: Checked) -> list[tuple[str, str]]:
    unsure = "" if checked.sure else ": look at it, or give a map (motet convert --map)"
    tall = "not known"
    if checked.height is not None and checked.unit is not None:
        near = (name for name, metres in LENGTH_UNITS.items() if abs(checked.unit / metres - 1) < 1e-3)
        tall = f"{checked.height:.2f} m tall; lengths are in {next(near, f'units of {checked.unit:g} m')}"
    return [
        ("figure", f"{checked.convention}, confidence {checked.confidence:.2f}{unsure}"),
        ("size", tall),
        ("facing", f"{_facing(checked)} in the first frame; ahead is +z"),
        ("ground", f"soles stand at {_metres(checked.ground)} m; lowest point {_metres(checked.lowest)} m"),
        ("travel", "in place" if checked.in_place else f"{_metres(checked.travel)} m"),
    ]


def _facing(checked: Checked) -> str:
    if checked.facing is None:
        return "up or down"
    degrees = round(abs(checked.facing))
    return f"{degrees}° {'left' if checked.facing > 0 else 'right'}" if degrees else "ahead"


def _metres(value: float | None) -> str:
    return "" if value is None else f"{round(value, 2) + 0.0:.2f}"  # -0.0 is 0.0
