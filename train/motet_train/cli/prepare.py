"""``motet prepare``: a corpus into a store that models are trained on."""

from collections.abc import Callable
from pathlib import Path

import click

from motet.representation import named
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
    click.option("--sentences", type=Path, help="Table of sentences. [default: the only .tsv in or beside the data]"),
    click.option("--people", type=Path, help="Table of who moves in which clips. [default: by the clips' names]"),
    click.option("--gaits", type=Path, help="Table of gaits (TOML), to steer by. [default: the column gait]"),
    unit_in,
)

CORPUS = (
    *SOURCE,
    click.option("--figure", type=click.Choice(FIGURES), help="Whose joints. [default: humanoid; of KIT's data, own]"),
)
"""What says how a corpus is to be understood."""


def corpus_of(
    data: tuple[Path, ...],
    sentences: Path | None,
    people: Path | None,
    gaits: Path | None,
    unit_in: str | None,
    described: bool = True,
) -> Corpus:
    """The corpus by the options of :data:`SOURCE`, see :func:`motet_train.data.corpus.read_corpus`."""
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
    help="What is to be trained on it: describe, search; codes, fill, matching; predict; or all.",
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
    tab-separated table of the columns clip and sentence, which predict does not need; a clip of a file of several is
    called FILE#CLIP there. Of two files of one name that of the later DATA counts. Every human figure is brought to the
    humanoid. A motion that cannot be used is named and skipped; longer than 30 s, it is cut into pieces, which share
    its sentences.
    """
    corpus = corpus_of(data, sentences, people, gaits, unit_in, verb != "predict")
    if verb == "all" and (figure or fps):
        raise click.UsageError("--figure and --fps are for a store of one kind: give --for, too")
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
        click.echo(f"motet: most motions were skipped; channels and axes are those of the first, {first}", err=True)


def _check_unit(corpus: Corpus, preparation: Preparation) -> None:
    """DataError where the first motion does not say its unit and nobody else does: the others will not, either."""
    if preparation.humanoid or not named(preparation.representation).required:
        return  # the humanoid's unit is found by its height; joint angles alone have no lengths
    first = next((item for item in corpus if isinstance(item, Record)), None)
    if first is not None and first.motion.skeleton is not None and first.motion.skeleton.metres_per_unit is None:
        raise DataError(
            f"{first.name} does not state its unit of length: give --unit-in for files that do not state it"
        )
