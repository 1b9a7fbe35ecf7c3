"""Training between motion and language, either way, from a store; and the recipes of the motion-to-language model."""

from dataclasses import asdict, dataclass, replace
from functools import partial
from itertools import chain
from typing import Any

import numpy as np
import torch

from motet.bundle.fields import Json
from motet.bundle.manifest import Manifest
from motet.models.describe import ConfidenceSettings, DescribeModel
from motet.models.language import MAX_SECONDS
from motet.representation.base import FrameMirror
from motet.representation.contract import MotionContract, named
from motet.text.vocabulary import NEW_MODEL_RULES, Vocabulary
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
"""Sizes of both nets that the store determines."""


@dataclass(frozen=True)
class LanguageVisits:
    """The motions that an epoch visits: see :meth:`motet_train.data.batches.Examples.epoch`.

    offsets: the number of down-sampling offsets of each motion. windows: frames of each. mirror: whether half of all
    visits are to left-right mirrored motions. pairs: whether each offset is visited once with each sentence, not once
    with one that is drawn.
    """

    offsets: int | None = None
    windows: tuple[int, int] | None = None
    mirror: bool = False
    pairs: bool = False


PAPER = Recipe(
    "describe",
    "motion-to-language",
    "beam",
    MotionToLanguageConfig(0, 0),
    SIZES,
    Training(epochs=100, batch=128, optimiser="nadam", clip=8.0, keep="last"),
    LanguageVisits(pairs=True),
    {"beams": 5, "max_words": 40},
)
"""Table 1 of Plappert et al. 2017: encoder 2 x 64, 2 x 64; decoder 128, 128; embedding 64; dropout 0.4. An epoch is
every pair of a motion at an offset and a sentence about it, and the last weights are kept, as in the authors' code."""

DEFAULT = replace(
    PAPER,
    config=MotionToLanguageConfig(0, 0, dropout=0.2, frame_noise=0.3, travelled=3, summary=5.0),
    training=Training(epochs=200, batch=32, optimiser="nadam", learning_rate=2e-3, falling=0.5, clip=8.0, keep="last"),
    visits=LanguageVisits(offsets=3, mirror=True),
    defaults={**PAPER.defaults, "draws": 100, "temperature": 0.7},
)
"""The shipped recipe, for a small corpus, with noise on the frames instead of more dropout.

Many wordings share an action, so the most probable sentence describes it better than the consensus of draws.
"""

RECIPES = {"default": DEFAULT, "paper": PAPER}


@dataclass(frozen=True, eq=False)
class Divided:
    """A divided store, with everything that is derived from its training part alone."""

    store: Store
    parts: Split
    contract: MotionContract
    vocabulary: Vocabulary
    mirror: FrameMirror | None

    def examples(self, records: tuple[int, ...]) -> Examples:
        """The examples of some records."""
        return examples(self.store, records, self.vocabulary, self.mirror)


def divided(store: Store, mirror: bool, by: str = "trial") -> Divided:
    """Divide a store; contract and vocabulary are those of its training part. DataError if that is not possible.

    by: see :func:`motet_train.data.store.split`; the split has seed 0 whatever the seed of the training, so that runs
    can be compared and chained.
    """
    parts = split(store.records, 0, by)
    contract = store.contract(parts.train)
    sentences = []
    for record in parts.train:
        sentences += [sentence for sentence in store.records[record].sentences if usable(sentence)]
    mirrored = map(mirror_text, sentences) if mirror else ()
    vocabulary = Vocabulary.of(chain(sentences, mirrored))
    return Divided(store, parts, contract, vocabulary, frame_mirror(contract) if mirror else None)


def train_language(store: Store, job: Job, data: str = "", by: str = "trial") -> Run:
    """Train on a store, see :meth:`motet_train.recipes.recipe.Job.run`; DataError if it cannot be trained on.

    data: the store's name.
    """
    corpus = divided(store, job.recipe.visits.mirror, by)
    config = _config(job.recipe, corpus)
    torch.manual_seed(job.about.seed)
    net = MODELS[job.recipe.model](config)
    assert isinstance(net, LanguageNet)
    net.measure_by(corpus.contract.mean, corpus.contract.std)
    learner = _learner(job, corpus, net)
    about = manifest(job, corpus, config, data, by)
    if job.recipe.verb != "describe":
        return job.run(net, learner, about)
    return job.run(net, learner, about, tuned=partial(_confidence, corpus))


def _config(recipe: Recipe, corpus: Divided) -> Json:
    """The sizes of a recipe's net for a corpus."""
    config = asdict(recipe.sized(channels=len(corpus.contract.channels), words=len(corpus.vocabulary)))
    if "travelled" in config and not named(corpus.store.representation).required:
        config["travelled"] = 0  # its channels do not tell the path
    return config


def _learner(job: Job, corpus: Divided, net: LanguageNet) -> GradientLearner[LanguageNet]:
    """What trains a net on the training part of a corpus, and validates it on the validation part."""
    visits = job.recipe.visits
    batch_size = job.training.batch
    train = corpus.examples(corpus.parts.train)
    validation = corpus.examples(corpus.parts.validation)

    def validated() -> Json:
        longest = visits.windows and visits.windows[1]
        return {"validation": round(validation_loss(net, validation, batch_size, longest), 6)}

    return GradientLearner(
        net.to(job.device),
        job.training,
        partial(_loss, net),
        lambda rng: train.epoch(rng, batch_size, visits.offsets, visits.windows, visits.pairs),
        validated,
    )


def _loss(net: LanguageNet, batch: Batch) -> Terms:
    """The terms of a batch: the losses of all active steps, and that of the summary head, if there is one."""
    losses, summary = net.terms(batch)
    terms = (Term(losses, len(losses)),)
    return terms if summary is None else (*terms, Term(summary, len(batch)))


def _confidence(corpus: Divided, run: Run) -> tuple[ConfidenceSettings]:
    """The log-probability from which descriptions are confident, chosen on the validation motions."""
    model = DescribeModel(Manifest.from_json(run.manifest), run.torch_graphs())
    split_store = SplitStore(corpus.store, corpus.parts)
    records = []
    for record in corpus.parts.validation:
        if split_store.sentences(record):
            motion = split_store.motion(record)
            if len(motion) >= 2 and motion.duration <= MAX_SECONDS:
                records.append(record)
    descriptions, right = judged(model, split_store, records)
    scores = np.array([description.log_probability for description in descriptions])
    return (calibrated(scores, right),)


def manifest(job: Job, corpus: Divided, config: Json, data: str, by: str) -> dict[str, Any]:
    """The manifest of a run of a model that reads or writes sentences. data: the store's name."""
    parts = corpus.parts
    records = corpus.store.records
    sentences = list(chain.from_iterable(entry.sentences for entry in records))
    about = {
        "name": data,
        "motions": len(records),
        "sentences": len(sentences),
        "skipped": len(corpus.store.skipped),
        "unusable_sentences": sum(not usable(sentence) for sentence in sentences),
    }
    split_names = {
        "by": by,
        "train": len(parts.train),
        "validation": [records[record].name for record in parts.validation],
        "test": [records[record].name for record in parts.test],
    }
    training = {"data": about, "split": split_names}
    text = {"text": NEW_MODEL_RULES.to_json(), "vocabulary": corpus.vocabulary.words}
    return job.manifest(corpus.contract, config, job.recipe.defaults, None, training, **text)


@torch.no_grad()
def validation_loss(net: LanguageNet, examples: Examples, batch: int, longest: int | None = None) -> float:
    """The mean loss of a step, over every sentence of every motion, by its ``longest`` first frames."""
    total = 0.0
    count = 0
    device = net.mean.device
    for rows in examples.everything(batch, longest):
        losses, _ = net.terms(rows.to(device))
        total += float(losses.double().sum())
        count += len(losses)
    return total / count
