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
    """A character's skeleton as its file has it, to put motions onto.

    rest: a motion of it, of a glTF file one frame: the pose that its nodes rest in, in metres, with every angle 0.
    joint_map: its bones where the file names them, as VRM does, else None.
    nodes: of a glTF file the nodes that the joints are, by which a motion is written for just these.
    skin: joint -> points (P, 3) of the mesh that hang on it, from the joint, at rest; empty where there is no mesh.
    """

    rest: Motion
    joint_map: JointMap | None = None
    nodes: "Nodes | None" = None
    skin: Mapping[int, Array] = field(default_factory=dict)


def put_onto(motion: Motion, character: Character) -> Motion:
    """A motion of any human figure on a character's skeleton; as it is where it is on that skeleton already.

    A character of a glTF file stands on the ground, and z becomes the way that it faces at rest. MotionError, with the
    reason, where the motion's figure or the character is no human's.
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
