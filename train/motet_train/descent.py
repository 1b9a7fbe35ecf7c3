"""Learning by gradient descent: the settings, a step, and the learner of all nets that autograd can train."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn.parallel import DistributedDataParallel
from torch.optim.swa_utils import AveragedModel, get_ema_multi_avg_fn

from motet_train import distributed
from motet_train.models.net import Net
from motet_train.muon import Muon
from motet_train.runs import RunError
from motet_train.trainer import Part


@dataclass(frozen=True)
class Training:
    """How a net is trained.

    epochs or steps: how long; one of the two. every: of these from one line of the log, validation and checkpoint to
    the next. accumulate: a batch is computed in so many parts, whose gradients are added up: that takes less memory and
    gives the same step, but for what rows of a batch have in common: terms beside the loss, as of describe's summary,
    weigh as much in each part as in the whole. warm_up: over this many the learning rate rises, by equal steps, to the
    whole; falling: the share, at the end, over which it falls linearly to zero; cosine: it falls to a hundredth along
    half a cosine; decay: a factor for every so many.
    l2: the weight of the squared weights, not biases, in the loss. weight_decay: of "adamw" and "muon", apart from
    the loss. clip: the greatest norm of the gradient. adversary: the weight of a discriminator's opinion in the loss.
    average: of the running mean of weights, which is then what is kept. keep: the weights of the "best" validation or
    the "last". patience: training ends when so many validations in a row brought nothing better. precision: of the
    products of matrices in training; what is trained is float32.
    """

    epochs: int = 0
    steps: int = 0
    every: int = 1
    batch: int = 16
    accumulate: int = 1
    optimiser: Literal["adam", "adamw", "muon", "nadam", "sgd"] = "adam"
    learning_rate: float = 1e-3
    warm_up: int = 0
    falling: float = 0.0
    cosine: bool = False
    decay: tuple[float, int] | None = None
    l2: float = 0.0
    weight_decay: float = 0.0
    clip: float | None = None
    adversary: float = 0.0
    average: float = 0.0
    keep: Literal["best", "last"] = "best"
    patience: int | None = None
    precision: Literal["float32", "bfloat16"] = "float32"

    @property
    def unit(self) -> Literal["epoch", "step"]:
        """What the length is counted in."""
        return "epoch" if self.epochs else "step"

    @property
    def length(self) -> int:
        """Of the whole training."""
        return self.epochs or self.steps


def rate(training: Training, done: int) -> float:
    """The learning rate of the epoch or step that begins after ``done`` of them."""
    factor = min(1.0, (done + 1) / training.warm_up) if training.warm_up else 1.0
    if training.falling:
        factor *= min(1.0, (training.length - done) / (training.falling * training.length))
    if training.cosine:
        factor *= 0.01 + 0.99 * 0.5 * (1 + math.cos(math.pi * done / training.length))
    if training.decay is not None:
        factor *= training.decay[0] ** (done // training.decay[1])
    return training.learning_rate * factor


OPTIMISERS: Mapping[str, Callable[..., torch.optim.Optimizer | Muon]] = {
    "adam": torch.optim.Adam,
    "adamw": partial(torch.optim.AdamW, betas=(0.9, 0.98)),
    "muon": Muon,
    "nadam": torch.optim.NAdam,
    "sgd": torch.optim.SGD,
}


class Term(NamedTuple):
    """Losses of any shape, whose mean is made small, and how many things that is the mean of."""

    losses: Tensor
    things: int


Terms = tuple[Term, ...]
"""The losses of a batch, and means that are added to each of them."""


class Batch(Protocol):
    """Rows to train on; a tensor is one."""

    def to(self, device: Any, /) -> Any:
        """The same on a device."""

    def __len__(self) -> int: ...

    def __getitem__(self, rows: slice, /) -> Any: ...


class _Called(nn.Module):
    """A net with its loss as what it computes, which is what several processes have to agree on."""

    def __init__(self, net: nn.Module, loss: Callable[[Any], Terms]) -> None:
        super().__init__()
        self.net, self.loss = net, loss

    def forward(self, batch: Any) -> Terms:
        return self.loss(batch)


class Descent:
    """Steps of gradient descent of one net on one loss."""

    def __init__(self, net: nn.Module, loss: Callable[[Any], Terms], training: Training) -> None:
        self.net, self.training = net, training
        # added to the loss, l2 times the squared weights is a decay of twice as much
        decay = training.weight_decay if training.optimiser in ("adamw", "muon") else 2 * training.l2
        trained = [parameter for parameter in net.parameters() if parameter.requires_grad]
        matrices = set(net.matrices()) if isinstance(net, Net) and training.optimiser == "muon" else set()
        groups = [
            {"params": [one for one in trained if one in matrices], "weight_decay": decay, "muon": True},
            {"params": [one for one in trained if one.ndim > 1 and one not in matrices], "weight_decay": decay},
            {"params": [one for one in trained if one.ndim <= 1], "weight_decay": 0.0},
        ]
        made = OPTIMISERS[training.optimiser]
        self.optimiser = made([group for group in groups if group["params"]], lr=training.learning_rate)
        self._called: nn.Module = _Called(net, loss)
        if distributed.count() > 1:
            self._called = DistributedDataParallel(self._called)

    def step(self, parts: Sequence[tuple[Any, bool]], clip: float | None = None) -> tuple[float, float]:
        """One step on this process' rows of a batch, in parts whose gradients are added up; its share of the mean loss,
        and how many things that is of.

        Of each part it is said whether its rows are real, or there only because a process needs some. One part is in
        memory at a time.
        """
        self.optimiser.zero_grad(set_to_none=True)
        losses, counts = list[float](), list[float]()
        for number, (rows, real) in enumerate(parts, start=1):
            with nullcontext() if number == len(parts) else self._apart():
                loss, things = self._share(rows, real)
                counts.append(things)
                torch.autograd.backward(loss * (things / counts[0] * distributed.count()))
            losses.append(loss.item())
        if len(parts) > 1:
            for parameter in self.net.parameters():
                if parameter.grad is not None:
                    parameter.grad *= counts[0] / sum(counts)
        if clip is not None:
            nn.utils.clip_grad_norm_(self.net.parameters(), clip)
        self.optimiser.step()
        return float(np.average(losses, weights=counts)), sum(counts)

    def _share(self, rows: Any, real: bool) -> tuple[Tensor, float]:
        """This process' share of the mean loss of a part, and how many things that is of.

        Of several processes each weighs what it has so that their mean is the loss of the whole part.
        """
        device = next(self.net.parameters()).device
        with torch.autocast(device.type, torch.bfloat16, enabled=self.training.precision == "bfloat16"):
            terms: Terms = self._called(rows.to(device))
        counts = distributed.summed([term.things * real for term in terms], device)
        shares = [term.things * real / count for term, count in zip(terms, counts, strict=True)]
        losses = terms[0].losses
        for term, share in zip(terms[1:], shares[1:], strict=True):
            losses = losses + term.losses * (share / shares[0] if real else 0.0)
        loss = losses.mean() * shares[0]
        if not torch.isfinite(loss):
            raise RunError("the loss is no longer finite: start again with a lower learning rate or another seed")
        return loss, counts[0]

    def _apart(self) -> AbstractContextManager[None]:
        """Processes do not tell each other the gradients of what is computed in this."""
        several = isinstance(self._called, DistributedDataParallel)
        return self._called.no_sync() if several else nullcontext()  # type: ignore[operator]


class GradientLearner:
    """A net that learns by gradient descent, see :class:`motet_train.trainer.Learner`.

    loss: of some rows. batches: those of an epoch, or the one of a step. validate: of the net that is kept. told: told
    before each step which share of the training is done. others: what else has a state.
    """

    target = -math.inf

    def __init__(
        self,
        net: nn.Module,
        training: Training,
        loss: Callable[[Any], Terms],
        batches: Callable[[np.random.Generator], Iterable[Batch]],
        validate: Callable[[], Mapping[str, Any]] = dict,
        told: Callable[[float], object] = lambda share: None,
        others: Mapping[str, Part] = MappingProxyType({}),
    ) -> None:
        if training.batch < distributed.count():
            raise RunError(f"{distributed.count()} processes need batches of at least as many: use a larger --batch")
        self.training, self.net, self.batches = training, net, batches
        self.validate, self.told = validate, told
        self.descent = Descent(net, loss, training)
        self.parts: dict[str, Part] = {"net": net, "optimiser": self.descent.optimiser, **others}
        self.kept, self.average = net, None
        if training.average:
            self.average = self.parts["average"] = AveragedModel(
                net,
                multi_avg_fn=get_ema_multi_avg_fn(training.average),  # type: ignore[no-untyped-call]
            )
            self.kept = self.average.module
        self.unit, self.keep, self.patience = training.unit, training.keep, training.patience
        self.ends = [*range(training.every, training.length, training.every), training.length]
        self.first = 1 if training.epochs else 0

    def chunk(self, start: int, stop: int, rng: np.random.Generator) -> Iterator[tuple[int, float, float]]:
        """Train from one epoch or step to another."""
        self.net.train()
        for done in range(start, stop):
            for group in self.descent.optimiser.param_groups:
                group["lr"] = rate(self.training, done)
            self.told(done / self.training.length)
            for batch in self.batches(rng):
                loss, weight = self.descent.step(list(self._parts(batch)), self.training.clip)
                if self.average is not None:
                    self.average.update_parameters(self.net)
                yield done + 1, loss, weight
        self.net.eval()

    def _parts(self, batch: Batch) -> Iterator[tuple[Any, bool]]:
        """This process' rows of each part of a batch, and whether there are any; otherwise one of another's."""
        count = min(self.training.accumulate, len(batch))
        for part in range(count):
            rows = batch[part::count]
            mine = rows[distributed.rank() :: distributed.count()]
            yield (mine, True) if len(mine) else (rows[:1], False)
