"""``motet train``: the group of its commands."""

import click

from motet_train.cli import train_store, train_systems
from motet_train.cli.train_all import everything, generate
from motet_train.cli.train_control import crbm, tdbn
from motet_train.cli.train_predict import predict


@click.group()
def train() -> None:
    """Train models on your own recordings: all shipped kinds, or one. Evaluate and export take the runs."""


for command in (everything, generate, predict, tdbn, crbm, *train_store.COMMANDS, *train_systems.COMMANDS):
    train.add_command(command)
