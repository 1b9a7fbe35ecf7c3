"""The recipe of a figure steered by motion matching, and its training from a store."""

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from motet.motion.rotations import Array
from motet.representation.contract import MotionContract
from motet.steering.foot_lock import FootLockSettings
from motet.steering.matching import LEAST_PACE, is_faster, stride_velocities
from motet.steering.model import FEATURE_STEPS
from motet.steering.settings import SteeringSettings
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
        speeds=tuple(_speeds(rows, in_gait, STEERING) for in_gait in rows.gaits.T),
    )
    net = Matching(config)
    net.measure_by(contract.mean, contract.std)
    take(net, rows)
    return net


def _learner(net: Matching, job: Job, contract: MotionContract, rows: MatchingRows) -> GradientLearner[Matching]:
    """Learns codes that reproduce the poses of rows and the points of their joints."""
    visits = job.recipe.visits
    poses = torch.from_numpy(rows.poses).float().to(job.device)
    true = poses, net.points(_rotations(poses), poses[:, -1:])
    weights = joint_weights(contract, ("Foot", "Toes"), visits.feet).to(job.device)
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
    mean, scale = (part.round(6) for part in scaling(rows.features))
    values = {
        **_pose_codes(rows.poses, net.config),
        "moves": np.column_stack([rows.moves, rows.speed, rows.contacts]),
        "features": np.clip(np.round((rows.features - mean) * scale * FEATURE_STEPS), -127, 127),
        "shows": rows.gaits,
        "left": rows.left,
        "feature_mean": mean,
        "feature_scale": scale,
    }
    for name, value in values.items():
        getattr(net, name).copy_(torch.from_numpy(value))


def _pose_codes(poses: Array, config: MatchingConfig) -> dict[str, Array]:
    """Codes of poses (N, P), and the mean and the basis from which they are decoded."""
    # relative to the mean of all poses and their mirror images, weighted by reach
    columns, signs = mirrored_poses()
    mean_pose = poses.mean(axis=0)
    pose_mean = (mean_pose + mean_pose[columns] * signs) / 2
    offsets = poses - pose_mean
    weights = _reach(config.tree)

    # components that a mirror image has alike, and with the other sign
    mirrored = offsets[:, columns] * signs
    even = _components((offsets + mirrored) / 2 * weights, config.even)
    odd = _components((offsets - mirrored) / 2 * weights, config.odd)
    basis = np.concatenate([even, odd])
    return {"codes": offsets * weights @ basis.T, "pose_mean": pose_mean, "pose_basis": basis / weights}


def _components(offsets: Array, count: int) -> Array:
    """The first ``count`` principal components (count, P) of offsets (N, P), by about 4,000 of them."""
    every = max(1, len(offsets) // 4000)
    _, _, components = np.linalg.svd(offsets[::every], full_matrices=False)
    first: Array = components[:count]
    return first


def _reach(tree: Tree) -> Array:
    """The weight (P,) of each number of a pose: for a bone's quaternion the metres to the farthest joint that it
    carries, at least 5 cm."""
    # places of joints at rest
    places = np.zeros((len(tree.parents), 3))
    for joint, parent in enumerate(tree.parents):
        if parent >= 0:
            places[joint] = places[parent] + tree.offsets[joint]
    # the farthest joint that each bone carries
    reach = []
    for bone in tree.bones:
        carried = [bone]
        for joint, parent in enumerate(tree.parents):
            if parent in carried:
                carried.append(joint)
        reach.append(np.linalg.norm(places[carried] - places[bone], axis=1).max())
    return np.append(np.repeat(np.maximum(reach, 0.05), 4), 1.0)


def _speeds(rows: MatchingRows, in_gait: NDArray[np.bool_], settings: SteeringSettings) -> Speeds:
    """The speeds that a gait allows, as its rows can be played slower and faster; all 0 if it has no moving rows.

    The lowest is the 30th percentile of its moving rows, with shorter strides, or the slowest pace if that is a creep.
    The highest in each direction is the 90th percentile of its rows, or, if that is less, as for side steps, of means
    over a stride, with the longest strides; 0 for directions with at most a second of rows.
    """
    speed = rows.speed[in_gait]
    moving = speed > settings.idle
    if not moving.any():
        return (0.0,) * 5

    # rows, and means over a stride, by their direction: ahead, aside or back
    sectors = _sectors(rows.moves[in_gait], settings, right=True)
    strides = stride_velocities(rows.moves[:, :2], rows.left)[in_gait]
    stride_speeds = np.hypot(*strides.T)
    stride_moving = stride_speeds > settings.idle
    stride_sectors = _sectors(strides, settings, right=False)
    fastest = []
    for sector in range(3):
        row_speeds = speed[moving & (sectors == sector)]
        long_speeds = stride_speeds[stride_moving & (stride_sectors == sector)]
        fastest.append(_fastest(row_speeds, long_speeds, settings))
    ahead, aside, back = fastest
    return _slowest(speed, moving, settings), _median(speed[moving & (sectors == 0)]), ahead, aside, back


def _median(speeds: Array) -> float:
    """The median of speeds, m/s."""
    return round(float(np.median(speeds)), 2)


def _sectors(velocities: Array, settings: SteeringSettings, right: bool) -> NDArray[np.intp]:
    """The direction (N,) of velocities (N, 2 or more), forward and left: 0 ahead, 1 aside, 2 back. right: whether an
    angle on a bound counts as the smaller one."""
    angles = np.abs(np.arctan2(velocities[:, 1], velocities[:, 0]))
    return np.digitize(angles, (settings.aside, settings.back), right=right)


def _slowest(speed: Array, moving: NDArray[np.bool_], settings: SteeringSettings) -> float:
    """The lowest speed of a gait by the speeds of its rows, m/s."""
    slowest = round(float(np.percentile(speed[moving], 30.0)) * settings.slowest * settings.shortest, 2)
    return LEAST_PACE if slowest <= settings.creep and is_faster(speed, settings) else slowest


def _fastest(row_speeds: Array, stride_speeds: Array, settings: SteeringSettings) -> float:
    """The highest speed of a direction by the speeds of its rows and strides, m/s; 0 for too few."""
    if len(row_speeds) <= 30 or not len(stride_speeds):
        return 0.0
    by_strides = np.percentile(stride_speeds, 90.0) * settings.longest
    return round(float(min(np.percentile(row_speeds, 90.0), by_strides) * settings.fastest), 2)


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
def _measured(net: Matching, true: tuple[Tensor, Tensor]) -> dict[str, Any]:
    """The mean error of joints' positions in centimetres, and of bones' rotations in degrees."""
    poses, points = true
    rotations, height = net.poses(net.codes)
    distances = (net.points(rotations, height) - points).norm(dim=-1)
    cosines = (rotations * _rotations(poses)).sum(dim=-1).abs().clamp(max=1)
    degrees = torch.rad2deg(2 * torch.acos(cosines))
    return {"joints_cm": round(100 * float(distances.mean()), 3), "degrees": round(float(degrees.mean()), 3)}
