"""``motet predict``: how motions continue."""

from pathlib import Path

import click

from motet.bundle.session import SessionOptions
from motet.cli.options import session_options
from motet.cli.reading import Read, Tries, like_option, out_option, places, read_options, say_resampled
from motet.formats import write_motion
from motet.formats.character import Character
from motet.models.load import load_as
from motet.models.predict import PredictModel


@click.command()
@click.argument("sources", nargs=-1, required=True, type=Path, metavar="MOTION...")
@out_option
@click.option("--bundle", default="predict", show_default=True, help="Name or path of a bundle.")
@click.option("--frames", type=click.IntRange(1, 100_000), help="Frames to predict. [default: the bundle's horizon]")
@click.option("--append", is_flag=True, help="Write the motion too, then the prediction.")
@like_option
@session_options
@read_options
def predict(
    sources: tuple[Path, ...],
    out: Path,
    bundle: str,
    frames: int | None,
    append: bool,
    like: Character | None,
    session: SessionOptions,
    read: Read,
) -> None:
    """Continue motion files from their last frames, and write the predictions.

    A file may be of any human figure, and is continued on its own skeleton, at the bundle's frame rate. With several
    files OUT holds {name} for their names, or the results are numbered: out-1.bvh, out-2.bvh, ...
    """
    outs = places(out, [source.stem for source in sources])
    model, tries, rates = load_as(PredictModel, bundle, session), Tries(), []
    for source, place in zip(sources, outs, strict=True):
        with tries.of(source):
            motion = read(source)
            found = model.predict(motion, frames=frames, append=append)
            write_motion(place, found, like=like)
            rates.append(motion.fps)
            start = len(found) - (frames or model.horizon)
            said = f", predicted from {start / found.fps:.3g} s on (frame {start}, counted from 0)" if append else ""
            click.echo(f"{place}: {len(found)} frames at {found.fps:g} fps, {found.duration:g} s{said}")
    say_resampled(rates, model.fps)
    tries.finish()
