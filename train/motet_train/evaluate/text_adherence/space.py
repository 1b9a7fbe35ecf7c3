"""Motions and prompts in the space of a search model: whose prompt is found, and how far from recorded ones they are.

The two measures of text-to-motion (Guo et al. 2022, "Generating diverse and natural 3D human motions from text",
section 5), with the space of a model of :class:`SearchModel` in the place of theirs.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.stats import hypergeom

from motet.bundle.graph import Floats
from motet.models.search import SearchModel, direction
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet_train.evaluate.language.split_store import unknown_words_allowed
from motet_train.evaluate.tables import Report
from motet_train.evaluate.text_adherence.prompts import SHORTEST_MOTION, Prompt, Trial, actions

CHOICES = 32
"""Prompts among which a motion's own is to be found."""

Vectors = Mapping[str, Floats]
"""The text of a prompt -> vectors (N, E) of motions, as :func:`embedded` gives them."""


def space_report(
    model: SearchModel, asked: Sequence[Prompt], made: Mapping[str, Vectors], trials: Sequence[Trial]
) -> Report:
    """R-precision, and with trials the Frechet distances from them.

    made: "" for the generator and "_lookup" for the look-up -> the motions for every prompt.
    "r_precision": the share of motions whose own prompt is the nearest, among the two, the three nearest, of
        :data:`CHOICES`; the mean over prompts, 0 for a prompt without motions. "_lookup" the same of the look-up,
        "_real" of the trials that show the prompt.
    "frechet": between the trials that show any of the prompts and the generator's motions for prompts that a trial
        shows; the same for the look-up; and between two halves of these trials, drawn at random. "_motions" are how
        many of each there are.
    """
    with unknown_words_allowed():
        texts = model.embed_text([prompt.text for prompt in asked])
    seen = embedded(model, [trial.motion for trial in trials])
    shown = {prompt.text: [i for i, trial in enumerate(trials) if trial.shows(prompt)] for prompt in asked}
    shown = {text: rows for text, rows in shown.items() if rows}
    real = {"_real": {text: seen[rows] for text, rows in shown.items()}} if shown else {}
    report = {f"r_precision{kind}": _precisions(found, asked, texts) for kind, found in (*made.items(), *real.items())}
    if shown:
        sets = {
            kind.strip("_") or "generated": np.concatenate([vectors[text] for text in shown])
            for kind, vectors in made.items()
        }
        sets["trials"] = seen[sorted({row for rows in shown.values() for row in rows})]
        usable = {name: vectors[np.isfinite(vectors).all(axis=1)] for name, vectors in sets.items()}
        trials_seen = usable["trials"]
        order = np.random.default_rng(0).permutation(len(trials_seen))
        report["frechet"] = {
            **{name: frechet(vectors, trials_seen) for name, vectors in usable.items() if name != "trials"},
            "halves": frechet(trials_seen[order[::2]], trials_seen[order[1::2]]),
            **{f"{name}_motions": float(len(vectors)) for name, vectors in usable.items()},
        }
    return report


def embedded(model: SearchModel, motions: Sequence[Motion]) -> Floats:
    """The directions (N, E) of motions, NaN for one that is shorter than :data:`SHORTEST_MOTION`; MotionError as
    :func:`direction` for others that the model cannot take."""
    nothing = np.full(model.sizes["E"], np.nan, np.float32)
    found = [direction(model, motion) if motion.duration >= SHORTEST_MOTION else nothing for motion in motions]
    return np.array(found, np.float32).reshape(-1, len(nothing))


def rivals(asked: Sequence[Prompt]) -> list[list[int]]:
    """For each prompt the indices of those that ask for something else: no recorded action shows one of the two and
    may show the other."""
    names = set(actions().values())
    shown = [{name for name in names if prompt.shows(name)} for prompt in asked]
    may = [{name for name in names if prompt.shows(name) is not False} for prompt in asked]

    def differ(one: int, other: int) -> bool:
        return one != other and shown[one].isdisjoint(may[other]) and shown[other].isdisjoint(may[one])

    return [[other for other in range(len(asked)) if differ(one, other)] for one in range(len(asked))]


def r_precision(own: Array, others: Array) -> dict[str, float]:
    """R-precision by the similarity of motions to their own prompt (N,) and to each of its rivals (N, K).

    Guo et al. draw 31 rivals for each motion. This is the mean over all draws, so nothing depends on a seed: with b of
    K rivals nearer than the own prompt, or as near, the number of those that are drawn is hypergeometric. With fewer
    rivals all are drawn; NaN with none. Motions without a vector (NaN) find nothing, nor do no motions.
    """
    tops, count = (1, 2, 3), others.shape[1]
    if not count:
        return {str(top): np.nan for top in tops}
    nearer = (~(own[:, None] > others)).sum(axis=1)
    drawn = hypergeom(count, nearer, min(CHOICES - 1, count))
    return {str(top): float(drawn.cdf(top - 1).mean()) if len(nearer) else 0.0 for top in tops}


def frechet(one: Floats, other: Floats) -> float:
    """The squared Frechet distance between Gaussians of the mean and covariance of vectors (N, E) and (M, E).

    |m - n|^2 + tr S + tr T - 2 tr (S T)^1/2 (Dowson and Landau 1982; Heusel et al. 2017). With S = A'A and T = B'B of
    the centred vectors, the last trace is the sum of the singular values of A B', so no root of a matrix is needed and
    the plain definition holds for fewer vectors than dimensions, too: nothing is shrunk. Fewer vectors make it larger:
    compare distances of about as many. NaN for less than two vectors.
    """
    if min(len(one), len(other)) < 2:
        return np.nan
    m, n = (vectors.mean(axis=0, dtype=np.float64) for vectors in (one, other))
    a, b = (one - m) / np.sqrt(len(one) - 1), (other - n) / np.sqrt(len(other) - 1)
    return float(((m - n) ** 2).sum() + (a**2).sum() + (b**2).sum() - 2 * np.linalg.norm(a @ b.T, "nuc"))


def _precisions(vectors: Vectors, asked: Sequence[Prompt], texts: Floats) -> dict[str, float]:
    """The means over the prompts that there are vectors for."""
    rows = []
    for own, (prompt, others) in enumerate(zip(asked, rivals(asked), strict=True)):
        if prompt.text in vectors:
            scores = (vectors[prompt.text] @ texts.T).astype(np.float64)
            rows.append(r_precision(scores[:, own], scores[:, others]))
    return {key: float(np.mean([row[key] for row in rows])) for key in rows[0]}
