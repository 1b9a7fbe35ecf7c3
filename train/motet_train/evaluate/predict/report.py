"""The table of the protocol: each model and the zero-velocity baseline, for each action and on average."""

from collections.abc import Mapping

import numpy as np

from motet.predict import PredictModel
from motet.rotations import Array
from motet_train.data.errors import DataError
from motet_train.data.expmap_files import ExpmapCorpus, scaling_of
from motet_train.evaluate.predict.protocol import (
    LABELS,
    OUTPUT_FRAMES,
    REPORTED,
    Predictor,
    evaluate,
    true_times,
    zero_velocity,
)
from motet_train.evaluate.predict.published import FRAMES, GOAL, rows

COUNTS = (8, 256)
"""Windows of each action: as many as papers take, and enough for a figure without much noise."""

ZERO = "zero velocity"
MEAN = "mean"

Curves = dict[int, dict[str, dict[str, Array]]]
"""Windows of each action -> system -> action, or MEAN -> error (25,)."""


def curves(models: Mapping[str, PredictModel], corpus: ExpmapCorpus) -> Curves:
    """The errors of all systems. The mean is that of the actions that are :func:`complete`.

    DataError where there is no test file, or a model is not one of this corpus.
    """
    if not corpus.test:
        raise DataError("none of the test files is here")
    scaling = scaling_of(corpus.train)
    test = {action: list(files.values()) for action, files in corpus.test.items()}
    systems: dict[str, Predictor] = {ZERO: zero_velocity}
    systems |= {name: _predictor(name, model, corpus) for name, model in models.items()}
    found: Curves = {}
    for count in COUNTS:
        found[count] = {name: evaluate(system, test, scaling, count) for name, system in systems.items()}
        for errors in found[count].values():
            errors[MEAN] = np.mean([errors[action] for action in complete(corpus)], axis=0)
    return found


def complete(corpus: ExpmapCorpus) -> list[str]:
    """The actions with all of their training and test files; where no action has them, all that are tested."""
    gaps = {name.split("/")[1] for name in corpus.missing if name.count("/") == 2}
    return [action for action in corpus.test if action not in gaps] or list(corpus.test)


def _predictor(name: str, model: PredictModel, corpus: ExpmapCorpus) -> Predictor:
    if len(model.contract.channels) != corpus.layout.columns or model.contract.skeleton is not None:
        raise DataError(f"{name} is no model of these text files: it has {len(model.contract.channels)} channels")

    def predict(seed: Array) -> Array:
        return model.next_frames(seed[:, -model.seed_frames :], OUTPUT_FRAMES).astype(np.float64)

    return predict


def table(found: Curves, corpus: ExpmapCorpus) -> str:
    """The table as text: frames and true times above, published rows and the goal below the means."""
    layout, width = corpus.layout, max(34, *(len(name) for name in found[COUNTS[0]]))
    true = "".join(f"{time:>7.0f}" for time in true_times(layout.fps))
    lines = [
        f"{'output frame':<{width}}" + "".join(f"{frame:>7}" for frame in REPORTED),
        f"{'milliseconds, true':<{width}}{true}",
        f"{'milliseconds, as papers label them':<{width}}" + "".join(f"{label:>7}" for label in LABELS),
    ]
    for count, systems in found.items():
        lines.append(f"\n{count} windows of each action")
        for action in next(iter(systems.values())):
            title = f"mean of {', '.join(complete(corpus))}" if action == MEAN else action
            lines += [title, *(_line(name, errors[action], width) for name, errors in systems.items())]
    lines.append("\npublished means, 8 windows")
    lines += [_published(name, values, width) for name, values in rows(layout.name).items()]
    if layout.name.startswith("cmu"):
        lines.append(_published("goal", GOAL, width))
    return "\n".join(lines)


def _line(name: str, errors: Array, width: int) -> str:
    return f"  {name:<{width - 2}}" + "".join(f"{errors[frame]:>7.2f}" for frame in REPORTED)


def _published(name: str, values: tuple[float, ...], width: int) -> str:
    known = dict(zip(FRAMES, values, strict=True))
    cells = (f"{known[frame]:>7.2f}" if np.isfinite(known.get(frame, np.nan)) else " " * 7 for frame in REPORTED)
    return f"  {name:<{width - 2}}" + "".join(cells)


def to_json(found: Curves, name: str) -> dict[str, dict[str, dict[str, float]]]:
    """The errors of one system: "windows_8" -> action, or "mean" -> "frame_1" and so on."""
    return {
        f"windows_{count}": {
            action: {f"frame_{frame}": round(float(error[frame]), 6) for frame in REPORTED}
            for action, error in systems[name].items()
        }
        for count, systems in found.items()
    }
