"""What a figure must be like to be taken for a human's, and how long its unit of length is."""

from typing import NamedTuple

import numpy as np

from motet.errors import MotionError, listed
from motet.motion.humanoid.bones import HUMANOID, LEFT_RIGHT, LEG, REST, SPINE, leg_length, sided
from motet.motion.humanoid.joint_map import BY_THE_TREE, NEEDED, JointMap
from motet.motion.humanoid.rest_pose import Aims, direction, legs_up, to_left, trunk_up
from motet.motion.rotations import Array, unit
from motet.motion.skeleton import Skeleton

UNITS = {
    "metres": 1.0,
    "decimetres": 0.1,
    "CMU's unit": 0.0254 / 0.45,
    "inches": 0.0254,
    "centimetres": 0.01,
    "millimetres": 0.001,
}
"""Units that skeletons are written in, with their length in metres."""

ADULT_LEG, LIKELY_LEG, POSSIBLE_LEG = 0.82, (0.55, 1.1), (0.2, 1.6)
"""Metres of thigh and shin together: of an adult, within which a unit is taken for granted, and at all possible."""

SHORTEST = 0.02
"""A bone of a limb is at least this part of thigh and shin."""

BENT = 0.3
"""The sine from which on a knee counts as bent."""


class Unit(NamedTuple):
    """A length unit in metres, None where it is not known, and what there is to say about it."""

    metres: float | None
    note: str | None


def leg_of(skeleton: Skeleton, joint_map: JointMap, aims: Aims, rest: Array) -> float:
    """Length of thigh and shin in the skeleton's unit, the mean of both sides; MotionError for bones without length."""
    lengths = {
        bone: float(np.linalg.norm(direction(rest, joint_map.joints[bone], aims[bone])))
        for bone in NEEDED
        if bone not in ("hips", "spine") and aims[bone]
    }
    leg = sum(lengths[sided(side, part)] for side in LEFT_RIGHT for part in LEG[:2]) / 2
    short = [skeleton.names[joint_map.joints[bone]] for bone, length in lengths.items() if length <= SHORTEST * leg]
    if short or not leg > 0:
        remedy = "a human's limbs have lengths: export the skeleton with its offsets"
        raise MotionError(f"bones of length zero: {listed(short)}; {remedy}")
    return leg


def unit_of(skeleton: Skeleton, leg: float) -> Unit:
    """The skeleton's unit as it says, or else as the length of its legs tells; MotionError for giants and dwarfs."""
    stated = skeleton.metres_per_unit
    if stated is not None:
        if POSSIBLE_LEG[0] < leg * stated < POSSIBLE_LEG[1]:
            return Unit(stated, None)
        guess = _guess(leg)
        looks = f"; its lengths look like {guess}" if guess else ""
        remedy = (
            "give the right unit (motet's --unit-in), or where the file says its own, scale the figure at its source"
        )
        raise MotionError(
            f"legs of {leg * stated:.3g} m: a human's are {POSSIBLE_LEG[0]:g} to {POSSIBLE_LEG[1]:g} m{looks}: {remedy}"
        )
    guess = _guess(leg)
    if guess is None:
        return Unit(None, "unit not known: the figure is taken to be an adult's size")
    return Unit(UNITS[guess], f"unit taken to be {guess} from the length of the legs, {leg * UNITS[guess]:.2f} m")


def height_of(skeleton: Skeleton, joint_map: JointMap, leg: float) -> float:
    """Height of a figure that stands straight, in the skeleton's unit: of legs and back as they are long, and of what
    joints do not tell, soles and crown, as the humanoid's."""
    top = "head" if "head" in joint_map.joints else "neck" if joint_map.neck else SPINE[-1]
    joint = joint_map.joints.get("head", (*joint_map.spine, *joint_map.neck)[-1])
    own = _back(skeleton, joint_map.carrier(skeleton), joint)
    usual = _back(HUMANOID, 0, HUMANOID.index(top))
    return leg + own + (float(REST[:, 1].max()) - leg_length() - usual) * leg / leg_length()


def _back(skeleton: Skeleton, hips: int, joint: int) -> float:
    """How far a joint is from the hips, along the bones."""
    length = 0.0
    while joint != hips:
        length += float(np.linalg.norm(skeleton.offsets[joint]))
        joint = skeleton.joints[joint].parent
    return length


def _guess(leg: float) -> str | None:
    near = {name: abs(np.log(leg * metres / ADULT_LEG)) for name, metres in UNITS.items()}
    likely = [name for name, metres in UNITS.items() if LIKELY_LEG[0] < leg * metres < LIKELY_LEG[1]]
    return min(likely, key=lambda name: near[name], default=None)


def check_stance(positions: Array, joint_map: JointMap) -> None:
    """Refuse frames (T, J, 3) of a figure on four legs: asked where its rest pose is not a standing body.

    A human who sits all through a file has the trunk beside the legs, too; names that are known tell one who sits
    upright from an animal.
    """
    trunk = trunk_up(positions, joint_map)
    beside = np.quantile(np.sum(trunk * legs_up(positions, joint_map), axis=-1), 0.95) < 0.3
    sits = joint_map.convention != BY_THE_TREE and np.median(trunk[:, 1]) > 0.5
    if beside and not sits:
        raise MotionError(
            "the trunk never stands above the legs: this looks like a figure on four legs, not like a human's; "
            "where joints were mistaken, give a map"
        )


def check_frames(positions: Array, joint_map: JointMap, aims: Aims, hinges: dict[str, Array]) -> None:
    """Refuse frames (T, J, 3) that no human's body goes through: inside out, with feet or knees the other way.

    hinges: of each side the axis (T, 3) about which the knee bends, to the left, however the thigh is turned. A knee
    bends the wrong way where the pelvis says so, too: recorded thighs can be twisted by much.
    """
    toes, wrong, bent = [], 0, 0
    left = to_left(positions, joint_map, "UpperLeg")
    for side, hinge in hinges.items():
        bones = [bone for bone in (sided(side, part) for part in LEG[:3]) if aims[bone]]
        thigh, shin, *foot = (unit(direction(positions, joint_map.joints[bone], aims[bone])) for bone in bones)
        toes += [np.sum(np.cross(hinge, -shin) * along, axis=-1) for along in foot]
        bend = np.cross(thigh, shin)
        is_bent = np.linalg.norm(bend, axis=-1) > BENT
        bent += int(is_bent.sum())
        wrong += int((is_bent & (np.sum(bend * hinge, axis=-1) < 0) & (np.sum(bend * left, axis=-1) < 0)).sum())
    if toes and np.median(toes) < -0.3:
        raise MotionError(
            "the feet point backwards: left and right are swapped, or the frames turn inside out: name the joints in a "
            "map, or export the file anew"
        )
    if bent >= 0.1 * len(positions) and wrong > 0.6 * bent:
        raise MotionError(
            "the knees bend forwards: the frames turn inside out (a wrong order of rotations?), or this is no human: "
            "export the file anew"
        )
