"""Reading glTF 2.0 (.gltf, .glb) and VRM (.vrm, .vrma): the skeleton, and its animations as clips.

Joints are those of the skins and the humanoid bones of a VRM file, with all nodes between them. In a file with neither,
such as an animation exported alone, they are the nodes that its animations move, and the descendants of these. So they
are, besides those of the skins, where only both together are a human's: some characters' skins move the head alone.

Lengths include the scales of nodes and the transforms of nodes above the skeleton. The motion's skeleton has the rest
pose of the file's nodes, with all rotations removed: every angle 0 is that pose, whatever the nodes' own axes.
"""

import logging
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from motet.errors import MotionError, listed, quoted
from motet.figures.humanoid import BONES, map_of
from motet.files import File, Json, place_of
from motet.formats.gltf_data import REST_TRANSFORM, Gltf, Tracks, broken, parse
from motet.formats.text import (
    Clip,
    ContentError,
    Contents,
    UniqueNames,
    choice,
    chosen,
    most_poses,
    names_file,
    part_names,
    split_clip,
)
from motet.formats.text import Figure as FigureChoice
from motet.motion.kinematics import motion_of
from motet.motion.motion import Motion, rest_motion
from motet.motion.rotations import Array, Indices, inverse, product, rotated
from motet.motion.skeleton import END_SUFFIX, Joint, Names, Skeleton

log = logging.getLogger(__name__)

MAX_SKINS = 500
MAX_JOINTS = 3000
"""Skins of a file, and joints of its skeleton: a figure has a skin for each of its meshes, and a detailed facial rig
has a thousand joints."""

NodeSet = set[int]
"""Nodes of a file, by their numbers in it."""


def read(file: File, clip: Clip = None, rest: File | None = None, figure: FigureChoice = None) -> Motion:
    """Read a clip, by default the first, or the rest pose as one frame if there is none; lengths are metres.

    rest: a file with the same joints in a T-pose, or "file#clip" whose first frame is one, used as the rest pose. An
        animation exported without its character needs it, because its nodes rest in its first frame.
    figure: one of several skeletons, by name or number, by default that which the clip moves the most. Without a clip,
        the first that moves this figure is read. The name of a figure may also be given as ``clip``.

    Bones of a VRM humanoid get VRM's names, other joints keep theirs. Channels: three angles in "deg" for each joint,
    the translation of the root and of moving joints in "length". FormatError names what the file lacks.
    """
    with broken(place_of(file)):
        # the clip and the figure that are read
        scene = _scene(file)
        gltf = scene.gltf
        stance = {} if rest is None else _stance(rest)
        parts = _contents(scene)
        take = _take(scene, *choice(gltf.path, parts, clip, figure))
        if stance and not stance.keys() & set(take.figure.names):
            raise ContentError("the file of the rest pose shares no joint name with this figure")
        # every angle is counted from the rest pose of the nodes, whatever their own axes
        rest_turns, rest_places = _rested(take, stance)
        skeleton = skeleton_at(_joint_names(gltf, take.figure), take.figure.parents, rest_places)
        turned = product(take.turns, inverse(rest_turns))
        return motion_of(skeleton, turned, _moving(skeleton, turned, take.places), take.fps)


def _joint_names(gltf: Gltf, figure: "Figure") -> list[str]:
    """The names of a figure's joints: VRM's for the bones of its humanoid, and unique ones for the others."""
    bones = {node: bone for bone, node in gltf.humanoid().items() if bone in BONES}
    unique_names = UniqueNames(bones.values())  # other joints with such a name are renamed
    names = []
    for node, name in zip(figure.nodes, figure.names, strict=True):
        names.append(bones.get(node) or unique_names.unique(name))
    return names


def contents(file: File) -> Contents:
    """The animations that move a figure, and the figures; FormatError like :func:`read`."""
    with broken(place_of(file)):
        return _contents(_scene(file))


def contents_of_takes(file: File, takes: Mapping[str, NodeSet]) -> Contents:
    """The figures of a file, with clips that are not in it, by their names and the nodes that each moves."""
    with broken(place_of(file)):
        return _contents(_scene(file), takes)


def _contents(scene: "_Scene", takes: Mapping[str, NodeSet] | None = None) -> Contents:
    if takes is None:
        takes = dict(zip(scene.names, map(moved, scene.animations), strict=True))
    figures = {}
    for title, joints in scene.figures.items():
        near = above(scene.gltf, joints)
        figures[title] = tuple(name for name, nodes in takes.items() if nodes & near)
    return Contents(tuple(takes), figures)


@dataclass(frozen=True)
class _Scene:
    """A file with its figures, their nodes, and the animations that move one, with their names.

    figures: by their names, which are those of their topmost nodes, in the order of the file's nodes.
    """

    gltf: Gltf
    figures: dict[str, NodeSet]
    animations: list[Json]
    names: Names


def _scene(file: File) -> _Scene:
    gltf = parse(file)
    # figures in the order of the file's nodes, and the animations that move them
    animations = gltf.objects("animations")
    moved_nodes = list(map(moved, animations))
    parts = figures(gltf, set().union(*moved_nodes))
    parts.sort(key=lambda joints: gltf.order[_top(gltf, joints)])
    titles = part_names((gltf.name(_top(gltf, joints)) for joints in parts), "figure")
    near = above(gltf, set().union(*parts))
    moving = [animation for animation, nodes in zip(animations, moved_nodes, strict=True) if nodes & near]
    if animations and not moving:
        raise ContentError("its animations move no joint of its skeleton: export the armature's animations")
    names = part_names(str(animation.get("name", "")) for animation in moving)
    return _Scene(gltf, dict(zip(titles, parts, strict=True)), moving, names)


@names_file
def _stance(file: File) -> dict[str, Array]:
    """The rotations (3, 3) of a file's joints in the world, by name: at rest, or at the start of a named clip."""
    extensions = (".glb", ".gltf", ".vrm", ".vrma")
    file, clip = split_clip(file, extensions)
    if isinstance(file, str | Path) and Path(file).suffix.lower() not in extensions:
        raise ContentError(f"a rest pose must come from a file of {' '.join(extensions)}")
    with broken(place_of(file)):
        scene = _scene(file)
        take = _take(scene, None if clip is None else chosen(scene.gltf.path, scene.names, clip), None)
        return dict(zip(take.figure.names, take.rest_turns if clip is None else take.turns[0], strict=True))


@dataclass(frozen=True)
class Figure:
    """The joints of one skeleton, parents first: their nodes in the file, parents (-1: none) and names."""

    nodes: tuple[int, ...]
    parents: tuple[int, ...]
    names: Names


@dataclass(frozen=True)
class _Take:
    """A figure's joints in the world: rotations without scale (T, J, 3, 3), positions (T, J, 3), and both at rest."""

    figure: Figure
    turns: Array
    places: Array
    rest_turns: Array
    rest_places: Array
    fps: float


def _take(scene: _Scene, index: int | None, place: int | None) -> _Take:
    """A figure, by default the likeliest, in the frames of an animation, or at rest."""
    gltf = scene.gltf
    animation = {} if index is None else scene.animations[index]
    figures = list(scene.figures.values())
    figure = figure_of(gltf, likeliest(gltf, figures, moved(animation)) if place is None else figures[place])
    near = above(gltf, figure.nodes)
    tracks: Tracks = {}
    fps = 30.0
    if index is not None:
        tracks, fps = _tracks(gltf, animation, scene.names[index], near)
    # at rest, and in each frame
    joints = list(figure.nodes)
    _, rest_turns, rest_places = (part[0, joints] for part in gltf.world(near))
    linear, turns, places = (part[:, joints] for part in gltf.world(near, tracks))
    _turn_with_bones(figure, linear, turns, places, rest_turns, rest_places)
    return _Take(figure, turns, places, rest_turns, rest_places, fps)


def _turn_with_bones(
    figure: Figure, linear: Array, turns: Array, places: Array, rest_turns: Array, rest_places: Array
) -> None:
    """Turn joints (T, J, 3, 3), in place, that unequal scales above them shear, so that their bones point where the
    linear maps (T, J, 3, 3) put them: by rotations alone, limbs would be some degrees off.
    """
    for joint in range(len(figure.nodes)):
        children = [child for child, parent in enumerate(figure.parents) if parent == joint]
        if children and _is_sheared(linear[:, joint]):
            at_rest = rest_places[children] - rest_places[joint]
            bones = places[:, children] - places[:, [joint]]
            turned = product(turns[:, joint], rest_turns[None, joint].swapaxes(-1, -2))
            turns[:, joint] = _turned_onto(at_rest, bones, turned) @ rest_turns[joint]


def _is_sheared(linear: Array) -> bool:
    """Whether linear maps (T, 3, 3) have columns of different lengths, or not at right angles, in some frame."""
    columns = product(linear.swapaxes(-1, -2), linear)
    size = np.trace(columns, axis1=-2, axis2=-1)[:, None, None] / 3
    return bool(np.abs(columns - size * np.eye(3)).max(initial=0.0) > 1e-3 * size.max(initial=0.0))


def _turned_onto(at_rest: Array, bones: Array, turned: Array) -> Array:
    """The rotations (T, 3, 3) that take directions (B, 3) closest to others (T, B, 3), and turn like ``turned``
    (T, 3, 3) where these leave that open, as one bone does."""
    lengths = np.linalg.norm(at_rest, axis=-1) * np.linalg.norm(bones, axis=-1)
    weights = np.where(lengths > 0, 1 / np.maximum(lengths, 1e-12), 0.0)
    wanted = 1e-4 * turned + np.einsum("tb,tbi,bj->tij", weights, bones, at_rest)
    left, _, right = np.linalg.svd(wanted)
    left[:, :, 2] *= np.linalg.det(left @ right)[:, None]  # no reflections
    closest: Array = left @ right
    return closest


def _rested(take: _Take, stance: Mapping[str, Array]) -> tuple[Array, Array]:
    """Rotations (J, 3, 3) and positions (J, 3) at rest, with bones turned like those of the same names in ``stance``.

    Bones keep their lengths; other joints keep their rotation relative to their parent.
    """
    turned = take.rest_turns.copy()
    places = take.rest_places.copy()
    for i, (name, parent) in enumerate(zip(take.figure.names, take.figure.parents, strict=True)):
        if parent >= 0:
            back = turned[parent] @ take.rest_turns[parent].T
            turned[i] = back @ take.rest_turns[i]
            places[i] = places[parent] + back @ (take.rest_places[i] - take.rest_places[parent])
        turned[i] = stance.get(name, turned[i])
    return turned, places


def skeleton_at(names: Sequence[str], parents: Sequence[int], places: Array) -> Skeleton:
    """The skeleton in metres of joints at places (J, 3) at rest; MotionError if they do not form one."""
    above = [places[parent] if parent >= 0 else np.zeros(3) for parent in parents]
    offsets = [(float(x), float(y), float(z)) for x, y, z in places - above]
    # offsets are differences of places: in this skeleton no joint is turned
    joints = tuple(Joint(*joint) for joint in zip(names, parents, offsets, strict=True))
    return Skeleton(joints, metres_per_unit=1.0)


def _moving(skeleton: Skeleton, turned: Array, places: Array) -> dict[int, Array]:
    """Translations (T, 3) in their parents' frames: of the root, and of joints that leave their offset."""
    moving = {0: places[:, 0]}
    for i, joint in enumerate(skeleton.joints[1:], start=1):
        local = rotated(inverse(turned[:, joint.parent]), places[:, i] - places[:, joint.parent])
        # share of the figure's height: a joint that stays within this of its offset does not move
        if np.abs(local - joint.offset).max(initial=0.0) > 1e-4 * max(skeleton.height, 1e-9):
            moving[i] = local
    return moving


def figures(gltf: Gltf, moved: NodeSet) -> list[NodeSet]:
    """The joints of each figure of a file, by node; of a VRM file only the humanoid's; FormatError if none.

    moved: the nodes that its animations move. Skins belong to one figure if one is below the other, or both are below a
    moved node. Where the skins' joints are no human's, and are one together with moved nodes, these are joints, too.
    """
    # joints are those of the humanoid and of skins
    humanoid = set(gltf.humanoid().values())
    sets = [humanoid, *_skins(gltf)]
    joints_of_all = set().union(*sets)
    if unknown := joints_of_all.difference(range(len(gltf.parents))):
        raise ContentError(f"joints that are not nodes: {listed(sorted(map(str, unknown)))}")
    roots = _roots(gltf)
    animated = _animated(gltf, moved, roots)
    if not joints_of_all:
        if not animated:
            raise _no_skeleton(gltf, moved)
        return _grouped(gltf, [animated], moved, roots)
    groups = _grouped(gltf, sets, moved, roots)
    if humanoid:
        return [joints for joints in groups if joints & humanoid]
    # animated nodes beyond the skins' count where only both together are a human's
    if animated <= above(gltf, set().union(*groups)) or _humans(gltf, groups):
        return groups
    return _humans(gltf, _grouped(gltf, [*sets, animated], moved, roots)) or groups


def _skins(gltf: Gltf) -> list[NodeSet]:
    """The joints of each skin; FormatError for too many skins."""
    skins = gltf.objects("skins")
    if len(skins) > MAX_SKINS:
        raise ContentError(f"it has {len(skins)} skins: expected at most {MAX_SKINS}")
    return [set(skin.get("joints", [])) for skin in skins]


def _no_skeleton(gltf: Gltf, moved: NodeSet) -> ContentError:
    """The error for a file without joints, with what its animations move instead."""
    if gltf.document.get("extensions", {}).get("VRMC_vrm_animation", {}).get("expressions"):
        return ContentError("it animates only expressions of a face, and no bones: it has no motion")
    reason = "expected a skin with joints or a VRM humanoid"
    if moved:
        names = listed([quoted(gltf.name(node)) for node in sorted(moved)])
        reason = f"its animations move only {names}, and nothing below"
    return ContentError(f"no skeleton: {reason}; export the armature, too")


def _grouped(gltf: Gltf, sets: list[NodeSet], moved: NodeSet, roots: Mapping[int, int]) -> list[NodeSet]:
    """Sets of joints put together that belong to one figure."""
    # a set that spans several trees belongs to several figures
    parts: dict[tuple[int, int], NodeSet] = {}
    for i, joints in enumerate(sets):
        for node in joints:
            parts.setdefault((i, roots[node]), set()).add(node)
    # parts below the same moved node, or below each other, are one figure
    tops = [_top(gltf, part) for part in parts.values()]
    heads = _heads(gltf, moved | set(tops))
    groups: dict[int, NodeSet] = {}
    for part, top in zip(parts.values(), tops, strict=True):
        groups.setdefault(heads[top], set()).update(part)
    return list(groups.values())


def _humans(gltf: Gltf, groups: list[NodeSet]) -> list[NodeSet]:
    """The figures, among the ten with the most joints, that are humans by their names or their tree at rest."""
    _, _, places = gltf.world()
    humans = []
    for joints in sorted(groups, key=len, reverse=True)[:10]:
        try:
            figure = figure_of(gltf, joints)
            skeleton = skeleton_at(figure.names, figure.parents, places[0, list(figure.nodes)])
            map_of(rest_motion(skeleton))
        except MotionError:
            continue
        humans.append(joints)
    return humans


def _animated(gltf: Gltf, moved: NodeSet, roots: Mapping[int, int]) -> NodeSet:
    """In each tree the moved nodes and the bones below them, if some are below others; empty if none are."""

    def is_thing(node: int, *kinds: str) -> bool:
        properties = gltf.objects("nodes")[node]
        is_light = "KHR_lights_punctual" in properties.get("extensions", {})
        return is_light or any(kind in properties for kind in kinds)

    # cameras and lights move, but are no bones
    bones = {node for node in moved if not is_thing(node, "camera")}
    below: NodeSet = set()
    for node in gltf.order:
        is_below = gltf.parents[node] in bones or gltf.parents[node] in below
        if is_below and (node in bones or not is_thing(node, "mesh", "camera")):
            below.add(node)
    trees = {roots[node] for node in bones & below}
    return {node for node in bones | below if roots[node] in trees}


def _heads(gltf: Gltf, among: NodeSet) -> dict[int, int]:
    """The highest of ``among`` that each node is or is below."""
    heads: dict[int, int] = {}
    for node in gltf.order:
        if gltf.parents[node] in heads:
            heads[node] = heads[gltf.parents[node]]
        elif node in among:
            heads[node] = node
    return heads


def _roots(gltf: Gltf) -> dict[int, int]:
    """The root of the tree that each node is in."""
    return _heads(gltf, {node for node, parent in enumerate(gltf.parents) if parent < 0})


def _top(gltf: Gltf, part: NodeSet) -> int:
    """The lowest common ancestor of a part: that of its first and last node in branch order."""
    # all of a part is between its first and its last node, in the order of branches
    first = min(part, key=gltf.order.__getitem__)
    last = max(part, key=gltf.order.__getitem__)
    line = above(gltf, [first])
    while last not in line:
        last = gltf.parents[last]
    return last


def above(gltf: Gltf, nodes: Iterable[int]) -> NodeSet:
    """The nodes and all their ancestors."""
    reached: NodeSet = set()
    for node in nodes:
        at = node
        while at >= 0 and at not in reached:
            reached.add(at)
            at = gltf.parents[at]
    return reached


def likeliest(gltf: Gltf, groups: list[NodeSet], moved: NodeSet) -> NodeSet:
    """The figure with the most moving nodes, counting its ancestors, or else with the most joints."""
    # the most moving nodes, then the most joints
    best = max(groups, key=lambda joints: (len(above(gltf, joints) & moved), len(joints)))
    if len(groups) > 1:
        name = quoted(gltf.name(_top(gltf, best)))
        message = "%s: of %d skeletons, reading that of %s, which moves the most; figure= or --figure takes another"
        log.warning(message, gltf.path, len(groups), name)
    return best


def figure_of(gltf: Gltf, joints: NodeSet) -> Figure:
    """The joints and the nodes between them, with the ends attached to them, by motet's and Blender's naming."""
    over = above(gltf, [gltf.parents[_top(gltf, joints)]])
    inside = above(gltf, joints) - over
    nodes = tuple(node for node in gltf.order if node in inside or _is_end(gltf, node, inside))
    if len(nodes) > MAX_JOINTS:
        raise ContentError(f"its skeleton has {len(nodes)} joints: expected at most {MAX_JOINTS}")
    index_of = {node: i for i, node in enumerate(nodes)}
    parents = tuple(index_of.get(gltf.parents[node], -1) for node in nodes)
    unique_names = UniqueNames()
    names = tuple(unique_names.unique(gltf.name(node)) for node in nodes)
    return Figure(nodes, parents, names)


def _is_end(gltf: Gltf, node: int, inside: NodeSet) -> bool:
    """Whether a node marks the end of one of a skeleton's nodes, by its name."""
    properties = gltf.objects("nodes")[node]
    is_named = str(properties.get("name", "")).endswith(END_SUFFIX)
    return is_named and not properties.get("children") and gltf.parents[node] in inside


def moved(animation: Json) -> NodeSet:
    """The nodes that an animation moves."""
    return {node for _, node, _ in _channels(animation)}


def _channels(animation: Json) -> Iterator[tuple[Json, int, str]]:
    """The channels of an animation that move nodes, each with the node and the part of its transform."""
    for channel in animation.get("channels", []):
        target = channel["target"]
        node = target.get("node")
        path = target.get("path")
        if path in REST_TRANSFORM and node is not None:
            yield channel, node, path


def _tracks(gltf: Gltf, animation: Json, name: str, nodes: NodeSet) -> tuple[Tracks, float]:
    """The values of some nodes at every frame of the animation ``name``, and its frame rate."""
    # keys at times of their own, read at the times of frames
    keys = _keys(gltf, animation, name, nodes)
    frame_times, fps = _frame_times(gltf, name, [times for times, _, _ in keys.values()])
    tracks = {}
    for (node, path), (times, values, interpolation) in keys.items():
        tracks[node, path] = _sampled(times, values, interpolation, frame_times, path)
    return tracks, fps


def _frame_times(gltf: Gltf, name: str, times_of_tracks: list[Array]) -> tuple[Array, float]:
    """The times (T,) of an animation's frames by the times (K,) of its tracks' keys, and its frame rate."""
    if not all(map(len, times_of_tracks)):
        raise ContentError(f"its animation {quoted(name)} has tracks without keys")
    # from the first key of any track to the last
    start = min(times[0] for times in times_of_tracks)
    end = max(times[-1] for times in times_of_tracks)
    # many programs count frames from 1: a start that is later than half a second is told
    if start > 0.5:
        log.warning("%s: its animation %s starts at %.3g s: read from there", gltf.path, quoted(name), start)
    fps = _rate(times_of_tracks)
    count = (end - start) * fps + 1
    if not count * len(gltf.objects("nodes")) < most_poses(gltf.size):
        raise ContentError(f"{end - start:g} s at {fps:g} fps is too many frames")
    return start + np.arange(round(count)) / fps, fps


Keys = dict[tuple[int, str], tuple[Array, Array, str]]
"""(Node, property) -> times (K,), values (K, 3 or 4), or three times as many for splines, and the interpolation."""


def _keys(gltf: Gltf, animation: Json, name: str, nodes: NodeSet) -> Keys:
    """The keys of some nodes; FormatError where times and values differ in number."""
    samplers = animation.get("samplers", [])
    keys = {}
    for channel, node, path in _channels(animation):
        if node not in nodes:
            continue
        sampler = samplers[channel["sampler"]]
        # a value for each time, three for splines
        times = gltf.array(sampler["input"])
        values = gltf.array(sampler["output"])
        interpolation = sampler.get("interpolation", "LINEAR")
        expected = times.size * (3 if interpolation == "CUBICSPLINE" else 1)  # a spline's keys have tangents
        if values.size != expected * len(REST_TRANSFORM[path]):
            counts = f"{times.size} times and {len(values)} values, not {expected},"
            track = f"the {path} of {quoted(gltf.name(node))}"
            raise ContentError(f"its animation {quoted(name)} has {counts} for {track}: export it again")
        keys[node, path] = (times.reshape(-1), values, interpolation)
    return keys


def _rate(times_of_tracks: Iterable[Array]) -> float:
    """The frame rate of tracks by the times of their keys, (K,) in seconds: that of the closest keys, 30 if none is
    near."""
    steps = [_step(times) for times in times_of_tracks if len(times) > 1]
    least = min((step for step in steps if step), default=0.0)
    if not 0 < least < 0.1:  # keys further apart do not tell a frame rate
        return 30.0
    rate = 1 / least
    # a rate is whole, or like 29.97, where the times cannot tell it from that
    for digits, error in ((0, 1e-4), (2, 1e-6), (3, 1e-6)):
        if abs(rate - round(rate, digits)) < error * rate:
            return float(round(rate, digits))
    return rate


def _step(times: Array) -> float:
    """The seconds between two keys of a track (K,).

    Times are 32-bit numbers, so a step between two is rough: it is measured over all whole steps of the track.
    """
    # a step may be missing where a key was left out
    gaps = np.diff(times)
    step = float(np.median(gaps))
    if step > 0:
        whole = np.rint(gaps / step)
        if np.abs(gaps - whole * step).max() < 0.01 * step and whole.sum() > 0:
            step = float((times[-1] - times[0]) / whole.sum())
    return step


def _sampled(times: Array, values: Array, kind: str, frames: Array, name: str) -> Array:
    """Values (T, 3 or 4) at given times: linear (rotations the shortest way), in steps, or by the tangents of splines.

    Beyond the first and last key the value stays (glTF 2.0, section 3.11 and appendix C).
    """
    values = values.reshape(
        len(times), -1, len(REST_TRANSFORM[name])
    )  # a key of a spline: in-tangent, value, out-tangent
    before, after = _keys_around(times, frames)
    # how far each frame is between its keys
    span = np.maximum(times[after] - times[before], 1e-9)[:, None]
    share = np.clip((frames - times[before])[:, None] / span, 0, 1)
    if kind == "CUBICSPLINE":
        return _on_spline(values[before], values[after], span, share)
    # in steps, on the shortest turn, or on a line
    low = values[before, 0]
    high = values[after, 0]
    if kind == "STEP":
        steps: Array = np.where(share < 1 - 1e-4, low, high)
        return steps
    if name == "rotation":
        return _on_great_circle(low, high, share)
    between: Array = low + share * (high - low)
    return between


def _keys_around(times: Array, frames: Array) -> tuple[Indices, Indices]:
    """The keys (T,) at or before the times of frames (T,), and those after them; of a single key this one."""
    before = np.searchsorted(times, frames + 1e-6, side="right") - 1
    before = np.clip(before, 0, max(len(times) - 2, 0))
    return before, np.minimum(before + 1, len(times) - 1)


def _on_spline(before: Array, after: Array, span: Array, share: Array) -> Array:
    """Values (T, D) on cubic Hermite splines between keys (T, 3, D) that are ``span`` seconds (T, 1) apart."""
    left = 1 - share
    tangent_before = before[:, 2] * span
    tangent_after = after[:, 0] * span
    value = (1 + 2 * share) * left**2 * before[:, 1]
    value = value + share * left**2 * tangent_before
    value = value + share**2 * (3 - 2 * share) * after[:, 1]
    return value - share**2 * left * tangent_after


def _on_great_circle(low: Array, high: Array, share: Array) -> Array:
    """Quaternions (T, 4) between others, the shortest way at constant speed; ends need not be normalised."""
    low = low / np.linalg.norm(low, axis=-1, keepdims=True)
    high = high / np.linalg.norm(high, axis=-1, keepdims=True)
    # of the two quaternions of a rotation, the nearer one
    cosine = np.sum(low * high, axis=-1, keepdims=True)
    high = np.where(cosine < 0, -high, high)
    angle = np.arccos(np.clip(np.abs(cosine), -1, 1))
    # for angles too small to divide by their sine, the straight line
    is_near = angle < 1e-4
    sine = np.where(is_near, 1.0, np.sin(angle))
    weight_low = np.where(is_near, 1 - share, np.sin((1 - share) * angle) / sine)
    weight_high = np.where(is_near, share, np.sin(share * angle) / sine)
    return weight_low * low + weight_high * high
