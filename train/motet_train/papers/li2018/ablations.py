"""The ablations of the convolutional predictor (Li et al. 2018, section 4.3): what each setting is worth."""

from collections.abc import Mapping, Sequence
from typing import Any

from motet.bundle.manifest import Manifest
from motet.models.predict import PredictModel
from motet_train.evaluate.predict.error_rows import ErrorRows
from motet_train.evaluate.predict.seed_groups import SeedGroup
from motet_train.papers.li2018.curves import COUNTS, MEAN, Curves
from motet_train.papers.li2018.published import FRAMES

MODEL = "convseq2seq"

WORDS = {
    ("long_term", "convolutional"): "convolutional encoder",
    ("long_term", "recurrent"): "LSTM encoder",
    ("long_term", "none"): "without long-term encoder",
    ("adversary", 0): "without adversary",
    ("adversary", None): "without adversary",
}
"""Setting and its value -> how papers put it; other settings are called by their names."""


def ablated(models: Mapping[str, PredictModel], groups: Sequence[SeedGroup]) -> dict[str, str]:
    """Title of each of the model's groups -> how its settings differ from the first; {} where there is one only."""
    ours = [group for group in groups if models[group.runs[0]].manifest.model == MODEL]
    if len(ours) < 2:
        return {}
    first, *others = ours
    given = models[first.runs[0]].manifest
    said = {first.title: f"{first.title}, as it is"}
    for group in others:
        words = difference(given, models[group.runs[0]].manifest)
        said[group.title] = f"{words}{group.count}" if words else group.title
    return said


def difference(first: Manifest, other: Manifest) -> str:
    """How the second's settings differ from the first's, in words; "" where they do not."""
    return _differing(_settings(first), _settings(other))


def _settings(manifest: Manifest) -> dict[str, Any]:
    """Config and recipe of a run as one."""
    config, recipe = manifest.config, manifest.training.get("recipe", {})
    return {**config, **config.get("system", {}), **recipe}


def _differing(first: Mapping[str, Any], other: Mapping[str, Any]) -> str:
    """How the second settings differ from the first, in words."""
    names = [name for name in {**first, **other} if name != "system" and first.get(name) != other.get(name)]
    return ", ".join(_said(name, other.get(name)) for name in names)


def _said(name: str, value: Any) -> str:
    if isinstance(value, list | tuple):
        return f"{name.replace('_', ' ')} {('x' if name == 'kernel' else ' / ').join(map(str, value))}"
    return WORDS.get((name, value), f"{name.replace('_', ' ')} {value}")


def ablation_table(found: Curves, said: Mapping[str, str], spreads: Curves | None = None) -> str:
    """The means of such rows as text, at the frames that papers report, on few windows and on many."""
    beside = spreads or {}
    rows = ErrorRows(any(beside.values()), FRAMES)
    for kind, count in COUNTS.items():
        rows.title(f"ablations, mean of the actions, {count} windows of each")
        for title, words in said.items():
            more = beside.get(kind, {}).get(title)
            rows.add(words, found[kind][title][MEAN], None if more is None else more[MEAN])
    return rows.text()
