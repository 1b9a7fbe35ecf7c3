"""What the models of all verbs share: a manifest, a motion contract, graphs, and the bundle that they came from."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, Self

from motet.bundle.bundle import Bundle
from motet.bundle.graph import Graph
from motet.representation.contract import MotionContract


class Bundled:
    """A model that runs graphs; without state, so that requests and threads share it.

    manifest: of a bundle of the model's verb, or of a training run with the same keys.
    """

    ROLES: ClassVar[tuple[str, ...]] = ("encoder", "step")
    """The graphs that a bundle of this verb has."""

    _source: tuple[Path, int] | None = None

    def __init__(self, manifest: Mapping[str, Any], graphs: Mapping[str, Graph]) -> None:
        self.manifest = manifest
        self.contract = MotionContract.from_json(manifest["motion"])
        self.graphs = graphs

    @classmethod
    def load(cls, bundle: Bundle, threads: int = 1) -> Self:
        """The model of an opened bundle; ``threads`` of one call of a graph pay in large batches."""
        model = cls(bundle.manifest, {role: bundle.graph(role, threads) for role in cls.ROLES})
        model._source = (bundle.path, threads)
        return model

    def __reduce__(self) -> tuple[Any, ...]:
        # sessions of ONNX Runtime do not pickle: another process loads the bundle again
        if self._source is None:
            raise TypeError("only a model loaded from a bundle can be pickled")
        return _reload, (type(self), *self._source)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({len(self.contract.channels)} channels at {self.fps:g} fps)"

    @property
    def fps(self) -> float:
        """Frames per second that the model takes and gives."""
        return self.contract.fps


def _reload(kind: type[Bundled], path: Path, threads: int) -> Bundled:
    return kind.load(Bundle.open(path), threads)
