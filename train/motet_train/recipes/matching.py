"""The recipe of a figure that is steered by motion matching, and its training from a store."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from motet.decode.matching import SteeringSettings
from motet.motion.feet.lock import FootLockSettings
from motet.motion.humanoid import LEFT_RIGHT, sided
from motet.representation.contract import MotionContract
from motet_train.data.errors import DataError
from motet_train.data.matching_rows import MatchingRows, gaits_of, recordings, rows_of
from motet_train.data.store import Store
from motet_train.descent import GradientLearner, Term, Terms, Training
from motet_train.models.kinematics import tree_of
from motet_train.models.matching import Matching, MatchingConfig, Speeds
from motet_train.recipes.matching_table import take
from motet_train.recipes.recipe import Job, Recipe
from motet_train.runs import Run

FEET = tuple(sided(side, part) for side in LEFT_RIGHT for part in ("Foot", "Toes"))

SPEEDS = 0.1
"""Seconds: how much the error of a joint's speed (m/s) counts beside that of its place (m)."""

TURNS = 0.2
"""Metres: how much an error of a quaternion's numbers counts, which places of joints do not tell all of."""

RARE = 30
"""Rows: a second, under which a gait does not go that way."""

SPAN = (30.0, 90.0)
"""Percentiles of the speeds of a gait's moving rows, from which on and to which it can be asked for; played slower with
shorter strides, or faster, it has more."""


@dataclass(frozen=True)
class MatchingVisits:
    """window: consecutive rows, of which a batch has several. feet: how many times they count."""

    window: int = 8
    feet: float = 6.0


STEERING = SteeringSettings()

DEFAULT = Recipe(
    "control",
    "motion-matching",
    "matching",
    MatchingConfig(0),
    ("channels", "tree", "rows", "features", "gaits", "speeds"),
    Training(steps=4000, every=250, batch=64, optimiser="adamw", learning_rate=2e-3, cosine=True, keep="last"),
    MatchingVisits(),
    settings=(STEERING, FootLockSettings()),
)

RECIPES = {"default": DEFAULT}


def train_matching(store: Store, job: Job, data: str = "") -> Run:
    """Train on the recordings of a store in ``root_sixd`` that show gaits; DataError where a gait has none."""
    recipe, training = job.recipe, job.recipe.training
    assert training is not None
    if store.representation != "root_sixd":
        raise DataError(f"steering is trained on root_sixd (motet prepare --for codes), not {store.representation}")
    gaits = gaits_of(store)
    names = tuple(gait.name for gait in gaits)
    found = recordings(store, gaits)
    contract = store.contract(tuple(range(len(store.records))))
    rows = rows_of(found, names, STEERING)
    torch.manual_seed(job.about.seed)
    net = _untrained(recipe, contract, rows, names).to(job.device)
    true = Truth.of(net, rows)
    weights = _weights(contract, recipe.visits.feet).to(job.device)
    starts = torch.from_numpy(np.flatnonzero(rows.left >= recipe.visits.window))

    def batches(rng: np.random.Generator) -> Iterator[Tensor]:
        drawn = torch.from_numpy(rng.integers(len(starts), size=training.batch))
        yield starts[drawn][:, None] + torch.arange(recipe.visits.window)

    learner = GradientLearner(
        net,
        training,
        lambda drawn: _loss(net, drawn, true, weights, contract.fps),
        batches,
        lambda: _measured(net, true),
    )
    about = {"data": {"name": data, "recordings": len(found), "rows": len(rows)}}
    return job.run(net, learner, job.manifest(contract, asdict(net.config), {}, None, about))


def _untrained(recipe: Recipe, contract: MotionContract, rows: MatchingRows, names: tuple[str, ...]) -> Matching:
    config = recipe.sized(
        channels=len(contract.channels),
        tree=tree_of(contract),
        rows=len(rows),
        features=rows.features.shape[1],
        gaits=names,
        speeds=tuple(_speeds(rows, shown, STEERING) for shown in rows.gaits.T),
    )
    net = Matching(config)
    net.measure_by(contract.mean, contract.std)
    take(net, rows)
    return net


def _speeds(rows: MatchingRows, shown: NDArray[np.bool_], how: SteeringSettings) -> Speeds:
    """Those of a gait's rows, that can be played slower and faster; all 0 for a gait that is played as it is."""
    speed = rows.speed[shown]
    moving = speed > how.idle
    if not moving.any():
        return (0.0,) * 5
    angle = np.abs(np.arctan2(rows.moves[shown, 1], rows.moves[shown, 0]))  # from the facing
    low = np.percentile(speed[moving], SPAN[0]) * how.slowest * how.shortest
    sectors = [moving & (np.digitize(angle, (how.aside, how.back), right=True) == sector) for sector in range(3)]
    fastest = [np.percentile(speed[part], SPAN[1]) * how.fastest if part.sum() > RARE else 0.0 for part in sectors]
    forward, aside, back = (round(float(one), 2) for one in fastest)
    return round(float(low), 2), round(float(np.median(speed[sectors[0]])), 2), forward, aside, back


@dataclass(frozen=True)
class Truth:
    """What is recorded: poses (N, P), quaternions and the height of the hips; points (N, J', 3) in metres."""

    poses: Tensor
    points: Tensor

    @staticmethod
    def of(net: Matching, rows: MatchingRows) -> "Truth":
        """That of rows, on the device of a net."""
        poses = torch.from_numpy(rows.poses).float().to(net.mean.device)
        return Truth(poses, net.points(poses[:, :-1].reshape(len(poses), -1, 4), poses[:, -1:]))


def _weights(contract: MotionContract, feet: float) -> Tensor:
    assert contract.skeleton is not None
    found = np.array([feet if name.startswith(FEET) else 1.0 for name in contract.skeleton.names])
    return torch.from_numpy(found / found.mean()).float()


def _loss(net: Matching, rows: Tensor, true: Truth, weights: Tensor, fps: float) -> Terms:
    """Errors of joints' places and speeds, and of quaternions, in windows of rows (B, W)."""
    codes = net.codes[rows]
    off = (net.points(*net.poses(codes)) - true.points[rows]) * weights[:, None]
    speeds = off.diff(dim=1) * fps
    turns = (net.values(codes) - true.poses[rows]).abs().mean()
    return (Term(off.abs().mean() + SPEEDS * speeds.abs().mean() + TURNS * turns, len(rows)),)


@torch.no_grad()
def _measured(net: Matching, true: Truth) -> dict[str, Any]:
    """The mean error of joints' places in centimetres, and of bones' rotations in degrees."""
    quats, height = net.poses(net.codes)
    off = (net.points(quats, height) - true.points).norm(dim=-1)
    same = (quats * true.poses[:, :-1].reshape(quats.shape)).sum(dim=-1).abs().clamp(max=1)
    degrees = torch.rad2deg(2 * torch.acos(same))
    return {"joints_cm": round(100 * float(off.mean()), 3), "degrees": round(float(degrees.mean()), 3)}
