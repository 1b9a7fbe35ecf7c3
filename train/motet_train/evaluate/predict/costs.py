"""What the systems of a table cost: parameters, and the time that training took."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from motet.models.predict import PredictModel
from motet_train.evaluate.predict.rows import Row


def costs(models: Mapping[str, PredictModel], rows: Sequence[Row]) -> str:
    """As text, a line for each row: parameters, the mean seconds of its runs' training, and where that was."""
    width = max(36, *(len(row.title) + 3 for row in rows))
    lines = [f"{'':<{width}}{'parameters':>12}{'training, s':>13}  on"]
    for row in rows:
        trainings = [models[name].manifest.get("training", {}) for name in row.runs]
        seconds = [training["seconds"] for training in trainings if "seconds" in training]
        places = sorted({_place(training) for training in trainings})
        parameters = f"{trainings[0]['parameters']:,}" if "parameters" in trainings[0] else ""
        time = f"{np.mean(seconds):.0f}" if seconds else ""
        lines.append(f"  {row.title:<{width - 2}}{parameters:>12}{time:>13}  {'; '.join(places)}".rstrip())
    return "\n".join(lines)


def _place(training: Mapping[str, Any]) -> str:
    threads = training.get("threads")
    return f"{training.get('machine', '')}{'' if threads is None else f', threads: {threads}'}"
