"""``motet predict``, ``fill``, ``join`` and ``control``: motions from other motions, or from a script."""

import json
import re
from collections.abc import Iterator, Sequence
from inspect import signature
from pathlib import Path
from typing import Any

import click

from motet.bundle.graph import SessionOptions
from motet.cli.options import Tries, bar, bundle_option, naming, noted, session_options, warned
from motet.cli.reading import Read, read_options
from motet.cli.writing import Output, out_option, places, size, spare, write_options
from motet.errors import ControlError, MotionError, quoted
from motet.formats import names_motion
from motet.generate.base import GenerateModel
from motet.generate.model import CodesModel
from motet.models.control import ControlModel
from motet.models.load import load_as
from motet.motion.motion import Motion
from motet.predict.fill import JOIN_SECONDS, LOOP_SECONDS, FillModel, Gap
from motet.predict.model import MAX_SAMPLES, PredictModel
from motet.steering.model import SteerModel
from motet.steering.scripts import parse_orders


@click.command()
@click.argument("sources", nargs=-1, required=True, type=Path, metavar="MOTION...")
@out_option
@bundle_option("predict")
@click.option("--frames", type=click.IntRange(1, 100_000), help="Frames to predict. [default: the bundle's horizon]")
@click.option("--seconds", type=click.FloatRange(0, min_open=True), help="The same in seconds.")
@click.option("--append", is_flag=True, help="Write the motion too, then the prediction.")
@click.option(
    "--samples", type=click.IntRange(1, MAX_SAMPLES), help="Number of different futures to write for each motion."
)
@click.option(
    "--seed", type=click.IntRange(0), default=0, show_default=True, help="Seed; later samples use seed + 1, ..."
)
@click.option(
    "--beyond",
    default="generate",
    show_default=True,
    metavar="BUNDLE",
    help="Model that continues beyond the horizon and gives samples; none: the predictor alone, which dies away.",
)
@write_options
@session_options
@read_options
@click.option("--json", "as_json", is_flag=True, help="Print a list with input and samples of each motion.")
def predict(
    sources: tuple[Path, ...],
    out: Path,
    bundle: str,
    frames: int | None,
    seconds: float | None,
    samples: int | None,
    beyond: str,
    output: Output,
    as_json: bool,
    session: SessionOptions,
    read: Read,
    **drawn: Any,
) -> None:
    """Continue motion files from their last frames, and write the predictions.

    A file may be of any human figure, and is continued on its own skeleton, at the bundle's frame rate. With several
    files or samples OUT holds {name} or {clip} for their names, or the results are numbered: out-1.bvh, out-2.bvh, ...
    More frames than the bundle's horizon come from a bundle that writes codes (--beyond): walks walk on, runs run.
    With --samples all frames do, and the futures differ as far as the motion leaves it open.
    """
    motion_sources = read.sources(sources)
    outs = iter(places(out, motion_sources, samples or 1, output))
    model = load_as(PredictModel, bundle, session)
    tries = Tries()
    count = model.count(seconds, frames)
    rows = []
    writer = _writer(beyond, session, samples, count > model.horizon)
    for source in motion_sources:
        source_outs = [next(outs) for _ in range(samples or 1)]
        with tries.of(source) as caught:
            futures, expected = _futures(model, read(source), writer, samples, count, **drawn)
            facts = _written(futures, source_outs, source.title, output, count, drawn["seed"])
            facts |= {"in_place": bool(caught), "beyond": writer and beyond}
            rows.append({"input": str(source), **facts, **expected})
            if not as_json:
                click.echo("\n".join(_lines(rows[-1], drawn["append"])))
    output.finish()
    if as_json and rows:
        click.echo(json.dumps(rows))
    read.say_resampled(lambda: model.fps)
    tries.finish()


def _writer(beyond: str, session: SessionOptions, samples: int | None, far: bool) -> CodesModel | None:
    """What continues after the horizon, where more is asked than a predictor gives by itself."""
    if beyond == "none":
        if samples is not None:
            raise click.UsageError("a predictor has one future: --samples does not go with --beyond none")
        return None
    return load_as(CodesModel, beyond, session) if far or samples is not None else None


def _futures(
    model: PredictModel, motion: Motion, writer: CodesModel | None, samples: int | None, frames: int, **drawn: Any
) -> tuple[list[Motion], dict[str, list[float]]]:
    """The futures of a motion, one where no number of samples is asked; how far off the predictor's frames may be.

    writer: what continues after the horizon; nothing is known of how far off its frames are.
    """
    try:
        if writer is not None and samples is not None:
            with bar("drawing") as progress:
                future_options = {"beyond": writer, "frames": frames, "progress": progress, **drawn}
                return model.futures(motion, samples=samples, **future_options), {}
        predicted = model.predict(motion, frames=frames, beyond=writer, **drawn)
    except MotionError as error:
        if writer is None:
            raise
        raise MotionError(f"{error} (--beyond none continues with the predictor alone)") from error
    if not model.knows_errors:
        return [predicted], {}
    errors = model.expected_errors(motion)[: min(frames, model.horizon if writer is None else model.sure)]
    return [predicted], {"expected_error_cm": [round(float(error), 2) for error in errors]}


def _written(
    futures: Sequence[Motion], outs: Sequence[Path], name: str, output: Output, frames: int, seed: int
) -> dict[str, Any]:
    """Write the futures of a motion; what is said of them."""
    start = (len(futures[0]) - frames) / futures[0].fps
    captions = [(0.0, "given"), (start, "predicted")] if start > 0 else [(0.0, "predicted")]
    first, *_ = [output.write(place, future, name, captions) for future, place in zip(futures, outs, strict=True)]
    samples = [{"output": str(place), "seed": seed + i} for i, place in enumerate(outs)]
    facts = {"fps": first.fps, "frames": len(first), "seconds": first.duration, "start": round(start * first.fps)}
    return {**facts, "samples": samples}


def _lines(row: dict[str, Any], append: bool) -> Iterator[str]:
    start = row["start"]
    joint = f", predicted from {start / row['fps']:.3g} s on (frame {start}, counted from 0)" if append else ""
    for sample in row["samples"]:
        yield f"{sample['output']}: {size(row['frames'], row['fps'])}{joint}"


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
            click.echo(f"{place}: {size(len(result), result.fps)}")
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
    click.echo(f"{out}: {size(len(joined), joined.fps)}")


@click.command()
@click.argument("script")
@out_option
@bundle_option("control")
@click.option("--start", help="Where to start: a gait or label, or a motion file to continue.")
@click.option("--seed", type=click.IntRange(0), help="Seed, for models with noise.  [default: 0]")
@click.option(
    "--variety",
    type=click.FloatRange(0, 1),
    help="For models that sample: 0 is always the same, 1 fully sampled.  [default: 0]",
)
@click.option(
    "--temperature",
    type=click.FloatRange(0.01, 100),
    help="Sampling temperature of models that sample; lower is more deterministic.  [default: the bundle's]",
)
@click.option("--loose-feet", "hold_feet", flag_value=False, default=None, help="Do not hold standing feet.")
@click.option(
    "--no-smooth", "smooth", flag_value=False, default=None, help="Show a trembling net's frames as they are."
)
@write_options
@session_options
@read_options
def control(
    script: str,
    out: Path,
    bundle: str,
    start: str | None,
    output: Output,
    session: SessionOptions,
    read: Read,
    **settings: Any,
) -> None:
    """Run SCRIPT, such as "walk 3s speed 1.4, turn left 90, run 4s, stop", and write the motion.

    Orders are separated by commas: a gait, "turn" or "stop", and in any order seconds ("3s"), a speed in m/s ("speed
    1.4"), a way ("backwards", "left", "right") and a turn in degrees ("turn left 90"). "act jump" does something
    once, "act 'wave'" as the bundle generate shows it.
    With --bundle tdbn: a label and seconds; a ramp "walk>run 5s"; a mix "walk*.3+run*.7 2s".
    """
    output.check(out)
    model = load_as(ControlModel, bundle, session)
    chosen = {name: value for name, value in settings.items() if value is not None}
    if unknown := chosen.keys() - signature(model.run).parameters.keys():
        raise ControlError(f"{model!r} has no setting {', '.join(map(repr, sorted(unknown)))}")
    captions = model.captions(script)
    with naming(start), noted():
        first = read(Path(start)) if start and (Path(start).suffix or names_motion(start)) else start
        if isinstance(model, SteerModel) and any(
            order.act and order.act not in model.takes for order in parse_orders(script, model.gaits)
        ):
            chosen["words"] = load_as(GenerateModel, "generate", session)
        motion = model.run(script, first, **chosen)
    motion = output.shaped(motion)
    output.save(out, motion, script, captions)
    output.finish()
    click.echo(f"{out}: {size(len(motion), motion.fps)}")
