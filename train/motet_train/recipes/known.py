"""The recipe of the known motions that answer for describe: which they are, and how sure their answers can be.

The probability that an answer is right is learned from people who are kept back, those of one corpus together: on their
motions, spaces that have never seen them answer. The space that is kept then knows everybody.
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
from motet_train.recipes.recipe import Job, Recipe
from motet_train.runs import Run, surroundings


@dataclass(frozen=True)
class KnownVisits(search.SearchVisits):
    """kept: of the views of each motion, how many are known, beside the whole motion. folds: into how many groups
    people are divided to learn how sure answers are. sure: how often an answer that is trusted is to be right."""

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
"""Of a run: the answers about people kept back that their probability was learned from."""

TURNING = r"(?<!in )\b(?:turn|veer|swerv|curv|corner|bend|angl|circl|spin|rotat|pivot|diagonal|head|cut|chang|off to)"
"""Beginnings of words of a path that is not straight."""

GOING = frozenset({"walk", "run", "skip", "backwards", "turn", "jump", "carry", "sidestep"})
"""Kinds of going, of which it is worth telling where to."""

SIDEWAYS = frozenset({"sidestep", "jump"})
"""Kinds of going to a side without turning there."""


def train_known(store: Store, job: Job, data: str, by: str, writer: Run) -> Run:
    """Gather the known motions of a store, for the run of a net that writes sentences, of the same channels. DataError
    where it is not."""
    began, visits = perf_counter(), job.recipe.visits
    found = divided(store, mirror=True, by=by)
    if not isinstance(writer.model, MotionToLanguage):
        raise DataError("known motions need a run of describe (--writer)")
    if writer.manifest["motion"]["channels"] != list(found.contract.channels):
        raise DataError(f"{writer.manifest['name']} describes motions of other channels than those of {data}")
    config = replace(search.config_for(store, found, search.DEFAULT), words=0)  # it reads no sentences
    space = JointEmbedding(config).eval()
    space.measure_by(found.contract.mean, found.contract.std)
    examples = found.examples(found.parts.train)
    seen = search.seen_by(space, examples, visits, job.about.seed, whole=True)
    tried = _tried(found, examples, space, seen, visits)
    discriminate(space, _cut(seen))
    known = _gathered(found, examples, space, seen, visits.kept)
    np.savez(job.folder / TRIED, **tried._asdict())
    settings = learned(tried, visits.sure)
    net = KnownMotions.of(writer.model, space, known)
    about = manifest(job, found, asdict(net.config), data, by)
    about |= {key: writer.manifest[key] for key in ("motion", "text", "vocabulary")}
    about["training"] |= {
        "epochs": job.training.epochs,
        "kept_epoch": job.training.epochs,
        "seconds": round(perf_counter() - began, 1),
        "parameters": sum(one.numel() for one in net.parameters()),
        "writer": _made(writer),
        **surroundings("cpu"),
    }
    about["settings"] = {**writer.manifest["settings"], settings.FEATURE: asdict(settings)}
    run = Run(about, net)
    run.save(job.folder)
    return run


def _made(run: Run) -> dict[str, object]:
    kept = ("command", "seed", "epochs", "seconds")
    return {key: run.manifest["training"][key] for key in kept if key in run.manifest["training"]}


def _gathered(found: Divided, examples: Examples, space: JointEmbedding, seen: Views, kept: int) -> Known:
    """What is known of some examples. seen: their views, the last one whole."""
    actions = actions_of(found.store, examples.records)
    titles = {actions.of[r, m]: found.store.records[r].action for r in examples.records for m in (False, True)}
    shows = [shown_by(said, titles[action]) for action, said in enumerate(actions.sentences)]
    kinds, sentences, said = list(KINDS), list[str](), list[int]()
    for action, wordings in enumerate(actions.sentences):
        clear = [one for one in wordings if {"left", "right"} - {*RULES.words(one)}] or wordings  # "left, right, left"
        kept_here = careful(clear, shows[action].shown, 3) or list(clear[:1])
        sentences += kept_here
        said += [action] * len(kept_here)
    shown = [[2 if kind in one.shown else int(kind in one.sayable) for kind in kinds] for one in shows]
    with torch.no_grad():
        views = torch.cat([seen.seen[:, :, :kept], seen.seen[:, :, -1:]], dim=2)
        vectors = space.embed_statistics(views).flatten(0, 1).numpy()
    of = [actions.of[record, mirrored] for mirrored in (False, True) for record in examples.records]
    return Known(
        np.rint(vectors * 127).astype(np.int8),
        np.array(of, dtype=np.int16),
        np.array(shown, dtype=np.uint8),
        tuple(sentences),
        np.array(said, dtype=np.int16),
        np.array([[kind in named(one) for kind in kinds] for one in sentences], dtype=np.uint8),
        np.array([way_of(one) for one in sentences], dtype=np.int16),
    )


def way_of(sentence: str) -> tuple[int, int, int]:
    """Where a sentence says that somebody goes, the degrees that it gives, 0 for none, and whether it is about going
    alone."""
    text = " ".join(RULES.words(sentence))
    kinds = named(sentence)
    going = bool(kinds) and kinds <= GOING

    # a side is that of the path where a word of turning says so, or where the sentence is about nothing but going:
    # "walks straight and then continues to the left"
    sides = frozenset(re.findall(r"\b(?:left|right)\b(?! angle)", text))
    of_the_path = re.search(TURNING, text) is not None or (going and not kinds & SIDEWAYS)
    of_a_limb = re.search(r"\b(?:foot|feet|legs?|arms?|hands?|shoulder)\b", text) is not None
    way = STRAIGHT if re.search(r"\bstraight\b", text) else 0
    if of_the_path and not of_a_limb:
        way = {frozenset({"left"}): LEFT, frozenset({"right"}): RIGHT}.get(sides, way)

    digits = re.search(r"\b(\d(?: ?\d)*) degrees?\b", text)
    degrees = int(digits[1].replace(" ", "")) if digits else 90 if re.search(r"right angle|quarter", text) else 0
    return way, min(degrees, 720), int(going)


class Tried(NamedTuple):
    """Answers about motions of people kept back: the share of near motions that each is right about, the similarity of
    the nearest, the group of people, and whether it is right, (N,) each."""

    share: NDArray[np.float64]
    similarity: NDArray[np.float64]
    group: NDArray[np.int64]
    right: NDArray[np.bool_]


def _tried(found: Divided, examples: Examples, space: JointEmbedding, seen: Views, visits: KnownVisits) -> Tried:
    """For each group of people what spaces that never saw them answer about them: about each motion as it is, and
    about two views."""
    entries, tried = [found.store.records[record] for record in examples.records], []
    shows = [shown_by((*entry.sentences, *entry.unseen), entry.action) for entry in entries]
    groups = grouped([entry.subject for entry in entries], visits.folds)
    for fold in range(groups.max() + 1):
        rest, kept_back = (np.flatnonzero(rows).tolist() for rows in (groups != fold, groups == fold))
        if not rest or not kept_back:
            continue
        mine = seen.only(rest)
        discriminate(space, _cut(mine))
        part = found.examples(tuple(examples.records[row] for row in rest))
        known = _gathered(found, part, space, mine, visits.kept)
        for view in (-1, 0, 1):
            with torch.no_grad():
                vectors = space.embed_statistics(seen.seen[0, kept_back, view]).numpy()
            tried.append(_answered(known, vectors, fold, [shows[row] for row in kept_back]))
    return Tried(*map(np.concatenate, zip(*tried, strict=True)))


def _cut(seen: Views) -> Views:
    """Without the last view, of whole motions: those that are disguised tell what does not matter."""
    return replace(seen, seen=seen.seen[:, :, :-1])


def _answered(known: Known, vectors: Floats, group: int, shows: Sequence[Shown]) -> Tried:
    """What is answered about motions at some places of the space, of which is known what they show."""
    counted, alike = known.near(vectors)
    shares = known.shares(counted)
    best, right = shares.argmax(axis=1), []
    for shown, names in zip(shows, known.sets[best], strict=True):
        kinds = {kind for kind, named in zip(KINDS, names, strict=True) if named}
        right.append(shown.right_kinds(kinds))
    said = shares[np.arange(len(best)), best]
    return Tried(said, alike, np.full(len(best), group), np.array(right, dtype=bool))


def grouped(people: Sequence[str], count: int) -> NDArray[np.int64]:
    """The group of each motion (N,), 0 to at most ``count``: people whose names begin alike, up to the first "_", are
    one corpus and together; the largest come first, each into the smallest group."""
    corpora = [name.partition("_")[0] for name in people]
    sizes, of = [0] * count, dict[str, int]()
    for corpus in sorted(set(corpora), key=lambda one: (-corpora.count(one), one)):
        of[corpus] = sizes.index(min(sizes))
        sizes[of[corpus]] += corpora.count(corpus)
    return np.array([of[corpus] for corpus in corpora], dtype=np.int64)


def learned(tried: Tried, sure: float) -> AnswerSettings:
    """How probable answers are (logistic regression, in which each group counts as the root of its size), from which
    probability on so many of them are right, and the similarity that one in a hundred motions does not have. The
    defaults where there are too few answers or all are alike.

    Other people's files are like the group that is hardest to tell: the bound is the highest of the groups'.
    """
    from sklearn.linear_model import LogisticRegression

    if len(tried.right) < 50 or tried.right.all() or not tried.right.any():
        return AnswerSettings()
    odds, sizes = log_odds(tried.share)[:, None], np.bincount(tried.group)[tried.group]
    weights = np.sqrt(len(sizes) / sizes)
    fitted = LogisticRegression(C=10.0, max_iter=1000).fit(odds, tried.right, sample_weight=weights)
    chances = fitted.predict_proba(odds)[:, 1]
    bounds = [_least(chances[rows], tried.right[rows], sure) for rows in (tried.group == g for g in set(tried.group))]
    reached = [one for one in bounds if one is not None]
    return AnswerSettings(
        bias=round(float(fitted.intercept_[0]), 4),
        share=round(float(fitted.coef_[0, 0]), 4),
        sure=round(max(reached, default=1.0), 4),
        outside=round(float(np.percentile(tried.similarity, 1)), 4),
    )


def _least(chances: NDArray[np.float64], right: NDArray[np.bool_], wanted: float) -> float | None:
    """The least probability at and above which the wanted share of answers is right; None where there is none."""
    order = np.argsort(-chances, kind="stable")
    precision = np.cumsum(right[order]) / np.arange(1, len(order) + 1)
    good = np.flatnonzero(precision[19:] >= wanted) + 19  # of fewer than 20 nothing is learned
    return float(chances[order[good[-1]]]) if len(good) else None
