"""What figures that are steered do of what they are told besides commands: acts in words, points and paths."""

from collections.abc import Sequence

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
from motet_train.evaluate.steer.following import MEASURED_SPEEDS, Track

SAID = (
    *("wave", "clap", "point", "greet", "throw", "drink", "punch", "box", "stretch", "look around"),
    *("kick", "bow", "sit down", "jump", "dance", "turn around", "kneel down", "cartwheel", "pick up", "squat"),
)
"""Acts that figures are told: of the arms, and of the whole body."""

AFTER = 1.0
"""Seconds that are looked at after the longest act."""

FAR = np.array([0.5, 1.0, 2.0, 4.0])
"""Metres to a point that figures are told to go to, in 8 directions from where they face."""

PATH = np.array([[0.0, 4.0], [4.0, 4.0], [4.0, 8.0]])
"""Corners of a path in metres, ahead of where figures stand: a turn to the left, and one to the right."""

UNTIL = 14.0
"""Seconds in which figures go."""


def said_acts(model: SteerModel) -> list[Act]:
    """The acts of :data:`SAID`, as the model ``generate`` that ships makes them."""
    said = SaidActs(model, load_as(CodesModel, "generate"))
    return [said.act(sentence) for sentence in SAID]


def act_figures(model: SteerModel, acts: Sequence[Act], leap: Array, gait: str | None) -> dict[str, float]:
    """What becomes of acts that are told to figures that stand, or that go straight on at a gait's usual speed.

    leap: (J',) the largest steps of joints in recordings, metres. begun, begun_worst: seconds until the arms, head and
    upper back are half way from the pose before to what the act shows. leaps: ticks, from the first to :data:`AFTER`
    the longest act, in which a joint goes a tenth farther, seen from the figure, than in recordings and in the act;
    largest_leap: the most, as a share of that.
    """
    begun, steps = list[float](), list[Array]()
    own = np.array([np.maximum(_steps(_shown(act)).max(axis=0)[0], leap) for act in acts])
    for phase in range(following.PHASES):
        session = model.start(gait, characters=len(acts))
        if gait is not None:
            session.control(speed=MEASURED_SPEEDS[gait], direction=0.0)
        poses = [session.tick() for _ in range(round(following.SETTLE * model.fps) + 4 * phase)][-1:]
        session.act(acts)
        frames = list[list[int]]()
        for _ in range(max(map(len, acts)) + round(AFTER * model.fps)):
            poses.append(session.tick())
            left = [now and round(now[1] * model.fps) for now in session.acting]
            frames.append([-1 if more is None else len(act) - 1 - more for act, more in zip(acts, left, strict=True)])
        shown = np.stack([pose.rotations for pose in poses], axis=1)
        own_frames = zip(acts, shown, np.transpose(frames), strict=True)
        begun += [begins(act, turned, at[at >= 0]) / model.fps for act, turned, at in own_frames]
        steps.append(_steps(Track.of(poses, model.fps)) / own)
    leaps = np.concatenate(steps).max(axis=2)
    found = {"begun": float(np.mean(begun)), "begun_worst": max(begun)}
    return {**found, "leaps": float((leaps > 1.1).sum()), "largest_leap": float(leaps.max())}


def begins(act: Act, shown: Array, frames: Array) -> float:
    """Ticks until a figure is half way to an act, infinite if it never is. shown: rotations (T, J, 4) from the tick
    before the act on. frames: those of the act that it plays from then on."""
    count = len(frames)
    before = _turned(shown[:1], act.rotations[frames[:1] - 1])[0]
    there = _turned(shown[1 : count + 1], act.rotations[frames]) <= before / 2
    return float(there.argmax() + 1) if there.any() else np.inf


def _turned(some: Array, other: Array) -> Array:
    """Mean angles (T,) between the bones above the lower spine, of rotations (T, J, 4)."""
    cosine = np.abs((some[:, UPPER] * other[:, UPPER]).sum(axis=-1))
    found: Array = np.arccos(cosine.clip(0, 1))[:, 1:].mean(axis=1)  # the lower spine makes up for the hips
    return found


def _steps(track: Track) -> Array:
    """Metres (T - 1, B, J') by which joints move from frame to frame, as the figures see it."""
    return length(np.diff(track.seen().places, axis=0))


def _shown(act: Act) -> Track:
    """An act as one figure."""
    rotations, height = act.rotations.astype(np.float32), act.height.astype(np.float32)
    return Track(act.ground[:, None], rotations[:, None], height[:, None], 1.0)


def going_figures(model: SteerModel, gait: str) -> dict[str, float]:
    """Where figures get to that go to points at :data:`FAR` in a gait, and how far they leave :data:`PATH`, from
    standing, in :data:`UNTIL` seconds.

    never: how many have not arrived. off_cm, off_worst_cm: from the points, at the end. s: mean seconds until they
    arrive, infinite where one never does. path_cm, path_p95_cm: from the path, at all ticks until they arrive.
    path_end_cm: from its end, at the end.
    """
    ways = np.radians(np.arange(0, 360, 45))
    points = (FAR[:, None, None] * np.stack([np.sin(ways), np.cos(ways)], axis=1)).reshape(-1, 2)
    session = model.start(gait, characters=len(points))
    session.go_to(points)
    poses, arrived = _gone(session, model.fps)
    off = 100 * length(poses[-1].ground[:, :2] - points)
    there = arrived.any(axis=0)
    found = {"never": float((~there).sum()), "off_cm": off.mean(), "off_worst_cm": off.max()}
    found["s"] = np.where(there, arrived.argmax(axis=0) / model.fps, np.inf).mean()
    session = model.start(gait)
    session.go_along(PATH)
    poses, arrived = _gone(session, model.fps)
    places = np.concatenate([pose.ground[:, :2] for pose in poses])
    left = 100 * from_path(places, np.concatenate([np.zeros((1, 2)), PATH]))
    going = left[: arrived[:, 0].argmax() or None]
    found |= {"path_cm": going.mean(), "path_p95_cm": np.percentile(going, 95)}
    found["path_end_cm"] = 100 * np.hypot(*(places[-1] - PATH[-1]))
    return {name: float(value) for name, value in found.items()}


def _gone(session: SteerSession, fps: float) -> tuple[list[Pose], Flags]:
    """The poses of :data:`UNTIL` seconds, and who has arrived (T, B)."""
    poses, arrived = list[Pose](), list[Flags]()
    for _ in range(round(UNTIL * fps)):
        poses.append(session.tick())
        arrived.append(session.arrived)
    return poses, np.stack(arrived)


def from_path(places: Array, corners: Array) -> Array:
    """Distances (T,) of places (T, 2) from a path of straight lines between corners (P, 2)."""
    starts, lines = corners[:-1], np.diff(corners, axis=0)
    off = places[:, None] - starts
    along = ((off * lines).sum(axis=2) / (lines * lines).sum(axis=1)).clip(0, 1)
    found: Array = length(off - along[..., None] * lines).min(axis=1)
    return found
