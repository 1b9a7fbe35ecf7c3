"""``motet embed``: context vectors of motions and of sentences."""

import io
from collections.abc import Sequence
from pathlib import Path

import click
import numpy as np
from numpy.typing import NDArray

from motet.bundle.graph import SessionOptions
from motet.cli.notes import noted
from motet.cli.options import session_options
from motet.cli.reading import Read, Source, Tries, read_options, say_resampled
from motet.files import check_place, write_whole
from motet.models.describe import DescribeModel
from motet.models.generate import GenerateModel
from motet.models.load import load_as


@click.command()
@click.argument("motions", nargs=-1, type=Path, metavar="[MOTION...]")
@click.option("--text", "texts", multiple=True, help="A sentence, instead of motions; may be given several times.")
@click.option("-o", "--out", required=True, type=Path, help="The .npy to write: (N, C) float32.")
@click.option("--bundle", help="Name or path of a bundle. [default: describe, with --text generate]")
@session_options
@read_options
def embed(
    motions: tuple[Path, ...],
    texts: tuple[str, ...],
    out: Path,
    bundle: str | None,
    session: SessionOptions,
    read: Read,
) -> None:
    """Write context vectors of motion files, or of sentences, one row each, to compare and cluster.

    Motions have those of a bundle that describes, sentences those of one that generates; the two are not comparable.
    A file or sentence that fails has no row.
    """
    if bool(motions) == bool(texts):
        raise click.UsageError("give either motion files or --text")
    if out.suffix.lower() != ".npy":
        raise click.UsageError(f"context vectors are written as .npy, not {out.name!r}")
    check_place(out)
    tries = Tries()
    if motions:
        vectors = _of_motions(load_as(DescribeModel, bundle or "describe", session), read.sources(motions), read, tries)
    else:
        model = load_as(GenerateModel, bundle or "generate", session)
        with noted():
            vectors = model.embed([texts[index] for index in tries.usable(model, texts)])
    if len(vectors):
        buffer = io.BytesIO()
        np.save(buffer, vectors, allow_pickle=False)
        write_whole(out, buffer.getvalue())
        click.echo(f"{out}: {len(vectors)} context vectors of {vectors.shape[1]} numbers")
    tries.finish()


def _of_motions(model: DescribeModel, sources: Sequence[Source], read: Read, tries: Tries) -> NDArray[np.float32]:
    prepared, rates = [], []
    for source in sources:
        with tries.of(source):
            motion = read(source)
            prepared.append(model.prepared(motion))
            rates.append(motion.fps)
    say_resampled(rates, model.fps)
    return model.embed(prepared)
