"""``motet train``: all shipped kinds in one command, and a command for each net and each published system."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from motet.bundle.fields import Json
from motet_train import distributed
from motet_train.cli.prepare import corpus_of, corpus_options, prepared, source_options
from motet_train.cli.train_options import Option, begun, options_of, split, train_command, unit_in, with_options
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


steps = options_of("steps")
epochs = options_of("epochs")
word_vectors = options_of("word_vectors")
of_plan = with_options(
    options_of("out_of_plan"), source_options, split, word_vectors, options_of("config_of_plan"), options_of("where")
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
@options_of("data_of_plan")
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


augmentation = options_of("augmentation")
predictor_data = with_options(options_of("motions"), corpus_options, options_of("motions_held_out"))


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


clips_data = with_options(options_of("clips"), unit_in, options_of("labels"))


# with --preset pure, seed 6 is that of the bundle tdbn
@train.add_command
@train_command("tdbn", tdbn.RECIPES, clips_data, defaults={"seed": 6, "out": "runs/tdbn", "name": "tdbn"})
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
    options_of("crbm"),
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
    train.add_command(train_command(name, recipes, options_of("store"), corpus_options, *options)(run))


by_epochs = with_options(
    epochs,
    options_of("motions_of_batch"),
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
_on_store("describe", language.RECIPES, language.train_language, by_epochs, attention)
_on_store("known", known.RECIPES, known.train_known, options_of("writer"), split)
_on_store("search", search.RECIPES, search.train_search, by_epochs)
_on_store("mixture", plappert2017.RECIPES, language.train_language, by_epochs, loss)
_on_store("codec", codec.RECIPES, codec.train_codec, by_steps, options_of("start"))
_on_store("actions", actions.RECIPES, actions.train_actions, by_steps, word_vectors)
_on_store("codes", codes.RECIPES, codes.train_codes, by_steps, options_of("parts"))
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
    switches = (options_of("ablations"),) if name == "convseq2seq" else ()
    train.add_command(train_command(name, li2018.RECIPES[name], of_system, *switches)(run))


of_system = with_options(predictor_data, steps, options_of("system"), augmentation, options_of("all_files"))
for name, (*_, title) in SYSTEMS.items():
    _system(name, title)
