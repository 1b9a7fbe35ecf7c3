"""The learner of nets whose layers learn by contrastive divergence, one after the other."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import accumulate
from typing import Any, Literal

import numpy as np
import torch
from torch import nn

from motet_train import distributed
from motet_train.papers.tdbn.contrastive import Layer, Stage
from motet_train.runs import RunError
from motet_train.trainer import Part

EPOCHS_A_CHUNK = 200
"""Epochs from one checkpoint to the next, within a stage."""

MORE_GOALS = 1000
"""More goals than exist."""


class DivergenceLearner:
    """A net that is trained in stages, see :class:`motet_train.trainer.Learner`.

    Each whole net is a candidate: the loss of contrastive divergence does not say how a figure moves. Kept is the
    first that misses no goal, which ends training, else the one that misses the fewest.
    missed: the goals that the net misses; it may stop counting at the number given, as more is no improvement. None
    where there is nothing to choose. others: what else has a state.
    """

    unit: Literal["epoch", "step"] = "epoch"
    keep: Literal["best", "last"] = "best"
    patience: int | None = None
    first, target = 0, 0.0

    def __init__(
        self,
        net: nn.Module,
        stages: Sequence[Stage],
        generator: torch.Generator,
        missed: Callable[[int], list[str]] | None,
        others: Mapping[str, Part],
    ) -> None:
        if distributed.count() > 1:
            raise RunError("contrastive divergence trains in one process, without torchrun")
        self.kept: nn.Module = net
        self.stages, self.generator, self.missed = stages, generator, missed
        self.bounds = list(accumulate((stage.epochs for stage in stages), initial=0))
        spans = zip(self.bounds, self.bounds[1:], strict=False)
        self.ends = [end for span in spans for end in (*range(*span, EPOCHS_A_CHUNK)[1:], span[1])]
        self.parts: dict[str, Part] = {"net": net, **others, "learning": self}
        self.layer: Layer | None = None
        self.done, self.fewest = 0, MORE_GOALS

    def chunk(self, start: int, stop: int, rng: np.random.Generator) -> Iterator[tuple[int, float, float]]:
        """Train from one epoch to another of the same stage; all random numbers are the generator's."""
        number = self._stage(start)
        if start == self.bounds[number]:
            self.stages[number].begin()
            self.layer = self.stages[number].layer()
        assert self.layer is not None
        for self.done in range(start + 1, stop + 1):
            yield self.done, self.layer.epoch(self.done - 1 - self.bounds[number]), 1.0

    def validate(self) -> Mapping[str, Any]:
        """The goals that a whole net misses."""
        if self.missed is None or self.done not in self.bounds or not self.stages[self._stage(self.done - 1)].whole:
            return {}
        found = self.missed(self.fewest)
        self.fewest = min(self.fewest, len(found))
        return {"validation": len(found), "missed": found}

    def _stage(self, done: int) -> int:
        return next(n for n, stop in enumerate(self.bounds[1:]) if done < stop)

    def state_dict(self) -> dict[str, Any]:
        """Where learning is: the epochs done, the velocities of the layer, the generator."""
        assert self.layer is not None
        velocities = {name: ascent.velocity for name, ascent in self.layer.ascents.items()}
        generator = self.generator.get_state()
        return {"done": self.done, "fewest": self.fewest, "velocities": velocities, "generator": generator}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Go on there; the net has its weights."""
        self.done, self.fewest = state["done"], state["fewest"]
        self.layer = self.stages[self._stage(self.done - 1)].layer()
        for name, ascent in self.layer.ascents.items():
            ascent.velocity.copy_(state["velocities"][name])
        self.generator.set_state(state["generator"])
