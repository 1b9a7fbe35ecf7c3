"""Error over time, and stick figures of predictions beside the truth (figures 4, 3 and 5 of Li et al. 2018)."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from motet.errors import OutputError
from motet.motion.rotations import Array
from motet.motion.skeleton import Skeleton

mpl.use("Agg")

SPACING = 0.6
"""Body heights from one stick figure to the next."""

WIDTH = 13
"""Inches of a strip."""

INSIDE = 4
"""Systems whose names have room in a panel."""

STYLES = ("-", "--", ":", "-.")
"""Of lines: another one where the ten colours begin again."""

TRUE, GIVEN, PREDICTED = "0.75", "tab:blue", "black"
"""Colours of stick figures: what was, seed frames, what is predicted."""


def error_over_time(panels: Mapping[str, Mapping[str, Array]], fps: float, unit: str, path: Path) -> Path:
    """Draw errors (N,) of systems by panel, against the true time at ``fps``, to a PNG; OutputError if impossible.

    The first system is the baseline, and grey.
    """
    columns = min(3, len(panels))
    rows = -(-len(panels) // columns)
    looks = _looks(next(iter(panels.values())))
    width = 4.2 * columns + (2.6 if len(looks) > INSIDE else 0)
    figure = Figure(figsize=(width, 3.2 * rows), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False)
    for axis in list(axes.flat)[len(panels) :]:
        axis.remove()
    for axis, (title, systems) in zip(axes.flat, panels.items(), strict=False):
        for name, error in systems.items():
            axis.plot((np.arange(len(error)) + 1) / fps * 1000, error, label=name, **looks[name])
        axis.set(title=title, xlabel="ms", ylabel=unit, ylim=(0, None))
    if len(looks) > INSIDE:
        figure.legend(*axes.flat[0].get_legend_handles_labels(), loc="outside right upper")
    else:
        axes.flat[0].legend()
    return _saved(figure, path)


def _looks(names: Iterable[str]) -> dict[str, dict[str, Any]]:
    """Colour and style of each system's line."""
    baseline, *others = names
    looks = {name: {"color": f"C{n % 10}", "linestyle": STYLES[n // 10 % len(STYLES)]} for n, name in enumerate(others)}
    return {baseline: {"color": "0.6", "linewidth": 2.5}, **looks}


def stick_figures(strips: Mapping[str, Array], skeleton: Skeleton, path: Path, given: int = 0) -> Path:
    """Draw places of joints (K, J, 3) in profile, a strip below the other, to a PNG; OutputError if impossible.

    The first strip is the truth, which is drawn in grey behind the others too. given: so many poses of each are seed
    frames, and blue.
    """
    truth = next(iter(strips.values()))
    height = 0.4 + 1.1 * WIDTH / (SPACING * (len(truth) + 1))
    figure = Figure(figsize=(WIDTH, height * len(strips)), layout="constrained")
    axes = figure.subplots(len(strips), 1, squeeze=False)
    for axis, (title, points) in zip(axes.flat, strips.items(), strict=True):
        if points is not truth:
            _draw(axis, truth, skeleton, [TRUE] * len(truth))
        _draw(axis, points, skeleton, [GIVEN] * given + [PREDICTED] * (len(points) - given))
        axis.autoscale_view()
        axis.set_title(title, loc="left")
        axis.set_aspect("equal")
        axis.axis("off")
    return _saved(figure, path)


def _draw(axis: Axes, points: Array, skeleton: Skeleton, colours: list[str]) -> None:
    """A figure for each pose (K, J, 3), seen along x, one after the other."""
    seen = points[..., [2, 1]] / skeleton.height + SPACING * np.arange(len(points))[:, None, None] * [1, 0]
    parents = [joint.parent for joint in skeleton.joints[1:]]
    bones = np.stack([seen[:, parents], seen[:, 1:]], axis=2)
    for pose, colour in zip(bones, colours, strict=True):
        axis.add_collection(LineCollection(list(pose), colors=colour, linewidths=0.9))


def _saved(figure: Figure, path: Path) -> Path:
    try:
        path.parent.mkdir(exist_ok=True)
        figure.savefig(path, dpi=110)
    except OSError as error:
        raise OutputError(f"cannot write plots to {path.parent}: {error.strerror}") from error
    return path
