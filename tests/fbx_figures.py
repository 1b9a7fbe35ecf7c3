"""How far motet's joints of FBX files are from Blender's: ``python tests/fbx_figures.py FILE.fbx...``.

Needs ``blender`` on the path, and the extra "fbx".
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import motet
from motet.motion.rotations import Array

PROGRAM = """
import bpy, json, sys
source, out = sys.argv[sys.argv.index("--") + 1:]
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.import_scene.fbx(filepath=source)
figure = next(thing for thing in bpy.data.objects if thing.type == "ARMATURE")
first, last = (round(frame) for frame in figure.animation_data.action.frame_range)
found = []
for frame in range(first, last + 1):
    bpy.context.scene.frame_set(frame)
    found.append([list(figure.matrix_world @ bone.head) for bone in figure.pose.bones])
json.dump({bone.name: [row[i] for row in found] for i, bone in enumerate(figure.pose.bones)}, open(out, "w"))
"""


def in_blender(path: Path) -> dict[str, Array]:
    """The positions (T, 3) of bones in metres, y up, as Blender has them in the frames of the first action."""
    with tempfile.TemporaryDirectory() as folder:
        program, out = Path(folder, "program.py"), Path(folder, "out.json")
        program.write_text(PROGRAM)
        command = ["blender", "-b", "--python", str(program), "--", str(path), str(out)]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        found = {name: np.array(places) for name, places in json.loads(out.read_text()).items()}
    return {name: np.stack([x, z, -y], axis=1) for name, (x, y, z) in ((n, p.T) for n, p in found.items())}


def main() -> None:
    """Print a line for each file."""
    for path in map(Path, sys.argv[1:]):
        motion, theirs = motet.read(path), in_blender(path)
        assert motion.skeleton is not None
        ours = dict(zip(motion.skeleton.names, np.moveaxis(motet.motion.positions(motion), 1, 0), strict=True))
        farthest = max(float(np.linalg.norm(ours[name] - theirs[name], axis=1).max()) for name in theirs)
        height = motion.skeleton.height
        print(f"{path.name}: {len(theirs)} of {len(ours)} joints, {len(motion)} frames, figure {height:.4g} m high,")
        print(f"    farthest {farthest:.2g} m, {farthest / height:.1g} of the height")


if __name__ == "__main__":
    main()
