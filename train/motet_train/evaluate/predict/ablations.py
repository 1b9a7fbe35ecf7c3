"""The ablations of the convolutional predictor (Li et al. 2018, section 4.3): what each setting is worth."""

from collections.abc import Mapping, Sequence
from typing import Any

from motet.models.predict import PredictModel
from motet_train.evaluate.predict.published import FRAMES
from motet_train.evaluate.predict.report import COUNTS, MEAN, Curves
from motet_train.evaluate.predict.rows import Row

MODEL = "convseq2seq"

WORDS = {
    ("long_term", "convolutional"): "convolutional encoder",
    ("long_term", "recurrent"): "LSTM encoder",
    ("long_term", "none"): "without long-term encoder",
    ("adversary", 0): "without adversary",
    ("adversary", None): "without adversary",
}
"""Setting and its value -> how papers put it; other settings are called by their names."""


def ablated(models: Mapping[str, PredictModel], rows: Sequence[Row]) -> dict[str, str]:
    """Title of each of the model's rows -> how it differs in settings from the first; {} where there is one only."""
    ours = [row for row in rows if models[row.runs[0]].manifest.get("model") == MODEL]
    if len(ours) < 2:
        return {}
    first, *others = ours
    given = _settings(models[first.runs[0]].manifest)
    said = {first.title: f"{first.title}, as it is"}
    for row in others:
        words = _differing(given, _settings(models[row.runs[0]].manifest))
        said[row.title] = f"{words}{row.count}" if words else row.title
    return said


def _settings(manifest: Mapping[str, Any]) -> dict[str, Any]:
    """Config and recipe of a run as one."""
    config, recipe = manifest["config"], manifest.get("training", {}).get("recipe", {})
    return {**config, **config.get("system", {}), **recipe}


def _differing(first: Mapping[str, Any], other: Mapping[str, Any]) -> str:
    """What has to be said of the second settings to who knows the first."""
    names = [name for name in {**first, **other} if name != "system" and first.get(name) != other.get(name)]
    return ", ".join(_said(name, other.get(name)) for name in names)


def _said(name: str, value: Any) -> str:
    if isinstance(value, list | tuple):
        return f"{name.replace('_', ' ')} {('x' if name == 'kernel' else ' / ').join(map(str, value))}"
    return WORDS.get((name, value), f"{name.replace('_', ' ')} {value}")


def ablations(found: Curves, said: Mapping[str, str]) -> str:
    """The means of such rows as text, at the frames that papers report, on few windows and on many."""
    width = max(36, *(len(words) + 3 for words in said.values()))
    frames = "".join(f"{frame:>6}" for frame in FRAMES)
    counts = "  ".join(f"{f'{count} windows':>30}" for count in COUNTS.values())
    lines = [
        f"{'ablations, mean of the actions':<{width}}{counts}",
        f"{'output frame':<{width}}" + "  ".join([frames] * len(COUNTS)),
    ]
    for title, words in said.items():
        parts = ("".join(f"{found[kind][title][MEAN][frame]:>6.2f}" for frame in FRAMES) for kind in COUNTS)
        lines.append(f"  {words:<{width - 2}}" + "  ".join(parts))
    return "\n".join(lines)
