"""Reading glTF 2.0 (.gltf, .glb) and VRM (.vrm, .vrma): the skeleton, and the first animation.

The joints are those of the skins and those that a VRM file calls bones of its humanoid (VRM 0 and 1, VRM Animation),
with all nodes between them. A motion's skeleton rests in the pose that the file's nodes rest in, with all rotations
taken out: every angle 0 is that pose, whatever the nodes' own axes. Scales of nodes count in lengths.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from motet.errors import FormatError, MotionError
from motet.files import File, place_of
from motet.formats.character import Character
from motet.formats.gltf_data import Gltf, parse
from motet.formats.lines import Names
from motet.motion.humanoid import BONES, REQUIRED
from motet.motion.joint_map import JointMap, check_map
from motet.motion.motion import Motion
from motet.motion.products import inverse, product, rotated
from motet.motion.rotations import Array, frames_last, quat_to_rotmat
from motet.motion.skeleton import END_SUFFIX, Joint, Skeleton
from motet.motion.world_rotations import motion_of

FPS = 30.0
"""The frame rate of a file that has no animation or keys too sparse to tell one."""

MAX_VALUES = 10**7
"""Frames times nodes: an hour at 30 frames a second of a figure of 90 nodes."""

FREE_VALUES = 10**6
"""Frames times nodes of a file of any size; a file of more has a byte for each, so that a small one stays cheap."""

SPARSE = 0.1
"""Keys further apart than this many seconds do not tell a frame rate."""

PATHS = {"rotation": 4, "translation": 3, "scale": 3}
"""What of a node is animated here, with the numbers it has; weights of meshes are left out."""


@dataclass(frozen=True)
class _Nodes:
    """The nodes that are joints, each after its parent: their indices in the file, parents and names."""

    nodes: tuple[int, ...]
    parents: tuple[int, ...]
    names: tuple[str, ...]


def read(file: File) -> Motion:
    """Read the first animation, or the rest pose as one frame where there is none; lengths are metres.

    Bones of a VRM humanoid get VRM's names, other joints keep theirs. Channels: three angles in "deg" for each joint,
    the translation of the root and of joints that move in "length". FormatError names what the file lacks.
    """
    path = place_of(file)
    with _broken(path):
        return _read(path, parse(file))


@contextmanager
def _broken(path: Path) -> Iterator[None]:
    """What a file holds in the wrong place or type, as a FormatError."""
    try:
        yield
    except MotionError as error:
        raise error if isinstance(error, FormatError) else FormatError(path, str(error)) from error
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        raise FormatError(path, f"broken glTF file: {type(error).__name__}: {str(error)[:200]}") from error


def _read(path: Path, gltf: Gltf) -> Motion:
    joints = _joints(path, gltf)
    names = _named(gltf, joints)
    tracks, fps = _tracks(path, gltf)
    rest_turns, rest_places = _world(gltf, {}, 1)
    turns, places = _world(gltf, tracks, len(next(iter(tracks.values()), np.zeros(1))))
    nodes = list(joints.nodes)
    rest = rest_places[0, nodes]
    offsets = [rest[i] - rest[parent] if parent >= 0 else rest[i] for i, parent in enumerate(joints.parents)]
    skeleton = _skeleton(path, joints, names, offsets)
    turned = product(turns[:, nodes], inverse(rest_turns[0, nodes]))
    moved = _moved(skeleton, turned, places[:, nodes])
    return motion_of(skeleton, turned, moved, fps)


def read_character(file: File) -> Character:
    """Read a character's skeleton for :func:`motet.motion.retarget.from_humanoid`; FormatError as :func:`read`."""
    path = place_of(file)
    with _broken(path):
        return _character(path, parse(file))


def _character(path: Path, gltf: Gltf) -> Character:
    joints = _joints(path, gltf)
    turns, places = _world(gltf, {}, 1)
    nodes = list(joints.nodes)
    locals_: list[Array] = [places[0, nodes[0]]]
    for i, parent in enumerate(joints.parents[1:], start=1):
        above = turns[0, nodes[parent]]
        locals_.append(above.T @ (places[0, nodes[i]] - places[0, nodes[parent]]))
    skeleton = _skeleton(path, joints, list(joints.names), locals_)
    rest = motion_of(skeleton, turns[:, nodes], {0: places[:, nodes[0]]}, FPS)
    humanoid = {bone: joints.nodes.index(node) for bone, node in gltf.humanoid().items() if node in joints.nodes}
    return Character(rest, _map(path, skeleton, humanoid) if humanoid else None)


def _map(path: Path, skeleton: Skeleton, humanoid: dict[str, int]) -> JointMap:
    missing = [bone for bone in REQUIRED if bone not in humanoid]
    if missing:
        raise FormatError(path, f"its VRM humanoid lacks bones that VRM requires: {', '.join(missing)}")
    spine = tuple(humanoid[bone] for bone in ("spine", "chest", "upperChest") if bone in humanoid)
    neck = tuple(humanoid[bone] for bone in ("neck",) if bone in humanoid)
    joints = {bone: humanoid[bone] for bone in BONES if bone in humanoid and humanoid[bone] not in (*spine, *neck)}
    try:
        return check_map(skeleton, JointMap(joints, spine, neck, "VRM humanoid", 1.0))
    except MotionError as error:
        raise FormatError(path, str(error)) from error


def _named(gltf: Gltf, joints: _Nodes) -> list[str]:
    """The joints' names, those of VRM for the bones of its humanoid; another joint of such a name gets another."""
    bones = {node: bone for bone, node in gltf.humanoid().items() if bone in BONES}
    given = Names(bones.values())
    return [bones.get(node) or given.unique(name) for node, name in zip(joints.nodes, joints.names, strict=True)]


def _skeleton(path: Path, joints: _Nodes, names: list[str], offsets: list[Array]) -> Skeleton:
    triples = [(float(x), float(y), float(z)) for x, y, z in offsets]
    made = [Joint(*joint) for joint in zip(names, joints.parents, triples, strict=True)]
    try:
        return Skeleton(tuple(made), metres_per_unit=1.0)
    except MotionError as error:
        raise FormatError(path, str(error)) from error


def _joints(path: Path, gltf: Gltf) -> _Nodes:
    """The joints and what lies between them, down from the lowest node that all of them hang on."""
    skins = gltf.objects("skins")
    wanted = {*gltf.humanoid().values(), *(joint for skin in skins for joint in skin.get("joints", []))}
    if not wanted:
        raise FormatError(path, "no skeleton: expected a skin with joints or a VRM humanoid; export the armature, too")
    parents, order = gltf.parents, gltf.order
    if not wanted <= set(range(len(parents))):
        raise FormatError(path, f"joints that are no nodes: {sorted(wanted - set(range(len(parents))))}")
    branch = gltf.branch(wanted)
    inside = set(branch)
    ends = {node for node in order if parents[node] in inside and _is_end(gltf.objects("nodes")[node])}
    kept = tuple(node for node in order if node in inside | ends)
    at, given = {node: i for i, node in enumerate(kept)}, Names()
    names = tuple(given.unique(gltf.name(node)) for node in kept)
    return _Nodes(kept, tuple(at.get(parents[node], -1) for node in kept), names)


def _is_end(node: dict[str, Any]) -> bool:
    """Whether a node marks the tip of a bone, as motet and Blender name them."""
    return str(node.get("name", "")).endswith(END_SUFFIX) and not node.get("children")


def _moved(skeleton: Skeleton, turned: Array, places: Array) -> dict[int, Array]:
    """Translations (T, 3) in their parents' frames: of the root, and of joints that do not stay at their offset."""
    moved = {0: places[:, 0]}
    for i, joint in enumerate(skeleton.joints[1:], start=1):
        from_parent = places[:, i] - places[:, joint.parent]
        local = rotated(inverse(turned[:, joint.parent]), from_parent)
        if np.abs(local - joint.offset).max() > 1e-4 * max(skeleton.height, 1e-9):
            moved[i] = local
    return moved


def _world(gltf: Gltf, tracks: dict[tuple[int, str], Array], count: int) -> tuple[Array, Array]:
    """Rotations (T, N, 3, 3) and positions (T, N, 3) of all nodes in the world, the tracks in place of the rest."""
    nodes = len(gltf.objects("nodes"))
    linear, turns = frames_last((count, nodes, 3, 3)), frames_last((count, nodes, 3, 3))
    places = frames_last((count, nodes, 3))
    for node in gltf.order:
        rest = dict(zip(("translation", "rotation", "scale"), gltf.local(node), strict=True))
        move, quat, scale = (tracks.get((node, name), rest[name]) for name in ("translation", "rotation", "scale"))
        turn = quat_to_rotmat(quat / np.linalg.norm(quat, axis=-1, keepdims=True))
        local = turn * scale[..., None, :]
        parent = gltf.parents[node]
        if parent < 0:
            linear[:, node], turns[:, node], places[:, node] = local, turn, move
        else:
            linear[:, node] = product(linear[:, parent], local)
            turns[:, node] = product(turns[:, parent], turn)
            places[:, node] = places[:, parent] + rotated(linear[:, parent], move)
    return turns, places


def _tracks(path: Path, gltf: Gltf) -> tuple[dict[tuple[int, str], Array], float]:
    """Of the first animation for each node and path the values at every frame, and the frame rate."""
    animations = gltf.objects("animations")
    if not animations:
        return {}, FPS
    samplers = animations[0].get("samplers", [])
    keys = {}
    for channel in animations[0].get("channels", []):
        node, name = channel["target"].get("node"), channel["target"].get("path")
        if node is not None and name in PATHS:
            sampler = samplers[channel["sampler"]]
            times, values = gltf.array(sampler["input"]), gltf.array(sampler["output"])
            keys[node, name] = times.reshape(-1), values, sampler.get("interpolation", "LINEAR")
    if not keys or not all(len(times) for times, _, _ in keys.values()):
        raise FormatError(path, "its animation moves no nodes: expected tracks of rotation or translation")
    start, end = min(times[0] for times, _, _ in keys.values()), max(times[-1] for times, _, _ in keys.values())
    steps = min((float(np.median(np.diff(times))) for times, _, _ in keys.values() if len(times) > 1), default=0.0)
    rate = 1 / steps if 0 < steps < SPARSE else FPS
    fps = float(round(rate)) if abs(rate - round(rate)) < 0.01 * rate else rate
    count = (end - start) * fps + 1
    if not count * len(gltf.objects("nodes")) < min(MAX_VALUES, FREE_VALUES + gltf.size):
        raise FormatError(path, f"{end - start:g} s at {fps:g} fps are too many frames")
    frames = start + np.arange(round(count)) / fps
    return {place: _sampled(*key, frames, place[1]) for place, key in keys.items()}, fps


def _sampled(times: Array, values: Array, kind: str, frames: Array, name: str) -> Array:
    """Values (T, 3 or 4) at given times: linear (turns the shortest way), in steps, or by the tangents of splines."""
    values = values.reshape(len(times), -1, PATHS[name])
    before = np.clip(np.searchsorted(times, frames + 1e-6, side="right") - 1, 0, max(len(times) - 2, 0))
    after = np.minimum(before + 1, len(times) - 1)
    span = np.maximum(times[after] - times[before], 1e-9)
    part = np.clip((frames - times[before]) / span, 0, 1)[:, None]
    if kind == "CUBICSPLINE":
        low, high = values[before], values[after]
        p, m0, q, m1 = low[:, 1], low[:, 2] * span[:, None], high[:, 1], high[:, 0] * span[:, None]
        t, u = part, 1 - part
        cubic: Array = (1 + 2 * t) * u**2 * p + t * u**2 * m0 + t**2 * (3 - 2 * t) * q - t**2 * u * m1
        return cubic
    low, high = values[before, 0], values[after, 0]
    if kind == "STEP":
        stepped: Array = np.where(part < 1 - 1e-4, low, high)
        return stepped
    if name != "rotation":
        linear: Array = low + part * (high - low)
        return linear
    return _between(low, high, part)


def _between(low: Array, high: Array, part: Array) -> Array:
    """Quaternions (T, 4) the shortest way between two, at constant speed."""
    low, high = (quats / np.linalg.norm(quats, axis=-1, keepdims=True) for quats in (low, high))
    cosine = np.sum(low * high, axis=-1, keepdims=True)
    high, cosine = np.where(cosine < 0, -high, high), np.abs(cosine)
    angle = np.arccos(np.clip(cosine, -1, 1))
    near = angle < 1e-4
    sine = np.where(near, 1.0, np.sin(angle))
    one = np.where(near, 1 - part, np.sin((1 - part) * angle) / sine)
    other = np.where(near, part, np.sin(part * angle) / sine)
    mixed: Array = one * low + other * high
    return mixed
