"""One graph as a function of named arrays, the contract that it keeps, and how ONNX Runtime runs it."""

import threading
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from motet.bundle.fields import LARGEST_NUMBER, Fields
from motet.bundle.graph_safety import check_graph
from motet.errors import BundleError, SettingError
from motet.settings import checked_int

MAX_THREADS = 256

PACKAGES = {
    "cuda": "onnxruntime-gpu",
    "tensorrt": "onnxruntime-gpu",
    "dml": "onnxruntime-directml",
    "openvino": "onnxruntime-openvino",
}
"""The builds of ONNX Runtime that have a provider which the plain one lacks, by its name in small letters."""


CPU = "CPUExecutionProvider"
"""The provider that every build of ONNX Runtime has."""


@dataclass(frozen=True)
class SessionOptions:
    """Options of every session of a model; the default is one thread of the CPU.

    threads: of one call of a graph, 1 to 256. 1 is right for step graphs: no idle spinning, and many sessions side by
        side; more pay in large batches.
    providers: execution providers of ONNX Runtime, the preferred first. ONNX Runtime gives the CPU what the others
        cannot run, all of it where one does not start: a model's ``providers`` are those that are really active.
    provider_options: options of each provider, in the same order; none by default.
    configure: called with the ``onnxruntime.SessionOptions`` of each session before it is made, for all else: the level
        of optimisation, profiling, spinning threads. A function of a module, if models are to be pickled.
    SettingError for a number of threads out of range, and for a provider that this build of ONNX Runtime does not have.
    """

    threads: int = 1
    providers: tuple[str, ...] = (CPU,)
    provider_options: tuple[Mapping[str, str], ...] = ()
    configure: Callable[[Any], None] | None = None

    def __post_init__(self) -> None:
        checked_int("threads", self.threads, 1, MAX_THREADS)
        if isinstance(self.providers, str):
            raise SettingError(f"providers must be a tuple of names, such as ({self.providers!r},)")
        for provider in self.providers:
            if provider != CPU and provider not in _available():
                package = PACKAGES.get(_short(provider))
                remedy = f"; in place of onnxruntime:  pip install {package}" if package else ""
                known = ", ".join(_available())
                raise SettingError(f"ONNX Runtime has no provider {provider!r} here; available: {known}{remedy}")
        # options are one mapping for each provider, or none
        of_each = self.provider_options
        if isinstance(of_each, Mapping) or not all(isinstance(options, Mapping) for options in of_each):
            raise SettingError(f"provider_options must hold a mapping for each provider, not {of_each!r:.60}")
        if not self.providers or len(self.provider_options) not in {0, len(self.providers)}:
            raise SettingError("give at least one provider, and options for each provider or for none")

    def session(self, model: bytes) -> Any:
        """A session of ONNX Runtime for a model in memory; raises what ONNX Runtime raises."""
        import onnxruntime

        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = int(self.threads)
        options.inter_op_num_threads = 1
        options.enable_cpu_mem_arena = False  # memory goes back after a large batch, at the same speed
        options.log_severity_level = 4
        if self.configure is not None:
            self.configure(options)
        options.add_session_config_entry("session.load_model_format", "ONNX")  # the one that was checked
        provider_options = [dict(provider) for provider in self.provider_options] or None
        return onnxruntime.InferenceSession(model, options, list(self.providers), provider_options, enable_fallback=0)


def _available() -> list[str]:
    """The providers of this build of ONNX Runtime, which is imported as late as here: it takes a tenth of a second."""
    import onnxruntime

    providers: list[str] = onnxruntime.get_available_providers()
    return providers


def _short(provider: str) -> str:
    return provider.removesuffix("ExecutionProvider").lower()


def provider_of(name: str) -> str:
    """A provider of this build by its name in letters of any case, with or without its ending; else the name."""
    return next((provider for provider in _available() if _short(provider) == _short(name)), name)


Arrays = Mapping[str, NDArray[Any]]
Floats = NDArray[np.float32]

TENSOR_TYPES = {"float32": "tensor(float)", "int64": "tensor(int64)", "bool": "tensor(bool)"}
"""dtype in a manifest -> type in ONNX Runtime."""

MAX_AXIS = 1 << 20
"""Of a fixed axis."""

_creation = threading.Lock()  # ONNX Runtime sessions are safe to share but not to create concurrently


@dataclass(frozen=True)
class TensorSpec:
    """One input or output: its tensor name, dtype, and shape of numbers and of names of dynamic axes."""

    name: str
    shape: tuple[int | str, ...]
    dtype: str = "float32"

    @staticmethod
    def read(data: Fields) -> "TensorSpec":
        """Of a manifest; BundleError for anything else."""
        shape = data.items("shape")
        fixed = [axis for axis in shape if not isinstance(axis, str)]
        if any(isinstance(axis, bool) or not isinstance(axis, int) or not 1 <= axis <= MAX_AXIS for axis in fixed):
            raise data.fault(f"names, and numbers between 1 and {MAX_AXIS}", shape, "shape")
        if len(shape) > 8 or np.prod(fixed, dtype=np.float64) > 1 << 22:
            raise data.fault(f"at most 8 axes with at most {1 << 22} numbers a row", shape, "shape")
        return TensorSpec(data.text("name"), tuple(shape), data.one_of("dtype", TENSOR_TYPES))

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
        inputs = list(map(_tensor_json, self.inputs))
        outputs = list(map(_tensor_json, self.outputs))
        data: dict[str, Any] = {"inputs": inputs, "outputs": outputs, "feedback": dict(self.feedback)}
        return {**data, "start": {name: list(sizes) for name, sizes in self.start.items()}} if self.start else data

    @staticmethod
    def read(data: Fields) -> "GraphSpec":
        """The inverse of :meth:`to_json`; BundleError if it contradicts itself."""
        # the tensors
        inputs = tuple(map(TensorSpec.read, data.list_of_fields("inputs")))
        outputs = tuple(map(TensorSpec.read, data.list_of_fields("outputs")))
        # which of them are fed back, and how large those are before the first step
        fed = data.optional("feedback")
        feedback = {name: fed.text(name) for name in fed.data}
        starts = data.optional("start")
        start: dict[str, tuple[int, ...]] = {}
        for name in starts.data:
            start[name] = tuple(map(int, starts.numbers(name, len(starts.items(name)))))
        graph_spec = GraphSpec(inputs, outputs, feedback, start)
        graph_spec._check(data.path)
        return graph_spec

    def _check(self, path: str) -> None:
        """BundleError where names, feedback or start contradict the tensors. path: of the graph in the manifest."""
        # names are unique
        for tensors in (self.inputs, self.outputs):
            if len({spec.name for spec in tensors}) != len(tensors):
                raise BundleError(f"manifest, {path}: two tensors have the same name")
        # outputs that are fed back fit their inputs
        for name, source in self.feedback.items():
            if not _may_feed(self.output(source), self.input(name)):
                raise BundleError(f"manifest, {path}.feedback: {source!r} does not fit the input {name!r}")
        # states before the first step fit, too
        for name, sizes in self.start.items():
            is_fed = _may_start(sizes, self.input(name).shape[1:]) and name in self.feedback
            if not is_fed:
                raise BundleError(f"manifest, {path}.start: {list(sizes)} does not fit the state {name!r}")


def _may_feed(source: TensorSpec, taken: TensorSpec) -> bool:
    """Whether an output can be fed back into an input: each axis of the same size or name, or of any where the input's
    is dynamic, or else the batch."""
    if source.dtype != taken.dtype or len(source.shape) != len(taken.shape):
        return False
    axes = zip(source.shape, taken.shape, strict=True)
    return all(b in {a, source.shape[0]} or isinstance(b, str) for a, b in axes)


def _may_start(sizes: tuple[int, ...], shape: tuple[int | str, ...]) -> bool:
    """Whether a state of these sizes fits a shape, both without the batch."""
    if len(sizes) != len(shape) or not all(0 <= size <= MAX_AXIS for size in sizes):
        return False
    return all(isinstance(b, str) or a == b for a, b in zip(sizes, shape, strict=True))


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
        self._outputs = [tensor.name for tensor in spec.outputs]
        # caches grow at each step, and nothing but the graph reads them
        grown = {spec.feedback[name] for name, sizes in spec.start.items() if 0 in sizes}
        self._checked = [name for name in self._outputs if name not in grown]
        # the graph has the tensors that the manifest promises
        _check_contract("input", self._session.get_inputs(), spec.inputs)
        _check_contract("output", self._session.get_outputs(), spec.outputs)

    @property
    def providers(self) -> tuple[str, ...]:
        """The execution providers that are active, the preferred first."""
        return tuple(self._session.get_providers())

    def __call__(self, feeds: Arrays) -> dict[str, NDArray[Any]]:
        """Named inputs to named outputs; arrays must have the contract's dtypes.

        BundleError where the graph fails, or gives numbers that are not finite, or beyond
        :data:`motet.bundle.fields.LARGEST_NUMBER`, whose squares would not be, but for caches, which only the graph
        reads."""
        try:
            outputs = dict(zip(self._outputs, self._session.run(self._outputs, feeds), strict=True))
        except Exception as error:
            raise BundleError(f"the graph cannot be run: {str(error).partition(chr(10))[0]}") from error
        # numbers that are not finite, or whose squares would not be, end here
        for name in self._checked:
            array = outputs[name]
            if (
                array.dtype.kind == "f"
                and not -LARGEST_NUMBER <= array.min(initial=0) <= array.max(initial=0) <= LARGEST_NUMBER
            ):
                raise BundleError(f"the graph's output {name!r} is not finite, or beyond {LARGEST_NUMBER:g}")
        return outputs


class LateGraph:
    """A graph that is read and made when it is first called; safe to share between threads.

    spec: its contract. make: reads, checks and makes it; what it raises, every call raises.
    """

    def __init__(self, spec: GraphSpec, make: Callable[[], OnnxGraph]) -> None:
        self.spec = spec
        self._make = make
        self._made: OnnxGraph | None = None
        self._making = threading.Lock()

    def ready(self) -> OnnxGraph:
        """The graph itself, made now if it was not; BundleError like :class:`OnnxGraph`."""
        if self._made is None:
            with self._making:
                self._made = self._made or self._make()
        return self._made

    @property
    def providers(self) -> tuple[str, ...]:
        """The execution providers that are active, the preferred first."""
        return self.ready().providers

    def __call__(self, feeds: Arrays) -> dict[str, NDArray[Any]]:
        """Named inputs to named outputs; BundleError like :class:`OnnxGraph`, and like its calls."""
        return (self._made or self.ready())(feeds)


def _check_contract(kind: str, nodes: Any, declared: tuple[TensorSpec, ...]) -> None:
    """BundleError where ONNX Runtime's tensors of a graph are not those that its contract declares."""
    actual = {node.name: (node.type, _sizes(node.shape)) for node in nodes}
    wanted = {tensor.name: (TENSOR_TYPES[tensor.dtype], _sizes(tensor.shape)) for tensor in declared}
    for name in sorted(actual.keys() | wanted.keys()):
        if actual.get(name) != wanted.get(name):
            difference = f"{actual.get(name, 'absent')}, declared {wanted.get(name, 'nowhere')}"
            raise BundleError(f"the graph does not match its contract: {kind} {name!r} is {difference}")


def _sizes(shape: Any) -> tuple[int | None, ...]:
    """A shape with None for dynamic axes."""
    return tuple(axis if isinstance(axis, int) else None for axis in shape)


def _tensor_json(tensor: TensorSpec) -> dict[str, Any]:
    return {"name": tensor.name, "dtype": tensor.dtype, "shape": list(tensor.shape)}


Sizes = dict[str, int]
"""Letter of an axis -> its size."""


def bind(
    role: str,
    spec: GraphSpec,
    inputs: Mapping[str, str],
    outputs: Mapping[str, str],
    sizes: Sizes,
    provided: Collection[TensorSpec] = (),
) -> None:
    """Check a graph's tensors, and note the sizes of axes not known before.

    inputs, outputs: shapes by name. A small word is a dynamic axis; a capital letter is a size, the same wherever it
        stands; "*" in front is int64. The graph may have more outputs, and more inputs where something gives them.
    provided: tensors that another graph gives. All other inputs must be fed back, and how they start be known.
    BundleError names the role, the tensor and what is expected.
    """
    # the tensors that the caller will use, with the sizes that they share
    for wanted, find in ((inputs, spec.input), (outputs, spec.output)):
        for name, shape in wanted.items():
            try:
                bind_tensor(find(name), shape.lstrip("*"), "int64" if shape.startswith("*") else "float32", sizes)
            except BundleError as error:
                raise BundleError(f"manifest, graphs.{role}: {error}") from error
    # all other inputs feed themselves
    for tensor in spec.inputs:
        if tensor in provided or tensor.name in inputs:
            continue
        if tensor.name not in spec.feedback:
            raise BundleError(f"manifest, graphs.{role}: input {tensor.name!r} is neither supplied nor fed back")
        spec.start_shape(tensor.name)


def bind_tensor(tensor: TensorSpec, shape: str, dtype: str, sizes: Sizes) -> None:
    """Check one tensor, whose shape is put as :func:`bind` has it; BundleError says what is expected."""
    # a letter whose size is known stands for this size in the message
    axes = shape.split()
    expected = tuple(sizes.get(axis, axis) if axis.isupper() else axis for axis in axes)
    fits = tensor.dtype == dtype and len(tensor.shape) == len(axes)
    for axis, size in zip(axes, tensor.shape, strict=False):
        if axis.isdecimal():
            fits &= size == int(axis)
        elif axis.isupper():
            fits &= isinstance(size, int) and sizes.get(axis, size) == size
        else:
            fits &= isinstance(size, str)
    if not fits:
        raise BundleError(f"{tensor.name!r} is {tensor.dtype} {list(tensor.shape)}, expected {dtype} {list(expected)}")
    # sizes read here hold for the tensors that follow
    sizes.update({a: s for a, s in zip(axes, tensor.shape, strict=True) if a.isupper() and isinstance(s, int)})
