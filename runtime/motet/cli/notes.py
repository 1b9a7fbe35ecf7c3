"""What commands print on stderr: the log of ``motet``, and its warnings."""

import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

import click

from motet.errors import ControlWarning, TextWarning

log = logging.getLogger("motet")


class _Echo(logging.Handler):
    """One line on stderr for each record."""

    def emit(self, record: logging.LogRecord) -> None:
        click.echo(f"motet: {self.format(record)}", err=True)


def show_log(level: int) -> None:
    """Print what ``motet`` logs from this level on."""
    log.handlers = [_Echo()]
    log.setLevel(level)


@contextmanager
def noted() -> Iterator[None]:
    """Log what motet warns of, words that are not known and speeds that a gait does not have, each once."""
    with warnings.catch_warnings(record=True) as caught:
        for category in (TextWarning, ControlWarning):
            warnings.simplefilter("always", category)
        yield
    for text in dict.fromkeys(str(warning.message) for warning in caught):
        log.warning(text)
