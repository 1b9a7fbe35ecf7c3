"""The recipe of the codec of motions, and its training from a store."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from motet.decode.codec import REACH, seen_from
from motet.motion.humanoid import LEFT_RIGHT, sided
from motet.motion.rotations import Array
from motet.representation.contract import MotionContract
from motet_train.data.batches import frame_mirror
from motet_train.data.errors import DataError
from motet_train.data.sixd_windows import SixdWindows, Window
from motet_train.data.store import Store, split
from motet_train.descent import GradientLearner, Term, Terms, Training
from motet_train.models.codec import CodecConfig, MotionCodec, places_in_world
from motet_train.models.kinematics import tree_of
from motet_train.recipes.recipe import Job, Recipe
from motet_train.runs import Run

ENDS = tuple(sided(side, part) for side in LEFT_RIGHT for part in ("Foot", "Toes", "LowerArm", "Hand"))
"""Joints whose errors are seen most: feet that slide, hands that lag."""

PLACES, SPEEDS = 5.0, 0.5
"""Weights of the losses of joints' places (m) and speeds (m/s)."""


@dataclass(frozen=True)
class CodecVisits:
    """frames: of a window. ends: how many times hands and feet count. sharp: how much it counts that movement is as
    sharp as it was, which sets the jerk of what is decoded."""

    frames: int = 64
    ends: float = 3.0
    sharp: float = 0.2


TRAINING = Training(
    steps=9000,
    every=250,
    batch=32,
    optimiser="muon",
    learning_rate=2e-3,
    weight_decay=0.01,
    warm_up=200,
    cosine=True,
    clip=1.0,
    keep="last",
    precision="bfloat16",
)

DEFAULT = Recipe("codec", "motion-codec", "codes", CodecConfig(0), ("channels", "tree"), TRAINING, CodecVisits())

DECODING = replace(TRAINING, steps=4000, learning_rate=1e-3)

DECODER = replace(DEFAULT, training=DECODING, visits=CodecVisits(sharp=1.0))
"""What the decoder of a codec is trained on with, when its codes are settled."""

SHARP = replace(DECODER, training=replace(DECODING, steps=1000, precision="float32"))
"""The last of its decoder's training: rounding to bfloat16 adds jerk, by which the decoder learns to be too smooth."""

RECIPES = {"default": DEFAULT, "decoder": DECODER, "sharp": SHARP}


def train_codec(store: Store, job: Job, data: str = "", by: str = "trial", start: Run | None = None) -> Run:
    """Train on a store in ``root_sixd``, see :meth:`motet_train.recipes.recipe.Job.run`.

    start: a codec whose decoder alone is trained on; its codes stay.
    """
    recipe, training = job.recipe, job.recipe.training
    assert training is not None
    if store.representation != "root_sixd":
        raise DataError(f"a codec is trained on root_sixd (motet prepare --for codes), not {store.representation}")
    parts = split(store.records, 0, by)
    contract = store.contract(parts.train)
    settled = None if start is None else _settled(start)
    config = settled.config if settled else recipe.sized(channels=len(contract.channels), tree=tree_of(contract))
    train, validation = (
        SixdWindows(store, part, recipe.visits.frames, config.hop, frame_mirror(contract))
        for part in (parts.train, parts.validation)
    )
    torch.manual_seed(job.about.seed)
    net = settled or _untrained(config, contract, train, job.about.seed)
    book = net.book.numpy().astype(np.float64)
    weights = _weights(contract, recipe.visits.ends).to(job.device)

    def batches(rng: np.random.Generator) -> Iterator[Window]:
        yield train.draw(training.batch, book, rng)

    seen = validation.draw(128, book, np.random.default_rng(0))
    learner = GradientLearner(
        net.to(job.device),
        training,
        lambda drawn: _loss(net, drawn, weights, recipe.visits.sharp),
        batches,
        lambda: _measured(net, seen),
    )
    about: dict[str, Any] = {
        "data": {"name": data, "motions": len(store.records)},
        "split": {"by": by, "train": len(parts.train)},
    }
    if start is not None:
        about["start"] = start.manifest["training"]
    return job.run(net, learner, job.manifest(contract, asdict(config), {}, None, about))


def _settled(start: Run) -> MotionCodec:
    """A codec of which only the decoder is trained; DataError where the run is none of a codec."""
    if not isinstance(start.model, MotionCodec):
        raise DataError(f"a decoder is that of a codec (motet train codec), not of {start.manifest['model']}")
    start.model.encoder.requires_grad_(False)
    return start.model


def _untrained(config: CodecConfig, contract: MotionContract, windows: SixdWindows, seed: int) -> MotionCodec:
    net = MotionCodec(config)
    net.measure_by(contract.mean, contract.std)
    book = fit_book(windows.sequences(), config.hop, config.moves, seed)
    net.book.copy_(torch.from_numpy(book))
    net.book_scale.copy_(torch.from_numpy(book.std(axis=0)))
    return net


def fit_book(poses: list[Array], hop: int, size: int, seed: int) -> Array:
    """A book (size, 3) of the moves over ``hop`` frames of poses (T, 3): x, z, facing. Standing still is entry 0.

    What a move leaves out is not lost: the next one is chosen from where the moves so far have really led.
    """
    from sklearn.cluster import MiniBatchKMeans  # for this alone, so that other trainings do not load it

    moves = np.concatenate([seen_from(way[:-hop], way[hop:]) for way in poses if len(way) > hop])
    scaled = moves * (1, 1, REACH)
    found = MiniBatchKMeans(size - 1, random_state=seed, n_init=3, batch_size=4096).fit(scaled).cluster_centers_
    return np.concatenate([np.zeros((1, 3)), found / (1, 1, REACH)])


def _weights(contract: MotionContract, ends: float) -> Tensor:
    """How much each joint's place and speed count (J,)."""
    assert contract.skeleton is not None
    found: Array = np.array([ends if name.startswith(ENDS) else 1.0 for name in contract.skeleton.names])
    return torch.from_numpy(found / found.mean()).float()


def _loss(net: MotionCodec, window: Window, weights: Tensor, sharp: float) -> Terms:
    frames = net.decode(window.moves, net.encode(window.given)).float()
    scale = torch.where(net.scale > 0, net.scale, torch.inf)
    scale = torch.cat([net.path_scale, scale[3:]])
    off = functional.smooth_l1_loss(frames / scale, window.frames / scale, beta=0.2, reduction="none")
    with torch.autocast(frames.device.type, enabled=False):
        found, true = (places_in_world(net, one, window.way) for one in (frames, window.frames))
        places = (found - true).abs() * weights[:, None]
        speeds = (found.diff(dim=1) - true.diff(dim=1)).abs() * 30 * weights[:, None]
        jerk = (_sharpness(found) / _sharpness(true)).log().abs()
    total = off.mean() + PLACES * places.mean() + SPEEDS * speeds.mean() + sharp * jerk.mean()
    return (Term(total, len(window)),)


def _sharpness(places: Tensor) -> Tensor:
    """The mean length (B, J) of the third difference of joints (B, T, J, 3), metres per frame cubed."""
    third = places.diff(dim=1).diff(dim=1).diff(dim=1)
    return (third.square().sum(-1) + 1e-10).sqrt().mean(dim=1) + 1e-4


@torch.no_grad()
def _measured(net: MotionCodec, seen: Window) -> dict[str, float]:
    """Of people never seen: the mean distance in cm of joints from where they were, how sharp the movement is over how
    sharp it was, and the share of codes in use."""
    device = net.mean.device
    window = seen.to(device)
    values = net.encode(window.given)
    found, true = (places_in_world(net, one, window.way) for one in (net.decode(window.moves, values), window.frames))
    codes = net.to_codes(values).cpu().numpy()
    used = [len(np.unique(codes[..., group])) / net.config.codes for group in range(net.config.groups)]
    return {
        "validation": round(100 * float((found - true).norm(dim=-1).mean()), 4),
        "sharpness": round(float(_sharpness(found).mean() / _sharpness(true).mean()), 4),
        "used": round(float(np.mean(used)), 3),
    }
