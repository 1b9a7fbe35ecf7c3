"""``motet prepare``, which turns a corpus into a store for training; and the store of a training command."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from motet.jobs import Shard
from motet.representation.contract import named
from motet_train import distributed
from motet_train.cli.train_options import unit_in, with_options
from motet_train.data.corpus import Corpus, Record, read_corpus
from motet_train.data.errors import DataError
from motet_train.data.merging import merge_stores
from motet_train.data.preparation import FIGURE_CHOICES, PARTS_OF_ALL_VERBS, Preparation, preparation
from motet_train.data.store import INDEX, Store, is_store, prepare_parts
from motet_train.data.table import read_gaits, read_people
from motet_train.plan import kind_for, store_for
from motet_train.progress import preparing
from motet_train.recipes.recipe import Job
from motet_train.trainer import CHECKPOINT

source_options = with_options(
    click.option("--sentences", type=Path, help="Table of sentences. [default: the only .tsv in or next to the data]"),
    click.option("--people", type=Path, help="Table of performers by clip. [default: from the clips' names]"),
    click.option("--gaits", type=Path, help="Table of gaits (TOML) for steering. [default: the column gait]"),
    unit_in,
)

corpus_options = with_options(
    source_options,
    click.option(
        "--figure",
        type=click.Choice(FIGURE_CHOICES),
        help="Skeleton of the store. [default: humanoid; for KIT's data, own]",
    ),
)


def corpus_of(
    data: tuple[Path, ...],
    sentences: Path | None,
    people: Path | None,
    gaits: Path | None,
    unit_in: str | None,
    described: bool = True,
) -> Corpus:
    """The corpus read with the options of a source, see :func:`motet_train.data.corpus.read_corpus`."""
    performers = () if people is None else read_people(people)
    gait_patterns = () if gaits is None else read_gaits(gaits)
    return read_corpus(data, sentences, performers, unit_in, described, gait_patterns)


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
@click.option("--shard", metavar="I/N", help="A store of one of N parts of the corpus, such as 3/16.")
@corpus_options
def prepare(
    data: tuple[Path, ...],
    out: Path,
    verb: str,
    fps: float | None,
    figure: str | None,
    shard: str | None = None,
    **source: Any,
) -> None:
    """Prepare the corpus DATA once: folders or zips of motions with sentences become a store to train on.

    DATA is the KIT Motion-Language data, or motion files .amc (with .asf) .bvh .npz .glb .vrma with a
    tab-separated table with the columns clip and sentence, which predict does not need; a clip in a file with several
    is named FILE#CLIP there. Of two files of one name, the one in the later DATA is used. Every human figure is
    retargeted to the humanoid. Unusable motions are named and skipped; those over 30 s are cut into pieces that share
    their sentences.

    If DATA are the stores of all shards of a corpus, they are merged.
    """
    if all(map(is_store, data)):
        merge_stores(data, out)
    else:
        corpus = corpus_of(data, **source, described=verb != "predict")
        if verb == "all" and (figure or fps):
            raise click.UsageError("--figure and --fps apply to a store of one kind: add --for")
        _prepare(
            corpus,
            out,
            PARTS_OF_ALL_VERBS if verb == "all" else {".": preparation(verb, corpus.kit, figure, fps)},
            shard,
        )
    _summarise(out)


def _prepare(corpus: Corpus, out: Path, parts: Mapping[str, Preparation], shard: str | None) -> None:
    """Prepare a corpus, or one of its shards."""
    for settings in parts.values():
        _check_unit(corpus, settings)
    part = None if shard is None else Shard.parse(shard)
    corpus = corpus if part is None else corpus.shard(part)
    with preparing(len(corpus)) as done:
        prepare_parts(corpus, out, parts, done, part)


def _summarise(out: Path) -> None:
    """Print the contents of a store in each representation."""
    for index in sorted(out.rglob(INDEX)):
        store = Store.open(index.parent)
        # a record's offsets show the same motion
        seconds = sum(len(store.sequence(record)) for record in range(len(store.records))) / store.fps
        texts = sum(len(entry.sentences) for entry in store.records)
        click.echo(
            f"{index.parent}: {len(store.records)} motions of {seconds:.0f} s with {texts} sentences, "
            f"{len(store.channels)} channels at {store.fps:g} fps; {len(store.skipped)} skipped"
        )
        if len(store.skipped) > len(store.records):
            hint = "most motions were skipped; channels and axes are taken from the first"
            click.echo(f"motet: {hint}, {store.records[0].name}", err=True)


def _check_unit(corpus: Corpus, preparation: Preparation) -> None:
    """DataError if neither the first motion nor an option states the length unit; the other motions will not either."""
    if preparation.humanoid or not named(preparation.representation).required:
        return  # the humanoid's unit is inferred from its height; joint angles alone have no lengths
    first = next((item for item in corpus if isinstance(item, Record)), None)
    if first is None or first.motion.skeleton is None:
        return
    if first.motion.skeleton.metres_per_unit is None:
        raise DataError(f"{first.name} does not state its length unit: give --unit-in for such files")


def prepared(data: Path, job: Job, **corpus: Any) -> Store:
    """The store at ``data``, or one prepared beside the run from the corpus there; a resumed run has such a store.

    corpus: options of ``motet prepare``.
    """
    path = store_for(data, job.recipe)
    if (path / INDEX).is_file():
        return Store.open(path)
    place = store_beside(job.folder)
    if not (job.folder / CHECKPOINT).is_file():
        verb = kind_for(job.recipe)
        if distributed.count() > 1:
            raise DataError(f"several processes need a prepared store: motet prepare {data} --for {verb} --out {place}")
        click.get_current_context().invoke(prepare, data=(data,), out=place, verb=verb, fps=None, **corpus)
    return Store.open(place)


def store_beside(run: Path) -> Path:
    """The path of the store that is prepared for a run from its corpus."""
    return run.with_name(f"{run.name}-store")
