"""What a table of the protocol says, in sentences: each is computed from the figures as the table shows them."""

from collections.abc import Mapping, Sequence

import numpy as np

from motet_train.evaluate.predict.curves import FEW, MANY, MEAN, ROTATION, complete
from motet_train.evaluate.predict.floors import CONSTANT, DAMPED, ZERO
from motet_train.evaluate.predict.protocol import REPORTED
from motet_train.evaluate.predict.published import FRAMES, GOALS, by_action, mean_over
from motet_train.evaluate.predict.published_h36m import CONV, RRNN
from motet_train.evaluate.predict.results import Results
from motet_train.evaluate.predict.words import amount, at, grouped, listed

PAPERS = {"convseq2seq": CONV, "rrnn": RRNN}
"""Model -> its published row."""

OWN = "trajectory"
"""Motet's own predictor, which has a goal."""

STILL = {ZERO: "standing still", CONSTANT: CONSTANT, DAMPED: DAMPED}
"""Floor -> how sentences call it."""


class Figures:
    """The figures of a table as it shows them."""

    def __init__(self, results: Results) -> None:
        self.results = results
        self.groups = {group.title: group for group in results.groups}

    def name(self, title: str) -> str:
        """What a sentence calls a row: without the number of its seeds."""
        return title.removesuffix(self.groups[title].count) if title in self.groups else STILL.get(title, title)

    def models(self, *kinds: str) -> list[str]:
        """The rows of some models."""
        models = self.results.models
        return [group.title for group in self.results.groups if models[group.runs[0]].manifest.model in kinds]

    def error(self, row: str, frame: int, kind: str = FEW, action: str = MEAN) -> float:
        """What stands in a row."""
        return round(float(self.results.means[kind][row][action][frame]), 2)

    def spread(self, row: str, frame: int, kind: str) -> float | None:
        """What stands in its brackets, 0 of what has no seed, None of a single run."""
        if row in self.results.spreads[kind]:
            return round(float(self.results.spreads[kind][row][MEAN][frame]), 2)
        return None if row in self.groups else 0.0


def smallest(figures: Figures, kind: str) -> list[str]:
    """Which row has the smallest mean at which frames, and how sure that is."""
    winners, leads = {}, {}
    for frame in REPORTED:
        ranked = sorted(figures.results.systems, key=lambda row: figures.error(row, frame, kind))
        least = figures.error(ranked[0], frame, kind)
        first = [row for row in ranked if figures.error(row, frame, kind) == least]
        winners[frame] = listed([figures.name(row) for row in first])
        if len(first) == 1 < len(ranked):
            leads[frame] = _sureness(figures, kind, frame, (first[0], ranked[1]))
    said = [
        f"{words} {'have' if ' and ' in words else 'has'} the smallest {_error(kind)} {at(frames)}"
        for words, frames in grouped(winners).items()
    ]
    return [f"{_windows(kind)}: {'; '.join(said)}.", *_doubts(leads)]


def _sureness(figures: Figures, kind: str, frame: int, pair: tuple[str, str]) -> str:
    """What the lead of a row over the next one rests on; "" where it is more than both spreads."""
    spreads = [figures.spread(row, frame, kind) for row in pair]
    first, second = (figures.name(row) for row in pair)
    lone = [name for name, spread in zip((first, second), spreads, strict=True) if spread is None]
    if lone:
        runs = "each" if len(lone) > 1 else lone[0]
        return f"the lead of {first} over {second} rests on one run of {runs}"
    lead = round(figures.error(pair[1], frame, kind) - figures.error(pair[0], frame, kind), 2)
    if lead <= max(spread for spread in spreads if spread is not None):
        return f"the lead of {first} over {second} is within the spread of their seeds"
    return ""


def _doubts(leads: dict[int, str]) -> list[str]:
    found = grouped(leads)
    sure = found.pop("", [])
    said = [f"{_capital(at(frames))} {words}." for words, frames in found.items()]
    if sure:
        said.append(f"{_capital(at(sure))} the lead over the next row is more than the spread of the seeds.")
    return said


def beside_papers(figures: Figures) -> list[str]:
    """Where a system is at or under what its paper reports, in the mean of eight windows and by action."""
    results, known = figures.results, by_action(figures.results.corpus.layout.name)
    means, said = mean_over(known, complete(results.corpus)), []
    for row in figures.models(*PAPERS):
        paper = PAPERS[results.models[figures.groups[row].runs[0]].manifest.model]
        off = _off(figures, row, MEAN, means.get(paper, ()))
        by = {action: _off(figures, row, action, known.get(action, {}).get(paper, ())) for action in results.actions}
        if off:
            said.append(f"{_against(figures.name(row), 'its published row', off)}{_actions(by)}.")
    return said


def _off(figures: Figures, row: str, action: str, known: Sequence[float], kind: str = FEW) -> dict[int, float]:
    """Frame -> by how much a row is over what is known, as shown; frames of which nothing is known are left out."""
    found = zip(FRAMES, known, strict=False)
    return {
        frame: round(figures.error(row, frame, kind, action) - round(value, 2), 2)
        for frame, value in found
        if np.isfinite(value)
    }


def _against(name: str, other: str, off: Mapping[int, float]) -> str:
    """Where a row is at or under another, and where over it and by how much."""
    under, over = ([frame for frame in off if (off[frame] > 0) == above] for above in (False, True))
    much = listed([amount(off[frame]) for frame in over])
    if not over:
        return f"{name} is at or under {other} {at(under, list(off))}"
    if not under:
        return f"{name} is over {other} {at(over, list(off))}, by {much}"
    return f"{name} is at or under {other} {at(under)}, and over it {at(over)}, by {much}"


def _actions(by: Mapping[str, Mapping[int, float]]) -> str:
    """In which actions it is over it."""
    over = {action: [frame for frame in off if off[frame] > 0] for action, off in by.items() if off}
    if not over:
        return ""
    parts = [f"in {action} {at(frames, list(by[action]))}" for action, frames in over.items() if frames]
    nowhere = [action for action, frames in over.items() if not frames]
    parts += [f"nowhere in {listed(nowhere)}"] if nowhere else []
    return f"; by action, it is over it {', '.join(parts)}"


def beside_goals(figures: Figures) -> list[str]:
    """Where motet's own predictor reaches its goals."""
    if not figures.results.corpus.layout.name.startswith("cmu"):
        return []
    return [
        f"{_windows(kind)}: {_against(figures.name(row), 'the goal', _off(figures, row, MEAN, goal, kind))}."
        for row in figures.models(OWN)
        for kind, goal in GOALS.items()
    ]


def beside_floors(figures: Figures, kind: str = FEW) -> list[str]:
    """Which rows are no better than a floor in the mean; and where motet's own and those with published rows are no
    better than standing still."""
    found = {floor: _rows_no_better(figures, floor, kind) for floor in figures.results.floors}
    beaten = [STILL[floor] for floor, rows in found.items() if not rows]
    said = [
        f"{_windows(kind)}: no better than {STILL[floor]} in the mean: {rows}." for floor, rows in found.items() if rows
    ]
    if beaten and figures.groups:
        said.append(f"{_windows(kind)}: better than {listed(beaten)} in the mean, at every frame: all rows.")
    for row in figures.models(OWN, *PAPERS):
        by = {action: _no_better(figures, row, ZERO, kind, action) for action in figures.results.actions}
        words = [f"in {action} {at(frames)}" for action, frames in by.items() if frames]
        where = (
            f"no better than standing still {', '.join(words)}" if words else "better than standing still everywhere"
        )
        said.append(f"By action, {figures.name(row)} is {where}.")
    return said


def _rows_no_better(figures: Figures, floor: str, kind: str) -> str:
    found = {row: _no_better(figures, row, floor, kind, MEAN) for row in figures.groups}
    return "; ".join(f"{figures.name(row)} {at(frames)}" for row, frames in found.items() if frames)


def _no_better(figures: Figures, row: str, floor: str, kind: str, action: str) -> list[int]:
    return [
        frame
        for frame in REPORTED
        if figures.error(row, frame, kind, action) >= figures.error(floor, frame, kind, action)
    ]


def _windows(kind: str) -> str:
    return {FEW: "Eight windows", MANY: "256 windows", ROTATION: "Angles of rotation"}[kind]


def _error(kind: str) -> str:
    return "mean angle" if kind == ROTATION else "mean error"


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
