"""Write a motion as binary glTF 2.0: one node per joint, an animation, and a simple body skinned to the joints.

Axes are glTF's and motet's own: y up, right-handed. Lengths are metres if the skeleton states its unit, else its own
unit. Times are seconds from 0. A joint is animated if it turns or moves, the root always. The rest pose of the file is
the skeleton's (every angle 0). The body makes the file visible in any viewer and puts the joints in a skin, so that
viewers and Blender recognize them as bones.
"""

import json
import struct
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motet.draw.body import COLOURS, Body, Bone
from motet.errors import MotionError
from motet.files import File, write_whole
from motet.motion.kinematics import local_rotations, local_translations, skeleton_of
from motet.motion.motion import Motion
from motet.motion.rotations import Array, rotmat_to_quat
from motet.motion.skeleton import Skeleton

FLOAT, UINT8, UINT16, UINT32 = 5126, 5121, 5123, 5125
"""glTF's component types."""

GLB_TYPES: dict[tuple[int, ...], str] = {(): "SCALAR", (3,): "VEC3", (4,): "VEC4", (4, 4): "MAT4"}

VERTICES, INDICES = 34962, 34963
"""glTF's buffer targets."""

LIMB_CORNERS = 10
"""Corners around a bone of the body."""


class Buffer:
    """The binary part of a file: arrays, each an accessor with its own view, after those of ``document``."""

    def __init__(self, document: Mapping[str, Any] | None = None, content: bytes = b"") -> None:
        document = document or {}
        self.content = bytearray(content + bytes(-len(content) % 4))
        self.views: list[dict[str, Any]] = list(document.get("bufferViews", []))
        self.accessors: list[dict[str, Any]] = list(document.get("accessors", []))

    def add(self, values: NDArray[Any], kind: int = FLOAT, target: int = 0, **more: Any) -> int:
        """Index of the new accessor of values (N, ...) of a component type, for a use in a mesh or none."""
        types = {FLOAT: "<f4", UINT8: "<u1", UINT16: "<u2", UINT32: "<u4"}
        content = np.ascontiguousarray(values, dtype=types[kind])
        if not np.isfinite(content).all():
            raise MotionError("values of this motion exceed glTF's 32-bit numbers")
        view = {"buffer": 0, "byteOffset": len(self.content), "byteLength": content.nbytes}
        self.views.append(view | ({"target": target} if target else {}))
        self.content += content.tobytes() + bytes(-content.nbytes % 4)
        shape = GLB_TYPES[content.shape[1:]]
        accessor = {"bufferView": len(self.views) - 1, "componentType": kind, "count": len(content), "type": shape}
        self.accessors.append(accessor | more)
        return len(self.accessors) - 1

    def add_bounded(self, values: NDArray[Any], target: int = 0) -> int:
        """The same for floats (N, ...) with their minimum and maximum, required for times and corners."""
        single = np.asarray(values, dtype="<f4").reshape(len(values), -1)
        least, greatest = single.min(axis=0).tolist(), single.max(axis=0).tolist()
        return self.add(values, FLOAT, target, min=least, max=greatest)

    def parts(self) -> dict[str, Any]:
        """The document's entries for its binary part."""
        return {
            "bufferViews": self.views,
            "accessors": self.accessors,
            "buffers": [{"byteLength": len(self.content)}],
        }


def write(file: File, motion: Motion) -> None:
    """Write a motion; MotionError for one without skeleton or frames, OutputError if the file cannot be written."""
    skeleton = skeleton_of(motion)
    if not len(motion):
        raise MotionError("this motion has no frames, and glTF cannot hold an empty animation")
    if skeleton.metres_per_unit is not None:
        motion = motion.scaled(1.0)
        skeleton = skeleton_of(motion)
    buffer = Buffer()
    joints = len(skeleton.joints)
    document = {
        "asset": {"version": "2.0", "generator": "motet", "extras": facts(motion, skeleton)},
        "scene": 0,
        "scenes": [{"nodes": [0, joints]}],
        "nodes": [*joint_nodes(skeleton), {"name": "body", "mesh": 0, "skin": 0}],
        "animations": [animation(buffer, "motion", motion, joint_tracks(motion, skeleton))],
        "skins": [_skin(buffer, skeleton)],
        **drawn(buffer, skeleton),
        **buffer.parts(),
    }
    write_whole(file, container(document, bytes(buffer.content)))


def drawn(buffer: Buffer, skeleton: Skeleton) -> dict[str, Any]:
    """The mesh of a body, for the file's first skin, and its material."""
    return {
        "meshes": [{"name": "body", "primitives": [_body(buffer, skeleton)]}],
        "materials": [{"name": "body", "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.6}}],
    }


def facts(motion: Motion, skeleton: Skeleton) -> dict[str, Any]:
    """Properties of the motion that glTF has no field for."""
    return {"fps": motion.fps, "frames": len(motion), "length_unit": "m" if skeleton.metres_per_unit else "unknown"}


def container(document: dict[str, Any], content: bytes) -> bytes:
    """A GLB file of a JSON object and the binary part."""
    text = json.dumps(document, separators=(",", ":"), allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sII", b"glTF", 2, 12 + 8 + len(text) + 8 + len(content))
    return head + struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(content), b"BIN\0") + content


def joint_nodes(skeleton: Skeleton) -> list[dict[str, Any]]:
    """A node for each joint, at rest, in their order."""
    nodes: list[dict[str, Any]] = []
    for joint, children in zip(skeleton.joints, skeleton.children, strict=True):
        node: dict[str, Any] = {"name": joint.name, "translation": list(joint.offset)}
        nodes.append(node | ({"children": list(children)} if children else {}))
    return nodes


Track = tuple[int, str, Array]
"""A node's index, "rotation" or "translation", and quaternions (T, 4) or positions (T, 3); T = 1 if constant."""


def joint_tracks(motion: Motion, skeleton: Skeleton) -> Iterator[Track]:
    """The tracks of the joints' nodes, which come first: of those that turn or move, and always of the root."""
    turns, moves = rotmat_to_quat(local_rotations(motion)), local_translations(motion)
    for i, joint in enumerate(skeleton.joints):
        tracks = {"rotation": (turns[:, i], [0, 0, 0, 1]), "translation": (moves[:, i], joint.offset)}
        yield from ((i, path, track) for path, (track, rest) in tracks.items() if i == 0 or np.any(track != rest))


def animation(buffer: Buffer, name: str, motion: Motion, tracks: Iterable[Track]) -> dict[str, Any]:
    """The animation of tracks from the motion's first frame; its arrays go into the buffer."""
    times = {len(motion): buffer.add_bounded(np.arange(len(motion)) / motion.fps)}
    samplers: list[dict[str, Any]] = []
    channels: list[dict[str, Any]] = []
    for node, path, track in tracks:
        channels.append({"sampler": len(samplers), "target": {"node": node, "path": path}})
        values = _continuous(track) if path == "rotation" else track
        if len(track) not in times:
            times[len(track)] = buffer.add_bounded(np.arange(len(track)) / motion.fps)
        samplers.append({"input": times[len(track)], "output": buffer.add(values), "interpolation": "LINEAR"})
    return {"name": name, "channels": channels, "samplers": samplers}


def _continuous(quats: Array) -> Array:
    """The same rotations (T, ..., 4) with signs that keep each quaternion near its predecessor."""
    flips = np.sum(quats[1:] * quats[:-1], axis=-1, keepdims=True) < 0
    signs = np.cumprod(np.where(flips, -1.0, 1.0), axis=0)
    return np.concatenate([quats[:1], quats[1:] * signs])


def _skin(buffer: Buffer, skeleton: Skeleton) -> dict[str, Any]:
    inverse = np.tile(np.eye(4), (len(skeleton.joints), 1, 1))
    inverse[:, 3, :3] = -_rest(skeleton)  # glTF keeps columns, so the translation is the last row here
    return {"joints": list(range(len(skeleton.joints))), "skeleton": 0, "inverseBindMatrices": buffer.add(inverse)}


def _rest(skeleton: Skeleton) -> Array:
    """Positions of the joints (J, 3) in the file's rest pose: the skeleton's, with the root at its offset."""
    rest: Array = skeleton.rest_positions + skeleton.offsets[0]
    return rest


def _body(buffer: Buffer, skeleton: Skeleton) -> dict[str, Any]:
    """The primitive of the body: a tapered prism for each bone, its ends moving with the bone's carriers."""
    body = Body(skeleton)
    points = body.points(_rest(skeleton) / body.height)
    prisms = [_prism(bone, points[bone.start], points[bone.end]) for bone in body.bones]
    corners, normals = (np.concatenate(arrays) for arrays in zip(*prisms, strict=True))
    joints = np.zeros((len(corners), 4))
    joints[:, 0] = np.repeat([bone.carriers for bone in body.bones], LIMB_CORNERS + 1)
    colours = np.repeat([COLOURS[bone.side] for bone in body.bones], 2 * LIMB_CORNERS + 2, axis=0)
    triangles = _triangles() + (2 * LIMB_CORNERS + 2) * np.arange(len(body.bones))[:, None]
    attributes = {
        "POSITION": buffer.add_bounded(corners * body.height, VERTICES),
        "NORMAL": buffer.add(normals, FLOAT, VERTICES),
        "COLOR_0": buffer.add(_linear(colours), FLOAT, VERTICES),
        "JOINTS_0": buffer.add(joints, UINT16, VERTICES),
        "WEIGHTS_0": buffer.add(np.tile([1.0, 0, 0, 0], (len(corners), 1)), FLOAT, VERTICES),
    }
    return {"attributes": attributes, "indices": buffer.add(triangles.reshape(-1), UINT32, INDICES), "material": 0}


def _linear(colours: NDArray[Any]) -> Array:
    """sRGB colours (N, 3) of 0 to 255 as glTF's linear ones."""
    linear: Array = (colours / 255) ** 2.2
    return linear


def _prism(bone: Bone, start: Array, end: Array) -> tuple[Array, Array]:
    """Corners and normals (2 * LIMB_CORNERS + 2, 3): tip and ring at the start, ring and tip at the end."""
    axis = end - start
    length = float(np.linalg.norm(axis))
    axis = axis / length if length else np.array([0.0, 1.0, 0.0])
    side = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    side /= np.linalg.norm(side)
    angles = np.arange(LIMB_CORNERS)[:, None] * 2 * np.pi / LIMB_CORNERS
    ring = np.cos(angles) * side + np.sin(angles) * np.cross(axis, side)
    thick, thin = bone.start_radius, bone.end_radius
    corners = [start - 0.7 * thick * axis, *(start + thick * ring), *(end + thin * ring), end + 0.7 * thin * axis]
    return np.array(corners), np.array([-axis, *ring, *ring, axis])


def _triangles() -> NDArray[np.int64]:
    """Corners of the triangles of a prism, counterclockwise from outside."""
    now = np.arange(LIMB_CORNERS)
    after = (now + 1) % LIMB_CORNERS
    low, high, tip = now + 1, now + 1 + LIMB_CORNERS, 2 * LIMB_CORNERS + 1
    low_after, high_after = after + 1, after + 1 + LIMB_CORNERS
    cap, lid = np.stack([0 * now, low_after, low]), np.stack([0 * now + tip, high, high_after])
    wall = [np.stack([low, low_after, high]), np.stack([low_after, high_after, high])]
    return np.concatenate([part.T.reshape(-1) for part in (cap, *wall, lid)])
