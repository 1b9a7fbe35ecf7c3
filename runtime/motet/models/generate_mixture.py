"""Motions drawn frame by frame from mixtures of Gaussians. Section 4.3 of Plappert et al. 2017."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from motet.bundle.graph import Arrays, Floats, Graph
from motet.bundle.manifest import Manifest
from motet.decode.noise import Noise
from motet.decode.sample import Sample
from motet.decode.score import score_frames
from motet.models.generate import GenerateModel
from motet.motion.motion import Motion


class MixtureModel(GenerateModel):
    """A model whose step outputs a mixture, or frames.

    graphs: "encoder" (words, lengths -> context), "step" (frame, context, states -> log_weights, means, stds,
        active, next states), with frames normalised and the active flag last.
    Its loops (:mod:`motet.decode.loops`) take the step, contexts (B, C), a generator of noise for each row, the largest
    number of frames and their settings by name, and return samples for each row, best first.
    """

    LOOPS = ("mixture",)

    def __init__(self, manifest: Manifest, graphs: Mapping[str, Graph], tables: Arrays | None = None) -> None:
        super().__init__(manifest, graphs, tables)
        self.sizes["F"] = self.sizes["D"] + 1  # with the active flag
        self.bind("encoder", {"words": "*batch words", "lengths": "*batch"}, {"context": "batch C"})
        self.bind("step", self.loop.inputs, self.loop.outputs)

    def decode(self, contexts: Floats, noise: Sequence[Noise], settings: Mapping[str, Any]) -> list[list[Sample]]:
        """See :meth:`GenerateModel.decode`."""
        rest = {name: value for name, value in settings.items() if name != "max_seconds"}
        frames = max(1, round(settings["max_seconds"] * self.fps))
        found: list[list[Sample]] = self.loop.run(self.graphs["step"], contexts, noise, frames, **rest)
        return [[one._replace(frames=self.contract.denormalised(one.frames)) for one in row] for row in found]

    def score(self, sentence: str, motion: Motion) -> float:
        """See :meth:`GenerateModel.score`."""
        normal = self.contract.normalised(self.frames(motion)).astype(np.float32)
        return score_frames(self.graphs["step"], self.embed(sentence), normal)
