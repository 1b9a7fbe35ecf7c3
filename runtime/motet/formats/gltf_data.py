"""The parts of a glTF 2.0 file: its JSON object, its nodes as a tree, and its arrays of numbers."""

import base64
import json
import struct
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from motet.errors import FormatError, quoted
from motet.files import File, place_of
from motet.formats.lines import read_bytes
from motet.motion.rotations import Array, rotmat_to_quat

COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
"""glTF's numbers for types of numbers."""

SHAPES = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}

UNREADABLE = ("EXT_meshopt_compression", "KHR_meshopt_compression")
"""Extensions by which arrays of animations are packed."""


@dataclass(frozen=True)
class Gltf:
    """A parsed file: its JSON object and its buffers."""

    path: Path
    document: dict[str, Any]
    buffers: tuple[bytes, ...]

    def objects(self, name: str) -> list[dict[str, Any]]:
        """One of the file's lists of objects, empty where it has none."""
        found: list[dict[str, Any]] = self.document.get(name, [])
        return found

    @cached_property
    def parents(self) -> tuple[int, ...]:
        """For each node its parent, -1 for a root; FormatError where nodes do not form trees."""
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
        """All nodes, each after its parent, branch by branch."""
        order: list[int] = []
        waiting = [node for node, parent in enumerate(self.parents) if parent == -1][::-1]
        while waiting:
            order.append(waiting.pop())
            waiting.extend(reversed(self.objects("nodes")[order[-1]].get("children", [])))
        if len(order) < len(self.parents):
            raise FormatError(self.path, "its nodes are not a tree: some of them form a ring")
        return tuple(order)

    def above(self, node: int) -> list[int]:
        """A node and all that it hangs on, upwards."""
        chain = [node]
        while self.parents[chain[-1]] >= 0:
            chain.append(self.parents[chain[-1]])
        return chain

    def humanoid(self) -> dict[str, int]:
        """The bones that VRM 0, VRM 1 or VRM Animation names, with their nodes; empty where there are none."""
        extensions = self.document.get("extensions", {})
        if "VRM" in extensions:
            old = extensions["VRM"].get("humanoid", {}).get("humanBones", [])
            return {bone["bone"]: bone["node"] for bone in old}
        for name in ("VRMC_vrm", "VRMC_vrm_animation"):
            if name in extensions:
                bones = extensions[name].get("humanoid", {}).get("humanBones", {})
                return {bone: value["node"] for bone, value in bones.items()}
        return {}

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

    def array(self, index: int) -> Array:
        """The numbers (N, ...) of an accessor; FormatError where it does not lie in the file."""
        try:
            accessor = self.objects("accessors")[index]
            kind, width, count = COMPONENTS[accessor["componentType"]], SHAPES[accessor["type"]], accessor["count"]
            if "bufferView" not in accessor or "sparse" in accessor:
                raise FormatError(self.path, f"accessor {index} is sparse: export it without compression")
            view = self.objects("bufferViews")[accessor["bufferView"]]
            size = np.dtype(kind).itemsize * width
            stride = view.get("byteStride", size)
            start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
            content = self.buffers[view["buffer"]]
            if (
                count < 0
                or start < 0
                or stride < size
                or (start + stride * (count - 1) + size > len(content) and count)
            ):
                raise FormatError(self.path, f"accessor {index} reaches beyond its buffer: the file is truncated")
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


def parse(file: File) -> Gltf:
    """Read a file's parts; FormatError for one that is not glTF 2.0, is truncated, or lacks its buffers."""
    path, content = place_of(file), read_bytes(file)
    text, binary = _chunks(path, content) if content[:4] == b"glTF" else (content, b"")
    try:
        document = json.loads(text)
        version = document["asset"]["version"]
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise FormatError(path, f"not a glTF file: {str(error)[:200]}") from error
    if not str(version).startswith("2."):
        raise FormatError(path, f"glTF of version {str(version)[:20]}: expected 2.0")
    packed = [name for name in UNREADABLE if name in document.get("extensionsRequired", [])]
    if packed:
        raise FormatError(path, f"its arrays are packed by {packed[0]}: export without compression")
    buffers = [_buffer(path, buffer, binary) for buffer in document.get("buffers", [])]
    return Gltf(path, document, tuple(buffers))


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


def _buffer(path: Path, buffer: dict[str, Any], binary: bytes) -> bytes:
    uri = buffer.get("uri")
    if uri is None:
        return binary
    if uri.startswith("data:"):
        return base64.b64decode(uri.partition(",")[2])
    place = path.parent / unquote(uri)
    if not path.is_file():
        raise FormatError(path, f"its buffer {quoted(uri)} is another file: give the path, or save it as .glb")
    try:
        return read_bytes(place)
    except FormatError as error:
        raise FormatError(path, f"its buffer {quoted(uri)} beside it: {error.reason}") from error
