"""Motions and sentences in one space, where what belongs together is near: the idea of CLIP and of TMR, made small.

Two encoders give unit vectors. In a batch each motion is to be nearer to its sentence than to the others, and each
sentence to its motion (symmetric InfoNCE: Radford et al. 2021, Petrovich et al. 2023), and to another wording of it;
what is said to show the same without being a pair is left out. With some hundred motions of a few dozen people, nets
that see every frame learn the people; so the encoder of motions sees statistics, and that of sentences a weighted mean
of words.

Letters in shapes: B rows, T frames, D channels, W words, S statistics, E numbers of a vector.
"""

from dataclasses import dataclass, field
from functools import partial

import torch
from torch import Tensor, nn
from torch.nn import functional

from motet.bundle.graph import GraphSpec
from motet_train.data.batches import Pairs
from motet_train.models.kinematics import EulerPlaces, Figure, in_whole_registers
from motet_train.models.net import Graphs, Net, Part, before, float_rows, id_rows, normalised
from motet_train.models.recurrent import WordEmbedding

LIMIT = 5.0
"""Standard deviations: wilder channels and statistics would outweigh all else."""

DEVIATION_FLOOR = 1e-3
"""Added to deviations and speeds: the root of less would make much of rounding."""


@dataclass(frozen=True)
class JointEmbeddingConfig:
    """Sizes, and what training adds.

    channels: D. words: of the vocabulary. figure: whose joints' places are seen, instead of the channels of joints.
    embedding: numbers of a word's vector. vector: E. noise: standard deviation of what training adds to the statistics,
    in theirs. temperature: what scores are divided by. wordings: weight of the loss between two wordings.
    """

    channels: int
    words: int
    figure: Figure = field(default_factory=Figure)
    embedding: int = 96
    vector: int = 128
    dropout: float = 0.3
    word_dropout: float = 0.3
    noise: float = 0.2
    temperature: float = 0.1
    wordings: float = 1.0
    travelled: int = 0


class JointEmbedding(Net):
    """Both encoders with the motions' normalisation. seen_mean, seen_scale: of the statistics."""

    CONFIG = JointEmbeddingConfig
    seen_mean: Tensor
    seen_scale: Tensor

    def __init__(self, config: JointEmbeddingConfig) -> None:
        super().__init__(config.channels)
        self.config = config
        # the statistics of a motion
        self.places = EulerPlaces(config.figure) if config.figure.parents else None
        joints = max(0, len(config.figure.parents) - 1)
        seen = 3 * joints + len(config.figure.root) if joints else config.channels
        statistics = of_frames(torch.zeros(1, 1, seen), torch.ones(1)).shape[1] + 2 * joints + 1 + 2 * config.travelled
        self.register_buffer("seen_mean", torch.zeros(statistics))
        self.register_buffer("seen_scale", torch.ones(statistics))
        # the encoder of motions, and that of sentences
        self.motion = nn.Linear(statistics, config.vector)
        self.words = WordEmbedding(config.words, config.embedding, config.word_dropout)
        self.weight = nn.Linear(config.embedding, 1)
        self.text = nn.Linear(config.embedding, config.vector)
        self.dropout = nn.Dropout(config.dropout)

    def embed_motion(self, frames: Tensor, lengths: Tensor) -> Tensor:
        """Frames (B, T, D) in the contract's units, of lengths (B,), to unit vectors (B, E)."""
        return self.embed_statistics(self.statistics(frames, lengths))

    def embed_statistics(self, seen: Tensor) -> Tensor:
        """Statistics (..., S) to unit vectors (..., E)."""
        z = normalised(seen, self.seen_mean, self.seen_scale, LIMIT)
        if self.training:
            z = z + self.config.noise * torch.randn_like(z)
        return functional.normalize(self.motion(self.dropout(z)), dim=-1)

    def see_by(self, seen: Tensor) -> None:
        """Set mean and scale of statistics from examples (..., S)."""
        rows = seen.flatten(0, -2)
        self.seen_mean.copy_(rows.mean(dim=0))
        self.seen_scale.copy_(rows.std(dim=0).clamp(min=0.03))

    def statistics(self, frames: Tensor, lengths: Tensor) -> Tensor:
        """Frames (B, T, D) of lengths (B,) to what is seen of the whole motion (B, S)."""
        normal = normalised(frames, self.mean, self.scale, LIMIT)
        length = torch.cat([lengths[:, None].log(), self.way(frames, lengths)], dim=1)
        if self.places is None:
            return torch.cat([of_frames(normal, lengths), length], dim=1)
        places = self.places(frames) / 0.2  # metres
        seen = torch.cat([places, normal[..., list(self.config.figure.root)]], dim=-1)
        return torch.cat([of_frames(seen, lengths), of_speeds(places, lengths), length], dim=1)

    def way(self, frames: Tensor, lengths: Tensor) -> Tensor:
        """Sums over frames (B, T, D) of lengths (B,) of the channels of the way, and of their sizes."""
        count = self.config.travelled
        rates = frames[..., :count] / self.scale[:count].clamp(min=DEVIATION_FLOOR) / 10
        rates = torch.where(before(lengths, frames.shape[1])[..., None], rates, 0.0)
        return torch.cat([rates.sum(dim=1), rates.abs().sum(dim=1)], dim=1)

    def embed_text(self, words: Tensor, lengths: Tensor) -> Tensor:
        """Ids (B, W) of sentences of lengths (B,) to unit vectors (B, E)."""
        vectors = self.words(words)
        known = before(lengths, words.shape[1])
        weights = self.weight(vectors)[..., 0].masked_fill(~known, -torch.inf).softmax(dim=1)
        mean = (weights[..., None] * vectors).sum(dim=1)
        return functional.normalize(self.text(self.dropout(mean)), dim=1)

    def losses(self, pairs: Pairs) -> Tensor:
        """For each row (B,) the loss between its motion and its sentence, and between its sentences, among all rows."""
        motions = self.embed_statistics(pairs.seen)
        texts, others = (self.embed_text(words, (words != 0).sum(dim=1)) for words in (pairs.words, pairs.others))
        between_motion_and_text = contrast(motions @ texts.T / self.config.temperature, pairs.groups)
        between_texts = contrast(texts @ others.T / self.config.temperature, pairs.groups)
        return between_motion_and_text + self.config.wordings * between_texts

    def graphs(self) -> Graphs:
        """Both encoders, each with its contract."""
        vector = float_rows("vector", self.config.vector)
        lengths = id_rows("lengths")
        frames = float_rows("frames", "time", self.config.channels)
        words = id_rows("words", "words")
        return {
            "motion": (Part(self, self.embed_motion), GraphSpec((frames, lengths), (vector,))),
            "text": (Part(self, self.embed_text), GraphSpec((words, lengths), (vector,))),
        }


def contrast(scores: Tensor, groups: Tensor) -> Tensor:
    """Symmetric InfoNCE (B,) of scores (B, B) of one kind (rows) and another (columns), whose diagonal is right.

    groups: (B,) what a row shows: pairs off the diagonal that show the same are left out.
    """
    right = torch.arange(len(groups), device=groups.device)
    alike = (groups[:, None] == groups) & (right[:, None] != right)
    scores = scores.masked_fill(alike, -torch.inf)
    rows, columns = (functional.cross_entropy(way, right, reduction="none") for way in (scores, scores.T))
    return (rows + columns) / 2


def of_frames(x: Tensor, lengths: Tensor) -> Tensor:
    """Frames (B, T, C) of lengths (B,) to mean, deviation, least and greatest, and the means of parts: (B, 7 C)."""
    # sums over thirds of the time: sitting down is not standing up
    parts = _thirds(lengths, x.shape[1])
    sums = parts @ x
    sizes = parts.sum(dim=2, keepdim=True)

    # mean, deviation, and extremes of the frames that there are
    active = before(lengths, x.shape[1])
    count = lengths[:, None]
    mean = sums.sum(dim=1) / count
    square = _sum((x - mean[:, None]).square(), active) / count
    shown = torch.where(active[..., None], x, x[:, :1])
    means = torch.where(sizes > 0, sums / sizes.clamp(min=1), mean[:, None]).flatten(1)
    deviation = _root(square + DEVIATION_FLOOR**2)
    return torch.cat([mean, deviation, shown.amin(dim=1), shown.amax(dim=1), means], dim=1)


def _thirds(lengths: Tensor, frames: int) -> Tensor:
    """Which of the first frames are in each third of rows of lengths (B,): (B, 3, frames) float32."""
    place = 3 * torch.arange(frames, device=lengths.device)
    length = lengths[:, None, None]
    starts = length * torch.arange(3, device=lengths.device)[:, None]
    return ((place >= starts) & (place < starts + length)).float()


def of_speeds(places: Tensor, lengths: Tensor) -> Tensor:
    """Places (B, T, 3 J) of joints to roots of their mean and greatest speeds (B, 2 J), per frame."""
    steps = torch.diff(places, dim=1, prepend=places[:, :1]).reshape(*places.shape[:2], -1, 3)
    active = before(lengths, places.shape[1])
    speed = torch.where(active[..., None], _root(steps.square().sum(dim=-1) + DEVIATION_FLOOR**2), 0.0)
    return _root(torch.cat([_sum(speed, active) / lengths[:, None], speed.amax(dim=1)], dim=1))


_root = partial(in_whole_registers, torch.sqrt)


def _sum(x: Tensor, active: Tensor) -> Tensor:
    """Sums (B, C) of the active frames (B, T) of x (B, T, C), which is finite: a product, faster than a reduction."""
    return (active[:, None].float() @ x)[:, 0]
