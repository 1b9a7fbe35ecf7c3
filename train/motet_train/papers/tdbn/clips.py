"""Labelled clips: a few short motions with the names of their actions; their body parts and periods."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from motet.errors import MotionError
from motet.formats import READABLE, read_motion
from motet.motion.kinematics import skeleton_of, without_heading
from motet.motion.motion import Motion
from motet.motion.rotations import Array, Indices
from motet.motion.skeleton import LEFT, MIDDLE, Skeleton, sides_of
from motet.representation.base import phases
from motet.representation.retargeting import in_joints_of
from motet_train.data.cmu_trials import CMU_CLIPS, CMU_LICENCE, cmu_trial
from motet_train.data.errors import DataError

TRUNK_PART = "trunk"

Sequences = Mapping[str, Sequence[Array]]
"""Label -> sequences (T, D) of frames."""


@dataclass(frozen=True, eq=False)
class Clips:
    """Motions by label, all with the same channels, and the skeleton on which generated motions are shown."""

    motions: Mapping[str, Sequence[Motion]]
    skeleton: Skeleton
    licence: str | None

    @property
    def labels(self) -> tuple[str, ...]:
        """The labels, in the order of control values."""
        return tuple(self.motions)

    @property
    def channels(self) -> tuple[str, ...]:
        """The channels of all motions."""
        return next(iter(self.motions.values()))[0].channels

    def only(self, labels: Sequence[str]) -> "Clips":
        """The motions of some labels, in their order; DataError if a label has no motion."""
        missing = [label for label in labels if label not in self.motions]
        if missing or not labels:
            raise DataError(f"the clips show {', '.join(self.labels)}, not {', '.join(missing) or 'nothing'}")
        return replace(self, motions={label: self.motions[label] for label in labels})

    def frames(self, fps: float, channels: tuple[str, ...] | None = None) -> dict[str, list[Array]]:
        """The sequences (T, D) of each label, of all or some channels at a model's frame rate, in all phases.

        A 120 Hz clip gives three sequences at 40 fps (thesis 5.1 takes every third frame; the others are data too).
        """
        sequences: dict[str, list[Array]] = {}
        for label, motions in self.motions.items():
            sequences[label] = []
            for motion in motions:
                selected = motion.select(channels or self.channels)
                sequences[label] += [phase.values for phase in phases(selected, fps)]
        return sequences


def read_clips(folder: Path | None = None, root_rotation: bool = True, unit: str | float | None = None) -> Clips:
    """Read labelled clips: from ``folder``, or the three CMU trials of the repository.

    ``folder`` holds motion files, LABEL.bvh, and folders of them, LABEL/anything.bvh. Only joint angles are kept, in
    degrees, and with ``root_rotation`` the root's rotation without its heading. unit: the length unit of files that do
    not state theirs, as in :func:`motet.read`. DataError or MotionError name a file that does not match the others.
    """
    paths = {label: [cmu_trial(name)] for label, name in CMU_CLIPS.items()} if folder is None else _find(folder)
    first_path = next(iter(paths.values()))[0]
    first = _angles(read_motion(first_path, unit=unit), root_rotation)
    motions: dict[str, list[Motion]] = {}
    for label, files in paths.items():
        motions[label] = []
        for path in files:
            motion = _angles(read_motion(path, unit=unit), root_rotation)
            motions[label].append(_fit(path, motion, first_path, first))
    skeleton = skeleton_of(first)
    metric = skeleton if skeleton.metres_per_unit is None else skeleton.scaled(1.0)
    return Clips(motions, metric, CMU_LICENCE if folder is None else None)


def _find(folder: Path) -> dict[str, list[Path]]:
    if not folder.is_dir():
        raise DataError(f"no folder of clips: {folder}")
    paths: dict[str, list[Path]] = {}
    for path in sorted(folder.iterdir()):
        files = sorted(path.iterdir()) if path.is_dir() else [path]
        clips = [file for file in files if file.suffix.lower() in READABLE]
        if clips:
            paths.setdefault(path.name if path.is_dir() else path.stem, []).extend(clips)
    bad = [label for label in paths if not label.isidentifier()]
    if bad:
        raise DataError(f"labels are written in scripts: letters, digits and _ only, not {', '.join(map(repr, bad))}")
    if not paths:
        raise DataError(
            f"no clips in {folder}: it needs files LABEL.bvh or folders LABEL/ of {' '.join(READABLE)} files"
        )
    return paths


def _angles(motion: Motion, root_rotation: bool) -> Motion:
    """The Euler channels of a motion in degrees, without heading and without leaps."""
    level = without_heading(motion.continuous())
    root = skeleton_of(motion).joints[0].name
    columns: list[int] = []
    for joint, of_joint in level.rotation_columns().items():
        if root_rotation or joint != root:
            columns += of_joint
    channels = tuple(level.channels[column] for column in sorted(columns))
    return level.select(channels, ("deg",) * len(channels))


def _fit(path: Path, motion: Motion, first_path: Path, first: Motion) -> Motion:
    different = sorted(set(motion.channels) ^ set(first.channels))
    if different:
        raise DataError(f"{path} does not match {first_path}: only one of them has {', '.join(different)}")
    try:
        return in_joints_of(motion, first.skeleton).select(first.channels)
    except MotionError as error:
        raise DataError(f"{path} does not match {first_path}: {error}") from error


class BodyParts(NamedTuple):
    """The body parts of a figure.

    names: the parts that have channels; a limb is named by its topmost joint. of_channel: (D,) the part of each
    channel. legs: the parts of the left and the right leg; empty unless two limbs point down.
    """

    names: tuple[str, ...]
    of_channel: Indices
    legs: tuple[int, ...]


def body_parts(skeleton: Skeleton, channels: tuple[str, ...]) -> BodyParts:
    """Divide channels ("JOINT.rx") among the trunk and the limbs (thesis 4.1, figure 4.2).

    A limb begins at a joint of the left or the right side whose parent is in the middle. CMU's skeleton gives the
    thesis' five parts: trunk with head, two legs, two arms. Channels of the root's path belong to the trunk.
    """
    limb_of = _limbs(skeleton)
    limbs = dict(zip(skeleton.names, limb_of, strict=True))
    of_joint = [limbs.get(channel.rpartition(".")[0], TRUNK_PART) for channel in channels]
    names = tuple(dict.fromkeys(of_joint))
    legs = [names.index(limb) for limb in _lowest_limbs(skeleton, limb_of) if limb in names]
    of_channel = np.array([names.index(limb) for limb in of_joint])
    return BodyParts(names, of_channel, tuple(legs) if len(legs) == 2 else ())


def _limbs(skeleton: Skeleton) -> list[str]:
    """The limb of each joint by its topmost joint, or the trunk."""
    sides = sides_of(skeleton.names)
    limb_of = [TRUNK_PART] * len(skeleton.joints)
    for i, joint in enumerate(skeleton.joints[1:], start=1):
        parent_limb = limb_of[joint.parent]
        begins_limb = parent_limb == TRUNK_PART and sides[i] != MIDDLE
        limb_of[i] = joint.name if begins_limb else parent_limb
    return limb_of


def _lowest_limbs(skeleton: Skeleton, limb_of: Sequence[str]) -> list[str]:
    """The limb with the lowest joint at rest on each side, the left one first."""
    lowest: dict[str, tuple[float, str]] = {}
    for limb, side, position in zip(limb_of, sides_of(skeleton.names), skeleton.rest_positions, strict=True):
        if limb != TRUNK_PART:
            lowest[side] = min(lowest.get(side, (np.inf, "")), (float(position[1]), limb))
    by_side = sorted(lowest.items(), key=lambda item: item[0] != LEFT)
    return [limb for _, (_, limb) in by_side]


def period(frames: Array) -> float:
    """The period of frames (T, D), in frames; NaN if there is none.

    It is the first peak of the autocorrelation that reaches 0.9 of the largest peak, refined by a parabola.
    """
    # autocorrelation, without normalisation
    signal = frames - frames.mean(axis=0)
    lags = min(len(signal) - 8, 200)
    curve = np.array([_autocorrelation(signal, lag) for lag in range(lags)])
    # positive local maxima
    inner = curve[1:-1]
    peaks = np.flatnonzero((inner > curve[:-2]) & (inner >= curve[2:]) & (inner > 0)) + 1
    if not len(peaks) or signal.std() < 1e-6:
        return float("nan")
    # the first high peak, and the vertex of the parabola through it and its neighbours
    peak = int(peaks[np.argmax(curve[peaks] > 0.9 * curve[peaks].max())])
    left, middle, right = curve[peak - 1 : peak + 2]
    return float(peak + 0.5 * (left - right) / (left - 2 * middle + right))


def _autocorrelation(signal: Array, lag: int) -> float:
    products = signal[lag:] * signal[: len(signal) - lag]
    return float(products.sum() / len(products))


def is_periodic(sequences: Sequence[Array]) -> bool:
    """Whether all sequences (T, D) of a motion repeat their poses, as walking does and bending over does not."""
    return all(np.isfinite(period(frames)) for frames in sequences)
