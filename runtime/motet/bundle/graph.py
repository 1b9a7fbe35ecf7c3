"""One graph as a function of named arrays, and the contract that it keeps."""

import threading
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from motet.bundle.fields import Fields
from motet.bundle.graph_safety import check_graph
from motet.bundle.session import SessionOptions
from motet.errors import BundleError

Arrays = Mapping[str, NDArray[Any]]
Floats = NDArray[np.float32]

DTYPES = {"float32": "tensor(float)", "int64": "tensor(int64)", "bool": "tensor(bool)"}
"""dtype in a manifest -> type in ONNX Runtime."""

MAX_AXIS, MAX_ROW = 1 << 20, 1 << 22
"""Of a fixed axis, and of all the fixed axes of a tensor multiplied."""

_creation = threading.Lock()  # ONNX Runtime sessions are safe to share but not to create concurrently


@dataclass(frozen=True)
class TensorSpec:
    """One input or output: its tensor name, dtype, and shape of numbers and of names of dynamic axes."""

    name: str
    shape: tuple[int | str, ...]
    dtype: str = "float32"

    def to_json(self) -> dict[str, Any]:
        """A JSON object; :meth:`read` is the inverse."""
        return {"name": self.name, "dtype": self.dtype, "shape": list(self.shape)}

    @staticmethod
    def read(data: Fields) -> "TensorSpec":
        """The inverse of :meth:`to_json`; BundleError for anything else."""
        shape = data.items("shape")
        fixed = [axis for axis in shape if not isinstance(axis, str)]
        if any(isinstance(axis, bool) or not isinstance(axis, int) or not 1 <= axis <= MAX_AXIS for axis in fixed):
            raise data.fault(f"names, and numbers between 1 and {MAX_AXIS}", shape, "shape")
        if len(shape) > 8 or np.prod(fixed, dtype=np.float64) > MAX_ROW:
            raise data.fault(f"at most 8 axes with at most {MAX_ROW} numbers a row", shape, "shape")
        return TensorSpec(data.text("name"), tuple(shape), data.one_of("dtype", DTYPES))

    def size(self, axis: int) -> int:
        """The size of a fixed axis; BundleError if the axis is dynamic."""
        size = self.shape[axis]
        if isinstance(size, str):
            raise BundleError(f"axis {axis} of {self.name!r} must have a fixed size, not {size!r}")
        return size

    def example(self, rng: np.random.Generator, batch: int) -> NDArray[Any]:
        """A random array that fits: uniform in [0.05, 1) for float32; every dynamic axis gets ``batch``."""
        shape = [batch if isinstance(axis, str) else axis for axis in self.shape]
        return rng.uniform(0.05, 1.0, shape).astype(self.dtype)


@dataclass(frozen=True)
class GraphSpec:
    """A graph's inputs and outputs, and which outputs are fed back into which inputs at the next step.

    start: for a fed back input with dynamic axes besides the batch, the sizes that all its axes but the batch have
        before the first step: (heads, 0, width) for a cache that grows by one along its second axis.
    """

    inputs: tuple[TensorSpec, ...]
    outputs: tuple[TensorSpec, ...]
    feedback: Mapping[str, str] = field(default_factory=dict)
    start: Mapping[str, tuple[int, ...]] = field(default_factory=dict)

    def input(self, name: str) -> TensorSpec:
        """The input called ``name``; BundleError if there is none."""
        return _named(name, self.inputs, "input")

    def output(self, name: str) -> TensorSpec:
        """The output called ``name``; BundleError if there is none."""
        return _named(name, self.outputs, "output")

    def takes(self, name: str) -> bool:
        """Whether there is an input of that name."""
        return any(spec.name == name for spec in self.inputs)

    def start_shape(self, name: str) -> tuple[int, ...]:
        """The sizes (batch left out) of a fed back input before the first step; BundleError where nothing says them."""
        spec = self.input(name)
        return self.start.get(name) or tuple(spec.size(axis) for axis in range(1, len(spec.shape)))

    def to_json(self) -> dict[str, Any]:
        """A JSON object; :meth:`read` is the inverse."""
        found: dict[str, Any] = {
            "inputs": [spec.to_json() for spec in self.inputs],
            "outputs": [spec.to_json() for spec in self.outputs],
            "feedback": dict(self.feedback),
        }
        return {**found, "start": {name: list(sizes) for name, sizes in self.start.items()}} if self.start else found

    @staticmethod
    def read(data: Fields) -> "GraphSpec":
        """The inverse of :meth:`to_json`; BundleError if it contradicts itself."""
        inputs, outputs = (tuple(map(TensorSpec.read, data.list_of_fields(key))) for key in ("inputs", "outputs"))
        fed = data.fields("feedback") if "feedback" in data else Fields({})
        feedback = {name: fed.text(name) for name in fed.data}
        start = data.fields("start") if "start" in data else Fields({})
        sizes = {name: tuple(int(size) for size in start.numbers(name, len(start.items(name)))) for name in start.data}
        found = GraphSpec(inputs, outputs, feedback, sizes)
        found._check(data.path)
        return found

    def _check(self, path: str) -> None:
        for tensors in (self.inputs, self.outputs):
            if len({spec.name for spec in tensors}) != len(tensors):
                raise BundleError(f"manifest, {path}: two tensors have the same name")
        for name, source in self.feedback.items():
            given, taken = self.output(source), self.input(name)
            alike = [
                b in {a, given.shape[0]} or isinstance(b, str) for a, b in zip(given.shape, taken.shape, strict=False)
            ]
            if given.dtype != taken.dtype or len(given.shape) != len(taken.shape) or not all(alike):
                raise BundleError(f"manifest, {path}.feedback: {source!r} does not fit the input {name!r}")
        for name, sizes in self.start.items():
            shape = self.input(name).shape[1:]
            fits = len(sizes) == len(shape) and all(
                isinstance(b, str) or a == b for a, b in zip(sizes, shape, strict=True)
            )
            if name not in self.feedback or not fits or not all(0 <= size <= MAX_AXIS for size in sizes):
                raise BundleError(f"manifest, {path}.start: {list(sizes)} does not fit the state {name!r}")


def _named(name: str, tensors: tuple[TensorSpec, ...], kind: str) -> TensorSpec:
    for spec in tensors:
        if spec.name == name:
            return spec
    raise BundleError(f"the graph has no {kind} {name!r}, only {', '.join(spec.name for spec in tensors)}")


class Graph(Protocol):
    """A function of named arrays; whether ONNX Runtime or torch computes it, its callers do not know."""

    @property
    def spec(self) -> GraphSpec:
        """The contract."""

    def __call__(self, feeds: Arrays) -> dict[str, NDArray[Any]]:
        """Named inputs to named outputs."""


class OnnxGraph:
    """A graph run by ONNX Runtime; safe to share between threads.

    BundleError for a graph that is damaged, does not keep the contract ``spec``, or could reach outside of its bytes.
    """

    def __init__(self, model: bytes, spec: GraphSpec, options: SessionOptions | None = None) -> None:
        self.spec = spec
        check_graph(model)
        try:
            with _creation:
                self._session = (options or SessionOptions()).session(model)
        except Exception as error:  # ONNX Runtime's errors share no base class of their own
            raise BundleError(f"ONNX Runtime rejected the graph: {str(error).partition(chr(10))[0]}") from error
        _check(self._session.get_inputs(), spec.inputs, "input")
        _check(self._session.get_outputs(), spec.outputs, "output")
        self._outputs = [tensor.name for tensor in spec.outputs]

    @property
    def providers(self) -> tuple[str, ...]:
        """The execution providers that are active, the preferred first."""
        return tuple(self._session.get_providers())

    def __call__(self, feeds: Arrays) -> dict[str, NDArray[Any]]:
        """Named inputs to named outputs; arrays must have the contract's dtypes.

        BundleError where the graph fails, or gives numbers that are not finite.
        """
        try:
            found = dict(zip(self._outputs, self._session.run(self._outputs, feeds), strict=True))
        except Exception as error:
            raise BundleError(f"the graph cannot be run: {str(error).partition(chr(10))[0]}") from error
        for name, array in found.items():
            if array.dtype.kind == "f" and not np.isfinite(array).all():
                raise BundleError(f"the graph's output {name!r} is not finite")
        return found


def _check(found: list[Any], declared: tuple[TensorSpec, ...], kind: str) -> None:
    """Refuse a graph whose tensors differ from the manifest's; dynamic axes may have other names."""
    actual = {node.name: (node.type, _sizes(node.shape)) for node in found}
    wanted = {spec.name: (DTYPES[spec.dtype], _sizes(spec.shape)) for spec in declared}
    for name in actual.keys() | wanted.keys():
        if actual.get(name) != wanted.get(name):
            raise BundleError(
                f"the graph does not match its contract: {kind} {name!r} is {actual.get(name, 'absent')}, "
                f"declared {wanted.get(name, 'nowhere')}"
            )


def _sizes(shape: Any) -> tuple[int | None, ...]:
    """A shape with None for dynamic axes."""
    return tuple(axis if isinstance(axis, int) else None for axis in shape)
