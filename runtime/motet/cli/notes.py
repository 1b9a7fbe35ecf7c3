"""What commands say on stderr beside their results: the log of ``motet``, and words that a model does not know."""

import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

import click

from motet.errors import TextWarning

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
def text_notes() -> Iterator[None]:
    """Log unknown words, once for each sentence."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", TextWarning)
        yield
    for text in dict.fromkeys(str(warning.message) for warning in caught):
        log.warning(text)
