"""Recipes of the model that writes motions as codes, and its training on a codec."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from itertools import product
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from motet.bundle.fields import Json
from motet.generate.memory import Memory, MemorySettings, squared_distances
from motet.motion.rotations import Array
from motet.representation.base import FrameMirror
from motet.representation.root_block import poses_of
from motet_train.data.acts import acts
from motet_train.data.batches import frame_mirror
from motet_train.data.errors import DataError
from motet_train.data.sentences import Actions
from motet_train.data.sixd_windows import CodeBatch, CodedMotion, Codes, CodeWindows, memory_of, with_way
from motet_train.data.store import Store
from motet_train.descent import GradientLearner, Term, Terms
from motet_train.models.action_net import ActionNet
from motet_train.models.codec import MotionCodec
from motet_train.models.motion_codes import CodeModelConfig, MotionCodes, MotionCodesConfig
from motet_train.recipes.actions import described, spoken
from motet_train.recipes.language import divided, manifest
from motet_train.recipes.recipe import MUON, Job, Recipe, origin
from motet_train.runs import Run

DRAWING_SETTINGS: dict[str, Any] = {
    "temperature": 1.0,
    "top_p": 0.8,
    "guidance": 1.5,
    "certainty": 8.0,
    "memory": 0.9,
    "first_temperature": 0.7,
    "max_seconds": 30.0,
}


ALIKE_PAIRS = 0.2018
"""Share of the pairs of steps within long recordings that count as alike."""


@dataclass(frozen=True)
class CodeVisits:
    """window: steps of codes. first: weight of a motion's first step."""

    window: int = 64
    first: float = 8.0


DEFAULT = Recipe(
    "generate",
    "motion-codes",
    "codes",
    CodeModelConfig(0),
    ("actions",),
    replace(MUON, steps=4500, every=300, batch=16, weight_decay=0.05, warm_up=100, falling=0.5),
    CodeVisits(),
    DRAWING_SETTINGS,
)

RECIPES = {"default": DEFAULT}


def train_codes(store: Store, job: Job, data: str, by: str, codec: Run, actions: Run) -> Run:
    """Train a writer on a store, for the runs of a codec and of a net of actions that were trained on the same store
    and split, or of another writer that has them. DataError if they were not.

    A writer that has the net of actions is trained further.
    """
    corpus = divided(store, mirror=True, by=by)
    shown = spoken(store, corpus.parts.train)
    sentences = {"vocabulary": list(corpus.vocabulary.words), "actions": described(shown)}
    codec_net, action_net = _parts(codec, actions, sentences)

    # the training motions in the codec's codes, and a writer with a memory of them
    torch.manual_seed(job.about.seed)
    motions = coded(store, corpus.parts.train, codec_net.eval(), shown, frame_mirror(corpus.contract))
    net = _untrained(job.recipe.sized(actions=len(shown)), codec_net, action_net, memory_of(motions))

    about = manifest(job, corpus, asdict(net.config), data, by)
    _add_parts(about, codec, actions)
    _take_up(net, actions)
    learner = _learner(net, job, motions)
    return job.run(net, learner, about, tuned=lambda run: (memory_settings(net.tables(), len(shown)),))


def _add_parts(about: dict[str, Any], codec: Run, actions: Run) -> None:
    """Add to a manifest the actions of a run, and how it and a codec were trained."""
    about |= {key: actions.manifest[key] for key in ("actions", "common") if key in actions.manifest}
    for part, run in (("codec", codec), ("actions", actions)):
        training = run.manifest["training"]
        about["training"][part] = training[part] if isinstance(run.model, MotionCodes) else origin(training)
    if isinstance(actions.model, MotionCodes):
        about["training"]["start"] = origin(actions.manifest["training"])


def _untrained(config: CodeModelConfig, codec: MotionCodec, actions: ActionNet, memory: Tensor) -> MotionCodes:
    """A new writer beside two trained nets, with a memory of steps."""
    net = MotionCodes(MotionCodesConfig(codec.config, actions.config, config, len(memory)))
    net.take(codec, actions)
    net.memory.copy_(memory)
    return net


def _take_up(net: MotionCodes, run: Run) -> None:
    """Begin with the writer of a run, if it has one; DataError if its sizes differ."""
    if not isinstance(run.model, MotionCodes):
        return
    if run.model.config.writer != net.config.writer:
        raise DataError(f"{run.manifest['name']} is a writer of other sizes, which cannot be trained further")
    net.writer.load_state_dict(run.model.writer.state_dict())


def _learner(net: MotionCodes, job: Job, motions: list[CodedMotion]) -> GradientLearner[MotionCodes]:
    """Learns to write each step of coded motions by those before it and the action."""
    visits = job.recipe.visits
    windows = CodeWindows(motions, visits.window, net.end, visits.first)
    config = net.config.writer

    def loss(batch: CodeBatch) -> Terms:
        losses = net.losses(batch.codes, batch.before, batch.action, batch.age)
        return (Term(losses.mean(dim=-1) * batch.weights / batch.weights.mean(), len(batch)),)

    return GradientLearner(
        net.to(job.device),
        job.training,
        loss,
        lambda rng: (windows.draw(job.training.batch, config.unsaid, config.actions, rng),),
    )


def memory_settings(tables: Mapping[str, NDArray[Any]], actions: int) -> MemorySettings:
    """The settings of a memory, from the tables of a bundle and the number of actions.

    Only ``alike_distance`` depends on the codec: it is found by :func:`alike_distance`. Shares of movement do not, and
    the other distances are left as they are, since every codec keeps its numbers between -1 and 1 and spread.
    """
    memory = Memory.of(tables["memory"], tables["moves"], tables["body"], actions)
    return replace(memory.settings, alike_distance=alike_distance(memory))


def alike_distance(memory: Memory) -> float:
    """The squared distance, to three digits, within which the share :data:`ALIKE_PAIRS` of the pairs of steps in long
    recordings lies; the memory's own setting if it has no recording longer than an act."""
    # recordings longer than an act
    lengthy = []
    for action in memory.rows:
        for recording in memory.recordings(action):
            if len(recording.places) - 1 > memory.settings.act_steps:
                lengthy.append(memory.keys(action)[recording.places])
    if not lengthy:
        return memory.settings.alike_distance
    # distances of all pairs of steps in a thousand of them at most
    distances = []
    for keys in lengthy[:: -(-len(lengthy) // 1000)]:
        distances.append(squared_distances(keys)[np.triu_indices(len(keys), 1)])
    alike = float(np.quantile(np.concatenate(distances), ALIKE_PAIRS))
    return max(float(f"{alike:.3g}"), MemorySettings.RANGES["alike_distance"][1].low)


def _parts(codec: Run, actions: Run, sentences: Json) -> tuple[MotionCodec, ActionNet]:
    """The nets of two runs, of parts or of writers that have them; DataError for other runs, or for a net of actions
    that was trained on other sentences."""
    codec_net = codec.model.codec if isinstance(codec.model, MotionCodes) else codec.model
    action_net = actions.model.text if isinstance(actions.model, MotionCodes) else actions.model
    if not isinstance(codec_net, MotionCodec):
        raise DataError(f"codes need the run of a codec (motet train codec), not of {codec.manifest['model']}")
    if not isinstance(action_net, ActionNet):
        kind = actions.manifest["model"]
        raise DataError(f"codes need the run of a net of actions (motet train actions), not of {kind}")
    if any(actions.manifest[key] != value for key, value in sentences.items()):
        name = actions.manifest["name"]
        raise DataError(
            f"the net of actions {name} was trained on other sentences: train it on the same data and split"
        )
    return codec_net, action_net


@torch.no_grad()
def coded(
    store: Store, records: tuple[int, ...], codec: MotionCodec, actions: Actions, mirror: FrameMirror
) -> list[CodedMotion]:
    """The acts of every span of some records, as they are and mirrored, in the codes of a codec."""
    motions = []
    for record in records:
        entry = store.records[record]
        parts = acts(store.motion(record))
        cut = parts[0][1] < len(store.sequence(record))  # a long take that repeats an act
        # each act in each span, as it is and mirrored
        for (begin, end), (start, stop) in product(entry.spans, parts):
            frames = store.values(begin + start, min(begin + stop, end))
            first = begin == entry.spans[0][0]
            for mirrored, seen in ((False, frames), (True, mirror(frames))):
                codes = codes_of(codec, seen, store.fps, entry.ends or cut)
                if len(codes):
                    motions.append(CodedMotion(codes, actions.of[record, mirrored], entry.starts or cut, first))
    return motions


def codes_of(codec: MotionCodec, frames: Array, fps: float, ended: bool = False) -> Codes:
    """Frames (T, D) to codes (N, P), without the frames of an incomplete last step. ended: with the move that ends a
    motion after them, if there are any."""
    hop = codec.config.hop
    frames = frames[: len(frames) // hop * hop]
    if not len(frames):
        return np.empty((0, codec.config.groups + 1), dtype=np.int64)
    body = codec.to_codes(codec.encode(torch.from_numpy(frames).float()[None]))[0].numpy()
    codes = np.concatenate([_moves(codec, frames, fps)[:, None], body], axis=1)
    if ended:
        codes = np.pad(codes, ((0, 1), (0, 0)))
        codes[-1, 0] = codec.config.moves
    return codes


def _moves(codec: MotionCodec, frames: Array, fps: float) -> Codes:
    """The root moves (N,) of frames (T, D) of whole steps."""
    poses = poses_of(frames, fps)
    poses = np.concatenate([poses, 2 * poses[-1:] - poses[-2:-1]])  # the root keeps its pace after the end
    _, moves, _ = with_way(frames, poses, codec.book.numpy().astype(np.float64), codec.config.hop)
    return moves
