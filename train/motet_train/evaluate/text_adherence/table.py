"""Does what it says: every prompt asked with several seeds, beside recorded trials and the look-up."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from matplotlib.figure import Figure
from tqdm import tqdm

from motet.bundle.graph import Floats
from motet.errors import TextError
from motet.models.generate import GenerateModel
from motet.models.search import SearchModel
from motet.motion.motion import Motion
from motet_train.data.errors import DataError
from motet_train.evaluate.figures import Drawings, strips
from motet_train.evaluate.language.split_store import unknown_words_allowed
from motet_train.evaluate.tables import Goals, Report, aligned, report_table, short_names
from motet_train.evaluate.text_adherence.measures import depth, jerk, slide, spread
from motet_train.evaluate.text_adherence.prompts import Prompt, prompts
from motet_train.evaluate.text_adherence.space import embedded, space_report
from motet_train.evaluate.text_adherence.track import Track, track_of
from motet_train.evaluate.text_adherence.trials import LookUp, Trial

LEFT_90, RIGHT_90 = (f"a person walks forward and turns {side} 90 degrees" for side in ("left", "right"))

SAYS_GOALS: Goals = {
    "says.all": (0.8, None),
    "says.locomotion": (0.95, None),
    "says.rest": (0.7, None),
    f"turn.{LEFT_90}": (80, 100),
    f"turn.{RIGHT_90}": (-100, -80),
    "quality.slide": (None, 0.2),
    "quality.jerk_ratio": (0.85, 1.15),
    "quality.spread_ratio": (0.7, None),
}
"""Figure -> (least, most) that the models that come with motet are to reach."""


class Generator(Protocol):
    """Whatever makes motions of a human figure from a sentence and a seed; TextError for one that it cannot take."""

    def generate(self, text: str, seed: int) -> Motion:
        """The motion."""


@dataclass(frozen=True)
class Best:
    """A model as users get it: the first of its motions, with its default settings."""

    model: GenerateModel

    def generate(self, text: str, seed: int) -> Motion:
        """The motion at 30 frames a second, its feet planted."""
        return self.model.generate(text, seed=seed)[0].motion


Figures = dict[str, float]


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
    sources |= {"_lookup": (LookUp(own), 1)} if own else {}
    rows: dict[str, dict[str, Figures]] = {kind: {} for kind in (*sources, *(["_real"] if own else []))}
    others: Figures = {}
    seen: dict[str, dict[str, Floats]] = {kind: {} for kind in sources}
    for prompt in tqdm(prompts(), unit=" prompts", disable=None, leave=False):
        for kind, (source, count) in sources.items():
            motions = asked(source, prompt, count)
            rows[kind][prompt.text] = figures(prompt, [track_of(motion) for motion in motions])
            if search is not None:
                seen[kind][prompt.text] = embedded(search, motions)
        if own:
            rows["_real"][prompt.text] = real(prompt, trials)
            others[prompt.text] = _share(prompt, [trial.track for trial in trials if trial.shows(prompt) is False])
    known = [prompt.text for prompt in prompts() if any(trial.shows(prompt) for trial in own)]
    report: Report = {}
    for kind, found in rows.items():
        report |= _groups(kind, found, known)
    if own:
        report["prompt_others"] = others
        report["quality"] |= _ratios(rows[""], rows["_real"])
    return report if search is None else report | space_report(search, prompts(), seen, trials)


def asked(generator: Generator, prompt: Prompt, seeds: int) -> list[Motion]:
    """The motions for a prompt, one for each seed; none where the generator cannot take the prompt."""
    with unknown_words_allowed():
        try:
            return [generator.generate(prompt.text, seed) for seed in range(seeds)]
        except TextError:
            return []


def figures(prompt: Prompt, tracks: Sequence[Track]) -> Figures:
    """What is measured of the motions for a prompt: means, NaN for what is not asked of it. No motions do nothing."""
    return {
        "share": _share(prompt, tracks) if tracks else 0.0,
        "turn": _mean([track.turn for track in tracks]) if prompt.turns else np.nan,
        "slide": _mean([slide(track) for track in tracks]) if prompt.walk else np.nan,
        "jerk": _mean([jerk(track) for track in tracks]),
        "depth": _mean([depth(track) for track in tracks]),
        "seconds": _mean([track.seconds for track in tracks]),
        "spread": spread(tracks),
    }


def real(prompt: Prompt, trials: Sequence[Trial]) -> Figures:
    """The same of the trials that show what is asked; the spread is that between takes of the same action, of which ten
    are compared at most."""
    shown = [trial for trial in trials if trial.shows(prompt)]
    found = figures(prompt, [trial.track for trial in shown])
    actions = dict.fromkeys(trial.action for trial in shown)
    takes = [[trial.track for trial in shown if trial.action == one] for one in actions]
    apart = _mean([spread(tracks[:: -(-len(tracks) // 10)]) for tracks in takes])
    return found | {"share": found["share"] if shown else np.nan, "spread": apart}


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
                motion = generator.generate(prompt.text, 0)
                if prompt.passes(track_of(motion)):
                    shown[prompt.text] = motion
                    break
                failed += 1
        title = f"every eighth prompt; {failed} whose motions did not do what they say are passed over for the next"
        return strips(list(shown.values()), list(shown), title)

    return {"says": draw}


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


def _share(prompt: Prompt, tracks: Sequence[Track]) -> float:
    return _mean([float(prompt.passes(track)) for track in tracks])


def _mean(values: Sequence[float]) -> float:
    """The mean of the values that are numbers; NaN where none is."""
    kept = [value for value in values if np.isfinite(value)]
    return float(np.mean(kept)) if kept else np.nan
