"""Training on several processes started by ``torchrun``: the rank of this one, and values shared by all.

Every process makes the same global batches, which costs little compared to a step, and takes its own rows of them.
Without ``torchrun`` there is one process, and nothing here has an effect.
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
    """Join the processes of ``torchrun``, if it is used; yields the device of this process."""
    if not launched():
        yield device
        return
    if device == "cuda":
        device = f"cuda:{os.environ['LOCAL_RANK']}"
        torch.cuda.set_device(device)
    dist.init_process_group("nccl" if device.startswith("cuda") else "gloo")
    try:
        yield device
        # the first process still writes when others are done: one that ends earlier may abort in Gloo's threads
        dist.barrier()
    finally:
        dist.destroy_process_group()


def launched() -> bool:
    """Whether ``torchrun`` started this process."""
    return dist.is_available() and dist.is_torchelastic_launched()


def rank() -> int:
    """The rank of this process; only rank 0 writes files."""
    return dist.get_rank() if dist.is_available() and dist.is_initialized() else 0


def count() -> int:
    """The number of processes."""
    return dist.get_world_size() if dist.is_available() and dist.is_initialized() else 1


def summed(values: Sequence[float], device: torch.device) -> list[float]:
    """The sum of each value over all processes."""
    if count() == 1:
        return list(values)
    total: Tensor = torch.tensor(values, dtype=torch.float64, device=device)
    dist.all_reduce(total)
    return list(map(float, total.tolist()))


def from_first(make: Callable[[], Value]) -> Value:
    """Call ``make`` in the first process, and return its result in all."""
    if count() == 1:
        return make()
    values = [make() if rank() == 0 else None]
    dist.broadcast_object_list(values)
    return values[0]  # type: ignore[return-value]
