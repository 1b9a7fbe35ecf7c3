"""The thesis' nets as a steered figure that travels: root velocities are channels, and labels are directions.

There are six control values from 0 to 1 (:data:`LABELS`). A trained net is steered with the interface of motion
matching, so that the same measures apply: each tick, a simple rule turns speed, direction and facing into control
values, for the velocity relative to the figure and a turn towards the facing; the root moves by the velocities that the
net generates.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from motet.bundle.graph import Floats
from motet.figures.feet.contacts import ContactSettings, standing
from motet.figures.humanoid import sole_points
from motet.motion.motion import Motion
from motet.motion.rotations import Array, quat_to_rotmat, rotmat_to_quat, wrapped
from motet.papers.tdbn_control import TdbnModel
from motet.representation.contract import MotionContract, living
from motet.representation.root_sixd import ROOT_SIXD, sixd_to_rotmat
from motet.steering.foot_lock import FootLock, FootLockSettings
from motet.steering.pose import Pose
from motet.steering.recorded import Recording
from motet_train.data.recorded import gaits_of, recordings
from motet_train.data.store import Store
from motet_train.data.table import Gait, read_toml
from motet_train.models.net import configured
from motet_train.papers.tdbn.recipe import train_lessons, untrained
from motet_train.papers.tdbn.tdbn import AngleCRBMConfig, Lessons, TDBNConfig
from motet_train.recipes.recipe import Job, Recipe
from motet_train.runs import Run

LABELS = ("forward", "backward", "left", "right", "turn_left", "turn_right")

FULL_CONTROL = (4.5, 4.5, 3.0)
"""The velocities of a control value of 1: forward and sideways in m/s, turning in rad/s."""


def controls_of(velocities: ArrayLike) -> Array:
    """Velocities (..., 3), forward, to the left (m/s) and turning to the left (rad/s), as control values (..., 6)."""
    shares = np.asarray(velocities, dtype=np.float64) / FULL_CONTROL
    # a value for each direction of each velocity
    both = np.stack([shares, -shares], axis=-1)
    return np.clip(both, 0, 1).reshape(*shares.shape[:-1], len(LABELS))


def course(features: Motion) -> Array:
    """Velocities (T, 3) of frames in ``root_sixd``, each the mean over the next half second, or to the end."""
    values = features.select(ROOT_SIXD[:3]).values
    total = np.concatenate([np.zeros((1, 3)), np.cumsum(values, axis=0)])
    start = np.arange(len(values))
    stop = np.minimum(start + max(1, round(0.5 * features.fps)), len(values))
    return np.asarray((total[stop] - total[start]) / (stop - start)[:, None])


GAIT_SPEEDS = {"walk": (0.3, 1.8), "run": (1.8, 4.0)}
"""Range of speeds of each gait, m/s. The net has no gaits: it walks or runs depending on the speed."""

STEERED_NETS = read_toml(__file__, "steered.toml")
TDBN: TDBNConfig = configured(TDBNConfig, STEERED_NETS["tdbn"])
CRBM: AngleCRBMConfig = configured(AngleCRBMConfig, STEERED_NETS["crbm"])

RECIPES = {
    "default": Recipe("control", "tdbn", "session", TDBN),
    "recorded-past": Recipe("control", "tdbn", "session", replace(TDBN, unrolled=0, past_noise=0.3)),
    "crbm": Recipe("control", "angle-crbm", "session", CRBM),
}
"""The deep net; the same with the thesis' training, on recorded pasts only; and Taylor's net, without the RBM."""


def train_steered(store: Store, job: Job, data: str = "") -> Run:
    """Train on the recordings of a store in ``root_sixd`` that show :data:`GAIT_SPEEDS`, and on their mirror images.

    DataError if a gait has no recording, or the store is in another representation.
    """
    store.needs_sixd("steering is trained on")
    config = replace(job.recipe.config, fps=store.fps)
    known = {gait.name: gait for gait in gaits_of(store)}
    recorded = recordings(store, tuple(known.get(name, Gait(name, (), ())) for name in GAIT_SPEEDS))
    contract, motions = mirrored_too(store, recorded)
    assert store.skeleton is not None
    # the net, with the mean and scale of all frames
    net = untrained(config, store.skeleton, store.channels, len(LABELS))
    net.measure_by(contract.mean, contract.std * config.sigma)
    control = {"labels": LABELS, "starts": dict.fromkeys(LABELS, _start(recorded, config.taps))}
    about = {"data": {"name": data, "recordings": len(recorded), "frames": sum(map(len, motions))}}
    manifest = job.manifest(contract, net.to_config(), net.defaults, None, about, control=control)
    return train_lessons(net, job, manifest, _lessons(motions))


def _lessons(motions: Sequence[Motion]) -> Lessons:
    """Recordings under the control of their course, in one group, so that long ones weigh as much as short ones."""
    sequences = [motion.values for motion in motions]
    controls = [controls_of(course(motion)) for motion in motions]
    return Lessons([sequences], [controls], [1.0])


def _start(recorded: Sequence[Recording], taps: int) -> list[list[float]]:
    """The first frames of the recording that begins with the least movement of the root."""
    beginnings = [recording.features.values[:taps] for recording in recorded if len(recording.features) >= taps]
    stillest = min(beginnings, key=lambda frames: float(np.abs(frames[:, : len(ROOT_SIXD) - 1]).sum()))
    start: list[list[float]] = stillest.round(6).tolist()
    return start


def mirrored_too(store: Store, recorded: Sequence[Recording]) -> tuple[MotionContract, list[Motion]]:
    """Recordings and their mirror images, and the contract with the mean and standard deviation of all of them."""
    motions = [recording.features for recording in recorded]
    zero = np.zeros(len(store.channels))
    contract = MotionContract("root_sixd", store.channels, store.units, store.fps, zero, zero + 1, store.skeleton)
    motions += [replace(motion, values=contract.mirror(motion.values)) for motion in motions]
    every = np.concatenate([motion.values for motion in motions])
    return replace(contract, mean=every.mean(axis=0), std=living(every.std(axis=0), store.units)), motions


class Driven:
    """A control model with :data:`LABELS` in place of :class:`motet.steering.model.SteerModel`, with the part of its
    interface that measures use."""

    gaits = tuple(GAIT_SPEEDS)
    speeds = GAIT_SPEEDS

    def __init__(self, model: TdbnModel) -> None:
        self.model = model
        self.fps = model.fps

    @staticmethod
    def fits(model: TdbnModel) -> bool:
        """Whether a model can be steered."""
        return model.labels == LABELS and model.contract.representation == "root_sixd"

    def start(self, start: str | None = None, *, characters: int = 1, hold_feet: bool = True) -> "DrivenSession":
        """A session of standing figures; ``start`` is ignored. hold_feet: with the foot lock."""
        return DrivenSession(self.model, characters, hold_feet)


class DrivenSession:
    """Figures with the commands of :class:`motet.steering.session.SteerSession`."""

    def __init__(self, model: TdbnModel, characters: int, hold_feet: bool) -> None:
        self.session = model.start(characters=characters)
        self.fps = model.fps
        self.ground = np.zeros((characters, 3))
        self.speed = np.zeros(characters)
        self.direction = np.zeros(characters)
        self.facing = np.zeros(characters)
        self.lock = FootLock.none(characters) if hold_feet else None

    def control(
        self,
        *,
        gait: str | Sequence[str] | None = None,
        speed: ArrayLike | None = None,
        direction: ArrayLike | None = None,
        facing: ArrayLike | None = None,
    ) -> None:
        """Set the commands of a steered figure, angles in degrees; the gait is ignored."""
        if speed is not None:
            self.speed[:] = speed
        if direction is not None:
            self.direction[:] = np.radians(direction)
        facing = direction if facing is None else facing
        if facing is not None:
            self.facing[:] = np.radians(facing)

    @property
    def target(self) -> Array:
        """The commanded velocity along x and z in m/s, and facing in radians, (B, 3)."""
        x = self.speed * np.sin(self.direction)
        z = self.speed * np.cos(self.direction)
        return np.stack([x, z, self.facing], axis=1)

    def tick(self) -> Pose:
        """The next pose of all figures."""
        # the velocity relative to the figure
        heading = self.ground[:, 2]
        angle = self.direction - heading
        forward = self.speed * np.cos(angle)
        left = self.speed * np.sin(angle)
        # a turn of 3 rad/s for each radian of error in the facing
        turn = 3.0 * wrapped(self.facing - heading)
        velocities = np.stack([forward, left, turn], axis=-1)
        self.session.set_control(controls_of(velocities))
        pose = self.pose(self.session.step())
        if self.lock is not None:
            self.lock, pose = self.lock.update(pose, FootLockSettings(), 1 / self.fps)
        return pose

    def pose(self, frames: Floats) -> Pose:
        """The pose of frames (B, D), one tick after the last pose."""
        values = frames.astype(np.float64)
        # the root moves by its velocities
        self.ground = moved(self.ground, values[:, : len(ROOT_SIXD) - 1] / self.fps)
        quats = rotmat_to_quat(sixd_to_rotmat(values[:, len(ROOT_SIXD) :].reshape(len(values), -1, 6)))
        unknown = np.zeros((len(values), 2), dtype=np.float32)
        pose = Pose(self.ground, quats.astype(np.float32), frames[:, len(ROOT_SIXD) - 1], unknown)
        # the net knows no contacts: for the foot lock, a foot stands if its lowest point is low
        rotations, places = (part.astype(np.float64) for part in pose.global_transforms())
        heights = sole_points(quat_to_rotmat(rotations), places)[..., 1].reshape(len(pose), 2, 3).min(axis=2)
        contacts = standing(heights, None, ContactSettings(heights=(0.03, 0.03))).astype(np.float32)
        return replace(pose, contacts=contacts)


def moved(ground: Array, steps: Array) -> Array:
    """Places (B, 3) of x, z and facing after steps (B, 3) forward, left and turning, relative to the figures."""
    forward, left, turn = steps.T
    sin = np.sin(ground[:, 2])
    cos = np.cos(ground[:, 2])
    return np.asarray(ground + np.stack([forward * sin + left * cos, forward * cos - left * sin, turn], axis=-1))
