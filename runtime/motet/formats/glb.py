"""Write a motion as binary glTF 2.0: one node per joint, an animation, and a simple body skinned to the joints.

Axes are glTF's and motet's own: y up, right-handed. Lengths are metres if the skeleton states its unit or a human's
legs suggest it, else its own unit. Times are seconds from 0. A joint is animated if it turns or moves, the root always.
The rest pose of the file is the skeleton's (every angle 0). The body makes the file visible in any viewer and puts the
joints in a skin, so that viewers and Blender recognize them as bones.

VRM Animation (.vrma) is a GLB whose nodes are the humanoid in a VRM T-pose, with the extension VRMC_vrm_animation 1.0.
Every bone has a rotation, only the hips a translation; players adapt both to their avatar's rest pose and scale the
path by its hip height. The fingers form a relaxed hand.
"""

import json
import struct
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motet.draw.body import INKS, human_mesh
from motet.draw.figure import Body
from motet.draw.mesh import Mesh
from motet.draw.skinned import mesh_of_bones
from motet.errors import MotionError
from motet.figures.humanoid import (
    BONES,
    FINGERS,
    HUMANOID,
    SIDES,
    grounded,
    on_humanoid,
    relaxed,
    sided,
    with_unit_by_legs,
)
from motet.files import File, Json, write_whole
from motet.formats.gltf_data import COMPONENTS
from motet.motion.kinematics import local_rotations, local_translations, skeleton_of
from motet.motion.motion import Motion
from motet.motion.rotations import Array, rotmat_to_quat
from motet.motion.skeleton import Joint, Skeleton

VERTICES = 34962
INDICES = 34963
"""glTF's buffer targets."""

CODES = {dtype: code for code, dtype in COMPONENTS.items()}
ELEMENT_TYPES = {(): "SCALAR", (3,): "VEC3", (4,): "VEC4", (4, 4): "MAT4"}
"""glTF's numbers for dtypes, and its names for the shapes of an accessor's elements."""

Track = tuple[int, str, Array]
"""A node's index, "rotation" or "translation", and quaternions (T, 4) or positions (T, 3); T = 1 if constant."""


class Buffer:
    """The binary part of a file: arrays, each an accessor with its own view, after those of ``document``."""

    def __init__(self, document: Json | None = None, content: bytes = b"") -> None:
        document = document or {}
        self.content = bytearray(content + bytes(-len(content) % 4))
        self.views: list[Json] = list(document.get("bufferViews", []))
        self.accessors: list[Json] = list(document.get("accessors", []))

    def add(
        self,
        values: NDArray[Any],
        dtype: str = "<f4",
        target: int = 0,
        bounded: bool = False,
        normalized: bool = False,
    ) -> int:
        """Index of the new accessor of values (N, ...), for a use in a mesh or none.

        bounded: with their minimum and maximum, required for times and corners. normalized: whole numbers from 0 to
        the largest stand for 0 to 1.
        """
        # each array gets a view of its own, filled up to four bytes
        content = np.ascontiguousarray(values, dtype=dtype)
        if not np.isfinite(content).all():
            raise MotionError("values of this motion exceed glTF's 32-bit numbers")
        view = {"buffer": 0, "byteOffset": len(self.content), "byteLength": content.nbytes}
        self.views.append(view | ({"target": target} if target else {}))
        self.content += content.tobytes() + bytes(-content.nbytes % 4)
        accessor = {
            "bufferView": len(self.views) - 1,
            "componentType": CODES[dtype],
            "count": len(content),
            "type": ELEMENT_TYPES[content.shape[1:]],
        }
        if normalized:
            accessor["normalized"] = True
        if bounded:
            rows = content.reshape(len(content), -1)
            accessor |= {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()}
        self.accessors.append(accessor)
        return len(self.accessors) - 1

    def parts(self) -> Json:
        """The document's entries for its binary part."""
        length = len(self.content)
        return {"bufferViews": self.views, "accessors": self.accessors, "buffers": [{"byteLength": length}]}


def write(file: File, motion: Motion) -> None:
    """Write a motion; MotionError for one without skeleton or frames, OutputError if the file cannot be written."""
    # glTF's unit is the metre; a skeleton whose unit is not known keeps its own
    if skeleton_of(motion).metres_per_unit is None:
        motion = with_unit_by_legs(motion)
    if skeleton_of(motion).metres_per_unit is not None:
        motion = motion.scaled(1.0)
    buffer = Buffer()
    skeleton = skeleton_of(motion)
    made = animation(buffer, "motion", motion, joint_tracks(motion, skeleton))
    inverse = np.tile(np.eye(4), (len(skeleton.joints), 1, 1))
    inverse[:, :3, 3] = -_rest(skeleton)
    skin = {"joints": list(range(len(skeleton.joints))), "skeleton": 0}
    document = with_body(buffer, motion, skeleton, joint_nodes(skeleton), made, skin, inverse)
    write_whole(file, container(document, buffer.content))


def with_body(
    buffer: Buffer,
    motion: Motion,
    skeleton: Skeleton,
    nodes: Sequence[Json],
    made: Json,
    skin: Json,
    inverse_bind: Array,
) -> Json:
    """The document of an animation of nodes, with a body that a skin with matrices (J, 4, 4) moves."""
    unit = "m" if skeleton.metres_per_unit else "unknown"
    facts = {"fps": motion.fps, "frames": len(motion), "length_unit": unit}
    matrices = buffer.add(np.swapaxes(inverse_bind, 1, 2))  # glTF keeps columns
    return {
        "asset": {"version": "2.0", "generator": "motet", "extras": facts},
        "scene": 0,
        "scenes": [{"nodes": [0, len(nodes)]}],
        "nodes": [*nodes, {"name": "body", "mesh": 0, "skin": 0}],
        "animations": [made],
        "skins": [{**skin, "inverseBindMatrices": matrices}],
        "meshes": [{"name": "body", "primitives": [_body(buffer, skeleton)]}],
        "materials": [{"name": "body", "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.6}}],
        **buffer.parts(),
    }


def container(document: Json, content: bytes | bytearray) -> bytes:
    """A GLB file of a JSON object and the binary part."""
    # both chunks end at a multiple of four bytes
    text = json.dumps(document, separators=(",", ":"), allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sII", b"glTF", 2, 12 + 8 + len(text) + 8 + len(content))
    return head + struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(content), b"BIN\0") + content


def joint_nodes(skeleton: Skeleton) -> list[Json]:
    """A node for each joint, at rest, in their order."""
    nodes = []
    for joint, children in zip(skeleton.joints, skeleton.children, strict=True):
        nodes.append({"name": joint.name, "translation": list(joint.offset)})
        if children:
            nodes[-1]["children"] = list(children)
    return nodes


def joint_tracks(motion: Motion, skeleton: Skeleton) -> Iterator[Track]:
    """The tracks of the joints' nodes, which come first: of those that turn or move, and always of the root."""
    turns = rotmat_to_quat(local_rotations(motion))
    moves = local_translations(motion)
    for i, joint in enumerate(skeleton.joints):
        if i == 0 or np.any(turns[:, i] != [0, 0, 0, 1]):
            yield i, "rotation", turns[:, i]
        if i == 0 or np.any(moves[:, i] != joint.offset):
            yield i, "translation", moves[:, i]


def animation(buffer: Buffer, name: str, motion: Motion, tracks: Iterable[Track]) -> Json:
    """The animation of tracks from the motion's first frame; its arrays go into the buffer."""
    if not len(motion):
        raise MotionError("this motion has no frames, and glTF cannot hold an empty animation")
    # tracks of equally many frames share their times
    times = {len(motion): buffer.add(np.arange(len(motion)) / motion.fps, bounded=True)}
    samplers: list[Json] = []
    channels = []
    for node, path, values in tracks:
        channels.append({"sampler": len(samplers), "target": {"node": node, "path": path}})
        if len(values) not in times:
            times[len(values)] = buffer.add(np.arange(len(values)) / motion.fps, bounded=True)
        output = buffer.add(_continuous(values) if path == "rotation" else values)
        samplers.append({"input": times[len(values)], "output": output, "interpolation": "LINEAR"})
    return {"name": name, "channels": channels, "samplers": samplers}


def _continuous(quats: Array) -> Array:
    """Quaternions (T, 4) with signs that keep each near its predecessor."""
    is_flipped = np.sum(quats[1:] * quats[:-1], axis=-1, keepdims=True) < 0
    signs = np.cumprod(np.where(is_flipped, -1.0, 1.0), axis=0)
    return np.concatenate([quats[:1], quats[1:] * signs])


def _rest(skeleton: Skeleton) -> Array:
    """Positions of the joints (J, 3) in the file's rest pose: the skeleton's, with the root at its offset."""
    rest: Array = skeleton.rest_positions + skeleton.offsets[0]
    return rest


def _body(buffer: Buffer, skeleton: Skeleton) -> Json:
    """The primitive of the body."""
    mesh = _mesh(skeleton)
    # four joints for each corner, and colours from sRGB to linear
    missing = ((0, 0), (0, 4 - mesh.joints.shape[1]))
    colours = np.pad((INKS[mesh.parts] / 255) ** 2.2, ((0, 0), (0, 1)), constant_values=1.0)
    attributes = {
        "POSITION": buffer.add(mesh.places, target=VERTICES, bounded=True),
        "NORMAL": buffer.add(mesh.normals, target=VERTICES),
        "COLOR_0": buffer.add(np.round(255 * colours), "<u1", VERTICES, normalized=True),
        "JOINTS_0": buffer.add(np.pad(mesh.joints, missing), "<u2", VERTICES),
        "WEIGHTS_0": buffer.add(np.pad(mesh.shares, missing), "<u1", VERTICES, normalized=True),
    }
    return {"attributes": attributes, "indices": buffer.add(mesh.triangles.reshape(-1), "<u4", INDICES), "material": 0}


def _mesh(skeleton: Skeleton) -> Mesh:
    """The body on a skeleton at rest: on the humanoid the player's, on others round bones."""
    if skeleton == HUMANOID:
        return human_mesh()
    body = Body(skeleton)
    mesh = mesh_of_bones(body, body.points(_rest(skeleton) / body.height), skeleton.offsets[None])
    return replace(mesh, places=mesh.places * body.height)


def _with_fingers() -> Skeleton:
    """The humanoid with VRM's fingers after its joints."""
    # fingers hang on the hands, mirrored for the right one
    joints = {joint.name: joint for joint in HUMANOID.joints}
    for side, sign in SIDES:
        for part, (parent, (x, y, z), order) in FINGERS.items():
            above = list(joints).index(sided(side, parent))
            joints[sided(side, part)] = Joint(sided(side, part), above, (sign * x, y, z), order)
    return Skeleton(tuple(joints.values()), metres_per_unit=1.0)


VRMA_SKELETON = _with_fingers()


def write_vrma(file: File, motion: Motion) -> None:
    """Write a VRM animation; a motion of another skeleton is retargeted to the humanoid first.

    MotionError for a motion without frames or of a figure that is not human, OutputError if it cannot be written.
    """
    if not len(motion):
        raise MotionError("this motion has no frames, and a VRM animation cannot be empty")
    motion = grounded(on_humanoid(motion))
    buffer = Buffer()
    extension = "VRMC_vrm_animation"
    fingers = VRMA_SKELETON.names[len(HUMANOID.names) :]
    bones = {bone: {"node": VRMA_SKELETON.index(bone)} for bone in (*BONES, *fingers)}
    document: Json = {
        "asset": {"version": "2.0", "generator": "motet"},
        "extensionsUsed": [extension],
        "extensions": {extension: {"specVersion": "1.0", "humanoid": {"humanBones": bones}}},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": joint_nodes(VRMA_SKELETON),
        "animations": [animation(buffer, "motion", motion, (*joint_tracks(motion, HUMANOID), *_hand_tracks()))],
        **buffer.parts(),
    }
    write_whole(file, container(document, buffer.content))


def _hand_tracks() -> Iterator[Track]:
    """The tracks of the fingers, relaxed and still."""
    joints = len(VRMA_SKELETON.names)
    still = np.broadcast_to(np.eye(3), (joints, 3, 3))
    turned = relaxed(VRMA_SKELETON, still, VRMA_SKELETON.places)
    for joint in range(len(HUMANOID.names), joints):
        yield joint, "rotation", rotmat_to_quat(turned[joint : joint + 1])
