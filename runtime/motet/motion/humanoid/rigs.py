"""Rigs by name: the joints' names and the unit of a well-known rig, with the humanoid's proportions, in a T-pose.

They are for programs that know figures by these names and retarget from their T-pose, as engines do. A rig is in the
table of its convention (:mod:`motet.motion.humanoid.joint_names`): every bone has its first name there, back and neck
all of them; "rig" says the "unit" in metres, and where there is one the "prefix" of all names and the "root" at the
floor that the hips hang on.
"""

import json
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np

from motet.errors import MotionError
from motet.motion.humanoid.bones import ARM, HUMANOID, LEFT_RIGHT, LEG, NECK, SPINE, T_POSE, sided
from motet.motion.rotations import Array
from motet.motion.skeleton import END_SUFFIX, Joint, Skeleton

RIGS = ("mixamo", "rigify", "unity", "unreal")


@cache
def rig(name: str) -> Skeleton:
    """The skeleton of a rig out of :data:`RIGS`, its lengths in the rig's unit; MotionError for another name."""
    if name not in RIGS:
        raise MotionError(f"there is no rig {name!r}; expected one of {', '.join(RIGS)}")
    table = files("motet.motion.humanoid") / "conventions" / f"{name}.json"
    content = json.loads(table.read_text("utf-8"))
    return _skeleton(content, content["rig"])


def _skeleton(content: dict[str, Any], rig: dict[str, Any]) -> Skeleton:
    known, place = content["joints"], dict(zip(HUMANOID.names, T_POSE, strict=True))
    tree: list[tuple[str, str, Array]] = [(rig["root"], "", np.zeros(3))] if "root" in rig else []
    above = rig.get("root", "")
    back = _shared_out([place[bone] for bone in ("hips", *SPINE)], len(known["spine"]))
    neck = _shared_out([place[bone] for bone in (SPINE[-1], *NECK)], len(known["neck"]) + 1)[:-1]
    names = [known["hips"][0], *known["spine"], *known["neck"]]
    for name, at in zip(names, [place["hips"], *back, *neck], strict=True):
        tree.append((name, above, at))
        above = name
    called = {"hips": names[0], "upperChest": known["spine"][-1], "neck": known["neck"][-1], "head": known["head"][0]}
    for side, word in zip(LEFT_RIGHT, content["sides"][0], strict=True):
        called |= {sided(side, part): known[part][0].replace("{s}", word) for part in (*LEG, *ARM)}
    called |= {bone + END_SUFFIX: name + END_SUFFIX for bone, name in called.items()}
    for joint in HUMANOID.joints[1:]:
        if joint.name not in (*SPINE, "neck"):
            tree.append((called[joint.name], called[HUMANOID.names[joint.parent]], place[joint.name]))
    return _joined(tree, rig.get("prefix", ""), rig["unit"])


def _shared_out(chain: list[Array], count: int) -> list[Array]:
    """Places (3,) of the joints of another chain, as far up as :mod:`motet.motion.humanoid.spread` shares turns out."""
    up = np.arange(1, count + 1) * (len(chain) - 1) / count
    return list(np.stack([np.interp(up, range(len(chain)), along) for along in np.transpose(chain)], axis=1))


def _joined(tree: list[tuple[str, str, Array]], prefix: str, unit: float) -> Skeleton:
    """The skeleton of joints with the names of their parents, "" for none, and places (3,) in metres."""
    at = {name: i for i, (name, _, _) in enumerate(tree)}
    joints = []
    for name, above, place in tree:
        x, y, z = ((place - tree[at[above]][2] if above else place) / unit).tolist()
        joints.append(Joint(prefix + name, at[above] if above else -1, (x, y, z)))
    return Skeleton(tuple(joints), unit)


MIXAMO = rig("mixamo")
