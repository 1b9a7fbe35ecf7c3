"""The recipe of the known motions that answer for describe: which they are, and how sure their answers can be.

The probability that an answer is right is learned from people who are kept back, those of one corpus together: on their
motions, spaces that have never seen them answer. Their own space then knows everybody.
"""

import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from motet.bundle.graph import Floats
from motet.models.known import LEFT, RIGHT, STRAIGHT, AnswerSettings, Known, log_odds
from motet.models.language import RULES
from motet_train.data.batches import Examples, Views
from motet_train.data.errors import DataError
from motet_train.data.kinds import KINDS, Shown, careful, named, shown_by
from motet_train.data.sentences import actions_of
from motet_train.data.store import Store
from motet_train.models.joint_embedding import JointEmbedding, JointEmbeddingConfig
from motet_train.models.known_motions import KnownMotions, KnownMotionsConfig
from motet_train.models.motion_to_language import MotionToLanguage, MotionToLanguageConfig
from motet_train.recipes import language, search
from motet_train.recipes.language import Divided, divided, manifest
from motet_train.recipes.recipe import Job, Recipe
from motet_train.runs import Run, surroundings
from motet_train.trainer import train


@dataclass(frozen=True)
class KnownVisits(search.SearchVisits):
    """kept: of the views of each motion, how many are known, beside the whole motion. folds: into how many groups
    people are divided to learn how sure answers are. sure: how often an answer that is trusted is to be right."""

    kept: int = 4
    folds: int = 3
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

GOING = frozenset({"walk", "run", "skip", "backwards", "turn", "jump", "carry", "sidestep"})
"""Kinds of going, of which it is worth telling where to."""


def train_known(store: Store, job: Job, data: str, by: str, writer: Run, space: Run) -> Run:
    """Gather the known motions of a store, for the runs of a net that writes sentences, of the same channels, and of a
    space that was trained on the same store and split. DataError where they are not."""
    began, visits = perf_counter(), job.recipe.visits
    found = divided(store, mirror=True, by=by)
    if not isinstance(writer.model, MotionToLanguage) or not isinstance(space.model, JointEmbedding):
        raise DataError("known motions need a run of describe (--writer) and one of search (--space)")
    if space.manifest["vocabulary"] != list(found.vocabulary.words):
        raise DataError(f"{space.manifest['name']} was trained on other sentences: use the same data and split")
    if writer.manifest["motion"]["channels"] != list(found.contract.channels):
        raise DataError(f"{writer.manifest['name']} describes motions of other channels than those of {data}")
    space.model.eval()
    examples = found.examples(found.parts.train)
    seen = search.seen_by(space.model, examples, visits, job.about.seed, whole=True)
    known = _gathered(found, examples, space.model, seen, visits.kept)
    tried = _tried(job, found, examples, space.model, seen)
    np.savez(job.folder / TRIED, **tried._asdict())
    settings = learned(tried, visits.sure)
    net = KnownMotions.of(writer.model, space.model, known)
    about = manifest(job, found, asdict(net.config), data, by)
    about |= {key: writer.manifest[key] for key in ("motion", "text", "vocabulary")}
    about["training"] |= {
        "epochs": job.training.epochs,
        "kept_epoch": job.training.epochs,
        "seconds": round(perf_counter() - began, 1),
        "parameters": sum(one.numel() for one in net.parameters()),
        "writer": _made(writer),
        "space": _made(space),
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
        kept_here = careful(wordings, shows[action].shown, 3) or list(wordings[:1])
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
    text, kinds = " ".join(RULES.words(sentence)), named(sentence)
    turns = re.search(r"(?<!in )\b(?:turn|veer|swerv|curv|corner|bend|angl|circl|spin|rotat)", text)
    sides = frozenset(re.findall(r"\b(?:left|right)\b(?! angle)", text))
    way = STRAIGHT if re.search(r"\bstraight\b", text) else 0
    if turns and not re.search(r"\b(?:foot|feet|legs?|arms?|hands?|shoulder)\b", text):
        way = {frozenset({"left"}): LEFT, frozenset({"right"}): RIGHT}.get(sides, way)
    digits = re.search(r"\b(\d(?: ?\d)*) degrees?\b", text)
    degrees = int(digits[1].replace(" ", "")) if digits else 90 if re.search(r"right angle|quarter", text) else 0
    return way, min(degrees, 720), int(bool(kinds) and kinds <= GOING)


class Tried(NamedTuple):
    """Answers about motions of people kept back: the share of near motions that each is right about, the similarity of
    the nearest, the length in seconds, and whether it is right, (N,) each."""

    share: NDArray[np.float64]
    similarity: NDArray[np.float64]
    seconds: NDArray[np.float64]
    right: NDArray[np.bool_]


def _tried(job: Job, found: Divided, examples: Examples, space: JointEmbedding, seen: Views) -> Tried:
    """For each group of people what spaces that never saw them answer about them: about each motion as it is, and
    about two views."""
    entries, tried = [found.store.records[record] for record in examples.records], []
    shows = [shown_by((*entry.sentences, *entry.unseen), entry.action) for entry in entries]
    groups = grouped([entry.subject for entry in entries], job.recipe.visits.folds)
    for fold in range(groups.max() + 1):
        rest, kept_back = (np.flatnonzero(rows).tolist() for rows in (groups != fold, groups == fold))
        if not rest or not kept_back:
            continue
        mine = seen.only(rest)
        net = _space_like(space, job, replace(mine, seen=mine.seen[:, :, :-1]))
        part = found.examples(tuple(examples.records[row] for row in rest))
        known = _gathered(found, part, net, mine, job.recipe.visits.kept)
        for view in (-1, 0, 1):
            with torch.no_grad():
                vectors = net.embed_statistics(seen.seen[0, kept_back, view]).numpy()
            seconds = seen.frames[kept_back, view] / found.store.fps
            tried.append(_answered(known, vectors, seconds, [shows[row] for row in kept_back]))
    return Tried(*map(np.concatenate, zip(*tried, strict=True)))


def _answered(known: Known, vectors: Floats, seconds: NDArray[np.float64], shows: Sequence[Shown]) -> Tried:
    """What is answered about motions at some places of the space, of which is known what they show."""
    counted, alike = known.near(vectors)
    shares = known.shares(counted)
    best, right = shares.argmax(axis=1), []
    for shown, names in zip(shows, known.sets[best], strict=True):
        kinds = {kind for kind, named in zip(KINDS, names, strict=True) if named}
        right.append(shown.right_kinds(kinds))
    return Tried(shares[np.arange(len(best)), best], alike, seconds, np.array(right, dtype=bool))


def _space_like(space: JointEmbedding, job: Job, seen: Views) -> JointEmbedding:
    """A space as another, trained on other views."""
    torch.manual_seed(job.about.seed)
    net = JointEmbedding(space.config)
    net.mean, net.scale = space.mean.clone(), space.scale.clone()
    with TemporaryDirectory() as folder:
        train(search.space_learner(net, job.training, seen), job.about.seed, Path(folder))
    return net.eval()


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
    """How probable answers are (logistic regression), from which probability on so many of them are right, and the
    similarity that one in a hundred motions does not have. The defaults where there are too few answers or all are
    alike.

    What is nearer is never taken to be less probable: a weight below 0 would trust what is far from all that is known.
    """
    from sklearn.linear_model import LogisticRegression

    if len(tried.right) < 50 or tried.right.all() or not tried.right.any():
        return AnswerSettings()
    columns = [log_odds(tried.share), tried.similarity, np.log(np.maximum(tried.seconds, 0.1))]
    fit = LogisticRegression(C=10.0, max_iter=1000).fit
    fitted = fit(np.column_stack(columns), tried.right)
    if fitted.coef_[0, 1] < 0:
        columns[1] = np.zeros_like(columns[1])
        fitted = fit(np.column_stack(columns), tried.right)
    share, similarity, length = (round(float(one), 4) for one in fitted.coef_[0])
    bias = round(float(fitted.intercept_[0]), 4)
    chances = fitted.predict_proba(np.column_stack(columns))[:, 1]
    limits = AnswerSettings(bias=bias, share=share, similarity=similarity, length=length)
    outside = round(float(np.percentile(tried.similarity, 1)), 4)
    return replace(limits, sure=_least(chances, tried.right, sure), outside=outside)


def _least(chances: NDArray[np.float64], right: NDArray[np.bool_], wanted: float) -> float:
    """The least probability at and above which the wanted share of answers is right; 1 where there is none."""
    order = np.argsort(-chances, kind="stable")
    precision = np.cumsum(right[order]) / np.arange(1, len(order) + 1)
    good = np.flatnonzero(precision[19:] >= wanted) + 19  # of fewer than 20 nothing is learned
    return round(float(chances[order[good[-1]]]), 4) if len(good) else 1.0
