"""Stores of one representation."""

from collections.abc import Iterable
from pathlib import Path

from motet_train.data.preparation import Preparation
from motet_train.data.store import Item, Store, prepare_parts


def prepare(items: Iterable[Item], path: Path, preparation: Preparation) -> Store:
    prepare_parts(items, path, {".": preparation})
    return Store.open(path)
