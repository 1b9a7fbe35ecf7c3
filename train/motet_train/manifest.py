"""What a run's manifest says beside its recipe, and what of it has to stay for the run to go on."""

import json
import platform
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from motet_train import distributed
from motet_train.runs import RunError

SAME = ("model", "config", "motion", "vocabulary", "control")
SAME_TRAINING = ("seed", "data", "split")
"""What has to be as it was for a run to go on, beside the recipe but for its length."""


@dataclass(frozen=True)
class About:
    """What a manifest says that no computation finds out; a licence that nobody stated is None."""

    name: str
    command: str
    seed: int = 0
    licence: str | None = None
    data_licence: str | None = None


def surroundings(device: str) -> dict[str, Any]:
    """Where a training ran."""
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
    try:
        before = _essence(json.loads(path.read_text()))
    except (AttributeError, TypeError, ValueError) as error:
        raise RunError(f"{path} is not a run that can be resumed: {error}") from error
    different = [key for key, value in _essence(manifest).items() if before.get(key) != value]
    if different:
        raise RunError(f"{path.parent} was started with other settings, so cannot be resumed: {', '.join(different)}")


def _essence(manifest: Mapping[str, Any]) -> dict[str, Any]:
    training = manifest.get("training", {})
    recipe = {key: value for key, value in training.get("recipe", {}).items() if key not in ("epochs", "steps")}
    return {
        **{key: manifest.get(key) for key in SAME},
        **{key: training.get(key) for key in SAME_TRAINING},
        **recipe,
    }
