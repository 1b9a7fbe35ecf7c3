"""The figures of the protocol: of each model and the floors, for each action and on average."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from motet.models.predict import PredictModel
from motet.motion.rotations import Array
from motet_train.data.errors import DataError
from motet_train.evaluate.predict.error_rows import REPORTED
from motet_train.evaluate.predict.seed_groups import SeedGroup, mean, pooled, spread
from motet_train.papers.li2018.expmap_files import ExpmapCorpus, scaling_of
from motet_train.papers.li2018.protocol import (
    OUTPUT_FRAMES,
    Continuation,
    errors,
    predictions,
    rotation_errors,
)
from motet_train.papers.li2018.text_floors import text_floors

COUNTS = {"windows_8": 8, "windows_256": 256}
"""Windows of each action: as many as papers take, and enough for a figure without much noise."""

FEW, MANY = COUNTS
ROTATION = "rotation"
"""Of the many windows, not the Euler error but :func:`rotation_errors`."""

MEAN = "mean"

Curves = dict[str, dict[str, dict[str, Array]]]
"""FEW, MANY or ROTATION -> system -> action, or MEAN -> error (25,)."""


def curves(
    models: Mapping[str, PredictModel], corpus: ExpmapCorpus, progress: Callable[[str], object] = lambda name: None
) -> Curves:
    """The errors of all systems, floors first. The mean is that of the actions that are :func:`complete`.

    progress: is told each system that has been measured, once for each of :data:`COUNTS`.
    DataError where there is no test file, or a model is not one of this corpus.
    """
    if not corpus.test:
        raise DataError("none of the test files was found")
    scaling = scaling_of(corpus.train)
    test = {action: list(files.values()) for action, files in corpus.test.items()}
    systems = text_floors(corpus)
    systems |= {name: predictor(name, model, corpus) for name, model in models.items()}
    found: Curves = {FEW: {}, MANY: {}, ROTATION: {}}
    for name, system in systems.items():
        predicted = {}
        for kind, count in COUNTS.items():
            predicted[kind] = predictions(system, test, scaling, count)
            found[kind][name] = errors(predicted[kind])
            progress(name)
        found[ROTATION][name] = errors(predicted[MANY], rotation_errors)
    whole = complete(corpus)
    for by_system in found.values():
        for measured in by_system.values():
            measured[MEAN] = np.mean([measured[action] for action in whole], axis=0)
    return found


def complete(corpus: ExpmapCorpus) -> list[str]:
    """The actions with all of their training and test files; where no action has them, all that are tested."""
    gaps = {name.split("/")[1] for name in corpus.missing if name.count("/") == 2}
    return [action for action in corpus.test if action not in gaps] or list(corpus.test)


def predictor(name: str, model: PredictModel, corpus: ExpmapCorpus) -> Continuation:
    """A model's predictions for windows of a corpus; DataError where it is not one of that corpus."""
    if len(model.contract.channels) != corpus.layout.columns or model.contract.skeleton is not None:
        raise DataError(f"{name} is not a model of these files: it has {len(model.contract.channels)} channels")

    def predict(seed: Array) -> Array:
        return model.next_frames(seed[:, -model.seed_frames :], OUTPUT_FRAMES).astype(np.float64)

    return predict


def by_group(found: Curves, groups: Sequence[SeedGroup], how: Callable[[Sequence[Array]], Array] = mean) -> Curves:
    """The same with groups in place of runs, see :func:`motet_train.evaluate.predict.seed_groups.pooled`."""
    return {kind: pooled(systems, groups, how) for kind, systems in found.items()}


def spreads_of(found: Curves, groups: Sequence[SeedGroup]) -> Curves:
    """The largest minus the smallest error of each group of several seeds, by its title."""
    several = [group for group in groups if len(group.runs) > 1]
    titles = {group.title for group in several}
    everything = by_group(found, several, spread)
    return {kind: {name: systems[name] for name in systems if name in titles} for kind, systems in everything.items()}


def to_json(found: Curves, name: str) -> dict[str, dict[str, dict[str, float]]]:
    """The errors of one system: "windows_8" and so on -> action, or "mean" -> "frame_1" and so on."""
    return {
        kind: {
            action: {f"frame_{frame}": round(float(error[frame]), 6) for frame in REPORTED}
            for action, error in systems[name].items()
        }
        for kind, systems in found.items()
    }
