"""What every model must have: its normalisation, and the graphs that are exported."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any

import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from motet.bundle.graph import GraphSpec
from motet.motion.rotations import Array


class Net(nn.Module, ABC):
    """A model of any kind. mean, scale: of the channels that it takes, set before training."""

    mean: Tensor
    scale: Tensor

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.register_buffer("mean", torch.zeros(channels))
        self.register_buffer("scale", torch.ones(channels))

    def measure_by(self, mean: Array, scale: Array) -> None:
        """Set mean and scale (D,)."""
        self.mean.copy_(torch.from_numpy(mean))
        self.scale.copy_(torch.from_numpy(scale))

    def matrices(self) -> list[Tensor]:
        """The weights that Muon may train: the matrices of linear layers."""
        return [module.weight for module in self.modules() if isinstance(module, nn.Linear)]

    @abstractmethod
    def graphs(self) -> dict[str, tuple[nn.Module, GraphSpec]]:
        """For each role the module to export and the contract that its forward keeps."""

    def tables(self) -> dict[str, NDArray[Any]]:
        """The plain arrays that a bundle holds beside the graphs, by name."""
        return {}


class Part(nn.Module):
    """One function of a net as a module of its own, to be exported."""

    def __init__(self, net: nn.Module, function: Callable[..., Any]) -> None:
        super().__init__()
        self.net, self.forward = net, function


def tuples(value: Any) -> Any:
    """A configuration from JSON, whose lists were tuples before."""
    if isinstance(value, Mapping):
        return {key: tuples(item) for key, item in value.items()}
    return tuple(map(tuples, value)) if isinstance(value, list) else value
