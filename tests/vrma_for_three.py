"""Writes a VRM animation and where its joints are, for ``tests/vrma_in_three.mjs``: FOLDER [MOTION]."""

import json
import sys
from pathlib import Path

from motet.figures.humanoid.bones import HUMANOID
from motet.figures.humanoid.retarget import to_humanoid
from motet.formats import glb, read_motion
from motet.motion.kinematics import positions


def main(folder: Path, source: Path) -> None:
    """Write motion.vrma and motion.json."""
    motion = to_humanoid(read_motion(source)).motion
    folder.mkdir(parents=True, exist_ok=True)
    glb.write_vrma(folder / "motion.vrma", motion)
    parents = [HUMANOID.names[joint.parent] if joint.parent >= 0 else None for joint in HUMANOID.joints]
    joints = [
        {"name": joint.name, "parent": parent, "offset": joint.offset}
        for joint, parent in zip(HUMANOID.joints, parents, strict=True)
    ]
    facts = {"fps": motion.fps, "joints": joints, "places": positions(motion).tolist()}
    (folder / "motion.json").write_text(json.dumps(facts))


if __name__ == "__main__":
    folder, *source = map(Path, sys.argv[1:])
    main(folder, source[0] if source else Path(__file__).parent / "runtime" / "skeletons" / "lafan1.bvh")
