"""``motet train convseq2seq`` and the commands of the other published prediction systems."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from motet_train.cli.train_options import train_command
from motet_train.cli.train_predict import AUGMENTATION, read_expmap_files
from motet_train.papers.li2018.material import expmap_material, validation_files
from motet_train.papers.li2018.protocol import PROTOCOL_WINDOW
from motet_train.papers.li2018.recipe import RECIPES, train_system
from motet_train.papers.li2018.systems import SYSTEM_TITLES
from motet_train.recipes.recipe import Job
from motet_train.runs import Run

OPTIONS = (
    click.option("--data", type=Path, required=True, help="Folder or zip of exponential-map text files."),
    click.option("--steps", type=click.IntRange(1), help="[default: the preset's]"),
    click.option("--batch", type=click.IntRange(1), help="Windows per batch. [default: the preset's]"),
    click.option("--learning-rate", type=click.FloatRange(0, min_open=True), help="[default: the preset's]"),
    *AUGMENTATION,
    click.option("--all-files", is_flag=True, help="Hold out no training files; validate on windows of all of them."),
)

SWITCHES = (
    click.option("--long-term", type=click.Choice(["convolutional", "recurrent", "none"]), help="Long-term encoder."),
    click.option("--kernel", type=click.IntRange(1), nargs=2, help="Frames and channels of the convolutions' kernels."),
    click.option("--padding", type=click.Choice(["valid", "same"]), help="Other kernels or windows need 'same'."),
    click.option("--window", type=click.IntRange(1), help="Frames seen by the short-term encoder, C."),
    click.option(
        "--own", type=click.FloatRange(0, 1), help="Share of predicted frames among those fed back in training."
    ),
    click.option("--loss", type=click.Choice(["square", "distance"]), help="Mean squared distance, or mean distance."),
    click.option("--l2", type=click.FloatRange(0), help="Weight of the squared weights in the loss."),
    click.option("--adversary", type=click.FloatRange(0), help="Weight of the discriminator in the loss; 0: none."),
)
"""Options of the ablations; the defaults are the preset's."""


def _command(name: str, title: str, *switches: Callable[..., Any]) -> click.Command:
    def run(job: Job, data: Path, all_files: bool) -> Run:
        corpus = read_expmap_files(data)
        kept_back = () if all_files else validation_files(corpus, PROTOCOL_WINDOW)
        return train_system(expmap_material(corpus, kept_back), job)

    run.__doc__ = f"Train {title}, a baseline of `motet train predict`."
    return train_command(name, RECIPES[name], *OPTIONS, *switches)(run)


COMMANDS = tuple(
    _command(name, title, *(SWITCHES if name == "convseq2seq" else ())) for name, title in SYSTEM_TITLES.items()
)
