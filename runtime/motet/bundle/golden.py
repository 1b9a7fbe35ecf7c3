"""Golden vectors: inputs, noise and outputs of a bundle's graphs and of one whole run, to be computed again anywhere.

They are arrays in an .npz: ``ROLE.in.NAME`` and ``ROLE.out.NAME`` of one call of each graph, ``run.in.NAME`` and
``run.out.NAME`` of the run, whose settings are in the manifest, and ``meaning.in.NAME`` and ``meaning.out.NAME``, which
hold the manifest to the graphs. docs/reference/bundle.md says what the run of each verb is.
"""

import math
from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from motet.bundle.bundle import archive_bytes
from motet.bundle.fields import Json
from motet.bundle.graph import Arrays, Graph
from motet.bundle.manifest import Golden
from motet.bundle.members import Archive, array_bytes, array_of
from motet.errors import BundleError
from motet.motion.rotations import Array

TOLERANCE = 1e-4
"""On :func:`difference`, for graphs in float32: processors round differently, and a run carries that on. The bundles of
nets that amplify rounding have a larger one."""

MEANING = "meaning"


class Replayable(Protocol):
    """A model that can compute its golden vectors again."""

    graphs: Mapping[str, Graph]

    def replay(self, inputs: Arrays, settings: Json) -> Arrays:
        """The outputs of the whole run."""

    def meaning(self, frames: Array) -> Arrays:
        """What frames (T, D), and the ids of words, mean by the manifest."""


def vectors(model: Replayable, feeds: Mapping[str, Arrays], run_inputs: Arrays, settings: Json, frames: Array) -> bytes:
    """The golden vectors of a model: of its graphs from the ``feeds`` of each role, of a run, and of the meaning of
    ``frames`` (T, D)."""
    arrays: dict[str, Arrays] = {}
    # a call of each graph, a run of the whole, and the meaning of its numbers
    for role, inputs in feeds.items():
        arrays |= {f"{role}.in": inputs, f"{role}.out": model.graphs[role](inputs)}
    arrays |= {"run.in": run_inputs, "run.out": model.replay(run_inputs, settings)}
    arrays |= {f"{MEANING}.in": {"frames": frames}, f"{MEANING}.out": model.meaning(frames)}
    # each array is a member of the archive
    members: dict[str, bytes] = {}
    for prefix, part in arrays.items():
        for name, array in part.items():
            members[f"{prefix}.{name}.npy"] = array_bytes(array)
    return archive_bytes(members)


def replay(model: Replayable, data: bytes, golden: Golden) -> dict[str, float]:
    """The :func:`difference` of each graph, of the run and of the meaning from the vectors ``data``.

    BundleError where one is above the tolerance, or the vectors do not fit the model. Vectors that were written before
    there was a meaning among them have none.
    """
    arrays = read(data)
    differences = {}
    # the graphs one by one: where they agree, a difference below is in the loop
    for role, graph in model.graphs.items():
        differences[role] = difference(graph(_part(arrays, f"{role}.in.")), _part(arrays, f"{role}.out."))
    try:
        # the whole run
        run = model.replay(_part(arrays, "run.in."), golden.run)
    except (KeyError, TypeError, IndexError, ValueError) as error:
        raise BundleError(f"the golden run cannot be replayed: {error}") from error
    differences["run"] = difference(run, _part(arrays, "run.out."))
    if any(name.startswith(f"{MEANING}.") for name in arrays):
        differences[MEANING] = _meaning_difference(model, arrays)
    # the verdict comes last, so that the first name is the innermost that is off
    for name, off in differences.items():
        if not off <= golden.tolerance:
            raise BundleError(f"golden vectors, {name}: off by {off:.2e}, the tolerance is {golden.tolerance:g}")
    return differences


def _meaning_difference(model: Replayable, arrays: Arrays) -> float:
    frames = _part(arrays, f"{MEANING}.in.").get("frames")
    if frames is None or frames.ndim != 2 or not len(frames):
        raise BundleError(f"the golden vectors have no {MEANING}.in.frames of shape (T, D)")
    return difference(model.meaning(frames), _part(arrays, f"{MEANING}.out."))


def difference(actual: Arrays, expected: Arrays) -> float:
    """The largest |a - b| / max(1, RMS of b, |b|) over arrays of equal names; of whole numbers, infinity for any.

    BundleError where shapes or dtypes differ, or a value is not finite.
    """
    largest = 0.0
    for name, array in expected.items():
        if name not in actual or actual[name].shape != array.shape or actual[name].dtype != array.dtype:
            raise BundleError(f"output {name!r} does not have the expected shape or dtype")
        if not np.isfinite(actual[name]).all() or not np.isfinite(array).all():
            raise BundleError(f"output {name!r} is not finite")
        if array.dtype.kind in "bi":
            largest = largest if np.array_equal(actual[name], array) else math.inf
        elif array.size:
            # relative to the size of the value, or of all of them where it is near 0
            wanted = array.astype(np.float64)
            scale = np.maximum(max(1.0, math.sqrt(np.mean(np.square(wanted)))), np.abs(wanted))
            largest = max(largest, float((np.abs(actual[name] - wanted) / scale).max()))
    return largest


def read(data: bytes) -> dict[str, NDArray[Any]]:
    """The arrays of an .npz by name; BundleError where it is damaged, too large, or holds anything but numbers."""
    archive = Archive(data)
    left = 16 << 20
    arrays = {}
    dtypes = ("float32", "float64", "int64")
    for member in sorted(archive.names):
        content = archive.read(member, left)
        left -= len(content)
        if left < 0:
            raise BundleError(f"the golden vectors are larger than {16 << 20} bytes")
        arrays[member.removesuffix(".npy")] = array_of(content, f"golden vectors, {member}", dtypes)
    return arrays


def _part(arrays: Arrays, prefix: str) -> dict[str, NDArray[Any]]:
    part = {name.removeprefix(prefix): value for name, value in arrays.items() if name.startswith(prefix)}
    if not part:
        raise BundleError(f"the golden vectors have no {prefix}*")
    return part
