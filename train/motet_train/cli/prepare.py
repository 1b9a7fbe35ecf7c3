"""``motet prepare``: turns a corpus into a store for training."""

from collections.abc import Callable
from pathlib import Path

import click

from motet.representation.contract import named
from motet_train.cli.train_options import unit_in
from motet_train.data.corpus import Corpus, read_corpus
from motet_train.data.errors import DataError
from motet_train.data.gaits import read_gaits
from motet_train.data.preparation import ALL, FIGURES, Preparation, preparation
from motet_train.data.records import Record
from motet_train.data.store import Store, prepare_parts
from motet_train.data.table import read_people
from motet_train.progress import preparing

SOURCE = (
    click.option("--sentences", type=Path, help="Table of sentences. [default: the only .tsv in or next to the data]"),
    click.option("--people", type=Path, help="Table of performers by clip. [default: from the clips' names]"),
    click.option("--gaits", type=Path, help="Table of gaits (TOML) for steering. [default: the column gait]"),
    unit_in,
)

CORPUS = (
    *SOURCE,
    click.option(
        "--figure", type=click.Choice(FIGURES), help="Skeleton of the store. [default: humanoid; for KIT's data, own]"
    ),
)
"""Options for interpreting a corpus."""


def corpus_of(
    data: tuple[Path, ...],
    sentences: Path | None,
    people: Path | None,
    gaits: Path | None,
    unit_in: str | None,
    described: bool = True,
) -> Corpus:
    """The corpus read with the options of :data:`SOURCE`, see :func:`motet_train.data.corpus.read_corpus`."""
    who = () if people is None else read_people(people)
    return read_corpus(data, sentences, who, unit_in, described, () if gaits is None else read_gaits(gaits))


def corpus_options(function: Callable[..., None]) -> Callable[..., None]:
    """The options of :data:`CORPUS` on a command."""
    for option in reversed(CORPUS):
        function = option(function)
    return function


@click.command()
@click.argument("data", type=Path, nargs=-1, required=True)
@click.option("-o", "--out", type=Path, required=True, help="Folder of the store to write; must not exist.")
@click.option(
    "--for",
    "verb",
    type=click.Choice(["describe", "generate", "codes", "predict", "all"]),
    default="describe",
    show_default=True,
    help="Models to train on it: describe, search; codes, fill, matching; predict; or all.",
)
@click.option("--fps", type=click.FloatRange(1, 240), help="Frames per second. [default: 10; for codes, predict 30]")
@corpus_options
def prepare(
    data: tuple[Path, ...],
    out: Path,
    verb: str,
    fps: float | None,
    sentences: Path | None,
    people: Path | None,
    gaits: Path | None,
    figure: str | None,
    unit_in: str | None,
) -> None:
    """Prepare the corpus DATA once: folders or zips of motions with sentences become a store to train on.

    DATA is the KIT Motion-Language data, or motion files .amc (with .asf) .bvh .npz .glb .vrma with a
    tab-separated table with the columns clip and sentence, which predict does not need; a clip in a file with several
    is named FILE#CLIP there. Of two files of one name, the one in the later DATA is used. Every human figure is
    retargeted to the humanoid. Unusable motions are named and skipped; those over 30 s are cut into pieces that share
    their sentences.
    """
    corpus = corpus_of(data, sentences, people, gaits, unit_in, verb != "predict")
    if verb == "all" and (figure or fps):
        raise click.UsageError("--figure and --fps apply to a store of one kind: add --for")
    parts = ALL if verb == "all" else {".": preparation(verb, corpus.kit, figure, fps)}
    for one in parts.values():
        _check_unit(corpus, one)
    with preparing(len(corpus)) as done:
        prepare_parts(corpus, out, parts, done)
    for name in parts:
        _summarise(out / name)


def _summarise(place: Path) -> None:
    store = Store.open(place)
    seconds = sum(stop - start for entry in store.records for start, stop in entry.spans[:1]) / store.fps
    texts = sum(len(entry.sentences) for entry in store.records)
    click.echo(
        f"{place}: {len(store.records)} motions of {seconds:.0f} s with {texts} sentences, "
        f"{len(store.channels)} channels at {store.fps:g} fps; {len(store.skipped)} skipped"
    )
    if len(store.skipped) > len(store.records):
        first = store.records[0].name
        click.echo(f"motet: most motions were skipped; channels and axes are taken from the first, {first}", err=True)


def _check_unit(corpus: Corpus, preparation: Preparation) -> None:
    """DataError if neither the first motion nor an option states the unit: the others will not either."""
    if preparation.humanoid or not named(preparation.representation).required:
        return  # the humanoid's unit is inferred from its height; joint angles alone have no lengths
    first = next((item for item in corpus if isinstance(item, Record)), None)
    if first is not None and first.motion.skeleton is not None and first.motion.skeleton.metres_per_unit is None:
        raise DataError(f"{first.name} does not state its length unit: give --unit-in for such files")
