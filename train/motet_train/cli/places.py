"""What the commands share: where a run may go, and how it was called."""

import shlex
import sys
from pathlib import Path

from motet.errors import OutputError


def refuse_existing(out: Path) -> None:
    """OutputError if there is something at the place of a new run."""
    if out.exists():
        raise OutputError(f"cannot write the run {out}: it exists; remove it first or choose another folder")


def command_line() -> str:
    """The command as it was given."""
    return shlex.join(["motet", *sys.argv[1:]])
