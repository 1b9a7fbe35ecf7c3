"""``motet predict``: a motion in, what follows out."""

from pathlib import Path

import click

from motet.bundle.session import SessionOptions
from motet.cli.convert import METRES
from motet.cli.notes import note, refused, unit_option
from motet.cli.options import session_options
from motet.errors import MotionError
from motet.formats import check_writable, read_motion, write_motion
from motet.models.load import load_as
from motet.models.predict import PredictModel
from motet.motion.motion import Motion


@click.command()
@click.argument("source", type=Path, metavar="MOTION")
@click.option("-o", "--out", required=True, type=Path, help="File to write; its extension says the format.")
@click.option("--bundle", default="cmu-predict", show_default=True, help="Name or path of a bundle.")
@click.option("--frames", type=click.IntRange(1), help="How many to predict. [default: the bundle's horizon]")
@click.option("--append", is_flag=True, help="Write the motion too, and what follows behind it.")
@unit_option
@session_options
def predict(
    source: Path,
    out: Path,
    bundle: str,
    frames: int | None,
    append: bool,
    unit_in: str | None,
    session: SessionOptions,
) -> None:
    """Carry the motion file MOTION on from its last frames, and write what follows.

    The file must have the joints of the bundle's figure; the frames come at the bundle's frame rate.
    """
    check_writable(out)
    model = load_as(PredictModel, bundle, session)
    motion = _read(source, unit_in)
    try:
        found = model.predict(motion, frames, append)
    except MotionError as error:
        raise refused(source, error) from error
    if abs(motion.fps - model.fps) > 1e-6:
        note(f"{source}: resampled from {motion.fps:g} to {model.fps:g} fps")
    write_motion(out, found)
    click.echo(f"{out}: {len(found)} frames at {found.fps:g} fps, {found.duration:g} s")


def _read(path: Path, unit_in: str | None) -> Motion:
    motion = read_motion(path)
    if unit_in and motion.skeleton and motion.skeleton.metres_per_unit is None:
        motion = motion.with_unit(METRES[unit_in])
    return motion
