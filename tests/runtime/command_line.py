"""The command line as tests use it: a run, and what is asked of every refusal."""

import inspect
from pathlib import Path

from click.testing import CliRunner, Result

from motet.cli import main

# click before 8.2 puts stderr into stdout unless told not to; since then it never does
SEPARATE = {"mix_stderr": False} if "mix_stderr" in inspect.signature(CliRunner).parameters else {}


def run(*arguments: object) -> Result:
    """What ``motet ARGUMENTS`` says and returns."""
    return CliRunner(**SEPARATE).invoke(main, [str(argument) for argument in arguments])


def check_refused(result: Result, said: str, out: Path, code: int = 2) -> None:
    """One message with the words ``said``, and nothing written in the folder ``out``.

    code: 2 where the command cannot be run as it was given, 1 where an input file fails.
    """
    assert result.exit_code == code
    assert said in result.stderr
    assert "Traceback" not in result.stderr
    assert result.stdout == ""
    assert list(out.iterdir()) == []
