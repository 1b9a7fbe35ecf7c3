"""Loading a model: from a bundle's name or path to what its verb offers."""

from pathlib import Path

from motet.bundle import Bundle
from motet.control import ControlModel
from motet.errors import BundleError

VERBS = {"control": ControlModel.load}
"""Verb of a bundle -> how its model is loaded."""


def load(name_or_path: str | Path, threads: int = 1) -> ControlModel:
    """The model of a bundle: a name (``motet bundle list``), or the path of a folder or zip.

    threads: for one call of a graph. BundleError if there is no such bundle, or if it is damaged.
    """
    bundle = Bundle.open(name_or_path)
    loader = VERBS.get(bundle.manifest["verb"])
    if loader is None:
        raise BundleError(
            f"bundle {bundle.path} is for {bundle.manifest['verb']!r}; this motet runs {', '.join(VERBS)}"
        )
    return loader(bundle, threads)
