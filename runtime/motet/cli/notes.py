"""What commands say on stderr, beside their results, and how they take motion files."""

import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import click

from motet.cli.convert import METRES
from motet.errors import FormatError, MotionError, TextWarning, UnitError
from motet.formats import read_motion
from motet.models.language import LanguageModel
from motet.motion.motion import Motion

unit_option = click.option(
    "--unit-in", type=click.Choice(list(METRES)), help="Length unit of motions whose file does not say."
)


def note(text: str) -> None:
    """One line on stderr."""
    click.echo(f"motet: {text}", err=True)


def refused(path: Path, error: MotionError) -> FormatError:
    """The error that names the file a motion is from."""
    unit = "the file does not say how long a unit of its skeleton is: give --unit-in"
    return FormatError(path, unit if isinstance(error, UnitError) else str(error))


@contextmanager
def text_notes() -> Iterator[None]:
    """Unknown words are said on stderr, once for each sentence."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", TextWarning)
        yield
    for text in dict.fromkeys(str(warning.message) for warning in caught):
        note(text)


def read_for(model: LanguageModel, paths: Sequence[Path], unit_in: str | None) -> list[Motion]:
    """Motion files as motions of the model's contract, with a note where one is resampled; errors name the file.

    unit_in: a key of :data:`motet.cli.convert.METRES`, the length unit of files that do not say theirs, or None.
    """
    motions = []
    for path in paths:
        motion = read_motion(path)
        if unit_in and motion.skeleton and motion.skeleton.metres_per_unit is None:
            motion = motion.with_unit(METRES[unit_in])
        try:
            motions.append(model.contract.features(model.frames(motion)))
        except MotionError as error:
            raise refused(path, error) from error
        if abs(motion.fps - model.fps) > 1e-6:
            note(f"{path}: resampled from {motion.fps:g} to {model.fps:g} fps")
    return motions
