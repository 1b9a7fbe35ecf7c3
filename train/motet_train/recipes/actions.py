"""The recipe of the net that recognises the action in a sentence, and its training on the sentences of a store."""

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from motet.text.vocabulary import NEW_MODEL_RULES, Vocabulary
from motet_train.data.batches import Ids, Rows, padded_tensors
from motet_train.data.errors import DataError
from motet_train.data.sentences import Actions, actions_of
from motet_train.data.store import Store
from motet_train.data.word_table import WordTable, word_table
from motet_train.descent import GradientLearner, Term, Terms
from motet_train.evaluate.tables import Figures
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
    """S sentences. words: ids (S, W) int64. lengths: (S,). actions: (S,) the action of each."""

    words: Tensor
    lengths: Tensor
    actions: Tensor


def train_actions(store: Store, job: Job, data: str, by: str, vectors: WordVectors | None) -> Run:
    """Train on the sentences of a store's training part, see :meth:`motet_train.recipes.recipe.Job.run`.

    vectors: of the words of sentences and of common words, which the net then knows by their vectors alone.
    """
    corpus = divided(store, mirror=True, by=by)
    actions = spoken(store, corpus.parts.train)
    words = corpus.vocabulary.words
    table = word_table(vectors.file, words, job.recipe.config.vector) if vectors else None
    common = table.common if table else {}

    # the net, with the vectors of words if there are any
    torch.manual_seed(job.about.seed)
    net = _untrained(job.recipe, words, len(actions), table)
    learner = _learner(net, job, ActionSentences(actions, replace(corpus.vocabulary, common=common)))
    # what the manifest says of actions and vectors
    about = manifest(job, corpus, asdict(net.config), data, by)
    about["actions"] = described(actions)
    if vectors and table:
        about["common"] = common
        about["training"]["word_vectors"] = {
            "file": vectors.file.name,
            "words": int(table.vectors.any(axis=1).sum()),
            "origin": vectors.origin,
        }
    return job.run(net, learner, about)


def _untrained(recipe: Recipe, words: Sequence[str], actions: int, table: WordTable | None) -> ActionNet:
    """A new net, with the vectors of words if there are any."""
    common = tuple(table.common) if table else ()
    config = recipe.sized(words=len(words), actions=actions, common=len(common), stems=stems_of(words, common))
    if table is None:
        return ActionNet(replace(config, vector=0))
    net = ActionNet(config)
    net.start_from(torch.from_numpy(table.vectors).float())
    return net


def _learner(net: ActionNet, job: Job, sentences: "ActionSentences") -> GradientLearner[ActionNet]:
    """Learns the actions of sentences."""

    def loss(batch: SentenceBatch) -> Terms:
        log_probabilities = net(batch.words, batch.lengths).float()
        losses = functional.nll_loss(log_probabilities, batch.actions, reduction="none")
        return (Term(losses, len(batch)),)

    return GradientLearner(
        net.to(job.device),
        job.training,
        loss,
        lambda rng: (sentences.draw(job.training.batch, rng),),
        lambda: sentences.measured(net),
    )


def spoken(store: Store, records: tuple[int, ...]) -> Actions:
    """The actions of some records; DataError if one has no usable sentence."""
    actions = actions_of(store, records)
    if not all(actions.sentences):
        raise DataError("each action needs a sentence that can be used: of 1 to 40 words")
    return actions


def described(actions: Actions) -> list[dict[str, Any]]:
    """A sentence of each action and the words of all its sentences, for manifests."""
    descriptions = []
    for sentences in actions.sentences:
        words = set(chain.from_iterable(map(NEW_MODEL_RULES.words, sentences)))
        descriptions.append({"sentence": sentences[0], "words": sorted(words)})
    return descriptions


def _encoded(vocabulary: Vocabulary, sentences: Iterable[str]) -> list[Ids]:
    """The words of sentences as ids."""
    return [vocabulary.encode(sentence)[0] for sentence in sentences]


class ActionSentences:
    """The sentences of all actions, to draw from and to measure by."""

    def __init__(self, actions: Actions, vocabulary: Vocabulary) -> None:
        self.known = [_encoded(vocabulary, sentences) for sentences in actions.sentences]

        # the sentences that are not in training, and the actions that each is about
        actions_by_sentence: dict[str, set[int]] = {}
        for action, unseen in enumerate(actions.unseen):
            for sentence in unseen:
                if any(map(vocabulary.meant, NEW_MODEL_RULES.words(sentence))):
                    actions_by_sentence.setdefault(sentence, set()).add(action)
        ids = _encoded(vocabulary, actions_by_sentence)
        self.unseen = padded_tensors(ids, "int64") if ids else None
        self.alike = torch.zeros(len(ids), len(actions), dtype=torch.bool)
        for row, sentence_actions in enumerate(actions_by_sentence.values()):
            self.alike[row, list(sentence_actions)] = True

    def draw(self, count: int, rng: np.random.Generator) -> SentenceBatch:
        """Sentences of random actions, each action with the same probability."""
        actions = rng.integers(len(self.known), size=count)
        ids = []
        for action in actions:
            sentences = self.known[action]
            ids.append(sentences[rng.integers(len(sentences))])
        return SentenceBatch(*padded_tensors(ids, "int64"), torch.from_numpy(actions))

    @torch.no_grad()
    def measured(self, net: ActionNet) -> Figures:
        """For sentences in unseen wordings the cross-entropy of their actions (validation), and how often the most
        likely action is one of these (understood)."""
        if self.unseen is None:
            return {}
        words, lengths = (part.to(net.mean.device) for part in self.unseen)
        # each sentence may be about several actions
        log_probabilities = net(words, lengths).cpu()
        best = log_probabilities.argmax(dim=1)
        right = log_probabilities.masked_fill(~self.alike, -torch.inf).logsumexp(dim=1)
        understood = self.alike[torch.arange(len(best)), best].float().mean()
        return {"validation": round(-float(right.mean()), 4), "understood": round(float(understood), 4)}
