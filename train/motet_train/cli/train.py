"""``motet train``: the group of its commands."""

import click

from motet_train.cli.train_codec import actions, codec, codes
from motet_train.cli.train_control import crbm, tdbn
from motet_train.cli.train_fill import fill
from motet_train.cli.train_language import describe, generate, search
from motet_train.cli.train_matching import matching
from motet_train.cli.train_predict import predict
from motet_train.cli.train_steered import steered
from motet_train.cli.train_systems import COMMANDS


@click.group()
def train() -> None:
    """Train a model; the run goes into a new folder that evaluate and export take."""


CONTROL = (matching, steered, tdbn, crbm)
for command in (*CONTROL, describe, codec, actions, codes, generate, search, predict, fill, *COMMANDS):
    train.add_command(command)
