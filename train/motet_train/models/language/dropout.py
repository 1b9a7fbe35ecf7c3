"""Dropout that keeps its mask for a whole sequence: of units (variational) and of word types (Gal, Ghahramani 2016)."""

import torch
from torch import Tensor, nn
from torch.nn import functional


def mask(module: nn.Module, rate: float, like: Tensor, *shape: int) -> Tensor | None:
    """Numbers to multiply by, 0 with probability ``rate`` and else 1 / (1 - rate); None where nothing is dropped."""
    return functional.dropout(like.new_ones(shape), rate) if module.training and rate > 0 else None


class WordEmbedding(nn.Module):
    """Vectors of words, of which training drops word types: a dropped word is zero wherever its sentence has it."""

    def __init__(self, words: int, units: int, dropout: float) -> None:
        super().__init__()
        self.weight = nn.Parameter(torch.empty(words, units).uniform_(-0.05, 0.05))
        self.dropout = dropout

    def forward(self, words: Tensor) -> Tensor:
        """Ids (B, W) to vectors (B, W, E)."""
        vectors = functional.embedding(words, self.weight)
        keep = mask(self, self.dropout, vectors, words.shape[0], len(self.weight))
        return vectors if keep is None else vectors * keep.gather(1, words)[..., None]
