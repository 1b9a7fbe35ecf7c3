"""The table of the protocol: what was measured, and under it what papers report; and rows of errors in general."""

from collections.abc import Sequence

import numpy as np

from motet.motion.rotations import Array
from motet_train.data.expmap_files import ExpmapCorpus
from motet_train.evaluate.predict.curves import FEW, MANY, MEAN, ROTATION, Curves, complete
from motet_train.evaluate.predict.protocol import LABELS, REPORTED, true_times
from motet_train.evaluate.predict.published import FRAMES, GOAL, averages, by_action, mean_over
from motet_train.evaluate.predict.published_h36m import Rows
from motet_train.evaluate.tables import aligned

PUBLISHED = "published: "
"""What lines begin with that were not measured here."""

TITLES = {
    FEW: "8 windows of each action",
    MANY: "256 windows of each action",
    ROTATION: "256 windows, mean angle between predicted and true rotations of the joints that move, degrees",
}


def protocol_table(found: Curves, corpus: ExpmapCorpus) -> str:
    """As text: frames and true times above, then each action's rows, and on top of the means the averages of papers.

    Published figures are of eight windows and stand there only.
    """
    layout, whole = corpus.layout, complete(corpus)
    rows = [*frame_heads(), ("milliseconds, true", *(f"{time:.0f}" for time in true_times(layout.fps)))]
    rows.append(("milliseconds, as papers label them", *map(str, LABELS)))
    known = by_action(layout.name)
    beside = {**known, MEAN: mean_over(known, whole)}
    for kind, systems in found.items():
        rows += [("",), (TITLES[kind],)]
        for action in next(iter(systems.values())):
            rows.append((f"mean of {', '.join(whole)}" if action == MEAN else action,))
            rows += [error_row(name, errors[action]) for name, errors in systems.items()]
            rows += _published(beside.get(action, {})) if kind == FEW else []
    rows += [("",), (f"average of all {len(layout.test)} actions, 8 windows",), *_published(averages(layout.name))]
    if layout.name.startswith("cmu"):
        rows += [("goal of the mean, 8 windows",), error_row("goal", _at_frames(GOAL))]
    return aligned(rows)


def frame_heads(frames: Sequence[int] = REPORTED) -> list[tuple[str, ...]]:
    """The heads of columns of errors."""
    return [("output frame", *map(str, frames))]


def error_row(name: str, error: Array, frames: Sequence[int] = REPORTED, digits: int = 2) -> tuple[str, ...]:
    """A system's errors (N,) at some frames; an error that is not known is left out."""
    cells = (f"{error[frame]:.{digits}f}" if np.isfinite(error[frame]) else "" for frame in frames)
    return (f"  {name}", *cells)


def _published(rows: Rows) -> list[tuple[str, ...]]:
    return [error_row(PUBLISHED + name, _at_frames(values)) for name, values in rows.items()]


def _at_frames(values: tuple[float, ...]) -> Array:
    """Published values as an error (N,), NaN at frames that papers do not report."""
    error = np.full(max(FRAMES) + 1, np.nan)
    error[list(FRAMES)] = values
    return error
