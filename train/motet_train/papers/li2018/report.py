"""What predictors reach by the protocol, action by action, beside floors and the rows that papers publish.

Runs that differ in nothing but their seed are measured as one: a row of a table.
"""

import json
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from tqdm import tqdm

from motet.motion.rotations import Array
from motet.predict.model import PredictModel
from motet_train.data.errors import DataError
from motet_train.evaluate.predict.floors import FLOORS, REPORTED, by_frame, key
from motet_train.evaluate.tables import aligned, short_names
from motet_train.papers.li2018.expmap import ExpmapCorpus, scaling_of
from motet_train.papers.li2018.protocol import errors, predictions, predictor, rotation_errors, text_floors, true_times
from motet_train.papers.li2018.published import AVERAGES, BY_ACTION, PREDICTOR_GOALS, PUBLISHED_FRAMES, Rows, mean_over

KINDS = {
    "windows_8": "8 windows of each action",
    "windows_256": "256 windows of each action",
    "rotation": "256 windows, mean angle between predicted and true rotations of the joints that move, degrees",
}
"""As many windows of each action as papers take; enough for a figure without much noise; and of those, not the Euler
error but :func:`motet_train.papers.li2018.protocol.rotation_errors`."""

FEW, MANY, ANGLE_ERRORS = KINDS

MEAN, EVERY = "mean", "every"
"""In place of an action: the mean of those with all their files, and that of all, which only papers measured."""

Models = Mapping[str, PredictModel]
Groups = Mapping[str, Sequence[str]]
"""Title of a group of runs that differ in their seed alone -> the names they were given by."""

Errors = Mapping[str, Mapping[tuple[str, str], Array]]
"""System -> FEW, MANY or ANGLE_ERRORS, and an action or MEAN -> error (25,)."""


@dataclass(frozen=True, eq=False)
class Results:
    """Errors of models and floors in a corpus, and how the models fall into groups that differ in their seed alone."""

    models: Models
    corpus: ExpmapCorpus
    groups: Groups
    errors: Errors

    def grouped(self, how: Callable[..., Array] = np.mean) -> Errors:
        """Groups, by their titles, in place of runs; what is not a run stays first. how: mean, or np.ptp of seeds."""
        found = {name: dict(parts) for name, parts in self.errors.items() if name not in self.models}
        for title, runs in self.groups.items():
            parts = self.errors[runs[0]]
            found[title] = {part: how([self.errors[name][part] for name in runs], axis=0) for part in parts}
        return found

    def spreads(self) -> Errors:
        """The largest minus the smallest error of each group of several runs."""
        found = self.grouped(np.ptp)
        return {title: found[title] for title, runs in self.groups.items() if len(runs) > 1}

    def text(self) -> str:
        """The tables: errors, training, costs."""
        tables = harness_table(self.models, self.groups), cost_table(self.models, self.groups)
        return "\n\n".join((protocol_table(self.grouped(), self.corpus, self.spreads()), *tables))

    def to_json(self) -> dict[str, dict[str, Any]]:
        """The figures of each run and, under "zero_velocity", "constant_velocity" and so on, of the floors.

        Each: "windows_8" and so on -> action, or "mean" -> "frame_1" and so on. Of several models also "grouped": title
        of each group of several runs -> their names as "runs", the figures of their mean, and of "spread".
        """
        beside = {key(name): _nested(parts) for name, parts in self.errors.items() if name in FLOORS}
        found: dict[str, dict[str, Any]] = {name: {**_nested(self.errors[name]), **beside} for name in self.models}
        if len(self.models) > 1:
            means = self.grouped()
            found["grouped"] = {
                title: {"runs": list(self.groups[title]), **_nested(means[title]), "spread": _nested(spread)}
                for title, spread in self.spreads().items()
            }
        return found


def _nested(parts: Mapping[tuple[str, str], Array]) -> dict[str, Any]:
    nested: dict[str, Any] = {}
    for (kind, action), error in parts.items():
        nested.setdefault(kind, {})[action] = by_frame(error)
    return nested


def protocol_results(models: Models, corpus: ExpmapCorpus) -> Results:
    """Measure all systems, floors first; DataError without a test file, or for a model that is not of this corpus."""
    if not corpus.test:
        raise DataError("none of the test files was found")
    systems = text_floors(corpus) | {name: predictor(name, model, corpus) for name, model in models.items()}
    scaling, measured = scaling_of(corpus.train), dict[str, Mapping[tuple[str, str], Array]]()
    test = {action: list(files.values()) for action, files in corpus.test.items()}
    with tqdm(systems.items(), unit=" systems", disable=None, leave=False) as bar:
        for name, system in bar:
            few, many = (predictions(system, test, scaling, count) for count in (8, 256))
            found = {FEW: errors(few), MANY: errors(many), ANGLE_ERRORS: errors(many, rotation_errors)}
            for parts in found.values():
                parts[MEAN] = np.mean([parts[action] for action in complete(corpus)], axis=0)
            measured[name] = {(kind, action): parts[action] for kind, parts in found.items() for action in parts}
    return Results(models, corpus, seed_groups(models), measured)


def complete(corpus: ExpmapCorpus) -> list[str]:
    """The actions with all of their training and test files; where no action has them, all that are tested."""
    gaps = {name.split("/")[1] for name in corpus.missing if name.count("/") == 2}
    return [action for action in corpus.test if action not in gaps] or list(corpus.test)


def seed_groups(models: Models) -> Groups:
    """The groups of some models by name, in their order.

    Runs of equal model, config, recipe and data are one group; another one with the same seed is a group of its own.
    """
    groups: dict[tuple[str, int], list[str]] = {}
    seen: Counter[tuple[str, Any]] = Counter()
    for name, model in models.items():
        manifest, training = model.manifest, model.manifest.training
        parts = manifest.model, manifest.config, training.get("recipe"), training.get("data")
        system = json.dumps(parts, sort_keys=True) if "seed" in training else name
        groups.setdefault((system, seen[system, training.get("seed")]), []).append(name)
        seen[system, training.get("seed")] += 1
    short, titles = dict(zip(models, short_names(list(models)), strict=True)), []
    for runs in groups.values():
        names = [short[name] for name in runs]
        stems = {re.sub(r"[-_. ]?(seed)?\d+$", "", name) for name in names}  # without the seed
        titles.append(((stems.pop() if len(stems) == 1 < len(runs) else "") or names[0], names[0]))
    found = [title for title, _ in titles]  # of different systems they can be the same
    unique = [first if found.count(title) > 1 else title for title, first in titles]
    counts = ["" if len(runs) == 1 else f" ({len(runs)} seeds)" for runs in groups.values()]
    return {title + count: runs for title, count, runs in zip(unique, counts, groups.values(), strict=True)}


def protocol_table(found: Errors, corpus: ExpmapCorpus, spreads: Errors | None = None) -> str:
    """As text: frames and true times, then the systems in each action, and under them what papers report.

    spreads: of the systems that are means of several seeds; they stand in brackets behind the mean.
    """
    beside = spreads or {}
    room = 6 if beside else 0

    def head(name: str, cells: Sequence[str]) -> tuple[str, ...]:
        return (name, *(cell + " " * room for cell in cells))

    def row(name: str, error: Array, spread: Array | None) -> tuple[str, ...]:
        more = ["" if spread is None else f"[{spread[f]:.2f}]".replace("[0.", "[.") for f in REPORTED]
        known = [f"{error[f]:.2f}{end:>{room}}" for f, end in zip(REPORTED, more, strict=True)]
        return (f"  {name}", *(cell if np.isfinite(error[f]) else "" for f, cell in zip(REPORTED, known, strict=True)))

    rows = [
        head("output frame", [str(frame) for frame in REPORTED]),
        head("milliseconds, true", [f"{time:.0f}" for time in true_times(corpus.layout.fps)]),
        head("milliseconds, as papers label them", ["80", "160", "320", "400", "560", "1000"]),
        *([("in brackets: the largest seed's minus the smallest's",)] if beside else []),
    ]
    titles = {MEAN: f"mean of {', '.join(complete(corpus))}"}
    titles[EVERY] = f"average of all {len(corpus.layout.test)} actions, 8 windows"
    systems, first = [*found.items(), *published(corpus).items()], next(iter(corpus.test))
    for kind, action in dict.fromkeys(part for _, parts in systems for part in parts):
        above = [("",), (KINDS[kind],)] if action == first else [("",)] if action == EVERY else []
        rows += [*above, (titles.get(action, action),)]
        for name, parts in systems:
            if (kind, action) in parts:
                rows.append(row(name, parts[kind, action], beside.get(name, {}).get((kind, action))))
    return aligned(rows)


def published(corpus: ExpmapCorpus) -> Errors:
    """What papers report of a corpus, on eight windows, and the goals of the small predictor."""

    def at_frames(values: Sequence[float]) -> Array:
        error = np.full(max(PUBLISHED_FRAMES) + 1, np.nan)
        error[list(PUBLISHED_FRAMES)] = values
        return error

    name, found = corpus.layout.name, dict[str, dict[tuple[str, str], Array]]()
    parts: dict[str, Rows] = {action: BY_ACTION[name].get(action, {}) for action in corpus.test}
    parts |= {MEAN: mean_over(BY_ACTION[name], complete(corpus)), EVERY: AVERAGES[name]}
    for action in sorted(parts, key=lambda action: -len(parts[action])):  # so that systems keep the papers' order
        for system, values in parts[action].items():
            found.setdefault(f"published: {system}", {})[FEW, action] = at_frames(values)
    goals = PREDICTOR_GOALS.get(name, {})
    return {**found, "goal": {(kind, MEAN): at_frames(values) for kind, values in goals.items()}}


def harness_table(models: Models, groups: Groups) -> str:
    """As text, a line for each group: its seeds, training files and files held out, augmentation, rate and steps.

    What a manifest does not say is left out. "kept": the step whose weights are kept, from the earliest of the seeds
    to the latest, and by what: the best by the validation error, or the last.
    """
    shown = ("warp", "reverse", "mirror", "average", "learning_rate")  # the fourth is the running mean of the weights
    rows = [("", "seeds", "files", "held out", *shown[:4], "rate", "steps", "kept", "by")]
    for title, runs in groups.items():
        trainings = [models[name].manifest.training for name in runs]
        recipe, data = trainings[0].get("recipe", {}), trainings[0].get("data", {})
        found = ({one[key] for one in trainings if key in one} for key in ("seed", "steps", "kept_step"))
        seeds, steps, kept = ("-".join(map(str, sorted({min(one), max(one)}))) if one else "" for one in found)
        cells = ["" if value is None else f"{value:g}" for value in (data.get("files"), *map(recipe.get, shown))]
        held = str(len(data.get("validation", ()))) if "files" in data else ""
        rows.append((f"  {title}", seeds, cells[0], held, *cells[1:], steps, kept, recipe.get("keep", "")))
    return aligned(rows)


def cost_table(models: Models, groups: Groups) -> str:
    """As text, a line for each group: parameters, the mean seconds of its runs' training, and where that was."""
    rows = [("", "parameters", "training, s", "on")]
    for title, runs in groups.items():
        trainings = [models[name].manifest.training for name in runs]
        seconds = [training["seconds"] for training in trainings if "seconds" in training]
        parameters = f"{trainings[0]['parameters']:,}" if "parameters" in trainings[0] else ""
        threads = [f", threads: {one['threads']}" if one.get("threads") is not None else "" for one in trainings]
        places = {one.get("machine", "") + more for one, more in zip(trainings, threads, strict=True)}
        mean = f"{np.mean(seconds):.0f}" if seconds else ""
        rows.append((f"  {title}", parameters, mean, "; ".join(sorted(places))))
    return aligned(rows, left=(0, 3))
