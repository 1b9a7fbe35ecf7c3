"""The figures of a glTF file: which of its nodes are joints, and of which skeleton.

Joints are those of the skins and those that a VRM file calls bones of its humanoid, with all nodes between them. A file
that has neither, as animations alone are exported, has the nodes that its animations move, and what hangs on them.
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
"""Skins of a file; a figure has one for each of its meshes."""

MAX_JOINTS = 3000
"""Joints of a figure; one with a face of many bones has a thousand."""


@dataclass(frozen=True)
class Figure:
    """The joints of one skeleton, each after its parent: their nodes in the file, parents (-1: none) and names."""

    nodes: tuple[int, ...]
    parents: tuple[int, ...]
    names: tuple[str, ...]


def figures(gltf: Gltf, moved: set[int]) -> list[set[int]]:
    """The joints of each figure of a file, by their nodes, that of a VRM humanoid alone; FormatError for none.

    moved: the nodes that its animations move. Skins belong to one figure where one hangs below the other, or both below
    a node that is moved.
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
    """Of several figures the one of which most nodes move, those above it, too, or which has the most joints."""
    best = max(found, key=lambda joints: (len(above(gltf, joints) & moved), len(joints)))
    if len(found) > 1:
        name = quoted(gltf.name(_top(gltf, best)))
        log.warning("%s: of %d skeletons that of %s is taken, which moves the most", gltf.path, len(found), name)
    return best


def figure_of(gltf: Gltf, joints: set[int]) -> Figure:
    """The joints and what lies between them, with the ends that hang on them."""
    inside = set(gltf.branch(joints))
    ends = {node for node in gltf.order if gltf.parents[node] in inside and _is_end(gltf, node)}
    kept = tuple(node for node in gltf.order if node in inside or node in ends)
    if len(kept) > MAX_JOINTS:
        raise FormatError(gltf.path, f"its skeleton has {len(kept)} joints: expected at most {MAX_JOINTS}")
    at, given = {node: i for i, node in enumerate(kept)}, Names()
    names = tuple(given.unique(gltf.name(node)) for node in kept)
    return Figure(kept, tuple(at.get(gltf.parents[node], -1) for node in kept), names)


def above(gltf: Gltf, nodes: Iterable[int]) -> set[int]:
    """The nodes and all that they hang on."""
    found: set[int] = set()
    for node in nodes:
        at = node
        while at >= 0 and at not in found:
            found.add(at)
            at = gltf.parents[at]
    return found


def _parts(gltf: Gltf) -> list[set[int]]:
    """The joints of each skin and the bones of the humanoid, those in each tree of nodes apart."""
    skins = gltf.objects("skins")
    if len(skins) > MAX_SKINS:
        raise FormatError(gltf.path, f"it has {len(skins)} skins: expected at most {MAX_SKINS}")
    given = [set(gltf.humanoid().values()), *(set(skin.get("joints", [])) for skin in skins)]
    if strange := set().union(*given) - set(range(len(gltf.parents))):
        raise FormatError(gltf.path, f"joints that are no nodes: {listed(sorted(map(str, strange)))}")
    return [part for nodes in given for part in _by_tree(gltf, nodes)]


def _animated(gltf: Gltf, moved: set[int]) -> list[set[int]]:
    """In each tree the nodes that are moved and the bones that hang on them, if some hang on others."""
    bones = {node for node in moved if not _is_thing(gltf, node, ("camera",))}
    hanging: set[int] = set()
    for node in gltf.order:
        held = gltf.parents[node] in bones or gltf.parents[node] in hanging
        # an extension, such as a light, makes a node a thing, too
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
    """For each node the highest one of ``among`` that it hangs on or is."""
    heads: dict[int, int] = {}
    for node in gltf.order:
        if gltf.parents[node] in heads:
            heads[node] = heads[gltf.parents[node]]
        elif node in among:
            heads[node] = node
    return heads


def _top(gltf: Gltf, part: set[int]) -> int:
    """The lowest node that a part hangs on: what the first and the last of its nodes, branch by branch, share."""
    first, last = (pick(part, key=gltf.places.__getitem__) for pick in (min, max))
    line = above(gltf, [first])
    while last not in line:
        last = gltf.parents[last]
    return last


def _is_end(gltf: Gltf, node: int) -> bool:
    """Whether a node marks the tip of a bone, as motet and Blender name them."""
    found = gltf.objects("nodes")[node]
    return str(found.get("name", "")).endswith(END_SUFFIX) and not found.get("children")


@dataclass(frozen=True)
class Rest:
    """The node of each joint, and the skeleton, which rests in the nodes' pose, in metres.

    linear: what all nodes of the file, joints or not, make of vectors in the world (N, 3, 3), with their scales; places
    (N, 3): where they are.
    """

    nodes: tuple[int, ...]
    skeleton: Skeleton
    linear: Array
    places: Array


def at_rest(gltf: Gltf) -> Rest:
    """The figure of a file that its animations move the most; FormatError where there is none."""
    all_moved = set().union(*map(moved, gltf.objects("animations")))
    figure = figure_of(gltf, likeliest(gltf, figures(gltf, all_moved), all_moved))
    linear, _, places = (found[0] for found in gltf.world())
    joints = places[list(figure.nodes)]
    offsets = [joints[i] - joints[parent] if parent >= 0 else joints[i] for i, parent in enumerate(figure.parents)]
    skeleton = skeleton_of_nodes(gltf.path, list(figure.names), figure.parents, offsets, metres=1.0)
    return Rest(figure.nodes, skeleton, linear, places)
