"""``motet embed``: context vectors of motions and sentences."""

import io
import json
from pathlib import Path

import click
import numpy as np

from motet.bundle.graph import Floats, SessionOptions
from motet.cli.many import Many, many_options
from motet.cli.options import json_option, noted, session_options
from motet.cli.reading import read_options
from motet.corpus.answers import Embed
from motet.files import check_place, write_whole
from motet.generate.base import GenerateModel
from motet.models.load import load_as


@click.command()
@click.argument("motions", nargs=-1, type=Path, metavar="[MOTION|FOLDER|ZIP...]")
@click.option("--text", "texts", multiple=True, help="A sentence, instead of motions; may be given several times.")
@click.option("-o", "--out", type=Path, help="The .npy to write, where there is no --parts: (N, C) float32.")
@click.option("--bundle", help="Name or path of a bundle. [default: describe, with --text generate]")
@session_options
@read_options
@many_options
@json_option("Print a list with the input of each row.")
def embed(
    motions: tuple[Path, ...],
    texts: tuple[str, ...],
    out: Path | None,
    bundle: str | None,
    session: SessionOptions,
    many: Many,
    as_json: bool,
) -> None:
    """Write context vectors of motion files, of each clip of a file of several, or of sentences, one row each, to
    compare and cluster.

    Motions have those of a bundle that describes, sentences those of one that generates; the two are not comparable.
    A file or sentence that fails has no row.
    """
    if bool(motions) == bool(texts):
        raise click.UsageError("give either motion files or --text")
    verb = Embed(many.read.options, bundle or "describe", session)
    if many.parts and motions:
        many.write_part(verb, many.sources(motions), motions, "embedding")
    if out is None or out.suffix.lower() != ".npy":
        raise click.UsageError("context vectors are written as .npy: give -o VECTORS.npy")
    check_place(out)
    tries = many.tries
    rows = []
    if motions:
        for answer in many.answers(verb, many.sources(motions), "embedding"):
            rows += answer.rows
        vectors = np.array([row.pop("vector") for row in rows])
        many.read.say_resampled(lambda: verb.model.fps)
    else:
        generator = load_as(GenerateModel, bundle or "generate", session)
        usable = list(tries.usable(dict(enumerate(texts)), generator.unknown).values())
        rows += [{"input": text} for text in usable]
        with noted():
            vectors = generator.embed(usable)
    if len(vectors):
        _save(out, vectors)
        summary = f"{out}: {len(vectors)} context vectors of {vectors.shape[1]} numbers"
        click.echo(json.dumps(rows) if as_json else summary)
    tries.finish()


def _save(out: Path, vectors: Floats) -> None:
    buffer = io.BytesIO()
    np.save(buffer, vectors, allow_pickle=False)
    write_whole(out, buffer.getvalue())
