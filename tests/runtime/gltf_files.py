"""Small glTF files as tests make them: several clips, with a skin or without, and their joints by plain matrices."""

import json
import struct
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from motet.formats import glb
from motet.motion.kinematics import skeleton_of
from motet.motion.motion import Motion
from motet.motion.rotations import Array


def write_clips(path: Path, clips: Sequence[tuple[str, Motion]], skin: bool | Sequence[str] = True) -> Path:
    """A GLB of one figure with several named motions, and a skin of all its joints, or of those with ends of names."""
    buffer, skeleton = glb.Buffer(), skeleton_of(clips[0][1])
    document: dict[str, Any] = {"asset": {"version": "2.0"}, "nodes": glb.joint_nodes(skeleton)}
    document["animations"] = [
        glb.animation(buffer, name, motion, glb.joint_tracks(motion, skeleton)) for name, motion in clips
    ]
    ends = ("",) if skin is True else tuple(skin or ())
    joints = [i for i, name in enumerate(skeleton.names) if name.endswith(ends)]
    document |= {"skins": [{"joints": joints}]} if joints else {}
    document |= {"bufferViews": buffer.views, "accessors": buffer.accessors}
    return write_document(path, document, bytes(buffer.content))


def write_document(path: Path, document: Mapping[str, Any], binary: bytes) -> Path:
    path.write_bytes(glb.container({**document, "buffers": [{"byteLength": len(binary)}]}, binary))
    return path


def read_document(path: Path) -> tuple[dict[str, Any], bytes]:
    content = path.read_bytes()
    length = struct.unpack_from("<I", content, 12)[0]
    return json.loads(content[20 : 20 + length]), content[28 + length :]


def node_places(path: Path, clip: int, frames: int) -> dict[str, Array]:
    """Positions (frames, 3) of all nodes by their names at the keys of a clip, by products of 4x4 matrices.

    All tracks must be of floats and have ``frames`` keys.
    """
    document, binary = read_document(path)
    nodes = document["nodes"]
    parents = {child: parent for parent, node in enumerate(nodes) for child in node.get("children", [])}
    tracks = {}
    for channel in document["animations"][clip]["channels"]:
        accessor = document["accessors"][document["animations"][clip]["samplers"][channel["sampler"]]["output"]]
        start = document["bufferViews"][accessor["bufferView"]].get("byteOffset", 0)
        values = np.frombuffer(binary, "<f4", frames * int(accessor["type"][-1]), start).reshape(frames, -1)
        tracks[channel["target"]["node"], channel["target"]["path"]] = values

    def local(node: int, frame: int) -> Array:
        def part(name: str, rest: list[float]) -> Array:
            track = tracks.get((node, name))
            return np.array(nodes[node].get(name, rest) if track is None else track[frame], np.float64)

        x, y, z, w = part("rotation", [0, 0, 0, 1])
        turn = np.eye(3) + 2 * w * cross([x, y, z]) + 2 * cross([x, y, z]) @ cross([x, y, z])
        matrix = np.eye(4)
        matrix[:3, :3] = turn @ np.diag(part("scale", [1, 1, 1]))
        matrix[:3, 3] = part("translation", [0, 0, 0])
        return matrix

    def world(node: int, frame: int) -> Array:
        above = world(parents[node], frame) if node in parents else np.eye(4)
        found: Array = above @ local(node, frame)
        return found

    return {node["name"]: np.array([world(i, frame)[:3, 3] for frame in range(frames)]) for i, node in enumerate(nodes)}


def cross(vector: Sequence[float]) -> Array:
    """The matrix (3, 3) by which a vector is multiplied for its cross product."""
    x, y, z = vector
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]], np.float64)
