"""``motet check``, ``convert`` and ``view``: motion files looked at, brought to other formats, and played."""

import hashlib
import logging
import pickle
import sys
import tempfile
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, groupby
from pathlib import Path
from typing import Any

import click

from motet.cli.many import Many, many_options, print_list
from motet.cli.options import Tries
from motet.cli.reading import Read, read_options
from motet.cli.writing import Output, places, size, write_options
from motet.corpus.answers import Answer, Check, Verb, to_json
from motet.corpus.checked import Checked
from motet.corpus.sources import Source, files_of
from motet.draw.page import write_many
from motet.figures.feet.hold import hold_feet as feet_held
from motet.figures.feet.treadmill import with_travel
from motet.figures.humanoid import LENGTH_UNITS, read_map, to_humanoid
from motet.formats import READS, WRITES, write_motion
from motet.motion.kinematics import skeleton_of
from motet.motion.looping import looped
from motet.motion.mirroring import mirror as mirrored
from motet.motion.motion import Motion
from motet.motion.skeleton import METRES

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
@click.option("--json", "as_json", is_flag=True, help="Print a list of objects, one for each clip.")
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
        last = None
        for row in of_file:
            if row.source.part and last is None:
                click.echo(str(file))
            name = f"  {row.source.part}" if row.source.part else str(file)
            line = f"{row.verdict}, as above" if row.reason and last and last.reason == row.reason else _line(row)
            click.echo(f"{name:<{width - 2}}  {line}")
            last = row
    click.echo(f"{len(sources)} motions: " + ", ".join(f"{count} {word}" for word, count in counts.items()))


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
    facts: list[tuple[str, str]] = []
    if checked.clips:
        facts.append(("clip", f"{checked.clip}, {checked.clips.index(checked.clip or '') + 1} of {len(checked.clips)}"))
    if len(checked.figures) > 1:
        names = ", ".join(checked.figures)
        taken = "the default" if checked.figure is None else checked.figure
        facts.append(("figures", f"{taken}, of {len(checked.figures)}: {names} (--figure)"))
    facts += [("refused", checked.refused)] if checked.refused else _understood(checked)
    facts.append(("length", size(checked.frames, checked.fps)))
    facts += [("" if number else "assumed", note) for number, note in enumerate(checked.notes)]
    if row.source.place is not None:
        facts.append(("page", str(row.source.place)))
    return chain([str(row.source)], (f"  {name:<9} {text}" for name, text in facts))


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


@click.command(
    help=f"""Convert motion files; the extensions give the formats: IN OUT, or IN... -o OUT.

    With several files OUT holds {{name}} for their names, as in -o 'bvh/{{name}}.bvh', or the results are numbered.
    IN.glb#Walk is the clip Walk of a file of several, and --clip all takes each: --clip all -o 'bvh/{{clip}}.bvh'.

    Reads {READS}; writes {WRITES}.
    """
)
@click.argument("files", nargs=-1, required=True, type=Path, metavar="IN|FOLDER|ZIP... [OUT]")
@click.option("-o", "--out", type=Path, help="File to write. [default: the second of two files]")
@click.option("--from", "start", type=click.FloatRange(0), default=0.0, help="Cut: seconds from the start.")
@click.option("--to", "stop", type=click.FloatRange(0, min_open=True), help="Cut: seconds to stop at.")
@click.option("--mirror", is_flag=True, help="Swap left and right.")
@click.option("--unit", type=click.Choice(list(METRES)), help="Length unit to write.")
@click.option("--humanoid", is_flag=True, help="Retarget the motions to the humanoid (docs/humanoid.md).")
@click.option(
    "--map", "map_file", type=Path, metavar="FILE", help="Which joint of IN is which bone, as JSON; implies --humanoid."
)
@click.option("--travel", is_flag=True, help="Give an in-place clip the path that its feet imply.")
@click.option("--hold-feet", is_flag=True, help="Keep feet that stand from sliding; implies --humanoid.")
@click.option("--loop", is_flag=True, help="Cut to a seamless loop, such as strides of a walk.")
@write_options
@read_options
@many_options
def convert(files: Sequence[Path], out: Path | None, output: Output, many: Many, **changes: Any) -> None:
    """Convert motion files."""
    if out is None:
        if len(files) != 2:
            raise click.UsageError("give IN and OUT, or several files and -o OUT")
        *files, out = files
    if many.shard.count > 1:  # all names differ, not only those of this shard
        if "{" not in str(out):
            raise click.UsageError("shards of convert need an OUT with {name} and, for clips, {clip}")
        places(out, list(map(Source, files_of(files))), output=output)
    sources = many.sources(files, every=False)
    outs = places(out, sources, output=output)
    sources = [replace(source, place=place) for source, place in zip(sources, outs, strict=True)]
    many = replace(many, jobs=1) if output.onto else many  # which holds all clips until the end
    verb = Convert(many.read.options, output, Changes(**changes))
    if many.parts and output.onto:
        raise click.UsageError("--parts writes a file for each motion: it does not go with --onto")
    if many.parts:
        many.write_part(verb, sources, files, "converting")
    for answer in many.answers(verb, sources, "converting"):
        for row in answer.rows:
            click.echo(f"{row['output']}: {size(row['frames'], row['fps'])}")
    output.finish()
    many.tries.finish()


@dataclass(frozen=True, kw_only=True)
class Changes:
    """What is done to a motion on its way, as the options of ``motet convert`` say."""

    start: float
    stop: float | None
    mirror: bool
    unit: str | None
    humanoid: bool
    map_file: Path | None
    travel: bool
    hold_feet: bool
    loop: bool


@dataclass(frozen=True)
class Convert(Verb):
    """Writes each motion to its source's place: a row with input, output, frames and fps."""

    output: Output
    changes: Changes

    def about(self) -> dict[str, Any]:
        """Also what is done."""
        figure = hashlib.sha256(pickle.dumps(self.output.character)).hexdigest()
        output = {"fps": self.output.fps, "in_place": self.output.in_place, "figure": figure}
        return {**super().about(), "changes": {key: str(value) for key, value in vars(self.changes).items()}, **output}

    def rows(self, answer: Answer) -> list[Any]:
        """The one row."""
        changes = self.changes
        place = answer.source.place
        assert place is not None
        motion = self.read(answer)
        motion = motion.cut(changes.start, changes.stop) if changes.start or changes.stop is not None else motion
        if changes.humanoid or changes.map_file or changes.hold_feet:
            motion = _to_humanoid(motion, changes.map_file)
        motion = with_travel(motion) if changes.travel else motion
        motion = self.output.shaped(feet_held(motion) if changes.hold_feet else motion)
        motion = motion.scaled(METRES[changes.unit]) if changes.unit else motion
        motion = looped(motion) if changes.loop else motion
        self.output.save(place, mirrored(motion) if changes.mirror else motion, answer.source.title)
        paths = {"input": str(answer.source), "output": str(place)}
        return [{**paths, "frames": len(motion), "fps": motion.fps}]


def _to_humanoid(motion: Motion, map_file: Path | None) -> Motion:
    mapped = to_humanoid(motion, read_map(map_file, skeleton_of(motion)) if map_file else None)
    log.info("brought to the humanoid: %s", mapped.summary)
    return mapped.motion


@click.command()
@click.argument("sources", nargs=-1, required=True, type=Path, metavar="MOTION...")
@click.option("-o", "--out", type=Path, help="Page to write. [default: a new file in the temporary folder]")
@read_options
def view(sources: tuple[Path, ...], out: Path | None, read: Read) -> None:
    """Write a self-contained page that plays each motion file, and print its path."""
    tries = Tries()
    motion_sources = read.sources(sources)
    new = ((source, source.label if source.part else source.name) for source in motion_sources)
    if out:
        pages = places(out, motion_sources)
    else:
        pages = [Path(tempfile.mkdtemp(prefix="motet-")) / f"{name}.html" for _, name in new]
    for source, page in zip(motion_sources, pages, strict=True):
        with tries.of(source):
            write_motion(page, read(source))
            click.echo(str(page))
    tries.finish()
