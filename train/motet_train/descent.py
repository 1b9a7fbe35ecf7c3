"""Gradient descent: its settings, a single step, and the learner of all nets that autograd trains."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Generic, Literal, NamedTuple, Protocol, TypeVar, cast

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn.parallel import DistributedDataParallel
from torch.optim.swa_utils import AveragedModel, get_ema_multi_avg_fn

from motet.bundle.fields import Json
from motet_train import distributed
from motet_train.models.net import Net
from motet_train.muon import Muon
from motet_train.runs import RunError
from motet_train.trainer import Part


@dataclass(frozen=True)
class Training:
    """Settings of gradient descent.

    epochs or steps: the length; one of the two. every: number of these between two log lines, validations and
    checkpoints. accumulate: compute a batch in this many parts and add up their gradients, which takes less memory and
    gives the same step; only terms beside the loss, such as describe's summary, weigh as much in each part as in the
    whole. warm_up: number over which the learning rate rises in equal steps. falling: final share of the training over
    which it falls linearly to zero. cosine: it falls to a hundredth along half a cosine. decay: a factor, and after how
    many it is applied again.
    l2: weight in the loss of the squared weights, without biases. weight_decay: of "adamw" and "muon", apart from the
    loss. clip: largest norm of the gradient. adversary: weight of a discriminator in the loss. average: decay of a
    running mean of the weights, which is then what is kept. keep: the weights of the "best" validation or the "last".
    patience: early stopping after this many validations without improvement. precision: of matrix products in
    training; parameters are float32.
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
        """The unit of the length."""
        return "epoch" if self.epochs else "step"

    @property
    def length(self) -> int:
        """The number of epochs or steps of the training."""
        return self.epochs or self.steps


def rate(training: Training, done: int) -> float:
    """The learning rate of the epoch or step after ``done`` of them."""
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
    """Losses of any shape, whose mean is minimised, and the number of things of which it is the mean."""

    losses: Tensor
    things: int


Terms = tuple[Term, ...]
"""The losses of a batch, followed by terms whose means are added to each of them."""


class Batch(Protocol):
    """Rows to train on; a tensor is a batch."""

    def to(self, device: Any, /) -> Any:
        """The same batch on a device."""

    def __len__(self) -> int: ...

    def __getitem__(self, rows: slice, /) -> Any: ...


class _Called(nn.Module):
    """A net whose forward computes the loss, so that DistributedDataParallel can average its gradients."""

    def __init__(self, net: nn.Module, loss: Callable[[Any], Terms]) -> None:
        super().__init__()
        self.net = net
        self.loss = loss

    def forward(self, batch: Any) -> Terms:
        return self.loss(batch)


class Descent:
    """Steps of gradient descent of one net on one loss."""

    def __init__(self, net: nn.Module, loss: Callable[[Any], Terms], training: Training) -> None:
        self.net = net
        self.training = training
        make_optimiser = OPTIMISERS[training.optimiser]
        self.optimiser = make_optimiser(_parameter_groups(net, training), lr=training.learning_rate)
        self._called: nn.Module = _Called(net, loss)
        if distributed.count() > 1:
            self._called = DistributedDataParallel(self._called)

    def step(self, parts: Sequence[tuple[Any, bool]], clip: float | None = None) -> tuple[float, float]:
        """One step on this process' rows of a batch, in parts whose gradients are added up.

        Each part comes with a flag: False for rows that only fill up a process without any of its own. One part is in
        memory at a time. Returns this process' share of the mean loss, and the number of things that it is of.
        """
        self.optimiser.zero_grad(set_to_none=True)
        losses = list[float]()
        counts = list[float]()
        for number, (rows, real) in enumerate(parts, start=1):
            # processes exchange gradients once, after the last part
            with nullcontext() if number == len(parts) else self._without_exchange():
                loss, things = self._share(rows, real)
                counts.append(things)
                torch.autograd.backward(loss * (things / counts[0] * distributed.count()))
            losses.append(loss.item())
        if len(parts) > 1:
            # the sum over parts, in units of the first, becomes a mean
            self._scale_gradients(counts[0] / sum(counts))
        if clip is not None:
            nn.utils.clip_grad_norm_(self.net.parameters(), clip)
        self.optimiser.step()
        return float(np.average(losses, weights=counts)), sum(counts)

    def _scale_gradients(self, factor: float) -> None:
        for parameter in self.net.parameters():
            if parameter.grad is not None:
                parameter.grad *= factor

    def _share(self, rows: Any, real: bool) -> tuple[Tensor, float]:
        """This process' share of the mean loss of a part, and the number of things that it is of.

        Shares are weighted so that their sum over all processes is the loss of the whole part.
        """
        device = next(self.net.parameters()).device
        with torch.autocast(device.type, torch.bfloat16, enabled=self.training.precision == "bfloat16"):
            terms: Terms = self._called(rows.to(device))
        # the weight of this process in each term
        counts = distributed.summed([term.things * real for term in terms], device)
        shares = [term.things * real / count for term, count in zip(terms, counts, strict=True)]
        # the other terms are added in units of the first one's share
        losses = terms[0].losses
        for term, share in zip(terms[1:], shares[1:], strict=True):
            losses = losses + term.losses * (share / shares[0] if real else 0.0)
        loss = losses.mean() * shares[0]
        if not torch.isfinite(loss):
            raise RunError("the loss is no longer finite: start again with a lower learning rate or another seed")
        return loss, counts[0]

    def _without_exchange(self) -> AbstractContextManager[None]:
        """A context in which gradients are not exchanged between processes."""
        several = isinstance(self._called, DistributedDataParallel)
        return self._called.no_sync() if several else nullcontext()  # type: ignore[operator]


def _parameter_groups(net: nn.Module, training: Training) -> list[dict[str, Any]]:
    """The trained parameters of a net: those for Muon, other matrices, and vectors, which do not decay."""
    # added to the loss, l2 times the squared weights is a decay of twice as much
    decay = training.weight_decay if training.optimiser in ("adamw", "muon") else 2 * training.l2
    for_muon = set(net.matrices()) if isinstance(net, Net) and training.optimiser == "muon" else set()
    muon = []
    matrices = []
    vectors = []
    for parameter in net.parameters():
        if not parameter.requires_grad:
            continue
        if parameter in for_muon:
            muon.append(parameter)
        elif parameter.ndim > 1:
            matrices.append(parameter)
        else:
            vectors.append(parameter)
    groups = [
        {"params": muon, "weight_decay": decay, "muon": True},
        {"params": matrices, "weight_decay": decay},
        {"params": vectors, "weight_decay": 0.0},
    ]
    return [group for group in groups if group["params"]]


Trained = TypeVar("Trained", bound=nn.Module)


@dataclass(eq=False)
class GradientLearner(Generic[Trained]):
    """A net that learns by gradient descent, see :class:`motet_train.trainer.Learner`.

    loss: of some rows. batches: those of an epoch, or the batch of a step. validate: of the net that is kept. on_share:
    called before each step with the share of the training that is done. others: further parts with a state.
    """

    net: Trained
    training: Training
    loss: Callable[[Any], Terms]
    batches: Callable[[np.random.Generator], Iterable[Batch]]
    validate: Callable[[], Json] = dict
    on_share: Callable[[float], object] = lambda share: None
    others: Mapping[str, Part] = field(default_factory=dict)

    target = -math.inf

    def __post_init__(self) -> None:
        net = self.net
        training = self.training
        if training.batch < distributed.count():
            raise RunError(f"{distributed.count()} processes need batches of at least as many: use a larger --batch")
        self.descent = Descent(net, self.loss, training)
        self.parts: dict[str, Part] = {"net": net, "optimiser": self.descent.optimiser, **self.others}
        self.kept = net
        self.average = None
        if training.average:
            multi_avg_fn = get_ema_multi_avg_fn(training.average)  # type: ignore[no-untyped-call]
            self.average = self.parts["average"] = AveragedModel(net, multi_avg_fn=multi_avg_fn)
            self.kept = cast(Trained, self.average.module)
        self.unit = training.unit
        self.keep = training.keep
        self.patience = training.patience
        self.ends = [*range(training.every, training.length, training.every), training.length]
        self.first = 1 if training.epochs else 0

    def chunk(self, start: int, stop: int, rng: np.random.Generator) -> Iterator[tuple[int, float, float]]:
        """Train from one epoch or step to another."""
        self.net.train()
        for done in range(start, stop):
            # the learning rate of this epoch or step
            for group in self.descent.optimiser.param_groups:
                group["lr"] = rate(self.training, done)
            self.on_share(done / self.training.length)
            for batch in self.batches(rng):
                loss, weight = self.descent.step(list(self._parts(batch)), self.training.clip)
                if self.average is not None:
                    self.average.update_parameters(self.net)
                yield done + 1, loss, weight
        self.net.eval()

    def _parts(self, batch: Batch) -> Iterator[tuple[Any, bool]]:
        """This process' rows of each part of a batch, or False with a row of another process if it has none."""
        count = min(self.training.accumulate, len(batch))
        for part in range(count):
            rows = batch[part::count]
            mine = rows[distributed.rank() :: distributed.count()]
            yield (mine, True) if len(mine) else (rows[:1], False)
