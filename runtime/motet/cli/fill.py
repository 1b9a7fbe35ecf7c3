"""``motet fill`` and ``motet join``: gaps of motions, loops, and transitions between two."""

import re
from pathlib import Path

import click

from motet.bundle.graph import SessionOptions
from motet.cli.options import session_options
from motet.cli.reading import Read, Tries, naming, out_option, places, read_options
from motet.cli.writing import Output, size, spare, write_options
from motet.errors import quoted
from motet.models.fill import JOIN_SECONDS, LOOP_SECONDS, FillModel, Gap
from motet.models.load import load_as

bundle_option = click.option("--bundle", default="fill", show_default=True, help="Name or path of a bundle.")


NUMBER = r"\s*([-+]?(?:\d+\.?\d*|\.\d+))\s*"


def _gaps(context: click.Context, option: click.Parameter, texts: tuple[str, ...]) -> tuple[Gap, ...]:
    """What ``--gap`` gives, as two numbers each."""
    found = [re.fullmatch(f"{NUMBER}:{NUMBER}", text) for text in texts]
    for text, parts in zip(texts, found, strict=True):
        if parts is None:
            raise click.BadParameter(f"{quoted(text)} is no gap: give its start and stop in seconds, such as 1.0:2.0")
    return tuple((float(parts[1]), float(parts[2])) for parts in found if parts is not None)


@click.command()
@click.argument("sources", nargs=-1, required=True, type=Path, metavar="MOTION...")
@out_option
@click.option(
    "--gap",
    "gaps",
    multiple=True,
    callback=_gaps,
    metavar="START:STOP",
    help="Seconds to fill, from the first frame that is replaced to the first that stays; may be given several times.",
)
@click.option("--loop", is_flag=True, help="Add a transition from the end to the start instead.")
@click.option("--seconds", type=float, help=f"With --loop: how long it takes. [default: {LOOP_SECONDS}]")
@bundle_option
@write_options
@session_options
@read_options
def fill(
    sources: tuple[Path, ...],
    out: Path,
    gaps: tuple[Gap, ...],
    loop: bool,
    seconds: float | None,
    bundle: str,
    output: Output,
    session: SessionOptions,
    read: Read,
) -> None:
    """Fill gaps of motion files, or close them to loops; all other frames stay as they are.

    What a file has in its gaps is not looked at. It may be of any human figure and at any frame rate. With several
    files OUT holds {name} or {clip} for their names, or the results are numbered: out-1.bvh, out-2.bvh, ...
    """
    if loop == bool(gaps) or (seconds is not None and not loop):
        raise click.UsageError("give --gap START:STOP, once or several times, or --loop, with --seconds if you like")
    given = read.sources(sources)
    outs = places(out, given, output=output)
    model, tries = load_as(FillModel, bundle, session), Tries()
    for source, place in zip(given, outs, strict=True):
        with tries.of(source):
            motion = read(source)
            if loop:
                found = model.looped(motion, seconds=LOOP_SECONDS if seconds is None else seconds)
            else:
                found = model.fill(motion, gaps)
            found = output.write(place, found, source.title)
            click.echo(f"{place}: {size(len(found), found.fps)}")
    output.finish()
    tries.finish()


@click.command()
@click.argument("first", type=Path)
@click.argument("second", type=Path)
@out_option
@click.option("--seconds", type=float, default=JOIN_SECONDS, show_default=True, help="How long the transition takes.")
@bundle_option
@write_options
@session_options
@read_options
def join(
    first: Path,
    second: Path,
    out: Path,
    seconds: float,
    bundle: str,
    output: Output,
    session: SessionOptions,
    read: Read,
) -> None:
    """Join the motion files FIRST and SECOND by a transition.

    SECOND is set down where FIRST leads, facing as it does, and brought to its frame rate and figure.
    """
    spare(out, first, second)
    model = load_as(FillModel, bundle, session)
    one, other = read(first), read(second)
    with naming(f"{first} and {second}"):
        found = model.join(one, other, seconds=seconds)
    found = output.write(out, found, f"{first.stem} {second.stem}")
    output.finish()
    click.echo(f"{out}: {size(len(found), found.fps)}")
