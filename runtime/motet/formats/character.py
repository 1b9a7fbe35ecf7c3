"""Characters: a skeleton that motions are put onto."""

from dataclasses import dataclass

from motet.errors import MotionError
from motet.motion.joint_map import JointMap
from motet.motion.motion import Motion
from motet.motion.retarget import from_humanoid, on_humanoid
from motet.motion.root_motion import travel_on_root


@dataclass(frozen=True)
class Character:
    """A character's skeleton as its file has it, to put motions onto.

    rest: a motion of it; of a glTF file one frame, the pose that the nodes rest in, with angles and offsets of the
        nodes themselves, so that a motion on this skeleton fits the file by the nodes' names.
    joint_map: its bones where the file names them, as VRM does, else None.
    """

    rest: Motion
    joint_map: JointMap | None = None


def put_onto(motion: Motion, character: Character) -> Motion:
    """A motion of any human figure on a character's skeleton; as it is where it is on that skeleton already.

    MotionError, with the reason, where the motion's figure or the character is no human's.
    """
    if motion.skeleton == character.rest.skeleton:
        return motion
    humanoid = on_humanoid(motion)
    try:
        found = from_humanoid(humanoid, character.rest, character.joint_map)
    except MotionError as error:
        raise MotionError(f"the character cannot take a motion: {error}") from error
    return travel_on_root(found, character.joint_map)
