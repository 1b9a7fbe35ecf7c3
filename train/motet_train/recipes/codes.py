"""Recipes of the model that writes motions as codes, and its training on a codec."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
import torch

from motet.models.language import padded
from motet.models.text import RULES, Vocabulary
from motet_train.data.actions import Actions, actions_of
from motet_train.data.batches import frame_mirror
from motet_train.data.code_windows import CodeBatch, CodeWindows, memory_of
from motet_train.data.errors import DataError
from motet_train.data.store import Store
from motet_train.descent import GradientLearner, Term, Terms, Training
from motet_train.models.codes.actions import ActionsConfig, stems_of
from motet_train.models.codes.code_model import CodeModelConfig
from motet_train.models.codes.codec import MotionCodec
from motet_train.models.codes.motion_codes import MotionCodes, MotionCodesConfig
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
class Written:
    """The configuration before the data are known: see :class:`MotionCodesConfig`."""

    writer: CodeModelConfig = field(default_factory=lambda: CodeModelConfig(0))
    text: ActionsConfig = field(default_factory=lambda: ActionsConfig(0, 0))


@dataclass(frozen=True)
class CodeVisits:
    """window: steps of codes. first: how many times a motion's first step counts. sentences: in a batch."""

    window: int = 64
    first: float = 8.0
    sentences: int = 64


DEFAULT = Recipe(
    "generate",
    "motion-codes",
    "codes",
    Written(),
    (),
    Training(
        steps=6000,
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


def train_codes(store: Store, codec: Run, job: Job, data: str = "", by: str = "trial") -> Run:
    """Train on a store and the run of a codec that was trained on the same store, divided alike."""
    recipe, training = job.recipe, job.recipe.training
    assert training is not None
    if not isinstance(codec.model, MotionCodec):
        raise DataError(f"codes need the run of a codec (motet train codec), not of {codec.manifest['model']}")
    found = divided(store, mirror=True, by=by)
    mirror = frame_mirror(found.contract)
    actions = actions_of(store, found.parts.train)
    if not all(actions.sentences):
        raise DataError("each action needs a sentence that can be used: of 1 to 40 words")
    torch.manual_seed(job.about.seed)
    motions = coded(store, found.parts.train, codec.model.eval(), actions, mirror)
    net = _untrained(recipe.config, codec.model, actions, found.vocabulary, memory_of(motions))
    windows = CodeWindows(motions, recipe.visits.window, net.end, recipe.visits.first)
    said = _Said(actions, found.vocabulary)

    def batches(rng: np.random.Generator) -> Iterator[CodeBatch]:
        drawn = windows.draw(training.batch, net.config.writer.unsaid, len(actions), rng)
        yield CodeBatch(*drawn, *said.draw(recipe.visits.sentences, rng))

    learner = GradientLearner(
        net.to(job.device), training, lambda batch: _loss(net, batch), batches, lambda: said.measured(net)
    )
    about = manifest(job, found, asdict(net.config), data, by)
    about["actions"] = [
        {"sentence": sentences[0], "words": sorted({word for s in sentences for word in RULES.words(s)})}
        for sentences in actions.sentences
    ]
    about["training"]["codec"] = _made(codec.manifest["training"])
    return job.run(net, learner, about)


def _made(training: Mapping[str, Any]) -> dict[str, Any]:
    """How a codec was made, and the one that it started from."""
    start = {"start": _made(training["start"])} if "start" in training else {}
    return {**{key: training[key] for key in ("command", "seed", "steps", "seconds")}, **start}


def _untrained(
    config: Written, codec: MotionCodec, actions: Actions, vocabulary: Vocabulary, memory: torch.Tensor
) -> MotionCodes:
    stems = stems_of(vocabulary.words)
    text = replace(config.text, words=len(vocabulary), actions=len(actions), stems=stems)
    writer = replace(config.writer, actions=len(actions))
    net = MotionCodes(MotionCodesConfig(codec.config, text, writer, len(memory)))
    net.take(codec)
    net.memory.copy_(memory)
    return net


def _loss(net: MotionCodes, batch: CodeBatch) -> Terms:
    losses = net.losses(batch.codes, batch.before, batch.action, batch.age)
    weighed = losses.mean(dim=-1) * batch.weights / batch.weights.mean()
    chances = net.text(batch.words, batch.lengths)
    asked = torch.nn.functional.nll_loss(chances.float(), batch.asked)
    return (Term(weighed, len(batch)), Term(asked, len(batch)))


class _Said:
    """The sentences of all actions, to draw from and to measure by."""

    def __init__(self, actions: Actions, vocabulary: Vocabulary) -> None:
        self.vocabulary, self.actions = vocabulary, actions
        self.known = [[self._ids(s) for s in said] for said in actions.sentences]
        pairs = [(self._ids(s), action) for action, said in enumerate(actions.unseen) for s in said]
        self.unseen = padded([ids for ids, _ in pairs], "int64") if pairs else None
        self.asked = torch.tensor([action for _, action in pairs])
        self.alike = self._alike()

    def _ids(self, sentence: str) -> Any:
        return self.vocabulary.encode(sentence)[0]

    def _alike(self) -> torch.Tensor:
        """(S, A): whether an unseen sentence S is one of the action A."""
        asking: dict[str, set[int]] = {}
        for action, said in enumerate(self.actions.unseen):
            for s in said:
                asking.setdefault(s, set()).add(action)
        found = torch.zeros(len(self.asked), len(self.actions), dtype=torch.bool)
        for row, s in enumerate(s for said in self.actions.unseen for s in said):
            found[row, list(asking[s])] = True
        return found

    def draw(self, count: int, rng: np.random.Generator) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Sentences (S, W), their lengths (S,) and what they ask for (S,)."""
        asked = rng.integers(len(self.known), size=count)
        ids, lengths = padded([self.known[a][rng.integers(len(self.known[a]))] for a in asked], "int64")
        return torch.from_numpy(ids), torch.from_numpy(lengths), torch.from_numpy(asked)

    @torch.no_grad()
    def measured(self, net: MotionCodes) -> dict[str, float]:
        """How often the likeliest action of a sentence in a wording never seen is one that it was said of."""
        if self.unseen is None:
            return {}
        words, lengths = (torch.from_numpy(part).to(net.mean.device) for part in self.unseen)
        best = net.text(words, lengths).argmax(dim=1).cpu()
        return {"understood": round(float(self.alike[torch.arange(len(best)), best].float().mean()), 4)}
