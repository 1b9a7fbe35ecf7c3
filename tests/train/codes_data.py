"""Walkers in ``root_sixd``, each shown as one of a few actions, and tiny nets for their codes."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from click.testing import CliRunner
from language_data import walker
from stores import prepare

from motet.cli import main
from motet_train.data.corpus import Record
from motet_train.data.preparation import Preparation
from motet_train.data.store import Store
from motet_train.runs import Run

ACTIONS = {
    "walk": ("a person walks", "someone walks along", "walking"),
    "turn left": ("a person turns left", "someone goes to the left"),
    "turn right": ("a person turns right", "someone goes to the right"),
    "run": ("a person runs", "running ahead"),
}
"""What is shown, and what is said of it."""

PREPARATION = Preparation("root_sixd", humanoid=False, trim=False, cut=False, fps=30.0)

CODEC = """
[training]
steps = 6
every = 3
batch = 8
warm_up = 0
cosine = false
precision = "float32"
[model]
moves = 8
groups = 2
levels = [3, 5]
width = 12
blocks = 1
ahead = [1, 0]
fine = 6
[visits]
frames = 16
"""

CODES = """
[training]
steps = 6
every = 3
batch = 4
warm_up = 0
falling = 0.0
precision = "float32"
[model]
width = 12
layers = 2
heads = 2
action = 5
ages = 6
[visits]
window = 6
"""

TEXT = """
[training]
steps = 6
every = 3
batch = 8
falling = 0.0
[model]
embedding = 6
hidden = 5
"""


def records(count: int = 20) -> Iterator[Record]:
    """Motions of 1.3 to 1.8 seconds, each with an action, its sentences, and one for measuring."""
    for i in range(count):
        action = list(ACTIONS)[i % len(ACTIONS)]
        said = ACTIONS[action]
        yield Record(f"{i:02}", f"{i % 4}", walker(i, 40 + i % 15), said, (f"{said[0]} slowly",), action=action)


def small_store(folder: Path, count: int = 20) -> Store:
    """The walkers at 30 Hz, in ``folder``/store."""
    return prepare(records(count), folder / "store", PREPARATION)


def without_actions(store: Store) -> Store:
    """The same, nobody having said what is shown."""
    return replace(store, records=tuple(replace(entry, action="") for entry in store.records))


def trained(command: str, settings: str, store: Path, out: Path, *options: object) -> Run:
    """The run of a training command with settings, as users start it."""
    config = out.parent / f"{command}.toml"
    config.write_text(settings)
    given = ("train", command, "--data", store, "--out", out, "--config", config, *options)
    result = CliRunner().invoke(main, [str(option) for option in given])
    assert result.exit_code == 0, result.output or result.exception
    return Run.load(out)
