"""Search: motions and sentences as unit vectors of one space, in which matching ones are near."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, ClassVar

from motet.bundle.graph import Arrays, Floats, Graph
from motet.bundle.manifest import Manifest
from motet.models.language import MAX_SECONDS, LanguageModel
from motet.motion.motion import Motion
from motet.settings import Range, Settings


@dataclass(frozen=True)
class IndexSettings(Settings):
    """window: longest motion for one vector; longer ones are cut, so that a hit has a time."""

    FEATURE: ClassVar[str] = "index"
    window: Annotated[float, Range(0.5, MAX_SECONDS, "s")] = 10.0


class SearchModel(LanguageModel):
    """A model that embeds motions and sentences in one space; their similarity is the product of their vectors.

    graphs: "motion" (frames, lengths -> vector) and "text" (words, lengths -> vector).
    Its loop takes scores (Q, N) and the number of best ones wanted, and returns their columns.
    """

    VERB = "search"
    SETTINGS = (IndexSettings,)
    LOOPS = ("nearest",)
    ROLES = ("motion", "text")

    def __init__(self, manifest: Manifest, graphs: Mapping[str, Graph], tables: Arrays | None = None) -> None:
        super().__init__(manifest, graphs, tables)
        vector = {"vector": "batch E"}
        self.bind("motion", {"frames": "batch time D", "lengths": "*batch"}, vector)
        self.bind("text", {"words": "*batch words", "lengths": "*batch"}, vector)

    def embed(self, motions: Motion | Sequence[Motion]) -> Floats:
        """The unit vector (E,) float32 of a motion, or vectors (N, E) of several; MotionError like :meth:`frames`."""
        if isinstance(motions, Motion):
            vector: Floats = self.embed([motions])[0]
            return vector
        return self.contexts([self.frames(motion) for motion in motions], "motion")

    def embed_text(self, sentences: str | Sequence[str]) -> Floats:
        """The unit vector (E,) float32 of a sentence, or vectors (N, E) of several; errors like :meth:`ids`."""
        if isinstance(sentences, str):
            vector: Floats = self.embed_text([sentences])[0]
            return vector
        return self.contexts([self.ids(text) for text in sentences], "text")

    @cached_property
    def identity(self) -> str:
        """A unique identity of this model: its name, its version and a hash of its manifest."""
        text = json.dumps(self.manifest.source, sort_keys=True).encode()
        return f"{self.manifest.name} {self.manifest.version} {hashlib.sha256(text).hexdigest()[:16]}"

    def replay(self, given: Arrays, settings: Mapping[str, Any]) -> Arrays:
        """Frames (T, D) and a sentence ("text" of the settings) to ids (words,) int64 and the vectors (E,) of both."""
        ids, _ = self.vocabulary.encode(str(settings["text"]))
        motion, text = self.contexts([given["frames"]], "motion"), self.contexts([ids], "text")
        return {"ids": ids, "motion": motion[0], "text": text[0]}
