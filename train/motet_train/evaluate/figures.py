"""The writer of all pictures: axes, stick figures, strips and files. It uses no pyplot and needs no display."""

import io
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure

from motet.draw.svg import shapes
from motet.errors import OutputError
from motet.files import write_whole
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet.motion.skeleton import Skeleton
from motet_train.evaluate.predict.floors import CONSTANT, FLOORS

SPACING = 0.6
"""Body heights from one stick figure to the next."""

Drawings = Mapping[str, Callable[[], Figure]]
"""Name of a figure -> the function that draws it."""


Looks = dict[str, dict[str, Any]]
"""Name of a system -> how its line is drawn."""


def save(drawings: Drawings, folder: Path) -> list[Path]:
    """Draw figures as NAME.png into a folder, made if needed, and return the files; OutputError if that fails."""
    make_folder(folder)
    paths = [folder / f"{name}.png" for name in drawings]
    for path, draw in zip(paths, drawings.values(), strict=True):
        buffer = io.BytesIO()
        draw().savefig(buffer, dpi=110, format="png")
        write_whole(path, buffer.getvalue())
    return paths


def make_folder(folder: Path) -> None:
    """Make a folder for figures, with its parents; OutputError if that fails."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"cannot write plots to {folder}: {error.strerror}") from error


def panels(rows: int, columns: int, size: tuple[float, float], title: str = "") -> tuple[Figure, list[Axes]]:
    """A figure of ``size`` inches with rows x columns axes."""
    figure = Figure(figsize=size, layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False)
    figure.suptitle(title)
    return figure, list(axes.flat)


def in_profile(points: Array, skeleton: Skeleton) -> Array:
    """Positions (K, J, 3) of joints seen along x: (K, J, 2) in body heights."""
    profile: Array = points[..., [2, 1]] / skeleton.height
    return profile


def stick_figures(axes: Axes, points: Array, skeleton: Skeleton, colours: Sequence[Any]) -> None:
    """Draw poses (K, J, 2) in body heights from left to right, :data:`SPACING` apart.

    colours: one for each pose, or one for each of its bones.
    """
    shifts = SPACING * np.arange(len(points))
    placed = points + shifts[:, None, None] * [1, 0]
    bones = np.stack([skeleton.parents, np.arange(len(skeleton.parents))], axis=1)[1:]
    for pose, colour in zip(placed[:, bones], colours, strict=True):
        axes.add_collection(LineCollection(list(pose), colors=colour, linewidths=0.9))
    axes.autoscale_view()
    axes.set_aspect("equal")
    axes.axis("off")


def strips(motions: Sequence[Motion], titles: Sequence[str], title: str, count: int = 9) -> Figure:
    """Playable motions, each as a strip of ``count`` poses of the player's body under its title.

    The poses are evenly spaced in time, seen from slightly in front of the side that the figure first turns to.
    """
    picture, rows = panels(len(motions), 1, (9, 2.0 * len(motions)), title)
    for axes, motion, text in zip(rows, motions, titles, strict=True):
        bodies(axes, motion, count)
        axes.set_title(text, fontsize=8, loc="left")
    return picture


def bodies(axes: Axes, motion: Motion, count: int) -> None:
    """Draw ``count`` poses of a playable motion with the player's body, :data:`SPACING` apart."""
    for number, (triangles, inks, shadow) in enumerate(shapes(motion, count)):
        shift = [SPACING * number, 0]
        _polygons(axes, np.add(shadow, shift), "0.85")
        _polygons(axes, np.add(triangles, shift), inks / 255)
    axes.set(xlim=(-SPACING, SPACING * count), ylim=(-0.15, 1.25), aspect="equal")
    axes.axis("off")


def _polygons(axes: Axes, polygons: Array, colours: Any) -> None:
    axes.add_collection(PolyCollection(list(polygons), facecolors=colours, edgecolors=colours, linewidths=0.3))


def error_over_time(errors: Mapping[str, Mapping[str, Array]], fps: float, unit: str) -> Figure:
    """Errors (N,) of systems over time at ``fps``, a panel for each action or measure, as figures 3 and 4 of Li et al.
    2018.

    A panel ends slightly above the largest error of all but constant velocity, which soon leaves it.
    """
    looks = looks_of(list(next(iter(errors.values()))))
    legend_outside = len(looks) > 4  # more names do not fit into a panel
    # at most three panels in a row, and a legend in the first one or beside them
    columns = min(3, len(errors))
    rows = -(-len(errors) // columns)
    width = 4.2 * columns + (2.6 if legend_outside else 0)
    figure, axes = panels(rows, columns, (width, 3.2 * rows))
    for unused in axes[len(errors) :]:
        unused.remove()

    for axis, (title, systems) in zip(axes, errors.items(), strict=False):
        highest = _plot(axis, systems, fps, looks)
        axis.set(title=title, xlabel="ms", ylabel=unit, ylim=(0, 1.1 * highest))

    if legend_outside:
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside right upper")
    else:
        axes[0].legend()
    return figure


def _plot(axis: Axes, systems: Mapping[str, Array], fps: float, looks: Looks) -> float:
    """Plot errors (N,) against the true time; the largest of all but constant velocity, if there is anything else."""
    for name, error in systems.items():
        milliseconds = (np.arange(len(error)) + 1) / fps * 1000
        axis.plot(milliseconds, error, label=name, **looks[name])
    others = [error for name, error in systems.items() if not name.startswith(CONSTANT)]
    return max(float(error.max()) for error in others or systems.values())


def looks_of(names: Sequence[str]) -> Looks:
    """Colour and style of each system's line: floors are grey; line styles change once the ten colours are used up."""
    styles = ("-", "--", ":", "-.", (0, (1, 3)))
    # floors stand back behind what is compared
    floors = [name for name in names if name in FLOORS]
    others = [name for name in names if name not in FLOORS]
    looks: Looks = {}
    for number, name in enumerate(floors):
        looks[name] = {"color": "0.6", "linewidth": 1.8, "linestyle": styles[number]}
    for number, name in enumerate(others):
        looks[name] = {"color": f"C{number % 10}", "linestyle": styles[number // 10 % 4]}
    return looks
