"""The recipe of the net that fills gaps, and its training from a store."""

from dataclasses import asdict, dataclass, replace
from functools import partial

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from motet.figures.humanoid import HUMANOID
from motet.representation.contract import MotionContract
from motet.representation.placed import PLACED_CHANNELS
from motet_train.data.batches import frame_mirror
from motet_train.data.errors import DataError
from motet_train.data.sixd_windows import GapWindow, GapWindows
from motet_train.data.store import Store, split
from motet_train.descent import GradientLearner, Term, Terms
from motet_train.models.filler import Filler, FillerConfig
from motet_train.models.kinematics import joint_weights, smooth_length, tree_of
from motet_train.recipes.recipe import MUON, Job, Recipe, data_of
from motet_train.runs import Run


@dataclass(frozen=True)
class FillVisits:
    """context, least: the largest and smallest number of frames before and after a gap; whole: the share of windows
    with the largest. gaps: the shortest and the longest. feet: weight of their positions."""

    context: int = 20
    least: int = 4
    whole: float = 0.7
    gaps: tuple[int, int] = (3, 60)
    feet: float = 2.0


DEFAULT = Recipe(
    "fill",
    "gap-filler",
    "between",
    FillerConfig(0),
    ("channels", "tree"),
    replace(MUON, steps=6000, every=250, learning_rate=4e-3, warm_up=100, cosine=True, average=0.998),
    FillVisits(),
)

RECIPES = {"default": DEFAULT}


def train_fill(store: Store, job: Job, data: str, by: str) -> Run:
    """Train on a store in ``root_sixd``, see :meth:`motet_train.recipes.recipe.Job.run`."""
    _check_store(store)
    visits = job.recipe.visits
    # windows with gaps, half of them mirrored
    parts = split(store.records, 0, by)
    contract = store.contract(parts.train)
    mirror = frame_mirror(contract)
    longest = 2 * visits.context + visits.gaps[1]
    train = GapWindows(store, parts.train, longest, mirror)
    validation = _validation_windows(GapWindows(store, parts.validation, longest, mirror), visits)
    # the net and its training
    torch.manual_seed(job.about.seed)
    net = _untrained(job.recipe, contract, train).to(job.device)
    learner = _learner(net, job, contract, train, validation)
    about = data_of(store, data, by, parts)
    defaults = {"context": visits.context, "least": visits.least, "longest": visits.gaps[1]}
    return job.run(learner.kept, learner, job.manifest(contract, asdict(net.config), defaults, None, about))


def _check_store(store: Store) -> None:
    """DataError for a store in which no gaps can be filled."""
    store.needs_sixd("gaps are filled in")
    if store.skeleton != HUMANOID:
        raise DataError(
            "gaps are filled on the humanoid (motet prepare --for codes --figure humanoid), not on another figure"
        )


def _learner(
    net: Filler, job: Job, contract: MotionContract, train: GapWindows, validation: list[GapWindow]
) -> GradientLearner[Filler]:
    """Learns to fill the gaps of windows."""
    visits = job.recipe.visits
    weights = joint_weights(contract, ("Foot", "Toes"), visits.feet).to(job.device)
    on_device = [window.to(job.device) for window in validation]
    learner = GradientLearner(
        net,
        job.training,
        lambda window: _loss(net, window, weights, contract.fps),
        partial(_batches, train, visits, job.training.batch),
        lambda: _measured(learner.kept, on_device),
    )
    return learner


def _validation_windows(windows: GapWindows, visits: FillVisits) -> list[GapWindow]:
    """Windows with gaps of a quarter, a half and the whole of the longest length."""
    rng = np.random.default_rng(0)
    drawn = []
    for share in (0.25, 0.5, 1.0):
        gap = max(1, round(share * visits.gaps[1]))
        drawn.append(windows.draw(256, (visits.context, gap, visits.context), rng))
    return drawn


def _batches(windows: GapWindows, visits: FillVisits, size: int, rng: np.random.Generator) -> tuple[GapWindow]:
    before = visits.context
    after = visits.context
    count = int(rng.integers(visits.gaps[0], visits.gaps[1] + 1))
    if rng.random() >= visits.whole:
        before, after = rng.integers(visits.least, visits.context + 1, size=2).tolist()
    return (windows.draw(size, (before, count, after), rng),)


def _untrained(recipe: Recipe, contract: MotionContract, windows: GapWindows) -> Filler:
    """A new net, with the normalisation of the frames around gaps in some windows."""
    net = Filler(recipe.sized(channels=PLACED_CHANNELS, tree=tree_of(contract)))
    context = recipe.visits.context
    _, longest = recipe.visits.gaps
    window = windows.draw(1024, (context, longest // 2, context), np.random.default_rng(0))
    frames = torch.cat([window.past, window.truth, window.after], dim=1).flatten(0, 1).numpy().astype(np.float64)
    net.measure_by(frames.mean(axis=0), np.maximum(frames.std(axis=0), 0.02))
    return net


def _loss(net: Filler, window: GapWindow, weights: Tensor, fps: float) -> Terms:
    """Errors of positions (m), of frames in standard deviations and of speeds of joints (m/s), and the speeds of feet
    that stand: those slower than 0.2 m/s."""
    frames = net.once(window.past, window.plain, window.after).float()
    frame_error = functional.smooth_l1_loss(frames / net.scale, window.truth / net.scale, beta=0.2)
    with torch.autocast(frames.device.type, enabled=False):
        # where joints are, how they move, and that feet that stand do not
        places = _joints_with_seams(net, window, frames)
        true_places = _joints_with_seams(net, window, window.truth)
        place_errors = smooth_length(places - true_places, 1e-8) * weights
        velocity_errors, slide = _motion_errors(places.diff(dim=1) * fps, true_places.diff(dim=1) * fps, weights)
    total = place_errors.mean() + 0.05 * frame_error + 0.1 * velocity_errors.mean() + 0.1 * slide.mean()
    return (Term(total, len(window)),)


def _motion_errors(velocities: Tensor, true_velocities: Tensor, weights: Tensor) -> tuple[Tensor, Tensor]:
    """The weighted errors (B, T, J) of velocities (B, T, J, 3), and the speeds of joints that stand."""
    errors = smooth_length(velocities - true_velocities, 1e-4) * weights
    stands = (true_velocities.norm(dim=-1) < 0.2) & (weights > 1)
    return errors, smooth_length(velocities, 1e-4) * stands


def _joints_with_seams(net: Filler, window: GapWindow, frames: Tensor) -> Tensor:
    """The joints (B, N + 2, J, 3) of a gap filled with frames, and of one frame on each side."""
    return net.joints(torch.cat([window.past[:, -1:], frames, window.after[:, :1]], dim=1))


@torch.no_grad()
def _measured(net: Filler, windows: list[GapWindow]) -> dict[str, float]:
    """On validation windows of each gap length: the mean error of joints in cm, and that of the plain way."""
    errors = {}
    net_errors = []
    for window in windows:
        frames = window.truth.shape[1]
        # the net, and the plain way that it improves
        true_places = net.joints(window.truth)
        for name, filled in (("", net(window.past, window.plain, window.after)), ("plain_", window.plain)):
            distances = (net.joints(filled) - true_places).norm(dim=-1)
            errors[f"{name}{frames}"] = round(100 * float(distances.mean()), 3)
        net_errors.append(errors[str(frames)])
    return {"validation": round(float(np.mean(net_errors)), 4), **errors}
