"""Self-contained pages: a template with the parts that all pages share, and the data for its script.

A motion is written as one HTML page with a player: no network, no other file, any browser. The page is ``player.html``
with the figures inserted as JSON. A figure holds the path of its root as float32 (T, 3) and its points relative to the
root as int16 (T, P, 3) in steps of ``step`` body heights, both base64 of little-endian bytes. A step is 0.0001 heights
(0.2 mm for a person) unless a point is further than 3.2 heights from the root.
"""

import json
import math
import re
from base64 import b64encode
from collections.abc import Sequence
from html import escape
from importlib.resources import files
from typing import Any

import numpy as np

from motet.draw.figure import Bone, figure_of
from motet.errors import MotionError
from motet.files import File, place_of, write_whole
from motet.motion.motion import Motion

Captions = Sequence[tuple[float, str]]
"""Timed captions: (start in seconds, text), each shown until the next starts."""


def write(file: File, motion: Motion, captions: Captions | None = None, title: str | None = None) -> None:
    """Write the page of one motion, with timed captions and a title (the file's name if None).

    MotionError for a motion without skeleton or frames, OutputError if the file cannot be written.
    """
    _write(file, [figure_data(motion, "", captions)], title)


def write_many(file: File, motions: Sequence[Motion], names: Sequence[str], title: str | None = None) -> None:
    """Write one page of several motions side by side on one clock, each with its name; errors like :func:`write`."""
    if not motions or len(motions) != len(names):
        raise MotionError(f"a page needs motions and a name for each, not {len(motions)} and {len(names)} names")
    _write(file, [figure_data(motion, name) for motion, name in zip(motions, names, strict=True)], title)


def _write(file: File, figures: list[dict[str, Any]], title: str | None) -> None:
    title = place_of(file).stem if title is None else title
    write_whole(file, filled(source("motet.draw", "player.html"), title, {"figures": figures}))


def figure_data(motion: Motion, name: str, captions: Captions | None = None) -> dict[str, Any]:
    """A motion in the player's format, ready for JSON; see the module's docstring."""
    figure, starts = figure_of(motion), [start for start, _ in captions or ()]
    root = figure.points[:, 0].astype("<f4")
    relative = figure.points - root[:, None]
    step = max(1e-4, float(np.abs(relative).max()) / 32767)
    if not all(math.isfinite(start) for start in starts) or starts != sorted(starts):
        raise MotionError(f"caption start times must not decrease: {starts}")
    return {
        "name": name,
        "fps": figure.fps,
        "frames": len(motion),
        "heading": figure.heading,
        "bones": [bone_data(bone) for bone in figure.bones],
        "captions": [[float(start), text] for start, text in captions or ()],
        "step": step,
        "root": b64encode(root.tobytes()).decode(),
        "points": b64encode(np.round(relative / step).astype("<i2").tobytes()).decode(),
    }


def filled(template: str, title: str, data: dict[str, Any], **parts: str) -> str:
    """The HTML of a template: ``{{TITLE}}``, ``{{DATA}}`` (as JSON), the parts of all pages, and ``parts`` by name."""
    text = json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    shared = {"STYLE": "page.css", "NUMBERS": "numbers.js", "STAGE": "stage.js"}
    found = {name: source("motet.draw", file) for name, file in shared.items()}
    found |= {"TITLE": escape(title), "DATA": text, **parts}
    return re.sub(r"\{\{([A-Z]+)\}\}", lambda place: found[place[1]], template)


def source(package: str, file: str) -> str:
    """A text file of a package."""
    return (files(package) / file).read_text(encoding="utf-8").rstrip("\n")


def bone_data(bone: Bone) -> list[int | float | str]:
    """A bone as ``stage.js`` draws it: start, end, their radii, side."""
    return [bone.start, bone.end, round(bone.start_radius, 4), round(bone.end_radius, 4), bone.side]
