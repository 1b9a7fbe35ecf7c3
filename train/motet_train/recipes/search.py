"""The recipe of the joint embedding of motions and sentences, and its training from a store."""

from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from functools import partial

import torch
from torch.nn import functional

from motet.models.language import padded
from motet.representation.contract import named
from motet.text.vocabulary import RULES
from motet_train.data.batches import Examples, Views, views
from motet_train.data.disguise import Disguise, seen_as
from motet_train.data.sentences import alike, usable
from motet_train.data.store import Store
from motet_train.descent import GradientLearner, Term, Training
from motet_train.models.joint_embedding import JointEmbedding, JointEmbeddingConfig
from motet_train.models.kinematics import figure_of
from motet_train.recipes.language import Divided, divided, manifest
from motet_train.recipes.recipe import ADAMW, Job, Recipe
from motet_train.runs import Run


@dataclass(frozen=True)
class SearchVisits:
    """How motions are seen: see :func:`motet_train.data.batches.views`, and for windows and disguise
    :func:`motet_train.data.disguise.seen_as`. mirror: also mirrored."""

    views: int = 12
    windows: tuple[int, int] = (25, 120)
    mirror: bool = True
    disguise: Disguise = field(default_factory=Disguise)


DEFAULT = Recipe(
    "search",
    "joint-embedding",
    "nearest",
    JointEmbeddingConfig(0, 0, travelled=3),
    ("channels", "words", "figure"),
    replace(ADAMW, epochs=120, every=10, batch=256, warm_up=10, cosine=True, weight_decay=0.05),
    SearchVisits(),
    {"count": 5},
)
"""What is shipped."""

RECIPES = {"default": DEFAULT}


def train_search(store: Store, job: Job, data: str = "", by: str = "trial") -> Run:
    """Train on a store, see :func:`motet_train.recipes.language.train_language`."""
    visits, training = job.recipe.visits, job.training
    found = divided(store, visits.mirror, by)
    config = config_for(store, found, job.recipe)
    torch.manual_seed(job.about.seed)
    net = JointEmbedding(config)
    net.measure_by(found.contract.mean, found.contract.std)
    asked = _Asked(found, found.parts.validation)
    seen = seen_by(net, found.examples(found.parts.train), visits, job.about.seed)
    learner = space_learner(net.to(job.device), training, seen, lambda: asked.measures(net))
    return job.run(net, learner, manifest(job, found, asdict(config), data, by))


def config_for(store: Store, found: Divided, recipe: Recipe) -> JointEmbeddingConfig:
    """The configuration of a recipe's net for a store."""
    sizes = {"channels": len(found.contract.channels), "words": len(found.vocabulary)}
    config: JointEmbeddingConfig = recipe.sized(**sizes, figure=figure_of(found.contract))
    if named(store.representation).required:
        return config
    return replace(config, travelled=0)  # its channels do not say where the figure goes


def seen_by(net: JointEmbedding, examples: Examples, visits: SearchVisits, seed: int, whole: bool = False) -> Views:
    """The views of examples that a net is trained on. whole: and of each motion as it is."""
    windows, store = (visits.windows[0], visits.windows[1]), examples.store
    cut = partial(seen_as, disguise=visits.disguise, windows=windows, channels=store.channels, fps=store.fps)
    return views(examples, net.statistics, visits.views, cut, seed, whole)


def space_learner(
    net: JointEmbedding, training: Training, seen: Views, validate: Callable[[], dict[str, float]] = dict
) -> GradientLearner:
    """What trains a net on views, by which it is measured first."""
    net.see_by(seen.seen)
    return GradientLearner(
        net,
        training,
        lambda pairs: (Term(net.losses(pairs), len(pairs)),),
        lambda rng: seen.epoch(rng, training.batch),
        validate,
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
        """The mean surprise at the motions that show what a sentence says, and how often one is among the best 5."""
        device = net.mean.device
        motions = net.embed_motion(*(part.to(device) for part in self.motions)).cpu()
        texts = net.embed_text(*(part.to(device) for part in self.texts)).cpu()
        scores = texts @ motions.T
        right = self.groups[self.rows][:, None] == self.groups
        chances = functional.log_softmax(scores / net.config.temperature, dim=1)
        surprise = -chances.masked_fill(~right, -torch.inf).logsumexp(dim=1)
        best = scores.topk(min(5, scores.shape[1]), dim=1).indices
        first = right.gather(1, best).any(dim=1).float().mean()
        return {"validation": round(float(surprise.mean()), 6), "first_5": round(float(first), 4)}
