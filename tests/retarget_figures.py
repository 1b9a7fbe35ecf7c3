"""Figures of retargeting on the motion beside the project: ``python tests/retarget_figures.py ../shared/data``.

Prints a table of all files by convention, how far trials that exist as AMC and as BVH agree on the humanoid, how
`describe` describes both forms and takes of ACCAD, and what retargeting ten seconds takes.
"""

import sys
import time
import zipfile
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import motet
from motet.errors import MotetError
from motet.figures.humanoid.bones import BONES, HUMANOID, MIXAMO
from motet.figures.humanoid.retarget import from_humanoid, to_humanoid
from motet.formats import read_motion
from motet.models.describe import DescribeModel
from motet.models.language import MAX_SECONDS
from motet.motion.kinematics import global_transforms, motion_of, skeleton_of
from motet.motion.motion import Motion
from motet.motion.skeleton import Skeleton

ARCHIVES = ("cmu-asfamc.zip", "cmu-asfamc-more.zip", "cmu-bvh.zip", "cmu-bvh-more.zip", "accad-bvh.zip")

LEFT_OUT = ("14_36",)
"""A file that is another one's copy, as the data's README says."""

ADDED = {"07_12": 2}
"""Frames that a BVH has before the AMC's where it is not the added T-pose alone: this AMC lacks its first frame."""

SHORT = ("Leg", "Foot", "ToeBase")
STOCKY = replace(
    MIXAMO,
    joints=tuple(
        replace(joint, offset=tuple((0.8 if joint.name.endswith(SHORT) else 1.1) * x for x in joint.offset))
        for joint in MIXAMO.joints
    ),
)
"""A figure of Mixamo's names with short legs and a long trunk."""

TRUNK = ("hips", "spine", "chest", "upperChest", "neck", "head")
LIMBS = tuple(bone for bone in BONES if bone.endswith(("UpperLeg", "LowerLeg", "Foot", "UpperArm", "LowerArm")))


def unpacked(data: Path, folder: Path, names: tuple[str, ...] = ARCHIVES) -> list[Path]:
    """The motion files of the archives, unpacked; those called "NAME-more" over those called "NAME"."""
    for name in names:
        with zipfile.ZipFile(data / name) as archive:
            archive.extractall(folder / name.removesuffix(".zip").removesuffix("-more"))
    files = sorted(path for path in folder.rglob("*") if path.suffix in (".amc", ".bvh"))
    return [path for path in files if path.stem not in LEFT_OUT]


def agreement(bvh: Motion, amc: Motion, added: int) -> tuple[float, dict[str, float]]:
    """Centimetres between the bones' joints, mean over frames and bones; and degrees for each limb's bone, mean.

    added: frames that the BVH has before those of the AMC.
    """
    (turned, places), (other_turned, other_places) = (
        global_transforms(to_humanoid(motion).motion) for motion in (bvh, amc)
    )
    bones = [HUMANOID.index(bone) for bone in BONES]
    frames = min(len(turned) - added, len(other_turned))
    apart = np.linalg.norm(places[added : added + frames, bones] - other_places[:frames, bones], axis=-1)
    limbs = [HUMANOID.index(bone) for bone in LIMBS]
    product = np.swapaxes(turned[added : added + frames, limbs], -1, -2) @ other_turned[:frames, limbs]
    cosines = (np.trace(product, axis1=-2, axis2=-1) - 1) / 2
    degrees = np.degrees(np.arccos(np.clip(cosines, -1, 1))).mean(axis=0)
    return float(100 * apart.mean()), dict(zip(LIMBS, degrees.tolist(), strict=True))


def both_forms(folder: Path) -> Iterator[tuple[str, Motion, Motion, int]]:
    """Trials that exist as BVH and as AMC: name, both motions, and the frames that the BVH adds in front."""
    for path in sorted((folder / "cmu-bvh").glob("*.bvh")):
        amc = folder / "cmu-asfamc" / "amc" / f"{path.stem}.amc"
        if amc.is_file():
            yield path.stem, read_motion(path), read_motion(amc), ADDED.get(path.stem, 1)


def _print_descriptions(folder: Path) -> None:
    """Best sentences of trials in both forms, the T-pose in front of the BVH left out; and of every sixteenth take."""
    model = motet.load_as(DescribeModel, "describe")

    def best(motion: Motion) -> str:
        return model.describe(model.windows(motion)[0][1])[0].text

    print("trial  from AMC | from BVH")
    for name, bvh, amc, added in both_forms(folder):
        print(f"{name}  {best(amc)} | {best(bvh[added:])}")
    for path in sorted((folder / "accad-bvh").rglob("*.bvh"))[::16]:
        print(f"{path.stem}: {best(read_motion(path))}")


def _print_actions(folder: Path) -> None:
    """How many of every third trial are said to be the same action from the AMC and from another figure's BVH."""
    # not above: tests of the runtime take the rest of this file, without the packages of evaluation
    from motet_train.evaluate.language.attributes import ACTIONS, mentioned

    model, same, different = motet.load_as(DescribeModel, "describe"), 0, []
    for path in sorted((folder / "cmu-asfamc" / "amc").glob("*.amc"))[::3]:
        whole = read_motion(path)
        amc = whole[: int(MAX_SECONDS * whole.fps)]
        motet.write(folder / "other.bvh", from_humanoid(to_humanoid(amc).motion, STOCKY))
        pair = [model.describe(motion)[0].text for motion in (amc, read_motion(folder / "other.bvh"))]
        if mentioned(ACTIONS, pair[0]) == mentioned(ACTIONS, pair[1]):
            same += 1
        else:
            different.append(f"{path.stem}  {pair[0]} | {pair[1]}")
    print(f"the same action from an AMC and from the BVH of another figure: {same} of {same + len(different)}")
    print("\n".join(different))


def in_its_start(motion: Motion) -> Motion:
    """The motion on a skeleton that rests in its first frame."""
    skeleton, (turned, places) = skeleton_of(motion), global_transforms(motion)
    offsets = [places[0, i] - (places[0, j.parent] if j.parent >= 0 else 0.0) for i, j in enumerate(skeleton.joints)]
    joints = [replace(j, offset=tuple(o), axis=(0.0, 0.0, 0.0)) for j, o in zip(skeleton.joints, offsets, strict=True)]
    rested = Skeleton(tuple(joints), skeleton.metres_per_unit)
    return motion_of(rested, turned @ np.swapaxes(turned[0], -1, -2), {0: places[:, 0]}, motion.fps)


def _print_rests(figures: Path) -> None:
    """How far off the humanoid is where clips of several characters rest in their first frame, by bones and twists."""
    apart = []
    for path in (figures / f"{name}.glb" for name in ("Michelle", "Soldier", "Xbot", "many-clips")):
        for motion in (read_motion(path, clip=clip) for clip in motet.clips(path)):
            if len(motion) > 4:
                known, guessed = (global_transforms(to_humanoid(m).motion)[0] for m in (motion, in_its_start(motion)))
                cosines = (np.trace(np.swapaxes(known, -1, -2) @ guessed, axis1=-2, axis2=-1) - 1) / 2
                degrees = np.degrees(np.arccos(np.clip(cosines, -1, 1)))
                bones = [[HUMANOID.index(bone) for bone in of] for of in (TRUNK, LIMBS)]
                apart.append([degrees[:, of].mean() for of in bones])
    (trunk, limbs), worst = np.mean(apart, axis=0), np.max(apart)
    print(f"{len(apart)} clips from their start: trunks {trunk:.0f} degrees off, limbs {limbs:.0f}; worst {worst:.0f}")


def _print_times(motion: Motion) -> None:
    """Milliseconds of one core for ten seconds of a motion of CMU's, there and on."""
    for fps in (30, 120):
        few = motion.resample(fps)
        ten = replace(few, values=np.concatenate([few.values] * 20)[: 10 * fps])
        humanoid = to_humanoid(ten).motion
        there, on = _milliseconds(partial(to_humanoid, ten)), _milliseconds(partial(from_humanoid, humanoid, MIXAMO))
        print(f"10 s at {fps} fps: {there:.1f} ms onto the humanoid, {on:.1f} ms from there onto Mixamo's names")


def _milliseconds(what: Callable[[], object]) -> float:
    times = []
    for _ in range(7):
        start = time.process_time()
        what()
        times.append(1000 * (time.process_time() - start))
    return min(times)


def _print_files(files: list[Path]) -> None:
    found: dict[tuple[str, float, tuple[str, ...]], int] = defaultdict(int)
    for path in files:
        try:
            humanoid = to_humanoid(read_motion(path))
            notes = tuple(note.rpartition(",")[0] if note.endswith(" m") else note for note in humanoid.notes)
            found[humanoid.convention, humanoid.confidence, notes] += 1
        except MotetError as error:
            found[f"REFUSED {path.name}: {error}", 0.0, ()] += 1
    for (convention, confidence, notes), count in sorted(found.items()):
        print(f"{count:5d}  {confidence:.2f}  {convention}: {'; '.join(notes)}")


def main(data: Path) -> None:
    """Print all figures."""
    with TemporaryDirectory() as temporary:
        folder = Path(temporary)
        files = [*unpacked(data, folder), *sorted((data / "kit").glob("0*.xml"))]
        print("files  confidence  convention: notes")
        _print_files(files)
        print("trial  frames  joints apart, cm  limbs apart, degrees: mean, worst bone")
        for name, bvh, amc, added in both_forms(folder):
            apart, limbs = agreement(bvh, amc, added)
            worst = max(limbs, key=lambda bone: limbs[bone])
            mean = np.mean(list(limbs.values()))
            print(f"{name}  {len(amc):5d}  {apart:6.2f}  {mean:6.2f}  {worst} {limbs[worst]:.2f}")
        _print_descriptions(folder)
        _print_actions(folder)
        if (data / "figures").is_dir():
            _print_rests(data / "figures")
        _print_times(next(amc for _, _, amc, _ in both_forms(folder)))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
