"""Errors of predictors by the protocol, action by action, with floors and published rows.

Runs that differ only in their seed share a row of a table.
"""

import json
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np
from tqdm import tqdm

from motet.bundle.fields import Json
from motet.motion.rotations import Array
from motet.predict.model import PredictModel
from motet_train.data.errors import DataError
from motet_train.evaluate.predict.floors import FLOORS, REPORTED, by_frame, key
from motet_train.evaluate.tables import aligned, short_names
from motet_train.papers.li2018.expmap import ExpmapCorpus, scaling_of
from motet_train.papers.li2018.protocol import errors, predictions, predictor, rotation_errors, text_floors, true_times
from motet_train.papers.li2018.published import AVERAGES, BY_ACTION, PREDICTOR_GOALS, PUBLISHED_FRAMES, Rows, mean_over

FIGURE_KINDS = {
    "windows_8": "8 windows of each action",
    "windows_256": "256 windows of each action",
    "rotation": "256 windows, mean angle between predicted and true rotations of the joints that move, degrees",
}
"""Kinds of figures: as many windows of each action as in papers; enough for a figure with little noise; and, of these,
:func:`motet_train.papers.li2018.protocol.rotation_errors` in place of Euler errors."""

FEW, MANY, ANGLE_ERRORS = FIGURE_KINDS

MEAN = "mean"
"""In place of an action: the mean of the actions with all their files."""

EVERY = "every"
"""In place of an action: the mean of all actions, which only papers measured."""

Models = Mapping[str, PredictModel]
Groups = Mapping[str, Sequence[str]]
"""Title of a group of runs that differ only in their seed -> their names."""

Parts = Mapping[tuple[str, str], Array]
"""FEW, MANY or ANGLE_ERRORS, and an action or MEAN -> error (25,)."""

Errors = Mapping[str, Parts]
"""System -> its errors."""


@dataclass(frozen=True, eq=False)
class Results:
    """Errors of models and floors on a corpus, and the groups of models that differ only in their seed."""

    models: Models
    corpus: ExpmapCorpus
    groups: Groups
    errors: Errors

    def grouped(self, combine: Callable[..., Array] = np.mean) -> Errors:
        """Groups, by their titles, in place of runs, after the floors. combine: np.mean, or np.ptp of the seeds."""
        grouped = {name: dict(parts) for name, parts in self.errors.items() if name not in self.models}
        for title, runs in self.groups.items():
            grouped[title] = {}
            for part in self.errors[runs[0]]:
                grouped[title][part] = combine([self.errors[name][part] for name in runs], axis=0)
        return grouped

    def spreads(self) -> Errors:
        """The largest minus the smallest error of each group of several runs."""
        ranges = self.grouped(np.ptp)
        return {title: ranges[title] for title, runs in self.groups.items() if len(runs) > 1}

    def text(self) -> str:
        """The tables: errors, training, costs."""
        tables = [
            protocol_table(self.grouped(), self.corpus, self.spreads()),
            harness_table(self.models, self.groups),
            cost_table(self.models, self.groups),
        ]
        return "\n\n".join(tables)

    def to_json(self) -> Json:
        """The figures of each run and, under "zero_velocity", "constant_velocity" and so on, of the floors.

        Each is "windows_8" and so on -> action, or "mean" -> "frame_1" and so on. For several models also "grouped":
        title of each group of several runs -> their names as "runs", and the figures of their mean and of "spread".
        """
        floors = {key(name): _nested(parts) for name, parts in self.errors.items() if name in FLOORS}
        figures: dict[str, Json] = {}
        for name in self.models:
            figures[name] = {**_nested(self.errors[name]), **floors}
        if len(self.models) > 1:
            means = self.grouped()
            grouped = {}
            for title, spread in self.spreads().items():
                runs = list(self.groups[title])
                grouped[title] = {"runs": runs, **_nested(means[title]), "spread": _nested(spread)}
            figures["grouped"] = grouped
        return figures


def _nested(parts: Parts) -> Json:
    nested: dict[str, Any] = {}
    for (kind, action), error in parts.items():
        nested.setdefault(kind, {})[action] = by_frame(error)
    return nested


def protocol_results(models: Models, corpus: ExpmapCorpus) -> Results:
    """Measure all systems, floors first; DataError without a test file, or for a model of other data."""
    if not corpus.test:
        raise DataError("none of the test files was found")
    systems = text_floors(corpus) | {name: predictor(name, model, corpus) for name, model in models.items()}
    # windows of the test files
    scaling = scaling_of(corpus.train)
    test = {action: list(files.values()) for action, files in corpus.test.items()}
    measured: dict[str, Parts] = {}
    for name, system in tqdm(systems.items(), unit=" systems", disable=None, leave=False):
        few = predictions(system, test, scaling, 8, corpus.layout)
        many = predictions(system, test, scaling, 256, corpus.layout)
        by_kind = {FEW: errors(few), MANY: errors(many), ANGLE_ERRORS: errors(many, rotation_errors)}
        measured[name] = _with_means(by_kind, complete(corpus))
    return Results(models, corpus, seed_groups(models), measured)


def _with_means(by_kind: Mapping[str, Mapping[str, Array]], actions: Sequence[str]) -> Parts:
    """The errors of each kind and action, and of each kind the mean over some actions."""
    parts = {}
    for kind, by_action in by_kind.items():
        mean = np.mean([by_action[action] for action in actions], axis=0)
        for action, error in {**by_action, MEAN: mean}.items():
            parts[kind, action] = error
    return parts


def complete(corpus: ExpmapCorpus) -> list[str]:
    """The actions with all of their training and test files, or, if there are none, all that are tested."""
    gaps = {name.split("/")[1] for name in corpus.missing if name.count("/") == 2}
    return [action for action in corpus.test if action not in gaps] or list(corpus.test)


def seed_groups(models: Models) -> Groups:
    """The groups of models, in their order, by title.

    Runs of equal model, config, recipe and data form a group; further ones with a seed that it has form another.
    """
    # by system, and by how often its seed has been seen
    groups: dict[tuple[str, int], list[str]] = {}
    seen: Counter[tuple[str, Any]] = Counter()
    for name, model in models.items():
        system = _system(name, model)
        seed = model.manifest.training.get("seed")
        groups.setdefault((system, seen[system, seed]), []).append(name)
        seen[system, seed] += 1
    return _titled(list(groups.values()), dict(zip(models, short_names(list(models)), strict=True)))


def _titled(groups: Sequence[list[str]], short: Mapping[str, str]) -> Groups:
    """Groups of runs by their titles, made of the runs' short names."""
    stems = [_stem(list(map(short.__getitem__, runs))) for runs in groups]
    titled: dict[str, list[str]] = {}
    for runs, stem in zip(groups, stems, strict=True):
        # different systems can have the same stem
        title = short[runs[0]] if stems.count(stem) > 1 else stem
        titled[title if len(runs) == 1 else f"{title} ({len(runs)} seeds)"] = runs
    return titled


def _system(name: str, model: PredictModel) -> str:
    """A text that is equal for runs that differ only in their seed; the name of a model without a seed."""
    manifest = model.manifest
    training = manifest.training
    if "seed" not in training:
        return name
    return json.dumps([manifest.model, manifest.config, training.get("recipe"), training.get("data")], sort_keys=True)


def _stem(names: Sequence[str]) -> str:
    """The common name of several runs without their seeds, or else the first name."""
    stems = {re.sub(r"[-_. ]?(seed)?\d+$", "", name) for name in names}
    return (stems.pop() if len(stems) == 1 < len(names) else "") or names[0]


def protocol_table(systems: Errors, corpus: ExpmapCorpus, spreads: Errors) -> str:
    """A text table: frames and true times, then for each action the systems, and below them the published rows.

    spreads: of systems that are means of several seeds, shown in brackets behind the mean.
    """
    room = 6 if spreads else 0
    rows = _head(corpus, room)
    if spreads:
        rows.append(("in brackets: the largest seed's minus the smallest's",))
    titles = {
        MEAN: f"mean of {', '.join(complete(corpus))}",
        EVERY: f"average of all {len(corpus.layout.test)} actions, 8 windows",
    }

    # each part, with all systems that have it
    every = [*systems.items(), *published(corpus).items()]
    first = next(iter(corpus.test))
    for part in dict.fromkeys(chain.from_iterable(parts for _, parts in every)):
        kind, action = part
        if action in (first, EVERY):
            rows.append(("",))
        if action == first:
            rows.append((FIGURE_KINDS[kind],))
        rows.append((titles.get(action, action),))
        for name, parts in every:
            if part in parts:
                rows.append((f"  {name}", *_cells(parts[part], spreads.get(name, {}).get(part), room)))
    return aligned(rows)


def _head(corpus: ExpmapCorpus, room: int) -> list[tuple[str, ...]]:
    """The rows of frames and times, with room for spreads at the end of each cell."""
    times = true_times(corpus.layout.fps)
    rows = [
        ["output frame", *map(str, REPORTED)],
        ["milliseconds, true", *(f"{time:.0f}" for time in times)],
        ["milliseconds, as papers label them", "80", "160", "320", "400", "560", "1000"],
    ]
    head = []
    for name, *cells in rows:
        head.append((name, *(cell + " " * room for cell in cells)))
    return head


def _cells(error: Array, spread: Array | None, room: int) -> list[str]:
    """The errors (25,) at the reported frames, with their spread if there is one."""
    cells = []
    for frame in REPORTED:
        bracket = "" if spread is None else f"[{spread[frame]:.2f}]".replace("[0.", "[.")
        cells.append(f"{error[frame]:.2f}{bracket:>{room}}" if np.isfinite(error[frame]) else "")
    return cells


def published(corpus: ExpmapCorpus) -> Errors:
    """The published errors on a corpus, on eight windows, and the goals of the small predictor."""
    name = corpus.layout.name
    by_action: dict[str, Rows] = {action: BY_ACTION[name].get(action, {}) for action in corpus.test}
    by_action[MEAN] = mean_over(BY_ACTION[name], complete(corpus))
    by_action[EVERY] = AVERAGES[name]
    systems: dict[str, dict[tuple[str, str], Array]] = {}
    # actions with most systems first, so that these keep the papers' order
    for action in sorted(by_action, key=lambda action: -len(by_action[action])):
        for system, values in by_action[action].items():
            systems.setdefault(f"published: {system}", {})[FEW, action] = _at_frames(values)
    goals = PREDICTOR_GOALS.get(name, {})
    return {**systems, "goal": {(kind, MEAN): _at_frames(values) for kind, values in goals.items()}}


def _at_frames(values: Sequence[float]) -> Array:
    """Errors (25,) from those at the published frames, NaN elsewhere."""
    error = np.full(max(PUBLISHED_FRAMES) + 1, np.nan)
    error[list(PUBLISHED_FRAMES)] = values
    return error


def harness_table(models: Models, groups: Groups) -> str:
    """A text table with a line for each group: seeds, training files, files held out, augmentation, rate and steps.

    Entries that a manifest lacks are empty. "kept": the step of the kept weights, from the earliest to the latest of
    the seeds, and the criterion: the best validation error, or the last step.
    """
    settings = ("warp", "reverse", "mirror", "average", "learning_rate")  # average: the running mean of the weights
    rows = [("", "seeds", "files", "held out", *settings[:4], "rate", "steps", "kept", "by")]
    for title, runs in groups.items():
        trainings = [models[name].manifest.training for name in runs]
        recipe = trainings[0].get("recipe", {})
        data = trainings[0].get("data", {})
        # what a recipe leaves out stays empty
        cells = [_cell(recipe.get(key), "g") for key in settings]
        files = _cell(data.get("files"), "g")
        held_out = str(len(data.get("validation", ()))) if "files" in data else ""
        # a range where the runs of a group differ
        seeds, steps, kept = (_range(trainings, key) for key in ("seed", "steps", "kept_step"))
        rows.append((f"  {title}", seeds, files, held_out, *cells, steps, kept, recipe.get("keep", "")))
    return aligned(rows)


def _cell(value: Any, form: str) -> str:
    return "" if value is None else format(value, form)


def _range(trainings: Sequence[Json], key: str) -> str:
    """The least and the largest value of an entry, or the only one."""
    values = {training[key] for training in trainings if key in training}
    return "-".join(map(str, sorted({min(values), max(values)}))) if values else ""


def cost_table(models: Models, groups: Groups) -> str:
    """A text table with a line for each group: parameters, mean training time in seconds, and the machines."""
    rows = [("", "parameters", "training, s", "on")]
    for title, runs in groups.items():
        trainings = [models[name].manifest.training for name in runs]
        seconds = [training["seconds"] for training in trainings if "seconds" in training]
        parameters = _cell(trainings[0].get("parameters"), ",")
        mean = _cell(np.mean(seconds) if seconds else None, ".0f")
        rows.append((f"  {title}", parameters, mean, "; ".join(sorted(set(map(_machine, trainings))))))
    return aligned(rows, left=(0, 3))


def _machine(training: Json) -> str:
    threads = training.get("threads")
    machine: str = training.get("machine", "")
    return machine if threads is None else f"{machine}, threads: {threads}"
