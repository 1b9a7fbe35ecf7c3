"""VRM Animation (.vrma): a GLB whose nodes are the humanoid in a VRM T-pose, with the extension VRMC_vrm_animation 1.0.

Every bone has a rotation, only the hips a translation; players adapt both to their avatar's rest pose and scale the
path by its hip height. The fingers form a relaxed hand.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from motet.errors import MotionError
from motet.files import File, write_whole
from motet.formats.glb import Buffer, Track, animation, container, joint_nodes, joint_tracks
from motet.motion.humanoid import BONES, HUMANOID, LEFT_RIGHT, grounded, on_humanoid, relaxed, sided
from motet.motion.motion import Motion
from motet.motion.rotations import rotmat_to_quat
from motet.motion.skeleton import Joint, Skeleton

EXTENSION = "VRMC_vrm_animation"

THUMB, FINGER = ("Metacarpal", "Proximal", "Distal"), ("Proximal", "Intermediate", "Distal")
"""VRM's names for the joints of the thumb, and of other fingers."""

FINGER_BONES = {
    "Thumb": ((0.025, -0.01, 0.025), (0.035, -0.005, 0.02), (0.025, -0.005, 0.015)),
    "Index": ((0.09, 0.0, 0.03), (0.04, 0.0, 0.0), (0.025, 0.0, 0.0)),
    "Middle": ((0.09, 0.0, 0.01), (0.045, 0.0, 0.0), (0.03, 0.0, 0.0)),
    "Ring": ((0.09, 0.0, -0.01), (0.04, 0.0, 0.0), (0.025, 0.0, 0.0)),
    "Little": ((0.09, 0.0, -0.03), (0.03, 0.0, 0.0), (0.02, 0.0, 0.0)),
}
"""Finger -> offsets of its joints from their parents, in metres, in the left hand; the right one mirrors it."""


def _with_fingers() -> Skeleton:
    joints = list(HUMANOID.joints)
    for side, sign in zip(LEFT_RIGHT, (1.0, -1.0), strict=True):
        for finger, offsets in FINGER_BONES.items():
            parent = HUMANOID.index(sided(side, "Hand"))
            for part, (x, y, z) in zip(THUMB if finger == "Thumb" else FINGER, offsets, strict=True):
                joints.append(Joint(sided(side, finger + part), parent, (sign * x, y, z)))
                parent = len(joints) - 1
    return Skeleton(tuple(joints), metres_per_unit=1.0)


VRMA_SKELETON = _with_fingers()
"""The humanoid with VRM's fingers."""


def write(file: File, motion: Motion) -> None:
    """Write a motion; one of another skeleton is retargeted to the humanoid first.

    MotionError for a motion without frames or of a figure that is not human, OutputError if it cannot be written.
    """
    if not len(motion):
        raise MotionError("this motion has no frames, and a VRM animation cannot be empty")
    motion = grounded(on_humanoid(motion))
    buffer = Buffer()
    document: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "motet"},
        "extensionsUsed": [EXTENSION],
        "extensions": {EXTENSION: {"specVersion": "1.0", "humanoid": {"humanBones": _bones()}}},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": joint_nodes(VRMA_SKELETON),
        "animations": [animation(buffer, "motion", motion, (*joint_tracks(motion, HUMANOID), *_fingers()))],
        **buffer.parts(),
    }
    write_whole(file, container(document, bytes(buffer.content)))


def _bones() -> dict[str, dict[str, int]]:
    fingers = VRMA_SKELETON.names[len(HUMANOID.names) :]
    return {bone: {"node": VRMA_SKELETON.index(bone)} for bone in (*BONES, *fingers)}


def _fingers() -> Iterator[Track]:
    """The tracks of a relaxed hand's fingers, one frame each."""
    still = np.broadcast_to(np.eye(3), (len(VRMA_SKELETON.names), 3, 3))
    turned = relaxed(VRMA_SKELETON, still, VRMA_SKELETON.places)
    for joint in range(len(HUMANOID.names), len(VRMA_SKELETON.names)):
        yield joint, "rotation", rotmat_to_quat(turned[joint : joint + 1])
