"""The rows of motion matching: all that its loop (:mod:`motet.steering.matching`) needs to know of each recorded frame.

Letters in shapes: T frames, N rows, J bones, F features, G gaits.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motet.figures.feet.contacts import ContactSettings
from motet.figures.humanoid import BONES
from motet.motion.kinematics import global_transforms
from motet.motion.motion import Motion
from motet.motion.rotations import Array, rotmat_to_quat
from motet.motion.skeleton import partners_of
from motet.representation.contract import named
from motet.representation.root_block import poses_of
from motet.representation.root_sixd import ROOT_SIXD, joint_rotations
from motet.steering.acts import foot_contacts, pose_features
from motet.steering.matching import HORIZONS, horizons, mirrored_features, speed_feature
from motet.steering.pose import seen
from motet.steering.recorded import Recording
from motet.steering.settings import SteeringSettings

GROUPS = {
    "places": (2 * HORIZONS, 1.0),
    "facings": (2 * HORIZONS, 1.5),
    "speed": (1, 2.5),
    "feet": (6, 0.94),
    "feet_speeds": (6, 1.25),
    "hips_speed": (3, 1.0),
    "hands": (6, 0.5),
}
"""Groups of features, with the length and the weight of each.

Most weights are those of Holden et al. 2020, "Learned Motion Matching"; feet weigh a quarter more, so that fewer
swinging feet have to stop at a transition."""


STANCE_CONTACTS = ContactSettings(heights=(0.03, 0.06), speeds=(0.2, 0.6))
"""Contacts of recorded soles on level ground: a foot turning on its ball is in contact, a landing foot is not yet."""

LEAP_DISTANCE = 0.4
"""Shortest flight, in seconds, that is a leap rather than part of a running step."""

LEAP_MARGIN_SECONDS = 0.3
"""Seconds before and after a leap that belong to it."""


@dataclass(frozen=True, eq=False)
class MatchingRows:
    """N rows, recording after recording.

    poses: (N, 4 J + 1) quaternions (x, y, z, w) of the bones, the hips' relative to the facing, and the hips' height.
    moves: (N, 3) forward and left in m/s, turn in rad/s, since the frame before. speed: (N,). contacts: (N, 2) from 0
    to 1. features: (N, F), not scaled. gaits: (N, G) bool. left: (N,) number of later rows in the same recording.
    """

    poses: Array
    moves: Array
    speed: Array
    contacts: Array
    features: Array
    gaits: NDArray[np.bool_]
    left: NDArray[np.int64]

    def __len__(self) -> int:
        """N."""
        return len(self.poses)


def rows_of(recordings: list[Recording], gaits: tuple[str, ...], settings: SteeringSettings) -> MatchingRows:
    """The rows of recordings on the humanoid; quaternions of a bone lie on one half of their sphere where possible.

    Recordings that are played as recorded, such as jumps, have speed 0, so that they are never time-stretched: a
    falling body has its own rate. Rows of leaps within other gaits belong to no gait, so that no search ends in them.
    """
    # compute each recording on its own, and concatenate
    parts = [_rows(recording.features, settings) for recording in recordings]
    poses, moves, speed, contacts, features = (np.concatenate(column) for column in zip(*parts, strict=True))
    lengths = [len(recording.features) for recording in recordings]
    left = np.concatenate([np.arange(length)[::-1] for length in lengths])
    # the gaits of each recording, for each of its rows
    gait_table = [_shown_gaits(recording, gaits) for recording in recordings]
    shown = np.repeat(gait_table, lengths, axis=0)
    # what is played as recorded has no speed, and leaps no gait
    as_recorded = np.repeat([recording.as_recorded for recording in recordings], lengths)
    airborne = contacts.max(axis=1) < settings.stands
    shown[~as_recorded & _leaps(airborne, recordings[0].features.fps)] = False
    speed = np.where(as_recorded, 0.0, speed)
    return MatchingRows(_aligned(poses), moves, speed, contacts, features, shown, left)


def _shown_gaits(recording: Recording, gaits: tuple[str, ...]) -> list[bool]:
    return [gait in recording.gaits for gait in gaits]


def _leaps(airborne: NDArray[np.bool_], fps: float) -> NDArray[np.bool_]:
    """The rows (N,) of flights of :data:`LEAP_DISTANCE` seconds and more, and of :data:`LEAP_MARGIN_SECONDS` seconds
    before and after."""
    # rows in the middle of a long enough flight, all of that flight, and what is around it
    flight = round(LEAP_DISTANCE * fps / 2)
    middle = np.asarray(_near(airborne, flight).all(axis=1))
    margin = round(LEAP_MARGIN_SECONDS * fps)
    return np.asarray(_near(middle, flight + margin).any(axis=1))


def _near(flags: NDArray[np.bool_], reach: int) -> NDArray[np.bool_]:
    """For each of the flags (N,) those from ``reach`` before to ``reach`` after it (N, 2 reach + 1), false beyond the
    ends."""
    return np.lib.stride_tricks.sliding_window_view(np.pad(flags, reach), 2 * reach + 1)


def _rows(features: Motion, settings: SteeringSettings) -> tuple[Array, Array, Array, Array, Array]:
    """Poses, moves, speed, contacts and features of one recording."""
    fps = features.fps
    rotations, places = global_transforms(named("root_sixd").motion(features))
    block = features.select(ROOT_SIXD).values
    way = poses_of(block, fps)  # x, z, facing
    contacts = foot_contacts(rotations, places, fps, STANCE_CONTACTS)
    speed = _smooth_speed(block, fps)
    # features: the trajectory ahead, the speed at the second horizon, and the pose
    times = horizons(settings)
    ahead = np.minimum(np.arange(len(speed)) + round(times[1] * fps), len(speed) - 1)
    trajectory = _trajectory(way, times, fps)
    speed_ahead = speed_feature(speed[ahead], settings)[:, None]
    pose = pose_features(places, way, fps)
    matched = np.concatenate([trajectory, speed_ahead, pose], axis=1)
    return _poses(features, block[:, 3]), block[:, :3], speed, contacts, matched


def _poses(features: Motion, height: Array) -> Array:
    """Quaternions of the bones' local rotations, and the hips' height: (T, 4 J + 1)."""
    local = joint_rotations(features)
    quats = np.stack([rotmat_to_quat(local[bone]) for bone in BONES], axis=1)
    return np.column_stack([quats.reshape(len(features), -1), height])


def _smooth_speed(block: Array, fps: float) -> Array:
    """Speeds (T,) on the floor in m/s, averaged over half a second; fewer frames count at the ends."""
    speed = np.hypot(block[:, 0], block[:, 1])
    window = np.ones(min(round(0.5 * fps), len(speed)))
    counts = np.convolve(np.ones(len(speed)), window, "same")
    smooth: Array = np.convolve(speed, window, "same") / counts
    return smooth


def _trajectory(way: Array, times: list[float], fps: float) -> Array:
    """Places and facings of the root ``times`` seconds later, relative to each row (T, 12).

    Beyond the last frame the root goes straight on at its final velocity.
    """
    # beyond its end a recording goes on as in its last tenth of a second
    last = len(way) - 1
    tenth = round(fps / 10)  # of a second, in frames
    final_velocity = (way[last] - way[max(0, last - tenth)]) * fps / max(1, min(last, tenth))
    offsets = []
    for time in times:
        frame = np.arange(len(way)) + round(time * fps)
        seconds_beyond = np.maximum(frame - last, 0)[:, None] / fps
        recorded = way[np.minimum(frame, last)] - way
        offsets.append(recorded + seconds_beyond * final_velocity * (1, 1, 0))
    # seen from each row's facing
    places = [seen(offset[:, :2], way[:, 2]) for offset in offsets]
    facings = [_direction(offset[:, 2]) for offset in offsets]
    return np.concatenate(places + facings, axis=1)


def _direction(angle: Array) -> Array:
    """Unit vectors (T, 2) of angles (T,)."""
    return np.stack([np.sin(angle), np.cos(angle)], axis=1)


def _aligned(poses: Array) -> Array:
    """Poses with the signs of quaternions that are nearest to their bone's mean, the same in the mirror image."""
    quats = poses[:, :-1].reshape(len(poses), -1, 4)
    # the mean depends on the signs, and the signs on the mean
    mean = quats[0]
    for _ in range(3):
        quats = np.where((quats * mean).sum(axis=-1, keepdims=True) < 0, -quats, quats)
        mean = quats.mean(axis=0)
    return np.column_stack([quats.reshape(len(poses), -1), poses[:, -1]])


def mirrored_poses() -> tuple[NDArray[np.intp], Array]:
    """The columns (P,) and signs (P,) that turn a pose into its mirror image."""
    partners = np.array(partners_of(BONES))
    columns = (4 * partners[:, None] + np.arange(4)).ravel()
    signs = np.tile([1.0, -1.0, -1.0, 1.0], len(BONES))
    return np.append(columns, len(columns)), np.append(signs, 1.0)


def scaling(features: Array) -> tuple[Array, Array]:
    """Mean and scale (F,) by which features are normalised and their groups weighted, the same in the mirror image."""
    # statistics over recorded and mirrored rows
    columns, signs = mirrored_features()
    both = np.concatenate([features, features[:, columns] * signs])
    # one scale for all features of a group
    lengths, weights = zip(*GROUPS.values(), strict=True)
    groups = np.split(both.var(axis=0), np.cumsum(lengths)[:-1])
    scale = [weight / np.sqrt(group.mean()) for weight, group in zip(weights, groups, strict=True)]
    return both.mean(axis=0), np.repeat(scale, lengths)
