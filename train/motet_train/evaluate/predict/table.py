"""The table of the protocol: what was measured, and under it what papers report."""

from collections.abc import Iterable

import numpy as np

from motet.motion.rotations import Array
from motet_train.data.expmap_files import ExpmapCorpus
from motet_train.evaluate.predict.protocol import LABELS, REPORTED, true_times
from motet_train.evaluate.predict.published import FRAMES, GOAL, averages, by_action, mean_over
from motet_train.evaluate.predict.published_h36m import Rows
from motet_train.evaluate.predict.report import FEW, MANY, MEAN, ROTATION, Curves, complete

PUBLISHED = "published: "
"""What lines begin with that were not measured here."""

TITLES = {
    FEW: "8 windows of each action",
    MANY: "256 windows of each action",
    ROTATION: "256 windows, mean angle between predicted and true rotations of the joints that move, degrees",
}


def table(found: Curves, corpus: ExpmapCorpus) -> str:
    """As text: frames and true times above, then each action's rows, and on top of the means the averages of papers.

    Published figures are of eight windows and stand there only.
    """
    layout, complete_ones = corpus.layout, complete(corpus)
    width = _width([*found[FEW], *(PUBLISHED + name for name in _names(layout.name))])
    true = "".join(f"{time:>7.0f}" for time in true_times(layout.fps))
    lines = [
        f"{'output frame':<{width}}" + "".join(f"{frame:>7}" for frame in REPORTED),
        f"{'milliseconds, true':<{width}}{true}",
        f"{'milliseconds, as papers label them':<{width}}" + "".join(f"{label:>7}" for label in LABELS),
    ]
    known = by_action(layout.name)
    beside = {**known, MEAN: mean_over(known, complete_ones)}
    for kind, systems in found.items():
        lines.append(f"\n{TITLES[kind]}")
        for action in next(iter(systems.values())):
            lines.append(f"mean of {', '.join(complete_ones)}" if action == MEAN else action)
            lines += [_line(name, errors[action], width) for name, errors in systems.items()]
            lines += _published(beside.get(action, {}), width) if kind == FEW else []
    lines += [f"\naverage of all {len(layout.test)} actions, 8 windows", *_published(averages(layout.name), width)]
    if layout.name.startswith("cmu"):
        lines += ["goal of the mean, 8 windows", _line("goal", _at_frames(GOAL), width)]
    return "\n".join(lines)


def _names(layout: str) -> set[str]:
    return {name for rows in (*by_action(layout).values(), averages(layout)) for name in rows}


def _width(names: Iterable[str]) -> int:
    return max(36, *(len(name) + 3 for name in names))


def _published(rows: Rows, width: int) -> list[str]:
    return [_line(PUBLISHED + name, _at_frames(values), width) for name, values in rows.items()]


def _at_frames(values: tuple[float, ...]) -> Array:
    """Published values as an error (N,), NaN at frames that papers do not report."""
    error = np.full(max(FRAMES) + 1, np.nan)
    error[list(FRAMES)] = values
    return error


def _line(name: str, error: Array, width: int) -> str:
    cells = (f"{error[frame]:>7.2f}" if np.isfinite(error[frame]) else " " * 7 for frame in REPORTED)
    return f"  {name:<{width - 2}}" + "".join(cells)
