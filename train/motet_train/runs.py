"""A training run on disk: ``run.json``, which will be the bundle's manifest, and ``weights.pt``."""

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

from motet.bundle.graph import Arrays, Graph, GraphSpec
from motet.bundle.manifest import Manifest
from motet.errors import MotetError
from motet.files import write_whole
from motet.models.base import BundleModel
from motet.models.load import build
from motet_train import distributed
from motet_train.models.action_net import ActionNet
from motet_train.models.codec import MotionCodec
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

MANIFEST, WEIGHTS = "run.json", "weights.pt"

MODELS: Mapping[str, Callable[[Mapping[str, Any]], Net]] = {
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
    **{name: partial(li2018.from_config, name) for name in li2018.SYSTEMS},
}
"""Name of a model -> how it is built from the configuration in its manifest."""

DAMAGE = (OSError, EOFError, RuntimeError, ValueError, LookupError, TypeError, AttributeError, AssertionError)
"""What torch raises besides for a file that is damaged."""


class RunError(MotetError, ValueError):
    """A training run that cannot be read, or not be resumed."""


@dataclass(frozen=True)
class About:
    """What a manifest says that no computation finds out; a licence that nobody stated is None."""

    name: str
    command: str
    seed: int = 0
    licence: str | None = None
    data_licence: str | None = None


class TorchGraph:
    """A torch module behind the same face as an ONNX graph, so that one decoding loop serves both.

    Its forward takes the inputs by name and gives the outputs in order.
    """

    def __init__(self, module: nn.Module, spec: GraphSpec) -> None:
        self.module, self.spec = module.eval(), spec

    @torch.inference_mode()
    def __call__(self, feeds: Arrays) -> dict[str, NDArray[Any]]:
        """Run eagerly on the CPU."""
        outputs = self.module(**{tensor.name: torch.tensor(feeds[tensor.name]) for tensor in self.spec.inputs})
        outputs = outputs if isinstance(outputs, tuple) else (outputs,)
        return {tensor.name: output.numpy() for tensor, output in zip(self.spec.outputs, outputs, strict=True)}


@dataclass(frozen=True, eq=False)
class Run:
    """A trained model and its manifest: see :meth:`motet_train.recipes.recipe.Job.manifest`."""

    manifest: Mapping[str, Any]
    model: Net

    def torch_graphs(self) -> dict[str, Graph]:
        """The graphs, run by torch."""
        return {role: TorchGraph(module, spec) for role, (module, spec) in self.model.graphs().items()}

    def bundle_model(self) -> BundleModel:
        """The model as it will be in its bundle, run by torch."""
        return build(Manifest.from_json(self.manifest), self.torch_graphs(), self.model.tables())

    def save(self, folder: Path) -> None:
        """Write the run into an existing folder."""
        write_whole(folder / WEIGHTS, to_bytes(self.model.state_dict()))
        write_whole(folder / MANIFEST, json.dumps(self.manifest, indent=1) + "\n")

    @staticmethod
    def load(folder: Path) -> "Run":
        """Read what :meth:`save` wrote, onto the CPU; RunError where that is not possible."""
        for name in (MANIFEST, WEIGHTS):
            if not (folder / name).is_file():
                raise RunError(f"{folder} is not a training run: it has no {name}")
        try:
            manifest = json.loads((folder / MANIFEST).read_text())
            model = MODELS[manifest["model"]](manifest["config"])
            model.load_state_dict(read_state(folder / WEIGHTS))
        except (KeyError, TypeError, ValueError, RuntimeError, OSError) as error:
            raise RunError(f"the training run {folder} cannot be read: {error}") from error
        return Run(manifest, model)


def torch_model(like: BundleModel, threads: int, compiled: bool = False) -> BundleModel:
    """A bundle's model with the same sizes and tables in torch, its weights untrained, eager or by ``torch.compile``,
    which fails at the first call where there is no C++ compiler: the baselines of ``motet bench``."""
    torch.set_num_threads(threads)
    manifest = like.manifest
    model = build(manifest, Run(manifest.source, MODELS[manifest.model](manifest.config)).torch_graphs(), like.tables)
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
    """What was written by :func:`to_bytes`, on the CPU wherever it was; RunError where that is not possible.

    Nothing in it is executed: a file with other objects than tensors and plain values is refused.
    """
    try:
        return torch.load(path, map_location="cpu", weights_only=True)
    except pickle.UnpicklingError as error:  # whose text is torch's, of eight lines, on how to execute it nevertheless
        reason = "it is damaged, or holds objects other than tensors and plain values, which could execute anything"
        raise RunError(f"{path} cannot be read: {reason}") from error
    except DAMAGE as error:
        raise RunError(f"{path} cannot be read: {str(error).partition(chr(10))[0] or 'it is cut off'}") from error


def surroundings(device: str) -> dict[str, Any]:
    """Where a training ran, for its manifest."""
    processes = {"processes": distributed.count()} if distributed.count() > 1 else {}
    return {
        "threads": torch.get_num_threads(),
        **processes,
        "machine": f"{platform.system()} {platform.machine()}, {device.partition(':')[0].upper()}",
        "torch": torch.__version__,
    }


def refuse_other(path: Path, manifest: Mapping[str, Any]) -> None:
    """RunError if the run.json at ``path`` is of a run that was started with other data or settings."""
    if not path.exists():
        return

    def essence(manifest: Mapping[str, Any]) -> dict[str, Any]:
        """What has to be as it was for a run to continue: not the length of its training."""
        training = manifest.get("training", {})
        recipe = {key: value for key, value in training.get("recipe", {}).items() if key not in ("epochs", "steps")}
        same = {key: manifest.get(key) for key in ("model", "config", "motion", "vocabulary", "control")}
        return {**same, **{key: training.get(key) for key in ("seed", "data", "split")}, **recipe}

    try:
        before = essence(json.loads(path.read_text()))
    except (AttributeError, TypeError, ValueError, RecursionError) as error:
        raise RunError(f"{path} is not a run that can be resumed: {error}") from error
    different = [key for key, value in essence(manifest).items() if before.get(key) != value]
    if different:
        raise RunError(f"{path.parent} was started with other settings, so cannot be resumed: {', '.join(different)}")
