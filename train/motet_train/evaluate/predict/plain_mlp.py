"""A plain rival of predictors: a residual MLP on the positions of joints alone, trained when it is compared.

It knows no bones, no rotations and no representation: joints as seen from the last seed frame, its hips at the origin
and facing z, go in, and their steps from that frame come out. So it says what a predictor has to beat with the same
data, in some five minutes of one processor. Letters in shapes: W windows, L seed frames, N predicted frames, J joints.
Positions are metres, y up.
"""

from collections.abc import Iterator, Sequence
from copy import deepcopy

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from motet.figures.humanoid import HUMANOID, LEFT_RIGHT, sided
from motet.motion.kinematics import positions
from motet.motion.rotations import Array
from motet.motion.skeleton import partners_of
from motet.representation.contract import named
from motet_train.data.store import Store
from motet_train.evaluate.positions import length
from motet_train.models.figure_predictor import PLACE_SCALE, STEP_SCALE
from motet_train.models.net import zero_linear
from motet_train.models.predictor import Block

PLAIN_MLP = "plain MLP"
"""Its name in tables."""

PLAIN_BONES = f"{PLAIN_MLP} with bones"
"""The name of its points, once bones have kept their lengths."""

STEPS = 7_000
"""Batches of training."""

WINDOWS_OF_STEP = 128
LARGEST_RATE = 1.5e-3
"""The largest learning rate: it falls to 0 along a cosine."""

AVERAGED = 0.995
"""Of the averaged weights, the share that stays at each step."""

HIDDEN = 512
BLOCKS = 3

ACROSS = [HUMANOID.index(sided(side, "UpperLeg")) for side in LEFT_RIGHT]
"""Left and right hip joint: the facing is at right angles to the line through them."""

MIRRORED_JOINTS = partners_of(HUMANOID.names)
MIRROR = torch.tensor([-1.0, 1.0, 1.0])


class PlainMLP(nn.Module):
    """Positions (W, L, J, 3) to those of the next frames (W, N, J, 3), both seen from the last seed frame."""

    time: Tensor

    def __init__(self, seed: int, frames: int) -> None:
        super().__init__()
        width = 3 * len(HUMANOID.names)
        self.inward = nn.Linear(seed * width, HIDDEN)
        self.blocks = nn.Sequential(*(Block(HIDDEN, 0.0) for _ in range(BLOCKS)))
        self.outward = zero_linear(HIDDEN, frames * width)
        # steps grow with time, so that those of early frames are small
        self.register_buffer("time", torch.arange(1.0, frames + 1) / (frames / 3), persistent=False)

    def forward(self, seed: Tensor) -> Tensor:
        """Positions (W, L, J, 3) to (W, N, J, 3)."""
        last = seed[:, -1:]
        inputs = [PLACE_SCALE * last.flatten(1), STEP_SCALE * seed.diff(dim=1).flatten(1)]
        hidden = self.blocks(self.inward(torch.cat(inputs, dim=1)))
        steps = torch.unflatten(self.outward(hidden), 1, (-1, *seed.shape[2:])) / PLACE_SCALE
        moved: Tensor = last + steps * self.time[:, None, None]
        return moved


def seen_from_last(windows: Tensor, seed: int) -> tuple[Tensor, Tensor, Tensor]:
    """Windows (W, T, J, 3) seen from the frame before frame ``seed``; its hips (W, 1, 1, 3) on the ground, and the
    rotation (W, 3, 3) from its facing to the world."""
    frame = windows[:, seed - 1]
    origin = (frame[:, :1] * torch.tensor([1.0, 0.0, 1.0]))[:, None]
    turned = _turn_along(frame[:, ACROSS[0]] - frame[:, ACROSS[1]])
    return (windows - origin) @ turned[:, None], origin, turned


def _turn_along(across: Tensor) -> Tensor:
    """The turns (W, 3, 3) about the vertical that take x to where vectors (W, 3) point over the ground."""
    ahead = functional.normalize(across * torch.tensor([1.0, 0.0, 1.0]), dim=-1)
    up = torch.tensor([0.0, 1.0, 0.0]).expand_as(ahead)
    return torch.stack([ahead, up, torch.linalg.cross(ahead, up)], dim=-1)


def mirrored(places: Tensor) -> Tensor:
    """Positions (..., J, 3) with left and right exchanged."""
    return places[..., MIRRORED_JOINTS, :] * MIRROR


def trained(clips: Sequence[Array], seed: int, frames: int, steps: int = STEPS) -> PlainMLP:
    """The net after training on windows of clips (T, J, 3), half of them mirrored; always the same for the same
    clips."""
    torch.manual_seed(0)
    net = PlainMLP(seed, frames)
    averaged = deepcopy(net)
    descent = torch.optim.AdamW(net.parameters(), lr=LARGEST_RATE, weight_decay=1e-3)
    rates = torch.optim.lr_scheduler.OneCycleLR(descent, LARGEST_RATE, steps, pct_start=min(0.3, 100 / steps))
    for windows in _batches(clips, seed, seed + frames, steps):
        descent.zero_grad()
        _loss(net(windows[:, :seed]) - windows[:, seed:]).backward()  # type: ignore[no-untyped-call]
        nn.utils.clip_grad_norm_(net.parameters(), 1.0)
        descent.step()
        rates.step()
        for mean, weight in zip(averaged.parameters(), net.parameters(), strict=True):
            mean.data.lerp_(weight.data, 1 - AVERAGED)
    return averaged.eval()


def _loss(apart: Tensor) -> Tensor:
    """The mean distance of joints by vectors (W, N, J, 3) to their true places, and how these change by the frame."""
    error: Tensor = torch.linalg.vector_norm(apart, dim=-1).mean()
    change: Tensor = torch.linalg.vector_norm(apart.diff(dim=1), dim=-1).mean()
    return error + change


def _batches(clips: Sequence[Array], seed: int, length: int, count: int) -> Iterator[Tensor]:
    """Windows (B, length, J, 3) of clips as they are seen at prediction, half of them mirrored, so many times."""
    rng = np.random.default_rng(0)
    places = torch.from_numpy(np.concatenate(clips)).float()
    starts = _starts([len(clip) for clip in clips], length)
    for _ in range(count):
        drawn = torch.from_numpy(rng.choice(starts, WINDOWS_OF_STEP))[:, None] + torch.arange(length)
        windows, _, _ = seen_from_last(places[drawn], seed)
        flipped = torch.from_numpy(rng.random(WINDOWS_OF_STEP) < 0.5)[:, None, None, None]
        yield torch.where(flipped, mirrored(windows), windows)


def _starts(lengths: Sequence[int], window: int) -> Array:
    """The first rows of all windows in clips of these lengths, one after the other."""
    starts = []
    first = 0
    for frames in lengths:
        starts.append(np.arange(first, first + frames - window + 1))
        first += frames
    return np.concatenate(starts)


@torch.no_grad()
def positions_after(net: PlainMLP, seeds: Array) -> Array:
    """Positions (W, N, J, 3) after seeds (W, L, J, 3), in the world: the mean of those for them and for their mirror
    images."""
    count = seeds.shape[1]
    seen, origin, turned = seen_from_last(torch.from_numpy(seeds).float(), count)
    both = (net(seen) + mirrored(net(mirrored(seen)))) / 2
    in_world: Array = (both @ turned[:, None].transpose(-1, -2) + origin).double().numpy()
    return in_world


def with_bones(points: Array) -> Array:
    """Points (..., J, 3) with each bone at its length: from the hips outwards it is aimed at the point of its tip."""
    joints = points.copy()
    for joint, parent in enumerate(HUMANOID.parents[1:], start=1):
        start = joints[..., parent, :]
        aim = points[..., joint, :] - start
        joints[..., joint, :] = start + aim / length(aim)[..., None] * length(HUMANOID.offsets[joint])
    return joints


def training_clips(store: Store, held_out: Sequence[str]) -> list[Array]:
    """Positions (T, J, 3) in metres in the records of a store on the humanoid that are not held out."""
    playable = named(store.representation).motion
    clips = []
    for number, entry in enumerate(store.records):
        if entry.name not in held_out:
            clips.append(positions(playable(store.motion(number))))
    return clips
