"""Whether a bundle is whole and works here: every file, every graph, the model, and the golden vectors."""

from collections.abc import Mapping
from dataclasses import dataclass

from motet.bundle.bundle import Bundle
from motet.bundle.golden import replay
from motet.bundle.session import SessionOptions
from motet.errors import BundleError
from motet.models.load import kind_of


@dataclass(frozen=True)
class Verified:
    """The files, the active providers, and the errors of each graph and of the run against the golden vectors."""

    files: tuple[str, ...]
    providers: tuple[str, ...]
    errors: Mapping[str, float]
    tolerance: float


def verify(bundle: Bundle, options: SessionOptions | None = None) -> Verified:
    """Read all files of a bundle, load its model, and replay its golden vectors; BundleError at the first fault."""
    files, golden = bundle.check_files(), bundle.manifest.golden
    with bundle.named():
        model = kind_of(bundle.manifest).load(bundle, options)
        if golden is None:
            raise BundleError("it has no golden vectors")
        errors = replay(model, bundle.read(golden.file), golden)
    return Verified(tuple(files), model.providers, errors, golden.tolerance)
