"""``motet generate``: sentences in, motion files out."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click

from motet.bundle.session import SessionOptions
from motet.cli.notes import text_notes
from motet.cli.options import session_options
from motet.cli.reading import FPS, Tries, bar, like_option, out_option, places
from motet.formats import check_writable, write_motion
from motet.formats.character import Character
from motet.models.generate import PLAYED, Generated, GenerateModel
from motet.models.load import load_as
from motet.motion.motion import Motion


@click.command()
@click.argument("texts", nargs=-1, required=True, metavar="TEXT...")
@out_option
@click.option("--bundle", default="generate", show_default=True, help="Name or path of a bundle.")
@click.option(
    "--hypotheses", type=click.IntRange(1, 100), help="Hypotheses kept while decoding. [default: the bundle's]"
)
@click.option(
    "--candidates",
    type=click.IntRange(1, 100),
    help="Draws per hypothesis; 1: independent samples. [default: the bundle's]",
)
@click.option("--temperature", type=click.FloatRange(0.01, 100), help="Sampling temperature. [default: the bundle's]")
@click.option("--max-seconds", type=click.FloatRange(0, 600), help="Maximum length in seconds. [default: the bundle's]")
@click.option(
    "--seed", type=click.IntRange(0), default=0, show_default=True, help="Seed; later texts use seed + 1, ..."
)
@click.option("--fps", type=FPS, default=PLAYED, show_default=True, help="Frame rate to write.")
@click.option("--no-plant", is_flag=True, help="Skip foot planting: the figure moves as drawn.")
@click.option("--all", "every", is_flag=True, help="Write all hypotheses, not only the best.")
@like_option
@session_options
@click.option("--json", "as_json", is_flag=True, help="Print a list with input and hypotheses of each text.")
def generate(
    texts: tuple[str, ...],
    out: Path,
    bundle: str,
    fps: float,
    no_plant: bool,
    every: bool,
    seed: int,
    like: Character | None,
    as_json: bool,
    session: SessionOptions,
    **settings: Any,
) -> None:
    """Generate a motion for each TEXT, such as "a person walks and turns left", and write it to OUT.

    With several texts, or --all, the files are numbered: out-1.bvh, out-2.bvh, ... A text that cannot be used has none.
    """
    check_writable(out)
    model = load_as(GenerateModel, bundle, session)
    tries = Tries()
    asked = tries.usable(model, texts)
    with text_notes(), bar("generating") as progress:
        seeds = [seed + index for index in asked]
        found = model.generate([texts[index] for index in asked], seed=seeds, progress=progress, **settings)
    count = max(map(len, found), default=1) if every else 1
    outs = places(out, [str(number + 1) for number in range(count * len(texts))])
    rows = []
    for index, results in zip(asked, found, strict=True):
        pairs = zip(results[:count], outs[count * index :], strict=False)
        written = [_write(result.playable(fps, not no_plant), result, place, like) for result, place in pairs]
        rows.append({"input": texts[index], "hypotheses": written})
    if rows:
        click.echo(json.dumps(rows) if as_json else "\n".join(_lines(rows)))
    tries.finish()


def _write(motion: Motion, result: Generated, place: Path, like: Character | None) -> dict[str, Any]:
    write_motion(place, motion, like=like)
    size = {"frames": len(motion), "fps": motion.fps, "seconds": motion.duration}
    return {"output": str(place), "log_likelihood": result.log_likelihood, **size}


def _lines(rows: list[dict[str, Any]]) -> Iterator[str]:
    for row in rows:
        for found in row["hypotheses"]:
            size = f"{found['frames']} frames at {found['fps']:g} fps, {found['seconds']:.3g} s"
            likelihood = found["log_likelihood"]
            score = "" if likelihood is None else f", log-likelihood {likelihood:.1f}"
            yield f"{found['output']}: {size}{score}: {row['input']}"
