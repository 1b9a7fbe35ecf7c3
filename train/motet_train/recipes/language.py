"""Training between motion and language, either way, from a store; and the recipes of the motion-to-language model."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from functools import partial
from itertools import chain
from typing import Any

import numpy as np
import torch

from motet.bundle.manifest import Manifest
from motet.models.describe import ConfidenceSettings, DescribeModel
from motet.models.language import MAX_SECONDS
from motet.representation.base import FrameMirror
from motet.representation.contract import MotionContract, named
from motet.text.vocabulary import RULES, Vocabulary
from motet_train.data.batches import Batch, Examples, examples, frame_mirror
from motet_train.data.sentences import mirror_text, usable
from motet_train.data.store import Split, Store, split
from motet_train.descent import GradientLearner, Term, Terms, Training
from motet_train.evaluate.language.confidence import calibrated, judged
from motet_train.evaluate.language.split_store import SplitStore
from motet_train.models.motion_to_language import LanguageNet, MotionToLanguageConfig
from motet_train.recipes.recipe import Job, Recipe
from motet_train.runs import MODELS, Run

SIZES = ("channels", "words")
"""What the store decides in the configurations of both nets."""


@dataclass(frozen=True)
class LanguageVisits:
    """Which motions an epoch visits: see :meth:`motet_train.data.batches.Examples.epoch`.

    offsets: how many down-sampling offsets of each motion. windows: frames of each. mirror: whether half of all visits
    are to left-right mirrored motions.
    """

    offsets: int | None = None
    windows: tuple[int, int] | None = None
    mirror: bool = False


PAPER = Recipe(
    "describe",
    "motion-to-language",
    "beam",
    MotionToLanguageConfig(0, 0),
    SIZES,
    Training(epochs=100, batch=128, optimiser="nadam", clip=8.0),
    LanguageVisits(),
    {"beams": 5, "max_words": 40},
)
"""Table 1 of Plappert et al. 2017: encoder 2 x 64, 2 x 64; decoder 128, 128; embedding 64; dropout 0.4."""

DEFAULT = replace(
    PAPER,
    config=MotionToLanguageConfig(0, 0, dropout=0.2, frame_noise=0.3, travelled=3, summary=5.0),
    training=Training(epochs=200, batch=32, optimiser="nadam", learning_rate=2e-3, falling=0.5, clip=8.0, keep="last"),
    visits=LanguageVisits(offsets=3, mirror=True),
    defaults={**PAPER.defaults, "draws": 100, "temperature": 0.7},
)
"""What is shipped: for a small corpus, whose motions are seen through noise instead of more dropout.

Many wordings share an action, so the most probable sentence says it better than the consensus of draws.
"""

RECIPES = {"default": DEFAULT, "paper": PAPER}


@dataclass(frozen=True, eq=False)
class Divided:
    """A store, divided, with all that is taken from its training part alone."""

    store: Store
    parts: Split
    contract: MotionContract
    vocabulary: Vocabulary
    mirror: FrameMirror | None

    def examples(self, records: tuple[int, ...]) -> Examples:
        """The examples of some records."""
        return examples(self.store, records, self.vocabulary, self.mirror)


def divided(store: Store, mirror: bool, by: str = "trial") -> Divided:
    """Divide a store; contract and vocabulary are those of its training part. DataError where that is not possible.

    by: see :func:`motet_train.data.store.split`; the split is drawn with seed 0 whatever the seed of the training is,
    so that runs can be compared and chained.
    """
    parts = split(store.records, 0, by)
    contract = store.contract(parts.train)
    sentences = [s for record in parts.train for s in store.records[record].sentences if usable(s)]
    mirrored = map(mirror_text, sentences) if mirror else ()
    vocabulary = Vocabulary.of(chain(sentences, mirrored))
    return Divided(store, parts, contract, vocabulary, frame_mirror(contract) if mirror else None)


def train_language(store: Store, job: Job, data: str = "", by: str = "trial") -> Run:
    """Train on a store, see :meth:`motet_train.recipes.recipe.Job.run`; DataError where it cannot be trained on.

    data: its name.
    """
    recipe, visits, size = job.recipe, job.recipe.visits, job.training.batch
    found = divided(store, visits.mirror, by)
    config = asdict(recipe.sized(channels=len(found.contract.channels), words=len(found.vocabulary)))
    if "travelled" in config and not named(store.representation).required:
        config["travelled"] = 0  # its channels do not say where the figure goes
    torch.manual_seed(job.about.seed)
    net = MODELS[recipe.model](config)
    assert isinstance(net, LanguageNet)
    net.measure_by(found.contract.mean, found.contract.std)
    train, validation = (found.examples(part) for part in (found.parts.train, found.parts.validation))

    def loss(batch: Batch) -> Terms:
        losses, summary = net.terms(batch)
        terms = (Term(losses, len(losses)),)
        return terms if summary is None else (*terms, Term(summary, len(batch)))

    def validated() -> dict[str, Any]:
        longest = visits.windows and visits.windows[1]
        return {"validation": round(validation_loss(net, validation, size, longest), 6)}

    learner = GradientLearner(
        net.to(job.device),
        job.training,
        loss,
        lambda rng: train.epoch(rng, size, visits.offsets, visits.windows),
        validated,
    )
    about = manifest(job, found, config, data, by)
    if recipe.verb != "describe":
        return job.run(net, learner, about)
    return job.run(net, learner, about, tuned=partial(_confidence, found))


def _confidence(found: Divided, run: Run) -> tuple[ConfidenceSettings]:
    """From which log-probability on descriptions are believed, by those of the validation motions."""
    model = DescribeModel(Manifest.from_json(run.manifest), run.torch_graphs())
    corpus = SplitStore(found.store, found.parts)
    said = [record for record in found.parts.validation if corpus.sentences(record)]
    fitting = [n for n in said if len(corpus.motion(n)) >= 2 and corpus.motion(n).duration <= MAX_SECONDS]
    descriptions, right = judged(model, corpus, fitting)
    return (calibrated(np.array([one.log_probability for one in descriptions]), right),)


def manifest(job: Job, found: Divided, config: Mapping[str, Any], data: str, by: str) -> dict[str, Any]:
    """The manifest of a run of a model that reads or writes sentences. data: the store's name."""
    parts, records = found.parts, found.store.records
    about = {
        "name": data,
        "motions": len(records),
        "sentences": sum(len(entry.sentences) for entry in records),
        "skipped": len(found.store.skipped),
        "unusable_sentences": sum(not usable(s) for entry in records for s in entry.sentences),
    }
    named = {part: [records[record].name for record in getattr(parts, part)] for part in ("validation", "test")}
    training = {"data": about, "split": {"by": by, "train": len(parts.train), **named}}
    known = {"text": RULES.to_json(), "vocabulary": found.vocabulary.words}
    return job.manifest(found.contract, config, job.recipe.defaults, None, training, **known)


@torch.no_grad()
def validation_loss(net: LanguageNet, examples: Examples, batch: int, longest: int | None = None) -> float:
    """The mean loss of a step, over every sentence of every motion, of which the ``longest`` first frames count."""
    total, count, device = 0.0, 0, net.mean.device
    for rows in examples.everything(batch, longest):
        losses, _ = net.terms(rows.to(device))
        total, count = total + float(losses.double().sum()), count + len(losses)
    return total / count
