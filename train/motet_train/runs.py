"""A training run on disk: ``run.json``, which will be the bundle's manifest, and ``weights.pt``."""

import io
import json
import pickle
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import torch
from numpy.typing import NDArray
from torch import nn

from motet.bundle.graph import Graph, GraphSpec
from motet.errors import MotetError
from motet.files import write_whole
from motet_train.models.action_net import ActionNet
from motet_train.models.codec import MotionCodec
from motet_train.models.filler import Filler
from motet_train.models.joint_embedding import JointEmbedding
from motet_train.models.matching import Matching
from motet_train.models.motion_codes import MotionCodes
from motet_train.models.motion_to_language import MotionToLanguage
from motet_train.models.net import Net
from motet_train.models.predictor import Predictor
from motet_train.papers.li2018 import systems
from motet_train.papers.plappert2017 import language_to_motion
from motet_train.papers.tdbn import angle_crbm, tdbn
from motet_train.torch_graph import TorchGraph

MANIFEST, WEIGHTS = "run.json", "weights.pt"

MODELS: Mapping[str, Callable[[Mapping[str, Any]], Net]] = {
    "tdbn": tdbn.from_config,
    "motion-to-language": MotionToLanguage.from_config,
    "language-to-motion": language_to_motion.from_config,
    "joint-embedding": JointEmbedding.from_config,
    "motion-actions": ActionNet.from_config,
    "motion-codec": MotionCodec.from_config,
    "motion-codes": MotionCodes.from_config,
    "angle-crbm": angle_crbm.from_config,
    "motion-matching": Matching.from_config,
    "gap-filler": Filler.from_config,
    "trajectory": Predictor.from_config,
    **{name: partial(systems.stepwise, name) for name in systems.SYSTEMS},
}
"""Name of a model -> how it is built from the configuration in its manifest."""


class RunError(MotetError, ValueError):
    """A training run that cannot be read, or not be resumed."""


@dataclass(frozen=True, eq=False)
class Run:
    """A trained model and its manifest: see :meth:`motet_train.recipes.recipe.Job.manifest`."""

    manifest: Mapping[str, Any]
    model: Net

    def graphs(self) -> dict[str, tuple[nn.Module, GraphSpec]]:
        """For each role the module to export and the contract that its forward keeps."""
        return self.model.graphs()

    def tables(self) -> dict[str, NDArray[Any]]:
        """The plain arrays of the bundle, by name."""
        return self.model.tables()

    def torch_graphs(self) -> dict[str, Graph]:
        """The graphs, run by torch."""
        return {role: TorchGraph(module, spec) for role, (module, spec) in self.graphs().items()}

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


def to_bytes(state: Any) -> bytes:
    """States of modules and optimisers, and plain values, as bytes."""
    buffer = io.BytesIO()
    torch.save(state, buffer)
    return buffer.getvalue()


def read_state(path: Path) -> Any:
    """What was written by :func:`to_bytes`, on the CPU wherever it was; RunError where that is not possible."""
    try:
        return torch.load(path, map_location="cpu", weights_only=True)
    except (OSError, EOFError, RuntimeError, ValueError, pickle.UnpicklingError) as error:
        raise RunError(f"{path} cannot be read: {error}") from error
