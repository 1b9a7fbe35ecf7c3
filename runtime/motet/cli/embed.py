"""``motet embed``: context vectors of motions and of sentences."""

import io
from pathlib import Path

import click
import numpy as np

from motet.bundle.session import SessionOptions
from motet.cli.notes import read_for, text_notes, unit_option
from motet.cli.options import session_options
from motet.files import check_place, write_whole
from motet.models.describe import DescribeModel
from motet.models.generate import GenerateModel
from motet.models.load import load_as


@click.command()
@click.argument("motions", nargs=-1, type=Path)
@click.option("--text", "texts", multiple=True, help="A sentence, instead of motions; may be given several times.")
@click.option("-o", "--out", required=True, type=Path, help="The .npy to write: (N, C) float32.")
@click.option("--bundle", help="Name or path of a bundle. [default: cmu-describe, with --text cmu-generate]")
@unit_option
@session_options
def embed(
    motions: tuple[Path, ...],
    texts: tuple[str, ...],
    out: Path,
    bundle: str | None,
    unit_in: str | None,
    session: SessionOptions,
) -> None:
    """Write context vectors of the motion files MOTIONS, or of sentences, one row for each: for search and clusters.

    Motions have those of a bundle that describes, sentences those of one that generates; the two are not comparable.
    """
    if bool(motions) == bool(texts):
        raise click.UsageError("give either motion files or --text")
    if out.suffix.lower() != ".npy":
        raise click.UsageError(f"context vectors are written as .npy, not {out.name!r}")
    check_place(out)
    if motions:
        describer = load_as(DescribeModel, bundle or "cmu-describe", session)
        vectors = describer.embed(read_for(describer, motions, unit_in))
    else:
        with text_notes():
            vectors = load_as(GenerateModel, bundle or "cmu-generate", session).embed(texts)
    buffer = io.BytesIO()
    np.save(buffer, vectors, allow_pickle=False)
    write_whole(out, buffer.getvalue())
    click.echo(f"{out}: {len(vectors)} context vectors of {vectors.shape[1]} numbers")
