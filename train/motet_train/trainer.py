"""The training loop of all models: chunk after chunk, each saved whole, so that a run can stop and resume.

It trains a :class:`Learner`. The random numbers of a chunk depend on the seed and the chunk's number alone.
"""

import json
import pickle
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np
import torch
from torch import nn

from motet.bundle.fields import Json
from motet.files import write_whole
from motet_train import distributed
from motet_train.progress import SILENT, Watcher
from motet_train.runs import WEIGHTS, RunError, read_state, to_bytes

CHECKPOINT = "checkpoint.pt"
LOG = "log.jsonl"

Line = dict[str, Any]
"""A line of ``log.jsonl`` for a chunk: the units done, the loss, the results of validation, seconds and speed."""


class Part(Protocol):
    """Something with a state: a net, an optimiser, an averaged net, velocities, a generator of random numbers."""

    def state_dict(self) -> Any:
        """The state, of tensors and plain values."""

    def load_state_dict(self, state_dict: Any, /) -> Any:
        """Restore a state."""


class Learner(Protocol):
    """An object that the loop trains.

    parts: everything with a state, by the name under which it is saved. unit:
    of the length of a training. ends: units done after each chunk. first: number of the first chunk. keep: the weights
    of the "best" validation, or the "last". patience: early stopping after this many validations without improvement.
    target: training ends when validation reaches it.
    """

    parts: dict[str, Part]
    unit: Literal["epoch", "step"]
    ends: list[int]
    first: int
    keep: Literal["best", "last"]
    patience: int | None
    target: float

    @property
    def kept(self) -> nn.Module:
        """The net whose weights are kept."""

    def chunk(self, start: int, stop: int, rng: np.random.Generator) -> Iterator[tuple[int, float, float]]:
        """Train from one unit to another; after each step the units done, the loss and how much it weighs."""

    def validate(self) -> Json:
        """Entries of the log for the chunk: under "validation" the number to minimise, if there is one."""


def train(learner: Learner, seed: int, folder: Path, progress: Watcher = SILENT) -> list[Line]:
    """Train to the end, leaving the weights to keep in ``learner.kept``, and return the log.

    After each chunk the existing ``folder`` holds ``log.jsonl``, the weights to keep and a checkpoint, each written
    whole. If there is a checkpoint, training resumes after it, on the CPU to the same bits as if it had never stopped.
    RunError if the checkpoint cannot be read or belongs to another training, or the loss is no longer finite.
    """
    is_first = distributed.rank() == 0
    log = _resume(folder / CHECKPOINT, learner)
    # chunk after chunk
    while not _done(log, learner):
        start = log[-1][learner.unit] if log else 0
        rng = _seeded(seed, learner.first + len(log))
        log.append(_chunk(learner, start, rng, progress))
        if is_first:
            _write(folder, learner, log)
        progress.chunk(log[-1], learner.ends[-1], learner.unit)
    if is_first:
        learner.kept.load_state_dict(read_state(folder / WEIGHTS))
    learner.kept.eval()
    return log


def _seeded(seed: int, number: int) -> np.random.Generator:
    """The random numbers of a chunk; torch's depend on the seed, the number of the chunk and the process alone."""
    entropy = (seed, number, distributed.rank()) if distributed.rank() else (seed, number)
    torch.manual_seed(int(np.random.SeedSequence(entropy).generate_state(1, np.uint64)[0]))
    return np.random.default_rng((seed, number))


def _chunk(learner: Learner, start: int, rng: np.random.Generator, progress: Watcher) -> Line:
    """Train from ``start`` to the end of its chunk, and validate."""
    stop = min(end for end in learner.ends if end > start)
    began = time.perf_counter()
    losses = []
    weights = []
    for done, loss, weight in learner.chunk(start, stop, rng):
        losses.append(loss)
        weights.append(weight)
        progress.step(done, learner.ends[-1], learner.unit, loss)
    seconds = time.perf_counter() - began

    # each process has its share of every loss
    mean = float(np.average(losses, weights=weights))
    (total,) = distributed.summed([mean], next(learner.kept.parameters()).device)
    return {
        learner.unit: stop,
        "loss": round(total, 6),
        **distributed.from_first(learner.validate),
        "seconds": round(seconds, 3),
        "steps_per_second": round(len(losses) / seconds, 3),
    }


def kept(log: Sequence[Line], keep: Literal["best", "last"]) -> Line:
    """The log line of the kept weights: the best validation, the first of equals, or the last."""
    validated = [line for line in log if "validation" in line and keep == "best"]
    return min(validated, key=lambda line: float(line["validation"]), default=log[-1])


def _done(log: Sequence[Line], learner: Learner) -> bool:
    if not log or log[-1][learner.unit] >= learner.ends[-1]:
        return bool(log)
    validations = [line["validation"] for line in log if "validation" in line]
    if not validations:
        return False
    best = min(validations)
    waited = len(validations) - 1 - validations.index(best)
    return bool(best <= learner.target) or (learner.patience is not None and waited >= learner.patience)


def _write(folder: Path, learner: Learner, log: Sequence[Line]) -> None:
    """Persist a chunk; the checkpoint goes last, so a crash repeats the chunk, to the same weights."""
    if kept(log, learner.keep) is log[-1]:
        write_whole(folder / WEIGHTS, to_bytes(learner.kept.state_dict()))
    write_whole(folder / LOG, "".join(json.dumps(line) + "\n" for line in log))
    states = {name: part.state_dict() for name, part in learner.parts.items()}
    write_whole(folder / CHECKPOINT, to_bytes({"log": list(log), "states": states}))


def _resume(path: Path, learner: Learner) -> list[Line]:
    """Restore the parts; the log so far."""
    saved = distributed.from_first(lambda: read_state(path) if path.exists() else None)
    if saved is None:
        return []
    try:
        for name, part in learner.parts.items():
            part.load_state_dict(saved["states"][name])
        log: list[Line] = saved["log"]
        return log
    except (KeyError, TypeError, ValueError, RuntimeError, pickle.UnpicklingError) as error:
        raise RunError(f"the checkpoint {path} does not belong to this run: {error}") from error
