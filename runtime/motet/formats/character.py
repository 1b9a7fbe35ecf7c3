"""Characters: a skeleton that motions are put onto."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from motet.errors import MotionError
from motet.motion.humanoid import JointMap, from_humanoid, grounded, on_humanoid
from motet.motion.motion import Motion
from motet.motion.root_motion import travel_on_root
from motet.motion.rotations import Array

if TYPE_CHECKING:
    from motet.formats.gltf_character import Nodes


@dataclass(frozen=True)
class Character:
    """A character's skeleton from its file, to put motions onto.

    rest: a motion of it; for a glTF file one frame, the rest pose of its nodes, in metres, with every angle 0.
    joint_map: its bones if the file names them, as VRM does, else None.
    nodes: for a glTF file, the nodes of the joints, used to write a motion for exactly these nodes.
    skin: joint -> points (P, 3) of the mesh attached to it, relative to the joint, at rest; empty without a mesh.
    """

    rest: Motion
    joint_map: JointMap | None = None
    nodes: "Nodes | None" = None
    skin: Mapping[int, Array] = field(default_factory=dict)


def put_onto(motion: Motion, character: Character) -> Motion:
    """A motion of any human figure on a character's skeleton; unchanged if it already is on that skeleton.

    A character from a glTF file stands on the ground, and z becomes its facing direction at rest. MotionError, with the
    reason, if the motion's figure or the character is not human.
    """
    if motion.skeleton == character.rest.skeleton:
        return motion
    found, has_nodes = on_humanoid(motion), character.nodes is not None
    try:
        put = from_humanoid(
            grounded(found) if has_nodes else found,
            character.rest,
            character.joint_map,
            skin=character.skin,
            ahead=has_nodes,
        )
    except MotionError as error:
        raise MotionError(f"the character cannot take a motion: {error}") from error
    return travel_on_root(put, character.joint_map)
