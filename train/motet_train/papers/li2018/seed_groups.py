"""Runs that differ in nothing but their seed are measured as one: a row of a table."""

import json
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from motet.bundle.manifest import Manifest
from motet.models.predict import PredictModel
from motet.motion.rotations import Array
from motet_train.evaluate.predict.floors import key
from motet_train.evaluate.tables import short_names

SEED = re.compile(r"[-_. ]?(seed)?\d+$")
"""The end of a run's name that gives its seed."""

Models = Mapping[str, PredictModel]
Ready = dict[str, dict[str, Any]]
Figures = Callable[[str], dict[str, Any]]
"""The figures of a system or group, ready for JSON."""

Errors = Mapping[str, Mapping[Any, Array]]
"""Run or group, or the baseline -> action or measure -> error at each predicted frame (N,)."""


@dataclass(frozen=True)
class SeedGroup:
    """Runs of one system: what they are called together, and the names they were given by."""

    title: str
    runs: tuple[str, ...]

    @property
    def count(self) -> str:
        """What follows a name that stands for several runs."""
        return _count(self.runs)


def seed_groups(models: Models) -> list[SeedGroup]:
    """The groups of some models by name, in their order.

    Runs of equal model, config, recipe and data are one group; another one with the same seed is a group of its own.
    """
    groups: dict[tuple[str, int], list[str]] = {}
    seen: Counter[tuple[str, Any]] = Counter()
    for name, model in models.items():
        training = model.manifest.training
        system = _system(model.manifest) if "seed" in training else name
        twins = seen[system, training.get("seed")]
        seen[system, training.get("seed")] += 1
        groups.setdefault((system, twins), []).append(name)
    together = [tuple(names) for names in groups.values()]
    return [SeedGroup(title, runs) for title, runs in zip(_titles(together), together, strict=True)]


def _system(manifest: Manifest) -> str:
    """What all seeds of a system have in common."""
    training = manifest.training
    parts = manifest.model, manifest.config, training.get("recipe"), training.get("data")
    return json.dumps(parts, sort_keys=True)


def _titles(together: Sequence[tuple[str, ...]]) -> list[str]:
    """Short names, of several runs without their seed and with their number."""
    names = [name for runs in together for name in runs]
    short = dict(zip(names, short_names(names), strict=True))
    first = [short[runs[0]] for runs in together]
    stems = [_stem([short[name] for name in runs]) for runs in together]
    # names of different systems can have a stem in common
    stems = [one if stems.count(stem) > 1 else stem for one, stem in zip(first, stems, strict=True)]
    return [stem + _count(runs) for stem, runs in zip(stems, together, strict=True)]


def _count(runs: Sequence[str]) -> str:
    return "" if len(runs) == 1 else f" ({len(runs)} seeds)"


def _stem(names: Sequence[str]) -> str:
    """What the names of several runs have in common before their seeds; else the first name."""
    stems = {SEED.sub("", name) for name in names}
    return (stems.pop() or names[0]) if len(stems) == 1 < len(names) else names[0]


def mean(errors: Sequence[Array]) -> Array:
    """The mean (N,) of some errors (N,)."""
    result: Array = np.mean(errors, axis=0)
    return result


def spread(errors: Sequence[Array]) -> Array:
    """The largest minus the smallest (N,) of some errors (N,)."""
    result: Array = np.ptp(errors, axis=0)
    return result


def pooled(
    errors: Errors, groups: Sequence[SeedGroup], how: Callable[[Sequence[Array]], Array] = mean
) -> dict[str, dict[Any, Array]]:
    """The errors with groups, by their titles, in place of runs; what is not a run stays first."""
    runs = {name for group in groups for name in group.runs}
    found = {name: dict(parts) for name, parts in errors.items() if name not in runs}
    for group in groups:
        parts = errors[group.runs[0]]
        found[group.title] = {part: how([errors[name][part] for name in group.runs]) for part in parts}
    return found


def drawn(models: Models, groups: Sequence[SeedGroup]) -> dict[str, PredictModel]:
    """The first run of each group: a mean of poses is none."""
    return {group.runs[0]: models[group.runs[0]] for group in groups}


def ready(
    models: Models, groups: Sequence[SeedGroup], floors: Sequence[str], runs: Figures, means: Figures, spreads: Figures
) -> Ready:
    """The figures of each run and, under "zero_velocity", "constant_velocity" and so on, of the floors.

    Of several models also "grouped": title of each group of several runs -> their names as "runs", the figures of their
    mean, and as "spread" the largest minus the smallest.
    """
    beside = {key(floor): runs(floor) for floor in floors}
    found: Ready = {name: {**runs(name), **beside} for name in models}
    if len(models) > 1:
        found["grouped"] = {
            group.title: {"runs": list(group.runs), **means(group.title), "spread": spreads(group.title)}
            for group in groups
            if len(group.runs) > 1
        }
    return found
