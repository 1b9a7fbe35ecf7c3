"""``motet train convseq2seq`` and the commands of the other published systems that predict."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import torch
from tqdm import tqdm

from motet_train.cli.places import command_line, refuse, resumable
from motet_train.cli.train_predict import read_expmap_files
from motet_train.data.predict_data import expmap_material, validation_files
from motet_train.evaluate.predict.protocol import WINDOW
from motet_train.recipes.language import check_device
from motet_train.recipes.predict import About
from motet_train.recipes.systems import RECIPES, Recipe, train_system

Option = Callable[[Callable[..., None]], Callable[..., None]]

OPTIONS: tuple[Option, ...] = (
    click.option("--data", type=Path, required=True, help="Folder or zip of exponential-map text files."),
    click.option("--out", type=Path, required=True, help="Folder to write; must not exist."),
    click.option("--steps", type=click.IntRange(1), help="[default: the preset's]"),
    click.option("--batch", type=click.IntRange(1), help="Windows in a batch. [default: the preset's]"),
    click.option("--learning-rate", type=click.FloatRange(0, min_open=True), help="[default: the preset's]"),
    click.option("--precision", type=click.Choice(["float32", "bfloat16"]), help="Of products in training."),
    click.option("--all-files", is_flag=True, help="Keep no training file back, and validate on windows of them all."),
    click.option("--seed", type=click.IntRange(0), default=0, show_default=True),
    click.option("--device", type=click.Choice(["cpu", "cuda"]), default="cpu", show_default=True),
    click.option("--threads", type=click.IntRange(1), default=1, show_default=True),
    click.option("--resume", is_flag=True, help="Go on where the run in --out was stopped, by the same command."),
    click.option("--name", help="Name of the bundle to be. [default: the run's folder]"),
    click.option("--licence", default="MIT", show_default=True, help="Licence of the weights."),
)

SWITCHES: tuple[Option, ...] = (
    click.option("--long-term", type=click.Choice(["convolutional", "recurrent", "none"]), help="Which encoder."),
    click.option("--kernel", type=click.IntRange(1), nargs=2, help="Frames and channels of the convolutions' kernels."),
    click.option("--padding", type=click.Choice(["valid", "same"]), help="Other kernels or windows need 'same'."),
    click.option("--window", type=click.IntRange(1), help="Frames that the short-term encoder sees, C."),
    click.option("--own", type=click.FloatRange(0, 1), help="Share of predicted frames in what training feeds back."),
    click.option(
        "--loss", type=click.Choice(["square", "distance"]), help="Of distances from true frames, or squares."
    ),
    click.option("--l2", type=click.FloatRange(0), help="Weight of the squared weights in the loss."),
    click.option("--adversary", type=click.FloatRange(0), help="Weight of the discriminator in the loss; 0 is none."),
)
"""Of the ablations; each one's default is the preset's."""

FITTING = ("steps", "batch", "learning_rate", "precision", "l2", "adversary")


def _command(name: str, title: str, switches: tuple[Option, ...] = ()) -> click.Command:
    def run(preset: str, **options: Any) -> None:
        _train(RECIPES[name][preset], **options)

    run.__doc__ = f"Train {title}, which `motet train predict` is compared with."
    presets = click.option("--preset", type=click.Choice(list(RECIPES[name])), default="default", show_default=True)
    function: Callable[..., None] = run
    options: tuple[Option, ...] = (*OPTIONS, presets, *switches)
    for option in reversed(options):
        function = option(function)
    return click.command(name)(function)


def _train(
    recipe: Recipe,
    data: Path,
    out: Path,
    all_files: bool,
    resume: bool,
    seed: int,
    device: str,
    threads: int,
    name: str | None,
    licence: str,
    **settings: Any,
) -> None:
    check_device(device)
    refuse(out, resume)
    torch.set_num_threads(threads)
    recipe = _changed(recipe, {key: value for key, value in settings.items() if value is not None})
    corpus = read_expmap_files(data)
    material = expmap_material(corpus, () if all_files else validation_files(corpus, WINDOW))
    about = About(name or out.name, command_line(), licence)
    with resumable(out), tqdm(total=recipe.fitting.steps, unit=" steps", disable=None) as bar:
        run = train_system(material, recipe, seed, about, out, device, lambda steps, loss: _advance(bar, steps, loss))
    training = run.manifest["training"]
    error, best = training["validation_error"], training["kept_step"]
    click.echo(f"{out}: {training['parameters']:,} parameters, {training['seconds']:g} s, {error:.3f} at step {best}")


def _changed(recipe: Recipe, settings: Mapping[str, Any]) -> Recipe:
    """The recipe with other settings of the training, and of the system's sizes."""
    fitting = {key: value for key, value in settings.items() if key in FITTING}
    sizes = {key: value for key, value in settings.items() if key not in FITTING}
    config = recipe.config
    return replace(
        recipe,
        fitting=replace(recipe.fitting, **fitting),
        config=lambda material: replace(config(material), **sizes),
    )


def _advance(bar: "tqdm[Any]", steps: int, loss: float) -> None:
    bar.set_postfix(loss=f"{loss:.3f}", refresh=False)
    bar.update(steps - bar.n)


TITLES = {
    "rrnn": "the residual recurrent net (Martinez et al. 2017)",
    "erd": "the encoder-recurrent-decoder (Fragkiadaki et al. 2015)",
    "lstm-3lr": "three LSTMs between linear maps (Fragkiadaki et al. 2015)",
    "srnn": "the structural RNN (Jain et al. 2016)",
    "lstm-ae": "the LSTMs with a denoising autoencoder (Ghosh et al. 2017)",
}

COMMANDS = (
    _command("convseq2seq", "the convolutional sequence-to-sequence model (Li et al. 2018)", SWITCHES),
    *(_command(name, title) for name, title in TITLES.items()),
)
