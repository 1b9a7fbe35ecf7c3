"""The parts of a glTF 2.0 file: its JSON object, its nodes as a tree, and its arrays of numbers."""

import base64
import json
import os
import stat
import struct
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from motet.errors import MotionError, quoted
from motet.files import File, Json, place_of
from motet.formats.text import ContentError, names_file, naming, read_bytes
from motet.motion.rotations import Array, frames_last, product, quat_to_rotmat, rotated, rotmat_to_quat

COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
"""glTF's component types."""

GLTF_MAX_BYTES = 2**29
MAX_UNPACKED = 2**25
"""Total bytes of a file's buffers, and of parts unpacked: 12 minutes of a figure of 90 joints at 60 keys per second."""

MAX_NODES = 20_000
"""Nodes of a file: a figure has a few hundred."""


Tracks = Mapping[tuple[int, str], Array]
"""(Node, "translation", "rotation" or "scale") -> values (T, 3 or 4)."""

REST_TRANSFORM = {"translation": (0.0, 0.0, 0.0), "rotation": (0.0, 0.0, 0.0, 1.0), "scale": (1.0, 1.0, 1.0)}
"""The parts of a node's transform, and what they are where a file does not say."""


@contextmanager
def broken(path: Path) -> Iterator[None]:
    """Turn errors from misplaced or mistyped content into FormatError."""
    with naming(path):
        try:
            yield
        except MotionError:
            raise
        except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
            raise ContentError(f"broken glTF file: {type(error).__name__}: {str(error)[:200]}") from error


@dataclass(frozen=True)
class Gltf:
    """A parsed file: its JSON object, its buffers, and the folder of the files that it may name, if any."""

    path: Path
    document: Json
    buffers: tuple[bytes, ...]
    beside: Path | None = None
    _arrays: dict[int, Array] = field(default_factory=dict)
    _numbers: list[int] = field(default_factory=lambda: [0])
    _unpacked: dict[int, bytes] = field(default_factory=dict)

    @property
    def size(self) -> int:
        """Total bytes of all buffers and of the parts unpacked from them."""
        return sum(map(len, (*self.buffers, *self._unpacked.values())))

    def objects(self, name: str) -> list[Json]:
        """One of the file's lists of objects, empty if absent."""
        objects: list[Json] = self.document.get(name, [])
        return objects

    @cached_property
    def parents(self) -> tuple[int, ...]:
        """The parent of each node, -1 for a root; FormatError if the nodes do not form trees."""
        # each node has one parent at most
        nodes = self.objects("nodes")
        parents = [-1] * len(nodes)
        for index, node in enumerate(nodes):
            for child in node.get("children", []):
                if not 0 <= child < len(nodes) or parents[child] != -1 or child == index:
                    raise ContentError(f"its nodes are not a tree: node {child} below node {index}")
                parents[child] = index
        return tuple(parents)

    @cached_property
    def order(self) -> dict[int, int]:
        """Each node's place in an order of all, parents first, branch by branch; iterating gives that order."""
        order: dict[int, int] = {}
        # from the roots on; nodes of a cycle are never reached
        waiting = [node for node, parent in enumerate(self.parents) if parent == -1][::-1]
        while waiting:
            node = waiting.pop()
            order[node] = len(order)
            waiting.extend(reversed(self.objects("nodes")[node].get("children", [])))
        if len(order) < len(self.parents):
            raise ContentError("its nodes are not a tree: some of them form a cycle")
        return order

    def humanoid(self) -> dict[str, int]:
        """The bones named by VRM 0, VRM 1 or VRM Animation, with their nodes; empty if none."""
        extensions = self.document.get("extensions", {})
        if "VRM" in extensions:
            old = extensions["VRM"].get("humanoid", {}).get("humanBones", [])
            return {bone["bone"]: bone["node"] for bone in old if bone["node"] != -1}  # UniVRM's bones that are not set
        vrm = extensions.get("VRMC_vrm", extensions.get("VRMC_vrm_animation", {}))
        bones = vrm.get("humanoid", {}).get("humanBones", {})
        return {bone: value["node"] for bone, value in bones.items()}

    def name(self, node: int) -> str:
        """A node's name, or one made from its number; FormatError if it is not text."""
        name = self.objects("nodes")[node].get("name") or f"node{node}"
        if not isinstance(name, str):
            raise ContentError(f"the name of node {node} is not text")
        return name

    def local(self, node: int) -> dict[str, Array]:
        """A node's translation (3), rotation as a quaternion (4), scalar last, and scale (3) at rest, each by name."""
        properties = self.objects("nodes")[node]
        if "matrix" in properties:
            # a matrix is column by column, and without shear
            matrix = np.array(properties["matrix"], np.float64).reshape(4, 4).T
            scale = np.linalg.norm(matrix[:3, :3], axis=0)
            turn = rotmat_to_quat(matrix[:3, :3] / np.where(scale > 0, scale, 1.0))
            return {"translation": matrix[:3, 3], "rotation": turn, "scale": scale}
        return {name: np.array(properties.get(name, values), np.float64) for name, values in REST_TRANSFORM.items()}

    def world(self, nodes: Iterable[int] | None = None, tracks: Tracks | None = None) -> tuple[Array, Array, Array]:
        """Linear maps and rotations (T, N, 3, 3) and positions (T, N, 3) of nodes in the world, at rest (T = 1) or
        moved by tracks.

        nodes: the nodes to fill, including all their ancestors; all by default. Others are not filled.
        """
        wanted = set(self.order if nodes is None else nodes)
        in_order = [node for node in self.order if node in wanted]
        linear, turns, places = self._in_parents(in_order, tracks or {})
        # each parent comes before its children, and is in the world by then
        for node in in_order:
            parent = self.parents[node]
            if parent >= 0:
                places[:, node] = places[:, parent] + rotated(linear[:, parent], places[:, node])
                linear[:, node] = product(linear[:, parent], linear[:, node])
                turns[:, node] = product(turns[:, parent], turns[:, node])
        return linear, turns, places

    def _in_parents(self, nodes: Iterable[int], tracks: Tracks) -> tuple[Array, Array, Array]:
        """As :meth:`world`, each node in its parent."""
        frames = len(next(iter(tracks.values()), [0]))
        linear = frames_last((frames, len(self.parents), 3, 3))
        turns = frames_last((frames, len(self.parents), 3, 3))
        places = frames_last((frames, len(self.parents), 3))
        # of each node the animated properties, or what it rests in
        for node in nodes:
            properties = {name: tracks.get((node, name), rest) for name, rest in self.local(node).items()}
            quat = properties["rotation"]
            turn = quat_to_rotmat(quat / np.linalg.norm(quat, axis=-1, keepdims=True))
            linear[:, node] = turn * properties["scale"][..., None, :]
            turns[:, node] = turn
            places[:, node] = properties["translation"]
        return linear, turns, places

    def array(self, index: int) -> Array:
        """The numbers (N, ...) of an accessor, not to be modified; FormatError if it is not in the file."""
        if index not in self._arrays:
            try:
                values = self._decoded(index)
            except (KeyError, IndexError, TypeError, ValueError) as error:
                if isinstance(error, ContentError):
                    raise
                raise ContentError(f"accessor {index} is broken: {str(error)[:200]}") from error
            if not np.isfinite(values).all():
                raise ContentError(f"accessor {index} holds numbers that are not finite")
            self._numbers[0] += values.size
            if self._numbers[0] > self.size:
                raise ContentError("its arrays overlap: they hold more numbers than the file has bytes")
            values.setflags(write=False)
            self._arrays[index] = values
        return self._arrays[index]

    def _decoded(self, index: int) -> Array:
        """The numbers (N, ...) of an accessor as the file has them, whatever they are."""
        accessor = self.objects("accessors")[index]
        width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}[accessor["type"]]
        kind = np.dtype(COMPONENTS[accessor["componentType"]])
        count = accessor["count"]
        # an accessor without a view is all zeros, of which a sparse one replaces some
        if "bufferView" in accessor:
            values = self._rows(index, accessor, kind, count, width).astype(np.float64)
        elif count * width > self.size:
            raise ContentError(f"accessor {index} has more zeros than the file has bytes")
        else:
            values = np.zeros((count, width))
        if "sparse" in accessor:
            sparse = accessor["sparse"]
            changed = self._sparse_places(index, sparse, count)
            values[changed] = self._rows(index, sparse["values"], kind, len(changed), width)
        # whole numbers may stand for 0 to 1, or -1 to 1
        return np.maximum(values / np.iinfo(kind).max, -1.0) if accessor.get("normalized") else values

    def _sparse_places(self, index: int, sparse: Json, count: int) -> NDArray[np.int64]:
        """The rows, of ``count``, that a sparse accessor replaces, in rising order; FormatError if they are not."""
        indices = sparse["indices"]
        kind = np.dtype(COMPONENTS[indices["componentType"]])
        if kind.kind != "u":
            raise ContentError(f"accessor {index} is broken: its sparse indices are not unsigned integers")
        places = self._rows(index, indices, kind, sparse["count"], 1)[:, 0].astype(np.int64)
        if (np.diff(places) <= 0).any() or (places >= count).any():
            reason = f"its sparse indices do not rise, or reach beyond its {count} elements"
            raise ContentError(f"accessor {index} is broken: {reason}")
        return places

    def _rows(self, index: int, part: Json, kind: np.dtype[Any], count: int, width: int) -> NDArray[Any]:
        """Elements (count, width) of a part of an accessor, which names a view; FormatError beyond its buffer."""
        # where the rows are, and whether all of them are in the buffer
        size = kind.itemsize * width
        content, start, stride = self._view(part["bufferView"])
        start = start + part.get("byteOffset", 0)
        stride = stride or size
        beyond = count and start + stride * (count - 1) + size > len(content)
        if count < 0 or start < 0 or stride < size or beyond:
            raise ContentError(f"accessor {index} extends beyond its buffer: the file is truncated")
        rows = np.lib.stride_tricks.as_strided(
            np.frombuffer(content, np.uint8, offset=start), (count, size), (stride, 1), writeable=False
        )
        return np.ascontiguousarray(rows).view(kind)

    def _view(self, index: int) -> tuple[bytes, int, int]:
        """A buffer, the start of a view of it, and the stride in bytes; 0 if dense."""
        # a plain view is part of a buffer; a packed one is unpacked once
        view = self.objects("bufferViews")[index]
        extensions = view.get("extensions", {})
        packings = (f"{maker}_meshopt_compression" for maker in ("EXT", "KHR"))
        packed = next((extensions[name] for name in packings if name in extensions), None)
        if packed is None:
            return self.buffers[view["buffer"]], view.get("byteOffset", 0), view.get("byteStride", 0)
        if index not in self._unpacked:
            self._unpacked[index] = self._unpack(packed)
        return self._unpacked[index], 0, packed["byteStride"]

    def _unpack(self, packed: Json) -> bytes:
        """The bytes of a view packed by meshoptimizer."""
        if find_spec("meshopt") is None:
            remedy = "install the extra with  pip install 'motet[meshopt]', or unpack the file with"
            command = "npx gltfpack -i IN.glb -o OUT.glb -noq -kn -ac"
            raise ContentError(f"its animations are packed by meshoptimizer: {remedy}  {command}")
        content = self._packed(packed)
        decode = import_module("meshopt").decode_gltf_buffer
        kind = (packed["count"], packed["byteStride"], packed["mode"], packed.get("filter"))
        try:
            unpacked: bytes = decode(content, *kind).tobytes()
        except (ValueError, TypeError) as error:
            raise ContentError(f"a packed part is broken: {str(error)[:200]}") from error
        return unpacked

    def _packed(self, packed: Json) -> bytes:
        """The packed bytes of a view; FormatError where they are not in the file, or would unpack to too many."""
        start = packed.get("byteOffset", 0)
        length = packed["byteLength"]
        content: bytes = self.buffers[packed["buffer"]][start : start + length]
        if not 0 <= start <= start + length or len(content) < length:
            raise ContentError("a packed part extends beyond its buffer: the file is truncated")
        count = packed["count"]
        stride = packed["byteStride"]
        room = MAX_UNPACKED - sum(map(len, self._unpacked.values()))
        # bytes that one packed byte can expand to: a block of 256 equal bytes takes two bits
        if not (count > 0 and stride > 0 and count * stride <= min(room, 1024 * length)):
            reason = f"a packed part of {length} bytes cannot hold {count} elements of {stride} bytes"
            raise ContentError(reason)
        return content


@names_file
def parse(file: File) -> Gltf:
    """Read a file's parts; FormatError if it is not glTF 2.0, is truncated, or lacks its buffers."""
    path = place_of(file)
    content = read_bytes(file)
    # a binary file has both parts; a text file names the buffers
    text, binary = _chunks(content) if content[:4] == b"glTF" else (content, b"")
    try:
        document = json.loads(text)
        version = document["asset"]["version"]
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise ContentError(f"not a glTF file: {str(error)[:200]}") from error
    if not str(version).startswith("2."):
        raise ContentError(f"glTF version {str(version)[:20]}: expected 2.0")
    if len(document.get("nodes", [])) > MAX_NODES:
        raise ContentError(f"it has {len(document['nodes'])} nodes: expected at most {MAX_NODES}")
    beside = path.parent if isinstance(file, str | Path) and content[:4] != b"glTF" else None
    return Gltf(path, document, _buffers(document, binary, beside), beside)


def _buffers(document: Json, binary: bytes, beside: Path | None) -> tuple[bytes, ...]:
    """The contents of all buffers; FormatError for sizes out of range."""
    buffers = document.get("buffers", [])
    sizes = [buffer["byteLength"] for buffer in buffers]
    if not all(isinstance(size, int) and size >= 0 for size in sizes) or sum(sizes) > GLTF_MAX_BYTES:
        raise ContentError(f"its buffers declare invalid sizes, or over {GLTF_MAX_BYTES} bytes in total")
    return tuple(_buffer(buffer, binary, beside) for buffer in buffers)


def _chunks(content: bytes) -> tuple[bytes, bytes]:
    """The JSON text and the binary part of a GLB file."""
    chunks: dict[bytes, bytes] = {}
    place = 12
    while place + 8 <= len(content):
        length, kind = struct.unpack_from("<I4s", content, place)
        if place + 8 + length > len(content):
            raise ContentError("truncated GLB file: it ends within a chunk")
        chunks.setdefault(kind, content[place + 8 : place + 8 + length])
        place += 8 + length
    if b"JSON" not in chunks:
        raise ContentError("truncated GLB file: it has no JSON chunk")
    return chunks[b"JSON"], chunks.get(b"BIN\0", b"")


def _buffer(buffer: Json, binary: bytes, beside: Path | None) -> bytes:
    """The content of a buffer, up to its declared size; files in the folder ``beside`` only if given."""
    uri = buffer.get("uri")
    size = buffer["byteLength"]
    if uri is None:
        return binary[:size]
    if uri.startswith("data:"):
        return base64.b64decode(uri.partition(",")[2])[:size]
    return read_beside("buffer", uri, size, beside)


def read_beside(what: str, uri: str, size: int, beside: Path | None) -> bytes:
    """At most ``size`` bytes of a file that a .gltf names; FormatError if it is none in the folder ``beside``."""
    if beside is None:
        raise ContentError(f"its {what} {quoted(uri)} is a separate file, which requires a .gltf given by path")
    place = beside / unquote(uri)
    try:
        if place.resolve().is_relative_to(beside.resolve()) and not place.is_symlink() and place.is_file():
            with open(place, "rb", opener=_without_links) as opened:
                if stat.S_ISREG(os.fstat(opened.fileno()).st_mode):
                    return opened.read(size)
    except (OSError, ValueError, RuntimeError) as error:  # RuntimeError: a loop of links, before Python 3.13
        raise ContentError(f"its {what} {quoted(uri)} cannot be read: {error}") from error
    raise ContentError(f"its {what} {quoted(uri)} is not a file in its folder")


def _without_links(name: str, flags: int) -> int:
    """Open a file that may have been exchanged since it was looked at: a link is refused, a pipe is not waited for."""
    return os.open(name, flags | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0))
