"""Write a motion as one HTML page with a player: no network, no other file, any browser.

The page is ``player.html`` with the figures inserted as JSON. A figure holds the path of its root as float32 (T, 3) and
its points relative to the root as int16 (T, P, 3) in steps of ``step`` body heights, both base64 of little-endian
bytes. A step is 0.0001 heights (0.2 mm for a person) unless a point is further than 3.2 heights from the root.
"""

import math
from base64 import b64encode
from collections.abc import Sequence
from typing import Any

import numpy as np

from motet.draw.figure import figure_of
from motet.draw.page import bone_data, filled, source
from motet.errors import MotionError
from motet.files import File, place_of, write_whole
from motet.motion.motion import Motion

Captions = Sequence[tuple[float, str]]
"""Timed captions: (start in seconds, text), each shown until the next starts."""


def write(file: File, motion: Motion, captions: Captions | None = None, title: str | None = None) -> None:
    """Write the page of one motion, with timed captions and a title (the file's name if None).

    MotionError for a motion without skeleton or frames, OutputError if the file cannot be written.
    """
    title = place_of(file).stem if title is None else title
    write_whole(file, page([figure_data(motion, "", captions)], title))


def write_many(file: File, motions: Sequence[Motion], names: Sequence[str], title: str | None = None) -> None:
    """Write one page of several motions side by side on one clock, each with its name; errors like :func:`write`."""
    if not motions or len(motions) != len(names):
        raise MotionError(f"a page needs motions and a name for each, not {len(motions)} and {len(names)} names")
    title = place_of(file).stem if title is None else title
    write_whole(file, page([figure_data(m, name) for m, name in zip(motions, names, strict=True)], title))


def page(figures: list[dict[str, Any]], title: str) -> str:
    """The HTML of the figures, each from :func:`figure_data`."""
    return filled(source("motet.draw", "player.html"), title, {"figures": figures})


def figure_data(motion: Motion, name: str, captions: Captions | None = None) -> dict[str, Any]:
    """A motion in the player's format, ready for JSON; see the module's docstring."""
    figure = figure_of(motion)
    root = figure.points[:, 0].astype("<f4")
    relative = figure.points - root[:, None]
    step = max(1e-4, float(np.abs(relative).max()) / 32767)
    return {
        "name": name,
        "fps": figure.fps,
        "frames": len(motion),
        "heading": figure.heading,
        "bones": [bone_data(bone) for bone in figure.bones],
        "captions": _checked(captions or ()),
        "step": step,
        "root": b64encode(root.tobytes()).decode(),
        "points": b64encode(np.round(relative / step).astype("<i2").tobytes()).decode(),
    }


def _checked(captions: Captions) -> list[list[float | str]]:
    starts = [start for start, _ in captions]
    if not all(math.isfinite(start) for start in starts) or starts != sorted(starts):
        raise MotionError(f"caption start times must not decrease: {starts}")
    return [[float(start), text] for start, text in captions]
