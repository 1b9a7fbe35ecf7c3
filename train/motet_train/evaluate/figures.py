"""The one writer of pictures: axes, stick figures, strips, files. They are drawn without pyplot and need no display."""

import io
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from motet.draw.figure import COLOURS, figure_of
from motet.errors import OutputError
from motet.files import write_whole
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet.motion.skeleton import Skeleton

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
    """Motions that can be played, each as a strip of ``count`` stick figures under its title.

    They stand at even times from left to right, seen from a little in front of the side they first turn to.
    """
    picture, rows = panels(len(motions), 1, (9, 2.0 * len(motions)), title)
    for axes, motion, text in zip(rows, motions, titles, strict=True):
        figure = figure_of(motion)
        view = figure.heading + np.radians(60)
        points = figure.points[np.linspace(0, len(figure.points) - 1, count).round().astype(int)]
        across = (points - points[:, :1])[..., [0, 2]] @ [np.sin(view), np.cos(view)]
        colours = [np.array(COLOURS[bone.side]) / 255 for bone in figure.bones]
        bones = [(bone.start, bone.end) for bone in figure.bones]
        stick_figures(axes, np.stack([across, points[..., 1]], axis=-1), bones, [colours] * count, width=1.2)
        axes.set(xlim=(-SPACING, SPACING * count), ylim=(-0.05, 1.25))
        axes.set_title(text, fontsize=8, loc="left")
    return picture
