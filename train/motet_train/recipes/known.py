"""The recipe of the known motions behind the answers of describe: which they are, and how sure their answers can be.

The probability that an answer is right is learned on held-out people, those of one corpus together: spaces that were
fitted without them answer about their motions. The final space is then fitted with everybody.
"""

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, fields, replace
from itertools import compress, product
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from motet.bundle.graph import Floats
from motet.models.nearest_neighbour import GOES_LEFT, GOES_RIGHT, GOES_STRAIGHT, AnswerSettings, Known, log_odds
from motet.motion.rotations import Array, Mask
from motet.text.vocabulary import NEW_MODEL_RULES
from motet_train.data.batches import Examples, Views
from motet_train.data.errors import DataError
from motet_train.data.kinds import KIND_PATTERNS, Shown, careful, named, shown_by
from motet_train.data.sentences import Actions, actions_of
from motet_train.data.store import KEYED, Store
from motet_train.models.discriminant import discriminate
from motet_train.models.joint_embedding import JointEmbedding, JointEmbeddingConfig
from motet_train.models.known_motions import KnownMotions, KnownMotionsConfig
from motet_train.models.motion_to_language import MotionToLanguage, MotionToLanguageConfig
from motet_train.recipes import language, search
from motet_train.recipes.language import Divided, divided, manifest
from motet_train.recipes.recipe import Job, Recipe, by_feature, origin, parameter_count
from motet_train.runs import Run, surroundings


@dataclass(frozen=True)
class KnownVisits(search.SearchVisits):
    """kept: the number of views of each motion that are known, besides the whole motion. folds: groups of people, held
    out in turn to learn how sure answers are. sure: how often a sure answer should be right."""

    kept: int = 4
    folds: int = 5
    sure: float = 0.94


DEFAULT = Recipe(
    "describe",
    "known-motions",
    "beam",
    KnownMotionsConfig(MotionToLanguageConfig(0, 0), JointEmbeddingConfig(0, 0), 0, 0, 0, 0, 0, 0),
    tuple(field.name for field in fields(KnownMotionsConfig)),
    training=search.DEFAULT.training,
    visits=KnownVisits(),
    defaults=language.DEFAULT.defaults,
)

RECIPES = {"default": DEFAULT}

TRIED = "tried.npz"
"""File of a run: the answers about held-out people from which their probability was learned."""

TURNING = r"(?<!in )\b(?:turn|veer|swerv|curv|corner|bend|angl|circl|spin|rotat|pivot|diagonal|head|cut|chang|off to)"
"""Beginnings of words for a path that is not straight."""

LOCOMOTION_KINDS = frozenset({"walk", "run", "skip", "backwards", "turn", "jump", "carry", "sidestep"})
"""Kinds of locomotion, whose direction is worth mentioning."""

SIDEWAYS = frozenset({"sidestep", "jump"})
"""Kinds of locomotion to a side without turning there."""


def train_known(store: Store, job: Job, data: str, by: str, writer: Run) -> Run:
    """Gather the known motions of a store, for the run of a net that writes sentences; DataError unless it has the
    store's channels."""
    began = perf_counter()
    corpus = divided(store, mirror=True, by=by)
    writer_net = _writer_net(writer, corpus, data)
    space, known, tried = _learned_space(store, corpus, job)
    net = KnownMotions.of(writer_net, space, known)

    # the manifest is the writer's where the model is
    about = manifest(job, corpus, asdict(net.config), data, by)
    about |= {key: writer.manifest[key] for key in ("motion", "text", "vocabulary")}
    epochs = job.training.epochs
    about["training"] |= {
        "epochs": epochs,
        "kept_epoch": epochs,
        "seconds": round(perf_counter() - began, 1),
        "parameters": parameter_count(net),
        "writer": origin(writer.manifest["training"]),
        **surroundings("cpu"),
    }
    about["settings"] = {**writer.manifest["settings"], **by_feature([learned(tried, job.recipe.visits.sure)])}
    run = Run(about, net)
    run.save(job.folder)
    return run


def _writer_net(writer: Run, corpus: Divided, data: str) -> MotionToLanguage:
    """The net of a run that writes sentences; DataError for another run, or one of other channels than the data's."""
    if not isinstance(writer.model, MotionToLanguage):
        raise DataError("known motions need a run of describe (--writer)")
    if writer.manifest["motion"]["channels"] != list(corpus.contract.channels):
        raise DataError(f"{writer.manifest['name']} describes motions of other channels than those of {data}")
    return writer.model


def _learned_space(store: Store, corpus: Divided, job: Job) -> tuple[JointEmbedding, Known, "Tried"]:
    """The space fitted with everybody and what it knows, and answers of spaces without each group of people."""
    visits = job.recipe.visits
    config = replace(search.config_for(store, corpus, search.DEFAULT), words=0)  # it reads no sentences
    space = JointEmbedding(config).eval()
    space.measure_by(corpus.contract.mean, corpus.contract.std)
    examples = corpus.examples(corpus.parts.train)
    views = search.seen_by(space, examples, visits, job.about.seed, whole=True)
    tried = _tried(corpus, examples, space, views, visits)
    np.savez(job.folder / TRIED, **tried._asdict())
    return space, _known(corpus, examples, space, views, visits.kept), tried


def _known(corpus: Divided, examples: Examples, space: JointEmbedding, views: Views, kept: int) -> Known:
    """Fit a space to some examples; what it then knows. views: of these examples, the last one whole."""
    # disguised views show which differences do not matter, so the whole one is left out
    discriminate(space, replace(views, seen=views.seen[:, :, :-1]))
    vectors = _embedded(space, _kept(views.seen, kept))

    # the action of each motion, then of each mirrored one; what it shows, and sentences about it
    actions = actions_of(corpus.store, examples.records)
    motion_actions = [actions.of[record, mirrored] for mirrored, record in product((False, True), examples.records)]
    shown = _shown_by_actions(corpus.store, actions)
    sentence_actions, sentences = zip(*_clear_sentences(actions, shown), strict=True)
    return Known(
        np.rint(vectors * 127).astype(np.int8),
        np.array(motion_actions, dtype=np.int16),
        _rows(_kind_row, shown, np.uint8),
        sentences,
        np.array(sentence_actions, dtype=np.int16),
        _rows(_named_row, sentences, np.uint8),
        _rows(way_of, sentences, np.int16),
    )


def _rows(row: Callable[[Any], Sequence[int]], things: Iterable[Any], dtype: type[np.integer[Any]]) -> NDArray[Any]:
    """A table with a row for each thing."""
    return np.array(list(map(row, things)), dtype=dtype)


def _shown_by_actions(store: Store, actions: Actions) -> list[Shown]:
    """What each action shows, by its sentences and its title."""
    titles = {action: store.records[record].action for (record, _), action in actions.of.items()}
    return [shown_by(wordings, titles[action]) for action, wordings in enumerate(actions.sentences)]


def _kept(seen: Tensor, count: int) -> Tensor:
    """Of views (M, N, K, S) of motions the first ones and the last: (M N, count + 1, S)."""
    return torch.cat([seen[:, :, :count], seen[:, :, -1:]], dim=2).flatten(0, 1)


@torch.no_grad()
def _embedded(space: JointEmbedding, seen: Tensor) -> Floats:
    """The vectors (..., E) of statistics (..., S) in a space."""
    vectors: Floats = space.embed_statistics(seen).numpy()
    return vectors


def _clear_sentences(actions: Actions, shown: Sequence[Shown]) -> Iterator[tuple[int, str]]:
    """A few clear sentences about each action, with the action."""
    for action, wordings in enumerate(actions.sentences):
        clear = [sentence for sentence in wordings if not _names_both_sides(sentence)] or wordings
        for sentence in careful(clear, shown[action].shown, 3) or clear[:1]:
            yield action, sentence


def _names_both_sides(sentence: str) -> bool:
    """Whether a sentence names left and right, as in "left, right, left"."""
    return {"left", "right"} <= set(NEW_MODEL_RULES.words(sentence))


def _kind_row(shown: Shown) -> list[int]:
    """For each kind 2 if it is shown, 1 if it may be mentioned, else 0."""
    return [2 if kind in shown.shown else int(kind in shown.sayable) for kind in KIND_PATTERNS]


def _named_row(sentence: str) -> list[bool]:
    """For each kind whether a sentence names it."""
    return [kind in named(sentence) for kind in KIND_PATTERNS]


def way_of(sentence: str) -> tuple[int, int, int]:
    """The direction of travel in a sentence, its degrees, 0 for none, and whether it is about locomotion alone."""
    text = " ".join(NEW_MODEL_RULES.words(sentence))
    kinds = named(sentence)
    going = bool(kinds) and kinds <= LOCOMOTION_KINDS

    # a side is that of the path if there is a word of turning, or if the sentence is about nothing but locomotion, as
    # in "walks straight and then continues to the left"
    sides = frozenset(re.findall(r"\b(?:left|right)\b(?! angle)", text))
    of_the_path = re.search(TURNING, text) is not None or (going and not kinds & SIDEWAYS)
    of_a_limb = re.search(r"\b(?:foot|feet|legs?|arms?|hands?|shoulder)\b", text) is not None
    way = GOES_STRAIGHT if re.search(r"\bstraight\b", text) else 0
    if of_the_path and not of_a_limb:
        way = {frozenset({"left"}): GOES_LEFT, frozenset({"right"}): GOES_RIGHT}.get(sides, way)

    # degrees in digits, or a right angle
    digits = re.search(r"\b(\d(?: ?\d)*) degrees?\b", text)
    degrees = 0
    if digits:
        degrees = int(digits[1].replace(" ", ""))
    elif re.search(r"right angle|quarter", text):
        degrees = 90
    return way, min(degrees, 720), int(going)


class Tried(NamedTuple):
    """Answers about motions of held-out people, (N,) each: the share of near motions for which each is right, the
    similarity of the nearest, the group of people, and whether it is right."""

    share: Array
    similarity: Array
    group: NDArray[np.int64]
    right: Mask


def _tried(corpus: Divided, examples: Examples, space: JointEmbedding, views: Views, visits: KnownVisits) -> Tried:
    """The answers of spaces fitted without each group of people about their motions: about each motion as it is, and
    about two views. What nobody performed is in all spaces."""
    entries = [corpus.store.records[record] for record in examples.records]
    shown = [shown_by((*entry.sentences, *entry.unseen), entry.action) for entry in entries]
    groups = grouped([entry.subject for entry in entries], visits.folds)
    answers = []
    for fold in np.unique(groups[groups >= 0]):
        # what a space of the others knows
        others = np.flatnonzero(groups != fold).tolist()
        if not others:
            continue
        part = corpus.examples(tuple(examples.records[row] for row in others))
        known = _known(corpus, part, space, views.only(others), visits.kept)

        # how it answers about the held-out motions
        held_out = np.flatnonzero(groups == fold).tolist()
        for view in (-1, 0, 1):
            vectors = _embedded(space, views.seen[0, held_out, view])
            answers.append(_answered(known, vectors, fold, [shown[row] for row in held_out]))
    return Tried(*map(np.concatenate, zip(*answers, strict=True)))


def _answered(known: Known, vectors: Floats, group: int, shows: Sequence[Shown]) -> Tried:
    """The answers about motions at some places of the space, by what these show."""
    counted, similarity = known.near(vectors)
    shares = known.shares(counted)
    best = shares.argmax(axis=1)
    right = []
    for shown, flags in zip(shows, known.sets[best], strict=True):
        right.append(shown.right_kinds(set(compress(KIND_PATTERNS, flags))))
    best_shares = shares[np.arange(len(best)), best]
    return Tried(best_shares, similarity, np.full(len(best), group), np.array(right, dtype=bool))


def grouped(people: Sequence[str], count: int) -> NDArray[np.int64]:
    """The group (N,) of each motion, from 0 to below ``count``: people whose names are equal up to the first "_" are
    one corpus and stay together; the largest corpora come first, each into the smallest group. -1: nobody's motion."""
    corpora = [name.partition("_")[0] for name in people]
    sizes = [0] * count
    groups = {KEYED: -1}
    for corpus in sorted(set(corpora) - {KEYED}, key=lambda corpus: (-corpora.count(corpus), corpus)):
        groups[corpus] = sizes.index(min(sizes))
        sizes[groups[corpus]] += corpora.count(corpus)
    return np.array([groups[corpus] for corpus in corpora], dtype=np.int64)


def learned(tried: Tried, sure: float) -> AnswerSettings:
    """The probability of answers (logistic regression with groups weighted by the root of their size), the probability
    from which a share of ``sure`` is right, and the 1st percentile of the similarity. The defaults for too few answers,
    or if all are right or all wrong.

    Files of other people are like the most difficult group: the bound is the highest of all groups.
    """
    from sklearn.linear_model import LogisticRegression

    if len(tried.right) < 50 or tried.right.all() or not tried.right.any():
        return AnswerSettings()
    # from the share of near motions to a probability
    odds = log_odds(tried.share)[:, None]
    sizes = np.bincount(tried.group)[tried.group]
    weights = np.sqrt(len(sizes) / sizes)
    regression = LogisticRegression(C=10.0, max_iter=1000).fit(odds, tried.right, sample_weight=weights)
    return AnswerSettings(
        bias=round(float(regression.intercept_[0]), 4),
        share=round(float(regression.coef_[0, 0]), 4),
        sure=round(_sure_from(tried, regression.predict_proba(odds)[:, 1], sure), 4),
        outside=round(float(np.percentile(tried.similarity, 1)), 4),
    )


def _sure_from(tried: Tried, probabilities: Array, sure: float) -> float:
    """The probability from which a share of ``sure`` is right in every group that has such; 1 if none has."""
    bounds = []
    for group in set(tried.group):
        rows = tried.group == group
        bounds += _lowest(probabilities[rows], tried.right[rows], sure)
    return max(bounds, default=1.0)


def _lowest(probabilities: Array, right: Mask, wanted: float) -> list[float]:
    """The lowest probability at and above which the wanted share of answers is right, if there is one."""
    order = np.argsort(-probabilities, kind="stable")
    precision = np.cumsum(right[order]) / np.arange(1, len(order) + 1)
    good = np.flatnonzero(precision[19:] >= wanted) + 19  # fewer than 20 answers prove nothing
    lowest: list[float] = probabilities[order[good[-1:]]].tolist()
    return lowest
