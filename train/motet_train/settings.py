"""The settings of a run as a TOML file: options of the command by name, and tables for parts of the recipe::

seed = 1
[training]        # how it is trained: the fields of Training
learning_rate = 1e-3
[model]           # sizes: the fields of the model's configuration
dropout = 0.3
[visits]          # how the data is visited
mirror = false
"""

import json
import tomllib
import types
from collections.abc import Collection, Mapping
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

from motet.bundle.fields import Json
from motet.errors import MotetError
from motet_train.recipes.recipe import Recipe

PART_OF_TABLE = {"training": "training", "model": "config", "visits": "visits"}
"""Table of a file -> the part of the recipe that it changes."""


class SettingsError(MotetError, ValueError):
    """A setting that is unknown or of a wrong type."""


def read_settings(path: Path) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
    """The options and the tables in a file, with underscores for hyphens in names; SettingsError if it is not TOML."""
    options = {}
    tables = {}
    for key, value in _read(path).items():
        if isinstance(value, dict):
            tables[key] = value
        else:
            options[key] = value
    _refuse_unknown(path, tables, PART_OF_TABLE)
    return options, tables


def read_stages(path: Path, stages: Collection[str]) -> dict[str, dict[str, dict[str, Any]]]:
    """The tables in a file for each of several trainings, such as ``[describe.training]``; as :func:`read_settings`."""
    data = _read(path)
    _refuse_unknown(path, data, stages)
    for stage, tables in data.items():
        _refuse_unknown(path, tables if isinstance(tables, dict) else {"": tables}, PART_OF_TABLE, f"{stage}.")
    return data


def _read(path: Path) -> dict[str, Any]:
    try:
        return _with_underscores(tomllib.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, RecursionError) as error:
        raise SettingsError(f"the settings {path} cannot be read: {error}") from error


def _refuse_unknown(path: Path, tables: Json, expected: Collection[str], inside: str = "") -> None:
    if unknown := sorted(tables.keys() - set(expected)):
        raise SettingsError(f"{path}: unknown table [{inside}{unknown[0]}]: expected one of {', '.join(expected)}")


def changed(recipe: Recipe, tables: Mapping[str, Json], options: Json) -> Recipe:
    """The recipe changed by tables, and over that by options, each of which sets the field of its name.

    Options that are None change nothing. SettingsError names a setting that is unknown or of a wrong type.
    """
    for table, part in PART_OF_TABLE.items():
        current = getattr(recipe, part)
        names: set[str] = set()
        if current is not None:
            names = {field.name for field in fields(current)} - set(recipe.derived)
        # tables first, options over them
        changes = dict(tables.get(table, {}))
        for name, value in options.items():
            if name in names and value is not None:
                changes[name] = value
        if unknown := sorted(changes.keys() - names):
            expected = ", ".join(sorted(names)) or "none"
            raise SettingsError(f"unknown setting {table}.{unknown[0]} of {recipe.model}: expected one of {expected}")
        if changes:
            recipe = replace(recipe, **{part: _replaced(current, changes, table)})
    return recipe


def to_toml(options: Json, recipe: Recipe) -> str:
    """The text of a file that :func:`read_settings` reads, with all settings of the recipe."""
    lines = [f"{name} = {_plain(value)}" for name, value in options.items() if value is not None]
    for table, part in PART_OF_TABLE.items():
        if (current := getattr(recipe, part)) is not None:
            lines += _table(table, current, recipe.derived)
    return "\n".join(lines) + "\n"


def _table(name: str, current: Any, left_out: tuple[str, ...] = ()) -> list[str]:
    """The lines of a table of a dataclass' fields, with a table of its own for each field that is a dataclass."""
    lines = ["", f"[{name}]"]
    nested_lines = []
    for field in fields(current):
        value = getattr(current, field.name)
        if field.name in left_out or value is None:
            continue
        if is_dataclass(value):
            nested_lines += _table(f"{name}.{field.name}", value)
        else:
            lines.append(f"{field.name} = {_plain(value)}")
    return lines + nested_lines


def _plain(value: Any) -> str:
    # strings, numbers, booleans and lists are the same in JSON and in TOML
    return json.dumps(str(value) if isinstance(value, Path) else value, ensure_ascii=False).replace("\x7f", "\\u007f")


def _with_underscores(data: dict[str, Any]) -> dict[str, Any]:
    renamed = {}
    for key, value in data.items():
        renamed[key.replace("-", "_")] = _with_underscores(value) if isinstance(value, dict) else value
    return renamed


def _replaced(current: Any, changes: Json, where: str) -> Any:
    """A dataclass with some fields replaced, also inside of fields that are dataclasses."""
    hints = get_type_hints(type(current))
    values = {}
    for name, value in changes.items():
        if name not in hints:
            raise SettingsError(f"unknown setting {where}.{name}: expected one of {', '.join(hints)}")
        hint = hints[name]
        # dataclasses inside, or a value that has to fit
        if is_dataclass(hint) and isinstance(value, dict):
            values[name] = _replaced(getattr(current, name), value, f"{where}.{name}")
            continue
        values[name] = tuple(value) if isinstance(value, list) else value
        if not _fits(values[name], hint):
            expected = hint.__name__ if isinstance(hint, type) else hint
            raise SettingsError(f"{where}.{name} = {_plain(value)} does not fit: expected {expected}")
    return replace(current, **values)


def _fits(value: Any, hint: Any) -> bool:
    """Whether a value has an annotated type; a whole number is also a float, and a boolean is not a number."""
    origin = get_origin(hint)
    arguments = get_args(hint)
    if origin is Literal:
        return value in arguments
    if origin in (Union, types.UnionType):
        return any(_fits(value, argument) for argument in arguments)
    if origin is tuple:
        return isinstance(value, tuple) and _tuple_fits(value, arguments)
    if isinstance(value, bool) or hint is bool:
        return isinstance(value, bool) and hint is bool
    return isinstance(value, (int, float) if hint is float else hint)


def _tuple_fits(values: tuple[Any, ...], hints: tuple[Any, ...]) -> bool:
    if hints[-1] is ...:
        hints = (hints[0],) * len(values)
    return len(hints) == len(values) and all(map(_fits, values, hints))
