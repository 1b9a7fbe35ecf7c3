"""A motion for a sentence: layer-norm GRUs and a mixture of Gaussians for each frame (Plappert et al. 2017, 4.3).

Letters in shapes: B rows, T frames, D channels, W words, C units of the context, K components. A frame of D + 1 numbers
is normalised and has the active flag at its end: 1 on every frame of a motion and 0 on the one that ends it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional

from motet.bundle.graph import GraphSpec, TensorSpec
from motet.representation.contract import Z_LIMIT
from motet_train.data.batches import Batch
from motet_train.models.motion_to_language import LanguageNet, SummaryHead
from motet_train.models.net import Part, before, normalised, tuples
from motet_train.models.recurrent import Decoder, Encoder, WordEmbedding
from motet_train.papers.plappert2017.layer_norm_gru import LayerNormGRU
from motet_train.papers.plappert2017.mixture_head import Mixture, MixtureHead

LOSSES = {"surrogate": Mixture.surrogate_loss, "likelihood": lambda *given: -Mixture.log_likelihood(*given)}
"""Eq. 12, on which the paper's net was trained, and eq. 11, the true likelihood."""


@dataclass(frozen=True)
class LanguageToMotionConfig:
    """Sizes; the defaults are the paper's (table 1). channels: D, without the flag. words: V, with special words."""

    channels: int
    words: int
    encoder_units: tuple[int, ...] = (64, 64)
    decoder_units: tuple[int, ...] = (400, 400, 400)
    embedding: int = 64
    components: int = 20
    dropout: float = 0.1
    gates: str = "sigmoid"
    loss: str = "surrogate"
    variance_floor: float = 1e-4
    """In normalised units."""
    feed_noise: float = 0.0
    """Standard deviation of what training adds to the frames that are fed back, in normalised units: a free run feeds
    back frames that are a little off, and must find its way back."""
    frame_dropout: float = 0.0
    """Mean share of the frames that are fed back as zeros in training, from none to twice as many in a sequence: what
    the frame before does not tell, the context must."""
    summary: float = 0.0
    """Weight of the training-only loss of :mod:`motet_train.models.motion_to_language`; 0 leaves its head out."""


class LanguageToMotion(LanguageNet):
    """The net with its normalisation."""

    def __init__(self, config: LanguageToMotionConfig) -> None:
        super().__init__(config.channels)
        self.config = config
        context, shared = 2 * config.encoder_units[-1], (config.gates, config.dropout)
        self.embedding = WordEmbedding(config.words, config.embedding, config.dropout)
        self.encoder = Encoder(LayerNormGRU, config.embedding, config.encoder_units, *shared)
        self.decoder = Decoder(LayerNormGRU, config.channels + 1, context, config.decoder_units, True, *shared)
        self.head = MixtureHead(
            sum(config.decoder_units), config.channels, config.components, config.variance_floor, config.dropout
        )
        self.summary = SummaryHead(context, config.channels) if config.summary else None

    def encode(self, words: Tensor, lengths: Tensor) -> Tensor:
        """Words (B, W) without SOS and EOS, of lengths (B,), to contexts (B, C)."""
        context: Tensor = self.encoder(self.embedding(words), lengths)
        return context

    def outputs(self, frames: Tensor, context: Tensor) -> Tensor:
        """Outputs of the decoder (B, T, S) from which each of the frames (B, T, D + 1) is predicted."""
        given = torch.cat([torch.ones_like(frames[:, :1]), frames[:, :-1]], dim=1).clamp(-Z_LIMIT, Z_LIMIT)
        found: Tensor = self.decoder(given, context)
        return found

    def mixture(self, outputs: Tensor) -> Mixture:
        """The distributions of frames from outputs (..., S) of the decoder; dead channels stay at 0."""
        found: Mixture = self.head(outputs)
        living = self.scale > 0
        means, variances = (torch.where(living, values, 0.0) for values in (found.means, found.variances))
        return replace(found, means=means, variances=variances)

    def terms(self, batch: Batch) -> tuple[Tensor, Tensor | None]:
        """The loss of every frame and of the one after it where a motion ends (N,), eq. 12 or 11; and the summary's."""
        context = self.encode(batch.words, (batch.words != 0).sum(dim=1))
        return LOSSES[self.config.loss](*self._predictions(batch, context)), self.summary_loss(batch, context)

    def _predictions(self, batch: Batch, context: Tensor) -> tuple[Mixture, Tensor, Tensor]:
        """Mixtures, frames (N, D) and flags (N,) of all active steps, in one row."""
        normal = functional.pad(normalised(batch.frames, self.mean, self.scale), (0, 0, 0, 1))
        flags = before(batch.lengths, normal.shape[1]).to(normal.dtype)
        active = before(batch.lengths + (1 if batch.ended is None else batch.ended), normal.shape[1])
        fed = self._blurred(normal) if self.training else normal
        outputs = self.outputs(torch.cat([fed, flags[..., None]], dim=-1), context)
        # padded steps are left out before the output layer, which is the largest product of all
        return self.mixture(outputs[active]), normal[active], flags[active]

    def _blurred(self, normal: Tensor) -> Tensor:
        """Frames (B, T, D) as training feeds them back: with noise, and some of them left out."""
        config = self.config
        if config.feed_noise:
            normal = normal + config.feed_noise * torch.randn_like(normal)
        if config.frame_dropout:
            share = 2 * config.frame_dropout * torch.rand_like(normal[:, :1, :1])
            normal = normal * (torch.rand_like(normal[..., :1]) >= share)
        return normal

    def step(self, frame: Tensor, context: Tensor, state: Tensor) -> tuple[Tensor, ...]:
        """Frame (B, D + 1), context (B, C), state (B, S) to the next frame's mixture and the next state.

        log_weights (B, K), means and standard deviations (B, K, D) in normalised units, probability of the flag (B,).
        """
        following = self.decoder.step(frame.clamp(-Z_LIMIT, Z_LIMIT), context, state)
        mixture = self.mixture(following)
        stds = mixture.variances.sqrt()
        return mixture.log_weights, mixture.means, stds, mixture.active.sigmoid(), following

    def graphs(self) -> dict[str, tuple[nn.Module, GraphSpec]]:
        """The encoder and the step, each with its contract."""
        channels, components = self.config.channels, self.config.components
        context = TensorSpec("context", ("batch", 2 * self.config.encoder_units[-1]))
        words, lengths = TensorSpec("words", ("batch", "words"), "int64"), TensorSpec("lengths", ("batch",), "int64")
        state, following = (TensorSpec(n, ("batch", sum(self.config.decoder_units))) for n in ("state", "next_state"))
        mixture = (
            TensorSpec("log_weights", ("batch", components)),
            *(TensorSpec(name, ("batch", components, channels)) for name in ("means", "stds")),
            TensorSpec("active", ("batch",)),
        )
        frame = TensorSpec("frame", ("batch", channels + 1))
        step = GraphSpec((frame, context, state), (*mixture, following), {"state": "next_state"})
        encoder = GraphSpec((words, lengths), (context,))
        return {"encoder": (Part(self, self.encode), encoder), "step": (Part(self, self.step), step)}


def from_config(config: Mapping[str, Any]) -> LanguageToMotion:
    """An untrained net of a configuration as it stands in a manifest."""
    return LanguageToMotion(LanguageToMotionConfig(**tuples(config)))
