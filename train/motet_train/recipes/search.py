"""The recipe of the joint embedding of motions and sentences, and its training from a store."""

from dataclasses import asdict, dataclass

import torch
from torch import Tensor
from torch.nn import functional

from motet.models.language import RULES, padded
from motet_train.data.batches import Pairs, views
from motet_train.data.sentences import alike, usable
from motet_train.data.store import Store
from motet_train.descent import GradientLearner, Term, Training
from motet_train.models.joint_embedding import JointEmbedding, JointEmbeddingConfig
from motet_train.models.kinematics import figure_of
from motet_train.recipes.language import Divided, divided, manifest
from motet_train.recipes.recipe import Job, Recipe
from motet_train.runs import Run


@dataclass(frozen=True)
class SearchVisits:
    """How motions are seen: so many views of each, of at most a number of frames drawn between the two; mirrored, too.

    See :func:`motet_train.data.batches.views`.
    """

    views: int = 8
    windows: tuple[int, int] = (25, 120)
    mirror: bool = True


DEFAULT = Recipe(
    "search",
    "joint-embedding",
    "nearest",
    JointEmbeddingConfig(0, 0),
    ("channels", "words", "figure"),
    Training(
        epochs=250,
        every=10,
        batch=256,
        optimiser="adamw",
        learning_rate=2e-3,
        warm_up=10,
        cosine=True,
        weight_decay=0.05,
        keep="last",
    ),
    SearchVisits(),
    {"count": 5},
)
"""What is shipped."""

RECIPES = {"default": DEFAULT}

FIRST = 5
"""Validation counts how often a motion that shows what a sentence says is among so many."""


def train_search(store: Store, job: Job, data: str = "", by: str = "trial") -> Run:
    """Train on a store, see :func:`motet_train.recipes.language.train_language`."""
    recipe = job.recipe
    found = divided(store, recipe.visits.mirror, by)
    sizes = {"channels": len(found.contract.channels), "words": len(found.vocabulary)}
    config = asdict(recipe.sized(**sizes, figure=figure_of(found.contract)))
    torch.manual_seed(job.about.seed)
    net = JointEmbedding.from_config(config)
    net.measure_by(found.contract.mean, found.contract.std)
    return job.run(net, _learner(net, found, job), manifest(job, found, config, data, by))


def _learner(net: JointEmbedding, found: Divided, job: Job) -> GradientLearner:
    assert job.recipe.training is not None
    training, visits = job.recipe.training, job.recipe.visits
    asked = _Asked(found, found.parts.validation)
    seen = views(found.examples(found.parts.train), net.statistics, visits.views, tuple(visits.windows), job.about.seed)
    net.see_by(seen.seen)

    def losses(pairs: Pairs) -> tuple[Term, ...]:
        return (Term(net.losses(pairs), len(pairs)),)

    return GradientLearner(
        net.to(job.device), training, losses, lambda rng: seen.epoch(rng, training.batch), lambda: asked.measures(net)
    )


class _Asked:
    """The motions of a part of a store, and sentences about them that no training has seen."""

    def __init__(self, found: Divided, records: tuple[int, ...]) -> None:
        entries = [found.store.records[record] for record in records]
        self.groups = torch.tensor(alike([[*map(RULES.normalise, (*e.sentences, *e.unseen))] for e in entries]))
        frames, lengths = padded([found.store.sequence(record) for record in records], "float32")
        self.motions = torch.from_numpy(frames), torch.from_numpy(lengths)
        said = [(s, row) for row, e in enumerate(entries) for s in e.unseen or e.sentences if usable(s)]
        known = found.vocabulary.ids.keys()
        said = [(s, row) for s, row in said if not known.isdisjoint(RULES.words(s))]
        words, counts = padded([found.vocabulary.encode(s)[0] for s, _ in said], "int64")
        self.texts = torch.from_numpy(words), torch.from_numpy(counts)
        self.rows = torch.tensor([row for _, row in said])

    @torch.no_grad()
    def measures(self, net: JointEmbedding) -> dict[str, float]:
        """The mean surprise at the motions that show what a sentence says, and how often one is among the first."""
        device = net.mean.device
        motions = net.embed_motion(*(part.to(device) for part in self.motions)).cpu()
        texts = net.embed_text(*(part.to(device) for part in self.texts)).cpu()
        scores = texts @ motions.T
        right = self.groups[self.rows][:, None] == self.groups
        chances = functional.log_softmax(scores / net.config.temperature, dim=1)
        surprise = -chances.masked_fill(~right, -torch.inf).logsumexp(dim=1)
        return {"validation": round(float(surprise.mean()), 6), f"first_{FIRST}": round(_found(scores, right), 4)}


def _found(scores: Tensor, right: Tensor) -> float:
    """The share of rows that have a right column among the FIRST with the highest scores."""
    best = scores.topk(min(FIRST, scores.shape[1]), dim=1).indices
    return float(right.gather(1, best).any(dim=1).float().mean())
