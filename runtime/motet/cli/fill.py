"""``motet fill`` and ``join``: gaps of motions filled, loops closed, motions joined."""

import re
from collections.abc import Sequence
from pathlib import Path

import click

from motet.bundle.graph import SessionOptions
from motet.cli.options import Tries, bundle_option, naming, session_options, warned
from motet.cli.reading import Read, read_options
from motet.cli.writing import Output, out_option, places, say_written, spare, write_options
from motet.errors import quoted
from motet.models.load import load_as
from motet.predict.fill import JOIN_SECONDS, LOOP_SECONDS, FillModel, Gap


def _gaps(context: click.Context, option: click.Parameter, texts: tuple[str, ...]) -> tuple[Gap, ...]:
    """What ``--gap`` gives, as two numbers each."""
    number = r"\s*([-+]?(?:\d+\.?\d*|\.\d+))\s*"
    gaps = []
    for text in texts:
        if (parts := re.fullmatch(f"{number}:{number}", text)) is None:
            raise click.BadParameter(f"{quoted(text)} is no gap: give its start and stop in seconds, such as 1.0:2.0")
        gaps.append((float(parts[1]), float(parts[2])))
    return tuple(gaps)


def _filled(gaps: Sequence[Gap]) -> list[tuple[float, str]]:
    """What a page says when: what is filled, and what was given."""
    captions = [(0.0, "given")]
    for start, stop in sorted(gaps):
        captions += [(start, "filled"), (max(start, stop), "given")]
    return sorted(captions, key=lambda caption: caption[0])


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
@bundle_option("fill")
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
    motion_sources = read.sources(sources)
    outs = places(out, motion_sources, output=output)
    model = load_as(FillModel, bundle, session)
    tries = Tries()
    for source, place in zip(motion_sources, outs, strict=True):
        with tries.of(source):
            motion = read(source)
            if loop:
                result = model.looped(motion, seconds=LOOP_SECONDS if seconds is None else seconds)
                filled: Sequence[Gap] = [(motion.duration, result.duration)]
            else:
                result = model.fill(motion, gaps)
                filled = gaps
            result = output.write(place, result, source.title, _filled(filled))
            say_written(place, result)
    output.finish()
    tries.finish()


@click.command()
@click.argument("first", type=Path)
@click.argument("second", type=Path)
@out_option
@click.option("--seconds", type=float, default=JOIN_SECONDS, show_default=True, help="How long the transition takes.")
@bundle_option("fill")
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
    before = read(first)
    after = read(second)
    with naming(f"{first} and {second}"), warned(f"{first} and {second}"):
        joined = model.join(before, after, seconds=seconds)
    captions = [(0.0, first.stem), (before.duration, "filled"), (joined.duration - after.duration, second.stem)]
    joined = output.write(out, joined, f"{first.stem} {second.stem}", captions)
    output.finish()
    say_written(out, joined)
