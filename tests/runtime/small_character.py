"""Small characters like those of Mixamo: hips below nodes with a scale or a turn, a mesh with soles, clips."""

import json
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from gltf_player import Array, matrix

from motet.figures.humanoid.bones import MIXAMO, T_POSE

QUARTER = 0.5**0.5

TEXTURE = b"\x89PNG of 13 b."

SOLES = {"Foot": ((0.0, -0.11, -0.06), (0.0, -0.11, 0.1)), "ToeBase": ((0.0, -0.05, 0.06),)}
"""Corners below the joints of a character of the humanoid's size: its soles are 3 cm thicker than the humanoid's."""

Node = dict[str, Any]


def local(node: Node) -> Array:
    """The matrix (4, 4) of a node."""
    if "matrix" in node:
        return np.array(node["matrix"], float).reshape(4, 4).T
    rest = {"translation": [0, 0, 0], "rotation": [0, 0, 0, 1], "scale": [1, 1, 1]} | node
    return matrix(*(np.array([rest[path]], float) for path in ("translation", "rotation", "scale")))[0]


def joints(above: Array, size: float, backwards: bool, matrices: bool) -> tuple[list[Node], Array]:
    """A node for each joint, with a rest rotation of its own, and their matrices (J, 4, 4) in the world."""
    random = np.random.default_rng(3)
    turn = np.diag([-1.0, 1, -1]) if backwards else np.eye(3)
    scale = np.linalg.det(above[:3, :3]) ** (1 / 3)
    worlds = matrix(size * T_POSE @ turn, random.normal(size=(len(T_POSE), 4)), np.full((len(T_POSE), 3), scale))
    nodes = []
    for i, joint in enumerate(MIXAMO.joints):
        own = np.linalg.inv(worlds[joint.parent] if i else above) @ worlds[i]
        parts = {"translation": own[:3, 3].tolist(), "rotation": quaternion(own[:3, :3])}
        nodes.append({"name": joint.name} | ({"matrix": own.T.reshape(-1).tolist()} if matrices else parts))
    return nodes, worlds


def quaternion(turn: Array) -> list[float]:
    """The quaternion of a rotation (3, 3): the vector that it keeps, from the largest of four sums."""
    x, y, z = turn
    sums = np.array([x[0] - y[1] - z[2], y[1] - x[0] - z[2], z[2] - x[0] - y[1], x[0] + y[1] + z[2]])
    table = np.array(
        [
            [1 + sums[0], x[1] + y[0], x[2] + z[0], z[1] - y[2]],
            [x[1] + y[0], 1 + sums[1], y[2] + z[1], x[2] - z[0]],
            [x[2] + z[0], y[2] + z[1], 1 + sums[2], y[0] - x[1]],
            [z[1] - y[2], x[2] - z[0], y[0] - x[1], 1 + sums[3]],
        ]
    )
    largest = table[int(np.argmax(sums))]
    found: list[float] = (largest / np.linalg.norm(largest)).tolist()
    return found


def soles(size: float, backwards: bool) -> tuple[Array, Array]:
    """Corners (P, 3) of the mesh in the world at rest, and the joint of each."""
    turn = np.diag([-1.0, 1, -1]) if backwards else np.eye(3)
    parts = [
        (T_POSE[i] + np.array(corner), i)
        for i, joint in enumerate(MIXAMO.joints)
        for corner in SOLES.get(joint.name.removeprefix("mixamorig:").removeprefix("Left").removeprefix("Right"), ())
    ]
    return size * np.array([place for place, _ in parts]) @ turn, np.array([joint for _, joint in parts])


def character(
    path: Path,
    above: Sequence[Node] = (),
    size: float = 1.0,
    *,
    backwards: bool = False,
    meshed: bool = True,
    matrices: bool = False,
) -> Path:
    """Write a GLB: ``above`` are the nodes that its hips hang below, from the top.

    backwards: it faces -z at rest; meshed: it has a mesh; matrices: its joints rest by matrices.
    """
    base = np.linalg.multi_dot([np.eye(4), np.eye(4), *map(local, above)])
    bones, worlds = joints(base, size, backwards, matrices)
    start = len(above)
    nodes = [{"name": f"above{i}", "children": [i + 1], **node} for i, node in enumerate(above)] + bones
    for i, joint in enumerate(MIXAMO.joints[1:], start=1):
        nodes[start + joint.parent].setdefault("children", []).append(start + i)
    nodes.append({"name": "body", "mesh": 0, "skin": 0, "extras": {"kept": True}} if meshed else {"name": "empty"})
    corners, owners = soles(size, backwards)
    bind = np.linalg.inv(worlds).transpose(0, 2, 1)
    arrays = (
        (corners.astype("<f4"), "VEC3", 5126),
        (np.stack([owners, 0 * owners, 0 * owners, 0 * owners], 1).astype("u1"), "VEC4", 5121),
        (np.tile([200, 0, 0, 0], (len(owners), 1)).astype("u1"), "VEC4", 5121),
        (bind.reshape(-1, 16).astype("<f4"), "MAT4", 5126),
        (np.array([0.0, 1.0], "<f4"), "SCALAR", 5126),
        (np.array([[0.0, 0, 0], [0, size, 0]], "<f4"), "VEC3", 5126),
    )
    binary, views, accessors = bytearray(), [], []
    for array, kind, component in arrays:
        views.append({"buffer": 0, "byteOffset": len(binary), "byteLength": array.nbytes})
        accessors.append({"bufferView": len(views) - 1, "componentType": component, "count": len(array), "type": kind})
        binary += array.tobytes()
    accessors[2]["normalized"] = True
    views.append({"buffer": 0, "byteOffset": len(binary), "byteLength": len(TEXTURE)})
    binary += TEXTURE  # of a length that is no multiple of four
    old = {"channels": [{"sampler": 0, "target": {"node": start, "path": "translation"}}], "name": "old"}
    document = {
        "asset": {"version": "2.0", "generator": "someone else"},
        "extensionsUsed": ["VENDOR_unknown"],
        "extensions": {"VENDOR_unknown": {"nodes": [1, 2]}},
        "scene": 0,
        "scenes": [{"nodes": [0, len(nodes) - 1]}],
        "nodes": nodes,
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "JOINTS_0": 1, "WEIGHTS_0": 2}, "material": 0}]}],
        "skins": [{"joints": list(range(start, start + len(bones))), "inverseBindMatrices": 3}],
        "materials": [{"name": "skin", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0}],
        "images": [{"bufferView": len(views) - 1, "mimeType": "image/png"}],
        "animations": [{**old, "samplers": [{"input": 4, "output": 5}]}],
        "bufferViews": views,
        "accessors": accessors,
        "buffers": [{"byteLength": len(binary)}],
    }
    path.write_bytes(packed(document, bytes(binary)))
    return path


def packed(document: dict[str, Any], binary: bytes) -> bytes:
    """A GLB file."""
    text = json.dumps(document).encode()
    text, binary = text + b" " * (-len(text) % 4), binary + bytes(-len(binary) % 4)
    head = struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(binary))
    return head + struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
