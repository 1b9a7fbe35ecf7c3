"""The settings of a run as a TOML file: a command's options by their names, and tables for what the recipe says.

Such as::

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

from motet.errors import MotetError
from motet_train.recipes.recipe import Recipe

TABLES = {"training": "training", "model": "config", "visits": "visits"}
"""Table of a file -> what of the recipe it changes."""


class SettingsError(MotetError, ValueError):
    """A setting that is unknown, or not of the kind that it has to be."""


def read_settings(path: Path) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
    """The options and the tables in a file, with underscores for hyphens in names; SettingsError if it is not TOML."""
    data = _read(path)
    tables = {key: value for key, value in data.items() if isinstance(value, dict)}
    _known(path, tables, TABLES)
    return {key: value for key, value in data.items() if key not in tables}, tables


def read_stages(path: Path, stages: Collection[str]) -> dict[str, dict[str, dict[str, Any]]]:
    """The tables in a file for each of several trainings, such as ``[describe.training]``; as :func:`read_settings`."""
    data = _read(path)
    _known(path, data, stages)
    for stage, tables in data.items():
        _known(path, tables if isinstance(tables, dict) else {"": tables}, TABLES, f"{stage}.")
    return data


def _read(path: Path) -> dict[str, Any]:
    try:
        return _named(tomllib.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, RecursionError) as error:
        raise SettingsError(f"the settings {path} cannot be read: {error}") from error


def _known(path: Path, given: Mapping[str, Any], expected: Collection[str], inside: str = "") -> None:
    if unknown := sorted(given.keys() - set(expected)):
        raise SettingsError(f"{path}: unknown table [{inside}{unknown[0]}]: expected one of {', '.join(expected)}")


def changed(recipe: Recipe, tables: Mapping[str, Mapping[str, Any]], options: Mapping[str, Any]) -> Recipe:
    """The recipe with what tables say, and over that options, each the field of that name; None changes nothing.

    SettingsError names what is unknown or of a wrong kind.
    """
    for table, part in TABLES.items():
        given = {**tables.get(table, {})}
        current = getattr(recipe, part)
        known = {field.name for field in fields(current)} - set(recipe.derived) if current is not None else set()
        given |= {name: value for name, value in options.items() if name in known and value is not None}
        if unknown := sorted(given.keys() - known):
            said = ", ".join(sorted(known)) or "none"
            raise SettingsError(f"unknown setting {table}.{unknown[0]} of {recipe.model}: expected one of {said}")
        recipe = replace(recipe, **{part: _replaced(current, given, table)}) if given else recipe
    return recipe


def to_toml(options: Mapping[str, Any], recipe: Recipe) -> str:
    """A file that :func:`read_settings` reads, with all settings of the recipe."""
    lines = [f"{name} = {_plain(value)}" for name, value in options.items() if value is not None]
    for table, part in TABLES.items():
        if (current := getattr(recipe, part)) is not None:
            lines += _table(table, current, recipe.derived)
    return "\n".join(lines) + "\n"


def _table(name: str, current: Any, left_out: tuple[str, ...] = ()) -> list[str]:
    values = {field.name: getattr(current, field.name) for field in fields(current) if field.name not in left_out}
    nested = {key: value for key, value in values.items() if is_dataclass(value)}
    lines = [f"{key} = {_plain(value)}" for key, value in values.items() if key not in nested and value is not None]
    return ["", f"[{name}]", *lines, *(line for key in nested for line in _table(f"{name}.{key}", nested[key]))]


def _plain(value: Any) -> str:
    # of strings, numbers, truth and lists, JSON is TOML
    return json.dumps(str(value) if isinstance(value, Path) else value, ensure_ascii=False).replace("\x7f", "\\u007f")


def _named(data: dict[str, Any]) -> dict[str, Any]:
    return {key.replace("-", "_"): _named(value) if isinstance(value, dict) else value for key, value in data.items()}


def _replaced(current: Any, given: Mapping[str, Any], where: str) -> Any:
    hints, values = get_type_hints(type(current)), {}
    for name, value in given.items():
        if name not in hints:
            raise SettingsError(f"unknown setting {where}.{name}: expected one of {', '.join(hints)}")
        if is_dataclass(hints[name]) and isinstance(value, dict):
            values[name] = _replaced(getattr(current, name), value, f"{where}.{name}")
            continue
        values[name] = tuple(value) if isinstance(value, list) else value
        if not _fits(values[name], hints[name]):
            said = getattr(hints[name], "__name__", None) if isinstance(hints[name], type) else None
            raise SettingsError(f"{where}.{name} = {_plain(value)} does not fit: expected {said or hints[name]}")
    return replace(current, **values)


def _fits(value: Any, hint: Any) -> bool:
    """Whether a value is of an annotated kind; a whole number is a float too, and truth is no number."""
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is Literal:
        return value in arguments
    if origin in (Union, types.UnionType):
        return any(_fits(value, one) for one in arguments)
    if origin is tuple:
        if not isinstance(value, tuple):
            return False
        kinds = [arguments[0]] * len(value) if arguments[-1] is ... else arguments
        return len(kinds) == len(value) and all(map(_fits, value, kinds))
    if isinstance(value, bool) or hint is bool:
        return isinstance(value, bool) and hint is bool
    return isinstance(value, (int, float) if hint is float else hint)
