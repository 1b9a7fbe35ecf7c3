"""``motet generate``: sentences in, motion files out."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click

from motet.bundle.session import SessionOptions
from motet.cli.notes import text_notes
from motet.cli.options import session_options
from motet.formats import check_writable, write_motion
from motet.models.generate import Generated, GenerateModel
from motet.models.load import load_as
from motet.motion.motion import Motion


@click.command()
@click.argument("texts", nargs=-1, required=True, metavar="TEXT...")
@click.option("-o", "--out", required=True, type=Path, help="File to write; its extension says the format.")
@click.option("--bundle", default="cmu-generate", show_default=True, help="Name or path of a bundle.")
@click.option("--hypotheses", type=int, help="Motions that are kept while decoding. [default: the bundle's]")
@click.option("--candidates", type=int, help="Frames drawn for each; 1: independent samples. [default: the bundle's]")
@click.option("--temperature", type=float, help="Of the draws; lower trembles less. [default: the bundle's]")
@click.option("--max-seconds", type=float, help="Where a motion ends at the latest. [default: the bundle's]")
@click.option("--seed", default=0, show_default=True, help="Seed of the first text; the next ones count on.")
@click.option("--fps", default=30.0, show_default=True, help="Frame rate to write.")
@click.option("--no-plant", is_flag=True, help="Let feet slide: move the figure as drawn, not as its feet take it.")
@click.option("--all", "every", is_flag=True, help="Write all hypotheses, not only the best.")
@session_options
@click.option("--json", "as_json", is_flag=True, help="Print a list with input and hypotheses of each text.")
def generate(
    texts: tuple[str, ...],
    out: Path,
    bundle: str,
    hypotheses: int | None,
    candidates: int | None,
    temperature: float | None,
    max_seconds: float | None,
    seed: int,
    fps: float,
    no_plant: bool,
    every: bool,
    as_json: bool,
    session: SessionOptions,
) -> None:
    """Generate a motion for each TEXT, such as "a person walks and turns left", and write it to OUT.

    With several texts, or --all, the files are numbered: out-1.bvh, out-2.bvh, ...
    """
    check_writable(out)
    model = load_as(GenerateModel, bundle, session)
    settings: dict[str, Any] = {"candidates": candidates, "temperature": temperature, "max_seconds": max_seconds}
    with text_notes():
        found = model.generate(texts, hypotheses, seed=seed, **settings)
    kept = [row if every else row[:1] for row in found]
    motions = [result.playable(fps, plant=not no_plant) for row in kept for result in row]
    paths = _numbered(out, len(motions))
    for path, motion in zip(paths, motions, strict=True):
        write_motion(path, motion)
    files = iter(zip(paths, motions, strict=True))
    rows = [
        {"input": text, "hypotheses": [_row(result, *next(files)) for result in row]}
        for text, row in zip(texts, kept, strict=True)
    ]
    click.echo(json.dumps(rows) if as_json else "\n".join(_lines(rows)))


def _numbered(out: Path, count: int) -> list[Path]:
    return [out] if count == 1 else [out.with_name(f"{out.stem}-{i}{out.suffix}") for i in range(1, count + 1)]


def _row(result: Generated, path: Path, motion: Motion) -> dict[str, Any]:
    size = {"frames": len(motion), "fps": motion.fps, "seconds": motion.duration}
    return {"output": str(path), "log_likelihood": result.log_likelihood, **size}


def _lines(rows: list[dict[str, Any]]) -> Iterator[str]:
    for row in rows:
        for found in row["hypotheses"]:
            size = f"{found['frames']} frames at {found['fps']:g} fps, {found['seconds']:.3g} s"
            yield f"{found['output']}: {size}, log-likelihood {found['log_likelihood']:.1f}: {row['input']}"
