"""The humanoid, the one figure through which motions of every skeleton are retargeted; and figures known by name.

The humanoid's bones have the names of the VRM 1.0 humanoid. At rest (every angle 0) it stands in a T-pose: y up, facing
+z, the left at +x, palms down, soles at y = 0 where the root is at its offset; lengths are metres. Every joint's frame
is that of the world at rest, so a rotation of a joint means the same on every figure.

Proportions: an adult of 1.70 m. Heights of knee, hip, shoulder and chin are the fractions of stature of Drillis and
Contini (1966), as in Winter, "Biomechanics and Motor Control of Human Movement", figure 4.1, rounded to centimetres;
the joint of the upper arm lies inside the shoulder's width, the ankle at the height of the joint's centre. The figures
are in humanoid.json for readers in other languages: of the trunk, and of the left side, which the right mirrors,
each joint's parent, offset and Euler order.
"""

import json
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np

from motet.errors import MotionError
from motet.motion.motion import Motion
from motet.motion.rotations import Array, rotated
from motet.motion.skeleton import END_SUFFIX, Joint, Names, Skeleton, Triple

LEFT_RIGHT = ("left", "right")

SIDES = (("left", 1.0), ("right", -1.0))
"""Both sides, and the sign of x there."""

SPINE = ("spine", "chest", "upperChest")
NECK = ("neck", "head")
LEG = ("UpperLeg", "LowerLeg", "Foot", "Toes")
ARM = ("Shoulder", "UpperArm", "LowerArm", "Hand")

Places = Mapping[str, tuple[str, Triple, str]]
"""Joint -> parent, "" for none, offset and Euler order."""


def sided(side: str, part: str) -> str:
    """The name of a joint on one side: ``sided("left", "UpperArm")`` is "leftUpperArm"."""
    return side + part


def joint_of(side: str, part: str) -> int:
    """The index of a joint of the humanoid on one side: ``joint_of("left", "UpperArm")``."""
    return HUMANOID.index(sided(side, part))


def limb_of(side: str, parts: Sequence[str]) -> Names:
    """The names of a limb's joints on one side, such as those of LEG."""
    return tuple(sided(side, part) for part in parts)


def part_of(bone: str) -> str:
    """The name of a bone without its side."""
    return bone.removeprefix("left").removeprefix("right")


def _joints(trunk: Places, left: Places, sides: tuple[str, str], scale: float = 1.0) -> tuple[Joint, ...]:
    """The joints of a trunk and, mirrored for the right, of a side, whose names lack the side."""
    places = dict(trunk)
    # the right side is the mirror image of the left
    for side, sign in zip(sides, (1.0, -1.0), strict=True):
        for part, (parent, (x, y, z), order) in left.items():
            places[side + part] = (
                side + parent if parent in left else parent,
                (sign * x, y, z),
                order,
            )
    # in the units of the skeleton
    names = list(places)
    joints = []
    for name, (parent, (x, y, z), order) in places.items():
        index = names.index(parent) if parent else -1
        joints.append(Joint(name, index, (scale * x, scale * y, scale * z), order))
    return tuple(joints)


def _table(*path: str) -> dict[str, Any]:
    """A JSON object of this folder."""
    table: dict[str, Any] = json.loads(files("motet.figures.humanoid").joinpath(*path).read_text("utf-8"))
    return table


_TABLES = _table("humanoid.json")

# an order's middle axis is the one that the joint turns least about, which keeps poses away from gimbal locks
HUMANOID = Skeleton(_joints(_TABLES["trunk"], _TABLES["left"], LEFT_RIGHT), metres_per_unit=1.0)
"""The humanoid's skeleton: 22 bones and the tips of head, hands and toes."""

BONES = tuple(name for name in HUMANOID.names if not name.endswith(END_SUFFIX))
"""The bones of the humanoid: all joints but the tips, each after its parent."""

REQUIRED = tuple(bone for bone in BONES if part_of(bone) in ("hips", "spine", "head", *LEG[:3], *ARM[1:]))
"""The bones required by VRM; the others stay at rest if a figure lacks them."""

PARENTS = {name: HUMANOID.names[max(0, HUMANOID.joints[HUMANOID.index(name)].parent)] for name in BONES[1:]}
"""For each bone but the hips its parent."""

T_POSE = HUMANOID.rest_positions + HUMANOID.offsets[0]
"""Positions (J, 3) of the humanoid's joints in the T-pose, with the soles at y = 0."""

SOLE: Mapping[str, tuple[Triple, ...]] = {part: tuple(map(tuple, row)) for part, row in _TABLES["soles"].items()}
"""Points of the sole in the frames of the foot (heel, ball) and of the toes (tip)."""


def leg_length() -> float:
    """Length of the humanoid's thigh and shin together, in metres: the measure by which figures are scaled."""
    return float(sum(np.linalg.norm(HUMANOID.offsets[joint_of("left", part)]) for part in LEG[1:3]))


def sole_points(rotations: Array, positions: Array) -> Array:
    """Points (T, 6, 3) of both soles, from the joints' world rotations (T, J, 3, 3) and positions (T, J, 3)."""
    points = []
    for side in LEFT_RIGHT:
        for part, places in SOLE.items():
            joint = joint_of(side, part)
            points += [positions[:, joint] + rotated(rotations[:, joint], np.array(place)) for place in places]
    return np.stack(points, axis=1)


def ground_under(soles: Array) -> float:
    """The height of the ground under points (T, P, 3) of the soles: the lowest is deeper in 5 % of the frames; 0 for
    no frames."""
    return float(np.percentile(soles[..., 1].min(axis=1), 5)) if len(soles) else 0.0


FINGERS: Places = _TABLES["fingers"]
"""VRM's fingers of the left hand, each after its parent, "Hand" or another finger's bone."""


MMM_SKELETON = Skeleton(
    _joints(**_table("mmm.json"), sides=("L", "R"), scale=1.7),
    metres_per_unit=1.0,
)
"""The figure of MMM files (KIT), which have no skeleton, and one channel for each angle: the Master Motor Map's
reference body, here 1.7 m high, as the files do not state it. Its segments, in mmm.json, are Winter's fractions of
the body's height; it rests with arms down, and a joint turns about its three axes one after the other. Here y is up
and the figure faces z."""


def is_mmm(motion: Motion) -> bool:
    """Whether the channels are those of an MMM file."""
    return motion.skeleton is None and {"root.rx", "LHx_joint", "RHx_joint"} <= set(motion.channels)


def with_figure(motion: Motion) -> Motion:
    """The motion of an MMM file on its figure; angles of joints that the figure lacks are left out."""
    # an angle of MMM, whose x points right, y forward and z up -> the channel here, and its sign
    axes = {"x": ("rx", -1.0), "y": ("rz", 1.0), "z": ("ry", 1.0)}
    names = []
    columns = []
    for i, channel in enumerate(motion.channels):
        joint = channel.removesuffix("_joint")[:-1]
        axis = channel.removesuffix("_joint")[-1]
        if channel.startswith("root."):
            names.append(channel)
            columns.append(motion.values[:, i])
        elif axis in axes and joint in MMM_SKELETON.names:
            names.append(f"{joint}.{axes[axis][0]}")
            columns.append(axes[axis][1] * motion.values[:, i])
    units = tuple("m" if name[-2] == "t" else "rad" for name in names)
    return Motion(np.stack(columns, axis=1), tuple(names), units, motion.fps, MMM_SKELETON)


RIGS = ("mixamo", "rigify", "unity", "unreal")
"""Names of well-known rigs."""


@cache
def rig(name: str) -> Skeleton:
    """The skeleton of a rig out of :data:`RIGS`, its lengths in the rig's unit; MotionError for another name.

    It has the joints' names and the unit of a well-known rig, with the humanoid's proportions, in a T-pose, for
    programs that know figures by these names and retarget from their T-pose, as engines do. Its convention's table
    (:mod:`motet.figures.humanoid.joint_map`) has each bone's name first, back and neck all of them; "rig" has the
    "unit" in metres, and where there is one the "prefix" of all names and the "root" at the floor that the hips hang
    on.
    """
    if name not in RIGS:
        raise MotionError(f"there is no rig {name!r}; expected one of {', '.join(RIGS)}")
    content = _table("conventions", f"{name}.json")
    rig = content["rig"]
    tree = _rig_tree(content)
    names = list(tree)
    joints = []
    for joint, (parent, position) in tree.items():
        offset = (position - tree[parent][1] if parent else position) / rig["unit"]
        x, y, z = offset.tolist()
        joints.append(
            Joint(
                rig.get("prefix", "") + joint,
                names.index(parent) if parent else -1,
                (x, y, z),
            )
        )
    return Skeleton(tuple(joints), rig["unit"])


Tree = dict[str, tuple[str, Array]]
"""Joint -> its parent, "" for none, and its position (3,) in metres, parents first."""


def _rig_tree(content: dict[str, Any]) -> Tree:
    """The joints of a rig with the humanoid's proportions, from its convention's table."""
    tree = {}
    parent = ""
    if "root" in content["rig"]:
        parent = content["rig"]["root"]
        tree[parent] = ("", np.zeros(3))

    # hips, back and neck hang on each other
    for joint, position in _rig_trunk(content["joints"]):
        tree[joint] = (parent, position)
        parent = joint

    # the other joints are the humanoid's
    names = _rig_names(content)
    for bone, position in zip(HUMANOID.names[1:], T_POSE[1:], strict=True):
        if bone not in (*SPINE, "neck"):
            above = HUMANOID.names[HUMANOID.parents[HUMANOID.index(bone)]]
            tree[names[bone]] = (names[above], position)
    return tree


def _rig_trunk(names: dict[str, list[str]]) -> list[tuple[str, Array]]:
    """The joints of a rig's hips, back and neck, upwards, with their positions (3,), from the names of its bones."""
    back = _shared_out(("hips", *SPINE), len(names["spine"]))
    neck = _shared_out((SPINE[-1], *NECK), len(names["neck"]) + 1)[:-1]
    joints = [names["hips"][0], *names["spine"], *names["neck"]]
    return list(zip(joints, [T_POSE[0], *back, *neck], strict=True))


def _rig_names(content: dict[str, Any]) -> dict[str, str]:
    """For bones of the humanoid, and for tips, the names of a rig's joints."""
    known = content["joints"]
    names = {
        "hips": known["hips"][0],
        "upperChest": known["spine"][-1],
        "neck": known["neck"][-1],
        "head": known["head"][0],
    }
    for side, word in zip(LEFT_RIGHT, content["sides"][0], strict=True):
        for part in (*LEG, *ARM):
            names[sided(side, part)] = known[part][0].replace("{s}", word)
    tips = {bone + END_SUFFIX: name + END_SUFFIX for bone, name in names.items()}
    return names | tips


def _shared_out(bones: Sequence[str], count: int) -> list[Array]:
    """Positions (3,) of ``count`` joints along a chain of bones, as far up as retargeting shares turns out."""
    chain = T_POSE[[HUMANOID.index(bone) for bone in bones]]
    up_chain = np.arange(1, count + 1) * (len(chain) - 1) / count
    coordinates = [np.interp(up_chain, range(len(chain)), along) for along in chain.T]
    return list(np.stack(coordinates, axis=1))


MIXAMO = rig("mixamo")
