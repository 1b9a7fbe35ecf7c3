"""Writes src/generated.ts: the numbers and lists of words that both languages use, from the modules that hold them.

    python runtime/web/generate.py

A module becomes an object with those of its constants that src uses, such as MEMORY.ALIKE; a class of settings becomes
an object with the default of each field, and its range where it has one.
"""

import inspect
import json
import re
from collections.abc import Iterable, Iterator
from dataclasses import MISSING, asdict, fields, is_dataclass
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from motet.settings import Settings

TARGET = Path(__file__).parent / "src/generated.ts"

MODULES = (
    "motet.bundle.bundle",
    "motet.bundle.fields",
    "motet.bundle.graph_safety",
    "motet.bundle.manifest",
    "motet.bundle.members",
    "motet.decode.beam",
    "motet.figures.feet.contacts",
    "motet.figures.feet.hold",
    "motet.figures.feet.treadmill",
    "motet.figures.humanoid.alignment",
    "motet.figures.humanoid.measure",
    "motet.figures.humanoid.retarget",
    "motet.figures.two_bones",
    "motet.formats.gltf",
    "motet.formats.gltf_data",
    "motet.formats.text",
    "motet.generate.base",
    "motet.generate.codec",
    "motet.generate.codes",
    "motet.generate.continue_codes",
    "motet.generate.memory",
    "motet.generate.model",
    "motet.generate.reading",
    "motet.models.control",
    "motet.models.describe",
    "motet.models.language",
    "motet.models.nearest_neighbour",
    "motet.motion.rotations",
    "motet.motion.skeleton",
    "motet.predict.between",
    "motet.predict.free_run",
    "motet.predict.model",
    "motet.representation.placed",
    "motet.representation.retargeting",
    "motet.representation.root_sixd",
    "motet.search.model",
    "motet.search.nearest",
    "motet.steering.action_layer",
    "motet.steering.acts",
    "motet.steering.paths",
    "motet.steering.avoidance",
    "motet.steering.events",
    "motet.steering.foot_lock",
    "motet.steering.idle",
    "motet.steering.look_layer",
    "motet.steering.matching",
    "motet.steering.model",
    "motet.steering.reach_layer",
    "motet.steering.repertoire",
    "motet.steering.saying",
    "motet.steering.settings",
    "motet.steering.spoken",
    "motet.steering.stepping",
    "motet.steering.style_layer",
    "motet.steering.styles",
    "motet.steering.targets",
    "motet.steering.terrain",
    "motet.steering.turn_limit",
    "motet.steering.warping",
    "motet.text.clauses",
    "motet.text.vocabulary",
)


def typescript() -> str:
    """The text of src/generated.ts: of each module what the other files of src name."""
    sources = [path.read_text("utf-8") for path in sorted(TARGET.parent.rglob("*.ts")) if path != TARGET]
    used = {name for source in sources for name in re.findall(r"\b[A-Z_]+\.[A-Z_]+\b|\b[a-z]\w+Settings\b", source)}
    parts = ["/* Written by runtime/web/generate.py: do not edit. Units stand in the modules of Python. */\n"]
    parts.append('import { ranges } from "./settings.js";\n')
    for module in map(import_module, MODULES):
        name = named(module)
        constants = list(constants_of(module, {use[1] for use in map(parted, used) if use[0] == name}))
        if constants:
            parts += [f"\n// {module.__name__}\nexport const {name} = {{\n", *constants, "} as const;\n"]
        for title, kind in inspect.getmembers(module, inspect.isclass):
            label = title[0].lower() + title[1:]
            if label in used and kind.__module__ == module.__name__:
                opening, closing = ("ranges({", "});") if issubclass(kind, Settings) else ("{", "} as const;")
                parts += [f"\n// {module.__name__}.{title}\nexport const {label} = {opening}\n", *fields_of(kind)]
                parts.append(f"{closing}\n")
    return "".join(parts)


def named(module: ModuleType) -> str:
    """The object of a module: MEMORY of motet.generate.memory, GENERATE of motet.generate.model."""
    *_, room, name = module.__name__.split(".")
    return (room if name == "model" else name).upper()


def parted(name: str) -> tuple[str, str]:
    """The object and the constant of a name such as MEMORY.ALIKE."""
    first, _, last = name.partition(".")
    return first, last


def constants_of(module: ModuleType, used: Iterable[str]) -> Iterator[str]:
    """A line for each constant of a module, or of its classes, that is used."""
    kinds = [kind for _, kind in inspect.getmembers(module, inspect.isclass) if kind.__module__ == module.__name__]
    for name in sorted(used):
        owners = [owner for owner in (module, *kinds) if hasattr(owner, name)]
        if not owners:
            raise AttributeError(f"{module.__name__} has no {name}, which src uses")
        yield f"  {name}: {literal(getattr(owners[0], name))},\n"


def fields_of(kind: type[Any]) -> Iterator[str]:
    """A line for each field of a dataclass: its default; of settings its default, null for none, and its range, too."""
    defaults = {field.name: None if field.default is MISSING else field.default for field in fields(kind)}
    for name, value in defaults.items():
        if issubclass(kind, Settings):
            whole, (low, high, _) = kind.RANGES[name]
            yield f"  {name}: {literal({'default': value, 'low': low, 'high': high, 'whole': whole})},\n"
        else:
            yield f"  {name}: {literal(value)},\n"


def literal(value: Any) -> str:
    """A value in TypeScript; TypeError for one that is not made of numbers and texts."""
    if is_dataclass(value) and not isinstance(value, type):
        value = asdict(value)
    elif hasattr(value, "_asdict"):
        value = value._asdict()
    elif isinstance(value, frozenset):
        value = sorted(value)
    if isinstance(value, tuple | list):
        return f"[{', '.join(map(literal, value))}]"
    if isinstance(value, dict):
        items = [f"{keyed(key)}: {literal(item)}" for key, item in value.items()]
        return f"{{ {', '.join(items)} }}"
    if isinstance(value, int | float | np.number) and not isinstance(value, bool):
        return str(int(value)) if value == int(value) else repr(float(value))
    return json.dumps(value, ensure_ascii=False)


def keyed(key: str | int) -> str:
    """A key of an object in TypeScript."""
    return str(key) if str(key).isalnum() else json.dumps(key)


if __name__ == "__main__":
    TARGET.write_text(typescript(), "utf-8")
