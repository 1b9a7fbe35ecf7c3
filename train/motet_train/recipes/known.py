"""The recipe of the known motions behind the answers of describe: which they are, and how sure their answers can be.

The probability that an answer is right is learned on held-out people, those of one corpus together: spaces that were
fitted without them answer about their motions. The final space is then fitted with everybody.
"""

import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields, replace
from time import perf_counter
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from motet.bundle.graph import Floats
from motet.models.nearest_neighbour import LEFT, RIGHT, STRAIGHT, AnswerSettings, Known, log_odds
from motet.text.vocabulary import RULES
from motet_train.data.batches import Examples, Views
from motet_train.data.errors import DataError
from motet_train.data.kinds import KINDS, Shown, careful, named, shown_by
from motet_train.data.sentences import actions_of
from motet_train.data.store import Store
from motet_train.models.discriminant import discriminate
from motet_train.models.joint_embedding import JointEmbedding, JointEmbeddingConfig
from motet_train.models.known_motions import KnownMotions, KnownMotionsConfig
from motet_train.models.motion_to_language import MotionToLanguage, MotionToLanguageConfig
from motet_train.recipes import language, search
from motet_train.recipes.language import Divided, divided, manifest
from motet_train.recipes.recipe import Job, Recipe, origin
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

GOING = frozenset({"walk", "run", "skip", "backwards", "turn", "jump", "carry", "sidestep"})
"""Kinds of locomotion, whose direction is worth mentioning."""

SIDEWAYS = frozenset({"sidestep", "jump"})
"""Kinds of locomotion to a side without turning there."""


def train_known(store: Store, job: Job, data: str, by: str, writer: Run) -> Run:
    """Gather the known motions of a store, for the run of a net that writes sentences; DataError unless it has the
    store's channels."""
    began = perf_counter()
    visits = job.recipe.visits
    corpus = divided(store, mirror=True, by=by)
    if not isinstance(writer.model, MotionToLanguage):
        raise DataError("known motions need a run of describe (--writer)")
    if writer.manifest["motion"]["channels"] != list(corpus.contract.channels):
        raise DataError(f"{writer.manifest['name']} describes motions of other channels than those of {data}")

    # the space, first without each group of people, then with all
    config = replace(search.config_for(store, corpus, search.DEFAULT), words=0)  # it reads no sentences
    space = JointEmbedding(config).eval()
    space.measure_by(corpus.contract.mean, corpus.contract.std)
    examples = corpus.examples(corpus.parts.train)
    views = search.seen_by(space, examples, visits, job.about.seed, whole=True)
    tried = _tried(corpus, examples, space, views, visits)
    discriminate(space, _without_whole(views))
    known = _gathered(corpus, examples, space, views, visits.kept)
    np.savez(job.folder / TRIED, **tried._asdict())
    settings = learned(tried, visits.sure)

    net = KnownMotions.of(writer.model, space, known)
    about = manifest(job, corpus, asdict(net.config), data, by)
    about |= {key: writer.manifest[key] for key in ("motion", "text", "vocabulary")}
    about["training"] |= {
        "epochs": job.training.epochs,
        "kept_epoch": job.training.epochs,
        "seconds": round(perf_counter() - began, 1),
        "parameters": sum(parameter.numel() for parameter in net.parameters()),
        "writer": origin(writer.manifest["training"]),
        **surroundings("cpu"),
    }
    about["settings"] = {**writer.manifest["settings"], settings.FEATURE: asdict(settings)}
    run = Run(about, net)
    run.save(job.folder)
    return run


def _gathered(corpus: Divided, examples: Examples, space: JointEmbedding, views: Views, kept: int) -> Known:
    """The known motions of some examples. views: of these, the last one whole."""
    actions = actions_of(corpus.store, examples.records)
    titles = {}
    motion_actions = []
    for mirrored in (False, True):
        for record in examples.records:
            action = actions.of[record, mirrored]
            titles[action] = corpus.store.records[record].action
            motion_actions.append(action)

    # what each action shows, and a few clear sentences about it
    shown = [shown_by(wordings, titles[action]) for action, wordings in enumerate(actions.sentences)]
    sentences: list[str] = []
    sentence_actions: list[int] = []
    for action, wordings in enumerate(actions.sentences):
        clear = [sentence for sentence in wordings if not _names_both_sides(sentence)] or wordings
        kept_sentences = careful(clear, shown[action].shown, 3) or list(clear[:1])
        sentences += kept_sentences
        sentence_actions += [action] * len(kept_sentences)

    with torch.no_grad():
        kept_views = torch.cat([views.seen[:, :, :kept], views.seen[:, :, -1:]], dim=2)
        vectors = space.embed_statistics(kept_views).flatten(0, 1).numpy()
    return Known(
        np.rint(vectors * 127).astype(np.int8),
        np.array(motion_actions, dtype=np.int16),
        np.array([_kind_row(action_shown) for action_shown in shown], dtype=np.uint8),
        tuple(sentences),
        np.array(sentence_actions, dtype=np.int16),
        np.array([[kind in named(sentence) for kind in KINDS] for sentence in sentences], dtype=np.uint8),
        np.array([way_of(sentence) for sentence in sentences], dtype=np.int16),
    )


def _names_both_sides(sentence: str) -> bool:
    """Whether a sentence names left and right, as in "left, right, left"."""
    return {"left", "right"} <= set(RULES.words(sentence))


def _kind_row(shown: Shown) -> list[int]:
    """For each kind 2 if it is shown, 1 if it may be mentioned, else 0."""
    return [2 if kind in shown.shown else int(kind in shown.sayable) for kind in KINDS]


def way_of(sentence: str) -> tuple[int, int, int]:
    """The direction of travel in a sentence, its degrees, 0 for none, and whether it is about locomotion alone."""
    text = " ".join(RULES.words(sentence))
    kinds = named(sentence)
    going = bool(kinds) and kinds <= GOING

    # a side is that of the path if there is a word of turning, or if the sentence is about nothing but locomotion, as
    # in "walks straight and then continues to the left"
    sides = frozenset(re.findall(r"\b(?:left|right)\b(?! angle)", text))
    of_the_path = re.search(TURNING, text) is not None or (going and not kinds & SIDEWAYS)
    of_a_limb = re.search(r"\b(?:foot|feet|legs?|arms?|hands?|shoulder)\b", text) is not None
    way = STRAIGHT if re.search(r"\bstraight\b", text) else 0
    if of_the_path and not of_a_limb:
        way = {frozenset({"left"}): LEFT, frozenset({"right"}): RIGHT}.get(sides, way)

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

    share: NDArray[np.float64]
    similarity: NDArray[np.float64]
    group: NDArray[np.int64]
    right: NDArray[np.bool_]


def _tried(corpus: Divided, examples: Examples, space: JointEmbedding, views: Views, visits: KnownVisits) -> Tried:
    """The answers of spaces fitted without each group of people about their motions: about each motion as it is, and
    about two views."""
    entries = [corpus.store.records[record] for record in examples.records]
    shown = [shown_by((*entry.sentences, *entry.unseen), entry.action) for entry in entries]
    groups = grouped([entry.subject for entry in entries], visits.folds)
    answers = []
    for fold in range(groups.max() + 1):
        others = np.flatnonzero(groups != fold).tolist()
        held_out = np.flatnonzero(groups == fold).tolist()
        if not others or not held_out:
            continue

        # a space of the others, and what it knows
        other_views = views.only(others)
        discriminate(space, _without_whole(other_views))
        part = corpus.examples(tuple(examples.records[row] for row in others))
        known = _gathered(corpus, part, space, other_views, visits.kept)

        # its answers about the held-out motions: whole, and two views
        for view in (-1, 0, 1):
            with torch.no_grad():
                vectors = space.embed_statistics(views.seen[0, held_out, view]).numpy()
            answers.append(_answered(known, vectors, fold, [shown[row] for row in held_out]))
    return Tried(*map(np.concatenate, zip(*answers, strict=True)))


def _without_whole(views: Views) -> Views:
    """Without the last view, of whole motions: disguised ones show which differences do not matter."""
    return replace(views, seen=views.seen[:, :, :-1])


def _answered(known: Known, vectors: Floats, group: int, shows: Sequence[Shown]) -> Tried:
    """The answers about motions at some places of the space, by what these show."""
    counted, similarity = known.near(vectors)
    shares = known.shares(counted)
    best = shares.argmax(axis=1)
    right = []
    for shown, flags in zip(shows, known.sets[best], strict=True):
        kinds = {kind for kind, in_answer in zip(KINDS, flags, strict=True) if in_answer}
        right.append(shown.right_kinds(kinds))
    best_shares = shares[np.arange(len(best)), best]
    return Tried(best_shares, similarity, np.full(len(best), group), np.array(right, dtype=bool))


def grouped(people: Sequence[str], count: int) -> NDArray[np.int64]:
    """The group (N,) of each motion, from 0 to below ``count``: people whose names are equal up to the first "_" are
    one corpus and stay together; the largest corpora come first, each into the smallest group."""
    corpora = [name.partition("_")[0] for name in people]
    sizes = [0] * count
    groups = {}
    for corpus in sorted(set(corpora), key=lambda corpus: (-corpora.count(corpus), corpus)):
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
    odds = log_odds(tried.share)[:, None]
    sizes = np.bincount(tried.group)[tried.group]
    weights = np.sqrt(len(sizes) / sizes)
    regression = LogisticRegression(C=10.0, max_iter=1000).fit(odds, tried.right, sample_weight=weights)
    probabilities = regression.predict_proba(odds)[:, 1]
    bounds = []
    for group in set(tried.group):
        rows = tried.group == group
        bound = _lowest(probabilities[rows], tried.right[rows], sure)
        if bound is not None:
            bounds.append(bound)
    return AnswerSettings(
        bias=round(float(regression.intercept_[0]), 4),
        share=round(float(regression.coef_[0, 0]), 4),
        sure=round(max(bounds, default=1.0), 4),
        outside=round(float(np.percentile(tried.similarity, 1)), 4),
    )


def _lowest(probabilities: NDArray[np.float64], right: NDArray[np.bool_], wanted: float) -> float | None:
    """The lowest probability at and above which the wanted share of answers is right; None without one."""
    order = np.argsort(-probabilities, kind="stable")
    precision = np.cumsum(right[order]) / np.arange(1, len(order) + 1)
    good = np.flatnonzero(precision[19:] >= wanted) + 19  # fewer than 20 answers prove nothing
    return float(probabilities[order[good[-1]]]) if len(good) else None
