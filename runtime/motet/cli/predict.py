"""``motet predict``: how motions continue."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from motet.bundle.graph import SessionOptions
from motet.cli.options import session_options
from motet.cli.reading import Read, Tries, bar, out_option, places, read_options, say_resampled
from motet.cli.writing import Output, size, write_options
from motet.errors import MotionError
from motet.models.generate_codes import CodesModel
from motet.models.load import load_as
from motet.models.predict import MAX_SAMPLES, PredictModel
from motet.motion.motion import Motion

NOBODY = "none"
"""Value of ``--beyond`` for the predictor alone."""


@click.command()
@click.argument("sources", nargs=-1, required=True, type=Path, metavar="MOTION...")
@out_option
@click.option("--bundle", default="predict", show_default=True, help="Name or path of a bundle.")
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
    help=f"Model that continues beyond the horizon and gives samples; {NOBODY}: the predictor alone, which dies away.",
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
    append: bool,
    samples: int | None,
    seed: int,
    beyond: str,
    output: Output,
    as_json: bool,
    session: SessionOptions,
    read: Read,
) -> None:
    """Continue motion files from their last frames, and write the predictions.

    A file may be of any human figure, and is continued on its own skeleton, at the bundle's frame rate. With several
    files or samples OUT holds {name} or {clip} for their names, or the results are numbered: out-1.bvh, out-2.bvh, ...
    More frames than the bundle's horizon come from a bundle that writes codes (--beyond): walks walk on, runs run.
    With --samples all frames do, and the futures differ as far as the motion leaves it open.
    """
    given = read.sources(sources)
    outs = places(out, given, samples or 1, output)
    model, tries, rates, rows = load_as(PredictModel, bundle, session), Tries(), list[float](), list[dict[str, Any]]()
    asked = Asked(model, model.count(seconds, frames), append, samples, seed)
    writer = asked.writer(beyond, session)
    for number, source in enumerate(given):
        with tries.of(source):
            motion = read(source)
            said = _written(asked, asked.futures(motion, writer), outs[number * (samples or 1) :], source.title, output)
            rows.append({"input": str(source), **said, "beyond": writer and beyond, **asked.expected(motion, writer)})
            rates.append(motion.fps)
            if not as_json:
                click.echo("\n".join(_lines(rows[-1], append)))
    output.finish()
    if as_json and rows:
        click.echo(json.dumps(rows))
    say_resampled(rates, model.fps)
    tries.finish()


@dataclass(frozen=True)
class Asked:
    """What is asked of each motion."""

    model: PredictModel
    frames: int
    append: bool
    samples: int | None
    seed: int

    def writer(self, beyond: str, session: SessionOptions) -> CodesModel | None:
        """What goes on after the horizon, where more is asked than a predictor gives by itself."""
        if beyond == NOBODY and self.samples is not None:
            raise click.UsageError(f"a predictor has one future: --samples does not go with --beyond {NOBODY}")
        more = self.samples is not None or self.frames > self.model.horizon
        return load_as(CodesModel, beyond, session) if more and beyond != NOBODY else None

    def expected(self, motion: Motion, writer: CodesModel | None) -> dict[str, list[float]]:
        """How far off the frames of the predictor may be, where it knows: not those that a writer gives."""
        if not self.model.knows_errors or self.samples is not None:
            return {}
        own = min(self.frames, self.model.horizon if writer is None else self.model.sure)
        return {"expected_error_cm": [round(float(off), 2) for off in self.model.expected_errors(motion)[:own]]}

    def futures(self, motion: Motion, writer: CodesModel | None) -> list[Motion]:
        """The futures of a motion, one where no number of samples is asked. writer: what goes on after the horizon."""
        if writer is None:
            return [self.model.predict(motion, frames=self.frames, append=self.append)]
        try:
            return self._beyond(motion, writer)
        except MotionError as error:
            raise MotionError(f"{error} (--beyond {NOBODY} continues with the predictor alone)") from error

    def _beyond(self, motion: Motion, writer: CodesModel) -> list[Motion]:
        frames, append, seed = self.frames, self.append, self.seed
        with bar("drawing") as progress:
            if self.samples is None:
                return [self.model.predict(motion, frames=frames, append=append, beyond=writer, seed=seed)]
            return self.model.futures(
                motion, frames=frames, append=append, beyond=writer, seed=seed, samples=self.samples, progress=progress
            )


def _written(asked: Asked, found: Sequence[Motion], outs: Sequence[Path], name: str, output: Output) -> dict[str, Any]:
    """Write the futures of a motion; what is said of them."""
    start = (len(found[0]) - asked.frames) / found[0].fps
    first, *_ = [output.write(place, future, name) for future, place in zip(found, outs, strict=False)]
    samples = [{"output": str(place), "seed": asked.seed + i} for i, place in enumerate(outs[: len(found)])]
    facts = {"fps": first.fps, "frames": len(first), "seconds": first.duration, "start": round(start * first.fps)}
    return {**facts, "samples": samples}


def _lines(row: dict[str, Any], append: bool) -> Iterator[str]:
    start = row["start"]
    said = f", predicted from {start / row['fps']:.3g} s on (frame {start}, counted from 0)" if append else ""
    for sample in row["samples"]:
        yield f"{sample['output']}: {size(row['frames'], row['fps'])}{said}"
