"""The command line: each command is imported on use, and names the extra it needs if one is missing."""

import importlib
import importlib.util
import logging
import os
import sys
from difflib import get_close_matches
from typing import Any

import click

from motet.errors import MotetError

COMMANDS = {
    "describe": ("motet.cli.describe", "", "Describe motions in ranked sentences."),
    "generate": ("motet.cli.generate", "", "Generate motions from sentences."),
    "compose": ("motet.cli.compose", "", "Compose motions: prompts, places and poses at given times."),
    "key": ("motet.cli.key", "", "Make clips of acts by key poses."),
    "predict": ("motet.cli.predict", "", "Predict how motions continue."),
    "fill": ("motet.cli.fill", "", "Fill gaps of motions, and close loops."),
    "join": ("motet.cli.fill", "", "Join two motions by a transition."),
    "control": ("motet.cli.control", "", "Run a script such as 'walk 3s, run 3s'."),
    "live": ("motet.cli.live", "", "Steer figures live: in a page, by a server, onto an avatar."),
    "demo": ("motet.cli.demo", "", "Write a folder of pages that show what the models do."),
    "serve": ("motet.cli.serve", "serve", "Serve models over HTTP."),
    "search": ("motet.cli.search", "", "Find motions in a folder by a sentence or a motion."),
    "embed": ("motet.cli.embed", "", "Write context vectors of motions or sentences."),
    "check": ("motet.cli.check", "", "Say what motion files hold and how they are understood."),
    "convert": ("motet.cli.convert", "", "Convert motion files to other formats, rates, units."),
    "merge": ("motet.cli.many", "", "Merge the answers that --parts wrote."),
    "view": ("motet.cli.convert", "", "Write a web page that plays a motion."),
    "bundle": ("motet.cli.bundles", "", "List, inspect, verify and pack models (bundles)."),
    "bench": ("motet.cli.bench", "", "Measure how fast a model runs here."),
    "prepare": ("motet_train.cli.prepare", "train", "Turn motions and sentences into a store to train on."),
    "train": ("motet_train.cli.train", "train", "Train a model."),
    "evaluate": ("motet_train.cli.evaluate", "evaluate", "Measure a trained run or a bundle."),
    "export": ("motet_export.cli", "export", "Export a trained run as a bundle."),
    "parity": ("motet_export.cli", "export", "Compare a bundle with the trained run it came from."),
}
"""Command -> the module that has it, the extra that it needs, and what it does."""

NEEDS = {
    "live": ("websockets", "pythonosc"),
    "serve": ("starlette", "uvicorn", "python_multipart", "websockets"),
    "mmcp": ("motionmcp", "fastapi"),
    "train": ("torch", "tqdm"),
    "evaluate": ("torch", "tqdm", "matplotlib", "sklearn", "sacrebleu"),
    "export": ("torch", "tqdm", "onnx", "onnxscript"),
}
"""Extra -> the packages by which it is recognised."""


class StderrHandler(logging.Handler):
    """One line on stderr for each record."""

    def emit(self, record: logging.LogRecord) -> None:
        """Print it."""
        click.echo(f"motet: {self.format(record)}", err=True)


class Commands(click.Group):
    """A group that imports a command only when it is called, and shows which need an extra."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """The commands whose extra is installed."""
        return [name for name, (_, extra, _) in COMMANDS.items() if not missing(extra)]

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands without importing them, and those whose extra is missing with the extra."""
        here = self.list_commands(ctx)
        with formatter.section("Commands"):
            formatter.write_dl([(name, COMMANDS[name][2]) for name in here])
        others = [(name, f"{line} [{extra}]") for name, (_, extra, line) in COMMANDS.items() if name not in here]
        if others:
            with formatter.section("Commands of extras, installed with  pip install 'motet[EXTRA]'"):
                formatter.write_dl(others)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """The called command; a misspelt one is refused with the nearest name."""
        near = get_close_matches(args[0], COMMANDS, 1)
        if near and args[0] not in COMMANDS and not ctx.resilient_parsing:
            ctx.fail(f"No such command {args[0]!r}. Did you mean {near[0]!r}?")
        return super().resolve_command(ctx, args)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import one command; a clear refusal where its extra is not installed."""
        if cmd_name not in COMMANDS:
            return None
        module, extra, _ = COMMANDS[cmd_name]
        if lacking := missing(extra):
            raise click.UsageError(
                f"motet {cmd_name} needs {', '.join(lacking)}: install the extra with  pip install 'motet[{extra}]'"
            )
        command: click.Command = getattr(importlib.import_module(module), cmd_name)
        return command

    def invoke(self, ctx: click.Context) -> Any:
        """Run a command; motet's own errors become one message on stderr and exit code 2, Ctrl-C becomes code 130."""
        try:
            return super().invoke(ctx)
        except MotetError as error:
            click.echo(f"motet: {error}", err=True)
            sys.exit(2)
        except KeyboardInterrupt:
            sys.exit(130)

    def main(self, *args: Any, **kwargs: Any) -> Any:
        """Run as a program; if results cannot be printed, as on a full disk, one message and exit code 1."""
        try:
            return super().main(*args, **kwargs)
        except OSError as error:
            if error.filename is not None:  # a fault of a file, not of what is printed
                raise
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # what Python still holds goes nowhere
            click.echo(f"motet: cannot print the results: {error.strerror}", err=True)
            sys.exit(1)


def missing(extra: str) -> list[str]:
    """The packages of an extra that are not installed."""
    return [name for name in NEEDS.get(extra, ()) if importlib.util.find_spec(name) is None]


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.option("-q", "--quiet", is_flag=True, help="Print only errors on stderr.")
@click.option("-v", "--verbose", is_flag=True, help="Print details on stderr, such as resampling.")
@click.version_option(package_name="motet")
def main(quiet: bool, verbose: bool) -> None:
    """Models of human motion that describe, generate, predict and control."""
    log = logging.getLogger("motet")
    log.handlers = [StderrHandler()]
    log.setLevel(logging.ERROR if quiet else logging.INFO if verbose else logging.WARNING)
