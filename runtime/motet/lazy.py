"""Names of a package that are imported when they are first used, so that ``import motet`` does not wait for all."""

import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from importlib.util import find_spec
from typing import Any


def lazily(package: str, places: Mapping[str, str]) -> Callable[[str], Any]:
    """A package's ``__getattr__`` (PEP 562): gives its public names, and the modules in it.

    places: module -> the names that it has; "read=read_motion" is the name ``read`` for its ``read_motion``. The
    function raises AttributeError for any other name.
    """
    origins: dict[str, tuple[str, str]] = {}
    for module, names in places.items():
        for entry in names.split():
            name, _, attribute = entry.partition("=")
            origins[name] = (module, attribute or name)

    def imported(name: str) -> Any:
        if name in origins:
            module, attribute = origins[name]
            value = getattr(import_module(module), attribute)
        elif not name.startswith("_") and find_spec(f"{package}.{name}"):
            value = import_module(f"{package}.{name}")
        else:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        # found at once from the second time on
        setattr(sys.modules[package], name, value)
        return value

    return imported
