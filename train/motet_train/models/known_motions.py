"""Known motions as the bundle has them: a space, the motions in it, what they show, and a net that writes sentences.

Nothing here is trained: the nets come from runs of their own.
"""

from dataclasses import dataclass

import torch

from motet.models.nearest_neighbour import Known
from motet_train.models.joint_embedding import JointEmbedding, JointEmbeddingConfig
from motet_train.models.motion_to_language import MotionToLanguage, MotionToLanguageConfig
from motet_train.models.net import Graphs, Net, Tables


@dataclass(frozen=True)
class KnownMotionsConfig:
    """The nets, and how many there are of what is known. letters: bytes of all sentences. E is that of the space."""

    writer: MotionToLanguageConfig
    space: JointEmbeddingConfig
    motions: int
    views: int
    actions: int
    kinds: int
    sentences: int
    letters: int


class KnownMotions(Net):
    """Both nets, and tables as :class:`motet.models.nearest_neighbour.Known` has them."""

    CONFIG = KnownMotionsConfig

    def __init__(self, config: KnownMotionsConfig) -> None:
        super().__init__(config.writer.channels)
        self.config = config
        self.writer = MotionToLanguage(config.writer)
        self.space = JointEmbedding(config.space)
        # what is known, by its shapes
        shapes: dict[str, tuple[tuple[int, ...], torch.dtype]] = {
            "vectors": ((config.motions, config.views, config.space.vector), torch.int8),
            "actions": ((config.motions,), torch.int16),
            "shown": ((config.actions, config.kinds), torch.uint8),
            "sentences": ((config.letters,), torch.uint8),
            "said": ((config.sentences,), torch.int16),
            "names": ((config.sentences, config.kinds), torch.uint8),
            "ways": ((config.sentences, 3), torch.int16),
        }
        self.known_tables = tuple(shapes)
        for name, (shape, dtype) in shapes.items():
            self.register_buffer(f"known_{name}", torch.zeros(shape, dtype=dtype))

    @staticmethod
    def of(writer: MotionToLanguage, space: JointEmbedding, known: Known) -> "KnownMotions":
        """The net of two trained ones and what is known."""
        # as many places as there are motions, sentences and letters
        letters = torch.frombuffer(bytearray("\n".join(known.sentences).encode()), dtype=torch.uint8)
        motions, views, _ = known.vectors.shape
        counts = (motions, views, *known.shown.shape, len(known.sentences), len(letters))
        net = KnownMotions(KnownMotionsConfig(writer.config, space.config, *counts))
        net.writer = writer
        net.space = space
        net.mean = writer.mean.clone()
        net.scale = writer.scale.clone()
        # fill them
        for name in net.known_tables:
            field = "sentence_actions" if name == "said" else name
            table = letters if name == "sentences" else torch.from_numpy(getattr(known, field))
            getattr(net, f"known_{name}").copy_(table)
        return net

    def graphs(self) -> Graphs:
        """Those of the net that writes sentences, and the space's encoder of motions."""
        return {**self.writer.graphs(), "space": self.space.graphs()["motion"]}

    def tables(self) -> Tables:
        """What is known."""
        return {f"known_{name}": getattr(self, f"known_{name}").numpy() for name in self.known_tables}
