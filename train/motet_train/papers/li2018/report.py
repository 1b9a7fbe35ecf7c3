"""What predictors reach by the protocol, action by action, beside floors and the rows that papers publish."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from tqdm import tqdm

from motet.motion.rotations import Array
from motet_train.data.errors import DataError
from motet_train.evaluate.predict.floors import FLOORS
from motet_train.evaluate.predict.frames import by_frame
from motet_train.papers.li2018.costs import cost_table, harness_table
from motet_train.papers.li2018.error_rows import BRACKETS, ErrorRows
from motet_train.papers.li2018.expmap_files import ExpmapCorpus, Scaling, scaling_of
from motet_train.papers.li2018.protocol import (
    LABELLED_MS,
    Continuation,
    errors,
    predictions,
    predictor,
    rotation_errors,
    true_times,
)
from motet_train.papers.li2018.published import AVERAGES, BY_ACTION, PREDICTOR_GOALS, PUBLISHED_FRAMES, Rows, mean_over
from motet_train.papers.li2018.seed_groups import Models, Ready, SeedGroup, mean, pooled, ready, seed_groups, spread
from motet_train.papers.li2018.text_floors import text_floors

FEW, MANY, ANGLES = "windows_8", "windows_256", "rotation"
"""As many windows of each action as papers take; enough for a figure without much noise; and of those, not the Euler
error but :func:`motet_train.papers.li2018.protocol.rotation_errors`."""

KIND_TITLES = {
    FEW: "8 windows of each action",
    MANY: "256 windows of each action",
    ANGLES: "256 windows, mean angle between predicted and true rotations of the joints that move, degrees",
}

MEAN, ALL = "mean", "every"
"""In place of an action: the mean of those with all their files, and that of all, which only papers measured."""

PUBLISHED = "published: "
"""What the names of systems begin with that were not measured here."""

Errors = Mapping[str, Mapping[tuple[str, str], Array]]
"""System -> FEW, MANY or ANGLES, and an action or MEAN -> error (25,)."""


@dataclass(frozen=True, eq=False)
class Results:
    """Errors of models and floors in a corpus, and how the models fall into groups that differ in their seed alone."""

    models: Models
    corpus: ExpmapCorpus
    groups: Sequence[SeedGroup]
    errors: Errors

    def grouped(self, how: Callable[[Sequence[Array]], Array] = mean) -> Errors:
        """Groups, by their titles, in place of runs."""
        return pooled(self.errors, self.groups, how)

    def spreads(self) -> Errors:
        """The largest minus the smallest error of each group of several runs."""
        found = self.grouped(spread)
        return {group.title: found[group.title] for group in self.groups if len(group.runs) > 1}

    def text(self) -> str:
        """The tables: errors, training, costs."""
        tables = harness_table(self.models, self.groups), cost_table(self.models, self.groups)
        return "\n\n".join((protocol_table(self.grouped(), self.corpus, self.spreads()), *tables))

    def to_json(self) -> Ready:
        """See :func:`motet_train.papers.li2018.seed_groups.ready`."""
        figures = (partial(_nested, found) for found in (self.errors, self.grouped(), self.spreads()))
        return ready(self.models, self.groups, [name for name in self.errors if name in FLOORS], *figures)


def protocol_results(models: Models, corpus: ExpmapCorpus) -> Results:
    """Measure all systems, floors first; DataError without a test file, or for a model that is not of this corpus."""
    if not corpus.test:
        raise DataError("none of the test files was found")
    systems = text_floors(corpus) | {name: predictor(name, model, corpus) for name, model in models.items()}
    scaling = scaling_of(corpus.train)
    with tqdm(systems.items(), unit=" systems", disable=None, leave=False) as bar:
        found = {name: _errors(system, corpus, scaling) for name, system in bar}
    return Results(models, corpus, seed_groups(models), found)


def _errors(system: Continuation, corpus: ExpmapCorpus, scaling: Scaling) -> dict[tuple[str, str], Array]:
    test = {action: list(files.values()) for action, files in corpus.test.items()}
    few, many = (predictions(system, test, scaling, count) for count in (8, 256))
    found = {FEW: errors(few), MANY: errors(many), ANGLES: errors(many, rotation_errors)}
    for measured in found.values():
        measured[MEAN] = np.mean([measured[action] for action in complete(corpus)], axis=0)
    return {(kind, action): error for kind, measured in found.items() for action, error in measured.items()}


def complete(corpus: ExpmapCorpus) -> list[str]:
    """The actions with all of their training and test files; where no action has them, all that are tested."""
    gaps = {name.split("/")[1] for name in corpus.missing if name.count("/") == 2}
    return [action for action in corpus.test if action not in gaps] or list(corpus.test)


def protocol_table(found: Errors, corpus: ExpmapCorpus, spreads: Errors | None = None) -> str:
    """As text: frames and true times, then the systems in each action, and under them what papers report.

    spreads: of the systems that are means of several seeds.
    """
    beside = spreads or {}
    rows = ErrorRows(bool(beside))
    rows.head("milliseconds, true", (f"{time:.0f}" for time in true_times(corpus.layout.fps)))
    rows.head("milliseconds, as papers label them", map(str, LABELLED_MS))
    if beside:
        rows.title(BRACKETS)
    known = published(corpus)
    for kind, action in dict.fromkeys(part for parts in (*found.values(), *known.values()) for part in parts):
        if action in (ALL, next(iter(corpus.test))):
            rows.title()
        if action == next(iter(corpus.test)):
            rows.title(KIND_TITLES[kind])
        means = {MEAN: f"mean of {', '.join(complete(corpus))}"}
        means[ALL] = f"average of all {len(corpus.layout.test)} actions, 8 windows"
        rows.title(means.get(action, action))
        for name, parts in (*found.items(), *known.items()):
            if (kind, action) in parts:
                rows.add(name, parts[kind, action], beside.get(name, {}).get((kind, action)))
    return rows.text()


def published(corpus: ExpmapCorpus) -> Errors:
    """What papers report of a corpus, on eight windows, and the goals of the small predictor."""
    actions, found = BY_ACTION[corpus.layout.name], dict[str, dict[tuple[str, str], Array]]()
    parts: dict[str, Rows] = {action: actions.get(action, {}) for action in corpus.test}
    parts |= {MEAN: mean_over(actions, complete(corpus)), ALL: AVERAGES[corpus.layout.name]}
    for action in sorted(parts, key=lambda action: -len(parts[action])):  # so that systems keep the papers' order
        for name, values in parts[action].items():
            found.setdefault(PUBLISHED + name, {})[FEW, action] = at_frames(values)
    goals = PREDICTOR_GOALS.get(corpus.layout.name, {})
    return {**found, "goal": {(kind, MEAN): at_frames(values) for kind, values in goals.items()}}


def at_frames(values: Sequence[float]) -> Array:
    """Published values as an error (N,), NaN at frames that papers do not report."""
    error = np.full(max(PUBLISHED_FRAMES) + 1, np.nan)
    error[list(PUBLISHED_FRAMES)] = values
    return error


def _nested(found: Errors, name: str) -> dict[str, Any]:
    """The errors of one system: "windows_8" and so on -> action, or "mean" -> "frame_1" and so on."""
    nested: dict[str, Any] = {}
    for (kind, action), error in found[name].items():
        nested.setdefault(kind, {})[action] = by_frame(error)
    return nested
