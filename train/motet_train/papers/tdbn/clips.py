"""Labelled clips: a few short motions, each with the name of what it shows; and sequences cut from them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from motet.errors import MotionError
from motet.formats import READABLE, read_motion
from motet.motion.kinematics import skeleton_of, without_heading
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet.motion.skeleton import Skeleton
from motet.representation.base import phases
from motet.representation.retargeting import in_joints_of
from motet_train.data.cmu_trials import CMU_CLIPS, CMU_LICENCE, cmu_trial
from motet_train.data.errors import DataError


@dataclass(frozen=True, eq=False)
class Clips:
    """Motions by label, all with the same channels, and the skeleton that shows what is generated from them."""

    motions: Mapping[str, Sequence[Motion]]
    skeleton: Skeleton
    licence: str | None

    @property
    def labels(self) -> tuple[str, ...]:
        """The labels, in the order of control values."""
        return tuple(self.motions)

    @property
    def channels(self) -> tuple[str, ...]:
        """The channels that all motions have."""
        return next(iter(self.motions.values()))[0].channels

    def only(self, labels: Sequence[str]) -> "Clips":
        """The motions of some labels, in their order; DataError where there is no motion of one."""
        missing = [label for label in labels if label not in self.motions]
        if missing or not labels:
            raise DataError(f"the clips show {', '.join(self.labels)}, not {', '.join(missing) or 'nothing'}")
        return replace(self, motions={label: self.motions[label] for label in labels})

    def frames(self, fps: float, channels: tuple[str, ...] | None = None) -> dict[str, list[Array]]:
        """For each label its sequences (T, D) of all or some channels at a model's frame rate, in all phases.

        A 120 Hz clip gives three sequences at 40 fps (thesis 5.1 takes every third frame; the others are data too).
        """
        return {
            label: [phase.values for one in found for phase in phases(one.select(channels or self.channels), fps)]
            for label, found in self.motions.items()
        }


def read_clips(folder: Path | None = None, root_rotation: bool = True, unit: str | float | None = None) -> Clips:
    """Read labelled clips: from ``folder``, or the three CMU trials of the repository.

    ``folder`` holds motion files, LABEL.bvh, and folders of them, LABEL/anything.bvh. Only joint angles are kept, in
    degrees, and with ``root_rotation`` the root's rotation with its heading taken out. unit: the length unit of
    files that do not state theirs, as in :func:`motet.read`. DataError or MotionError name the file that does not fit.
    """
    paths = {label: [cmu_trial(name)] for label, name in CMU_CLIPS.items()} if folder is None else _find(folder)
    read = {
        label: [(path, _angles(read_motion(path, unit=unit), root_rotation)) for path in found]
        for label, found in paths.items()
    }
    first_path, first = next(iter(read.values()))[0]
    motions = {
        label: [_fit(path, motion, first_path, first) for path, motion in found] for label, found in read.items()
    }
    licence = CMU_LICENCE if folder is None else None
    return Clips(motions, _metric(skeleton_of(first)), licence)


def _find(folder: Path) -> dict[str, list[Path]]:
    if not folder.is_dir():
        raise DataError(f"no folder of clips: {folder}")
    found: dict[str, list[Path]] = {}
    for path in sorted(folder.iterdir()):
        files = sorted(path.iterdir()) if path.is_dir() else [path]
        clips = [file for file in files if file.suffix.lower() in READABLE]
        if clips:
            found.setdefault(path.name if path.is_dir() else path.stem, []).extend(clips)
    bad = [label for label in found if not label.isidentifier()]
    if bad:
        raise DataError(f"labels are written in scripts: letters, digits and _ only, not {', '.join(map(repr, bad))}")
    if not found:
        raise DataError(
            f"no clips in {folder}: it needs files LABEL.bvh or folders LABEL/ of {' '.join(READABLE)} files"
        )
    return found


def _angles(motion: Motion, root_rotation: bool) -> Motion:
    """The Euler channels of a motion in degrees, without heading and without leaps."""
    level = without_heading(motion.continuous())
    root = skeleton_of(motion).joints[0].name
    wanted = {
        c for joint, columns in level.rotation_columns().items() if root_rotation or joint != root for c in columns
    }
    channels = tuple(name for column, name in enumerate(level.channels) if column in wanted)
    return level.select(channels, ("deg",) * len(channels))


def _fit(path: Path, motion: Motion, first_path: Path, first: Motion) -> Motion:
    different = sorted(set(motion.channels) ^ set(first.channels))
    if different:
        raise DataError(f"{path} does not match {first_path}: only one of them has {', '.join(different)}")
    try:
        return in_joints_of(motion, first.skeleton).select(first.channels)
    except MotionError as error:
        raise DataError(f"{path} does not match {first_path}: {error}") from error


def _metric(skeleton: Skeleton) -> Skeleton:
    return skeleton if skeleton.metres_per_unit is None else skeleton.scaled(1.0)
