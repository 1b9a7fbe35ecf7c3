"""Error over time, and stick figures of predictions beside the truth (figures 4, 3 and 5 of Li et al. 2018)."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from motet.motion.rotations import Array
from motet.motion.skeleton import Skeleton
from motet_train.evaluate.figures import SPACING, bones_of, in_profile, panels, stick_figures
from motet_train.evaluate.predict.floors import CONSTANT, FLOORS

WIDTH = 13
"""Inches of a strip."""

INSIDE = 4
"""Systems whose names have room in a panel."""

STYLES = ("-", "--", ":", "-.")
"""Of lines: another one where the ten colours begin again."""

GREYS = ("-", "--", ":", "-.", (0, (1, 3)))
"""Of the lines of floors."""

TRUE, GIVEN, PREDICTED = "0.75", "tab:blue", "black"
"""Colours of stick figures: what was, seed frames, what is predicted."""


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


def strips_drawing(strips: Mapping[str, Array], skeleton: Skeleton, given: int = 0) -> Figure:
    """Places of joints (K, J, 3) in profile, a strip below the other.

    The first strip is the truth, which is drawn in grey behind the others too. given: how many poses of each are seed
    frames, and blue.
    """
    truth, bones = next(iter(strips.values())), bones_of(skeleton)
    height = 0.4 + 1.1 * WIDTH / (SPACING * (len(truth) + 1))
    figure, axes = panels(len(strips), 1, (WIDTH, height * len(strips)))
    for axis, (title, points) in zip(axes, strips.items(), strict=True):
        if points is not truth:
            stick_figures(axis, in_profile(truth, skeleton), bones, [TRUE] * len(truth))
        colours = [GIVEN] * given + [PREDICTED] * (len(points) - given)
        stick_figures(axis, in_profile(points, skeleton), bones, colours)
        axis.set_title(title, loc="left")
    return figure
