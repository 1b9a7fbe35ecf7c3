"""Motions and sentences in one space, where what belongs together is near: the design of CLIP and of TMR, small.

An encoder of motions and one of sentences give unit vectors. In a batch each motion is to be nearer to its sentence
than to the others, and each sentence to its motion (symmetric InfoNCE, as in Radford et al. 2021 and Petrovich et al.
2023); pairs that mean the same without being a pair are no negatives.

Letters in shapes: B rows, T frames, D channels, W words, U units, E numbers of a vector.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional

from motet.bundle.graph import GraphSpec, TensorSpec
from motet_train.data.batch import Batch, before
from motet_train.models.language.dropout import WordEmbedding
from motet_train.models.language.places import Figure, Places
from motet_train.models.net import Net, Part, tuples
from motet_train.models.normalised import normalised

PAD = 0
LIMIT = 5.0
"""Standard deviations: wilder frames would outweigh the motion."""

NEAR = 0.2
"""Metres: what places are divided by."""


@dataclass(frozen=True)
class JointEmbeddingConfig:
    """Sizes. channels: D. words: of the vocabulary. figure: whose joints' places are seen, too.

    frame_noise: standard deviation of what training adds to normalised frames, posture_noise of what it adds to all
    frames of a motion alike, as another person's posture would.
    """

    channels: int
    words: int
    figure: Figure = field(default_factory=Figure)
    units: int = 128
    blocks: int = 3
    embedding: int = 96
    vector: int = 128
    dropout: float = 0.2
    word_dropout: float = 0.1
    frame_noise: float = 0.1
    posture_noise: float = 0.2
    temperature: float = 0.1
    texts: float = 0.0


class Mixed(nn.Module):
    """A residual convolution along a sequence; padded steps stay 0."""

    def __init__(self, units: int, dilation: int, dropout: float) -> None:
        super().__init__()
        self.norm = nn.LayerNorm(units)
        self.convolution = nn.Conv1d(units, units, 3, padding=dilation, dilation=dilation)
        self.dropout = nn.Dropout(dropout)

    def forward(self, x: Tensor, active: Tensor) -> Tensor:
        """Sequences (B, T, U), of which the steps count where active (B, T, 1) is 1."""
        y: Tensor = self.convolution((self.norm(x) * active).transpose(1, 2)).transpose(1, 2)
        mixed: Tensor = (x + self.dropout(functional.gelu(y))) * active
        return mixed


class Pooled(nn.Module):
    """Layers over a sequence, and the unit vector of the mean and the greatest of what they give."""

    def __init__(self, units: int, dilations: tuple[int, ...], vector: int, dropout: float) -> None:
        super().__init__()
        self.layers = nn.ModuleList(Mixed(units, dilation, dropout) for dilation in dilations)
        self.norm, self.dropout = nn.LayerNorm(2 * units), nn.Dropout(dropout)
        self.output = nn.Linear(2 * units, vector)

    def forward(self, x: Tensor, lengths: Tensor) -> Tensor:
        """Sequences (B, T, U) of the given lengths (B,) to vectors (B, E)."""
        active = before(lengths, x.shape[1])[..., None].to(x.dtype)
        x = x * active
        for layer in self.layers:
            x = layer(x, active)
        mean = x.sum(dim=1) / lengths[:, None]
        most = (x - 1e4 * (1 - active)).amax(dim=1)
        found = self.output(self.dropout(self.norm(torch.cat([mean, most], dim=1))))
        return functional.normalize(found.float(), dim=1)


class JointEmbedding(Net):
    """Both encoders with the motions' normalisation."""

    def __init__(self, config: JointEmbeddingConfig) -> None:
        super().__init__(config.channels)
        self.config = config
        self.places = Places(config.figure) if config.figure.parents else None
        seen = config.channels + 3 * len(config.figure.parents)
        self.frames = nn.Conv1d(seen, config.units, 3, stride=2, padding=2)
        dilations = tuple(2**block for block in range(config.blocks))
        self.motion = Pooled(config.units, dilations, config.vector, config.dropout)
        self.words = WordEmbedding(config.words, config.embedding, config.word_dropout)
        self.text = Pooled(config.embedding, (1,), config.vector, config.dropout)

    def embed_motion(self, frames: Tensor, lengths: Tensor) -> Tensor:
        """Frames (B, T, D) in the contract's units, of lengths (B,), to unit vectors (B, E)."""
        seen = [normalised(frames, self.mean, self.scale, LIMIT)]
        if self.places is not None:
            seen.append(self.places(frames) / NEAR)
        x = torch.cat(seen, dim=-1)
        if self.training:
            x = x + self.config.frame_noise * torch.randn_like(x)
            x = x + self.config.posture_noise * torch.randn_like(x[:, :1])
        x = x * before(lengths, x.shape[1])[..., None]
        found: Tensor = self.motion(self.frames(x.transpose(1, 2)).transpose(1, 2), lengths // 2 + 1)
        return found

    def embed_text(self, words: Tensor, lengths: Tensor) -> Tensor:
        """Ids (B, W) of sentences of lengths (B,) to unit vectors (B, E)."""
        found: Tensor = self.text(self.words(words), lengths)
        return found

    def losses(self, batch: Batch) -> Tensor:
        """For each row how hard its motion and its sentence find each other among the others' (B,)."""
        motions = self.embed_motion(batch.frames, batch.lengths)
        texts = self.embed_text(batch.words, (batch.words != PAD).sum(dim=1))
        assert batch.groups is not None
        return contrast(motions @ texts.T / self.config.temperature, batch.groups)

    def graphs(self) -> dict[str, tuple[nn.Module, GraphSpec]]:
        """Both encoders, each with its contract."""
        vector, lengths = (
            TensorSpec("vector", ("batch", self.config.vector)),
            TensorSpec("lengths", ("batch",), "int64"),
        )
        frames = TensorSpec("frames", ("batch", "time", self.config.channels))
        words = TensorSpec("words", ("batch", "words"), "int64")
        return {
            "motion": (Part(self, self.embed_motion), GraphSpec((frames, lengths), (vector,))),
            "text": (Part(self, self.embed_text), GraphSpec((words, lengths), (vector,))),
        }


def contrast(scores: Tensor, groups: Tensor) -> Tensor:
    """Symmetric InfoNCE (B,) of the scores (B, B) of motions (rows) and sentences (columns), whose diagonal is right.

    groups: (B,) what a row means: pairs off the diagonal that mean the same are left out.
    """
    alike = (groups[:, None] == groups) & ~torch.eye(len(groups), dtype=torch.bool, device=groups.device)
    scores, right = scores.masked_fill(alike, -torch.inf), torch.arange(len(groups), device=groups.device)
    both = (functional.cross_entropy(way, right, reduction="none") for way in (scores, scores.T))
    return sum(both) / 2  # type: ignore[return-value]


def from_config(config: Mapping[str, Any]) -> JointEmbedding:
    """An untrained net of a configuration as it stands in a manifest."""
    found = dict(tuples(config))
    return JointEmbedding(JointEmbeddingConfig(**{**found, "figure": Figure(**found["figure"])}))
