"""The reference of the Python interface has all that is public, and what a public method gives has a public name."""

import inspect
import re
import runpy
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args, get_type_hints

import pytest

import motet
from motet.figures import humanoid

ROOT = Path(__file__).parents[1]
INNER = ("motet.bundle.", "motet.decode.", "motet.generate.codec")
"""What graphs and loops give is one level under the verbs."""

ROOMS = (motet, motet.motion, humanoid)
CLASSES = [kind for name in motet.__all__ if inspect.isclass(kind := getattr(motet, name))]


def test_the_page_has_a_text_for_every_public_name() -> None:
    page = runpy.run_path(str(ROOT / "docs/reference/api.py"))["page"]()
    entries = dict(re.findall(r"^### (\w+)\n(.*?)(?=^##|\Z)", page, flags=re.DOTALL | re.MULTILINE))
    assert entries.keys() == {*motet.__all__, *motet.motion.__all__}
    texts = {
        name: re.sub(r"^```py\n.*?^```$", "", entry, flags=re.DOTALL | re.MULTILINE) for name, entry in entries.items()
    }
    assert [name for name, text in texts.items() if not text.strip()] == []
    assert "* `fps`" in texts["read"]
    assert "SteerModel.start(" in entries["SteerModel"]


def classes(hint: Any) -> Iterator[type]:
    """The classes that a type is made of."""
    if inspect.isclass(hint):
        yield hint
    for part in get_args(hint):
        yield from classes(part)


@pytest.mark.parametrize("kind", CLASSES)
def test_what_is_given_has_a_public_name(kind: type) -> None:
    lacking = []
    for name, found in inspect.getmembers(kind):
        call = getattr(found, "fget", getattr(found, "func", found))  # of a property, of a cached one
        if name.startswith("_") or not inspect.isfunction(call) or not call.__module__.startswith("motet."):
            continue
        for given in classes(get_type_hints(call).get("return")):
            inner = not given.__module__.startswith("motet.") or given.__module__.startswith(INNER)
            if not inner and not any(getattr(room, given.__name__, None) is given for room in ROOMS):
                lacking.append(f"{name} gives {given.__name__}")
    assert lacking == []
