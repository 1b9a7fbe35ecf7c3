"""The action in a sentence: a small net over words and their stems.

Letters in shapes: B rows, W words, A actions, E numbers of a word's vector.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional

from motet.bundle.graph import GraphSpec
from motet.text.vocabulary import SPECIALS, UNK
from motet_train.models.net import Graphs, Net, before, constants, float_rows, gelu, id_rows

UNKNOWN = SPECIALS.index(UNK)
"""The id of unknown words."""


@dataclass(frozen=True)
class ActionsConfig:
    """Sizes. words: of the sentences. stems: for each word the index of its stem. common: further words, known by
    their vectors alone; the last of ``stems`` are theirs. vector: numbers of each word's vector, 0 for none. unheard:
    share of words that training knows by their vectors alone, too.
    """

    words: int
    actions: int
    stems: tuple[int, ...] = ()
    embedding: int = 96
    hidden: int = 128
    dropout: float = 0.5
    word_dropout: float = 0.3
    common: int = 0
    vector: int = 0
    unheard: float = 0.15


class ActionNet(Net):
    """Words to the probabilities of actions: vectors of words and stems, convolved over three words, mean and most."""

    CONFIG = ActionsConfig
    stems: Tensor
    vectors: Tensor

    def __init__(self, config: ActionsConfig) -> None:
        super().__init__(0)  # it takes words, no channels
        self.config = config
        constants(self, stems=torch.tensor(config.stems))
        self.words = nn.Embedding(config.words, config.embedding)
        self.roots = nn.Embedding(max(config.stems) + 1, config.embedding)
        self.meant = nn.Linear(config.vector, config.embedding, bias=False) if config.vector else None
        table = torch.zeros(config.words + config.common, config.vector, dtype=torch.int8)
        self.register_buffer("vectors", None if self.meant is None else table)
        self.around = nn.Conv1d(config.embedding, config.hidden, 3, padding=1)
        self.outward = nn.Linear(2 * config.hidden + config.embedding, config.actions)
        self.dropout = nn.Dropout(config.dropout)

    @torch.no_grad()
    def start_from(self, vectors: Tensor) -> None:
        """Take vectors (words, V) of deviation 1, in sixteenths, of words and common words, 0 for none; words and stems
        say little beside them at first."""
        assert self.meant is not None
        self.vectors.copy_((16 * vectors).round().clamp(-127, 127))
        nn.init.orthogonal_(self.meant.weight)
        self.words.weight.zero_()
        self.roots.weight.mul_(0.3)

    def _of(self, words: Tensor) -> Tensor:
        """Vectors (B, W, E) of words (B, W)."""
        ids = words.masked_fill(words >= self.config.words, UNKNOWN)
        stems = self.stems[words]
        if self.training and self.meant is not None:
            # these words are known by their vectors alone
            unheard = torch.rand(words.shape, device=words.device) < self.config.unheard
            ids = ids.masked_fill(unheard, UNKNOWN)
            stems = stems.masked_fill(unheard, int(self.stems[UNKNOWN]))
        vectors: Tensor = self.words(ids) + self.roots(stems)
        return vectors if self.meant is None else vectors + self.meant(self.vectors[words].float() / 16)

    def forward(self, words: Tensor, lengths: Tensor) -> Tensor:
        """Ids (B, W) int64 of sentences of lengths (B,) int64 to log-probabilities (B, A)."""
        known = before(lengths, words.shape[1]).to(torch.float32)
        if self.training:
            dropped = torch.rand(words.shape, device=words.device) < self.config.word_dropout
            words = words.masked_fill(dropped, UNKNOWN)
        vectors = self.dropout(self._of(words)) * known[..., None]
        around = gelu(self.around(vectors.transpose(1, 2))) * known[:, None]
        count = known.sum(dim=1, keepdim=True).clamp_min(1)
        most = around.amax(dim=2).clamp_min(0)  # as if an empty word followed, so that padding changes nothing
        seen = [around.sum(dim=2) / count, most, vectors.sum(dim=1) / count]
        return functional.log_softmax(self.outward(self.dropout(torch.cat(seen, dim=1))), dim=1)

    def encoder(self) -> tuple[nn.Module, GraphSpec]:
        """Itself as a graph, the encoder of sentences."""
        words = id_rows("words", "words")
        lengths = id_rows("lengths")
        return self, GraphSpec((words, lengths), (float_rows("context", self.config.actions),))

    def graphs(self) -> Graphs:
        """None: it is a part of the model that writes codes."""
        return {}


def stem(word: str) -> str:
    """A word without its ending, and one of two equal letters left at the end: "running" and "runs" are "run"."""
    for ending in ("ingly", "edly", "ing", "ers", "ed", "es", "er", "ly", "s", "e"):
        if word.endswith(ending) and len(word) - len(ending) >= 3:
            word = word[: -len(ending)]
            break
    return word[:-1] if len(word) > 3 and word[-1] == word[-2] else word


def stems_of(words: Sequence[str], common: Sequence[str] = ()) -> tuple[int, ...]:
    """For each word the number of its stem; for common words with a new stem that of unknown words."""
    numbers: dict[str, int] = {}
    stems = [numbers.setdefault(stem(word), len(numbers)) for word in words]
    return (*stems, *(numbers.get(stem(word), stems[UNKNOWN]) for word in common))
