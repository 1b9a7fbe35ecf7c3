"""The recipe of the net that tells which action a sentence asks for, and its training on the sentences of a store."""

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from motet.models.language import padded
from motet.text.vocabulary import RULES, Vocabulary
from motet_train.data.batches import Rows
from motet_train.data.errors import DataError
from motet_train.data.sentences import Actions, actions_of
from motet_train.data.store import Store
from motet_train.data.word_table import word_table
from motet_train.descent import GradientLearner, Term, Terms
from motet_train.models.action_net import ActionNet, ActionsConfig, stems_of
from motet_train.recipes.language import divided, manifest
from motet_train.recipes.recipe import ADAMW, Job, Recipe
from motet_train.runs import Run

DEFAULT = Recipe(
    "actions",
    "motion-actions",
    "codes",
    ActionsConfig(0, 0, vector=64),
    ("words", "actions", "stems", "common"),
    replace(ADAMW, steps=5000, every=500, batch=128, weight_decay=0.05, falling=0.5),
)

RECIPES = {"default": DEFAULT}


@dataclass(frozen=True)
class WordVectors:
    """A file of word vectors (:func:`motet_train.data.word_table.read_word_vectors`). origin: source and licence."""

    file: Path
    origin: str | None = None


@dataclass(frozen=True, eq=False)
class SentenceBatch(Rows):
    """S sentences. words: ids (S, W) int64. lengths: (S,). asked: the actions (S,) that they ask for."""

    words: Tensor
    lengths: Tensor
    asked: Tensor


def train_actions(store: Store, job: Job, data: str = "", by: str = "trial", vectors: WordVectors | None = None) -> Run:
    """Train on the sentences of a store's training part, see :meth:`motet_train.recipes.recipe.Job.run`.

    vectors: of words, those of sentences and common ones, which the net then knows by their vectors alone.
    """
    found = divided(store, mirror=True, by=by)
    actions = spoken(store, found.parts.train)
    words = found.vocabulary.words
    table = vectors and word_table(vectors.file, words, job.recipe.config.vector)
    common = table.common if table else {}
    vocabulary = replace(found.vocabulary, common=common)
    sizes = {"words": len(words), "actions": len(actions), "common": len(common)}
    torch.manual_seed(job.about.seed)
    config = job.recipe.sized(**sizes, stems=stems_of(words, tuple(common)))
    net = ActionNet(config if table else replace(config, vector=0))
    said = Said(actions, vocabulary)
    about = manifest(job, found, asdict(net.config), data, by)
    about["actions"] = described(actions)
    if vectors and table:
        net.start_from(torch.from_numpy(table.vectors).float())
        of = {"file": vectors.file.name, "words": int(table.vectors.any(axis=1).sum())}
        about |= {"common": common}
        about["training"]["word_vectors"] = {**of, "origin": vectors.origin}

    def loss(batch: SentenceBatch) -> Terms:
        chances = net(batch.words, batch.lengths)
        return (Term(functional.nll_loss(chances.float(), batch.asked, reduction="none"), len(batch)),)

    learner = GradientLearner(
        net.to(job.device),
        job.training,
        loss,
        lambda rng: (said.draw(job.training.batch, rng),),
        lambda: said.measured(net),
    )
    return job.run(net, learner, about)


def spoken(store: Store, records: tuple[int, ...]) -> Actions:
    """The actions of some records; DataError where one has no usable sentence."""
    actions = actions_of(store, records)
    if not all(actions.sentences):
        raise DataError("each action needs a sentence that can be used: of 1 to 40 words")
    return actions


def described(actions: Actions) -> list[dict[str, Any]]:
    """A sentence of each action and the words of all its sentences, for manifests."""
    return [
        {"sentence": sentences[0], "words": sorted({word for s in sentences for word in RULES.words(s)})}
        for sentences in actions.sentences
    ]


class Said:
    """The sentences of all actions, to draw from and to measure by."""

    def __init__(self, actions: Actions, vocabulary: Vocabulary) -> None:
        self.known = [[vocabulary.encode(s)[0] for s in said] for said in actions.sentences]
        asking: dict[str, set[int]] = {}
        for action, said in enumerate(actions.unseen):
            for s in said:
                if any(map(vocabulary.meant, RULES.words(s))):
                    asking.setdefault(s, set()).add(action)
        self.unseen = padded([vocabulary.encode(s)[0] for s in asking], "int64") if asking else None
        self.alike = torch.zeros(len(asking), len(actions), dtype=torch.bool)
        for row, asked in enumerate(asking.values()):
            self.alike[row, list(asked)] = True

    def draw(self, count: int, rng: np.random.Generator) -> SentenceBatch:
        """Sentences of actions drawn at random, each as often as another."""
        asked = rng.integers(len(self.known), size=count)
        ids, lengths = padded([self.known[a][rng.integers(len(self.known[a]))] for a in asked], "int64")
        return SentenceBatch(torch.from_numpy(ids), torch.from_numpy(lengths), torch.from_numpy(asked))

    @torch.no_grad()
    def measured(self, net: ActionNet) -> dict[str, float]:
        """For sentences in wordings never seen, the surprise at the actions they were said of (validation), and how
        often the likeliest action is one of those (understood)."""
        if self.unseen is None:
            return {}
        words, lengths = (torch.from_numpy(part).to(net.mean.device) for part in self.unseen)
        chances = net(words, lengths).cpu()
        best, right = chances.argmax(dim=1), chances.masked_fill(~self.alike, -torch.inf).logsumexp(dim=1)
        understood = self.alike[torch.arange(len(best)), best].float().mean()
        return {"validation": round(-float(right.mean()), 4), "understood": round(float(understood), 4)}
