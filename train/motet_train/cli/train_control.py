"""``motet train tdbn`` and ``motet train crbm``: models for live control."""

from dataclasses import replace
from pathlib import Path

import click

from motet_train.cli.train_options import train_command, unit_in
from motet_train.papers.tdbn.clips import read_clips
from motet_train.papers.tdbn.recipe import BASELINES, RECIPES, train_control
from motet_train.recipes.recipe import Job
from motet_train.runs import Run

DATA = click.option(
    "--data",
    type=Path,
    help="Folder of clips LABEL.bvh and LABEL/*.bvh (or .amc .npz .csv). [default: three CMU trials, in a checkout]",
)

# seed 6 is that of the bundle cmu-control
SHIPPED = {"seed": 6, "out": "runs/tdbn", "name": "cmu-control"}


@train_command("tdbn", RECIPES, DATA, unit_in, defaults=SHIPPED)
def tdbn(job: Job, data: Path | None, unit_in: str | None) -> Run:
    """Train a temporal deep belief net for live control, on short labelled clips."""
    return train_control(read_clips(data, job.recipe.config.root_rotation, unit_in), job)


@train_command(
    "crbm",
    BASELINES,
    DATA,
    unit_in,
    click.option("--labels", help='Labels to train on, such as "walk,run". [default: all]'),
    click.option("--past-rate", type=float, help="Rate from past to angles. [default: the preset's]"),
    click.option("--control-units", type=click.IntRange(1), help="Units per label. [default: the preset's]"),
    click.option("--epochs", type=click.IntRange(1), help="[default: the preset's]"),
    defaults={"out": "runs/crbm", "name": "crbm"},
)
def crbm(job: Job, data: Path | None, unit_in: str | None, labels: str | None, epochs: int | None) -> Run:
    """Train the baseline, a conditional RBM on the joint angles (Taylor 2007)."""
    config = job.recipe.config
    if epochs is not None:
        config = replace(config, crbm=replace(config.crbm, epochs=epochs))
        job = replace(job, recipe=replace(job.recipe, config=config))
    clips = read_clips(data, config.root_rotation, unit_in)
    return train_control(clips.only([label.strip() for label in labels.split(",")]) if labels else clips, job)
