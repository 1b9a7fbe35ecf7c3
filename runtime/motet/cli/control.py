"""``motet control``: a script in, a moving figure out."""

from pathlib import Path

import click

from motet.bundle.session import SessionOptions
from motet.cli.options import session_options
from motet.formats import check_writable, read_motion, write_motion
from motet.formats.html import write as write_html
from motet.models.control import ControlModel
from motet.models.load import load_as
from motet.models.script import parse_script, starts_of


@click.command()
@click.argument("script")
@click.option("-o", "--out", required=True, type=Path, help="File to write; its extension says the format.")
@click.option("--bundle", default="cmu-control", show_default=True, help="Name or path of a bundle.")
@click.option("--start", help="Label to start in, or a motion file to carry on. [default: the script's first label]")
@click.option("--seed", default=0, show_default=True, help="Seed of the noise.")
@click.option("--variety", default=0.0, show_default=True, help="0 always alike, 1 fully sampled.")
@click.option("--temperature", type=float, help="Of the units; lower is more decided. [default: the bundle's]")
@session_options
@click.option("--in-place", is_flag=True, help="Keep the root where it is, instead of laying its path.")
def control(
    script: str,
    out: Path,
    bundle: str,
    start: str | None,
    seed: int,
    variety: float,
    temperature: float | None,
    in_place: bool,
    session: SessionOptions,
) -> None:
    """Run SCRIPT, such as "walk 3s, walk>run 2s, run 3s", and write the motion.

    Segments have commas between them: a label and seconds; a ramp "walk>run 5s"; a mix "walk*.3+run*.7 2s".
    """
    check_writable(out)
    model = load_as(ControlModel, bundle, session)
    segments = parse_script(script, model.labels)
    first = (
        read_motion(start)
        if start and Path(start).suffix
        else start or max(segments[0].start, key=segments[0].start.__getitem__)
    )
    figure = model.start(first, seed=seed, variety=variety, temperature=temperature)
    motion = figure.run(script, in_place)[0]
    if out.suffix.lower() == ".html":
        write_html(out, motion, captions=starts_of(segments), title=script)
    else:
        write_motion(out, motion)
    click.echo(f"{out}: {len(motion)} frames at {motion.fps:g} fps, {motion.duration:g} s")
