"""How motions stand on characters: ``python tests/character_figures.py MOTION... -- CHARACTER.glb...``.

Each motion is written by --like and by --onto, and played by the names of the character's nodes with kinematics that
are not motet's. Printed for each: the height of the lowest corner of the character's mesh (of its lowest joint where it
has none), the least, median and largest over all frames, in centimetres for a figure with the legs of the humanoid; how
far the trunk is off the humanoid's, in the median frame and at most, and the limbs at most, in degrees; and how much
longer the path is than the humanoid's, in percent, legs made alike.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent / "runtime"))
from gltf_player import Array, Played

import motet
from motet.figures.humanoid.bones import HUMANOID, LEFT_RIGHT, leg_length, sided
from motet.figures.humanoid.retarget import map_of, on_humanoid
from motet.formats import read_character

BONES = [
    (sided(side, a), sided(side, b))
    for side in LEFT_RIGHT
    for a, b in (("UpperLeg", "LowerLeg"), ("LowerLeg", "Foot"), ("UpperArm", "LowerArm"), ("LowerArm", "Hand"))
]


def angles(one: Array, other: Array) -> Array:
    """Degrees between vectors (..., 3)."""
    unit = [vectors / np.linalg.norm(vectors, axis=-1, keepdims=True) for vectors in (one, other)]
    return np.degrees(np.arccos(np.clip(np.sum(unit[0] * unit[1], axis=-1), -1, 1)))


def trunk(places: dict[str, Array]) -> Array:
    """Left, up and forward (T, 3, 3) of the trunk, from the joints of legs and arms."""
    left = places["leftUpperLeg"] - places["rightUpperLeg"]
    arms, legs = ((places[sided("left", part)] + places[sided("right", part)]) / 2 for part in ("UpperArm", "UpperLeg"))
    up = (arms - legs) / np.linalg.norm(arms - legs, axis=-1, keepdims=True)
    left = left - np.sum(left * up, axis=-1, keepdims=True) * up
    left /= np.linalg.norm(left, axis=-1, keepdims=True)
    return np.stack([left, up, np.cross(left, up)], axis=-1)


def way(places: dict[str, Array]) -> float:
    """Length of the path of the legs' middle on the ground."""
    legs = (places["leftUpperLeg"] + places["rightUpperLeg"]) / 2
    return float(np.linalg.norm(np.diff(legs[:, [0, 2]], axis=0), axis=1).sum())


def measured(file: Path, played: Played, motion: motet.Motion) -> str:
    """The figures of one motion on one character."""
    character = read_character(file)
    joints = (character.joint_map or map_of(character.rest)).joints
    names = {bone: character.rest.skeleton.names[joint] for bone, joint in joints.items()}
    figure, still = ({bone: each.places(name)[:, 0] for bone, name in names.items()} for each in (played, Played(file)))
    own = motet.motion.positions(motion)
    human = {bone: own[:, HUMANOID.index(bone)] for bone in names}
    if trunk(still)[0, 2, 2] < 0:  # the character faces the other way at rest
        figure, still = ({bone: each * [-1, 1, -1] for bone, each in places.items()} for places in (figure, still))
    scale = sum(np.linalg.norm(figure[a][0] - figure[b][0]) for a, b in BONES[:2]) / leg_length()
    points = [played.skin(node) for node in played.skinned()] or [played.places(*names.values())]
    lowest = np.min([each[..., 1].min(axis=1) for each in points], axis=0) / scale
    up = trunk(figure) @ trunk(still)[0, 1]  # where the rest's up points; the line of the trunk may lean at rest
    tilt = angles(up, trunk(human)[..., 1])
    limb = max(angles(figure[b] - figure[a], human[b] - human[a]).max() for a, b in BONES)
    path = 100 * (way(figure) / scale / max(way(human), 1e-9) - 1)
    least, middle, most = (100 * height for height in (lowest.min(), np.median(lowest), lowest.max()))
    ground = f"lowest {least:6.1f}, {middle:5.1f}, {most:5.1f} cm"
    return f"{ground}  trunk {np.median(tilt):4.1f}, {tilt.max():4.1f} limbs {limb:4.1f} deg  path {path:5.2f} %"


def main(arguments: list[str]) -> None:
    """Print a line for each character, motion and way of writing."""
    cut = arguments.index("--")
    for file in map(Path, arguments[cut + 1 :]):
        for source in map(Path, arguments[:cut]):
            motion = on_humanoid(motet.read(source))
            with tempfile.TemporaryDirectory() as folder:
                like, onto = Path(folder) / "like.glb", Path(folder) / "onto.glb"
                motet.write(like, motion, like=file)
                motet.write(onto, motion, onto=file)
                for way_of, figure in (("like", Played(file)), ("onto", Played(onto))):
                    clip = Played(like if way_of == "like" else onto).clip()
                    print(f"{file.stem:16} {source.stem:8} {way_of}  {measured(file, figure.play(clip), motion)}")


if __name__ == "__main__":
    main(sys.argv[1:])
