"""The progress of a training: a bar on a terminal, else a line for each chunk; and TensorBoard."""

import logging
import math
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tqdm import tqdm

from motet.bundle.fields import Json
from motet_train import distributed
from motet_train.data.corpus import Record, Skipped
from motet_train.runs import RunError

log = logging.getLogger("motet.train")

SOON = 10.0
"""Seconds between lines, where a chunk or the preparation of motions takes many minutes."""


class Watcher:
    """Receives the progress of a training, and ignores it. ``done`` of ``total`` epochs or steps are done."""

    def step(self, done: int, total: int, unit: str, loss: float) -> None:
        """After each step."""

    def chunk(self, line: Json, total: int, unit: str) -> None:
        """After each chunk, with its line of the log."""


SILENT = Watcher()


class Shown(Watcher):
    """A bar with loss, speed and remaining time; without a terminal, an early line and one for each chunk.

    The lines are logged by "motet.train"; with ``motet --quiet`` there is neither bar nor line.
    boards: the folder for TensorBoard; RunError if that is not installed.
    """

    def __init__(self, boards: Path | None = None) -> None:
        self.watched = sys.stderr.isatty() and distributed.rank() == 0 and log.isEnabledFor(logging.INFO)
        self.writer: Any = None
        self.bar: tqdm[Any] | None = None
        self.done = 0
        self.due = time.monotonic() + SOON
        if boards is not None and distributed.rank() == 0:
            try:
                from torch.utils.tensorboard import SummaryWriter
            except ImportError as error:
                raise RunError(
                    "--tensorboard needs the package tensorboard: pip install 'motet[tensorboard]'"
                ) from error
            self.writer = SummaryWriter(boards)

    def step(self, done: int, total: int, unit: str, loss: float) -> None:
        """Move the bar, or log the first line."""
        if self.bar is None:
            self.done = done - 1
            self.bar = tqdm(total=total, initial=self.done, unit=f" {unit}s", disable=not self.watched)
        if time.monotonic() > self.due:
            self.due = math.inf
            self._say("%s %d of %d: loss %.5g", unit, done, total, loss)
        self.bar.set_postfix(loss=f"{loss:.4g}", refresh=False)
        self.bar.update(done - (unit == "epoch") - self.bar.n)  # an epoch is done after its last step

    def chunk(self, line: Json, total: int, unit: str) -> None:
        """Log the line of a chunk, or move the bar, and add its numbers to TensorBoard."""
        figures = {key: value for key, value in line.items() if isinstance(value, int | float) and key != unit}
        done = line[unit]
        # TensorBoard, the log, and the bar
        if self.writer is not None:
            for key, value in figures.items():
                self.writer.add_scalar(key, value, done)
        if not self.watched:
            seconds_left = figures["seconds"] / (done - self.done) * (total - done)
            text = ", ".join(f"{key.replace('_', ' ')} {value:.5g}" for key, value in figures.items())
            self._say("%s %d of %d: %s, %.0f s left", unit, done, total, text, seconds_left)
        if self.bar is not None:
            self.bar.update(done - self.bar.n)
        self.done = done
        self.due = math.inf

    def _say(self, line: str, *values: object) -> None:
        if distributed.rank() == 0 and not self.watched:
            log.info(line, *values)

    def close(self) -> None:
        """Close the bar and the TensorBoard log."""
        if self.bar is not None:
            self.bar.close()
        if self.writer is not None:
            self.writer.close()


@contextmanager
def preparing(total: int) -> Iterator[Callable[[Record | Skipped], None]]:
    """A bar of prepared motions, with the names of those skipped; without a terminal, a line now and then."""
    count = 0
    due = time.monotonic() + SOON
    with tqdm(total=total, unit=" motions", disable=None) as bar:

        def done(item: Record | Skipped) -> None:
            nonlocal count, due
            count += 1
            bar.update()
            if isinstance(item, Skipped):
                bar.write(f"skipped {item.name}: {item.reason}")
            if bar.disable and time.monotonic() > due:
                due = time.monotonic() + SOON
                log.info("prepared %d of %d motions", count, total)

        yield done
