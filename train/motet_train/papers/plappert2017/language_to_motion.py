"""A motion for a sentence: layer-norm GRUs and a mixture of Gaussians for each frame (Plappert et al. 2017, 4.3, 5.2).

Letters in shapes: B rows, T frames, D channels, W words, C units of the context, K components, G directions, N units;
"..." is any number of leading axes. A frame of D + 1 numbers is normalised and ends in the active flag, which is 1 for
the frames of a motion and 0 for the one after its end.
"""

import math
from dataclasses import dataclass, replace

import torch
from torch import Tensor, nn
from torch.nn import functional

from motet.bundle.graph import GraphSpec
from motet.representation.contract import Z_LIMIT
from motet_train.data.batches import Batch
from motet_train.models.motion_to_language import LanguageNet, SummaryHead
from motet_train.models.net import Graphs, before, encoder_and_step, float_rows, id_rows, normalised
from motet_train.models.recurrent import GATES, GRU, Decoder, Encoder, WordEmbedding, mask


class LayerNormGRU(GRU):
    """One layer whose reset gate acts after the recurrent product: candidate tanh(LN(W x + b) + r * LN(U h)).

    There are four normalisations with gain and bias, 12 N parameters for each direction: of the input of both gates
    together, of the input of the candidate, and of the recurrent products of the same two.
    """

    def __init__(self, inputs: int, units: int, directions: int, gates: str, dropout: float) -> None:
        super().__init__(inputs, units, directions, gates, dropout)
        self.input_gate_norm = Norm(directions, 2 * units)
        self.gate_norm = Norm(directions, 2 * units)
        self.input_candidate_norm = Norm(directions, units)
        self.candidate_norm = Norm(directions, units)

    def project(self, x: Tensor) -> tuple[Tensor, Tensor]:
        """The projections of the plain unit, normalised."""
        gates, candidate = super().project(x)
        return self.input_gate_norm(gates), self.input_candidate_norm(candidate)

    def cell(self, state: Tensor, gates: Tensor, candidate: Tensor, keep: Tensor | None) -> Tensor:
        """The next state (G, B, N); see :meth:`GRU.cell`."""
        dropped = state if keep is None else state * keep
        gates = GATES[self.gates](gates + self.gate_norm(dropped @ self.gate_recurrence))
        update, reset = gates.chunk(2, dim=-1)
        candidate = torch.tanh(candidate + reset * self.candidate_norm(dropped @ self.candidate_recurrence))
        return candidate + update * (state - candidate)


class Norm(nn.Module):
    """Layer normalisation with a gain and a bias for each direction."""

    def __init__(self, directions: int, units: int) -> None:
        super().__init__()
        self.gain = nn.Parameter(torch.ones(directions, 1, units))
        self.bias = nn.Parameter(torch.zeros(directions, 1, units))

    def forward(self, x: Tensor) -> Tensor:
        """(G, ?, N) to the same shape: zero mean and unit variance over N, times the gain, plus the bias."""
        normal: Tensor = functional.layer_norm(x, x.shape[-1:])
        return normal * self.gain + self.bias


@dataclass(frozen=True, eq=False)
class Mixture:
    """The distribution of one frame: log_weights (..., K), means and variances (..., K, D), active (...), a logit.

    A channel of variance 0 is dead: it is always at its mean, and not part of the density.
    """

    log_weights: Tensor
    means: Tensor
    variances: Tensor
    active: Tensor

    def log_density(self, frames: Tensor) -> Tensor:
        """Log-density of frames (..., D) by log-sum-exp: eq. 8 without the flag."""
        return torch.logsumexp(self.log_weights + self._log_densities(frames).sum(dim=-1), dim=-1)

    def surrogate(self, frames: Tensor) -> Tensor:
        """The weighted mean of the components' log-densities of frames (..., D): eq. 12 without the flag.

        Without products of densities, and with each at least 1e-8 (the authors' code), nothing underflows.
        """
        floored = torch.log(self._log_densities(frames).exp() + 1e-8).sum(dim=-1)
        return (self.log_weights.exp() * floored).sum(dim=-1)

    def log_flag(self, flags: Tensor) -> Tensor:
        """Log-probability of flags (...), 1 or 0 (eq. 10)."""
        # logsigmoid would be exported as the logarithm of a sigmoid, which underflows
        return -functional.softplus(torch.where(flags > 0, -self.active, self.active))

    def log_likelihood(self, frames: Tensor, flags: Tensor) -> Tensor:
        """Log-likelihood of frames (..., D) with flags (...): eq. 8, or only the flag's part where it is 0."""
        return torch.where(flags > 0, self.log_density(frames), 0.0) + self.log_flag(flags)

    def surrogate_loss(self, frames: Tensor, flags: Tensor) -> Tensor:
        """The terms of eq. 12, before the mean, for frames (..., D) with flags (...)."""
        return -torch.where(flags > 0, self.surrogate(frames), 0.0) - self.log_flag(flags)

    def _log_densities(self, frames: Tensor) -> Tensor:
        """Log-densities (..., K, D) of each channel under each component."""
        living = self.variances > 0
        variances = torch.where(living, self.variances, 1.0)
        square = (frames[..., None, :] - self.means) ** 2 / variances
        return torch.where(living, -0.5 * (square + variances.log() + math.log(2 * math.pi)), 0.0)


class MixtureHead(nn.Module):
    """The output layer: from the decoder's outputs to the mixture (section 4.3.1), after dropout.

    It has 2 K D + K + 1 outputs. floor: least variance; the paper has none, but without it the likelihood of a channel
    that never moves is unbounded.
    """

    def __init__(self, inputs: int, channels: int, components: int, floor: float, dropout: float) -> None:
        super().__init__()
        self.sizes = [components * channels, components * channels, components, 1]
        self.components = components
        self.floor = floor
        self.dropout = dropout
        self.linear = nn.Linear(inputs, sum(self.sizes))
        nn.init.zeros_(self.linear.bias)
        for part in torch.split_with_sizes(self.linear.weight.detach(), self.sizes):
            nn.init.xavier_uniform_(part)

    def forward(self, x: Tensor) -> Mixture:
        """Outputs (..., S) of the decoder to mixtures."""
        keep = mask(self, self.dropout, x, *x.shape)
        parameters = self.linear(x if keep is None else x * keep).float()
        means, variances, weights, active = torch.split_with_sizes(parameters, self.sizes, dim=-1)
        shape = (*x.shape[:-1], self.components, -1)
        return Mixture(
            weights.log_softmax(dim=-1),
            means.reshape(shape),
            functional.softplus(variances).reshape(shape) + self.floor,
            active.squeeze(-1),
        )


def negative_log_likelihood(mixture: Mixture, frames: Tensor, flags: Tensor) -> Tensor:
    """The terms of eq. 11, before the mean, for frames (..., D) with flags (...)."""
    return -mixture.log_likelihood(frames, flags)


LOSSES = {"surrogate": Mixture.surrogate_loss, "likelihood": negative_log_likelihood}
"""Eq. 12, the paper's training loss, and eq. 11, the true likelihood."""


@dataclass(frozen=True)
class LanguageToMotionConfig:
    """Sizes; the defaults are the paper's (table 1). channels: D, without the flag. words: V, with special words.

    variance_floor: in normalised units. feed_noise: standard deviation, in normalised units, of noise on the frames fed
    back in training, so that the net learns to recover from the errors of a free run. frame_dropout: mean share of
    these frames that are zeroed, between none and twice the share in each sequence, so that the net relies on the
    context. summary: weight of the training-only loss of
    :class:`motet_train.models.motion_to_language.SummaryHead`; 0 leaves out its head.
    """

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
    feed_noise: float = 0.0
    frame_dropout: float = 0.0
    summary: float = 0.0


class LanguageToMotion(LanguageNet):
    """The net with its normalisation."""

    CONFIG = LanguageToMotionConfig

    def __init__(self, config: LanguageToMotionConfig) -> None:
        super().__init__(config.channels)
        self.config = config
        context = 2 * config.encoder_units[-1]
        shared = (config.gates, config.dropout)
        self.embedding = WordEmbedding(config.words, config.embedding, config.dropout)
        self.encoder = Encoder(LayerNormGRU, config.embedding, config.encoder_units, *shared)
        self.decoder = Decoder(LayerNormGRU, config.channels + 1, context, config.decoder_units, True, *shared)
        self.head = MixtureHead(
            sum(config.decoder_units), config.channels, config.components, config.variance_floor, config.dropout
        )
        self.summary = SummaryHead(context, config.channels) if config.summary else None

    def encode(self, words: Tensor, lengths: Tensor) -> Tensor:
        """Words (B, W) without SOS and EOS, of lengths (B,), to contexts (B, C)."""
        return self.encoder(self.embedding(words), lengths)  # type: ignore[no-any-return]

    def outputs(self, frames: Tensor, context: Tensor) -> Tensor:
        """Outputs of the decoder (B, T, S) from which each of the frames (B, T, D + 1) is predicted."""
        # each frame is predicted from the one before it; the first from a frame of ones
        inputs = torch.cat([torch.ones_like(frames[:, :1]), frames[:, :-1]], dim=1).clamp(-Z_LIMIT, Z_LIMIT)
        return self.decoder(inputs, context)  # type: ignore[no-any-return]

    def mixture(self, outputs: Tensor) -> Mixture:
        """The distributions of frames from outputs (..., S) of the decoder; dead channels stay at 0."""
        mixture: Mixture = self.head(outputs)
        living = self.scale > 0
        means = torch.where(living, mixture.means, 0.0)
        variances = torch.where(living, mixture.variances, 0.0)
        return replace(mixture, means=means, variances=variances)

    def terms(self, batch: Batch) -> tuple[Tensor, Tensor | None]:
        """The losses (N,) of all frames, and of the one after a motion's end, eq. 12 or 11; and that of the summary."""
        context = self.encode(batch.words, (batch.words != 0).sum(dim=1))
        # one frame more than the motions have, in which the flag is 0
        normal = functional.pad(normalised(batch.frames, self.mean, self.scale), (0, 0, 0, 1))
        flags = before(batch.lengths, normal.shape[1]).to(normal.dtype)
        active = before(batch.lengths + (1 if batch.ended is None else batch.ended), normal.shape[1])
        fed = self._blurred(normal) if self.training else normal
        outputs = self.outputs(torch.cat([fed, flags[..., None]], dim=-1), context)
        # padded steps are left out before the output layer, which is the largest product of all
        loss = LOSSES[self.config.loss](self.mixture(outputs[active]), normal[active], flags[active])
        return loss, self.summary_loss(batch, context)

    def _blurred(self, normal: Tensor) -> Tensor:
        """Frames (B, T, D) as they are fed back in training: with noise, and some of them zeroed."""
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
        next_state = self.decoder.step(frame.clamp(-Z_LIMIT, Z_LIMIT), context, state)
        mixture = self.mixture(next_state)
        stds = mixture.variances.sqrt()
        return mixture.log_weights, mixture.means, stds, mixture.active.sigmoid(), next_state

    def graphs(self) -> Graphs:
        """The encoder and the step, each with its contract."""
        config = self.config
        units = sum(config.decoder_units)
        words = id_rows("words", "words")
        lengths = id_rows("lengths")
        context = float_rows("context", 2 * config.encoder_units[-1])
        frame = float_rows("frame", config.channels + 1)
        state = float_rows("state", units)
        outputs = (
            float_rows("log_weights", config.components),
            float_rows("means", config.components, config.channels),
            float_rows("stds", config.components, config.channels),
            float_rows("active"),
            float_rows("next_state", units),
        )
        step = GraphSpec((frame, context, state), outputs, {"state": "next_state"})
        encoder = GraphSpec((words, lengths), (context,))
        return encoder_and_step(self, encoder, step)
