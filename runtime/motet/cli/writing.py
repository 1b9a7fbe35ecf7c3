"""How commands write motions: the options that all of them share, and what they say of what was written."""

import functools
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from motet.formats import read_character, write_motion
from motet.formats.character import Character, put_onto
from motet.motion.motion import Motion
from motet.motion.rigs import RIGS
from motet.motion.root_motion import in_place

FPS = click.FloatRange(0, 10_000, min_open=True)
"""Frame rates that a motion is resampled to."""


@dataclass(frozen=True)
class Output:
    """How results are written: on a character or their own figure, at this frame rate or their own, in place or not."""

    like: Character | None
    fps: float | None
    in_place: bool

    def shaped(self, motion: Motion) -> Motion:
        """The motion as it is to be written."""
        motion = put_onto(motion, self.like) if self.like else motion
        motion = motion.resample(self.fps) if self.fps else motion
        return in_place(motion) if self.in_place else motion

    def write(self, place: Path, motion: Motion) -> Motion:
        """Write a motion, and give what was written."""
        motion = self.shaped(motion)
        write_motion(place, motion)
        return motion


def write_options(command: Callable[..., None]) -> Callable[..., None]:
    """Gives a command ``output``, as ``--like``, ``--fps`` and ``--in-place`` say; a character is read at once."""

    @click.option(
        "--like",
        "like",
        type=Path,
        metavar="CHARACTER",
        help=f"Put the result on the skeleton of this file (.bvh, .glb, .vrm, ...), or of a rig: {', '.join(RIGS)}.",
    )
    @click.option("--fps", type=FPS, help="Frame rate to write, such as 24, 25, 30 or 60. [default: the result's own]")
    @click.option("--in-place", is_flag=True, help="Take out the way over the ground; height and turns stay.")
    @functools.wraps(command)
    def with_output(like: Path | None, fps: float | None, in_place: bool, **options: Any) -> None:
        command(output=Output(None if like is None else read_character(like), fps, in_place), **options)

    return with_output


def size(frames: int, fps: float) -> str:
    """How long a motion is, in words."""
    return f"{frames} frames at {fps:g} fps, {round(frames / fps, 2):g} s"
