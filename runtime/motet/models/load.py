"""From a bundle's name or path to the model of its verb; and whether the bundle is whole and works here."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Literal, TypeVar, cast, overload

from motet.bundle.bundle import Bundle
from motet.bundle.golden import replay
from motet.bundle.graph import Arrays, Graph, SessionOptions
from motet.bundle.manifest import Manifest
from motet.errors import ArgumentError, BundleError, quoted
from motet.models.base import BundleModel

if TYPE_CHECKING:
    from motet.generate.model import CodesModel
    from motet.models.describe import DescribeModel
    from motet.papers.mixture_model import MixtureModel
    from motet.papers.tdbn_control import TdbnModel
    from motet.predict.fill import FillModel
    from motet.predict.model import PredictModel
    from motet.search.model import SearchModel
    from motet.steering.model import SteerModel

KINDS = {
    "control": {"matching": "steering.model.SteerModel", "session": "papers.tdbn_control.TdbnModel"},
    "describe": {"beam": "models.describe.DescribeModel", "consensus": "models.describe.DescribeModel"},
    "fill": {"between": "predict.fill.FillModel"},
    "generate": {"codes": "generate.model.CodesModel", "mixture": "papers.mixture_model.MixtureModel"},
    "predict": {"free_run": "predict.model.PredictModel"},
    "search": {"nearest": "search.model.SearchModel"},
}
"""Verb -> loop of decoding -> the class of the model, imported where a bundle needs it; benchmarks and comparisons
register a function for each."""

Kind = TypeVar("Kind", bound=BundleModel)


@overload
def load(name_or_path: Literal["control"], options: SessionOptions | None = None) -> "SteerModel": ...
@overload
def load(name_or_path: Literal["convseq2seq"], options: SessionOptions | None = None) -> "PredictModel": ...
@overload
def load(name_or_path: Literal["motion-to-language"], options: SessionOptions | None = None) -> "DescribeModel": ...
@overload
def load(name_or_path: Literal["tdbn"], options: SessionOptions | None = None) -> "TdbnModel": ...
@overload
def load(name_or_path: Literal["describe"], options: SessionOptions | None = None) -> "DescribeModel": ...
@overload
def load(name_or_path: Literal["fill"], options: SessionOptions | None = None) -> "FillModel": ...
@overload
def load(name_or_path: Literal["generate"], options: SessionOptions | None = None) -> "CodesModel": ...
@overload
def load(name_or_path: Literal["language-to-motion"], options: SessionOptions | None = None) -> "MixtureModel": ...
@overload
def load(name_or_path: Literal["predict"], options: SessionOptions | None = None) -> "PredictModel": ...
@overload
def load(name_or_path: Literal["search"], options: SessionOptions | None = None) -> "SearchModel": ...
@overload
def load(name_or_path: str | Path, options: SessionOptions | None = None) -> BundleModel: ...
def load(name_or_path: str | Path, options: SessionOptions | None = None) -> BundleModel:
    """The model of a bundle: a name (``motet bundle list``), or the path of a folder or zip.

    options: threads and execution providers; by default one thread of the CPU. BundleError if there is no such bundle,
    its manifest is damaged, or does not fit the model. Its graphs and tables are read when they are first used, or by
    the model's ``ready()``: each is checked first, with a BundleError if it was altered or does not fit.
    """
    bundle = Bundle.open(name_or_path)
    with bundle.named():
        return kind_of(bundle.manifest).load(bundle, options)


def load_as(kind: Callable[..., Kind], name_or_path: str | Path, options: SessionOptions | None = None) -> Kind:
    """Like :func:`load`, for one class of models, possibly abstract: BundleError where the bundle is for another.

    kind: the class; typed as a callable, since type checkers reject an abstract class for ``type``.
    """
    if not (isinstance(kind, type) and issubclass(kind, BundleModel)):
        raise ArgumentError(f"expected a class of models, such as motet.DescribeModel, not {quoted(repr(kind))}")
    wanted = kind
    model = load(name_or_path, options)
    if not isinstance(model, wanted):
        need = f"need one for {wanted.VERB!r}"
        if model.VERB == wanted.VERB:
            need = f"its loop is {model.manifest.loop!r}; need one that is a {wanted.__name__}, such as {wanted.VERB!r}"
        raise BundleError(f"bundle {name_or_path} is for {model.VERB!r}; {need}")
    return cast(Kind, model)


def build(manifest: Manifest, graphs: Mapping[str, Graph], tables: Arrays | None = None) -> BundleModel:
    """The model of a manifest's verb over graphs of any kind; BundleError where they do not fit."""
    return kind_of(manifest)(manifest, graphs, tables)


def kind_of(manifest: Manifest) -> type[BundleModel]:
    """The class of a manifest's verb and loop; BundleError for an unknown verb, or a loop of another verb."""
    if manifest.verb not in KINDS:
        raise BundleError(f"manifest, verb: {manifest.verb!r} is unknown; expected one of {', '.join(KINDS)}")
    by_loop = KINDS[manifest.verb]
    if manifest.loop not in by_loop:
        loops = ", ".join(by_loop)
        raise BundleError(f"manifest, loop: {manifest.loop!r} does not {manifest.verb}; expected one of {loops}")
    module, _, name = by_loop[manifest.loop].rpartition(".")
    kind: type[BundleModel] = getattr(import_module(f"motet.{module}"), name)
    return kind


@dataclass(frozen=True)
class Verified:
    """The files, the active providers, and the errors of each graph and of the run against the golden vectors."""

    files: tuple[str, ...]
    providers: tuple[str, ...]
    errors: Mapping[str, float]
    tolerance: float


def verify(bundle: Bundle, options: SessionOptions | None = None) -> Verified:
    """Read all files of a bundle, load its model, and replay its golden vectors; BundleError at the first fault."""
    files = bundle.check_files()
    golden = bundle.manifest.golden
    with bundle.named():
        model = kind_of(bundle.manifest).load(bundle, options).ready()
        if golden is None:
            raise BundleError("it has no golden vectors")
        errors = replay(model, bundle.read(golden.file), golden)
    return Verified(tuple(files), model.providers, errors, golden.tolerance)
