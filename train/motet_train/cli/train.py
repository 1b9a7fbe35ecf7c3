"""``motet train``: all shipped kinds in one command, and a command for each net and each published system."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from motet.bundle.fields import Json
from motet_train import distributed
from motet_train.cli.prepare import corpus_of, corpus_options, prepared, source_options
from motet_train.cli.train_options import Option, begun, split, train_command, unit_in, where, with_options
from motet_train.data.errors import DataError
from motet_train.data.predict_data import Material, store_material
from motet_train.data.store import is_store
from motet_train.papers.li2018 import SYSTEMS
from motet_train.papers.li2018 import recipe as li2018
from motet_train.papers.li2018.expmap import ExpmapCorpus, expmap_material, is_expmap, read_expmap, validation_files
from motet_train.papers.plappert2017 import recipe as plappert2017
from motet_train.papers.plappert2017.language_to_motion import LOSSES
from motet_train.papers.tdbn import recipe as tdbn
from motet_train.papers.tdbn import steered
from motet_train.papers.tdbn.clips import Clips, read_clips
from motet_train.plan import PLANNED_VERBS, STAGES, Plan
from motet_train.recipes import actions, codec, codes, fill, known, language, matching, predict, search
from motet_train.recipes.actions import WordVectors
from motet_train.recipes.recipe import Job, Recipe
from motet_train.runs import Run
from motet_train.settings import read_stages


@click.group()
def train() -> None:
    """Train models on your own recordings: all shipped kinds, or one. Evaluate and export take the runs."""


steps = click.option("--steps", type=click.IntRange(1), help="[default: the preset's]")
epochs = click.option("--epochs", type=click.IntRange(1), help="[default: the preset's]")
word_vectors = with_options(
    click.option(
        "--word-vectors", type=Path, help="Vectors of words, common ones first: a word and its numbers per line."
    ),
    click.option("--vectors-from", help="Source and licence of the vectors, for the manifest."),
)
of_plan = with_options(
    click.option("-o", "--out", type=Path, required=True, help="Folder of the runs; the same command resumes there."),
    source_options,
    split,
    word_vectors,
    click.option("--config", type=Path, help="TOML file of settings: [describe.training] is for describe."),
    where,
)


@train.command("all", short_help="Train all shipped kinds on your own recordings: one command, resumable.")
@click.argument("data", type=Path, nargs=-1, required=True)
@click.option("--only", "verbs", type=click.Choice(PLANNED_VERBS), multiple=True, help="Only these. [default: all]")
@of_plan
def everything(verbs: tuple[str, ...], **options: Any) -> None:
    """Train all shipped kinds on DATA: folders or zips of motion files with a table of sentences, or their store.

    Motions are prepared once, into OUT/store; then one run per verb is trained, of the kind that ships with motet.
    Repeat the command to continue: finished runs are skipped, interrupted ones resume.
    """
    _train_plan(verbs or PLANNED_VERBS, **options)


@train.command(short_help="Train the shipped kind of generate, in five stages.")
@click.option("--data", type=Path, multiple=True, required=True, help="A store, or a corpus: folder or zip.")
@of_plan
def generate(**options: Any) -> None:
    """Train sentence to motion, the shipped kind: codec, decoder (twice), actions, and the writer of codes.

    Like `motet train all --only generate`: the runs go into the folder OUT, the last is OUT/generate.
    """
    _train_plan(("generate",), **options)


def _train_plan(verbs: tuple[str, ...], data: tuple[Path, ...], out: Path, **options: Any) -> None:
    if distributed.launched():
        raise DataError("torchrun trains one stage at a time: use the command of the stage, such as motet train codec")
    about = begun("", options)
    # what the stages share
    vectors = options["word_vectors"] and WordVectors(options["word_vectors"], options["vectors_from"])
    changes = read_stages(options["config"], STAGES) if options["config"] else {}
    source = {key: options[key] for key in ("sentences", "people", "gaits", "unit_in")}
    place = data[0] if len(data) == 1 and is_store(data[0]) else corpus_of(data, **source)
    # train, then say how to go on
    Plan(place, out, verbs, options["by"], options["device"], vectors, changes, about).train()
    click.echo(f"next: motet export {out} -o bundles, then motet bundle verify bundles/NAME.zip")
    for verb in verbs:
        click.echo(f"      motet evaluate {out / verb}")


augmentation = with_options(
    click.option("--warp", type=click.FloatRange(0), help="Play windows up to exp(this) times faster or slower."),
    click.option("--reverse", type=click.FloatRange(0, 1), help="Share of windows played backwards."),
    click.option("--mirror", type=click.FloatRange(0, 1), help="Share of windows mirrored."),
    click.option(
        "--average", type=click.FloatRange(0, 1, max_open=True), help="Decay of a running mean of weights; 0: none."
    ),
)


predictor_data = with_options(
    click.option(
        "--data",
        type=Path,
        required=True,
        help="Exponential-map text files, a store prepared for predict, or motion files: folder or zip.",
    ),
    corpus_options,
    click.option(
        "--split",
        "by",
        type=click.Choice(["trial", "subject"]),
        help="How to hold out motion files: at random, or by person. [default: subject]",
    ),
)


@train.add_command
@train_command("predict", predict.RECIPES, predictor_data, steps, augmentation)
def train_predictor(job: Job, data: Path, by: str | None, **corpus: Any) -> Run:
    """Train a predictor: a net that continues a motion from its last frames.

    Text files of the protocol train it for the measures of `motet evaluate`; motion files train it to continue files of
    any human figure.
    """
    predict.refuse_unfit(job.recipe, has_bones=not is_expmap(data))
    return predict.train_predict(_material(data, job, by, True, corpus), job)


def _material(data: Path, job: Job, by: str | None, all_files: bool, corpus: Json) -> Material:
    """Motion files divided by trial or person, or text files, of which some are kept back unless ``all_files``."""
    if not is_expmap(data):
        return store_material(prepared(data, job, **corpus), data.name, by or "subject")
    if by is not None:
        raise DataError(f"{data} has its own test files: --split is for motion files")
    files = read_expmap_files(data)
    return expmap_material(files, () if all_files else validation_files(files))


def read_expmap_files(data: Path) -> ExpmapCorpus:
    """The corpus of text files in a folder or zip; missing files are named on stderr, ten of them."""
    corpus = read_expmap(data)
    if corpus.missing and distributed.rank() == 0:
        shown = corpus.missing[:10]
        for name in shown:
            click.echo(f"motet: {data} lacks {name}", err=True)
        if more := len(corpus.missing) - len(shown):
            click.echo(f"motet: {data} lacks {more} files more", err=True)
    return corpus


clips_data = with_options(
    click.option(
        "--data",
        type=Path,
        help="Folder of clips LABEL.bvh and LABEL/*.bvh (or .amc .npz .csv). "
        "[default: three CMU trials, in a checkout]",
    ),
    unit_in,
)


labels = click.option("--labels", help='Labels to train on, such as "walk,run". [default: all]')


# with --preset pure, seed 6 is that of the bundle tdbn
@train.add_command
@train_command("tdbn", tdbn.RECIPES, clips_data, labels, defaults={"seed": 6, "out": "runs/tdbn", "name": "tdbn"})
def train_tdbn(job: Job, data: Path | None, unit_in: str | None, labels: str | None) -> Run:
    """Train a temporal deep belief net for live control, on short labelled clips."""
    return tdbn.train_control(labelled_clips(data, job.recipe.config.root_rotation, unit_in, labels), job)


def labelled_clips(data: Path | None, root_rotation: bool, unit_in: str | None, labels: str | None) -> Clips:
    """The clips of a folder; of ``labels``, separated by commas, alone."""
    clips = read_clips(data, root_rotation, unit_in)
    return clips.only([label.strip() for label in labels.split(",")]) if labels else clips


@train.add_command
@train_command(
    "crbm",
    tdbn.BASELINES,
    clips_data,
    labels,
    click.option("--past-rate", type=float, help="Rate from past to angles. [default: the preset's]"),
    click.option("--control-units", type=click.IntRange(1), help="Units per label. [default: the preset's]"),
    epochs,
    defaults={"out": "runs/crbm", "name": "crbm"},
)
def train_crbm(job: Job, data: Path | None, unit_in: str | None, labels: str | None, epochs: int | None) -> Run:
    """Train the baseline, a conditional RBM on the joint angles (Taylor 2007)."""
    config = job.recipe.config
    if epochs is not None:
        config = replace(config, crbm=replace(config.crbm, epochs=epochs))
        job = replace(job, recipe=replace(job.recipe, config=config))
    return tdbn.train_control(labelled_clips(data, config.root_rotation, unit_in, labels), job)


NETS = {
    "describe": "motion to language: a net that describes a motion in words.",
    "known": "nothing, but gathers the known motions that answer for describe, and learns how sure they are.",
    "search": "a joint embedding for search: motions and sentences in one space.",
    "mixture": "language to motion, after Plappert et al. 2017: frame by frame from a mixture.",
    "codec": "a codec of motions: frames to codes and back.",
    "actions": "a net that recognizes the action a sentence asks for.",
    "codes": "a code writer: from a sentence to motion, code by code.",
    "fill": "a net that fills gaps in motions from the frames before and after.",
    "matching": "a steerable figure: motion matching on recordings of gaits.",
    "steered-tdbn": "a steerable figure: the thesis' nets on recordings of walking and running.",
}
"""Command that trains a net on a store -> its one-line help."""


def _on_store(name: str, recipes: Mapping[str, Recipe], train_net: Callable[..., Run], *options: Option) -> None:
    """Add a command that calls a recipe's function with a store, the job, the store's name and its own options."""

    def run(job: Job, data: Path, **options: Any) -> Run:
        corpus = {key: options.pop(key) for key in ("sentences", "people", "gaits", "unit_in", "figure")}
        # options that name a run become that run
        for key in ("start", "codec", "actions", "writer"):
            if options.get(key):
                options[key] = Run.load(options[key])
        if "word_vectors" in options:
            file = options.pop("word_vectors")
            origin = options.pop("vectors_from")
            options["vectors"] = file and WordVectors(file, origin)
        return train_net(prepared(data, job, **corpus), job, data.name, **options)

    run.__doc__ = f"Train {NETS[name]}"
    store = click.option("--data", type=Path, required=True, help="A prepared store, or a corpus: folder or zip.")
    train.add_command(train_command(name, recipes, store, corpus_options, *options)(run))


by_epochs = with_options(
    epochs,
    click.option("--batch", type=click.IntRange(1), help="Motions per batch. [default: the preset's]"),
    split,
    click.option("--mirror/--no-mirror", default=None, help="Mirror left and right at random. [default: the preset's]"),
)
by_steps = with_options(steps, split)
loss = click.option(
    "--loss", type=click.Choice(list(LOSSES)), help="Eq. 12, or the true likelihood. [default: the preset's]"
)
attention = click.option(
    "--attention/--no-attention", default=None, help="Let words attend to the encoder's states. [default: the preset's]"
)
start = click.option("--start", type=Path, help="Run of a codec: train its decoder alone (--preset decoder, sharp).")
parts = with_options(
    click.option(
        "--codec", type=Path, required=True, help="Run of a codec, trained on the same data and split, or of codes."
    ),
    click.option(
        "--actions",
        type=Path,
        required=True,
        help="Run of an action net, trained on the same data and split, or of codes to train further.",
    ),
)
known_parts = with_options(
    click.option("--writer", type=Path, required=True, help="Run of describe, which writes sentences (--draws)."),
    split,
)
_on_store("describe", language.RECIPES, language.train_language, by_epochs, attention)
_on_store("known", known.RECIPES, known.train_known, known_parts)
_on_store("search", search.RECIPES, search.train_search, by_epochs)
_on_store("mixture", plappert2017.RECIPES, language.train_language, by_epochs, loss)
_on_store("codec", codec.RECIPES, codec.train_codec, by_steps, start)
_on_store("actions", actions.RECIPES, actions.train_actions, by_steps, word_vectors)
_on_store("codes", codes.RECIPES, codes.train_codes, by_steps, parts)
_on_store("fill", fill.RECIPES, fill.train_fill, by_steps)
_on_store("matching", matching.RECIPES, matching.train_matching, steps)
_on_store("steered-tdbn", steered.RECIPES, steered.train_steered)


def _system(name: str, title: str) -> None:
    """Add the command of a published system that predicts."""

    def run(job: Job, data: Path, all_files: bool, by: str | None, **corpus: Any) -> Run:
        if all_files and not is_expmap(data):
            raise DataError(f"{data} has no test files of its own: --all-files is for text files of the protocol")
        return li2018.train_system(_material(data, job, by, all_files, corpus), job)

    run.__doc__ = f"Train {title}, a baseline of `motet train predict`."
    switches = (ablations,) if name == "convseq2seq" else ()
    train.add_command(train_command(name, li2018.RECIPES[name], of_system, *switches)(run))


of_system = with_options(
    predictor_data,
    steps,
    click.option("--batch", type=click.IntRange(1), help="Windows per batch. [default: the preset's]"),
    click.option("--learning-rate", type=click.FloatRange(0, min_open=True), help="[default: the preset's]"),
    augmentation,
    click.option("--all-files", is_flag=True, help="Hold out no training files; validate on windows of all of them."),
)
ablations = with_options(
    click.option("--long-term", type=click.Choice(["convolutional", "recurrent", "none"]), help="Long-term encoder."),
    click.option("--kernel", type=click.IntRange(1), nargs=2, help="Frames and channels of the convolutions' kernels."),
    click.option("--padding", type=click.Choice(["valid", "same"]), help="Other kernels or windows need 'same'."),
    click.option("--window", type=click.IntRange(1), help="Frames seen by the short-term encoder, C."),
    click.option(
        "--predicted-share", type=click.FloatRange(0, 1), help="Share of predicted frames among those fed back."
    ),
    click.option("--loss", type=click.Choice(["square", "distance"]), help="Mean squared distance, or mean distance."),
    click.option("--l2", type=click.FloatRange(0), help="Weight of the squared weights in the loss."),
    click.option("--adversary", type=click.FloatRange(0), help="Weight of the discriminator in the loss; 0: none."),
)
for name, (*_, title) in SYSTEMS.items():
    _system(name, title)
