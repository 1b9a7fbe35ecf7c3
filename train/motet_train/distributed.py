"""Training on several processes, which ``torchrun`` starts: who this one is, and what all of them agree on.

Every process makes the same global batches, which costs little beside a step, and takes its own rows of them.
Outside of ``torchrun`` there is one process, and nothing here does anything.
"""

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TypeVar

import torch
import torch.distributed as dist
from torch import Tensor

Value = TypeVar("Value")


@contextmanager
def processes(device: str) -> Iterator[str]:
    """Join the processes that ``torchrun`` started, where it did; gives the device of this one."""
    if not launched():
        yield device
        return
    if device == "cuda":
        device = f"cuda:{os.environ['LOCAL_RANK']}"
        torch.cuda.set_device(device)
    dist.init_process_group("nccl" if device.startswith("cuda") else "gloo")
    try:
        yield device
    finally:
        dist.destroy_process_group()


def launched() -> bool:
    """Whether ``torchrun`` started this process."""
    return dist.is_available() and dist.is_torchelastic_launched()


def rank() -> int:
    """The number of this process; only 0 writes."""
    return dist.get_rank() if dist.is_available() and dist.is_initialized() else 0


def count() -> int:
    """How many processes there are."""
    return dist.get_world_size() if dist.is_available() and dist.is_initialized() else 1


def summed(values: Sequence[float], device: torch.device) -> list[float]:
    """The sums over all processes."""
    if count() == 1:
        return list(values)
    total: Tensor = torch.tensor(values, dtype=torch.float64, device=device)
    dist.all_reduce(total)
    return list(map(float, total.tolist()))


def from_first(make: Callable[[], Value]) -> Value:
    """What the first process makes, in all of them."""
    if count() == 1:
        return make()
    found = [make() if rank() == 0 else None]
    dist.broadcast_object_list(found)
    return found[0]  # type: ignore[return-value]
