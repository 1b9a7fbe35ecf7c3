"""``motet predict``: how motions continue."""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import click

from motet.bundle.graph import SessionOptions
from motet.cli.options import Tries, bar, bundle_option, json_option, seed_option, session_options
from motet.cli.reading import Read, read_options
from motet.cli.writing import Output, out_option, places, size, write_options
from motet.errors import MotionError
from motet.files import Json
from motet.generate.model import CodesModel
from motet.models.load import load_as
from motet.motion.motion import Motion
from motet.predict.model import MAX_SAMPLES, PredictModel


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
@seed_option("Seed; later samples use seed + 1, ...")
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
@json_option("Print a list with input and samples of each motion.")
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
) -> Json:
    """Write the futures of a motion; what is said of them."""
    start = (len(futures[0]) - frames) / futures[0].fps
    captions = [(0.0, "given"), (start, "predicted")] if start > 0 else [(0.0, "predicted")]
    first, *_ = [output.write(place, future, name, captions) for future, place in zip(futures, outs, strict=True)]
    samples = [{"output": str(place), "seed": seed + i} for i, place in enumerate(outs)]
    facts = {"fps": first.fps, "frames": len(first), "seconds": first.duration, "start": round(start * first.fps)}
    return {**facts, "samples": samples}


def _lines(row: Json, append: bool) -> Iterator[str]:
    start = row["start"]
    joint = f", predicted from {start / row['fps']:.3g} s on (frame {start}, counted from 0)" if append else ""
    for sample in row["samples"]:
        yield f"{sample['output']}: {size(row['frames'], row['fps'])}{joint}"
