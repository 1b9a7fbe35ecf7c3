"""Strips: a motion as stick figures side by side."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from motet.draw.body import COLOURS
from motet.draw.figure import figure_of
from motet.motion.motion import Motion
from motet_train.evaluate.figures import SPACING, panels, stick_figures

FIGURES = 9
"""Stick figures of a strip."""


def strips(motions: Sequence[Motion], titles: Sequence[str], title: str) -> Figure:
    """Motions that can be played, each as a strip of stick figures under its title."""
    picture, rows = panels(len(motions), 1, (9, 2.0 * len(motions)), title)
    for axes, motion, text in zip(rows, motions, titles, strict=True):
        _strip(axes, motion)
        axes.set_title(text, fontsize=8, loc="left")
    return picture


def _strip(axes: Axes, motion: Motion) -> None:
    """Stick figures at even times from left to right, seen from a little in front of the side they first turn to."""
    figure = figure_of(motion)
    view = figure.heading + np.radians(60)
    frames = np.linspace(0, len(figure.points) - 1, FIGURES).round().astype(int)
    points = figure.points[frames]
    across = (points - points[:, :1])[..., [0, 2]] @ [np.sin(view), np.cos(view)]
    colours = [np.array(COLOURS[bone.side]) / 255 for bone in figure.bones]
    bones = [(bone.start, bone.end) for bone in figure.bones]
    stick_figures(axes, np.stack([across, points[..., 1]], axis=-1), bones, [colours] * FIGURES, width=1.2)
    axes.set(xlim=(-SPACING, SPACING * FIGURES), ylim=(-0.05, 1.25))
