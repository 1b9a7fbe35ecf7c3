"""The recipe of a figure steered by motion matching, and its training from a store."""

from dataclasses import asdict, dataclass, replace

import numpy as np
import torch
from torch import Tensor

from motet.bundle.fields import Json
from motet.representation.contract import MotionContract
from motet.steering.foot_lock import FootLockSettings
from motet.steering.rows import MatchingRows, rows_of
from motet.steering.settings import SteeringSettings
from motet.steering.tables import speeds_of, tables_of
from motet_train.data.recorded import gaits_of, recordings
from motet_train.data.store import Store
from motet_train.descent import GradientLearner, Term, Terms
from motet_train.models.kinematics import joint_weights, tree_of
from motet_train.models.matching import Matching, MatchingConfig
from motet_train.recipes.recipe import ADAMW, Job, Recipe
from motet_train.runs import Run


@dataclass(frozen=True)
class MatchingVisits:
    """window: consecutive rows of a batch's windows. feet: their weight."""

    window: int = 8
    feet: float = 6.0


STEERING = SteeringSettings()

DEFAULT = Recipe(
    "control",
    "motion-matching",
    "matching",
    MatchingConfig(0),
    ("channels", "tree", "rows", "features", "gaits", "speeds"),
    replace(ADAMW, steps=4000, every=250, batch=64, cosine=True),
    MatchingVisits(),
    settings=(STEERING, FootLockSettings()),
)

RECIPES = {"default": DEFAULT}


def train_matching(store: Store, job: Job, data: str) -> Run:
    """Train on the recordings of gaits in a store in ``root_sixd``; DataError if a gait has none."""
    # the table of all rows of the recordings
    store.needs_sixd("steering is trained on")
    gaits = gaits_of(store)
    names = tuple(gait.name for gait in gaits)
    gait_recordings = recordings(store, gaits)
    rows = rows_of(gait_recordings, names, STEERING)

    # a net that begins with their principal components
    contract = store.contract(tuple(range(len(store.records))))
    torch.manual_seed(job.about.seed)
    net = _untrained(job.recipe, contract, rows, names).to(job.device)

    learner = _learner(net, job, contract, rows)
    about = {"data": {"name": data, "recordings": len(gait_recordings), "rows": len(rows)}}
    return job.run(net, learner, job.manifest(contract, asdict(net.config), {}, None, about))


def _untrained(recipe: Recipe, contract: MotionContract, rows: MatchingRows, gaits: tuple[str, ...]) -> Matching:
    """A new net filled with rows."""
    config = recipe.sized(
        channels=len(contract.channels),
        tree=tree_of(contract),
        rows=len(rows),
        features=rows.features.shape[1],
        gaits=gaits,
        speeds=speeds_of(rows, STEERING),
    )
    net = Matching(config)
    net.measure_by(contract.mean, contract.std)
    take(net, rows)
    return net


def _learner(net: Matching, job: Job, contract: MotionContract, rows: MatchingRows) -> GradientLearner[Matching]:
    """Learns codes that reproduce the poses of rows and the points of their joints."""
    visits = job.recipe.visits
    # what is to be reproduced, and how much each joint counts
    poses = torch.from_numpy(rows.poses).float().to(job.device)
    true = poses, net.points(_rotations(poses), poses[:, -1:])
    weights = joint_weights(contract, ("Foot", "Toes"), visits.feet).to(job.device)
    # windows lie within a recording
    starts = torch.from_numpy(np.flatnonzero(rows.left >= visits.window))

    def batch(rng: np.random.Generator) -> tuple[Tensor]:
        drawn = rng.integers(len(starts), size=job.training.batch)
        return (starts[torch.from_numpy(drawn)][:, None] + torch.arange(visits.window),)

    return GradientLearner(
        net,
        job.training,
        lambda windows: _loss(net, windows, true, weights, contract.fps),
        batch,
        lambda: _measured(net, true),
    )


@torch.no_grad()
def take(net: Matching, rows: MatchingRows) -> None:
    """Fill a net with rows: their table, and as codes the principal components of poses and mirrored poses."""
    for name, value in tables_of(rows, net.config.even, net.config.odd).items():
        getattr(net, name).copy_(torch.from_numpy(value))


def _rotations(poses: Tensor) -> Tensor:
    """The quaternions (N, J, 4) in poses (N, P)."""
    return poses[:, :-1].reshape(len(poses), -1, 4)


def _loss(net: Matching, rows: Tensor, true: tuple[Tensor, Tensor], weights: Tensor, fps: float) -> Terms:
    """Errors of positions (m) and speeds (m/s) of joints, and of quaternions, which positions do not determine, in
    windows of rows (B, W). true: poses (N, P) and the points (N, J', 3) of their joints."""
    # positions, their speeds, and the quaternions themselves
    poses, points = true
    codes = net.codes[rows]
    errors = (net.points(*net.poses(codes)) - points[rows]) * weights[:, None]
    speed_errors = errors.diff(dim=1) * fps
    turn_error = (net.values(codes) - poses[rows]).abs().mean()
    return (Term(errors.abs().mean() + 0.1 * speed_errors.abs().mean() + 0.2 * turn_error, len(rows)),)


@torch.no_grad()
def _measured(net: Matching, true: tuple[Tensor, Tensor]) -> Json:
    """The mean error of joints' positions in centimetres, and of bones' rotations in degrees."""
    poses, points = true
    rotations, height = net.poses(net.codes)
    distances = (net.points(rotations, height) - points).norm(dim=-1)
    cosines = (rotations * _rotations(poses)).sum(dim=-1).abs().clamp(max=1)
    degrees = torch.rad2deg(2 * torch.acos(cosines))
    return {"joints_cm": round(100 * float(distances.mean()), 3), "degrees": round(float(degrees.mean()), 3)}
