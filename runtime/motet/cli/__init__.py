"""The command line: each command is imported when it is used, and says which extra it needs where one is missing."""

import importlib
import importlib.util
import sys
from typing import Any

import click

from motet.errors import MotetError

COMMANDS = {
    "describe": ("motet.cli.describe:describe", None),
    "generate": ("motet.cli.generate:generate", None),
    "predict": ("motet.cli.predict:predict", None),
    "control": ("motet.cli.control:control", None),
    "embed": ("motet.cli.embed:embed", None),
    "convert": ("motet.cli.convert:convert", None),
    "view": ("motet.cli.convert:view", None),
    "bundle": ("motet.cli.bundle:bundle", None),
    "bench": ("motet.cli.bench:bench", None),
    "prepare": ("motet_train.cli.prepare:prepare", "train"),
    "train": ("motet_train.cli.train:train", "train"),
    "evaluate": ("motet_train.cli.evaluate:evaluate", "evaluate"),
    "export": ("motet_export.cli:export", "export"),
    "parity": ("motet_export.cli:parity", "export"),
}
"""Command -> where it is, and the extra that it needs."""

NEEDS = {
    "train": ("torch", "tqdm"),
    "evaluate": ("torch", "tqdm", "matplotlib", "sklearn", "sacrebleu"),
    "export": ("torch", "tqdm", "onnx", "onnxscript"),
}
"""Extra -> the packages by which it is recognised."""


class Commands(click.Group):
    """A group that imports a command only when it is called, and lists those that can run here."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """The commands whose extra is installed."""
        return [name for name, (_, extra) in COMMANDS.items() if not missing(extra)]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import one command; a clear refusal where its extra is not installed."""
        if cmd_name not in COMMANDS:
            return None
        place, extra = COMMANDS[cmd_name]
        if lacking := missing(extra):
            raise click.UsageError(
                f"motet {cmd_name} needs {', '.join(lacking)}: install the extra with  pip install 'motet[{extra}]'"
            )
        module, _, name = place.partition(":")
        command: click.Command = getattr(importlib.import_module(module), name)
        return command

    def invoke(self, ctx: click.Context) -> Any:
        """Run a command; motet's own errors become one message on stderr and exit code 2."""
        try:
            return super().invoke(ctx)
        except MotetError as error:
            click.echo(f"motet: {error}", err=True)
            sys.exit(2)


def missing(extra: str | None) -> list[str]:
    """The packages of an extra that are not installed."""
    return [name for name in NEEDS.get(extra or "", ()) if importlib.util.find_spec(name) is None]


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="motet")
def main() -> None:
    """Models of human motion that run anywhere: describe, generate, predict, control."""
