"""How files of other makers come in: ``python tests/check_figures.py FILE...`` prints a table of them.

For each file what ``motet.check`` finds, how far thighs, shins, upper arms and forearms of the humanoid point from
where those of the file do, and how far its path is off the file's, in figures of one size, over all frames of all
clips. Where the joints of a glTF file are in the world is computed by kinematics that are not motet's; those of others
are as motet reads them. Files that do not say their unit rightly get it as FILE=UNIT.
"""

import sys
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent / "runtime"))
from gltf_player import Array, Played

import motet
from motet.errors import MotetError
from motet.figures.humanoid.bones import ARM, HUMANOID, LEFT_RIGHT, LEG, leg_length, sided

LIMBS = [tuple(sided(side, part) for part in limb) for side in LEFT_RIGHT for limb in (LEG[:3], ARM[1:])]


def in_file(path: Path, clip: int, motion: motet.Motion, names: Mapping[str, str]) -> dict[str, Array]:
    """Positions (T, 3) of the joints of bones, as the file has them."""
    if path.suffix == ".glb":
        played = Played(path)
        played.play(played.sampled(clip, motion.fps, len(motion)))
        return {bone: played.places(name)[:, 0] for bone, name in names.items()}
    assert motion.skeleton is not None
    places = motet.motion.positions(motion)
    return {bone: places[:, motion.skeleton.index(name)] for bone, name in names.items()}


def apart(path: Path, clip: int, motion: motet.Motion) -> tuple[Array, float]:
    """Degrees (T, limbs) between the bones of limbs of the humanoid and those of the file, and centimetres between
    their paths."""
    found = motet.to_humanoid(motion)
    joints = {bone: found.joints[bone][0] for limb in LIMBS for bone in limb}
    theirs, places = in_file(path, clip, motion, joints), motet.motion.positions(found.motion)
    ours = {bone: places[:, HUMANOID.index(bone)] for bone in joints}
    degrees = []
    for upper, lower in (pair for limb in LIMBS for pair in pairwise(limb)):
        one, other = (bones[lower] - bones[upper] for bones in (theirs, ours))
        cosines = np.sum(one * other, axis=1) / np.linalg.norm(one, axis=1) / np.linalg.norm(other, axis=1)
        degrees.append(np.degrees(np.arccos(np.clip(cosines, -1, 1))))
    one, other = (way(bones) for bones in (theirs, ours))
    return np.stack(degrees, axis=1), float(100 * np.linalg.norm(one - other, axis=1).max())


def way(places: Mapping[str, Array]) -> Array:
    """The path (T, 3) of the middle of the hips' joints from where it begins, with legs as long as the humanoid's."""
    middle = (places["leftUpperLeg"] + places["rightUpperLeg"]) / 2
    leg = sum(np.linalg.norm(places[lower][0] - places[upper][0]) for upper, lower in pairwise(LIMBS[0]))
    found: Array = (middle - middle[0]) * (leg_length() / leg)
    return found


def row(path: Path, unit: str | None) -> str:
    """The line of one file."""
    names: tuple[str | None, ...] = motet.clips(path) or (None,)
    checked = [motet.check(path, clip=name, unit=unit) for name in names]
    good = [number for number, one in enumerate(checked) if one.refused is None]
    if not good:
        return f"| `{path.name}` | refused: {checked[0].refused} | | | 0 of {len(names)} | | |"
    found = [apart(path, number, motet.read(path, clip=names[number], unit=unit)) for number in good]
    errors, path_off = np.concatenate([limbs for limbs, _ in found]), max(off for _, off in found)
    first = checked[good[0]]
    sure, count = min(checked[number].confidence or 0 for number in good), f"{len(good)} of {len(names)}"
    told = f"| `{path.name}` | {first.convention} | {sure:.2f} | {first.height:.2f} m | {count}"
    return f"{told} | {errors.mean():.3f}, {errors.max():.2f} | {path_off:.1f} |"


def main(arguments: list[str]) -> None:
    """Print the table."""
    print(
        "| file | figure | sure | tall | clips | limbs off, degrees: mean, most | path off, cm |\n" + "|---" * 7 + "|"
    )
    for argument in arguments:
        name, _, unit = argument.partition("=")
        try:
            print(row(Path(name), unit or None))
        except MotetError as error:
            print(f"| `{Path(name).name}` | {error} | | | | | |")


if __name__ == "__main__":
    main(sys.argv[1:])
