"""A training run on disk: ``run.json``, the later manifest of the bundle, and ``weights.pt``."""

import io
import json
import pickle
import platform
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import torch
from numpy.typing import NDArray
from torch import nn

from motet.bundle.fields import Json
from motet.bundle.graph import Arrays, Graph, GraphSpec
from motet.bundle.manifest import Manifest
from motet.errors import MotetError
from motet.files import write_whole
from motet.models.base import BundleModel
from motet.models.load import build
from motet_train import distributed
from motet_train.models.action_net import ActionNet
from motet_train.models.codec import MotionCodec
from motet_train.models.figure_predictor import FigurePredictor
from motet_train.models.filler import Filler
from motet_train.models.joint_embedding import JointEmbedding
from motet_train.models.known_motions import KnownMotions
from motet_train.models.matching import Matching
from motet_train.models.motion_codes import MotionCodes
from motet_train.models.motion_to_language import MotionToLanguage
from motet_train.models.net import Net
from motet_train.models.predictor import Predictor
from motet_train.papers import li2018
from motet_train.papers.plappert2017.language_to_motion import LanguageToMotion
from motet_train.papers.tdbn.tdbn import TDBN, AngleCRBM

RUN_MANIFEST = "run.json"
WEIGHTS = "weights.pt"

MODELS: Mapping[str, Callable[[Json], Net]] = {
    "tdbn": TDBN.from_config,
    "motion-to-language": MotionToLanguage.from_config,
    "language-to-motion": LanguageToMotion.from_config,
    "joint-embedding": JointEmbedding.from_config,
    "motion-actions": ActionNet.from_config,
    "motion-codec": MotionCodec.from_config,
    "motion-codes": MotionCodes.from_config,
    "angle-crbm": AngleCRBM.from_config,
    "motion-matching": Matching.from_config,
    "known-motions": KnownMotions.from_config,
    "gap-filler": Filler.from_config,
    "trajectory": Predictor.from_config,
    "figure-trajectory": FigurePredictor.from_config,
    **{name: partial(li2018.from_config, name) for name in li2018.SYSTEMS},
}
"""Name of a model -> its constructor from the configuration in the manifest."""

CHECKPOINT_ERRORS = (
    OSError,
    EOFError,
    RuntimeError,
    ValueError,
    LookupError,
    TypeError,
    AttributeError,
    AssertionError,
)
"""Errors, besides UnpicklingError, that torch raises for a damaged file."""


class RunError(MotetError, ValueError):
    """A training run that cannot be read or resumed."""


@dataclass(frozen=True)
class About:
    """The entries of a manifest that the user states; a licence that is not stated is None."""

    name: str
    command: str
    seed: int = 0
    licence: str | None = None
    data_licence: str | None = None


class TorchGraph:
    """A torch module with the interface of an ONNX graph, so that one decoding loop serves both.

    Its forward takes the inputs by name and returns the outputs in order.
    """

    def __init__(self, module: nn.Module, spec: GraphSpec) -> None:
        self.module = module.eval()
        self.spec = spec

    @torch.inference_mode()
    def __call__(self, feeds: Arrays) -> dict[str, NDArray[Any]]:
        """Run eagerly on the CPU."""
        inputs = {tensor.name: torch.tensor(feeds[tensor.name]) for tensor in self.spec.inputs}
        outputs = self.module(**inputs)
        outputs = outputs if isinstance(outputs, tuple) else (outputs,)
        return {tensor.name: output.numpy() for tensor, output in zip(self.spec.outputs, outputs, strict=True)}


@dataclass(frozen=True, eq=False)
class Run:
    """A trained model and its manifest: see :meth:`motet_train.recipes.recipe.Job.manifest`."""

    manifest: Json
    model: Net

    def torch_graphs(self) -> dict[str, Graph]:
        """The model's graphs by role, run by torch."""
        return {role: TorchGraph(module, spec) for role, (module, spec) in self.model.graphs().items()}

    def bundle_model(self) -> BundleModel:
        """The model as in its bundle, run by torch."""
        return build(Manifest.from_json(self.manifest), self.torch_graphs(), self.model.tables())

    def save(self, folder: Path) -> None:
        """Write the run into an existing folder."""
        write_whole(folder / WEIGHTS, to_bytes(self.model.state_dict()))
        write_whole(folder / RUN_MANIFEST, json.dumps(self.manifest, indent=1) + "\n")

    @staticmethod
    def load(folder: Path) -> "Run":
        """Read a run that :meth:`save` wrote, onto the CPU; RunError if that fails."""
        for name in (RUN_MANIFEST, WEIGHTS):
            if not (folder / name).is_file():
                raise RunError(f"{folder} is not a training run: it has no {name}")
        try:
            manifest = json.loads((folder / RUN_MANIFEST).read_text())
            model = MODELS[manifest["model"]](manifest["config"])
            model.load_state_dict(read_state(folder / WEIGHTS))
        except (KeyError, TypeError, ValueError, RuntimeError, OSError) as error:
            raise RunError(f"the training run {folder} cannot be read: {error}") from error
        return Run(manifest, model)


def torch_model(like: BundleModel, threads: int, compiled: bool = False) -> BundleModel:
    """A model of a bundle's sizes and tables in torch, with untrained weights: the baseline of ``motet bench``.

    compiled: use ``torch.compile``, which fails at the first call if there is no C++ compiler.
    """
    torch.set_num_threads(threads)
    manifest = like.manifest
    net = MODELS[manifest.model](manifest.config)
    model = build(manifest, Run(manifest.source, net).torch_graphs(), like.tables)
    if compiled:
        for graph in model.graphs.values():
            if isinstance(graph, TorchGraph):
                graph.module.compile(dynamic=True)
    return model


def to_bytes(state: Any) -> bytes:
    """States of modules and optimisers, and plain values, as bytes."""
    buffer = io.BytesIO()
    torch.save(state, buffer)
    return buffer.getvalue()


def read_state(path: Path) -> Any:
    """Read what :func:`to_bytes` wrote, from any device onto the CPU; RunError if that fails.

    Nothing in it is executed: a file with other objects than tensors and plain values is refused.
    """
    try:
        return torch.load(path, map_location="cpu", weights_only=True)
    except pickle.UnpicklingError as error:  # its text, from torch, explains in eight lines how to execute it anyway
        reason = "it is damaged, or holds objects other than tensors and plain values, which could execute anything"
        raise RunError(f"{path} cannot be read: {reason}") from error
    except CHECKPOINT_ERRORS as error:
        raise RunError(f"{path} cannot be read: {str(error).partition(chr(10))[0] or 'it is cut off'}") from error


def surroundings(device: str) -> Json:
    """The machine and software of a training, for its manifest."""
    kind = device.partition(":")[0].upper()
    about: dict[str, Any] = {"threads": torch.get_num_threads()}
    if distributed.count() > 1:
        about["processes"] = distributed.count()
    about["machine"] = f"{platform.system()} {platform.machine()}, {kind}"
    about["torch"] = torch.__version__
    return about


def refuse_other(path: Path, manifest: Json) -> None:
    """RunError if the run.json at ``path`` is of a run that was started with other data or settings."""
    if not path.exists():
        return
    try:
        before = _essence(json.loads(path.read_text()))
    except (AttributeError, TypeError, ValueError, RecursionError) as error:
        raise RunError(f"{path} is not a run that can be resumed: {error}") from error
    different = [key for key, value in _essence(manifest).items() if before.get(key) != value]
    if different:
        raise RunError(f"{path.parent} was started with other settings, so cannot be resumed: {', '.join(different)}")


def _essence(manifest: Json) -> Json:
    """The entries that must be equal for a run to continue; the length of training may differ."""
    training = manifest.get("training", {})
    essence = {key: manifest.get(key) for key in ("model", "config", "motion", "vocabulary", "control")}
    essence |= {key: training.get(key) for key in ("seed", "data", "split")}
    for key, value in training.get("recipe", {}).items():
        if key not in ("epochs", "steps"):
            essence[key] = value
    return essence
