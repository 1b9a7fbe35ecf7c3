"""One graph as a function of named arrays, and the contract that it keeps."""

import threading
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
import onnxruntime
from numpy.typing import NDArray

from motet.bundle.graph_safety import check_graph
from motet.errors import BundleError

Arrays = Mapping[str, NDArray[Any]]

DTYPES = {"float32": "tensor(float)", "int64": "tensor(int64)", "bool": "tensor(bool)"}
"""dtype in a manifest -> type in ONNX Runtime."""

_creation = threading.Lock()  # ONNX Runtime sessions are safe to share but not to create concurrently


@dataclass(frozen=True)
class TensorSpec:
    """One input or output: its tensor name, dtype, and shape of numbers and of names of dynamic axes."""

    name: str
    shape: tuple[int | str, ...]
    dtype: str = "float32"

    def to_json(self) -> dict[str, Any]:
        """A JSON object; :meth:`from_json` is the inverse."""
        return {"name": self.name, "dtype": self.dtype, "shape": list(self.shape)}

    @staticmethod
    def from_json(data: Mapping[str, Any]) -> "TensorSpec":
        """Read what :meth:`to_json` wrote."""
        shape = tuple(axis if isinstance(axis, str) else int(axis) for axis in data["shape"])
        return TensorSpec(str(data["name"]), shape, str(data["dtype"]))

    def size(self, axis: int) -> int:
        """The size of a fixed axis; BundleError if the axis is dynamic."""
        size = self.shape[axis]
        if isinstance(size, str):
            raise BundleError(f"axis {axis} of {self.name!r} must have a fixed size, it is {size!r}")
        return size

    def example(self, rng: np.random.Generator, batch: int) -> NDArray[Any]:
        """A random array that fits: uniform in [0.05, 1) for float32; every dynamic axis gets ``batch``."""
        shape = [batch if isinstance(axis, str) else axis for axis in self.shape]
        return rng.uniform(0.05, 1.0, shape).astype(self.dtype)


@dataclass(frozen=True)
class GraphSpec:
    """What a graph takes and gives, and which outputs are fed back into which inputs at the next step."""

    inputs: tuple[TensorSpec, ...]
    outputs: tuple[TensorSpec, ...]
    feedback: Mapping[str, str] = field(default_factory=dict)

    def input(self, name: str) -> TensorSpec:
        """The input called ``name``; BundleError if there is none."""
        for spec in self.inputs:
            if spec.name == name:
                return spec
        raise BundleError(f"the graph has no input {name!r}, only {', '.join(spec.name for spec in self.inputs)}")

    def takes(self, name: str) -> bool:
        """Whether there is an input of that name."""
        return any(spec.name == name for spec in self.inputs)

    def to_json(self) -> dict[str, Any]:
        """A JSON object; :meth:`from_json` is the inverse."""
        return {
            "inputs": [spec.to_json() for spec in self.inputs],
            "outputs": [spec.to_json() for spec in self.outputs],
            "feedback": dict(self.feedback),
        }

    @staticmethod
    def from_json(data: Mapping[str, Any]) -> "GraphSpec":
        """Read what :meth:`to_json` wrote."""
        inputs, outputs = (tuple(TensorSpec.from_json(t) for t in data[key]) for key in ("inputs", "outputs"))
        return GraphSpec(inputs, outputs, {str(k): str(v) for k, v in data["feedback"].items()})


class Graph(Protocol):
    """A function of named arrays; whether ONNX Runtime or torch computes it, its callers do not know."""

    @property
    def spec(self) -> GraphSpec:
        """The contract."""

    def __call__(self, feeds: Arrays) -> dict[str, NDArray[Any]]:
        """Named inputs to named outputs."""


class OnnxGraph:
    """A graph run by ONNX Runtime on the CPU; safe to share between threads.

    threads: of one call. 1 is right for step graphs: no idle spinning, and many sessions side by side.
    """

    def __init__(self, model: bytes, spec: GraphSpec, threads: int = 1) -> None:
        self.spec = spec
        check_graph(model)
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = threads
        options.inter_op_num_threads = 1
        options.enable_cpu_mem_arena = False  # memory goes back after a large batch, at the same speed
        options.log_severity_level = 3
        options.add_session_config_entry("session.load_model_format", "ONNX")  # the one that was checked
        try:
            with _creation:
                self._session = onnxruntime.InferenceSession(model, options, providers=["CPUExecutionProvider"])
        except Exception as error:  # ONNX Runtime's errors share no base class of their own
            raise BundleError(f"ONNX Runtime refuses the graph: {str(error).splitlines()[0]}") from error
        _check(self._session.get_inputs(), spec.inputs, "input")
        _check(self._session.get_outputs(), spec.outputs, "output")
        self._outputs = [tensor.name for tensor in spec.outputs]

    def __call__(self, feeds: Arrays) -> dict[str, NDArray[Any]]:
        """Named inputs to named outputs; arrays must have the contract's dtypes."""
        return dict(zip(self._outputs, self._session.run(self._outputs, feeds), strict=True))


def _check(found: list[Any], declared: tuple[TensorSpec, ...], kind: str) -> None:
    """Refuse a graph whose tensors are not those that the manifest declares."""
    actual = {node.name: (node.type, tuple(node.shape)) for node in found}
    wanted = {spec.name: (DTYPES.get(spec.dtype, spec.dtype), tuple(spec.shape)) for spec in declared}
    for name in actual.keys() | wanted.keys():
        if actual.get(name) != wanted.get(name):
            raise BundleError(
                f"the graph does not keep its contract: {kind} {name!r} is {actual.get(name, 'absent')}, "
                f"declared {wanted.get(name, 'nowhere')}"
            )
