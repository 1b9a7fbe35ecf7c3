"""VRM Animation (.vrma): a GLB whose nodes are the humanoid in a VRM T-pose, with the extension VRMC_vrm_animation 1.0.

Every bone has its rotation, the hips alone their translation; players turn both to their avatar's rest pose and scale
the path by the height of its hips.
"""

from typing import Any

from motet.errors import MotionError
from motet.files import File, write_whole
from motet.formats.glb import Buffer, animation, container, joint_nodes, joint_tracks
from motet.motion.humanoid import BONES, HUMANOID
from motet.motion.motion import Motion
from motet.motion.retarget import grounded, on_humanoid

EXTENSION = "VRMC_vrm_animation"


def write(file: File, motion: Motion) -> None:
    """Write a motion; one of another skeleton is brought to the humanoid first.

    MotionError for a motion without frames or of a figure that is no human's, OutputError if it cannot be written.
    """
    if not len(motion):
        raise MotionError("this motion has no frames: a VRM animation cannot be without any")
    motion = grounded(on_humanoid(motion))
    buffer = Buffer()
    document: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "motet"},
        "extensionsUsed": [EXTENSION],
        "extensions": {EXTENSION: {"specVersion": "1.0", "humanoid": {"humanBones": _bones()}}},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": joint_nodes(HUMANOID),
        "animations": [animation(buffer, "motion", motion, joint_tracks(motion, HUMANOID))],
        **buffer.parts(),
    }
    write_whole(file, container(document, bytes(buffer.content)))


def _bones() -> dict[str, dict[str, int]]:
    return {bone: {"node": HUMANOID.index(bone)} for bone in BONES}
