"""Reading glTF 2.0 (.gltf, .glb) and VRM (.vrm, .vrma): the skeleton, and its animations as clips.

Lengths include the scales of nodes and the transforms of nodes above the skeleton.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from motet.errors import FormatError, MotionError
from motet.files import File, place_of
from motet.formats.gltf_data import Gltf, parse
from motet.formats.gltf_figures import Figure, above, figure_of, figures, likeliest
from motet.formats.gltf_tracks import GLTF_FPS, moved, tracks
from motet.formats.lines import Clip, Names, chosen, clip_names, split_clip
from motet.formats.nodes import Poses, motion_of_nodes, rested
from motet.motion.humanoid import BONES
from motet.motion.motion import Motion
from motet.motion.rotations import Array

GLTF_EXTENSIONS = (".glb", ".gltf", ".vrm", ".vrma")
"""The extensions of these files."""


def read(file: File, clip: Clip = None, rest: File | None = None) -> Motion:
    """Read a clip, by default the first, or the rest pose as one frame if there is none; lengths are metres.

    rest: a file with the same joints in a T-pose, or "file#clip" whose first frame is one, used as the rest pose. An
        animation exported without its character needs it, because its nodes rest in its first frame.

    Bones of a VRM humanoid get VRM's names, other joints keep theirs. Channels: three angles in "deg" for each joint,
    the translation of the root and of moving joints in "length". FormatError names what the file lacks.
    """
    with broken(place_of(file)):
        return _read(_parsed(file), clip, {} if rest is None else _stance(rest))


def clips(file: File) -> tuple[str, ...]:
    """The names of the animations that move a figure, in the file's order; FormatError like :func:`read`."""
    with broken(place_of(file)):
        return _parsed(file).names


@contextmanager
def broken(path: Path) -> Iterator[None]:
    """Turn errors from misplaced or mistyped content into FormatError."""
    try:
        yield
    except MotionError as error:
        raise error if isinstance(error, FormatError) else FormatError(path, str(error)) from error
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        raise FormatError(path, f"broken glTF file: {type(error).__name__}: {str(error)[:200]}") from error


@dataclass(frozen=True)
class _Scene:
    """A file with its figures, their nodes, and the animations that move one, with their names."""

    gltf: Gltf
    figures: list[set[int]]
    animations: list[dict[str, Any]]
    names: tuple[str, ...]


def _parsed(file: File) -> _Scene:
    gltf = parse(file)
    animations = gltf.objects("animations")
    found = figures(gltf, set().union(*map(moved, animations)))
    near = above(gltf, set().union(*found))
    moving = [animation for animation in animations if moved(animation) & near]
    if animations and not moving:
        raise FormatError(gltf.path, "its animations move no joint of its skeleton: export the armature's animations")
    return _Scene(gltf, found, moving, clip_names(str(animation.get("name", "")) for animation in moving))


@dataclass(frozen=True)
class _Take:
    """A figure at rest, in one frame, and in the frames of an animation."""

    figure: Figure
    rest: Poses
    poses: Poses
    fps: float


def _read(scene: _Scene, clip: Clip, turns: Mapping[str, Array]) -> Motion:
    """turns: rest rotations (3, 3) of joints in the world, to use instead of the file's."""
    named = scene.names or clip is not None
    take = _take(scene, chosen(scene.gltf.path, scene.names, clip) if named else None)
    names, parents = take.figure.names, take.figure.parents
    if turns and not turns.keys() & set(names):
        raise FormatError(scene.gltf.path, "the file of the rest pose shares no joint name with this figure")
    rest = rested(take.rest, names, parents, turns)
    return motion_of_nodes(
        scene.gltf.path, _named(scene.gltf, take.figure), parents, rest, take.poses, take.fps, metres=1.0
    )


def _stance(file: File) -> dict[str, Array]:
    """The rotations (3, 3) of a file's joints in the world, by name: at rest, or at the start of a named clip."""
    file, clip = split_clip(file, GLTF_EXTENSIONS)
    if isinstance(file, str | Path) and Path(file).suffix.lower() not in GLTF_EXTENSIONS:
        raise FormatError(place_of(file), f"a rest pose must come from a file of {' '.join(GLTF_EXTENSIONS)}")
    with broken(place_of(file)):
        scene = _parsed(file)
        take = _take(scene, None if clip is None else chosen(scene.gltf.path, scene.names, clip))
        return dict(zip(take.figure.names, (take.rest if clip is None else take.poses).turns[0], strict=True))


def _take(scene: _Scene, index: int | None) -> _Take:
    gltf = scene.gltf
    animation = {} if index is None else scene.animations[index]
    figure = figure_of(gltf, likeliest(gltf, scene.figures, moved(animation)))
    near = above(gltf, figure.nodes)
    values, fps = ({}, GLTF_FPS) if index is None else tracks(gltf, animation, scene.names[index], near)
    rest = poses = Poses(*gltf.world(near)[1:]).of(figure.nodes)
    if values:
        poses = Poses(*gltf.world(near, values)[1:]).of(figure.nodes)
    return _Take(figure, rest, poses, fps)


def _named(gltf: Gltf, joints: Figure) -> list[str]:
    """The joints' names, VRM's for the bones of its humanoid; other joints with such a name are renamed."""
    bones = {node: bone for bone, node in gltf.humanoid().items() if bone in BONES}
    given = Names(bones.values())
    return [bones.get(node) or given.unique(name) for node, name in zip(joints.nodes, joints.names, strict=True)]
