"""How the systems of a table were trained, by their manifests: on what, by which recipe, and what that cost."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from motet.models.predict import PredictModel
from motet_train.evaluate.tables import aligned
from motet_train.papers.li2018.seed_groups import SeedGroup

AUGMENTATION = ("warp", "reverse", "mirror", "average")
"""What varies the windows (:class:`motet_train.data.predict_data.Windows`), and the running mean of the weights."""


def harness_table(models: Mapping[str, PredictModel], groups: Sequence[SeedGroup]) -> str:
    """As text, a line for each group: its seeds, training files and files held out, augmentation, rate and steps.

    What a manifest does not say is left out. "kept": the step whose weights are kept, from the earliest of the seeds
    to the latest, and by what: the best by the validation error, or the last.
    """
    rows = [("", "seeds", "files", "held out", *AUGMENTATION, "rate", "steps", "kept", "by")]
    for group in groups:
        trainings = [models[name].manifest.training for name in group.runs]
        recipe, data = trainings[0].get("recipe", {}), trainings[0].get("data", {})
        steps, kept = (_range([one[key] for one in trainings if key in one]) for key in ("steps", "kept_step"))
        shown = [_said(recipe.get(key)) for key in (*AUGMENTATION, "learning_rate")]
        seeds = _range([one["seed"] for one in trainings if "seed" in one])
        held = str(len(data.get("validation", ()))) if "files" in data else ""
        rows.append(
            (f"  {group.title}", seeds, _said(data.get("files")), held, *shown, steps, kept, recipe.get("keep", ""))
        )
    return aligned(rows)


def _said(value: Any) -> str:
    return "" if value is None else f"{value:g}"


def _range(values: Sequence[int]) -> str:
    """The values from the smallest to the largest."""
    if not values:
        return ""
    first, last = min(values), max(values)
    return str(first) if first == last else f"{first}-{last}"


def cost_table(models: Mapping[str, PredictModel], groups: Sequence[SeedGroup]) -> str:
    """As text, a line for each group: parameters, the mean seconds of its runs' training, and where that was."""
    rows = [("", "parameters", "training, s", "on")]
    for group in groups:
        trainings = [models[name].manifest.training for name in group.runs]
        seconds = [training["seconds"] for training in trainings if "seconds" in training]
        parameters = f"{trainings[0]['parameters']:,}" if "parameters" in trainings[0] else ""
        places = "; ".join(sorted({_place(training) for training in trainings}))
        rows.append((f"  {group.title}", parameters, f"{np.mean(seconds):.0f}" if seconds else "", places))
    return aligned(rows, left=(0, 3))


def _place(training: Mapping[str, Any]) -> str:
    threads = training.get("threads")
    return f"{training.get('machine', '')}{'' if threads is None else f', threads: {threads}'}"
