"""The figures of a glTF file: which of its nodes are joints, and of which skeleton.

Joints are those of the skins and the humanoid bones of a VRM file, with all nodes between them. In a file with neither,
such as an animation exported alone, they are the nodes that its animations move, and the descendants of these.
"""

import logging
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from motet.errors import FormatError, listed, quoted
from motet.formats.gltf_data import Gltf
from motet.formats.gltf_tracks import moved
from motet.formats.lines import Names
from motet.formats.nodes import skeleton_of_nodes
from motet.motion.rotations import Array
from motet.motion.skeleton import END_SUFFIX, Skeleton

log = logging.getLogger(__name__)

MAX_SKINS = 500
"""Skins per file; a figure has one for each of its meshes."""

MAX_JOINTS = 3000
"""Joints per figure; one with a detailed facial rig has a thousand."""


@dataclass(frozen=True)
class Figure:
    """The joints of one skeleton, parents first: their nodes in the file, parents (-1: none) and names."""

    nodes: tuple[int, ...]
    parents: tuple[int, ...]
    names: tuple[str, ...]


def figures(gltf: Gltf, moved: set[int]) -> list[set[int]]:
    """The joints of each figure of a file, by node; of a VRM file only the humanoid's; FormatError if none.

    moved: the nodes that its animations move. Skins belong to one figure if one is below the other, or both are below a
    moved node.
    """
    parts = _parts(gltf) or _animated(gltf, moved)
    tops = [_top(gltf, part) for part in parts]
    heads = _heads(gltf, moved | set(tops))
    found: dict[int, set[int]] = {}
    for part, top in zip(parts, tops, strict=True):
        found.setdefault(heads[top], set()).update(part)
    bones = set(gltf.humanoid().values())
    return [joints for joints in found.values() if not bones or joints & bones]


def likeliest(gltf: Gltf, found: list[set[int]], moved: set[int]) -> set[int]:
    """The figure with the most moving nodes, counting its ancestors, or else with the most joints."""
    best = max(found, key=lambda joints: (len(above(gltf, joints) & moved), len(joints)))
    if len(found) > 1:
        name = quoted(gltf.name(_top(gltf, best)))
        log.warning("%s: of %d skeletons, reading that of %s, which moves the most", gltf.path, len(found), name)
    return best


def figure_of(gltf: Gltf, joints: set[int]) -> Figure:
    """The joints and the nodes between them, with the ends attached to them."""
    inside = set(gltf.branch(joints))
    ends = {node for node in gltf.order if gltf.parents[node] in inside and _is_end(gltf, node)}
    kept = tuple(node for node in gltf.order if node in inside or node in ends)
    if len(kept) > MAX_JOINTS:
        raise FormatError(gltf.path, f"its skeleton has {len(kept)} joints: expected at most {MAX_JOINTS}")
    at, given = {node: i for i, node in enumerate(kept)}, Names()
    names = tuple(given.unique(gltf.name(node)) for node in kept)
    return Figure(kept, tuple(at.get(gltf.parents[node], -1) for node in kept), names)


def above(gltf: Gltf, nodes: Iterable[int]) -> set[int]:
    """The nodes and all their ancestors."""
    found: set[int] = set()
    for node in nodes:
        at = node
        while at >= 0 and at not in found:
            found.add(at)
            at = gltf.parents[at]
    return found


def _parts(gltf: Gltf) -> list[set[int]]:
    """The joints of each skin and the bones of the humanoid, separately for each tree of nodes."""
    skins = gltf.objects("skins")
    if len(skins) > MAX_SKINS:
        raise FormatError(gltf.path, f"it has {len(skins)} skins: expected at most {MAX_SKINS}")
    given = [set(gltf.humanoid().values()), *(set(skin.get("joints", [])) for skin in skins)]
    if strange := set().union(*given) - set(range(len(gltf.parents))):
        raise FormatError(gltf.path, f"joints that are not nodes: {listed(sorted(map(str, strange)))}")
    return [part for nodes in given for part in _by_tree(gltf, nodes)]


def _animated(gltf: Gltf, moved: set[int]) -> list[set[int]]:
    """In each tree the moved nodes and the bones below them, if some are below others."""
    bones = {node for node in moved if not _is_thing(gltf, node, ("camera",))}
    hanging: set[int] = set()
    for node in gltf.order:
        held = gltf.parents[node] in bones or gltf.parents[node] in hanging
        # an extension, such as a light, makes a node an object too
        if held and (node in bones or not _is_thing(gltf, node, ("mesh", "camera"))):
            hanging.add(node)
    parts = [part for part in _by_tree(gltf, bones | hanging) if part & bones & hanging]
    if not parts:
        names = listed([quoted(gltf.name(node)) for node in sorted(moved)])
        reason = (
            f"its animations move only {names}, and nothing below"
            if moved
            else "expected a skin with joints or a VRM humanoid"
        )
        raise FormatError(gltf.path, f"no skeleton: {reason}; export the armature, too")
    return parts


def _is_thing(gltf: Gltf, node: int, kinds: tuple[str, ...]) -> bool:
    found = gltf.objects("nodes")[node]
    return any(kind in found for kind in kinds) or "KHR_lights_punctual" in found.get("extensions", {})


def _by_tree(gltf: Gltf, nodes: set[int]) -> Iterator[set[int]]:
    trees: dict[int, set[int]] = {}
    for node in nodes:
        trees.setdefault(gltf.roots[node], set()).add(node)
    yield from trees.values()


def _heads(gltf: Gltf, among: set[int]) -> dict[int, int]:
    """The highest of ``among`` that each node is or is below."""
    heads: dict[int, int] = {}
    for node in gltf.order:
        if gltf.parents[node] in heads:
            heads[node] = heads[gltf.parents[node]]
        elif node in among:
            heads[node] = node
    return heads


def _top(gltf: Gltf, part: set[int]) -> int:
    """The lowest common ancestor of a part: that of its first and last node in branch order."""
    first, last = (pick(part, key=gltf.places.__getitem__) for pick in (min, max))
    line = above(gltf, [first])
    while last not in line:
        last = gltf.parents[last]
    return last


def _is_end(gltf: Gltf, node: int) -> bool:
    """Whether a node marks the tip of a bone, by motet's and Blender's naming."""
    found = gltf.objects("nodes")[node]
    return str(found.get("name", "")).endswith(END_SUFFIX) and not found.get("children")


@dataclass(frozen=True)
class Rest:
    """The node of each joint, and the skeleton, whose rest pose is the nodes' pose, in metres.

    linear: the linear maps (N, 3, 3), with scales, of all nodes of the file, joints or not, in the world; places
    (N, 3): their positions.
    """

    nodes: tuple[int, ...]
    skeleton: Skeleton
    linear: Array
    places: Array


def at_rest(gltf: Gltf) -> Rest:
    """The figure of a file that its animations move the most; FormatError if there is none."""
    all_moved = set().union(*map(moved, gltf.objects("animations")))
    figure = figure_of(gltf, likeliest(gltf, figures(gltf, all_moved), all_moved))
    linear, _, places = (found[0] for found in gltf.world())
    joints = places[list(figure.nodes)]
    offsets = [joints[i] - joints[parent] if parent >= 0 else joints[i] for i, parent in enumerate(figure.parents)]
    skeleton = skeleton_of_nodes(gltf.path, list(figure.names), figure.parents, offsets, metres=1.0)
    return Rest(figure.nodes, skeleton, linear, places)
