"""Errors of predictions over time (as figures 3 and 4 of Li et al. 2018)."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from motet.motion.rotations import Array
from motet_train.evaluate.figures import panels
from motet_train.evaluate.predict.floors import CONSTANT, FLOORS

INSIDE = 4
"""Systems whose names have room in a panel."""

STYLES = ("-", "--", ":", "-.")
"""Of lines: another one where the ten colours begin again."""

GREYS = ("-", "--", ":", "-.", (0, (1, 3)))
"""Of the lines of floors."""


def error_over_time(errors: Mapping[str, Mapping[str, Array]], fps: float, unit: str) -> Figure:
    """Errors (N,) of systems, a panel for each action or measure, against the true time at ``fps``.

    A panel ends a little above the largest error of what is not constant velocity, which soon leaves it.
    """
    columns = min(3, len(errors))
    rows = -(-len(errors) // columns)
    looks = _looks(list(next(iter(errors.values()))))
    width = 4.2 * columns + (2.6 if len(looks) > INSIDE else 0)
    figure, axes = panels(rows, columns, (width, 3.2 * rows))
    for axis in axes[len(errors) :]:
        axis.remove()
    for axis, (title, systems) in zip(axes, errors.items(), strict=False):
        for name, error in systems.items():
            axis.plot((np.arange(len(error)) + 1) / fps * 1000, error, label=name, **looks[name])
        axis.set(title=title, xlabel="ms", ylabel=unit, ylim=(0, _top(systems)))
    if len(looks) > INSIDE:
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside right upper")
    else:
        axes[0].legend()
    return figure


def _top(systems: Mapping[str, Array]) -> float:
    shown = [error for name, error in systems.items() if not name.startswith(CONSTANT)] or list(systems.values())
    return 1.1 * max(float(error.max()) for error in shown)


def _looks(names: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Colour and style of each system's line: floors are grey."""
    floors = [name for name in names if name in FLOORS]
    others = [name for name in names if name not in FLOORS]
    greys = {name: {"color": "0.6", "linewidth": 1.8, "linestyle": GREYS[n]} for n, name in enumerate(floors)}
    looks = {name: {"color": f"C{n % 10}", "linestyle": STYLES[n // 10 % len(STYLES)]} for n, name in enumerate(others)}
    return {**greys, **looks}
