"""How commands write motions: the options that all of them share, where results go, and what is said of them."""

import functools
import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import click

from motet.cli.options import Command
from motet.cli.reading import FRAME_RATE
from motet.corpus.sources import Source
from motet.draw.page import Captions
from motet.draw.page import write as write_page
from motet.figures.humanoid import RIGS
from motet.formats import (
    BODIES,
    ONTO,
    WRITABLE,
    Character,
    check_writable,
    read_character,
    shaped,
    write_all_on,
    write_on,
)
from motet.formats.text import UniqueNames
from motet.motion.motion import Motion


@dataclass(frozen=True)
class Output:
    """How results are written: on a character or their own figure, at this frame rate or their own, in place or not.

    onto: the file of the character where it is written itself, with all results of a place as clips, in the end.
    """

    character: Character | None
    fps: float | None
    in_place: bool
    onto: Path | None = None
    _clips: dict[Path, dict[str, Motion]] = field(default_factory=dict)

    def check(self, place: Path) -> None:
        """Refuse a place that cannot be written to, or an extension that does not fit, before long work starts."""
        check_writable(place, allowed=ONTO if self.onto else WRITABLE)
        if self.onto:
            spare(place, self.onto)

    def shaped(self, motion: Motion) -> Motion:
        """The motion as it is to be written."""
        return shaped(motion, self.character, self.fps, self.in_place)

    def save(self, place: Path, motion: Motion, name: str, captions: Captions | None = None) -> None:
        """Write a motion that is shaped, or keep it for :meth:`finish` as a clip of this name, or one like it.

        A page has the name as its title, and the captions.
        """
        if self.onto:
            clips = self._clips.setdefault(place, {})
            clips[UniqueNames(clips).unique(name)] = motion
        elif place.suffix.lower() == ".html":
            write_page(place, motion, captions, name)
        else:
            write_on(place, motion, self.character)

    def write(self, place: Path, motion: Motion, name: str, captions: Captions | None = None) -> Motion:
        """Write a motion, see :meth:`save`, and give what was written."""
        motion = self.shaped(motion)
        self.save(place, motion, name, captions)
        return motion

    def finish(self) -> None:
        """Write the characters with their clips."""
        for place, clips in self._clips.items():
            if self.character:
                write_all_on(place, clips, self.character)


out_option = click.option(
    "-o", "--out", required=True, type=Path, help=f"File to write; its extension is the format: {' '.join(WRITABLE)}."
)


def write_options(command: Command) -> Command:
    """Gives a command ``output``, as ``--like``, ``--onto``, ``--fps`` and ``--in-place`` say; a character is read at
    once. The command calls its :meth:`Output.finish` in the end."""

    @click.option(
        "--like",
        type=Path,
        metavar="CHARACTER",
        help=f"Put the result on the skeleton of this file (.bvh, .glb, .vrm, ...), or of a rig: {', '.join(RIGS)}.",
    )
    @click.option(
        "--onto",
        type=Path,
        metavar="CHARACTER",
        help=f"Write this character ({' '.join(BODIES)}) with mesh and materials, and the results as clips in it.",
    )
    @click.option(
        "--fps", type=FRAME_RATE, help="Frame rate to write, such as 24, 25, 30 or 60. [default: the result's own]"
    )
    @click.option("--in-place", is_flag=True, help="Remove horizontal travel; height and turns stay.")
    @functools.wraps(command)
    def with_output(like: Path | None, onto: Path | None, fps: float | None, in_place: bool, **options: Any) -> None:
        if like and onto:
            raise click.UsageError("--like writes only motions, --onto the character with them: give one of the two")
        if onto and onto.suffix.lower() not in BODIES:
            raise click.UsageError(f"--onto takes a character with its mesh ({' '.join(BODIES)}), which {onto} is not")
        character_file = onto or like
        character = None if character_file is None else read_character(character_file)
        command(output=Output(character, fps, in_place, onto), **options)

    return with_output


def spare(place: Path, *sources: Path) -> None:
    """Refuse a result that would take the place of a file that it is made from."""
    _spare(place, {source.resolve() for source in sources})


def _spare(place: Path, sources: Collection[Path]) -> None:
    if place.resolve() in sources:
        raise click.UsageError(f"{place} is an input and would be overwritten: name another file for the result")


def say_written(place: Path, motion: Motion, note: str = "") -> None:
    """Print where a motion was written, how long it is, and a note."""
    click.echo(f"{place}: {size(len(motion), motion.fps)}{note}")


def size(frames: int, fps: float) -> str:
    """How long a motion is, in words."""
    return f"{frames} frames at {fps:g} fps, {round(frames / fps, 2):g} s"


NAME_FIELDS = re.compile(r"\{(name|clip)\}")


def _named(out: Path, source: Source | str) -> Path:
    """OUT with the names of a source in it."""

    def name_of(field: re.Match[str]) -> str:
        if isinstance(source, str):
            return source
        return source.name if field[1] == "name" else source.label

    return Path(NAME_FIELDS.sub(name_of, str(out)))


def _numbered(place: Path, count: int) -> list[Path]:
    """A place for each of several results."""
    if count <= 1:
        return [place] * count
    return [place.with_stem(f"{place.stem}-{number}") for number in range(1, count + 1)]


def places(out: Path, sources: Sequence[Source | str], samples: int = 1, output: Output | None = None) -> list[Path]:
    """Where results go: by ``{name}`` and ``{clip}`` in OUT, or several numbered: out-1.bvh, out-2.bvh, ...

    samples: how many results each source has, one after the other, which are numbered in any case.
    output: how they are written; a character takes all that go to one place.
    """
    onto = output is not None and output.onto is not None
    targets = []
    if onto:
        for source in sources:
            targets += [_named(out, source)] * samples
    elif NAME_FIELDS.search(str(out)):
        for source in sources:
            targets += _numbered(_named(out, source), samples)
    else:
        targets = _numbered(out, len(sources) * samples)
    if len(set(targets)) < len(targets) and not onto:
        raise click.UsageError(
            "several results have the same name: give an OUT with {name} and, for clips, {clip}, or without both"
        )
    inputs = {source.path.resolve() for source in sources if isinstance(source, Source)}
    for place in targets:
        output.check(place) if output else check_writable(place)
        _spare(place, inputs)
    return targets
