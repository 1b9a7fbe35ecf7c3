"""The parts of a glTF 2.0 file: its JSON object, its nodes as a tree, and its arrays of numbers."""

import base64
import json
import struct
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from motet.errors import FormatError, quoted
from motet.files import File, place_of
from motet.formats.gltf_packed import MAX_UNPACKED, packing, unpacked
from motet.formats.lines import read_bytes
from motet.motion.rotations import Array, frames_last, product, quat_to_rotmat, rotated, rotmat_to_quat

COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
"""glTF's component types."""

TYPE_SIZES = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}

MAX_NODES = 20_000
"""Nodes per file; a figure has a few hundred."""

GLTF_MAX_BYTES = 2**29
"""Total bytes of a file's buffers."""


@dataclass(frozen=True)
class Gltf:
    """A parsed file: its JSON object and its buffers."""

    path: Path
    document: dict[str, Any]
    buffers: tuple[bytes, ...]
    _arrays: dict[int, Array] = field(default_factory=dict)
    _unpacked: dict[int, bytes] = field(default_factory=dict)

    @property
    def size(self) -> int:
        """Total bytes of all buffers and of the parts unpacked from them."""
        return sum(map(len, (*self.buffers, *self._unpacked.values())))

    def objects(self, name: str) -> list[dict[str, Any]]:
        """One of the file's lists of objects, empty if absent."""
        found: list[dict[str, Any]] = self.document.get(name, [])
        return found

    @cached_property
    def parents(self) -> tuple[int, ...]:
        """The parent of each node, -1 for a root; FormatError if the nodes do not form trees."""
        nodes = self.objects("nodes")
        parents = [-1] * len(nodes)
        for index, node in enumerate(nodes):
            for child in node.get("children", []):
                if not 0 <= child < len(nodes) or parents[child] != -1 or child == index:
                    raise FormatError(self.path, f"its nodes are not a tree: node {child} below node {index}")
                parents[child] = index
        return tuple(parents)

    @cached_property
    def order(self) -> tuple[int, ...]:
        """All nodes, parents first, branch by branch."""
        order: list[int] = []
        waiting = [node for node, parent in enumerate(self.parents) if parent == -1][::-1]
        while waiting:
            order.append(waiting.pop())
            waiting.extend(reversed(self.objects("nodes")[order[-1]].get("children", [])))
        if len(order) < len(self.parents):
            raise FormatError(self.path, "its nodes are not a tree: some of them form a cycle")
        return tuple(order)

    @cached_property
    def places(self) -> dict[int, int]:
        """Each node's index in :attr:`order`."""
        return {node: place for place, node in enumerate(self.order)}

    @cached_property
    def roots(self) -> dict[int, int]:
        """The root of each node's tree."""
        roots: dict[int, int] = {}
        for node in self.order:
            roots[node] = roots.get(self.parents[node], node)
        return roots

    def branch(self, wanted: set[int]) -> tuple[int, ...]:
        """Nodes of one tree and the nodes between them, parents first; the first is their lowest common ancestor."""
        below = [int(node in wanted) for node in range(len(self.parents))]
        for node in reversed(self.order):
            if self.parents[node] >= 0:
                below[self.parents[node]] += below[node]
        top = [node for node in self.order if below[node] == len(wanted)][-1]
        return (top, *(node for node in self.order if 0 < below[node] < len(wanted) or node in wanted))

    def humanoid(self) -> dict[str, int]:
        """The bones named by VRM 0, VRM 1 or VRM Animation, with their nodes; empty if none."""
        extensions = self.document.get("extensions", {})
        if "VRM" in extensions:
            old = extensions["VRM"].get("humanoid", {}).get("humanBones", [])
            return {bone["bone"]: bone["node"] for bone in old}
        for name in ("VRMC_vrm", "VRMC_vrm_animation"):
            if name in extensions:
                bones = extensions[name].get("humanoid", {}).get("humanBones", {})
                return {bone: value["node"] for bone, value in bones.items()}
        return {}

    def name(self, node: int) -> str:
        """A node's name, or one made from its number; FormatError if it is not text."""
        name = self.objects("nodes")[node].get("name") or f"node{node}"
        if not isinstance(name, str):
            raise FormatError(self.path, f"the name of node {node} is not text")
        return name

    def local(self, node: int) -> tuple[Array, Array, Array]:
        """Translation (3), rotation as a quaternion (4) with the scalar last, and scale (3) of a node at rest."""
        found = self.objects("nodes")[node]
        if "matrix" in found:
            matrix = np.array(found["matrix"], np.float64).reshape(4, 4).T
            scale = np.linalg.norm(matrix[:3, :3], axis=0)
            return matrix[:3, 3], rotmat_to_quat(matrix[:3, :3] / np.where(scale > 0, scale, 1.0)), scale
        parts = (("translation", (0.0, 0.0, 0.0)), ("rotation", (0.0, 0.0, 0.0, 1.0)), ("scale", (1.0, 1.0, 1.0)))
        move, turn, scale = (np.array(found.get(name, rest), np.float64) for name, rest in parts)
        return move, turn, scale

    def world(
        self, nodes: Iterable[int] | None = None, tracks: Mapping[tuple[int, str], Array] | None = None
    ) -> tuple[Array, Array, Array]:
        """Linear maps and rotations (T, N, 3, 3) and positions (T, N, 3) of nodes in the world, at rest (T = 1) or
        moved by tracks, values (T, ...) of a node's "translation", "rotation" or "scale".

        nodes: the nodes to fill, including all their ancestors; all by default. Others are not filled.
        """
        tracks = tracks or {}
        count, wanted = len(next(iter(tracks.values()), [0])), self.order if nodes is None else set(nodes)
        linear, turns = (frames_last((count, len(self.parents), 3, 3)) for _ in range(2))
        places = frames_last((count, len(self.parents), 3))
        for node in (node for node in self.order if node in wanted):
            rest = dict(zip(("translation", "rotation", "scale"), self.local(node), strict=True))
            move, quat, scale = (tracks.get((node, name), value) for name, value in rest.items())
            turn = quat_to_rotmat(quat / np.linalg.norm(quat, axis=-1, keepdims=True))
            linear[:, node], turns[:, node], places[:, node] = turn * scale[..., None, :], turn, move
            if (parent := self.parents[node]) >= 0:
                places[:, node] = places[:, parent] + rotated(linear[:, parent], places[:, node])
                linear[:, node] = product(linear[:, parent], linear[:, node])
                turns[:, node] = product(turns[:, parent], turns[:, node])
        return linear, turns, places

    def array(self, index: int) -> Array:
        """The numbers (N, ...) of an accessor, not to be modified; FormatError if it is not in the file."""
        if index not in self._arrays:
            values = self._decoded(index)
            values.setflags(write=False)
            if sum(array.size for array in self._arrays.values()) + values.size > self.size:
                raise FormatError(self.path, "its arrays overlap: they hold more numbers than the file has bytes")
            self._arrays[index] = values
        return self._arrays[index]

    def _decoded(self, index: int) -> Array:
        try:
            accessor = self.objects("accessors")[index]
            kind, width, count = COMPONENTS[accessor["componentType"]], TYPE_SIZES[accessor["type"]], accessor["count"]
            if "bufferView" not in accessor or "sparse" in accessor:
                raise FormatError(self.path, f"accessor {index} is sparse: export it without compression")
            size = np.dtype(kind).itemsize * width
            content, start, stride = self._view(accessor["bufferView"])
            start, stride = start + accessor.get("byteOffset", 0), stride or size
            if (
                count < 0
                or start < 0
                or stride < size
                or (start + stride * (count - 1) + size > len(content) and count)
            ):
                raise FormatError(self.path, f"accessor {index} extends beyond its buffer: the file is truncated")
            rows = np.lib.stride_tricks.as_strided(
                np.frombuffer(content, np.uint8, offset=start), (count, size), (stride, 1), writeable=False
            )
            values = np.ascontiguousarray(rows).view(kind).astype(np.float64)
        except FormatError:
            raise
        except (KeyError, IndexError, TypeError, ValueError) as error:
            raise FormatError(self.path, f"accessor {index} is broken: {str(error)[:200]}") from error
        if accessor.get("normalized"):
            values = np.maximum(values / np.iinfo(np.dtype(kind)).max, -1.0)
        if not np.isfinite(values).all():
            raise FormatError(self.path, f"accessor {index} holds numbers that are not finite")
        return values

    def _view(self, index: int) -> tuple[bytes, int, int]:
        """A buffer, the start of a view of it, and the stride in bytes; 0 if dense."""
        view = self.objects("bufferViews")[index]
        packed = packing(view)
        if packed is None:
            return self.buffers[view["buffer"]], view.get("byteOffset", 0), view.get("byteStride", 0)
        if index not in self._unpacked:
            room = MAX_UNPACKED - sum(map(len, self._unpacked.values()))
            self._unpacked[index] = unpacked(self.path, packed, self.buffers, room)
        return self._unpacked[index], 0, packed["byteStride"]


def parse(file: File) -> Gltf:
    """Read a file's parts; FormatError if it is not glTF 2.0, is truncated, or lacks its buffers."""
    path, content = place_of(file), read_bytes(file)
    text, binary = _chunks(path, content) if content[:4] == b"glTF" else (content, b"")
    try:
        document = json.loads(text)
        version = document["asset"]["version"]
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise FormatError(path, f"not a glTF file: {str(error)[:200]}") from error
    if not str(version).startswith("2."):
        raise FormatError(path, f"glTF version {str(version)[:20]}: expected 2.0")
    if len(document.get("nodes", [])) > MAX_NODES:
        raise FormatError(path, f"it has {len(document['nodes'])} nodes: expected at most {MAX_NODES}")
    beside = path.parent if isinstance(file, str | Path) and content[:4] != b"glTF" else None
    return Gltf(path, document, _buffers(path, document.get("buffers", []), binary, beside))


def _chunks(path: Path, content: bytes) -> tuple[bytes, bytes]:
    """The JSON text and the binary part of a GLB file."""
    found: dict[bytes, bytes] = {}
    place = 12
    while place + 8 <= len(content):
        length, kind = struct.unpack_from("<I4s", content, place)
        if place + 8 + length > len(content):
            raise FormatError(path, "truncated GLB file: it ends within a chunk")
        found.setdefault(kind, content[place + 8 : place + 8 + length])
        place += 8 + length
    if b"JSON" not in found:
        raise FormatError(path, "truncated GLB file: it has no JSON chunk")
    return found[b"JSON"], found.get(b"BIN\0", b"")


def _buffers(path: Path, buffers: list[dict[str, Any]], binary: bytes, beside: Path | None) -> tuple[bytes, ...]:
    """The content of each buffer, up to its declared size; files in the folder ``beside`` only if given."""
    sizes = [buffer["byteLength"] for buffer in buffers]
    if not all(isinstance(size, int) and size >= 0 for size in sizes) or sum(sizes) > GLTF_MAX_BYTES:
        raise FormatError(path, f"its buffers declare invalid sizes, or over {GLTF_MAX_BYTES} bytes in total")
    return tuple(_buffer(path, buffer, binary, beside)[:size] for buffer, size in zip(buffers, sizes, strict=True))


def _buffer(path: Path, buffer: dict[str, Any], binary: bytes, beside: Path | None) -> bytes:
    uri = buffer.get("uri")
    if uri is None:
        return binary
    if uri.startswith("data:"):
        return base64.b64decode(uri.partition(",")[2])
    if beside is None:
        raise FormatError(path, f"its buffer {quoted(uri)} is a separate file, which requires a .gltf given by path")
    place = beside / unquote(uri)
    try:
        if not place.resolve().is_relative_to(beside.resolve()) or place.is_symlink() or not place.is_file():
            raise FormatError(path, f"its buffer {quoted(uri)} is not a file in its folder")
        with place.open("rb") as opened:
            return opened.read(buffer["byteLength"])
    except (OSError, ValueError) as error:
        raise (
            error
            if isinstance(error, FormatError)
            else FormatError(path, f"its buffer {quoted(uri)} cannot be read: {error}")
        ) from error
