"""What training leaves behind on its way, so that it can go on after a stop as if there had been none."""

import io
import json
import pickle
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch

from motet_train.runs import RunError

CHECKPOINT, LOG, WEIGHTS = "checkpoint.pt", "log.jsonl", "weights.pt"


def seed_torch(seed: int, epoch: int) -> None:
    """Let torch's random numbers depend on the seed and the number of the epoch alone."""
    torch.manual_seed(int(np.random.SeedSequence((seed, epoch)).generate_state(1, np.uint64)[0]))


def to_bytes(state: Any) -> bytes:
    """States of modules and optimisers, and plain numbers, as bytes; :func:`read_state` is the inverse."""
    buffer = io.BytesIO()
    torch.save(state, buffer)
    return buffer.getvalue()


def read_state(path: Path) -> Any:
    """What was written with :func:`to_bytes`; RunError where that is not possible."""
    try:
        return torch.load(path, map_location="cpu", weights_only=True)
    except (OSError, EOFError, RuntimeError, ValueError, pickle.UnpicklingError) as error:
        raise RunError(f"{path} cannot be read: {error}") from error


def refuse_other(
    path: Path, manifest: Mapping[str, Any], essence: Callable[[Mapping[str, Any]], Mapping[str, Any]]
) -> None:
    """RunError if the run.json at ``path`` is of a run that was started with other data or settings.

    essence: what of a manifest has to be equal for training to go on, by name.
    """
    if not path.exists():
        return
    try:
        before, now = essence(json.loads(path.read_text())), essence(manifest)
    except (KeyError, TypeError, ValueError) as error:
        raise RunError(f"{path} is no run that can be continued: {error}") from error
    different = [key for key in now if now[key] != before[key]]
    if different:
        raise RunError(f"{path.parent} was started with other settings, and so cannot go on: {', '.join(different)}")
