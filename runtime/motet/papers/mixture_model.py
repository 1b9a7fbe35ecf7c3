"""Generate frame by frame from a mixture of Gaussians (section 4.3 of Plappert et al. 2017)."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from motet.bundle.graph import Arrays, Floats, Graph
from motet.bundle.manifest import Manifest
from motet.decode.loop import Noise, Sample
from motet.generate.base import GenerateModel
from motet.motion.motion import Motion
from motet.papers.mixture import LOOPS, score_frames


class MixtureModel(GenerateModel):
    """A model whose step outputs a mixture, or frames: normalised, with the active flag last.

    Its loop (:mod:`motet.papers.mixture`) takes the step, contexts (B, C), a generator of noise for each row, the
    largest number of frames and its settings by name, and returns samples for each row, best first.
    """

    LOOPS = LOOPS

    def __init__(self, manifest: Manifest, graphs: Mapping[str, Graph], tables: Arrays | None = None) -> None:
        super().__init__(manifest, graphs, tables)
        self.sizes["F"] = self.sizes["D"] + 1  # with the active flag
        self.bind("encoder", {"words": "*batch words", "lengths": "*batch"}, {"context": "batch C"})
        self.bind("step", self.loop.inputs, self.loop.outputs)

    def decode(self, contexts: Floats, noise: Sequence[Noise], settings: Mapping[str, Any]) -> list[list[Sample]]:
        """See :meth:`GenerateModel.decode`."""
        rest = {name: value for name, value in settings.items() if name != "max_seconds"}
        frames = max(1, round(settings["max_seconds"] * self.fps))
        samples: list[list[Sample]] = self.loop.run(self.graphs["step"], contexts, noise, frames, **rest)
        denormalised = []
        for row in samples:
            denormalised.append([sample._replace(frames=self.contract.denormalised(sample.frames)) for sample in row])
        return denormalised

    def score(self, sentence: str, motion: Motion) -> float:
        """See :meth:`GenerateModel.score`."""
        normal = self.contract.normalised(self.frames(motion)).astype(np.float32)
        return score_frames(self.graphs["step"], self.embed(sentence), normal)
