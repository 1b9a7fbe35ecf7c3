"""The one writer of pictures: axes, stick figures, strips, files. They are drawn without pyplot and need no display."""

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
"""Name of a figure -> what draws it."""

Bones = Sequence[tuple[int, int]]


def save(drawings: Drawings, folder: Path) -> list[Path]:
    """Draw figures into NAME.png of a folder, which is made; the files. OutputError where that is not possible."""
    make_folder(folder)
    paths = [folder / f"{name}.png" for name in drawings]
    for path, draw in zip(paths, drawings.values(), strict=True):
        buffer = io.BytesIO()
        draw().savefig(buffer, dpi=110, format="png")
        write_whole(path, buffer.getvalue())
    return paths


def make_folder(folder: Path) -> None:
    """Make a folder for figures, with the folders around it; OutputError where that is not possible."""
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
    """Places (K, J, 3) of joints seen along x: (K, J, 2) in body heights."""
    seen: Array = points[..., [2, 1]] / skeleton.height
    return seen


def bones_of(skeleton: Skeleton) -> Bones:
    """Each bone as the joints at its ends."""
    return [(joint.parent, i) for i, joint in enumerate(skeleton.joints) if joint.parent >= 0]


def stick_figures(axes: Axes, points: Array, bones: Bones, colours: Sequence[Any], width: float = 0.9) -> None:
    """Draw poses (K, J, 2) in body heights, each :data:`SPACING` to the right of the one before.

    colours: for each pose one, or one for each of its bones.
    """
    placed = points + SPACING * np.arange(len(points))[:, None, None] * [1, 0]
    for pose, colour in zip(placed[:, np.array(bones)], colours, strict=True):
        axes.add_collection(LineCollection(list(pose), colors=colour, linewidths=width))
    axes.autoscale_view()
    axes.set_aspect("equal")
    axes.axis("off")


def strips(motions: Sequence[Motion], titles: Sequence[str], title: str, count: int = 9) -> Figure:
    """Motions that can be played, each as a strip of ``count`` poses of the player's body under its title.

    They stand at even times from left to right, seen from a little in front of the side they first turn to.
    """
    picture, rows = panels(len(motions), 1, (9, 2.0 * len(motions)), title)
    for axes, motion, text in zip(rows, motions, titles, strict=True):
        bodies(axes, motion, count)
        axes.set_title(text, fontsize=8, loc="left")
    return picture


def bodies(axes: Axes, motion: Motion, count: int) -> None:
    """Draw ``count`` poses of a motion that can be played with the player's body, each :data:`SPACING` to the right."""
    for n, (triangles, inks, shadow) in enumerate(shapes(motion, count)):
        for parts, colours in ((shadow, "0.85"), (triangles, inks / 255)):
            placed = list(np.add(parts, [SPACING * n, 0]))
            axes.add_collection(PolyCollection(placed, facecolors=colours, edgecolors=colours, linewidths=0.3))
    axes.set(xlim=(-SPACING, SPACING * count), ylim=(-0.15, 1.25), aspect="equal")
    axes.axis("off")


def error_over_time(errors: Mapping[str, Mapping[str, Array]], fps: float, unit: str) -> Figure:
    """Errors (N,) of systems, a panel for each action or measure, against the true time at ``fps`` (as figures 3 and 4
    of Li et al. 2018).

    A panel ends a little above the largest error of what is not constant velocity, which soon leaves it.
    """
    columns = min(3, len(errors))
    rows = -(-len(errors) // columns)
    looks = looks_of(list(next(iter(errors.values()))))
    beside = len(looks) > 4  # whose names have no room in a panel
    figure, axes = panels(rows, columns, (4.2 * columns + 2.6 * beside, 3.2 * rows))
    for axis in axes[len(errors) :]:
        axis.remove()
    for axis, (title, systems) in zip(axes, errors.items(), strict=False):
        for name, error in systems.items():
            axis.plot((np.arange(len(error)) + 1) / fps * 1000, error, label=name, **looks[name])
        shown = [error for name, error in systems.items() if not name.startswith(CONSTANT)] or list(systems.values())
        top = 1.1 * max(float(error.max()) for error in shown)
        axis.set(title=title, xlabel="ms", ylabel=unit, ylim=(0, top))
    if beside:
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside right upper")
    else:
        axes[0].legend()
    return figure


def looks_of(names: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Colour and style of each system's line: floors are grey; other styles where the ten colours begin again."""
    styles = ("-", "--", ":", "-.", (0, (1, 3)))
    floors, others = ([name for name in names if (name in FLOORS) == is_floor] for is_floor in (True, False))
    greys = {name: {"color": "0.6", "linewidth": 1.8, "linestyle": styles[n]} for n, name in enumerate(floors)}
    return greys | {name: {"color": f"C{n % 10}", "linestyle": styles[n // 10 % 4]} for n, name in enumerate(others)}
