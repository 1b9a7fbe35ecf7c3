"""Does what it says: every prompt asked with several seeds, beside recorded trials and the look-up; whose prompt is
found in the space of a search model, and how far from recorded motions those made are."""

from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure
from scipy.stats import hypergeom
from tqdm import tqdm

from motet.bundle.graph import Floats
from motet.errors import TextError
from motet.figures.feet.contacts import feet_of, ground_of
from motet.figures.humanoid import HUMANOID
from motet.generate.base import GenerateModel
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet.search.model import SearchModel, direction
from motet_train.data.errors import DataError
from motet_train.evaluate.figures import Drawings, strips
from motet_train.evaluate.language.split_store import unknown_words_allowed
from motet_train.evaluate.positions import BALLS, jerk, length, skate
from motet_train.evaluate.tables import Goals, Report, aligned, report_table, short_names
from motet_train.evaluate.text_adherence.prompts import SHORTEST_MOTION, LookUp, Prompt, Trial, actions, prompts
from motet_train.evaluate.text_adherence.track import RATE, Track, track_of

SAYS_GOALS: Goals = {
    "says.all": (0.8, None),
    "says.locomotion": (0.95, None),
    "says.rest": (0.7, None),
    "turn.a person walks forward and turns left 90 degrees": (80, 100),
    "turn.a person walks forward and turns right 90 degrees": (-100, -80),
    "quality.slide": (None, 0.2),
    "quality.jerk_ratio": (0.85, 1.15),
    "quality.spread_ratio": (0.7, None),
}
"""Figure -> (least, most) that the models that come with motet are to reach."""

CHOICES = 32
"""Prompts among which a motion's own is to be found."""

Vectors = Mapping[str, Floats]
"""The text of a prompt -> vectors (N, E) of motions, as :func:`embedded` gives them."""

Figures = dict[str, float]


Generator = Callable[[str, int], Motion]
"""Whatever makes a motion of a human figure from a sentence and a seed; TextError for a sentence that it cannot
take."""


def best_of(model: GenerateModel) -> Generator:
    """A model as users get it: the first of its motions, with its default settings, its feet planted."""
    return lambda text, seed: model.generate(text, seed=seed)[0].motion


def says_table(
    generator: Generator,
    trials: Sequence[Trial] = (),
    training: Iterable[str] | None = None,
    seeds: int = 10,
    search: SearchModel | None = None,
) -> Report:
    """The shares of motions that do what prompts say, by prompt and as means over groups of prompts, and how good the
    motions are.

    trials: recorded trials; with them come "real", the share of those that pass whose action the prompt asks for,
        "others", of those that show something else, and the look-up among the trials named in ``training`` (by default
        all). "known" is the mean over the prompts whose action a training trial shows.
    search: a model in whose space motions and prompts are compared (:func:`space_report`); without one they are not.
    """
    own = [trial for trial in trials if training is None or trial.name in set(training)]
    if trials and not own:
        raise DataError("none of the trials is one of the training motions to be looked up")
    sources: dict[str, tuple[Generator, int]] = {"": (generator, seeds)}
    sources |= {"_lookup": (LookUp(own).generate, 1)} if own else {}
    rows: dict[str, dict[str, Figures]] = {kind: {} for kind in (*sources, *(["_real"] if own else []))}
    others: Figures = {}
    seen: dict[str, dict[str, Floats]] = {kind: {} for kind in sources}
    for prompt in tqdm(prompts(), unit=" prompts", disable=None, leave=False):
        for kind, (source, count) in sources.items():
            motions = _asked(source, prompt, count)
            rows[kind][prompt.text] = _figures(prompt, [track_of(motion) for motion in motions])
            if search is not None:
                seen[kind][prompt.text] = embedded(search, motions)
        if own:
            rows["_real"][prompt.text] = _real(prompt, trials)
            unlike = [trial.track for trial in trials if trial.shows(prompt) is False]
            others[prompt.text] = _mean([prompt.passes(track) for track in unlike])
    known = [prompt.text for prompt in prompts() if any(trial.shows(prompt) for trial in own)]
    report = {group: row for kind, found in rows.items() for group, row in _groups(kind, found, known).items()}
    if own:
        report["prompt_others"] = others
        report["quality"] |= _ratios(rows[""], rows["_real"])
    return report if search is None else report | space_report(search, prompts(), seen, trials)


def _asked(generator: Generator, prompt: Prompt, seeds: int) -> list[Motion]:
    """The motions for a prompt, one for each seed; none where the generator cannot take the prompt."""
    with unknown_words_allowed():
        try:
            return [generator(prompt.text, seed) for seed in range(seeds)]
        except TextError:
            return []


def _figures(prompt: Prompt, tracks: Sequence[Track]) -> Figures:
    """What is measured of the motions for a prompt: means, NaN for what is not asked of it. No motions do nothing."""
    return {
        "share": _mean([prompt.passes(track) for track in tracks]) if tracks else 0.0,
        "turn": _mean([track.turn for track in tracks]) if prompt.turns else np.nan,
        "slide": _mean([slide(track) for track in tracks]) if prompt.walk else np.nan,
        "jerk": _mean([jerk(track.points, RATE) for track in tracks]),
        "depth": _mean([depth(track) for track in tracks]),
        "seconds": _mean([track.seconds for track in tracks]),
        "spread": spread(tracks),
    }


def _real(prompt: Prompt, trials: Sequence[Trial]) -> Figures:
    """The same of the trials that show what is asked; the spread is that between takes of the same action, of which ten
    are compared at most."""
    takes: dict[str | None, list[Track]] = {}
    for trial in trials:
        if trial.shows(prompt):
            takes.setdefault(trial.action, []).append(trial.track)
    found = _figures(prompt, [trial.track for trial in trials if trial.shows(prompt)])
    apart = _mean([spread(tracks[:: -(-len(tracks) // 10)]) for tracks in takes.values()])
    return found | {"share": found["share"] if takes else np.nan, "spread": apart}


def slide(track: Track) -> float:
    """How fast the balls of the feet slide, m/s, while they stand: while they are no higher than 2 cm above where they
    are in standing. NaN where none ever does."""
    balls = track.points[:, BALLS]
    return skate(balls, balls[..., 1] - ground_of(track.points[:, feet_of(HUMANOID), 1]), 0.04, RATE)


def depth(track: Track) -> float:
    """How deep the lowest joint is under y = 0, metres: the mean over all frames, 0 where it is above."""
    return float(np.maximum(-track.points[..., 1].min(axis=1), 0).mean())


def poses(track: Track, count: int = 32) -> Array:
    """Poses (count, J, 3), evenly spaced in time: what is in front, to the left and how high, each seen from the hips,
    so that neither the place nor the heading nor how long it takes makes a difference."""
    part = track.frames(np.round(np.linspace(0, len(track) - 1, count)).astype(np.intp))
    return np.stack([part.body(name) for name in HUMANOID.names], axis=1)


def spread(tracks: Sequence[Track]) -> float:
    """The mean distance of joints, metres, between the :func:`poses` of two of several motions; NaN for less than
    two."""
    seen = [poses(track) for track in tracks]
    pairs = [length(one - other).mean() for i, one in enumerate(seen) for other in seen[:i]]
    return float(np.mean(pairs)) if pairs else np.nan


def _groups(kind: str, found: Mapping[str, Figures], known: list[str]) -> Report:
    """The means over groups of prompts, the figures of each, and the quality of all."""
    shares = {text: row["share"] for text, row in found.items()}
    groups = {"all": [prompt.text for prompt in prompts()]}
    groups |= {name: [p.text for p in prompts() if p.group == name] for name in ("locomotion", "rest")}
    groups |= {"known": known} if known else {}
    keys = ("slide", "jerk", "depth", "spread", "seconds")
    return {
        f"says{kind}": {name: _mean([shares[text] for text in texts]) for name, texts in groups.items()},
        f"quality{kind}": {key: _mean([row[key] for row in found.values()]) for key in keys},
        f"turn{kind}": {prompt.text: found[prompt.text]["turn"] for prompt in prompts() if prompt.turns},
        f"prompt{kind}": shares,
    }


def _ratios(found: Mapping[str, Figures], recorded: Mapping[str, Figures]) -> Figures:
    """Jerk and spread over those of recorded trials, of the prompts that have both."""
    ratios = {}
    for key in ("jerk", "spread"):
        pairs = np.array([(found[text][key], recorded[text][key]) for text in found])
        own, data = pairs[np.isfinite(pairs).all(axis=1)].sum(axis=0)
        ratios[f"{key}_ratio"] = float(own / data) if data else np.nan
    return ratios


def _mean(values: Sequence[float]) -> float:
    """The mean of the values that are numbers; NaN where none is."""
    kept = [value for value in values if np.isfinite(value)]
    return float(np.mean(kept)) if kept else np.nan


def space_report(
    model: SearchModel, asked: Sequence[Prompt], made: Mapping[str, Vectors], trials: Sequence[Trial]
) -> Report:
    """The two measures of text-to-motion (Guo et al. 2022, "Generating diverse and natural 3D human motions from text",
    section 5), in the space of a search model in the place of theirs: R-precision, and with trials the Frechet
    distances from them.

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


def said_to_be_outside(model: GenerateModel, sentences: Sequence[str]) -> float:
    """The share of sentences that are refused, or said to be outside the model's training data."""

    def outside(sentence: str) -> bool:
        try:
            model.check(sentence)
        except TextError:
            return True
        return False

    return sum(map(outside, sentences)) / len(sentences)


def says_text(reports: Mapping[str, Report]) -> str:
    """The shares of each prompt in per cent, of every generator and beside them those of the look-up, of real trials
    and of trials of other actions; then all other figures with the goals."""
    columns = dict(zip(short_names(list(reports)), (report["prompt"] for report in reports.values()), strict=True))
    first = next(iter(reports.values()))
    columns |= {key: first[f"prompt_{key}"] for key in ("lookup", "real", "others") if f"prompt_{key}" in first}
    rows = [["%", *columns]]
    for prompt in prompts():
        values = [shares[prompt.text] for shares in columns.values()]
        rows.append([prompt.text, *("" if np.isnan(value) else f"{100 * value:.0f}" for value in values)])
    rest = {
        name: {group: found for group, found in report.items() if not group.startswith("prompt")}
        for name, report in reports.items()
    }
    return f"{aligned(rows)}\n\n{report_table(rest, SAYS_GOALS)}"


def says_drawings(generator: Generator, every: int = 8) -> Drawings:
    """Every eighth prompt with a motion of seed 0 that does what it says, else the next that is done before the eighth
    after it; how many were passed over so is said above them."""

    def draw() -> Figure:
        shown, failed = dict[str, Motion](), 0
        for start in range(0, len(prompts()), every):
            for prompt in prompts()[start : start + every]:
                motion = generator(prompt.text, 0)
                if prompt.passes(track_of(motion)):
                    shown[prompt.text] = motion
                    break
                failed += 1
        title = f"every eighth prompt; {failed} whose motions did not do what they say are passed over for the next"
        return strips(list(shown.values()), list(shown), title)

    return {"says": draw}
