"""Write motions for a character's own nodes: into its file, with mesh and materials, or as a clip without them.

The tracks are the nodes' own (:mod:`motet.formats.gltf_character`), so a clip also plays correctly by node names.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from motet.errors import FormatError, MotionError
from motet.files import File, place_of, write_whole
from motet.formats.glb import Buffer, animation, container, drawn, facts
from motet.formats.gltf import broken
from motet.formats.gltf_character import Nodes
from motet.formats.gltf_data import Gltf
from motet.motion.motion import Motion


def write_onto(file: File, clips: Mapping[str, Motion], nodes: Nodes) -> None:
    """Write a character's file with an animation for each named motion; the motions are on its skeleton.

    Everything else in the file is kept; its own animations follow the new ones, except those of the same names.
    FormatError for a character in several files, or a .vrm of one that is not a VRM avatar; MotionError for a motion
    without frames, OutputError if the file cannot be written.
    """
    gltf = nodes.gltf
    if place_of(file).suffix.lower() == ".vrm" and not gltf.humanoid():
        raise FormatError(gltf.path, "not a VRM avatar: write it to a .glb")
    with broken(gltf.path):
        buffer = Buffer(gltf.document, _binary(gltf))
        made = [_animation(buffer, name, motion, nodes) for name, motion in clips.items()]
        kept = [old for old in gltf.objects("animations") if old.get("name") not in clips]
        moved = {channel["target"]["node"] for each in made for channel in each["channels"]}
        all_nodes = [_turnable(gltf, i) if i in moved else node for i, node in enumerate(gltf.objects("nodes"))]
        others = gltf.objects("buffers")
        sizes = [{**(others[0] if others else {}), "byteLength": len(buffer.content)}, *others[1:]]
        document = {**gltf.document, "nodes": all_nodes, "animations": made + kept, **buffer.parts(), "buffers": sizes}
        content = container(document, bytes(buffer.content))
    write_whole(file, content)


def _binary(gltf: Gltf) -> bytes:
    """The binary part of a self-contained file."""
    buffers = gltf.objects("buffers")
    apart = [
        each["uri"] for each in (*buffers, *gltf.objects("images")) if not each.get("uri", "data:").startswith("data:")
    ]
    if apart or (buffers and "uri" in buffers[0]):
        raise FormatError(gltf.path, "parts of this character are in other files or text: export one .glb or .vrm")
    return gltf.buffers[0] if buffers else b""


def _turnable(gltf: Gltf, node: int) -> dict[str, Any]:
    """A node as animation requires it: with translation, rotation and scale instead of a matrix."""
    found = gltf.objects("nodes")[node]
    if "matrix" not in found:
        return found
    parts = zip(("translation", "rotation", "scale"), gltf.local(node), strict=True)
    return {key: value for key, value in found.items() if key != "matrix"} | {key: each.tolist() for key, each in parts}


def _animation(buffer: Buffer, name: str, motion: Motion, nodes: Nodes) -> dict[str, Any]:
    if not len(motion):
        raise MotionError("this motion has no frames, and glTF cannot hold an empty animation")
    return animation(buffer, name, motion, nodes.tracks(motion))


def write_clip(file: File, motion: Motion, nodes: Nodes) -> None:
    """Write a motion on a character's skeleton with its nodes, and a simple body instead of its mesh.

    MotionError and OutputError like :func:`write_onto`.
    """
    gltf, rest, buffer = nodes.gltf, nodes.rest, Buffer()
    kept = (*nodes.above(), *rest.nodes)
    at = {node: i for i, node in enumerate(kept)}
    made = _animation(buffer, "motion", motion, nodes)
    for channel in made["channels"]:
        channel["target"]["node"] = at[channel["target"]["node"]]
    bind = np.zeros((len(rest.nodes), 4, 4))
    bind[:, :3, :3], bind[:, :3, 3], bind[:, 3, 3] = rest.linear[list(rest.nodes)], rest.places[list(rest.nodes)], 1
    # glTF is column-major: the transpose is written
    skin = {
        "joints": [at[i] for i in rest.nodes],
        "inverseBindMatrices": buffer.add(np.linalg.inv(bind).swapaxes(1, 2)),
    }
    document = {
        "asset": {"version": "2.0", "generator": "motet", "extras": facts(motion, rest.skeleton)},
        "scene": 0,
        "scenes": [{"nodes": [0, len(kept)]}],
        "nodes": [*(_bare(gltf, node, at) for node in kept), {"name": "body", "mesh": 0, "skin": 0}],
        "animations": [made],
        "skins": [skin],
        **drawn(buffer, rest.skeleton),
        **buffer.parts(),
    }
    write_whole(file, container(document, bytes(buffer.content)))


def _bare(gltf: Gltf, node: int, at: Mapping[int, int]) -> dict[str, Any]:
    """A single node: its name, its rest pose, and its kept children."""
    found = _turnable(gltf, node)
    bare: dict[str, Any] = {key: found[key] for key in ("translation", "rotation", "scale") if key in found}
    kept = [at[child] for child in found.get("children", []) if child in at]
    children = {"children": kept} if kept else {}
    return {"name": gltf.name(node), **bare, **children}
