"""The commands behind a table, as a page shows them."""

import re
import shlex
from collections.abc import Sequence
from pathlib import PurePath

from motet_train.evaluate.predict.results import Results

WIDTH = 116
"""Columns of a line of a page."""


def training_commands(results: Results) -> list[str]:
    """The command of each group's first run, by its manifest, and the seeds of the others; one that is not known is
    left out."""
    lines = []
    for group in results.groups:
        trainings = [results.models[run].manifest.training for run in group.runs]
        seeds = [str(training["seed"]) for training in trainings[1:] if "seed" in training]
        if command := str(trainings[0].get("command", "")):
            many = "s" if len(seeds) > 1 else ""
            lines.append(shown(command, f"seed{many} {', '.join(seeds)} too" if seeds else ""))
    return lines


def shown(command: str, remark: str = "") -> str:
    """A command over as many lines as it needs, whole paths shortened to their names; remark: behind it."""
    words = [_short(word) for word in shlex.split(command)]
    whole = re.sub(r"'(\S+/\*)'", r"\1", shlex.join(words))  # the shell is to expand it
    lines, rest = [], whole + (f"  # {remark}" if remark else "")
    while len(rest) > WIDTH - 4 and (cut := rest.rfind(" --", 8, WIDTH - 6)) > 0:
        lines.append(rest[:cut] + " \\")
        rest = "    " + rest[cut + 1 :]
    return "\n".join([*lines, rest])


def _short(word: str) -> str:
    option, equals, value = word.partition("=")
    if equals and value.startswith("/"):
        return f"{option}={PurePath(value).name}"
    return PurePath(word).name if word.startswith("/") else word


def run_words(names: Sequence[str], existing: Sequence[str]) -> list[str]:
    """The runs of a command: FOLDER/* where they are all the runs of one folder, ``existing`` ones, else each."""
    parents = {str(PurePath(name).parent) for name in names}
    if len(names) > 1 and len(parents) == 1 and {PurePath(name).name for name in names} == set(existing):
        return [f"{_short(parents.pop())}/*"]
    return [_short(name) for name in names]
