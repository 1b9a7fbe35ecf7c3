"""Limbs are found by the tree beside whatever a body wears or carries, and in files without telling names."""

import numpy as np
import pytest

from motet.figures.humanoid import HUMANOID, map_of
from motet.motion.motion import Motion
from motet.motion.skeleton import END_SUFFIX, Joint, Skeleton

Place = tuple[float, float, float]

ODD = tuple(name.replace("left", "L_").replace("right", "R_").replace("Upper", "Up") for name in HUMANOID.names)
"""Names that no table has, which tell sides."""

BARE = tuple(f"b{i:02}" for i in range(len(HUMANOID.names)))
"""Names that tell nothing: no tip is called one, either."""

HAIR = [("head", f"Hair{k}", [(0.08 * np.cos(k), 0.1, 0.08 * np.sin(k)), *[(0.0, -0.2, 0.0)] * 5]) for k in range(16)]
STRANDS = [("head", f"strand{k}", chain) for k, (_, _, chain) in enumerate(HAIR)]
THIRD_ARM = [("chest", "q", [(0.0, 0.1, -0.15), (0.0, 0.1, -0.3), (0.0, 0.3, 0.0), (0.0, 0.3, 0.1), (0.2, 0.2, 0.2)])]
CAPE = [("chest", f"Cape{k}", [(0.05 * k, 0.15, -0.1), *[(0.0, -0.3, 0.0)] * 4]) for k in range(-2, 3)]
SKIRT = [
    ("hips", f"Skirt{k}", [(0.1 * np.cos(k), -0.05, 0.1 * np.sin(k)), *[(0.0, -0.25, 0.0)] * 4]) for k in range(12)
]


def wearing(names: tuple[str, ...], chains: list[tuple[str, str, list[Place]]]) -> Motion:
    """The humanoid at rest under other names, with chains of joints: bone, name, offsets."""
    joints = [Joint(name, joint.parent, joint.offset) for name, joint in zip(names, HUMANOID.joints, strict=True)]
    for bone, name, offsets in chains:
        at = HUMANOID.index(bone)
        for k, offset in enumerate(offsets):
            joints.append(Joint(f"{name}_{k}", at, offset))
            at = len(joints) - 1
    order: list[int] = []  # parents first, branch by branch
    waiting = [0]
    while waiting:
        at = waiting.pop()
        order.append(at)
        waiting += [i for i in reversed(range(len(joints))) if joints[i].parent == at]
    new = {at: i for i, at in enumerate(order)} | {-1: -1}
    skeleton = Skeleton(tuple(Joint(joints[i].name, new[joints[i].parent], joints[i].offset) for i in order), 1.0)
    return Motion(np.zeros((1, 0)), (), (), 1.0, skeleton)


def limbs_of(names: tuple[str, ...], chains: list[tuple[str, str, list[Place]]]) -> dict[str, str]:
    motion = wearing(names, chains)
    assert motion.skeleton is not None
    found = map_of(motion)
    assert found.convention == "by the tree"
    named = {bone: motion.skeleton.names[joint] for bone, joint in found.joints.items()}
    return {HUMANOID.names[names.index(name)]: bone for bone, name in named.items() if name in names}


@pytest.mark.parametrize("chains", [HAIR, STRANDS, THIRD_ARM, CAPE, SKIRT, HAIR + THIRD_ARM + CAPE + SKIRT])
def test_what_a_body_wears_is_no_limb(chains: list[tuple[str, str, list[Place]]]) -> None:
    found = limbs_of(ODD, chains)
    assert all(bone == joint for joint, bone in found.items())
    assert {"leftHand", "rightUpperArm", "leftFoot", "rightLowerLeg", "leftShoulder", "hips"} <= found.keys()


@pytest.mark.parametrize("chains", [[], THIRD_ARM, SKIRT, HAIR])
def test_a_leaf_below_the_hand_is_its_end(chains: list[tuple[str, str, list[Place]]]) -> None:
    found = limbs_of(BARE, chains)
    assert all(bone == joint for joint, bone in found.items())
    assert {"leftHand", "rightUpperArm", "leftFoot", "rightLowerLeg"} <= found.keys()


@pytest.mark.parametrize("short", [True, False])
def test_a_hand_without_anything_below_it_is_a_hand(short: bool) -> None:
    names = [name for name in HUMANOID.names if not name.endswith(END_SUFFIX)]
    kept = [HUMANOID.index(name) for name in names]
    joints = [HUMANOID.joints[i] for i in kept]
    clavicle = 1.0 if short else 1.6
    skeleton = Skeleton(
        tuple(
            Joint(
                f"b{i}",
                kept.index(joint.parent) if joint.parent >= 0 else -1,
                tuple(x * (clavicle if "UpperArm" in joint.name else 1.0) for x in joint.offset),
            )
            for i, joint in enumerate(joints)
        ),
        1.0,
    )
    found = map_of(Motion(np.zeros((1, 0)), (), (), 1.0, skeleton))
    assert all(names[joint] == bone for bone, joint in found.joints.items())
    assert "leftHand" in found.joints


def test_a_table_that_lacks_one_side_leaves_it_to_a_tree_that_agrees() -> None:
    names = tuple("Grip" if name == "rightHand" else name for name in HUMANOID.names)
    motion = wearing(names, [])
    assert motion.skeleton is not None
    found = map_of(motion)
    assert found.convention == "by the tree"
    assert [motion.skeleton.names[found.joints[bone]] for bone in ("leftHand", "rightHand")] == ["leftHand", "Grip"]
