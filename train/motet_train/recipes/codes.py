"""Recipes of the model that writes motions as codes, and its training on a codec."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import torch

from motet.models.language import Vocabulary
from motet_train.data.batches import frame_mirror
from motet_train.data.errors import DataError
from motet_train.data.sentences import Actions
from motet_train.data.sixd_windows import CodeBatch, CodeWindows, memory_of
from motet_train.data.store import Store
from motet_train.descent import GradientLearner, Term, Terms, Training
from motet_train.models.action_net import ActionNet
from motet_train.models.codec import MotionCodec
from motet_train.models.motion_codes import CodeModelConfig, MotionCodes, MotionCodesConfig
from motet_train.recipes.actions import described, spoken
from motet_train.recipes.coded import coded
from motet_train.recipes.language import divided, manifest
from motet_train.recipes.recipe import Job, Recipe
from motet_train.runs import Run

DRAWING: dict[str, Any] = {
    "temperature": 1.0,
    "top_p": 0.8,
    "guidance": 1.5,
    "certainty": 8.0,
    "memory": 0.9,
    "first_temperature": 0.7,
    "max_seconds": 30.0,
}


@dataclass(frozen=True)
class CodeVisits:
    """window: steps of codes. first: how many times a motion's first step counts."""

    window: int = 64
    first: float = 8.0


DEFAULT = Recipe(
    "generate",
    "motion-codes",
    "codes",
    CodeModelConfig(0),
    ("actions",),
    Training(
        steps=4500,
        every=300,
        batch=16,
        optimiser="muon",
        learning_rate=2e-3,
        weight_decay=0.05,
        warm_up=100,
        falling=0.5,
        clip=1.0,
        keep="last",
        precision="bfloat16",
    ),
    CodeVisits(),
    DRAWING,
)

RECIPES = {"default": DEFAULT}


def train_codes(store: Store, job: Job, data: str, by: str, codec: Run, actions: Run) -> Run:
    """Train a writer on a store, for the runs of a codec and of a net of actions that were trained on the same store,
    divided alike. DataError where they were not."""
    recipe, training = job.recipe, job.recipe.training
    assert training is not None
    found = divided(store, mirror=True, by=by)
    mirror = frame_mirror(found.contract)
    shown = spoken(store, found.parts.train)
    coder, reader = _codec(codec), _reader(actions, found.vocabulary, shown)
    torch.manual_seed(job.about.seed)
    motions = coded(store, found.parts.train, coder.eval(), shown, mirror)
    net = _untrained(recipe.sized(actions=len(shown)), coder, reader, memory_of(motions))
    windows = CodeWindows(motions, recipe.visits.window, net.end, recipe.visits.first)

    def batches(rng: np.random.Generator) -> Iterator[CodeBatch]:
        yield windows.draw(training.batch, net.config.writer.unsaid, len(shown), rng)

    learner = GradientLearner(net.to(job.device), training, lambda batch: _loss(net, batch), batches)
    about = manifest(job, found, asdict(net.config), data, by)
    about["actions"] = actions.manifest["actions"]
    about["training"] |= {"codec": _made(codec.manifest["training"]), "actions": _made(actions.manifest["training"])}
    return job.run(net, learner, about)


def _codec(run: Run) -> MotionCodec:
    if not isinstance(run.model, MotionCodec):
        raise DataError(f"codes need the run of a codec (motet train codec), not of {run.manifest['model']}")
    return run.model


def _reader(run: Run, vocabulary: Vocabulary, actions: Actions) -> ActionNet:
    """The net of a run that was trained on the same sentences."""
    if not isinstance(run.model, ActionNet):
        raise DataError(f"codes need the run of a net of actions (motet train actions), not of {run.manifest['model']}")
    known = {"vocabulary": list(vocabulary.words), "actions": described(actions)}
    if any(run.manifest[key] != value for key, value in known.items()):
        name = run.manifest["name"]
        raise DataError(
            f"the net of actions {name} was trained on other sentences: train it on the same data and split"
        )
    return run.model


def _made(training: Mapping[str, Any]) -> dict[str, Any]:
    """How a part was made, and what it started from."""
    start = {"start": _made(training["start"])} if "start" in training else {}
    kept = ("command", "seed", "steps", "seconds", "word_vectors")
    return {**{key: training[key] for key in kept if key in training}, **start}


def _untrained(config: CodeModelConfig, codec: MotionCodec, text: ActionNet, memory: torch.Tensor) -> MotionCodes:
    net = MotionCodes(MotionCodesConfig(codec.config, text.config, config, len(memory)))
    net.take(codec, text)
    net.memory.copy_(memory)
    return net


def _loss(net: MotionCodes, batch: CodeBatch) -> Terms:
    losses = net.losses(batch.codes, batch.before, batch.action, batch.age)
    weighed = losses.mean(dim=-1) * batch.weights / batch.weights.mean()
    return (Term(weighed, len(batch)),)
