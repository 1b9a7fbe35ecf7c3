"""``motet convert`` and ``view``: motion files brought to other formats, and played."""

import hashlib
import logging
import pickle
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import click

from motet.cli.many import Many, many_options
from motet.cli.options import Tries
from motet.cli.reading import Read, read_options
from motet.cli.writing import Output, places, size, write_options
from motet.corpus.answers import Answer, Verb
from motet.corpus.sources import Source, files_of
from motet.figures.feet.hold import hold_feet as feet_held
from motet.figures.feet.treadmill import with_travel
from motet.figures.humanoid import read_map, to_humanoid
from motet.files import Json
from motet.formats import READS, WRITES, write_motion
from motet.motion.kinematics import skeleton_of
from motet.motion.looping import looped
from motet.motion.mirroring import mirror as mirrored
from motet.motion.motion import Motion
from motet.motion.skeleton import METRES

log = logging.getLogger(__name__)


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

    def about(self) -> Json:
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
