"""Loading a model: from a bundle's name or path to what its verb offers."""

from pathlib import Path
from typing import Literal, TypeVar, overload

from motet.bundle.bundle import Bundle
from motet.errors import BundleError
from motet.models.base import Bundled
from motet.models.control import ControlModel
from motet.models.describe import DescribeModel
from motet.models.generate import GenerateModel
from motet.models.predict import PredictModel

Model = ControlModel | DescribeModel | GenerateModel | PredictModel
Kind = TypeVar("Kind", bound=Bundled)

VERBS: dict[str, type[Model]] = {
    "control": ControlModel,
    "describe": DescribeModel,
    "generate": GenerateModel,
    "predict": PredictModel,
}
"""Verb of a bundle -> the class of its model."""


@overload
def load(name_or_path: Literal["cmu-control"], threads: int = 1) -> ControlModel: ...
@overload
def load(name_or_path: Literal["cmu-describe"], threads: int = 1) -> DescribeModel: ...
@overload
def load(name_or_path: Literal["cmu-generate"], threads: int = 1) -> GenerateModel: ...
@overload
def load(name_or_path: Literal["cmu-predict"], threads: int = 1) -> PredictModel: ...
@overload
def load(name_or_path: str | Path, threads: int = 1) -> Model: ...
def load(name_or_path: str | Path, threads: int = 1) -> Model:
    """The model of a bundle: a name (``motet bundle list``), or the path of a folder or zip.

    threads: for one call of a graph. BundleError if there is no such bundle, or if it is damaged.
    """
    bundle = Bundle.open(name_or_path)
    verb = bundle.manifest["verb"]
    if verb not in VERBS:
        raise BundleError(f"bundle {bundle.path} is for {verb!r}; this motet runs {', '.join(VERBS)}")
    return VERBS[verb].load(bundle, threads)


def load_as(kind: type[Kind], name_or_path: str | Path, threads: int = 1) -> Kind:
    """As :func:`load`, for one verb: BundleError where the bundle is for another."""
    model = load(name_or_path, threads)
    if not isinstance(model, kind):
        wanted = next(verb for verb, known in VERBS.items() if known is kind)
        raise BundleError(f"bundle {name_or_path} is for {model.manifest['verb']!r}, and one for {wanted!r} is needed")
    return model
