"""What every model must have: its normalisation, and the graphs that are exported."""

from abc import ABC, abstractmethod

from torch import Tensor, nn

from motet.bundle.graph import GraphSpec


class Net(nn.Module, ABC):
    """A model of any kind. mean, scale: of the channels that it takes, set before training."""

    mean: Tensor
    scale: Tensor

    @abstractmethod
    def graphs(self) -> dict[str, tuple[nn.Module, GraphSpec]]:
        """For each role the module to export and the contract that its forward keeps."""
