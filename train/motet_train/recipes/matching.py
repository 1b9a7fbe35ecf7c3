"""The recipe of a figure that is steered by motion matching, and its training from a store."""

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from motet.motion.rotations import Array
from motet.steering.foot_lock import FootLockSettings
from motet.steering.matching import LEAST_PACE, is_faster, stride_velocities
from motet.steering.model import FEATURE_STEPS
from motet.steering.settings import SteeringSettings
from motet_train.data.errors import DataError
from motet_train.data.matching_rows import MatchingRows, mirrored_poses, rows_of, scaling
from motet_train.data.recorded import gaits_of, recordings
from motet_train.data.store import Store
from motet_train.descent import GradientLearner, Term, Terms
from motet_train.models.kinematics import Tree, joint_weights, tree_of
from motet_train.models.matching import Matching, MatchingConfig, Speeds
from motet_train.recipes.recipe import ADAMW, Job, Recipe
from motet_train.runs import Run


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
    replace(ADAMW, steps=4000, every=250, batch=64, cosine=True),
    MatchingVisits(),
    settings=(STEERING, FootLockSettings()),
)

RECIPES = {"default": DEFAULT}


def train_matching(store: Store, job: Job, data: str = "") -> Run:
    """Train on the recordings of a store in ``root_sixd`` that show gaits; DataError where a gait has none."""
    visits = job.recipe.visits
    if store.representation != "root_sixd":
        raise DataError(f"steering is trained on root_sixd (motet prepare --for codes), not {store.representation}")
    gaits = gaits_of(store)
    names = tuple(gait.name for gait in gaits)
    found = recordings(store, gaits)
    contract = store.contract(tuple(range(len(store.records))))
    rows = rows_of(found, names, STEERING)
    torch.manual_seed(job.about.seed)
    config = job.recipe.sized(
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
    poses = torch.from_numpy(rows.poses).float().to(job.device)
    true = poses, net.to(job.device).points(poses[:, :-1].reshape(len(poses), -1, 4), poses[:, -1:])
    weights = joint_weights(contract, ("Foot", "Toes"), visits.feet).to(job.device)
    starts = torch.from_numpy(np.flatnonzero(rows.left >= visits.window))

    def batch(rng: np.random.Generator) -> tuple[Tensor]:
        drawn = torch.from_numpy(rng.integers(len(starts), size=job.training.batch))
        return (starts[drawn][:, None] + torch.arange(visits.window),)

    learner = GradientLearner(
        net,
        job.training,
        lambda drawn: _loss(net, drawn, true, weights, contract.fps),
        batch,
        lambda: _measured(net, true),
    )
    about = {"data": {"name": data, "recordings": len(found), "rows": len(rows)}}
    return job.run(net, learner, job.manifest(contract, asdict(net.config), {}, None, about))


@torch.no_grad()
def take(net: Matching, rows: MatchingRows) -> None:
    """Fill a net with rows: their table, and codes that are the principal components of poses and mirrored poses."""
    mean, scale = (part.round(6) for part in scaling(rows.features))
    columns, signs = mirrored_poses()
    mean_pose = rows.poses.mean(axis=0)
    pose_mean = (mean_pose + mean_pose[columns] * signs) / 2
    weights, off = _reach(net.config.tree), rows.poses - pose_mean
    axes = []
    for sign, count in ((1, net.config.even), (-1, net.config.odd)):
        half = (off + sign * off[:, columns] * signs) / 2 * weights
        axes.append(np.linalg.svd(half[:: max(1, len(half) // 4000)], full_matrices=False)[2][:count])  # of 4000 poses
    basis = np.concatenate(axes)
    values = {
        "codes": off * weights @ basis.T,
        "moves": np.column_stack([rows.moves, rows.speed, rows.contacts]),
        "features": np.clip(np.round((rows.features - mean) * scale * FEATURE_STEPS), -127, 127),
        "shows": rows.gaits,
        "left": rows.left,
        "feature_mean": mean,
        "feature_scale": scale,
        "pose_mean": pose_mean,
        "pose_basis": basis / weights,
    }
    for name, value in values.items():
        getattr(net, name).copy_(torch.from_numpy(value))


def _reach(tree: Tree) -> Array:
    """How far each bone carries others, at least 5 cm: by so many metres the numbers (P,) of its quaternion count."""
    places = np.zeros((len(tree.parents), 3))
    for joint, parent in enumerate(tree.parents):
        if parent >= 0:
            places[joint] = places[parent] + tree.offsets[joint]
    far = []
    for bone in tree.bones:
        carried = [bone]
        for joint, parent in enumerate(tree.parents):
            if parent in carried:
                carried.append(joint)
        far.append(np.linalg.norm(places[carried] - places[bone], axis=1).max())
    return np.append(np.repeat(np.maximum(far, 0.05), 4), 1.0)


def _speeds(rows: MatchingRows, shown: NDArray[np.bool_], how: SteeringSettings) -> Speeds:
    """Those that a gait can be asked for, as its rows can be played slower and faster; all 0 if they cannot.

    They go from the 30th percentile of its moving rows, with shorter strides, or from the slowest pace if that is a
    creep, to the 90th of each direction, or to that of means over a stride, with the longest strides, if it is less, as
    it is of side steps; directions with a second of rows or less have none.
    """
    speed = rows.speed[shown]
    moving = speed > how.idle
    if not moving.any():
        return (0.0,) * 5
    angle = np.abs(np.arctan2(rows.moves[shown, 1], rows.moves[shown, 0]))  # from the facing
    low = round(float(np.percentile(speed[moving], 30.0)) * how.slowest * how.shortest, 2)
    if low <= how.creep and is_faster(speed, how):
        low = LEAST_PACE
    sectors = [moving & (np.digitize(angle, (how.aside, how.back), right=True) == sector) for sector in range(3)]
    going = stride_velocities(rows.moves[:, :2], rows.left)[shown]
    paces, ways = np.hypot(*going.T), np.abs(np.arctan2(going[:, 1], going[:, 0]))
    strides = [paces[(paces > how.idle) & (np.digitize(ways, (how.aside, how.back)) == sector)] for sector in range(3)]
    fastest = [
        min(np.percentile(speed[part], 90.0), np.percentile(own, 90.0) * how.longest) * how.fastest
        if part.sum() > 30 and len(own)
        else 0.0
        for part, own in zip(sectors, strides, strict=True)
    ]
    forward, aside, back = (round(float(one), 2) for one in fastest)
    return low, round(float(np.median(speed[sectors[0]])), 2), forward, aside, back


def _loss(net: Matching, rows: Tensor, true: tuple[Tensor, Tensor], weights: Tensor, fps: float) -> Terms:
    """Errors of joints' places (m) and speeds (m/s), and of quaternions, which places do not tell all of, in windows of
    rows (B, W). true: poses (N, P) and the points (N, J', 3) of their joints."""
    codes, (poses, points) = net.codes[rows], true
    off = (net.points(*net.poses(codes)) - points[rows]) * weights[:, None]
    speeds = off.diff(dim=1) * fps
    turns = (net.values(codes) - poses[rows]).abs().mean()
    return (Term(off.abs().mean() + 0.1 * speeds.abs().mean() + 0.2 * turns, len(rows)),)


@torch.no_grad()
def _measured(net: Matching, true: tuple[Tensor, Tensor]) -> dict[str, Any]:
    """The mean error of joints' places in centimetres, and of bones' rotations in degrees."""
    (quats, height), (poses, points) = net.poses(net.codes), true
    off = (net.points(quats, height) - points).norm(dim=-1)
    same = (quats * poses[:, :-1].reshape(quats.shape)).sum(dim=-1).abs().clamp(max=1)
    degrees = torch.rad2deg(2 * torch.acos(same))
    return {"joints_cm": round(100 * float(off.mean()), 3), "degrees": round(float(degrees.mean()), 3)}
