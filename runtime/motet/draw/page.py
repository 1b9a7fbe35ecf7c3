"""Self-contained pages: a template with the parts that all pages share, and the data for its script."""

import json
import re
from html import escape
from importlib.resources import files
from typing import Any

from motet.draw.body import Bone

SHARED_PARTS = {"STYLE": "page.css", "NUMBERS": "numbers.js", "STAGE": "stage.js"}
"""What templates include by name."""


def filled(template: str, title: str, data: dict[str, Any], **parts: str) -> str:
    """The HTML of a template: ``{{TITLE}}`` and ``{{DATA}}`` (as JSON), :data:`SHARED_PARTS`, and ``parts`` by name."""
    text = json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    shared = {name: source("motet.draw", file) for name, file in SHARED_PARTS.items()}
    found = {"TITLE": escape(title), "DATA": text, **shared, **parts}
    return re.sub(r"\{\{([A-Z]+)\}\}", lambda place: found[place[1]], template)


def source(package: str, file: str) -> str:
    """A text file of a package."""
    return (files(package) / file).read_text(encoding="utf-8").rstrip("\n")


def bone_data(bone: Bone) -> list[int | float | str]:
    """A bone as ``stage.js`` draws it: start, end, their radii, side."""
    return [bone.start, bone.end, round(bone.start_radius, 4), round(bone.end_radius, 4), bone.side]
