"""What the commands share: where a run may go, and how it was called."""

import shlex
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import click

from motet.errors import OutputError
from motet_train.checkpoint import CHECKPOINT


def refuse_existing(out: Path) -> None:
    """OutputError if there is something at the place of a new run."""
    if out.exists():
        raise OutputError(f"cannot write the run {out}: it exists; remove it first or choose another folder")


def refuse(out: Path, resume: bool) -> None:
    """OutputError if a run cannot start, or cannot go on, in that folder."""
    if not resume:
        refuse_existing(out)
    elif out.exists() and not (out / CHECKPOINT).is_file():
        raise OutputError(f"cannot go on in {out}: it has no {CHECKPOINT}; choose another folder")


@contextmanager
def resumable(out: Path) -> Iterator[None]:
    """A folder to train in. Where training ends early: say how it goes on, and leave nothing where it cannot."""
    out.mkdir(parents=True, exist_ok=True)
    try:
        yield
    except BaseException as error:
        if not (out / CHECKPOINT).is_file():
            shutil.rmtree(out)
        elif isinstance(error, KeyboardInterrupt):
            click.echo(f"\nstopped: the same command with --resume goes on from {out / CHECKPOINT}", err=True)
        raise


def command_line() -> str:
    """The command as it was given."""
    return shlex.join(["motet", *sys.argv[1:]])
