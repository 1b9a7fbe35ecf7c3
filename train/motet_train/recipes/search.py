"""The recipe of the joint embedding of motions and sentences, and its training from a store."""

from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from functools import partial

import torch
from torch.nn import functional

from motet.representation.contract import named
from motet.text.vocabulary import NEW_MODEL_RULES
from motet_train.data.batches import Examples, Views, padded_tensors, views
from motet_train.data.disguise import Disguise, seen_as
from motet_train.data.sentences import usable
from motet_train.data.store import Store
from motet_train.descent import GradientLearner, Term, Training
from motet_train.evaluate.language.split_store import description_groups
from motet_train.evaluate.tables import Figures
from motet_train.models.joint_embedding import JointEmbedding, JointEmbeddingConfig
from motet_train.models.kinematics import figure_of
from motet_train.recipes.language import Divided, divided, manifest
from motet_train.recipes.recipe import ADAMW, Job, Recipe
from motet_train.runs import Run


@dataclass(frozen=True)
class SearchVisits:
    """The views of motions: see :func:`motet_train.data.batches.views`, and for windows and disguise
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
"""The shipped recipe."""

RECIPES = {"default": DEFAULT}


def train_search(store: Store, job: Job, data: str, by: str) -> Run:
    """Train on a store, see :func:`motet_train.recipes.language.train_language`."""
    visits = job.recipe.visits
    corpus = divided(store, visits.mirror, by)
    config = config_for(store, corpus, job.recipe)
    torch.manual_seed(job.about.seed)
    net = JointEmbedding(config)
    net.measure_by(corpus.contract.mean, corpus.contract.std)
    # validate by sentences that are not in training
    queries = _UnseenSentences(corpus, corpus.parts.validation)
    train_views = seen_by(net, corpus.examples(corpus.parts.train), visits, job.about.seed)
    learner = space_learner(net.to(job.device), job.training, train_views, lambda: queries.measures(net))
    return job.run(net, learner, manifest(job, corpus, asdict(config), data, by))


def config_for(store: Store, corpus: Divided, recipe: Recipe) -> JointEmbeddingConfig:
    """The configuration of a recipe's net for a store."""
    config: JointEmbeddingConfig = recipe.sized(
        channels=len(corpus.contract.channels),
        words=len(corpus.vocabulary),
        figure=figure_of(corpus.contract),
    )
    if named(store.representation).required:
        return config
    return replace(config, travelled=0)  # its channels do not tell the path


def seen_by(net: JointEmbedding, examples: Examples, visits: SearchVisits, seed: int, whole: bool = False) -> Views:
    """The views of examples that a net is trained on. whole: also of each motion as it is."""
    store = examples.store
    cut = partial(
        seen_as,
        disguise=visits.disguise,
        windows=visits.windows,
        channels=store.channels,
        fps=store.fps,
    )
    return views(examples, net.statistics, visits.views, cut, seed, whole)


def space_learner(
    net: JointEmbedding, training: Training, seen: Views, validate: Callable[[], Figures] = dict
) -> GradientLearner[JointEmbedding]:
    """A learner of a net on views, whose statistics the net takes first."""
    net.see_by(seen.seen)
    return GradientLearner(
        net,
        training,
        lambda pairs: (Term(net.losses(pairs), len(pairs)),),
        lambda rng: seen.epoch(rng, training.batch),
        validate,
    )


class _UnseenSentences:
    """The motions of a part of a store, and sentences about them that are not in training."""

    def __init__(self, corpus: Divided, records: tuple[int, ...]) -> None:
        entries = [corpus.store.records[record] for record in records]
        self.motions = padded_tensors([corpus.store.sequence(record) for record in records], "float32")
        self.groups = torch.tensor(description_groups(entries))

        # the sentences with a known word, and the row of each one's motion
        known = corpus.vocabulary.ids.keys()
        ids = []
        rows = []
        for row, entry in enumerate(entries):
            for sentence in entry.unseen or entry.sentences:
                if usable(sentence) and not known.isdisjoint(NEW_MODEL_RULES.words(sentence)):
                    ids.append(corpus.vocabulary.encode(sentence)[0])
                    rows.append(row)
        self.texts = padded_tensors(ids, "int64")
        self.rows = torch.tensor(rows)

    @torch.no_grad()
    def measures(self, net: JointEmbedding) -> Figures:
        """The mean cross-entropy of the motions that a sentence describes, and how often one is among the best 5."""
        device = net.mean.device
        # scores of all pairs
        motions = net.embed_motion(*(part.to(device) for part in self.motions)).cpu()
        texts = net.embed_text(*(part.to(device) for part in self.texts)).cpu()
        scores = texts @ motions.T
        right = self.groups[self.rows][:, None] == self.groups
        # the likelihood of the right ones, and their ranks
        log_probabilities = functional.log_softmax(scores / net.config.temperature, dim=1)
        losses = -log_probabilities.masked_fill(~right, -torch.inf).logsumexp(dim=1)
        best = scores.topk(min(5, scores.shape[1]), dim=1).indices
        first = right.gather(1, best).any(dim=1).float().mean()
        return {"validation": round(float(losses.mean()), 6), "first_5": round(float(first), 4)}
