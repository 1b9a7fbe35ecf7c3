"""The acts that ship, in the folder library: says.toml has what each is called, in a table for each of the other files,
which have the key poses. A sentence is looked up in the first, and only the file of its act is read. One more table of
says.toml, "texts", has sentences that mean another text, of what is recorded."""

import tomllib
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from importlib.resources import as_file, files

from motet.keyed.acts import KeyedAct
from motet.keyed.file import read

LIBRARY = files("motet.keyed") / "library"

TEXTS = "texts"
"""The table of other texts."""


@cache
def _says_by_file() -> Mapping[str, Mapping[str, list[str]]]:
    """File -> the name of each of its acts -> its sentences."""
    return tomllib.loads((LIBRARY / "says.toml").read_text(encoding="utf-8"))


@cache
def says() -> Mapping[str, tuple[str, ...]]:
    """The name of each act, and each other text -> its sentences."""
    sentences: dict[str, tuple[str, ...]] = {}
    for acts in _says_by_file().values():
        sentences |= {name: tuple(of_act) for name, of_act in acts.items()}
    return sentences


@cache
def _acts_of(file: str) -> Mapping[str, KeyedAct]:
    """The acts of a file by name."""
    with as_file(LIBRARY / f"{file}.toml") as path:
        return {name: replace(act, says=says()[name]) for name, act in read(path).items()}


def shipped(name: str) -> KeyedAct:
    """An act by its name, or another text as an act without keys; KeyError for one that does not ship."""
    if name in _says_by_file()[TEXTS]:
        return KeyedAct(name, (name,), (), over=name)
    for file, acts in _says_by_file().items():
        if name in acts:
            return _acts_of(file)[name]
    raise KeyError(name)


def ours() -> Mapping[str, KeyedAct]:
    """All acts by name."""
    acts: dict[str, KeyedAct] = {}
    for file in _says_by_file():
        if file != TEXTS:
            acts |= _acts_of(file)
    return acts
