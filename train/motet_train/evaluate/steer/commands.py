"""How steered figures carry out commands other than speed and direction: acts in words, points and paths."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from motet.generate.model import CodesModel
from motet.models.load import load_as
from motet.motion.rotations import Array
from motet.steering.action_layer import UPPER
from motet.steering.acts import Act
from motet.steering.model import SteerModel
from motet.steering.pose import Pose
from motet.steering.sentence_acts import SaidActs
from motet.steering.session import SteerSession
from motet_train.evaluate.positions import Flags, length
from motet_train.evaluate.steer import following
from motet_train.evaluate.steer.following import MEASURED_SPEEDS, Track, floats, joint_steps, settled

MEASURED_ACTS = (
    *("wave", "clap", "point", "greet", "throw", "drink", "punch", "box", "stretch", "look around"),
    *("kick", "bow", "sit down", "jump", "dance", "turn around", "kneel down", "cartwheel", "pick up", "squat"),
)
"""The measured acts: of the arms, and of the whole body."""

AFTER = 1.0
"""Seconds that are measured after the longest act."""

GOAL_DISTANCES = np.array([0.5, 1.0, 2.0, 4.0])
"""Metres to the points that figures go to, in 8 directions from where they face."""

CORNERED_PATH = np.array([[0.0, 4.0], [4.0, 4.0], [4.0, 8.0]])
"""Corners of a path in metres, ahead of where figures stand: a turn to the left, and one to the right."""

POINT_SECONDS = 14.0
"""Seconds that figures have to arrive."""


def said_acts(model: SteerModel) -> list[Act]:
    """The acts of :data:`MEASURED_ACTS`, made by the shipped model ``generate``."""
    acts = SaidActs(model, load_as(CodesModel, "generate"))
    return [acts.act(sentence) for sentence in MEASURED_ACTS]


def act_figures(model: SteerModel, acts: Sequence[Act], leap: Array, gait: str | None) -> dict[str, float]:
    """How acts are carried out by figures that stand, or that go straight on at a gait's usual speed.

    leap: (J',) the largest steps of joints in recordings, metres. begun, begun_worst: seconds until the arms, head and
    upper back are half-way from the pose before to that of the act. leaps: ticks, from the first to :data:`AFTER` the
    longest act, in which a joint moves a tenth farther, in the figure's own space, than in recordings and in the act;
    largest_leap: the largest step relative to these.
    """
    # how far each joint may move
    limits = np.array([np.maximum(_largest_steps(act), leap) for act in acts])

    # every act from several phases of the stride
    seconds_to_begin = []
    relative_steps = []
    for phase in range(following.PHASES):
        poses, frames = _acted(model, acts, gait, phase)
        for number, act in enumerate(acts):
            rotations = np.stack([pose.rotations[number] for pose in poses])
            seconds_to_begin.append(begins(act, rotations, frames[number]) / model.fps)
        relative_steps.append(joint_steps(Track.of(poses, model.fps)) / limits)

    # the joint that moves the farthest in each tick
    leaps = np.concatenate(relative_steps).max(axis=2)
    return {
        "begun": float(np.mean(seconds_to_begin)),
        "begun_worst": max(seconds_to_begin),
        "leaps": float((leaps > 1.1).sum()),
        "largest_leap": float(leaps.max()),
    }


def _acted(model: SteerModel, acts: Sequence[Act], gait: str | None, phase: int) -> tuple[list[Pose], list[list[int]]]:
    """The poses from the last one before the acts on, and for each figure the frames of its act that it plays."""
    # going straight on, or standing
    session = model.start(gait, characters=len(acts))
    if gait is not None:
        session.control(speed=MEASURED_SPEEDS[gait], direction=0.0)
    poses = [settled(session, model.fps, phase)]

    # acting, until some time after the longest act
    session.act(acts)
    frames: list[list[int]] = [[] for _ in acts]
    for _ in range(max(map(len, acts)) + round(AFTER * model.fps)):
        poses.append(session.tick())
        for act, acting, act_frames in zip(acts, session.acting, frames, strict=True):
            if acting:
                frames_left = round(acting[1] * model.fps)
                act_frames.append(len(act) - 1 - frames_left)
    return poses, frames


def begins(act: Act, rotations: Array, frames: Sequence[int]) -> float:
    """Ticks until a figure is half-way to an act, infinite if it never is. rotations: (T, J, 4) from the tick before
    the act on. frames: the frames of the act that it plays from then on."""
    count = len(frames)
    first = [frame - 1 for frame in frames[:1]]
    before = _upper_angles(rotations[:1], act.rotations[first])[0]
    half_way = _upper_angles(rotations[1 : count + 1], act.rotations[list(frames)]) <= before / 2
    return float(half_way.argmax() + 1) if half_way.any() else np.inf


def _upper_angles(first: Array, second: Array) -> Array:
    """Mean angles (T,) between two sets of rotations (T, J, 4) over the bones above the lower spine."""
    # half angles between unit quaternions, of which both signs are the same rotation
    cosines = np.abs((first[:, UPPER] * second[:, UPPER]).sum(axis=-1))
    angles = np.arccos(cosines.clip(0, 1))
    means: Array = angles[:, 1:].mean(axis=1)  # the lower spine compensates for the hips
    return means


def _largest_steps(act: Act) -> Array:
    """The largest steps (J',) of joints between the frames of an act, metres."""
    rotations = act.rotations.astype(np.float32)
    height = act.height.astype(np.float32)
    track = Track(act.ground[:, None], rotations[:, None], height[:, None], 1.0)
    steps: Array = joint_steps(track).max(axis=0)[0]
    return steps


def going_figures(model: SteerModel, gait: str) -> dict[str, float]:
    """How figures that stand go to points at :data:`GOAL_DISTANCES` in a gait, and along :data:`CORNERED_PATH`, in
    :data:`POINT_SECONDS` seconds.

    never: how many do not arrive. off_cm, off_worst_cm: final distances from the points. s: mean seconds until they
    arrive, infinite if one never does. path_cm, path_p95_cm: distances from the path in all ticks until they arrive.
    path_end_cm: the final distance from its end.
    """
    return floats(_point_figures(model, gait) | _path_figures(model, gait))


def _point_figures(model: SteerModel, gait: str) -> dict[str, Any]:
    # points all around, at several distances
    angles = np.radians(np.arange(0, 360, 45))
    directions = np.stack([np.sin(angles), np.cos(angles)], axis=1)
    points = (GOAL_DISTANCES[:, None, None] * directions).reshape(-1, 2)

    # how far figures end from their points, and how soon
    session = model.start(gait, characters=len(points))
    session.go_to(points)
    poses, arrived = _gone(session, model.fps)
    errors = 100 * length(poses[-1].ground[:, :2] - points)
    ever_arrived = arrived.any(axis=0)
    seconds = np.where(ever_arrived, arrived.argmax(axis=0) / model.fps, np.inf)
    return {
        "never": (~ever_arrived).sum(),
        "off_cm": errors.mean(),
        "off_worst_cm": errors.max(),
        "s": seconds.mean(),
    }


def _path_figures(model: SteerModel, gait: str) -> dict[str, Any]:
    session = model.start(gait)
    session.go_along(CORNERED_PATH)
    poses, arrived = _gone(session, model.fps)
    places = np.concatenate([pose.ground[:, :2] for pose in poses])
    corners = np.concatenate([np.zeros((1, 2)), CORNERED_PATH])

    # until the figure arrives, or all along
    first_arrived = arrived[:, 0].argmax() or None
    errors = 100 * from_path(places, corners)[:first_arrived]
    return {
        "path_cm": errors.mean(),
        "path_p95_cm": np.percentile(errors, 95),
        "path_end_cm": 100 * np.hypot(*(places[-1] - CORNERED_PATH[-1])),
    }


def _gone(session: SteerSession, fps: float) -> tuple[list[Pose], Flags]:
    """The poses of :data:`POINT_SECONDS` seconds, and which figures have arrived (T, B)."""
    poses = []
    arrived = []
    for _ in range(round(POINT_SECONDS * fps)):
        poses.append(session.tick())
        arrived.append(session.arrived)
    return poses, np.stack(arrived)


def from_path(places: Array, corners: Array) -> Array:
    """Distances (T,) of places (T, 2) from a path of straight lines between corners (P, 2)."""
    starts = corners[:-1]
    lines = np.diff(corners, axis=0)

    # the nearest point of each line
    from_starts = places[:, None] - starts
    along = ((from_starts * lines).sum(axis=2) / (lines * lines).sum(axis=1)).clip(0, 1)
    distances = length(from_starts - along[..., None] * lines)
    nearest: Array = distances.min(axis=1)
    return nearest
