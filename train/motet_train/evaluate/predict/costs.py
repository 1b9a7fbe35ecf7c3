"""What the systems of a table cost: parameters, and the time that training took."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from motet.models.predict import PredictModel
from motet_train.evaluate.predict.seed_groups import SeedGroup
from motet_train.evaluate.tables import aligned


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
