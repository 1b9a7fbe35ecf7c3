"""What every model must have: its normalisation, and the graphs that are exported."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any

from torch import Tensor, nn

from motet.bundle.graph import GraphSpec


class Net(nn.Module, ABC):
    """A model of any kind. mean, scale: of the channels that it takes, set before training."""

    mean: Tensor
    scale: Tensor

    @abstractmethod
    def graphs(self) -> dict[str, tuple[nn.Module, GraphSpec]]:
        """For each role the module to export and the contract that its forward keeps."""


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
