"""Plays glTF clips on a character's nodes as engines do, by 4x4 matrices: kinematics that are not motet's."""

import json
import struct
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

TYPES = {5121: "<u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


def matrix(move: Array, quat: Array, scale: Array) -> Array:
    """Matrices (T, 4, 4) of translations, rotations and scales (T, ...)."""
    x, y, z, w = (quat / np.linalg.norm(quat, axis=1, keepdims=True)).T
    found = np.zeros((len(move), 4, 4))
    found[:, :3, 0] = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)], axis=1)
    found[:, :3, 1] = np.stack([2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)], axis=1)
    found[:, :3, 2] = np.stack([2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)], axis=1)
    found[:, :3, :3] *= scale[:, None, :]
    found[:, :3, 3], found[:, 3, 3] = move, 1
    return found


def between(keys: Array, values: Array, sampler: dict[str, Any], times: Array) -> Array:
    """Values (T, K) of a sampler at some times: of rotations the shortest way on the sphere."""
    after = np.clip(np.searchsorted(keys, times, "right"), 1, max(len(keys) - 1, 1))
    one, other = values[after - 1], values[np.minimum(after, len(keys) - 1)]
    span = keys[np.minimum(after, len(keys) - 1)] - keys[after - 1]
    part = np.clip((times - keys[after - 1]) / np.where(span > 0, span, 1), 0, 1)[:, None]
    if sampler.get("interpolation") == "STEP":
        return np.where(part < 1, one, other)
    cosine = np.sum(one * other, axis=1, keepdims=True)
    angle = np.arccos(np.clip(np.abs(cosine), 0, 1))
    if values.shape[1] < 4 or not (angle > 1e-6).any():
        straight: Array = one + part * (other - one)
        return straight
    sine = np.where(angle > 1e-6, np.sin(angle), 1)
    weights = [np.where(angle > 1e-6, np.sin(share * angle) / sine, share) for share in (1 - part, part)]
    round_: Array = weights[0] * one + weights[1] * np.where(cosine < 0, -other, other)
    return round_


@dataclass
class Played:
    """A GLB file; what moves its nodes is at their rest, until :meth:`play` says otherwise."""

    path: Path

    @cached_property
    def content(self) -> bytes:
        return self.path.read_bytes()

    @cached_property
    def document(self) -> dict[str, Any]:
        length = struct.unpack_from("<I", self.content, 12)[0]
        found: dict[str, Any] = json.loads(self.content[20 : 20 + length])
        return found

    @cached_property
    def binary(self) -> bytes:
        return self.content[28 + struct.unpack_from("<I", self.content, 12)[0] :]

    def array(self, index: int) -> Array:
        accessor = self.document["accessors"][index]
        view = self.document["bufferViews"][accessor["bufferView"]]
        kind, width, count = np.dtype(TYPES[accessor["componentType"]]), WIDTHS[accessor["type"]], accessor["count"]
        stride, start = view.get("byteStride", 0) or kind.itemsize * width, accessor.get("byteOffset", 0)
        start += view.get("byteOffset", 0)
        rows = [np.frombuffer(self.binary, kind, width, start + stride * row) for row in range(count)]
        values: Array = np.array(rows, dtype=float)
        return values / np.iinfo(kind).max if accessor.get("normalized") else values

    @cached_property
    def parents(self) -> dict[int, int]:
        return {child: i for i, node in enumerate(self.document["nodes"]) for child in node.get("children", [])}

    @property
    def names(self) -> list[str]:
        return [node.get("name", "") for node in self.document["nodes"]]

    def clip(self, number: int = 0) -> dict[tuple[str, str], Array]:
        """The keys of an animation, by the names of the nodes."""
        animation = self.document["animations"][number]
        found = {}
        for channel in animation["channels"]:
            target = channel["target"]
            keys = self.array(animation["samplers"][channel["sampler"]]["output"])
            found[self.names[target["node"]], target["path"]] = keys
        return found

    def sampled(self, number: int, fps: float, frames: int) -> dict[tuple[str, str], Array]:
        """The tracks of an animation, linear or in steps, at a frame rate from its first key on."""
        animation = self.document["animations"][number]
        keys = {i: self.array(sampler["input"])[:, 0] for i, sampler in enumerate(animation["samplers"])}
        moved = [channel for channel in animation["channels"] if channel["target"]["path"] != "weights"]
        times = min(keys[channel["sampler"]][0] for channel in moved) + np.arange(frames) / fps
        found = {}
        for channel in moved:
            sampler, target = animation["samplers"][channel["sampler"]], channel["target"]
            values = between(keys[channel["sampler"]], self.array(sampler["output"]), sampler, times)
            found[self.names[target["node"]], target["path"]] = values
        return found

    def play(self, clip: dict[tuple[str, str], Array]) -> Self:
        """With a clip's tracks on the nodes of their names."""
        self.tracks = clip
        self.__dict__.pop("worlds", None)
        return self

    @cached_property
    def worlds(self) -> Array:
        """Matrices (T, N, 4, 4) of all nodes in the world."""
        tracks = getattr(self, "tracks", {})
        frames = max((len(track) for track in tracks.values()), default=1)
        found: dict[int, Array] = {}

        def world(node: int) -> Array:
            if node not in found:
                own, name = self.document["nodes"][node], self.names[node]
                if "matrix" in own and not any(moved == name for moved, _ in tracks):
                    local = np.tile(np.array(own["matrix"], float).reshape(4, 4).T, (frames, 1, 1))
                else:
                    rest = {"translation": [0.0, 0, 0], "rotation": [0.0, 0, 0, 1], "scale": [1.0, 1, 1]} | own
                    parts = [
                        np.broadcast_to(tracks.get((name, path), rest[path]), (frames, len(rest[path])))
                        for path in ("translation", "rotation", "scale")
                    ]
                    local = matrix(*parts)
                found[node] = world(self.parents[node]) @ local if node in self.parents else local
            return found[node]

        return np.stack([world(node) for node in range(len(self.names))], axis=1)

    def places(self, *names: str) -> Array:
        """Positions (T, K, 3) of nodes called so."""
        return self.worlds[..., :3, 3][:, [self.names.index(name) for name in names]]

    def skin(self, node: int) -> Array:
        """Corners (T, P, 3) of the mesh of a node, as its skin moves them."""
        own = self.document["nodes"][node]
        skin = self.document["skins"][own["skin"]]
        bind = self.array(skin["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)
        moves = self.worlds[:, skin["joints"]] @ bind
        corners = []
        for primitive in self.document["meshes"][own["mesh"]]["primitives"]:
            given = {name: self.array(index) for name, index in primitive["attributes"].items() if name != "TANGENT"}
            given["WEIGHTS_0"] /= given["WEIGHTS_0"].sum(axis=1, keepdims=True)  # as engines do
            points = np.concatenate([given["POSITION"], np.ones((len(given["POSITION"]), 1))], axis=1)
            corner = np.zeros((len(moves), len(points), 3))
            for joint, weight in zip(given["JOINTS_0"].astype(int).T, given["WEIGHTS_0"].T, strict=True):
                corner += weight[:, None] * np.einsum("tpij,pj->tpi", moves[:, joint, :3], points)
            corners.append(corner)
        return np.concatenate(corners, axis=1)

    def skinned(self) -> list[int]:
        """The nodes with a mesh and a skin."""
        return [i for i, node in enumerate(self.document["nodes"]) if "skin" in node and "mesh" in node]
