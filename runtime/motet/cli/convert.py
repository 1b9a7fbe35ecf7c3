"""``motet convert`` and ``motet view``: motion files from one format to another, or to a page that plays."""

import tempfile
from pathlib import Path

import click

from motet.formats import check_writable, read_motion, write_motion
from motet.motion.mirror import mirror as mirrored
from motet.motion.motion import Motion

_PARTIAL = click.option("--partial", is_flag=True, help="Take the whole frames of a file that breaks off.")

METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "inch": 0.0254}


@click.command()
@click.argument("source", type=Path)
@click.argument("out", type=Path)
@click.option("--fps", type=float, help="Resample to this frame rate.")
@click.option("--from", "start", type=float, default=0.0, help="Cut: seconds from the start.")
@click.option("--to", "stop", type=float, help="Cut: seconds to stop at.")
@click.option("--mirror", is_flag=True, help="Swap left and right.")
@click.option("--unit", type=click.Choice(list(METRES)), help="Length unit to write.")
@click.option("--unit-in", type=click.Choice(list(METRES)), help="Length unit of SOURCE, where the file does not say.")
@_PARTIAL
def convert(
    source: Path,
    out: Path,
    fps: float | None,
    start: float,
    stop: float | None,
    mirror: bool,
    unit: str | None,
    unit_in: str | None,
    partial: bool,
) -> None:
    """Convert the motion file SOURCE to OUT; the extensions say the formats.

    Reads .amc (with its .asf) .bvh .npz .csv .xml (MMM); writes .amc .bvh .npz .csv .html .gif .glb.
    """
    check_writable(out)
    motion = read_motion(source, partial)
    if start or stop is not None:
        motion = motion.cut(start, stop)
    motion = _in_unit(motion, unit, unit_in)
    motion = motion.resample(fps) if fps else motion
    write_motion(out, mirrored(motion) if mirror else motion)
    click.echo(f"{out}: {len(motion)} frames at {motion.fps:g} fps, {motion.duration:g} s")


@click.command()
@click.argument("source", type=Path)
@click.option("-o", "--out", type=Path, help="Page to write. [default: a new file in the temporary folder]")
@_PARTIAL
def view(source: Path, out: Path | None, partial: bool) -> None:
    """Write a self-contained page that plays the motion file SOURCE, and print its path."""
    motion = read_motion(source, partial)
    if out is None:
        out = Path(tempfile.mkdtemp(prefix="motet-")) / f"{source.stem}.html"
    check_writable(out)
    write_motion(out, motion)
    click.echo(str(out))


def _in_unit(motion: Motion, unit: str | None, unit_in: str | None) -> Motion:
    if unit_in:
        motion = motion.with_unit(METRES[unit_in])
    return motion.scaled(METRES[unit]) if unit else motion
