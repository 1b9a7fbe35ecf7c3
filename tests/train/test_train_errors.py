"""Errors of training and export cross processes."""

import importlib
import pickle
import pkgutil

import motet_export
import motet_train
from motet.errors import MotetError


def error_classes() -> list[type[MotetError]]:
    """Of all modules of both packages."""
    for package in (motet_train, motet_export):
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            importlib.import_module(module.name)
    found, seen = [], [MotetError]
    while seen:
        seen += (below := seen.pop().__subclasses__())
        found += below
    return [kind for kind in found if kind.__module__.startswith(("motet_train", "motet_export"))]


def test_every_error_survives_pickling() -> None:
    kinds = error_classes()
    names = {kind.__name__ for kind in kinds}
    assert {"DataError", "DivergedError", "ExportError", "RunError", "SettingsError"} <= names
    for kind in kinds:
        again = pickle.loads(pickle.dumps(kind("what was wrong")))
        assert (type(again), str(again)) == (kind, "what was wrong")
