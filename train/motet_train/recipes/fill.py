"""The recipe of the net that fills gaps, and its training from a store."""

from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Any

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
from motet_train.models.kinematics import joint_weights, tree_of
from motet_train.recipes.recipe import MUON, Job, Recipe
from motet_train.runs import Run


@dataclass(frozen=True)
class FillVisits:
    """context: the most frames seen before and after a gap; least: the fewest; whole: the share of windows with the
    most. gaps: the shortest and the longest. feet: how many times their places count."""

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


def train_fill(store: Store, job: Job, data: str = "", by: str = "subject") -> Run:
    """Train on a store in ``root_sixd``, see :meth:`motet_train.recipes.recipe.Job.run`."""
    visits = job.recipe.visits
    if store.representation != "root_sixd":
        raise DataError(f"gaps are filled in root_sixd (motet prepare --for codes), not {store.representation}")
    if store.skeleton != HUMANOID:
        raise DataError(
            "gaps are filled on the humanoid (motet prepare --for codes --figure humanoid), not on another figure"
        )
    parts = split(store.records, 0, by)
    contract = store.contract(parts.train)
    longest = 2 * visits.context + visits.gaps[1]
    train, validation = (
        GapWindows(store, part, longest, frame_mirror(contract)) for part in (parts.train, parts.validation)
    )
    torch.manual_seed(job.about.seed)
    net = _untrained(job.recipe, contract, train).to(job.device)
    weights = joint_weights(contract, ("Foot", "Toes"), visits.feet).to(job.device)
    rng = np.random.default_rng(0)
    sizes = [(visits.context, max(1, round(part * visits.gaps[1])), visits.context) for part in (0.25, 0.5, 1.0)]
    seen = [validation.draw(256, size, rng).to(job.device) for size in sizes]

    def loss(window: GapWindow) -> Terms:
        return _loss(net, window, weights, store.fps)

    drawn = partial(_batches, train, visits, job.training.batch)
    learner = GradientLearner(net, job.training, loss, drawn, lambda: _measured(kept, seen))
    assert isinstance(learner.kept, Filler)
    kept: Filler = learner.kept
    about: dict[str, Any] = {
        "data": {"name": data, "motions": len(store.records)},
        "split": {"by": by, "train": len(parts.train)},
    }
    defaults = {"context": visits.context, "least": visits.least, "longest": visits.gaps[1]}
    return job.run(kept, learner, job.manifest(contract, asdict(net.config), defaults, None, about))


def _batches(windows: GapWindows, visits: FillVisits, size: int, rng: np.random.Generator) -> tuple[GapWindow]:
    before = after = visits.context
    count = int(rng.integers(visits.gaps[0], visits.gaps[1] + 1))
    if rng.random() >= visits.whole:
        before, after = rng.integers(visits.least, visits.context + 1, size=2).tolist()
    return (windows.draw(size, (before, count, after), rng),)


def _untrained(recipe: Recipe, contract: MotionContract, windows: GapWindows) -> Filler:
    """A net that has its normalisation of frames around a gap from some windows."""
    net = Filler(recipe.sized(channels=PLACED_CHANNELS, tree=tree_of(contract)))
    context, (_, longest) = recipe.visits.context, recipe.visits.gaps
    some = windows.draw(1024, (context, longest // 2, context), np.random.default_rng(0))
    frames = torch.cat([some.past, some.truth, some.after], dim=1).flatten(0, 1).numpy().astype(np.float64)
    net.measure_by(frames.mean(axis=0), np.maximum(frames.std(axis=0), 0.02))
    return net


def _loss(net: Filler, window: GapWindow, weights: Tensor, fps: float) -> Terms:
    """Errors of joints' places (m), of frames in standard deviations and of joints' speeds (m/s), and the speeds of
    feet that stand: those slower than 0.2 m/s."""
    frames = net.once(window.past, window.plain, window.after).float()
    off = functional.smooth_l1_loss(frames / net.scale, window.truth / net.scale, beta=0.2)
    with torch.autocast(frames.device.type, enabled=False):
        # one frame on each side, so that the joins count
        found, true = (
            net.joints(torch.cat([window.past[:, -1:], one, window.after[:, :1]], dim=1))
            for one in (frames, window.truth)
        )
        places = ((found - true).square().sum(-1) + 1e-8).sqrt() * weights
        speeds, was = found.diff(dim=1) * fps, true.diff(dim=1) * fps
        unlike = ((speeds - was).square().sum(-1) + 1e-4).sqrt() * weights
        stands = (was.norm(dim=-1) < 0.2) & (weights > 1)
        slide = (speeds.square().sum(-1) + 1e-4).sqrt() * stands
    total = places.mean() + 0.05 * off + 0.1 * unlike.mean() + 0.1 * slide.mean()
    return (Term(total, len(window)),)


@torch.no_grad()
def _measured(net: Filler, seen: list[GapWindow]) -> dict[str, float]:
    """On validation windows of each length of gap: the mean error of joints in cm, and that of the plain way."""
    found: dict[str, float] = {}
    counts = [window.truth.shape[1] for window in seen]
    for count, window in zip(counts, seen, strict=True):
        true = net.joints(window.truth)
        for name, frames in (("", net(window.past, window.plain, window.after)), ("plain_", window.plain)):
            found[f"{name}{count}"] = round(100 * float((net.joints(frames) - true).norm(dim=-1).mean()), 3)
    return {"validation": round(float(np.mean([found[str(count)] for count in counts])), 4), **found}
