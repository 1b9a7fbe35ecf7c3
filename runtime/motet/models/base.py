"""The base of all models: a manifest, a motion contract, graphs, and the bundle they were loaded from."""

import hashlib
import logging
from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping
from contextlib import AbstractContextManager, nullcontext
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Self, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from motet.bundle.bundle import Bundle, Tables, named
from motet.bundle.graph import Arrays, Graph, LateGraph, SessionOptions, Sizes, TensorSpec, bind, bind_tensor
from motet.bundle.manifest import Manifest
from motet.decode.loop import Loop
from motet.errors import BundleError
from motet.motion.kinematics import positions
from motet.motion.motion import Motion, with_frames
from motet.motion.rotations import Array
from motet.settings import Settings

S = TypeVar("S", bound=Settings)

log = logging.getLogger(__name__)


class BundleModel(ABC):
    """A model that runs graphs; stateless, so requests and threads can share it.

    manifest: of a bundle of the model's verb, or of a training run.
    graphs: by role. tables: plain arrays by name.
    BundleError where graphs or tables do not fit the verb or the manifest.
    """

    VERB: ClassVar[str]
    LOOPS: ClassVar[Mapping[str, Loop]]
    """The decoding loops of its bundles, by the names that manifests use."""
    ROLES: ClassVar[tuple[str, ...]] = ("encoder", "step")
    SETTINGS: ClassVar[tuple[type[Settings], ...]] = ()
    """Settings classes whose values a bundle may hold."""

    _source: tuple[Path, SessionOptions] | None = None

    def __init__(self, manifest: Manifest, graphs: Mapping[str, Graph], tables: Arrays | None = None) -> None:
        self._check(manifest, graphs)
        self.manifest = manifest
        self.contract = manifest.motion
        self.loop = self.LOOPS[manifest.loop]
        self.graphs = graphs
        self.tables = tables or {}
        self.defaults = self.loop.defaults(manifest.defaults)
        self._tuned = self._read_settings(manifest.settings)
        self.sizes: Sizes = {"D": len(self.contract.channels)}

    def _check(self, manifest: Manifest, graphs: Mapping[str, Graph]) -> None:
        if manifest.verb != self.VERB:
            raise BundleError(f"manifest, verb: {manifest.verb!r}, expected {self.VERB!r}")
        if manifest.loop not in self.LOOPS:
            loops = ", ".join(self.LOOPS)
            raise BundleError(f"manifest, loop: {manifest.loop!r} does not {self.VERB}; expected one of {loops}")
        for role in self.ROLES:
            if role not in graphs:
                raise BundleError(f"manifest, graphs: there is no graph for the role {role!r}")

    def _read_settings(self, settings: Mapping[str, Mapping[str, Any]]) -> dict[type[Settings], Settings]:
        """The bundle's values of all :attr:`SETTINGS`, defaults for the others."""
        features = {kind.FEATURE: kind for kind in self.SETTINGS}
        if unknown := sorted(settings.keys() - features.keys()):
            expected = ", ".join(features) or "none"
            raise BundleError(f"manifest, settings.{unknown[0]}: is unknown; expected {expected}")
        return {kind: kind.read(settings.get(name, {}), f"settings.{name}") for name, kind in features.items()}

    def bind(
        self,
        role: str,
        inputs: Mapping[str, str],
        outputs: Mapping[str, str],
        provided: Collection[TensorSpec] = (),
    ) -> None:
        """Check the graph of a role against :attr:`sizes`, and record its new sizes; arguments and BundleError like
        :func:`bind`."""
        bind(role, self.graphs[role].spec, inputs, outputs, self.sizes, provided)

    def settings(self, kind: type[S]) -> S:
        """The settings of a feature, one of :attr:`SETTINGS`: the bundle's values, defaults for the others."""
        return cast(S, self._tuned[kind])

    def table(self, name: str, shape: str, dtype: str) -> NDArray[Any]:
        """A table by name, its shape checked like in :meth:`bind`; BundleError where it is missing or does not fit."""
        self.bind_table(name, shape, dtype)
        return self.tables[name]

    def bind_table(self, name: str, shape: str, dtype: str) -> None:
        """As :meth:`table`, but the table is not read: it is checked by what the bundle declares."""
        if name not in self.tables:
            raise BundleError(f"manifest, tables: there is no table {name!r}")
        if isinstance(self.tables, Tables):
            declared = self.tables.declared(name)
        else:
            array = self.tables[name]
            declared = TensorSpec(name, array.shape, str(array.dtype))
        try:
            bind_tensor(declared, shape, dtype, self.sizes)
        except BundleError as error:
            raise BundleError(f"manifest, tables: {error}") from error

    @classmethod
    def load(cls, bundle: Bundle, options: SessionOptions | None = None) -> Self:
        """The model of an opened bundle: each graph and table is read and checked when it is first used."""
        options = options or SessionOptions()
        graphs = {role: bundle.late_graph(role, options) for role in bundle.manifest.graphs}
        with bundle.named():
            model = cls(bundle.manifest, graphs, bundle.late_tables())
        model._source = (bundle.path, options)
        log.info("loaded %s for %s", bundle.path, model.VERB)
        return model

    def ready(self) -> Self:
        """The model, once all that its first use would read is read: so that a server does not start with a damaged
        bundle, and its first answer does not wait. BundleError at the first fault."""
        for graph in self.graphs.values():
            if isinstance(graph, LateGraph):
                graph.ready()
        for name in self.tables:
            _ = self.tables[name]
        return self

    def named(self) -> AbstractContextManager[None]:
        """Name the bundle, if the model is from one, in every error raised within."""
        return nullcontext() if self._source is None else named(self._source[0])

    def __reduce__(self) -> tuple[Any, ...]:
        # sessions of ONNX Runtime do not pickle: another process loads the bundle again
        if self._source is None:
            raise TypeError("only a model loaded from a bundle can be pickled")
        return self._reload, self._source

    @classmethod
    def _reload(cls, path: Path, options: SessionOptions) -> Self:
        return cls.load(Bundle.open(path), options)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.manifest.name!r}, {self.sizes['D']} channels, {self.fps:g} fps)"

    @cached_property
    def fps(self) -> float:
        """The model's frames per second."""
        return self.contract.fps

    def at_own_rate(self, motion: Motion) -> Motion:
        """A motion at the model's frame rate, its last frame kept; MotionError for one without frames."""
        with_frames(motion)
        return motion if motion.fps == self.fps else motion.continuous().resample(self.fps, to_end=True)

    @property
    def providers(self) -> tuple[str, ...]:
        """The active execution providers of ONNX Runtime, the preferred first; empty without its graphs."""
        return tuple(getattr(self.graphs[self.ROLES[-1]], "providers", ())) if self.ROLES else ()

    @abstractmethod
    def replay(self, inputs: Arrays, settings: Mapping[str, Any]) -> Arrays:
        """The complete run of the golden vectors (docs/reference/bundle.md): outputs from its inputs and settings."""

    def meaning(self, frames: Array) -> Arrays:
        """What the manifest makes of numbers, for the golden vectors: it is in no graph.

        frames: (T, D) in the contract's units. Gives "normal", the same in standard deviations from the mean; "seconds"
        (1,), how long they last; "places" (T, J, 3), the joints of the figure that they move, in metres, where there is
        a skeleton; and "names" (32,) int64, the SHA-256 of the names of all channels, of all words in the order of
        their ids, and of the labels, each on a line. BundleError where the frames have another number of channels.
        """
        contract = self.contract
        if frames.shape[1] != len(contract.channels):
            raise BundleError(f"golden vectors: frames have {len(contract.channels)} channels, not {frames.shape[1]}")
        outputs: dict[str, NDArray[Any]] = {
            "normal": contract.normalised(frames),
            "seconds": np.array([len(frames) / contract.fps]),
        }
        if contract.skeleton is not None:
            scale = contract.skeleton.metres_per_unit or 1.0
            outputs["places"] = scale * positions(contract.motion(frames, plant=False))
        digest = hashlib.sha256("\n".join(self._names()).encode()).digest()
        outputs["names"] = np.frombuffer(digest, dtype=np.uint8).astype(np.int64)
        return outputs

    def _names(self) -> list[str]:
        """Of channels, of words in the order of their ids, and of labels."""
        names = [*self.contract.channels, *self.manifest.vocabulary]
        names += [f"{word} {known}" for word, known in self.manifest.common.items()]
        if self.manifest.control is not None:
            names += self.manifest.control.labels
        return names
