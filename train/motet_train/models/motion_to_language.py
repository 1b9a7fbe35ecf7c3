"""A sentence for a motion: bidirectional GRU encoder, GRU decoder over words (Plappert et al. 2017, section 4.2).

Letters in shapes: B rows, T frames, D channels, W words, V words of the vocabulary, C units of the context, S units of
the decoder.
"""

from abc import abstractmethod
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional

from motet.bundle.graph import GraphSpec, TensorSpec
from motet_train.data.batches import Batch
from motet_train.models.net import Graphs, Net, Part, before, normalised
from motet_train.models.recurrent import GRU, Attention, Decoder, Encoder, WordEmbedding

PAD = 0
SOS = 1
EOS = 2
"""Ids of the special words."""


class SummaryHead(nn.Module):
    """From contexts (B, C) to mean and deviation of D channels and the logarithm of the length, (B, 2 D + 1).

    Its loss exists in training only. A decoder that sees every frame before the next one learns to follow the frames
    and to ignore the sentence, whose context then holds no action. This head asks the context itself, so that the
    encoder of a sentence has to tell walking from running, and left from right, and the encoder of a motion has to keep
    what is only seen over the whole of it, such as a slow turn.
    """

    def __init__(self, context: int, channels: int) -> None:
        super().__init__()
        self.layers = nn.Sequential(nn.Linear(context, context), nn.Tanh(), nn.Linear(context, 2 * channels + 1))

    def loss(self, context: Tensor, normal: Tensor, lengths: Tensor) -> Tensor:
        """Mean squared error for contexts (B, C) of normalised frames (B, T, D) of the given lengths (B,)."""
        predicted: Tensor = self.layers(context)
        return (predicted - summary(normal, lengths)).square().mean()


def summary(normal: Tensor, lengths: Tensor) -> Tensor:
    """Mean, deviation and log-length (B, 2 D + 1) of normalised frames (B, T, D) of the given lengths (B,)."""
    real = before(lengths, normal.shape[1])[..., None]
    # within 5 deviations, or a few wild frames would outweigh the motion
    frames = torch.where(real, normal.clamp(-5.0, 5.0), 0.0)
    count = lengths[:, None]
    mean = frames.sum(dim=1) / count
    square = torch.where(real, (frames - mean[:, None]).square(), 0.0).sum(dim=1) / count
    return torch.cat([mean, square.sqrt(), count.log()], dim=1)


class LanguageNet(Net):
    """A net between motion and language. summary: its head, if any, whose loss weighs ``config.summary``."""

    config: Any
    summary: SummaryHead | None

    @abstractmethod
    def terms(self, batch: Batch) -> tuple[Tensor, Tensor | None]:
        """The losses of all active steps (N,), and in training the weighted loss of the summary head, if there is one:
        a mean over the B rows."""

    def summary_loss(self, batch: Batch, context: Tensor) -> Tensor | None:
        """The second of the :meth:`terms`, from contexts (B, C)."""
        if self.summary is None or not self.training:
            return None
        normal = normalised(batch.frames, self.mean, self.scale)
        weighed: Tensor = self.config.summary * self.summary.loss(context, normal, batch.lengths)
        return weighed


@dataclass(frozen=True)
class MotionToLanguageConfig:
    """Sizes; the defaults are the paper's (table 1). channels: D, without the flag. words: V, with special words."""

    channels: int
    words: int
    encoder_units: tuple[int, ...] = (64, 64)
    decoder_units: tuple[int, ...] = (128, 128)
    embedding: int = 64
    dropout: float = 0.4
    gates: str = "sigmoid"
    frame_noise: float = 0.0
    """Standard deviation of what training adds to the frames, in normalised units."""
    travelled: int = 0
    """Number of first channels whose sum so far the encoder also sees: way and turn since the start."""
    summary: float = 0.0
    """Weight of the loss of :class:`SummaryHead`; 0 leaves the head out."""
    attention: bool = False
    """Whether the words also see the encoder's states through :class:`motet_train.models.recurrent.Attention`, beside
    the last ones, which are the context; the paper names this as future work."""


class MotionToLanguage(LanguageNet):
    """The net with its normalisation."""

    CONFIG = MotionToLanguageConfig

    def __init__(self, config: MotionToLanguageConfig) -> None:
        super().__init__(config.channels)
        self.config = config
        context = 2 * config.encoder_units[-1]
        shared = (config.gates, config.dropout)
        self.encoder = Encoder(GRU, config.channels + config.travelled + 1, config.encoder_units, *shared)
        self.embedding = WordEmbedding(config.words, config.embedding, config.dropout)
        self.decoder = Decoder(GRU, config.embedding, context, config.decoder_units, False, *shared)
        seen = sum(config.decoder_units)
        self.attention = Attention(seen, context) if config.attention else None
        self.output = nn.Linear(seen + (context if config.attention else 0), config.words)
        nn.init.xavier_uniform_(self.output.weight)
        nn.init.zeros_(self.output.bias)
        self.summary = SummaryHead(context, config.channels) if config.summary else None

    def encode(self, frames: Tensor, lengths: Tensor) -> Tensor:
        """Frames (B, T, D) in the contract's units, of lengths (B,), to contexts (B, C)."""
        context: Tensor = self.encoder(self._seen(frames), lengths)
        return context

    def encode_states(self, frames: Tensor, lengths: Tensor) -> tuple[Tensor, Tensor]:
        """The contexts (B, C) of :meth:`encode`, and the states (B, T, C), 0 after a row's end, for the attention."""
        states, context = self.encoder.states(self._seen(frames), lengths)
        real = before(lengths, frames.shape[1])[..., None]
        return context, torch.where(real, states, 0.0)

    def _seen(self, frames: Tensor) -> Tensor:
        """What the encoder sees of frames (B, T, D): normalised, the sums so far, and the flag."""
        normal = normalised(frames, self.mean, self.scale)
        sums = normal[..., : self.config.travelled].cumsum(dim=1) / 10  # a second's frames at the usual rate
        if self.training and self.config.frame_noise:
            normal = normal + self.config.frame_noise * torch.randn_like(normal)
        return torch.cat([normal, sums, torch.ones_like(normal[..., :1])], dim=-1)

    def outputs(self, words: Tensor, context: Tensor) -> Tensor:
        """Outputs of the decoder (B, W, S) after each of the words (B, W) and all before it."""
        outputs: Tensor = self.decoder(self.embedding(words), context)
        return outputs

    def log_probabilities(self, outputs: Tensor) -> Tensor:
        """Outputs of the decoder (..., S), and what they attend to, to log-probabilities of the next word (..., V),
        eq. 5 and 6."""
        dropped = functional.dropout(outputs, self.config.dropout, self.training)
        return functional.log_softmax(self.output(dropped).float(), dim=-1)

    def terms(self, batch: Batch) -> tuple[Tensor, Tensor | None]:
        """Cross-entropy of every word and every EOS of the batch (N,), whose mean is eq. 7; and the summary's loss."""
        lengths = (batch.words != PAD).sum(dim=1)
        words = functional.pad(batch.words, (1, 0), value=SOS)
        targets = functional.pad(batch.words, (0, 1), value=PAD).scatter(1, lengths[:, None], EOS)
        active = before(lengths + 1, words.shape[1])
        if self.attention is None:
            context = self.encode(batch.frames, batch.lengths)
            outputs = self.outputs(words, context)
        else:
            context, states = self.encode_states(batch.frames, batch.lengths)
            outputs = self.outputs(words, context)
            outputs = torch.cat([outputs, self.attention(outputs, states, batch.lengths)], dim=-1)
        # padded steps are left out before the output layer, which is the largest product of all
        losses = functional.nll_loss(self.log_probabilities(outputs[active]), targets[active], reduction="none")
        return losses, self.summary_loss(batch, context)

    def step(self, word: Tensor, context: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        """Word (B,), context (B, C), state (B, S) to log-probabilities (B, V) and the next state (B, S)."""
        following = self.decoder.step(self.embedding(word[:, None])[:, 0], context, state)
        return self.log_probabilities(following), following

    def attending_step(
        self, word: Tensor, context: Tensor, states: Tensor, lengths: Tensor, state: Tensor
    ) -> tuple[Tensor, Tensor]:
        """:meth:`step` that also attends to the first ``lengths`` (B,) of the encoder's states (B, T, C)."""
        assert self.attention is not None
        following = self.decoder.step(self.embedding(word[:, None])[:, 0], context, state)
        attended = self.attention(following[:, None], states, lengths)[:, 0]
        return self.log_probabilities(torch.cat([following, attended], dim=-1)), following

    def graphs(self) -> Graphs:
        """The encoder and the step, each with its contract."""
        size = 2 * self.config.encoder_units[-1]
        frames = TensorSpec("frames", ("batch", "time", self.config.channels))
        lengths = TensorSpec("lengths", ("batch",), "int64")
        context = TensorSpec("context", ("batch", size))
        if self.attention is None:
            encoder = Part(self, self.encode), GraphSpec((frames, lengths), (context,))
            return {"encoder": encoder, "step": (Part(self, self.step), self._step_spec(context))}
        states = TensorSpec("states", ("batch", "time", size))
        encoder = Part(self, self.encode_states), GraphSpec((frames, lengths), (context, states))
        step = Part(self, self.attending_step), self._step_spec(context, states, lengths)
        return {"encoder": encoder, "step": step}

    def _step_spec(self, *contexts: TensorSpec) -> GraphSpec:
        """The contract of a step that takes these of a motion."""
        units = sum(self.config.decoder_units)
        word = TensorSpec("word", ("batch",), "int64")
        state = TensorSpec("state", ("batch", units))
        scores = TensorSpec("log_probabilities", ("batch", self.config.words))
        following = TensorSpec("next_state", ("batch", units))
        return GraphSpec((word, *contexts, state), (scores, following), {"state": "next_state"})
