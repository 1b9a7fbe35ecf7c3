"""The thesis' family as a figure that travels: its channels say where the root goes, its control values where to.

A control value is one of six numbers from 0 to 1 (:data:`LABELS`). A trained net is steered as a figure of motion
matching is, so that the same measures see it: each tick a small rule turns speed, direction and facing into the control
values, the velocity as the figure sees it and a turn by how far its facing is off; what the net says of the velocities
of the root is where the figure goes.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

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
from motet.steering.foot_lock import FootLock
from motet.steering.pose import Pose
from motet_train.data.errors import DataError
from motet_train.data.recorded import Recording, gaits_of, recordings
from motet_train.data.store import Store
from motet_train.data.table import Gait
from motet_train.papers.tdbn.rbm import Learning
from motet_train.papers.tdbn.recipe import train_lessons, untrained
from motet_train.papers.tdbn.tdbn import AngleCRBMConfig, Lessons, TDBNConfig
from motet_train.recipes.recipe import Job, Recipe
from motet_train.runs import Run

LABELS = ("forward", "backward", "left", "right", "turn_left", "turn_right")

FULL_CONTROL = (4.5, 4.5, 3.0)
"""What a value of 1 stands for, ahead, aside (m/s) and turning (rad/s)."""


def controls_of(velocities: ArrayLike) -> Array:
    """Velocities (..., 3), forward, to the left (m/s) and turning to the left (rad/s), as control values (..., 6)."""
    shares = np.asarray(velocities, dtype=np.float64) / FULL_CONTROL
    both = np.stack([shares, -shares], axis=-1)
    return np.asarray(np.clip(both, 0, 1).reshape(*shares.shape[:-1], len(LABELS)))


def course(features: Motion) -> Array:
    """Velocities (T, 3) of frames in ``root_sixd``: each the mean of the next half second, or to the end."""
    values = features.select(ROOT_SIXD[:3]).values
    total = np.concatenate([np.zeros((1, 3)), np.cumsum(values, axis=0)])
    start = np.arange(len(values))
    stop = np.minimum(start + max(1, round(0.5 * features.fps)), len(values))
    return np.asarray((total[stop] - total[start]) / (stop - start)[:, None])


GAITS = {"walk": (0.3, 1.8), "run": (1.8, 4.0)}
"""The slowest and the fastest that each is asked for, m/s. The net has no gaits: it walks or runs as the speed asks."""

TDBN = TDBNConfig(
    hidden_per_part=60,
    control_units=8,
    past_noise=0.1,
    own=12,
    restarts=1,
    tries=1,
    rbm=Learning(40, rate=1e-2, final_rate=0.03, batch=50, temperature=(1.0, 0.38)),
    crbm=Learning(60, rate=1e-2, final_rate=0.05, batch=50, temperature=(0.38, 0.38)),
)

CRBM = AngleCRBMConfig(
    taps=6,
    control_units=4,
    free_units=200,
    past_noise=0.3,
    past_rate=2e-3,
    iterations=10,
    crbm=Learning(120, rate=1e-2, final_rate=0.03, batch=50, decay=2e-5, temperature=(1.0, 1.0)),
)

RECIPES = {
    "default": Recipe("control", "tdbn", "session", TDBN),
    "recorded-past": Recipe("control", "tdbn", "session", replace(TDBN, own=0, past_noise=0.3)),
    "crbm": Recipe("control", "angle-crbm", "session", CRBM),
}
"""The deep net; the same as the thesis has it, whose past is always the recorded one; and Taylor's, without the RBM."""


def train_steered(store: Store, job: Job, data: str = "") -> Run:
    """Train on the recordings of a store in ``root_sixd`` that show :data:`GAITS`, and on their mirror images.

    DataError where a gait has none, or where the store is in another representation.
    """
    if store.representation != "root_sixd":
        raise DataError(f"steering is trained on root_sixd (motet prepare --for codes), not {store.representation}")
    shown = {gait.name: gait for gait in gaits_of(store)}
    found = recordings(store, tuple(shown.get(name, Gait(name, (), ())) for name in GAITS))
    contract, motions = mirrored_too(store, found)
    controls = [controls_of(course(motion)) for motion in motions]
    assert contract.skeleton is not None
    config = replace(job.recipe.config, fps=store.fps)
    net = untrained(config, contract.skeleton, contract.channels, len(LABELS))
    net.measure_by(contract.mean, contract.std * config.sigma)
    beginnings = [one.features.values[: config.taps] for one in found if len(one.features) >= config.taps]
    stillest = min(beginnings, key=lambda frames: float(np.abs(frames[:, : len(ROOT_SIXD) - 1]).sum()))
    control = {"labels": LABELS, "starts": dict.fromkeys(LABELS, stillest.round(6).tolist())}
    about = {"data": {"name": data, "recordings": len(found), "frames": sum(map(len, motions))}}
    manifest = job.manifest(contract, net.to_config(), net.defaults, None, about, control=control)
    return train_lessons(net, job, manifest, Lessons([[motion.values for motion in motions]], [controls], [1.0]))


def mirrored_too(store: Store, found: Sequence[Recording]) -> tuple[MotionContract, list[Motion]]:
    """The recordings and their mirror images, and the contract with the mean and deviation of all of them."""
    motions = [one.features for one in found]
    plain = np.zeros(len(store.channels))
    contract = MotionContract("root_sixd", store.channels, store.units, store.fps, plain, plain + 1, store.skeleton)
    motions += [replace(motion, values=contract.mirror(motion.values)) for motion in motions]
    every = np.concatenate([motion.values for motion in motions])
    return replace(contract, mean=every.mean(axis=0), std=living(every.std(axis=0), store.units)), motions


@dataclass(frozen=True, eq=False)
class Driven:
    """A control model with :data:`LABELS`, to be measured in place of :class:`motet.steering.model.SteerModel`: the
    part of it that measures use."""

    model: TdbnModel
    gaits: tuple[str, ...] = tuple(GAITS)

    @staticmethod
    def fits(model: TdbnModel) -> bool:
        """Whether a model is such a net."""
        return model.labels == LABELS and model.contract.representation == "root_sixd"

    @property
    def fps(self) -> float:
        """Ticks a second."""
        return self.model.fps

    @property
    def speeds(self) -> dict[str, tuple[float, float]]:
        """The slowest and the fastest that each gait is asked for, m/s."""
        return GAITS

    def start(self, start: str | None = None, *, characters: int = 1, hold_feet: bool = True) -> "DrivenSession":
        """A session of figures that stand, whatever the gait. hold_feet: with the foot lock."""
        return DrivenSession(self.model, characters, hold_feet)


class DrivenSession:
    """Figures that are told what :class:`motet.steering.session.SteerSession` is told."""

    def __init__(self, model: TdbnModel, characters: int, hold_feet: bool) -> None:
        self.session, self.fps = model.start(characters=characters), model.fps
        self.ground = np.zeros((characters, 3))
        self.told = np.zeros((3, characters))
        self.lock = FootLock(characters, 1 / self.fps) if hold_feet else None

    def control(
        self,
        *,
        gait: str | Sequence[str] | None = None,
        speed: ArrayLike | None = None,
        direction: ArrayLike | None = None,
        facing: ArrayLike | None = None,
    ) -> None:
        """As a steered figure is told; the gait says nothing to the net."""
        if speed is not None:
            self.told[0] = speed
        for row, angles in ((1, direction), (2, direction if facing is None else facing)):
            if angles is not None:
                self.told[row] = np.radians(angles)

    @property
    def target(self) -> Array:
        """What the figures were told (B, 3): velocity along x and z, m/s, and facing, radians."""
        speed, direction, facing = self.told
        return np.stack([speed * np.sin(direction), speed * np.cos(direction), facing], axis=1)

    def tick(self) -> Pose:
        """The next pose of all figures."""
        speed, direction, facing = self.told
        aside, off = direction - self.ground[:, 2], wrapped(facing - self.ground[:, 2])
        # it is told to turn by 3 rad/s for each radian that its facing is off
        velocities = np.stack([speed * np.cos(aside), speed * np.sin(aside), 3.0 * off], axis=-1)
        self.session.set_control(controls_of(velocities))
        pose = self.pose(self.session.step())
        return pose if self.lock is None else self.lock.held(pose)

    def pose(self, frames: Floats) -> Pose:
        """The pose of frames (B, D), one tick after the last."""
        values = frames.astype(np.float64)
        self.ground = moved(self.ground, values[:, : len(ROOT_SIXD) - 1] / self.fps)
        quats = rotmat_to_quat(sixd_to_rotmat(values[:, len(ROOT_SIXD) :].reshape(len(values), -1, 6)))
        unknown = np.zeros((len(values), 2), dtype=np.float32)
        pose = Pose(self.ground, quats.astype(np.float32), frames[:, len(ROOT_SIXD) - 1], unknown)
        turned, places = (part.astype(np.float64) for part in pose.global_transforms())
        heights = sole_points(quat_to_rotmat(turned), places)[..., 1].reshape(len(pose), 2, 3).min(axis=2)
        # the net says nothing of contacts: a foot stands, for the foot lock, by the height of its lowest point
        contacts = standing(heights, None, ContactSettings(heights=(0.03, 0.03))).astype(np.float32)
        return replace(pose, contacts=contacts)


def moved(ground: Array, steps: Array) -> Array:
    """Places (B, 3), x, z and facing, after steps (B, 3), forward, to the left and turned, as the figures see them."""
    forward, left, turn = steps.T
    sin, cos = np.sin(ground[:, 2]), np.cos(ground[:, 2])
    return np.asarray(ground + np.stack([forward * sin + left * cos, forward * cos - left * sin, turn], axis=-1))
