"""What all nets share: their normalisation, the graphs that are exported, and their configuration."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import is_dataclass
from typing import Any, ClassVar, Self, get_type_hints

import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from motet.bundle.fields import Json
from motet.bundle.graph import GraphSpec, TensorSpec
from motet.motion.rotations import Array
from motet.representation.contract import Z_LIMIT

Graphs = dict[str, tuple[nn.Module, GraphSpec]]
"""For each role the module to export and the contract of its forward."""

Tables = dict[str, NDArray[Any]]
"""Plain arrays of a bundle by name."""


def float_rows(name: str, *shape: str | int, dtype: str = "float32") -> TensorSpec:
    """The contract of a tensor (B, ...) of some rows. shape: of a row, with the names of axes of any size."""
    return TensorSpec(name, ("batch", *shape), dtype)


def id_rows(name: str, *shape: str | int) -> TensorSpec:
    """The contract of a tensor of whole numbers, see :func:`float_rows`."""
    return float_rows(name, *shape, dtype="int64")


class Net(nn.Module, ABC):
    """A model of any kind. mean, scale: of the channels it takes, set before training."""

    CONFIG: ClassVar[type]
    """The dataclass of its configuration."""

    mean: Tensor
    scale: Tensor

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.register_load_state_dict_pre_hook(_rename)  # type: ignore[no-untyped-call]
        self.register_buffer("mean", torch.zeros(channels))
        self.register_buffer("scale", torch.ones(channels))

    @classmethod
    def from_config(cls, config: Json) -> Self:
        """An untrained net of a configuration from a manifest."""
        return cls(configured(cls.CONFIG, config))

    def measure_by(self, mean: Array, scale: Array) -> None:
        """Set mean and scale (D,)."""
        self.mean.copy_(torch.from_numpy(mean))
        self.scale.copy_(torch.from_numpy(scale))

    def current_name(self, name: str) -> str:
        """The name of a weight, from its name in an older run: parts are renamed by the OLD_NAMES of their modules."""
        module: nn.Module | None = self
        parts = []
        for part in name.split("."):
            parts.append(getattr(module, "OLD_NAMES", {}).get(part, part))
            module = getattr(module, parts[-1], None)
        return ".".join(parts)

    def matrices(self) -> list[Tensor]:
        """The weights that Muon may train: the matrices of linear layers."""
        return [module.weight for module in self.modules() if isinstance(module, nn.Linear)]

    @abstractmethod
    def graphs(self) -> Graphs:
        """The graphs by role."""

    def tables(self) -> Tables:
        """The plain arrays that a bundle holds beside the graphs, by name."""
        return {}


class Part(nn.Module):
    """One function of a net as a module of its own, to be exported."""

    def __init__(self, net: nn.Module, function: Callable[..., Any]) -> None:
        super().__init__()
        self.net = net
        self.forward = function


def encoder_and_step(net: Any, encoder: GraphSpec, step: GraphSpec) -> Graphs:
    """The graphs of a net's ``encode`` and ``step`` with their contracts."""
    return {"encoder": (Part(net, net.encode), encoder), "step": (Part(net, net.step), step)}


def _rename(net: Net, state: dict[str, Any], prefix: str, *details: Any) -> None:
    """Give the weights of an older run the names of today, before they are loaded."""
    for key in list(state):
        if key.startswith(prefix):
            state[prefix + net.current_name(key.removeprefix(prefix))] = state.pop(key)


def tuples(value: Any) -> Any:
    """A value from JSON with its lists as tuples."""
    if isinstance(value, Mapping):
        return {key: tuples(item) for key, item in value.items()}
    return tuple(map(tuples, value)) if isinstance(value, list) else value


def configured(kind: Any, data: Json) -> Any:
    """The dataclass ``kind``, and the dataclasses in its fields, from JSON."""
    hints = get_type_hints(kind)
    parts = {name: hints[name] for name in data if is_dataclass(hints.get(name))}
    return kind(
        **{key: configured(parts[key], value) if key in parts else tuples(value) for key, value in data.items()}
    )


def normalised(frames: Tensor, mean: Tensor, scale: Tensor, limit: float = Z_LIMIT) -> Tensor:
    """Frames (..., D) as z = (frames - mean) / scale within +-limit, and 0 where the scale (D,) is 0.

    Like :meth:`motet.representation.contract.MotionContract.normalised`, but part of the exported graphs.
    """
    divisor = torch.where(scale > 0, scale, torch.inf)
    return ((frames - mean) / divisor).clamp(-limit, limit)


def constants(module: nn.Module, **tensors: Tensor) -> None:
    """Give a module tensors that move to a device with it, and are not among its weights."""
    for name, tensor in tensors.items():
        module.register_buffer(name, tensor, persistent=False)


def zero_linear(inputs: int, outputs: int) -> nn.Linear:
    """A linear layer that gives 0 until it is trained."""
    layer = nn.Linear(inputs, outputs)
    nn.init.zeros_(layer.weight)
    nn.init.zeros_(layer.bias)
    return layer


def gelu(x: Tensor) -> Tensor:
    """As in torch; exported in the one order of its products that ONNX Runtime computes in one kernel."""
    if torch.compiler.is_exporting():
        return x * (1 + torch.erf(x / 2**0.5)) * 0.5
    return functional.gelu(x)


def before(lengths: Tensor, steps: int) -> Tensor:
    """Which of the first ``steps`` steps lie before the end of each row: lengths (B,) to bool (B, steps)."""
    return torch.arange(steps, device=lengths.device) < lengths[:, None]
