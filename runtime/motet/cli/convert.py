"""``motet convert`` and ``motet view``: motion files from one format to another, or to a page that plays them."""

import logging
import tempfile
from collections.abc import Sequence
from pathlib import Path

import click

from motet.cli.reading import Read, Source, Tries, places, read_options
from motet.cli.writing import Output, size, write_options
from motet.formats import READS, WRITES, write_motion
from motet.motion.feet.contacts import lay_root_path
from motet.motion.feet.hold import hold_feet as feet_held
from motet.motion.humanoid import read_map, to_humanoid
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
@click.argument("files", nargs=-1, required=True, type=Path, metavar="IN... [OUT]")
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
def convert(
    files: Sequence[Path],
    out: Path | None,
    start: float,
    stop: float | None,
    mirror: bool,
    unit: str | None,
    humanoid: bool,
    map_file: Path | None,
    travel: bool,
    hold_feet: bool,
    loop: bool,
    output: Output,
    read: Read,
) -> None:
    """Convert motion files."""
    if out is None:
        if len(files) != 2:
            raise click.UsageError("give IN and OUT, or several files and -o OUT")
        *files, out = files
    sources, tries = read.sources(files), Tries()
    for source, place in zip(sources, places(out, sources, output=output), strict=True):
        with tries.of(source):
            motion = _cut(read(source), start, stop)
            if humanoid or map_file or hold_feet:
                motion = _to_humanoid(motion, map_file)
            motion = lay_root_path(motion, keep_height=True) if travel else motion
            motion = feet_held(motion) if hold_feet else motion
            motion = output.shaped(motion)
            motion = motion.scaled(METRES[unit]) if unit else motion
            motion = looped(motion) if loop else motion
            output.save(place, mirrored(motion) if mirror else motion, source.title)
            click.echo(f"{place}: {size(len(motion), motion.fps)}")
    output.finish()
    tries.finish()


@click.command()
@click.argument("sources", nargs=-1, required=True, type=Path, metavar="MOTION...")
@click.option("-o", "--out", type=Path, help="Page to write. [default: a new file in the temporary folder]")
@read_options
def view(sources: tuple[Path, ...], out: Path | None, read: Read) -> None:
    """Write a self-contained page that plays each motion file, and print its path."""
    tries, given = Tries(), read.sources(sources)
    pages = places(out, given) if out else [_new_page(source) for source in given]
    for source, page in zip(given, pages, strict=True):
        with tries.of(source):
            write_motion(page, read(source))
            click.echo(str(page))
    tries.finish()


def _new_page(source: Source) -> Path:
    name = source.name if source.clip is None else source.label
    return Path(tempfile.mkdtemp(prefix="motet-")) / f"{name}.html"


def _to_humanoid(motion: Motion, map_file: Path | None) -> Motion:
    found = to_humanoid(motion, read_map(map_file, skeleton_of(motion)) if map_file else None)
    log.info("brought to the humanoid: %s", found.summary)
    return found.motion


def _cut(motion: Motion, start: float, stop: float | None) -> Motion:
    return motion.cut(start, stop) if start or stop is not None else motion
