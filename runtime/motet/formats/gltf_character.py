"""Characters of glTF and VRM files: their skeleton, and motions on it for the file's own nodes.

Nodes have their own rest poses, axes and scales, and so may the skeleton's ancestors: in every Mixamo export the hips
are below a node with scale .01. A track is in the frame of the node's parent, so these all affect it. Motions are
written into the character's file, with mesh and materials, or as a clip without them, which plays by node names.
"""

import base64
import logging
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from motet.errors import FormatError, quoted
from motet.figures.humanoid import BONES, REQUIRED, JointMap, check_map
from motet.files import File, Json, place_of, write_whole
from motet.formats import Character
from motet.formats.glb import Buffer, Track, animation, container, with_body
from motet.formats.gltf import figure_of, figures, likeliest, moved, skeleton_at
from motet.formats.gltf_data import GLTF_MAX_BYTES, Gltf, broken, parse, read_beside
from motet.formats.text import ContentError, naming
from motet.motion.kinematics import local_rotations, local_translations
from motet.motion.motion import Motion, rest_motion
from motet.motion.rotations import Array, Indices, product, quat_to_rotmat, rotated, rotmat_to_quat
from motet.motion.skeleton import Skeleton

log = logging.getLogger(__name__)

MAX_POINTS = 2_000_000
"""Points of a character's meshes, each where a node or a skin puts it; games' characters have up to 100,000."""

MAX_PRIMITIVES = 50_000
"""Primitives of the meshes of all nodes together."""


PICTURES = {b"\x89PNG": "image/png", b"\xff\xd8\xff": "image/jpeg", b"RIFF": "image/webp", b"\xabKTX": "image/ktx2"}
"""How the pictures of glTF begin, and their media types."""


Primitive = tuple[int, dict[str, int], int | None]
"""The node of a primitive of a mesh, its attributes, and its skin if it has one."""

Skinned = tuple[Array, Indices]
"""Points (P, 3) in the world at rest, and the joint (P,) of each, -1 for none."""


@dataclass(frozen=True)
class Nodes:
    """A character's file, and the node of each joint of its skeleton, whose rest pose is the nodes' pose, in metres.

    linear: the linear maps (N, 3, 3), with scales, of all nodes of the file, joints or not, in the world; places
    (N, 3): their positions.
    """

    gltf: Gltf
    joints: tuple[int, ...]
    skeleton: Skeleton
    linear: Array
    places: Array

    def tracks(self, motion: Motion) -> Iterator[Track]:
        """The tracks of a motion on the character's skeleton for the file's nodes.

        The root has both tracks, other joints only those in which they leave their rest by over 1e-6, in radians or
        heights. Exact for uniform or mirroring scales; under stretched parents the rotation is the nearest one.
        """
        if motion.skeleton and motion.skeleton.metres_per_unit != 1:
            motion = motion.scaled(1.0)
        # the motion in its own frames, of which each node needs its parent's
        rotations = local_rotations(motion)
        translations = local_translations(motion)
        for i, node in enumerate(self.joints):
            is_root = i == 0
            offset_changes = np.abs(translations[:, i] - self.skeleton.offsets[i]).max()
            if is_root or np.abs(rotations[:, i] - np.eye(3)).max() > 1e-6:
                yield node, "rotation", self._node_rotations(node, rotations[:, i])
            if is_root or offset_changes > 1e-6 * self.skeleton.height:
                yield node, "translation", self._node_translations(node, translations[:, i], is_root)

    def _node_rotations(self, node: int, rotations: Array) -> Array:
        """Quaternions (T, 4) of a node in its parent for rotations (T, 3, 3) of its joint from rest."""
        # the frame of the node's parent
        parent = self.gltf.parents[node]
        # the rotation nearest to the parent's linear map
        left, _, right = np.linalg.svd(self.linear[parent] if parent >= 0 else np.eye(3))
        frame = left @ right
        rest = self.gltf.local(node)["rotation"]
        at_rest = frame @ quat_to_rotmat(rest / np.linalg.norm(rest))
        return rotmat_to_quat(product(product(frame.T, rotations), at_rest))

    def _node_translations(self, node: int, translations: Array, is_root: bool) -> Array:
        """Positions (T, 3) of a node in its parent for translations (T, 3) of its joint, the root's in the world."""
        parent = self.gltf.parents[node]
        to_parent = np.eye(3)
        origin = np.zeros(3)
        if parent >= 0:
            to_parent = self.linear[parent]
            origin = self.places[parent]
        from_parent: Array = translations - (origin if is_root else 0.0)
        return from_parent @ np.linalg.inv(to_parent).T

    def carrier(self, node: int) -> int:
        """The joint that a node is or is attached to, -1 for none."""
        while node >= 0 and node not in self.joints:
            node = self.gltf.parents[node]
        return self.joints.index(node) if node >= 0 else -1

    def turnable(self, node: int) -> Json:
        """A node as animation requires it: with translation, rotation and scale instead of a matrix."""
        properties = self.gltf.objects("nodes")[node]
        if "matrix" not in properties:
            return properties
        kept = {key: value for key, value in properties.items() if key != "matrix"}
        return kept | {name: part.tolist() for name, part in self.gltf.local(node).items()}


def read_character(file: File) -> Character:
    """Read a character to put motions onto; FormatError like :func:`motet.formats.gltf.read`."""
    with broken(place_of(file)):
        # the figure that moves, in the world at rest
        gltf = parse(file)
        all_moved = set().union(*map(moved, gltf.objects("animations")))
        figure = figure_of(gltf, likeliest(gltf, figures(gltf, all_moved), all_moved))
        linear, _, places = (part[0] for part in gltf.world())
        joints = list(figure.nodes)
        skeleton = skeleton_at(figure.names, figure.parents, places[joints])
        # frames of joints must be invertible to write tracks for their nodes
        if not np.abs(np.linalg.det(linear[joints])).min() > 0:
            raise ContentError("nodes of its skeleton have scale 0: apply scales when exporting")
        nodes = Nodes(gltf, figure.nodes, skeleton, linear, places)
        return Character(rest_motion(skeleton), _joint_map(nodes), nodes, _skin(nodes))


def _joint_map(nodes: Nodes) -> JointMap | None:
    """The bones of a VRM humanoid."""
    bones = {bone: nodes.joints.index(node) for bone, node in nodes.gltf.humanoid().items() if node in nodes.joints}
    if not bones:
        return None
    if missing := [bone for bone in REQUIRED if bone not in bones]:
        raise ContentError(f"its VRM humanoid lacks bones that VRM requires: {', '.join(missing)}")
    # the bones of the spine and the neck, upwards; others one by one
    spine = tuple(bones[bone] for bone in ("spine", "chest", "upperChest") if bone in bones)
    neck = (bones["neck"],) if "neck" in bones else ()
    joints = {bone: bones[bone] for bone in BONES if bone in bones and bones[bone] not in (*spine, *neck)}
    return check_map(nodes.skeleton, JointMap(joints, spine, neck, "VRM humanoid", 1.0))


def _skin(nodes: Nodes) -> dict[int, Array]:
    """Hull points (P, 3) of the mesh on each joint that has some, relative to the joint, at rest, in metres: soles.

    A point belongs to the joint that moves it most. Empty, with a line in the log, if meshes cannot be read.
    """
    try:
        parts = list(_meshes(nodes))
    except ContentError as error:
        log.info("estimating soles from the joints instead of the mesh: %s: %s", nodes.gltf.path, error)
        return {}
    if not parts:
        return {}
    points = np.concatenate([points for points, _ in parts])
    owners = np.concatenate([owners for _, owners in parts])
    hulls = {}
    for joint in np.unique(owners[owners >= 0]).tolist():
        hulls[joint] = _outermost(points[owners == joint] - nodes.places[nodes.joints[joint]])
    return hulls


def _outermost(points: Array) -> Array:
    """Those of points (P, 3) that are furthest out in some direction."""
    # 200 directions, spread evenly by the golden angle
    height = 1 - (2 * np.arange(200) + 1) / 200
    angle = np.arange(200) * np.pi * (3 - 5**0.5)
    radius = np.sqrt(1 - height**2)
    directions = np.stack([radius * np.cos(angle), height, radius * np.sin(angle)], axis=-1)
    outermost: Array = points[np.unique(np.argmax(points @ directions.T, axis=0))]
    return outermost


def _meshes(nodes: Nodes) -> Iterator[Skinned]:
    """The points (P, 3) of all meshes in the world at rest, and the joint of each, -1 for none."""
    gltf = nodes.gltf
    for node, attributes, skin in _primitives(gltf):
        points = gltf.array(attributes["POSITION"])
        if skin is None:
            yield points @ nodes.linear[node].T + nodes.places[node], np.full(len(points), nodes.carrier(node))
        else:
            joints = gltf.array(attributes["JOINTS_0"]).astype(np.intp)
            weights = gltf.array(attributes["WEIGHTS_0"])
            yield _skinned(nodes, gltf.objects("skins")[skin], points, joints, weights)


def _primitives(gltf: Gltf) -> list[Primitive]:
    """All primitives of meshes, each that a skin moves once, since it is where its joints are, whatever node has it.
    FormatError, before anything is computed, where these are too many points."""
    primitives = {}
    for node, primitive in _placed_primitives(gltf):
        attributes = primitive["attributes"]
        skin = gltf.objects("nodes")[node].get("skin") if "JOINTS_0" in attributes else None
        place = node if skin is None else (skin, attributes["JOINTS_0"], attributes["WEIGHTS_0"])
        primitives[place, attributes["POSITION"]] = (node, attributes, skin)
    accessors = gltf.objects("accessors")
    points = sum(accessors[attributes["POSITION"]]["count"] for _, attributes, _ in primitives.values())
    if points > MAX_POINTS:
        raise ContentError(f"the meshes of its nodes have {points} points, more than {MAX_POINTS}")
    return list(primitives.values())


def _placed_primitives(gltf: Gltf) -> Iterator[tuple[int, Json]]:
    """The nodes with meshes, with each primitive of these; FormatError for too many."""
    visited = 0
    for node in gltf.order:
        properties = gltf.objects("nodes")[node]
        if "mesh" not in properties:
            continue
        primitives = gltf.objects("meshes")[properties["mesh"]]["primitives"]
        visited += len(primitives)
        if visited > MAX_PRIMITIVES:
            raise ContentError(f"its nodes have more than {MAX_PRIMITIVES} primitives of meshes")
        for primitive in primitives:
            yield node, primitive


def _skinned(nodes: Nodes, skin: Json, points: Array, joints: Indices, weights: Array) -> Skinned:
    """The points (P, 3) moved by joints of a skin (P, K) with weights (P, K), and the heaviest joint of each."""
    # each joint moves every point, weighted; then the sum of weights is divided out
    linear, places = _bound(nodes, skin)
    moved = np.zeros(points.shape)
    for joint, weight in zip(joints.T, weights.T, strict=True):
        moved += weight[:, None] * (rotated(linear[joint], points) + places[joint])
    moved /= np.maximum(weights.sum(axis=1), 1e-9)[:, None]
    owners = np.array([nodes.carrier(node) for node in skin["joints"]])
    heaviest = joints[np.arange(len(joints)), np.argmax(weights, axis=1)]
    return moved, owners[heaviest]


def _bound(nodes: Nodes, skin: Json) -> tuple[Array, Array]:
    """The linear maps (J, 3, 3) and translations (J, 3) by which a skin's joints move points from where they were
    bound."""
    linear = nodes.linear[skin["joints"]]
    places = nodes.places[skin["joints"]]
    if "inverseBindMatrices" in skin:
        bind = np.swapaxes(nodes.gltf.array(skin["inverseBindMatrices"]).reshape(-1, 4, 4), 1, 2)[: len(linear)]
        places = rotated(linear, bind[:, :3, 3]) + places
        linear = linear @ bind[:, :3, :3]
    return linear, places


def write_onto(file: File, clips: Mapping[str, Motion], nodes: Nodes) -> None:
    """Write a character's file with an animation for each named motion; the motions are on its skeleton.

    Everything else in the file is kept; its own animations follow the new ones, except those of the same names.
    Buffers and pictures beside a .gltf, or within its text, become parts of the file. FormatError for those that cannot
    be read, or a .vrm of a character that is not a VRM avatar; MotionError for a motion without frames, OutputError if
    the file cannot be written.
    """
    gltf = nodes.gltf
    if place_of(file).suffix.lower() == ".vrm" and not gltf.humanoid():
        raise FormatError(gltf.path, "not a VRM avatar: write it to a .glb")
    with broken(gltf.path):
        content = _with_animations(nodes, clips)
    write_whole(file, content)


def _with_animations(nodes: Nodes, clips: Mapping[str, Motion]) -> bytes:
    """The character's file with an animation for each motion."""
    gltf = nodes.gltf
    first, *others = _embedded_buffers(gltf) or [{}]
    images = _embedded_images(gltf)
    # the arrays of the animations go behind what is in the first buffer
    buffer = Buffer(gltf.document, gltf.buffers[0] if gltf.buffers else b"")
    made = [animation(buffer, name, motion, nodes.tracks(motion)) for name, motion in clips.items()]
    kept = [old for old in gltf.objects("animations") if old.get("name") not in clips]
    first["byteLength"] = len(buffer.content)
    document = {**gltf.document, **buffer.parts(), "buffers": [first, *others]}
    document["nodes"] = _turnable_nodes(nodes, made)
    document["animations"] = made + kept
    if images:
        document["images"] = images
    return container(document, buffer.content)


def _turnable_nodes(nodes: Nodes, animations: Sequence[Json]) -> list[Json]:
    """All nodes of the file, those that animations move as animation requires them."""
    targets: set[int] = set()
    for each in animations:
        targets |= {channel["target"]["node"] for channel in each["channels"]}
    turnable = []
    for i, node in enumerate(nodes.gltf.objects("nodes")):
        turnable.append(nodes.turnable(i) if i in targets else node)
    return turnable


def _embedded_buffers(gltf: Gltf) -> list[Json]:
    """The buffers without references to files: the first is the binary part, others are data: URIs."""
    buffers = []
    for index, buffer in enumerate(gltf.objects("buffers")):
        embedded = dict(buffer)
        if index == 0:
            embedded.pop("uri", None)
        elif not buffer.get("uri", "data:").startswith("data:"):
            embedded["uri"] = _data_uri("application/octet-stream", gltf.buffers[index])
        buffers.append(embedded)
    return buffers


def _embedded_images(gltf: Gltf) -> list[Json]:
    """The images without references to files; FormatError for one not in the folder of a .gltf, or no picture."""
    images = []
    room = GLTF_MAX_BYTES - gltf.size
    for image in gltf.objects("images"):
        embedded = dict(image)
        uri = image.get("uri", "data:")
        if not uri.startswith("data:"):
            content = read_beside("image", uri, room + 1, gltf.beside)
            room -= len(content)
            media = next((PICTURES[start] for start in PICTURES if content.startswith(start)), None)
            if media is None:
                raise ContentError(f"its image {quoted(uri)} is no PNG, JPEG, WebP or KTX picture")
            if room < 0:
                raise ContentError(f"its buffers and images are over {GLTF_MAX_BYTES} bytes in total")
            embedded["uri"] = _data_uri(media, content)
        images.append(embedded)
    return images


def _data_uri(media: str, content: bytes) -> str:
    return f"data:{media};base64,{base64.b64encode(content).decode()}"


def write_clip(file: File, motion: Motion, nodes: Nodes) -> None:
    """Write a motion on a character's skeleton with its nodes, and a simple body instead of its mesh.

    MotionError and OutputError like :func:`write_onto`.
    """
    gltf = nodes.gltf
    joints = list(nodes.joints)
    if not any(gltf.objects("nodes")[node].get("name") for node in joints):
        remedy = "which writes the character itself"
        log.warning("%s: its nodes have no names, by which a clip plays: use --onto (onto=), %s", gltf.path, remedy)
    number_of = _numbers_in_clip(nodes)
    buffer = Buffer()
    # only the joints, with a body of motet's own
    tracks = ((number_of[node], path, values) for node, path, values in nodes.tracks(motion))
    clip = animation(buffer, "motion", motion, tracks)
    skin = {"joints": [number_of[node] for node in joints]}
    inverse_bind = _inverse_bind(nodes.linear[joints], nodes.places[joints])
    with naming(gltf.path):
        bare = _bare_nodes(nodes, number_of)
    document = with_body(buffer, motion, nodes.skeleton, bare, clip, skin, inverse_bind)
    write_whole(file, container(document, buffer.content))


def _numbers_in_clip(nodes: Nodes) -> dict[int, int]:
    """The numbers in the clip's file of the joints' nodes and of what they hang on, which comes first."""
    kept = list(nodes.joints)
    while (parent := nodes.gltf.parents[kept[0]]) >= 0:
        kept.insert(0, parent)
    return {node: number for number, node in enumerate(kept)}


def _bare_nodes(nodes: Nodes, number_of: Mapping[int, int]) -> list[Json]:
    """Nodes without meshes and the like, and with children by their new numbers."""
    bare = []
    for node in number_of:
        properties = nodes.turnable(node)
        kept: Json = {"name": nodes.gltf.name(node)}
        for key in ("translation", "rotation", "scale"):
            if key in properties:
                kept[key] = properties[key]
        if children := [number_of[child] for child in properties.get("children", []) if child in number_of]:
            kept["children"] = children
        bare.append(kept)
    return bare


def _inverse_bind(linear: Array, places: Array) -> Array:
    """The inverse bind matrices (J, 4, 4) of joints with linear maps (J, 3, 3) and positions (J, 3) in the world."""
    bind = np.zeros((len(linear), 4, 4))
    bind[:, :3, :3] = linear
    bind[:, :3, 3] = places
    bind[:, 3, 3] = 1
    return np.asarray(np.linalg.inv(bind), np.float64)
