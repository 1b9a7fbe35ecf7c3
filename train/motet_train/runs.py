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
from torch import nn

from motet.bundle.graph import Graph, GraphSpec
from motet.errors import MotetError
from motet.files import write_whole
from motet_train.models.control import angle_crbm, tdbn
from motet_train.models.language import language_to_motion, motion_to_language
from motet_train.models.predict import predictor, systems
from motet_train.torch_graph import TorchGraph

MODELS: Mapping[str, Callable[[Mapping[str, Any]], nn.Module]] = {
    "tdbn": tdbn.from_config,
    "motion-to-language": motion_to_language.from_config,
    "language-to-motion": language_to_motion.from_config,
    "angle-crbm": angle_crbm.from_config,
    "trajectory": predictor.from_config,
    **{name: partial(systems.stepwise, name) for name in systems.SYSTEMS},
}
"""Name of a model -> how it is built from the configuration in its manifest."""


class RunError(MotetError, ValueError):
    """A folder that is no training run."""


@dataclass(frozen=True, eq=False)
class Run:
    """A trained model with all that its bundle will say about it.

    manifest: name, verb, model, the config that the model is built from, motion contract, defaults, licence,
        training, quality and what the verb needs; ready for JSON.
    """

    manifest: Mapping[str, Any]
    model: nn.Module

    def graphs(self) -> dict[str, tuple[nn.Module, GraphSpec]]:
        """For each role the module to export and the contract that its forward keeps."""
        found: dict[str, tuple[nn.Module, GraphSpec]] = self.model.graphs()  # type: ignore[operator]
        return found

    def torch_graphs(self) -> dict[str, Graph]:
        """The same graphs, run by torch."""
        return {role: TorchGraph(module, spec) for role, (module, spec) in self.graphs().items()}

    def save(self, folder: Path) -> None:
        """Write the run into an existing folder."""
        buffer = io.BytesIO()
        torch.save(self.model.state_dict(), buffer)
        write_whole(folder / "weights.pt", buffer.getvalue())
        write_whole(folder / "run.json", json.dumps(self.manifest, indent=1) + "\n")

    @staticmethod
    def load(folder: Path) -> "Run":
        """Read what :meth:`save` wrote; RunError where that is not possible."""
        try:
            manifest = json.loads((folder / "run.json").read_text())
            model = MODELS[manifest["model"]](manifest["config"])
            model.load_state_dict(torch.load(folder / "weights.pt", weights_only=True))
        except FileNotFoundError as error:
            raise RunError(f"{folder} is no training run: it has no {Path(error.filename).name}") from error
        except (KeyError, TypeError, ValueError, RuntimeError, OSError, pickle.UnpicklingError) as error:
            raise RunError(f"the training run {folder} cannot be read: {error}") from error
        return Run(manifest, model)


def surroundings(device: str = "cpu") -> dict[str, Any]:
    """Where a training runs, for its manifest."""
    return {
        "threads": torch.get_num_threads(),
        "machine": f"{platform.system()} {platform.machine()}, {device.upper()}",
        "torch": torch.__version__,
    }
