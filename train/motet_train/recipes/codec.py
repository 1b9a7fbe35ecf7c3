"""The recipe of the codec of motions, and its training from a store."""

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from motet.generate.codec import REACH, seen_from
from motet.motion.rotations import Array
from motet_train.data.batches import frame_mirror
from motet_train.data.errors import DataError
from motet_train.data.sixd_windows import SixdWindows, Window
from motet_train.data.store import Store, split
from motet_train.descent import GradientLearner, Term, Terms
from motet_train.models.codec import CodecConfig, MotionCodec, places_in_world
from motet_train.models.kinematics import joint_weights, tree_of
from motet_train.models.motion_codes import MotionCodes
from motet_train.recipes.recipe import MUON, Job, Recipe
from motet_train.runs import Run


@dataclass(frozen=True)
class CodecVisits:
    """frames: of a window. ends: how many times hands and feet count. sharp: weight of movement being as sharp as it
    was, which sets the jerk of what is decoded. settled: whether the codes of a codec that is trained further stay;
    where they do not, motions that it shows badly are drawn more often (:func:`badly_shown`)."""

    frames: int = 64
    ends: float = 3.0
    sharp: float = 0.2
    settled: bool = True


CODEC_STEPS = replace(MUON, steps=9000, every=250, warm_up=200, cosine=True)

DEFAULT = Recipe("codec", "motion-codec", "codes", CodecConfig(0), ("channels", "tree"), CODEC_STEPS, CodecVisits())

DECODER = replace(DEFAULT, training=replace(CODEC_STEPS, steps=4000, learning_rate=1e-3), visits=CodecVisits(sharp=1.0))
"""Further training of the decoder of a codec whose codes are settled."""

SHARP = replace(DECODER, training=replace(CODEC_STEPS, steps=1000, learning_rate=1e-3, precision="float32"))
"""The last training of the decoder: rounding to bfloat16 adds jerk, from which it learns to be too smooth."""

WIDER = replace(
    DEFAULT,
    training=replace(CODEC_STEPS, steps=3000, batch=48, learning_rate=1e-3, precision="float32"),
    visits=CodecVisits(frames=32, sharp=0.5, settled=False),
)
"""Further training of a whole codec on motions unlike those that it knows, as those keyed by hand; its codes change."""

RECIPES = {"default": DEFAULT, "decoder": DECODER, "sharp": SHARP, "wider": WIDER}


def train_codec(store: Store, job: Job, data: str = "", by: str = "trial", start: Run | None = None) -> Run:
    """Train on a store in ``root_sixd``, see :meth:`motet_train.recipes.recipe.Job.run`.

    start: a codec to train further; of one whose codes are settled only the decoder.
    """
    recipe = job.recipe
    if store.representation != "root_sixd":
        raise DataError(f"a codec is trained on root_sixd (motet prepare --for codes), not {store.representation}")
    parts = split(store.records, 0, by)
    contract = store.contract(parts.train)
    started = None if start is None else _started(start, recipe.visits.settled)
    config = started.config if started else recipe.sized(channels=len(contract.channels), tree=tree_of(contract))
    train, validation = (
        SixdWindows(store, part, recipe.visits.frames, config.hop, frame_mirror(contract))
        for part in (parts.train, parts.validation)
    )
    torch.manual_seed(job.about.seed)
    net = started or MotionCodec(config)
    if started is None:
        net.measure_by(contract.mean, contract.std)
        fitted = fit_book(train.sequences(), config.hop, config.moves, job.about.seed)
        net.book.copy_(torch.from_numpy(fitted))
        net.book_scale.copy_(torch.from_numpy(fitted.std(axis=0)))
    elif not recipe.visits.settled:
        train.favour(badly_shown(net, train))
    book = net.book.numpy().astype(np.float64)
    weights = joint_weights(contract, ("Foot", "Toes", "LowerArm", "Hand"), recipe.visits.ends).to(job.device)
    seen = validation.draw(128, book, np.random.default_rng(0))
    learner = GradientLearner(
        net.to(job.device),
        job.training,
        lambda drawn: _loss(net, drawn, weights, recipe.visits.sharp),
        lambda rng: (train.draw(job.training.batch, book, rng),),
        lambda: _measured(net, seen),
    )
    about: dict[str, Any] = {"data": {"name": data, "motions": len(store.records)}}
    about["split"] = {"by": by, "train": len(parts.train)}
    if start is not None:
        about["start"] = start.manifest["training"]
    return job.run(net, learner, job.manifest(contract, asdict(config), {}, None, about))


def _started(start: Run, settled: bool) -> MotionCodec:
    """A codec, or that of a model that writes its codes, to be trained further; DataError where the run has none."""
    found = start.model.codec if isinstance(start.model, MotionCodes) else start.model
    if not isinstance(found, MotionCodec):
        raise DataError(f"a codec is trained further (motet train codec), not {start.manifest['model']}")
    found.decoder.requires_grad_(True)
    found.encoder.requires_grad_(not settled)
    return found


@torch.no_grad()
def badly_shown(net: MotionCodec, windows: SixdWindows) -> Array:
    """For each span of windows the square of a codec's mean error of joints in its middle (m), relative to the root:
    twice as far off is drawn four times as often."""
    book = net.book.numpy().astype(np.float64)
    net.eval()
    errors = []
    for window in windows.middles(book):
        decoded = net.decode(window.moves, net.encode(window.inputs))
        found, true = (places_in_world(net, one, window.way) for one in (decoded, window.frames))
        off = (found - found[:, :, :1]) - (true - true[:, :, :1])
        errors.append(float(off.norm(dim=-1).mean()))
    net.train()
    return np.square(errors)


def fit_book(poses: list[Array], hop: int, size: int, seed: int) -> Array:
    """A book (size, 3) of the moves over ``hop`` frames of poses (T, 3): x, z, facing. Standing still is entry 0.

    What a move leaves out is not lost: the next one is chosen from where the moves so far have really led.
    """
    from sklearn.cluster import MiniBatchKMeans  # for this alone, so that other trainings do not load it

    moves = np.concatenate([seen_from(way[:-hop], way[hop:]) for way in poses if len(way) > hop])
    scaled = moves * (1, 1, REACH)
    found = MiniBatchKMeans(size - 1, random_state=seed, n_init=3, batch_size=4096).fit(scaled).cluster_centers_
    return np.concatenate([np.zeros((1, 3)), found / (1, 1, REACH)])


def _loss(net: MotionCodec, window: Window, weights: Tensor, sharp: float) -> Terms:
    """Errors of decoder frames in standard deviations, of places (m), speeds (m/s) and the logarithm of the jerk."""
    frames = net.decode(window.moves, net.encode(window.inputs)).float()
    scale = torch.where(net.scale > 0, net.scale, torch.inf)
    scale = torch.cat([net.path_scale, scale[3:]])
    off = functional.smooth_l1_loss(frames / scale, window.frames / scale, beta=0.2, reduction="none")
    with torch.autocast(frames.device.type, enabled=False):
        found, true = (places_in_world(net, one, window.way) for one in (frames, window.frames))
        places = (found - true).abs() * weights[:, None]
        speeds = (found.diff(dim=1) - true.diff(dim=1)).abs() * 30 * weights[:, None]
        jerk = (_sharpness(found) / _sharpness(true)).log().abs()
    total = off.mean() + 5.0 * places.mean() + 0.5 * speeds.mean() + sharp * jerk.mean()
    return (Term(total, len(window)),)


def _sharpness(places: Tensor) -> Tensor:
    """The mean length (B, J) of the third difference of joints (B, T, J, 3), metres per frame cubed."""
    third = places.diff(dim=1).diff(dim=1).diff(dim=1)
    return (third.square().sum(-1) + 1e-10).sqrt().mean(dim=1) + 1e-4


@torch.no_grad()
def _measured(net: MotionCodec, seen: Window) -> dict[str, float]:
    """On the validation windows: the mean error of joints in cm, the sharpness of movement over the true one, and the
    share of codes in use."""
    window = seen.to(net.mean.device)
    values = net.encode(window.inputs)
    found, true = (places_in_world(net, one, window.way) for one in (net.decode(window.moves, values), window.frames))
    codes = net.to_codes(values).cpu().numpy()
    used = [len(np.unique(codes[..., group])) / net.config.codes for group in range(net.config.groups)]
    return {
        "validation": round(100 * float((found - true).norm(dim=-1).mean()), 4),
        "sharpness": round(float(_sharpness(found).mean() / _sharpness(true).mean()), 4),
        "used": round(float(np.mean(used)), 3),
    }
