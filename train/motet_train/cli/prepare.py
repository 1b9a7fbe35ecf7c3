"""``motet prepare``: a corpus into a store that models are trained on."""

from pathlib import Path

import click
from tqdm import tqdm

from motet.representation import named
from motet_train.cli.train_options import unit_in
from motet_train.data.corpus import Corpus, read_corpus
from motet_train.data.errors import DataError
from motet_train.data.records import Record, Skipped
from motet_train.data.store import Item
from motet_train.data.store import prepare as prepare_store


@click.command()
@click.argument("data", type=Path)
@click.option("-o", "--out", type=Path, required=True, help="Folder of the store to write; must not exist.")
@click.option("--sentences", type=Path, help="Table of sentences. [default: the only .tsv in or beside DATA]")
@unit_in
def prepare(data: Path, out: Path, sentences: Path | None, unit_in: str | None) -> None:
    """Prepare the corpus DATA once: a folder or zip of motions with sentences becomes a store to train on.

    DATA is the KIT Motion-Language data, or motion files .amc (with .asf) .bvh .npz with a tab-separated table
    of the columns clip and sentence. A motion that cannot be used is named and skipped.
    """
    corpus = read_corpus(data, sentences, unit_in)
    _check_unit(corpus)
    with tqdm(total=len(corpus), unit="motion", disable=None) as bar:

        def progress(item: Item) -> None:
            bar.update()
            if isinstance(item, Skipped):
                bar.write(f"skipped {item.name}: {item.reason}")

        store = prepare_store(corpus, out, corpus.preparation, progress)
    seconds = sum(stop - start for entry in store.records for start, stop in entry.spans[:1]) / store.fps
    texts = sum(len(entry.sentences) for entry in store.records)
    click.echo(
        f"{out}: {len(store.records)} motions of {seconds:.0f} s with {texts} sentences, "
        f"{len(store.channels)} channels at {store.fps:g} fps; {len(store.skipped)} skipped"
    )
    if len(store.skipped) > len(store.records):
        first = store.records[0].name
        click.echo(f"motet: most motions were skipped; channels and axes are those of the first, {first}", err=True)


def _check_unit(corpus: Corpus) -> None:
    """DataError where the first motion does not say its unit and nobody else does: the others will not, either."""
    if not named(corpus.preparation.representation).required:
        return  # joint angles alone have no lengths
    first = next((item for item in corpus if isinstance(item, Record)), None)
    if first is not None and first.motion.skeleton is not None and first.motion.skeleton.metres_per_unit is None:
        raise DataError(
            f"{first.name} does not state its unit of length: give --unit-in for files that do not state it"
        )
