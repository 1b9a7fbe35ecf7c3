"""Writes a VRM 1.0 avatar to look at motions on: ``python tests/vrm_avatar.py avatar.vrm``.

A child of 1.3 m with a large head and short legs, in a T-pose, facing +z: a skin of capsules around bones whose nodes
have rest rotations of their own (y along the bone, as Blender makes them). The left is red, the right blue.
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motet.figures.humanoid.bones import PARENTS
from motet.formats.glb import INDICES, VERTICES, Buffer, container
from motet.motion.rotations import rotmat_to_quat, swing

Array = NDArray[np.float64]

TRUNK = {
    "hips": ((0.0, 0.62, 0.0), (0.0, 0.70, 0.0), 0.085),
    "spine": ((0.0, 0.70, 0.0), (0.0, 0.78, 0.0), 0.075),
    "chest": ((0.0, 0.78, 0.0), (0.0, 0.86, 0.0), 0.08),
    "upperChest": ((0.0, 0.86, 0.0), (0.0, 0.95, 0.0), 0.07),
    "neck": ((0.0, 0.97, 0.0), (0.0, 1.02, 0.0), 0.03),
    "head": ((0.0, 1.02, 0.0), (0.0, 1.12, 0.0), 0.03),
}
"""Bone -> where it starts and ends in the T-pose, and its radius, all in metres."""

LEFT = {
    "Shoulder": ((0.03, 0.94, 0.0), (0.10, 0.95, 0.0), 0.035),
    "UpperArm": ((0.10, 0.95, 0.0), (0.27, 0.95, 0.0), 0.033),
    "LowerArm": ((0.27, 0.95, 0.0), (0.42, 0.95, 0.0), 0.028),
    "Hand": ((0.42, 0.95, 0.0), (0.51, 0.95, 0.0), 0.03),
    "UpperLeg": ((0.07, 0.59, 0.0), (0.075, 0.34, 0.01), 0.055),
    "LowerLeg": ((0.075, 0.34, 0.01), (0.075, 0.07, 0.0), 0.042),
    "Foot": ((0.075, 0.07, 0.0), (0.075, 0.03, 0.10), 0.033),
    "Toes": ((0.075, 0.03, 0.10), (0.075, 0.03, 0.13), 0.03),
}
"""The same for the left side, which the right one mirrors."""

MORE = (
    ("head", (0.0, 1.13, 0.01), (0.0, 1.16, 0.01), 0.115, "skull"),
    ("head", (0.0, 1.11, 0.12), (0.0, 1.11, 0.16), 0.018, "nose"),
    ("head", (0.045, 1.16, 0.105), (0.045, 1.17, 0.105), 0.017, "eye"),
    ("head", (-0.045, 1.16, 0.105), (-0.045, 1.17, 0.105), 0.017, "eye"),
    ("leftFoot", (0.075, 0.033, -0.03), (0.075, 0.033, 0.06), 0.033, "leftHeel"),
    ("rightFoot", (-0.075, 0.033, -0.03), (-0.075, 0.033, 0.06), 0.033, "rightHeel"),
)
"""What else hangs on bones: bone, start, end, radius and a name that tells the colour."""

AROUND = 16
"""Corners of a capsule around its axis."""

SLOPES = np.radians([-90, -70, -45, -20, 0, 0, 0, 0, 0, 20, 45, 70, 90])[:, None]
PARTS = np.array([0, 0, 0, 0, 0, 0.25, 0.5, 0.75, 1, 1, 1, 1, 1])[:, None]
"""Of each row of corners the slope outwards, and how far along the axis it is, from 0 to 1."""


def bones() -> dict[str, tuple[Array, Array, float]]:
    """Bone -> start (3,), end (3,) and radius in metres, each after its parent."""
    sides = {
        side + part: ((sign * a, b, c), (sign * x, y, z), radius)
        for side, sign in (("left", 1), ("right", -1))
        for part, ((a, b, c), (x, y, z), radius) in LEFT.items()
    }
    return {name: (np.array(start), np.array(end), r) for name, (start, end, r) in (TRUNK | sides).items()}


def capsule(start: Array, end: Array, radius: float) -> tuple[Array, Array, Array]:
    """Corners and normals (N, 3) of a capsule, and how far along it (N,) each corner is, from 0 to 1."""
    turn = swing(np.array([0.0, 1.0, 0.0]), end - start)
    around = np.arange(AROUND) * 2 * np.pi / AROUND
    outward = (np.cos(SLOPES) * np.cos(around), np.sin(SLOPES) + 0 * around, np.cos(SLOPES) * np.sin(around))
    normals, parts = np.stack(outward, axis=-1) @ turn.T, PARTS + 0 * around
    corners = start + parts[..., None] * (end - start) + radius * normals
    return corners.reshape(-1, 3), normals.reshape(-1, 3), parts.reshape(-1)


def triangles() -> NDArray[np.int64]:
    """Corners of a capsule's triangles, counterclockwise from outside."""
    row, column = np.meshgrid(np.arange(len(SLOPES) - 1), np.arange(AROUND), indexing="ij")
    here, right = row * AROUND + column, row * AROUND + (column + 1) % AROUND
    return np.stack([here, here + AROUND, right, right, here + AROUND, right + AROUND], axis=-1).reshape(-1)


def colour(name: str) -> tuple[float, float, float]:
    """Red for the left, blue for the right, orange for the face, grey for the trunk: linear RGB."""
    named = {
        "left": (0.6, 0.05, 0.05),
        "right": (0.05, 0.1, 0.6),
        "nose": (0.8, 0.25, 0.02),
        "eye": (0.02, 0.02, 0.02),
    }
    return next((rgb for start, rgb in named.items() if name.startswith(start)), (0.4, 0.4, 0.4))


def skin(buffer: Buffer) -> dict[str, Any]:
    """The mesh's primitive: near its start a bone's capsule moves half with its parent, so that joints stay closed."""
    names = list(bones())
    parts = [(name, *bones()[name], name) for name in names]
    parts += [(bone, np.array(start), np.array(end), radius, name) for bone, start, end, radius, name in MORE]
    corners, normals, joints, weights, colours = [], [], [], [], []
    for bone, start, end, radius, name in parts:
        places, outward, part = capsule(start, end, radius)
        own = np.clip(0.5 + 2 * part, 0, 1) if bone == name and bone in PARENTS else np.ones(len(part))
        joints.append(np.tile([names.index(bone), names.index(PARENTS.get(name, bone)), 0, 0], (len(part), 1)))
        weights.append(np.stack([own, 1 - own, 0 * own, 0 * own], axis=-1))
        corners.append(places)
        normals.append(outward)
        colours.append(np.tile(colour(name), (len(part), 1)))
    faces = triangles() + AROUND * len(SLOPES) * np.arange(len(parts))[:, None]
    attributes = {
        "POSITION": buffer.add(np.concatenate(corners), target=VERTICES, bounded=True),
        "NORMAL": buffer.add(np.concatenate(normals), target=VERTICES),
        "COLOR_0": buffer.add(np.concatenate(colours), target=VERTICES),
        "JOINTS_0": buffer.add(np.where(np.concatenate(weights) > 0, np.concatenate(joints), 0), "<u2", VERTICES),
        "WEIGHTS_0": buffer.add(np.concatenate(weights), target=VERTICES),
    }
    return {"attributes": attributes, "indices": buffer.add(faces.reshape(-1), "<u4", INDICES), "material": 0}


def nodes(turns: dict[str, Array]) -> list[dict[str, Any]]:
    """The bones' nodes, whose rest rotations in the world are ``turns`` (3, 3)."""
    names, found = list(bones()), []
    for name, (start, _, _) in bones().items():
        parent = PARENTS.get(name)
        above, origin = (turns[parent], bones()[parent][0]) if parent else (np.eye(3), np.zeros(3))
        node = {"name": f"J_{name}", "translation": (above.T @ (start - origin)).tolist()}
        node["rotation"] = rotmat_to_quat(above.T @ turns[name]).tolist()
        children = [names.index(child) for child in names if PARENTS.get(child) == name]
        found.append(node | ({"children": children} if children else {}))
    return found


def avatar() -> bytes:
    """The file's content."""
    buffer, names = Buffer(), list(bones())
    turns = {name: swing(np.array([0.0, 1.0, 0.0]), end - start) for name, (start, end, _) in bones().items()}
    inverse = np.tile(np.eye(4), (len(names), 1, 1))
    for place, name in enumerate(names):  # glTF keeps columns: what is written is the transpose
        inverse[place, :3, :3] = turns[name]
        inverse[place, 3, :3] = -bones()[name][0] @ turns[name]
    meta = {"name": "Capsules", "authors": ["motet"], "licenseUrl": "https://vrm.dev/licenses/1.0/"}
    humanoid = {"humanBones": {name: {"node": place} for place, name in enumerate(names)}}
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0, len(names)]}],
        "nodes": [*nodes(turns), {"name": "body", "mesh": 0, "skin": 0}],
        "skins": [{"joints": list(range(len(names))), "inverseBindMatrices": buffer.add(inverse)}],
        "meshes": [{"primitives": [skin(buffer)]}],
        "materials": [{"pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.7}}],
        "extensionsUsed": ["VRMC_vrm"],
        "extensions": {"VRMC_vrm": {"specVersion": "1.0", "meta": meta, "humanoid": humanoid}},
        "bufferViews": buffer.views,
        "accessors": buffer.accessors,
        "buffers": [{"byteLength": len(buffer.content)}],
    }
    return container(document, bytes(buffer.content))


if __name__ == "__main__":
    Path(sys.argv[1]).write_bytes(avatar())
