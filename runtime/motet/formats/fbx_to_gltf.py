"""A separate program: FBX on standard input, its skeleton and one of its takes as glTF on standard output.

    python -P fbx_to_gltf.py NUMBER

Only takes that move a bone count, from 0; without one of that number, the skeleton is at rest. The names of all and the
nodes that they move are in the glTF's ``extras``.

It has nodes, skins and samples at every frame; y is up, lengths are metres. Exit status 1 comes
with a reason on standard error.

It runs separately because of ufbx: it is C code, which untrusted files may crash, and version 0.0.5 returns Python
objects without counting the reference, so each has to be kept until the process ends.
"""

import base64
import gc
import json
import os
import sys
from array import array
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import chain, pairwise
from typing import Any

import ufbx

TRACK_TYPES = {"translation": "VEC3", "rotation": "VEC4", "scale": "VEC3"}
"""The parts of a node's transform, as named by both glTF and ufbx, and their glTF types."""

Vector = Sequence[float]
Matrix = Sequence[Vector]
"""Four columns of three numbers: the axes and the origin of one space in another."""

Json = dict[str, Any]
"""A JSON object."""

CALLBACKS: list[Any] = []


def keep(thing: Any) -> Any:
    """An object of ufbx, which must not be freed."""
    CALLBACKS.append(thing)
    return thing


def each(things: Iterable[Any]) -> list[Any]:
    """The objects of one of ufbx's lists."""
    return [keep(thing) for thing in things]


def product(a: Matrix, b: Matrix) -> Matrix:
    """First ``b``, then ``a``."""
    x, y, z, origin = a
    columns = []
    for u, v, w in b:
        columns.append([x[i] * u + y[i] * v + z[i] * w for i in range(3)])
    columns[3] = [columns[3][i] + origin[i] for i in range(3)]
    return columns


def cross(a: Vector, b: Vector) -> Vector:
    """The vector at right angles to both."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def inverse(matrix: Matrix) -> Matrix:
    """The inverse; ValueError if singular."""
    x, y, z, origin = matrix
    # the rows of the inverse, but for their length (Cramer's rule)
    rows = [cross(y, z), cross(z, x), cross(x, y)]
    volume = sum(a * b for a, b in zip(x, rows[0], strict=True))
    if not volume:
        raise ValueError("a bone's parent has a singular bind pose")
    linear = []
    for column in zip(*rows, strict=True):
        linear.append([number / volume for number in column])
    back = [*ufbx.identity_matrix[:3], [-number for number in origin]]
    return product([*linear, [0.0, 0.0, 0.0]], back)


def matrix_of(transform: Any) -> Matrix:
    """That of a translation, a rotation and a scale."""
    x, y, z, w = transform.rotation
    turn = (
        (1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)),
        (2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)),
        (2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)),
    )
    # each axis as long as its scale
    columns = []
    for axis, size in zip(turn, transform.scale, strict=True):
        columns.append([size * number for number in axis])
    return [*columns, transform.translation]


def _load(content: bytes) -> Any:
    """The scene of a file, in metres, y up."""
    return ufbx.load_memory(
        content,
        file_format=ufbx.FileFormat.FBX,
        ignore_geometry=True,
        ignore_embedded=True,
        target_axes=ufbx.axes_right_handed_y_up,
        target_unit_meters=1.0,
        space_conversion=ufbx.SpaceConversion.ADJUST_TRANSFORMS,
        inherit_mode_handling=ufbx.InheritModeHandling.COMPENSATE,
    )


class Scene:
    """A file's nodes without the root, parents first, and which of them are joints.

    at: indices in ``nodes`` by ufbx's numbers. bound: for bones of skins, where they are in the world when bound.
    skins: the bones of each skin, then those that no skin uses, skeleton by skeleton. near: the bones and what they
    hang on; all nodes where there is no bone.
    """

    def __init__(self, content: bytes) -> None:
        self.size = len(content)
        self.scene = keep(_load(content))
        # nodes by number, without the root that every file has
        self.nodes = [node for node in each(self.scene.nodes) if not node.is_root]
        self.at = {node.typed_id: i for i, node in enumerate(self.nodes)}
        self.parents = [self.at.get(keep(node.parent).typed_id, -1) for node in self.nodes]
        self.bound: dict[int, Any] = {}
        # the bones of skins, and then those without
        self.skins = [self._skin(skin) for skin in each(self.scene.skin_deformers)]
        self.skins += self._bare(set().union(*self.skins))
        self.near = self._above(set().union(*self.skins)) or set(self.at.values())

    def _above(self, nodes: set[int]) -> set[int]:
        """The nodes and all their ancestors."""
        # children come after their parents, so from the last node on all ancestors are reached
        for i in reversed(range(len(self.parents))):
            if i in nodes and self.parents[i] >= 0:
                nodes.add(self.parents[i])
        return nodes

    def _skin(self, skin: Any) -> set[int]:
        bones = set()
        for cluster in each(skin.clusters):
            node = keep(cluster.bone_node)
            if node is not None and node.typed_id in self.at:
                bones.add(self.at[node.typed_id])
                self.bound.setdefault(self.at[node.typed_id], cluster.bind_to_world)
        return bones

    def _bare(self, skinned: set[int]) -> Iterator[set[int]]:
        """The bones that no skin uses, grouped by topmost bone."""
        tops: dict[int, int] = {}
        groups: dict[int, set[int]] = {}
        for i, node in enumerate(self.nodes):
            if node.attrib_type == ufbx.ElementType.BONE:
                tops[i] = tops.get(self.parents[i], i)
                groups.setdefault(tops[i], set()).update({i} - skinned)
        yield from filter(None, groups.values())

    def rest(self) -> list[Matrix]:
        """Each node's rest pose in its parent: for bones of skins, the bind pose."""
        world: list[Matrix] = []
        rest = []
        for i, node in enumerate(self.nodes):
            above = world[self.parents[i]] if self.parents[i] >= 0 else ufbx.identity_matrix
            rest.append(product(inverse(above), self.bound[i]) if i in self.bound else tuple(node.node_to_parent))
            world.append(product(above, rest[i]))
        return rest


@dataclass(frozen=True)
class Take:
    """An animation, its curves, and the nodes that they move."""

    stack: Any
    curves: list[Any]
    moved: set[int]


def takes(scene: Scene) -> list[Take]:
    """The takes that move a bone or its ancestor; in a file without bones any node."""
    moving = []
    for stack in each(scene.scene.anim_stacks):
        take = Take(stack, [], set())
        for layer in each(stack.layers):
            for animated in layer.anim_props:
                node = keep(animated.element)
                if not (isinstance(node, ufbx.Node) and node.typed_id in scene.at):
                    continue
                if animated.prop_name.startswith("Lcl "):
                    take.moved.add(scene.at[node.typed_id])
                    curves = keep(keep(animated.anim_value).curves)
                    take.curves.extend(curve for curve in curves if curve is not None)
        if take.moved & scene.near:
            moving.append(take)
    return moving


def frame_times(scene: Scene, take: Take) -> list[float]:
    """When a take's frames are, in seconds: from its first key to its last, within its time range if that is not empty.

    ValueError for over 100,000 frames times nodes and one more for every four bytes of file, so small files stay cheap,
    and for over ten million, an hour of 90 nodes at 30 fps.
    """
    # where the keys are
    first = min((curve.min_time for curve in take.curves), default=0.0)
    last = max((curve.max_time for curve in take.curves), default=0.0)
    # within the take's own range, unless that is empty
    begin = max(first, take.stack.time_begin)
    end = min(last, take.stack.time_end)
    begin, end = (begin, end) if begin < end else (first, max(first, last))
    fps, _ = frame_rate(scene, take)
    if not (end - begin) * fps * len(scene.near) < min(10**7, 10**5 + scene.size / 4):
        raise ValueError(f"{end - begin:g} s at {fps:g} fps is too many frames")
    return [begin + i / fps for i in range(round((end - begin) * fps) + 1)]


def frame_rate(scene: Scene, take: Take, highest: float = 1000.0) -> tuple[float, str]:
    """The file's, or that of the take's keys if most of its curves are denser; 30 if neither is known or below the
    highest. And where it is not the file's, what the file states and which rate is taken."""
    stated = scene.scene.settings.frames_per_second
    # the median of all curves, so that a few with other rates do not count
    rates = sorted(key_rate(curve, highest) for curve in take.curves)
    keyed = rates[len(rates) // 2] if rates else 0.0
    if keyed > 1.01 * stated:
        return keyed, f"it states {stated:g} fps, but most of its curves have {keyed:g} keys a second: reading these"
    if 0 < stated <= highest:
        return stated, ""
    return 30.0, f"it states {stated:g} fps: reading 30, as rates are above 0 and at most {highest:g}"


def key_rate(curve: Any, highest: float) -> float:
    """Keys a second of a curve, by its median step; 0 for one of few keys, or of too many."""
    times = [key.time for key in curve.keyframes]
    steps = sorted(later - time for time, later in pairwise(times))
    step = steps[len(steps) // 2] if len(steps) > 1 else 0.0
    return 1 / step if step * highest >= 1 else 0.0


def as_gltf(scene: Scene, take: Take | None) -> Json:
    """The skeleton and a take of it, as a glTF document with its buffer embedded."""
    # nodes at rest, as a tree
    rest = scene.rest()
    nodes = [_node(scene, i, rest[i]) for i in range(len(scene.nodes))]
    for i, parent in enumerate(scene.parents):
        if parent >= 0:
            nodes[parent].setdefault("children", []).append(i)
    document: Json = {"asset": {"version": "2.0"}, "nodes": nodes}
    if any(scene.skins):
        document["skins"] = [{"joints": sorted(bones)} for bones in scene.skins if bones]
    return document if take is None else document | _animation(scene, take, rest)


def _node(scene: Scene, i: int, rest: Matrix) -> Json:
    """A node at rest: by its matrix, if a skin binds it there, or else by its own parts."""
    node: Json = {"name": scene.nodes[i].name}
    if i in scene.bound:
        node["matrix"] = []
        for column, last in zip(rest, (0, 0, 0, 1), strict=True):
            node["matrix"] += [*column, last]
        return node
    transform = scene.nodes[i].local_transform
    return node | {name: getattr(transform, name) for name in TRACK_TYPES}


def _animation(scene: Scene, take: Take, rest: list[Matrix]) -> Json:
    """The parts of a document with a take's tracks, a key for each frame."""
    # all numbers go into one array: first the times, then a track after the other
    times = frame_times(scene, take)
    values = array("f", [time - times[0] for time in times])
    accessors = [{"bufferView": 0, "componentType": 5126, "count": len(times), "type": "SCALAR"}]
    channels: list[Json] = []
    for node, poses in _poses(scene, take, times, rest):
        for name, kind in TRACK_TYPES.items():
            channels.append({"sampler": len(channels), "target": {"node": node, "path": name}})
            accessors.append({**accessors[0], "byteOffset": 4 * len(values), "type": kind})
            for pose in poses:
                values.extend(getattr(pose, name))
    # the first accessor has the times, which all tracks share
    samplers = [{"input": 0, "output": i} for i in range(1, len(accessors))]
    animation = {"name": take.stack.name, "channels": channels, "samplers": samplers}
    return {"animations": [animation], "accessors": accessors} | _embedded(values)


def _poses(scene: Scene, take: Take, times: list[float], rest: list[Matrix]) -> Iterator[tuple[int, list[Any]]]:
    """The nodes that a take moves, each with its transforms at the times of frames."""
    for node in sorted(scene.near):
        poses = [ufbx.evaluate_transform(take.stack.anim, scene.nodes[node], time) for time in times]
        if node in take.moved or not _is_still(poses, rest[node]):
            yield node, poses


def _embedded(values: "array[float]") -> Json:
    """The parts of a document with the values of its accessors."""
    if sys.byteorder == "big":
        values.byteswap()
    content = values.tobytes()
    uri = f"data:application/octet-stream;base64,{base64.b64encode(content).decode()}"
    length = len(content)
    return {"bufferViews": [{"buffer": 0, "byteLength": length}], "buffers": [{"byteLength": length, "uri": uri}]}


def _is_still(poses: list[Any], rest: Matrix) -> bool:
    """Whether a node without curves stays so near its rest that it needs no samples."""
    for pose in poses:
        numbers = zip(chain(*matrix_of(pose)), chain(*rest), strict=True)
        if any(abs(x - y) > 1e-5 * max(1.0, abs(y)) for x, y in numbers):
            return False
    return True


def main(number: int) -> Json:
    """The glTF document of the file on standard input."""
    content = sys.stdin.buffer.read()
    with suppress(ImportError, ValueError, OSError):  # limits memory by the file's size, if the system can
        import resource

        most = 2**28 + 32 * len(content)
        resource.setrlimit(resource.RLIMIT_AS, (most, resource.getrlimit(resource.RLIMIT_AS)[1]))
    # the skeleton, the takes that move it, and one of these
    scene = Scene(content)
    moving = takes(scene)
    take = moving[number] if 0 <= number < len(moving) else None
    document = as_gltf(scene, take)
    listed = [{"name": each.stack.name, "moved": sorted(each.moved)} for each in moving]
    note = "" if take is None else frame_rate(scene, take)[1]
    return document | {"extras": {"takes": listed, "note": note}}


if __name__ == "__main__":
    gc.disable()  # it would count references that ufbx did not
    status = 0
    try:
        sys.stdout.write(json.dumps(main(int(sys.argv[1])), allow_nan=False))
    except Exception as error:  # ufbx raises anything on a broken file
        sys.stderr.write(str(error) or type(error).__name__)
        status = 1
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)
