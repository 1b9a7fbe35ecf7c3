"""Whether motions do what prompts say, with several seeds each, next to recorded trials and the look-up; and, in the
space of a search model, R-precision and the distance of generated from recorded motions."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import chain, combinations

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
from motet_train.evaluate.tables import Figures, Report, aligned, read_goals, report_table, short_names
from motet_train.evaluate.text_adherence.prompts import EVERYDAY_PROMPTS, SHORTEST_SHOWN, LookUp, Prompt, Trial, actions
from motet_train.evaluate.text_adherence.track import RATE, Track, track_of

SAYS_GOALS = read_goals("says")

CHOICES = 32
"""Prompts among which a motion has to find its own."""

Vectors = Mapping[str, Floats]
"""The text of a prompt -> vectors (N, E) of motions from :func:`embedded`."""

Generator = Callable[[str, int], Motion]
"""Makes a motion of a human figure from a sentence and a seed; TextError for a sentence that it does not accept."""


def best_of(model: GenerateModel) -> Generator:
    """A model in its default use: the first of its motions, with default settings, its feet planted."""
    return lambda text, seed: model.generate(text, seed=seed)[0].motion


def says_table(
    generator: Generator,
    trials: Sequence[Trial] = (),
    training: Iterable[str] | None = None,
    seeds: int = 10,
    search: SearchModel | None = None,
) -> Report:
    """The shares of motions that do what prompts say, by prompt and as means over groups of prompts, and the quality of
    the motions.

    trials: recorded trials; they add "real", the share that passes of those whose action is the prompt's, "others", of
        those with other actions, and the look-up among the trials named in ``training`` (by default all). "known" is
        the mean over the prompts whose action a training trial shows.
    search: a model in whose space motions and prompts are compared (:func:`space_report`); None for no comparison.
    """
    train_trials = _training_trials(trials, training)
    sources = {"": (generator, seeds)}
    if train_trials:
        sources["_lookup"] = (LookUp(train_trials).generate, 1)

    # every source for every prompt, and what recorded trials show
    rows, vectors = _measured(sources, search)
    if train_trials:
        rows["_real"] = {prompt.text: _real(prompt, trials) for prompt in EVERYDAY_PROMPTS}
    known = list(_trials_shown(EVERYDAY_PROMPTS, train_trials))
    report: Report = {}
    for kind, figures in rows.items():
        report |= _groups(kind, figures, known)

    # what only trials and a space tell
    if train_trials:
        report["prompt_others"] = {prompt.text: _passed_by_others(prompt, trials) for prompt in EVERYDAY_PROMPTS}
        report["quality"] |= _ratios(rows[""], rows["_real"])
    if search is not None:
        report |= space_report(search, EVERYDAY_PROMPTS, vectors, trials)
    return report


def _training_trials(trials: Sequence[Trial], training: Iterable[str] | None) -> list[Trial]:
    """The trials of some names, or all; DataError if none of several trials is left."""
    names = {trial.name for trial in trials} if training is None else set(training)
    train_trials = [trial for trial in trials if trial.name in names]
    if trials and not train_trials:
        raise DataError("none of the trials is one of the training motions to be looked up")
    return train_trials


def _measured(
    sources: Mapping[str, tuple[Generator, int]], search: SearchModel | None
) -> tuple[dict[str, dict[str, Figures]], dict[str, dict[str, Floats]]]:
    """For each source, with its number of seeds, and the text of each prompt: the figures of its motions, and their
    vectors in the space of a search model."""
    rows: dict[str, dict[str, Figures]] = {kind: {} for kind in sources}
    vectors: dict[str, dict[str, Floats]] = {kind: {} for kind in sources}
    for prompt in tqdm(EVERYDAY_PROMPTS, unit=" prompts", disable=None, leave=False):
        # prompt by prompt, so that motions need not be kept
        for kind, (source, count) in sources.items():
            motions = _motions(source, prompt, count)
            rows[kind][prompt.text] = _figures(prompt, list(map(track_of, motions)))
            if search is not None:
                vectors[kind][prompt.text] = embedded(search, motions)
    return rows, vectors


def _passed_by_others(prompt: Prompt, trials: Sequence[Trial]) -> float:
    """The share of the trials of other actions that pass a prompt."""
    return _mean([prompt.passes(trial.track) for trial in trials if trial.shows(prompt) is False])


def _motions(generator: Generator, prompt: Prompt, seeds: int) -> list[Motion]:
    """The motions for a prompt, one for each seed; none if the generator does not accept the prompt."""
    with unknown_words_allowed():
        try:
            return [generator(prompt.text, seed) for seed in range(seeds)]
        except TextError:
            return []


def _figures(prompt: Prompt, tracks: Sequence[Track]) -> Figures:
    """The means over the motions for a prompt, NaN for measures that it does not ask for; share 0 of none."""
    return {
        "share": _mean([prompt.passes(track) for track in tracks]) if tracks else 0.0,
        "turn": _mean([track.turn for track in tracks]) if prompt.turns else np.nan,
        "slide": _mean([slide(track) for track in tracks]) if prompt.walk else np.nan,
        "head": _mean([head_pitch(track) for track in tracks]) if prompt.walk else np.nan,
        "jerk": _mean([jerk(track.points, RATE) for track in tracks]),
        "depth": _mean([depth(track) for track in tracks]),
        "seconds": _mean([track.seconds for track in tracks]),
        "spread": spread(tracks),
    }


def _real(prompt: Prompt, trials: Sequence[Trial]) -> Figures:
    """The same for the trials that show a prompt; the spread is between takes of one action, of at most ten each."""
    # the trials that show the prompt, and their takes of each action
    tracks = []
    takes: dict[str | None, list[Track]] = {}
    for trial in trials:
        if trial.shows(prompt):
            tracks.append(trial.track)
            takes.setdefault(trial.action, []).append(trial.track)
    figures = _figures(prompt, tracks)
    if not tracks:
        figures["share"] = np.nan
    # how different takes of one action are
    spreads = []
    for same_action in takes.values():
        every = -(-len(same_action) // 10)
        spreads.append(spread(same_action[::every]))
    figures["spread"] = _mean(spreads)
    return figures


def slide(track: Track) -> float:
    """How fast the balls of the feet slide, m/s, while they stand: while they are at most 2 cm above their height in
    standing. NaN if they never are."""
    balls = track.points[:, BALLS]
    ground = ground_of(track.points[:, feet_of(HUMANOID), 1])
    return skate(balls, balls[..., 1] - ground, 0.04, RATE)


def head_pitch(track: Track) -> float:
    """How far the head is pitched forward, in degrees: the mean over all frames."""
    top = track.body("head_end") - track.body("head")
    return float(np.degrees(np.arctan2(top[:, 2], top[:, 1])).mean())


def depth(track: Track) -> float:
    """How deep the lowest joint is below y = 0, metres: the mean over all frames, with 0 for those above."""
    lowest = track.points[..., 1].min(axis=1)
    return float(np.maximum(-lowest, 0).mean())


def poses(track: Track, count: int = 32) -> Array:
    """Poses (count, J, 3) at even times in the figure's space (:meth:`Track.body`), so that place, facing and duration
    make no difference."""
    # evenly spaced frames
    frames = np.linspace(0, len(track) - 1, count)
    part = track.frames(np.round(frames).astype(np.intp))
    return np.stack([part.body(name) for name in HUMANOID.names], axis=1)


def spread(tracks: Sequence[Track]) -> float:
    """The mean distance of joints, metres, between the :func:`poses` of two of several motions; NaN for fewer than
    two."""
    pairs = combinations([poses(track) for track in tracks], 2)
    distances = [length(first - second).mean() for first, second in pairs]
    return float(np.mean(distances)) if distances else np.nan


def _groups(kind: str, rows: Mapping[str, Figures], known: list[str]) -> Report:
    """The means over groups of prompts, the mean quality, and the turns and shares of each prompt."""
    # the prompts of each group
    groups: dict[str, list[str]] = {"all": [], "locomotion": [], "rest": []}
    for prompt in EVERYDAY_PROMPTS:
        groups["all"].append(prompt.text)
        groups[prompt.group].append(prompt.text)
    if known:
        groups["known"] = known

    # means over these, and figures of single prompts
    shares = {text: row["share"] for text, row in rows.items()}
    turns = {prompt.text: rows[prompt.text]["turn"] for prompt in EVERYDAY_PROMPTS if prompt.turns}
    says = {}
    for name, texts in groups.items():
        says[name] = _mean([shares[text] for text in texts])
    return {f"says{kind}": says, f"quality{kind}": _quality(rows), f"turn{kind}": turns, f"prompt{kind}": shares}


def _quality(rows: Mapping[str, Figures]) -> Figures:
    """The mean quality of the motions of all prompts."""
    quality = {}
    for key in ("slide", "head", "jerk", "depth", "spread", "seconds"):
        quality[key] = _mean([row[key] for row in rows.values()])
    return quality


def _ratios(generated: Mapping[str, Figures], recorded: Mapping[str, Figures]) -> Figures:
    """Jerk and spread relative to recorded trials, over the prompts that have both."""
    ratios = {}
    for key in ("jerk", "spread"):
        pairs = np.array([(generated[text][key], recorded[text][key]) for text in generated])
        both_known = np.isfinite(pairs).all(axis=1)
        generated_sum, recorded_sum = pairs[both_known].sum(axis=0)
        ratios[f"{key}_ratio"] = float(generated_sum / recorded_sum) if recorded_sum else np.nan
    return ratios


def _mean(values: Sequence[float]) -> float:
    """The mean of the finite values; NaN without any."""
    known = [value for value in values if np.isfinite(value)]
    return float(np.mean(known)) if known else np.nan


def space_report(
    model: SearchModel, candidates: Sequence[Prompt], made: Mapping[str, Vectors], trials: Sequence[Trial]
) -> Report:
    """The two measures of text-to-motion of Guo et al. 2022 ("Generating diverse and natural 3D human motions from
    text", section 5) in the space of a search model instead of theirs: R-precision, and with trials the Frechet
    distances from them.

    made: "" for the generator and "_lookup" for the look-up -> the vectors of the motions for every prompt.
    "r_precision": the share of motions whose own prompt is the nearest, or among the two or three nearest, of
        :data:`CHOICES`; the mean over prompts, 0 for a prompt without motions. "_lookup" the same for the look-up,
        "_real" for the trials that show the prompt.
    "frechet": between the trials that show any of the prompts and the generator's motions for the prompts that a trial
        shows; the same for the look-up; and between two random halves of these trials. "_motions" are the numbers of
        motions in each.
    """
    # prompts, trials and generated motions in one space
    with unknown_words_allowed():
        texts = model.embed_text([prompt.text for prompt in candidates])
    trial_vectors = embedded(model, [trial.motion for trial in trials])
    shown = _trials_shown(candidates, trials)
    sets = dict(made)
    if shown:
        sets["_real"] = {text: trial_vectors[rows] for text, rows in shown.items()}
    # both measures
    report = {f"r_precision{kind}": _precisions(vectors, candidates, texts) for kind, vectors in sets.items()}
    if shown:
        all_rows = sorted(set(chain.from_iterable(shown.values())))
        report["frechet"] = _frechet_figures(made, list(shown), trial_vectors[all_rows])
    return report


def _trials_shown(candidates: Sequence[Prompt], trials: Sequence[Trial]) -> dict[str, list[int]]:
    """The text of each prompt that trials show -> their indices."""
    shown = {}
    for prompt in candidates:
        rows = [row for row, trial in enumerate(trials) if trial.shows(prompt)]
        if rows:
            shown[prompt.text] = rows
    return shown


def _frechet_figures(made: Mapping[str, Vectors], texts: list[str], trial_vectors: Floats) -> Figures:
    """The distances from trials (N, E) of the motions for some prompts, and the numbers of motions."""
    # the motions for prompts that a trial shows
    sets = {}
    for kind, vectors in made.items():
        name = kind.strip("_") or "generated"
        sets[name] = _known_rows(np.concatenate([vectors[text] for text in texts]))
    trials = _known_rows(trial_vectors)
    figures = {name: frechet(rows, trials) for name, rows in sets.items()}

    # how far apart two samples of the same distribution are
    order = np.random.default_rng(0).permutation(len(trials))
    figures["halves"] = frechet(trials[order[::2]], trials[order[1::2]])
    for name, rows in {**sets, "trials": trials}.items():
        figures[f"{name}_motions"] = float(len(rows))
    return figures


def _known_rows(vectors: Floats) -> Floats:
    """The vectors (N, E) without NaN."""
    return vectors[np.isfinite(vectors).all(axis=1)]


def embedded(model: SearchModel, motions: Sequence[Motion]) -> Floats:
    """The directions (N, E) of motions, NaN for those shorter than :data:`SHORTEST_SHOWN`; MotionError as in
    :func:`direction` for others that the model does not accept."""
    vectors = np.full((len(motions), model.sizes["E"]), np.nan, np.float32)
    for row, motion in enumerate(motions):
        if motion.duration >= SHORTEST_SHOWN:
            vectors[row] = direction(model, motion)
    return vectors


def rivals(candidates: Sequence[Prompt]) -> list[list[int]]:
    """For each prompt the indices of those that ask for something else: no recorded action shows one of the two and
    may show the other."""
    # which recorded actions show a prompt (1), and which may (0); others do not (-1)
    answers = {True: 1, None: 0, False: -1}
    table = []
    for prompt in candidates:
        table.append([answers[prompt.shows(action)] for action in set(actions().values())])
    shown = np.array(table) == 1
    maybe_shown = np.array(table) >= 0

    # pairs of which no action shows the first and may show the second, nor the other way round
    overlap = shown @ maybe_shown.T
    apart = ~(overlap | overlap.T)
    np.fill_diagonal(apart, False)
    return [np.flatnonzero(row).tolist() for row in apart]


def r_precision(similarity: Array, rival_similarity: Array) -> Figures:
    """R-precision by the similarity of motions to their own prompt (N,) and to each of its rivals (N, K).

    Guo et al. draw 31 rivals for each motion. This is the mean over all draws, so nothing depends on a seed: if b of K
    rivals are at least as near as the own prompt, the number of those that are drawn is hypergeometric. Fewer rivals
    are all drawn; NaN without any. Motions without a vector (NaN) find nothing, nor do no motions.
    """
    tops = (1, 2, 3)
    rivals = rival_similarity.shape[1]
    if not rivals:
        return {str(top): np.nan for top in tops}
    # how many of the drawn rivals are nearer, over all draws
    nearer = (~(similarity[:, None] > rival_similarity)).sum(axis=1)
    drawn = hypergeom(rivals, nearer, min(CHOICES - 1, rivals))
    return {str(top): float(drawn.cdf(top - 1).mean()) if len(nearer) else 0.0 for top in tops}


def frechet(first: Floats, second: Floats) -> float:
    """The squared Frechet distance between Gaussians of the mean and covariance of vectors (N, E) and (M, E).

    |m - n|^2 + tr S + tr T - 2 tr (S T)^1/2 (Dowson and Landau 1982; Heusel et al. 2017). With S = A'A and T = B'B of
    the centred vectors, the last trace is the sum of the singular values of A B', so no matrix root is needed and the
    definition also holds, without shrinkage, for fewer vectors than dimensions. Fewer vectors make it larger: compare
    distances of about equal numbers. NaN for fewer than two vectors.
    """
    if min(len(first), len(second)) < 2:
        return np.nan
    # means, and centred vectors scaled so that products are covariances
    m = first.mean(axis=0, dtype=np.float64)
    n = second.mean(axis=0, dtype=np.float64)
    a = (first - m) / np.sqrt(len(first) - 1)
    b = (second - n) / np.sqrt(len(second) - 1)
    cross_trace = np.linalg.norm(a @ b.T, "nuc")
    return float(((m - n) ** 2).sum() + (a**2).sum() + (b**2).sum() - 2 * cross_trace)


def _precisions(vectors: Vectors, candidates: Sequence[Prompt], texts: Floats) -> Figures:
    """The means over the prompts that have vectors."""
    rows = []
    for column, (prompt, others) in enumerate(zip(candidates, rivals(candidates), strict=True)):
        if prompt.text in vectors:
            similarity = (vectors[prompt.text] @ texts.T).astype(np.float64)
            rows.append(r_precision(similarity[:, column], similarity[:, others]))
    means = {}
    for top in rows[0]:
        means[top] = float(np.mean([row[top] for row in rows]))
    return means


def said_to_be_outside(model: GenerateModel, sentences: Sequence[str]) -> float:
    """The share of sentences that a model rejects, or reports as outside its training data."""
    outside = 0
    for sentence in sentences:
        try:
            model.check(sentence)
        except TextError:
            outside += 1
    return outside / len(sentences)


def says_text(reports: Mapping[str, Report]) -> str:
    """The shares of each prompt in per cent, for every generator and next to them the look-up, real trials and trials
    of other actions; then all other figures with the goals."""
    # a column for each generator, then what stands next to the first one
    names = short_names(list(reports))
    columns = dict(zip(names, [report["prompt"] for report in reports.values()], strict=True))
    first = next(iter(reports.values()))
    for key in ("lookup", "real", "others"):
        if f"prompt_{key}" in first:
            columns[key] = first[f"prompt_{key}"]

    rows = [["%", *columns]]
    for prompt in EVERYDAY_PROMPTS:
        rows.append([prompt.text, *(_per_cent(shares[prompt.text]) for shares in columns.values())])

    # all other figures
    rest = {}
    for name, report in reports.items():
        rest[name] = {group: figures for group, figures in report.items() if not group.startswith("prompt")}
    return f"{aligned(rows)}\n\n{report_table(rest, SAYS_GOALS)}"


def _per_cent(share: float) -> str:
    return "" if np.isnan(share) else f"{100 * share:.0f}"


def says_drawings(generator: Generator) -> Drawings:
    """Every eighth prompt whose motion of seed 0 passes, or else the next one that passes before the eighth after it;
    the title has the number of prompts that were passed over."""
    return {"says": lambda: _strips_of_passed(generator)}


def _strips_of_passed(generator: Generator) -> Figure:
    motions: dict[str, Motion] = {}
    failed = 0
    for start in range(0, len(EVERYDAY_PROMPTS), 8):
        for prompt in EVERYDAY_PROMPTS[start : start + 8]:
            motion = generator(prompt.text, 0)
            if prompt.passes(track_of(motion)):
                motions[prompt.text] = motion
                break
            failed += 1
    title = f"every eighth prompt; {failed} whose motions did not do what they say are passed over for the next"
    return strips(list(motions.values()), list(motions), title)
