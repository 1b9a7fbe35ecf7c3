"""``motet control``: from a script to a motion."""

from functools import partial
from pathlib import Path

import click

from motet.bundle.session import SessionOptions
from motet.cli.options import session_options
from motet.cli.reading import Read, like_option, naming, out_option, read_options
from motet.formats import check_writable, write_motion
from motet.formats.character import Character, put_onto
from motet.formats.html import write as write_html
from motet.models.control import ControlModel
from motet.models.load import load_as
from motet.models.script import parse_script, starts_of


@click.command()
@click.argument("script")
@out_option
@click.option("--bundle", default="control", show_default=True, help="Name or path of a bundle.")
@click.option("--start", help="Label to start in, or a motion file to continue. [default: the script's first label]")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Seed of the noise.")
@click.option(
    "--variety", type=click.FloatRange(0, 1), default=0.0, show_default=True, help="0: always alike; 1: fully sampled."
)
@click.option(
    "--temperature",
    type=click.FloatRange(0.01, 100),
    help="Sampling temperature; lower is more deterministic. [default: the bundle's]",
)
@click.option("--no-smooth", is_flag=True, help="Show the net's frames as they are, which tremble.")
@click.option("--in-place", is_flag=True, help="Leave the root in place, without a path.")
@like_option
@session_options
@read_options
def control(
    script: str,
    out: Path,
    bundle: str,
    start: str | None,
    seed: int,
    variety: float,
    temperature: float | None,
    no_smooth: bool,
    in_place: bool,
    like: Character | None,
    session: SessionOptions,
    read: Read,
) -> None:
    """Run SCRIPT, such as "walk 3s, walk>run 2s, run 3s", and write the motion.

    Segments are separated by commas: a label and seconds; a ramp "walk>run 5s"; a mix "walk*.3+run*.7 2s".
    """
    check_writable(out)
    model = load_as(ControlModel, bundle, session)
    segments = parse_script(script, model.labels)
    with naming(start):
        first = read(Path(start)) if start and Path(start).suffix else start
        sampled = partial(model.run, script, first, seed=seed, variety=variety, temperature=temperature)
        motion = sampled(in_place=in_place, smooth=not no_smooth)
    motion = put_onto(motion, like) if like else motion
    if out.suffix.lower() == ".html":
        write_html(out, motion, captions=starts_of(segments), title=script)
    else:
        write_motion(out, motion)
    click.echo(f"{out}: {len(motion)} frames at {motion.fps:g} fps, {motion.duration:g} s")
