"""Error over time, and stick figures of predictions beside the truth (figures 4 and 3 of Li et al. 2018)."""

from collections.abc import Mapping
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from motet.errors import OutputError
from motet.kinematics import positions, skeleton_of
from motet.motion import Motion
from motet.rotations import Array

mpl.use("Agg")

SPACING = 0.6
"""Body heights from one stick figure to the next."""


def error_over_time(panels: Mapping[str, Mapping[str, Array]], fps: float, unit: str, path: Path) -> Path:
    """Draw errors (N,) of systems by panel, against the true time at ``fps``, to a PNG; OutputError if impossible."""
    columns = min(3, len(panels))
    rows = -(-len(panels) // columns)
    figure = Figure(figsize=(4.2 * columns, 3.2 * rows), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False)
    for axis in list(axes.flat)[len(panels) :]:
        axis.remove()
    for axis, (title, systems) in zip(axes.flat, panels.items(), strict=False):
        for name, error in systems.items():
            axis.plot((np.arange(len(error)) + 1) / fps * 1000, error, label=name)
        axis.set(title=title, xlabel="ms", ylabel=unit, ylim=(0, None))
    axes.flat[0].legend()
    return _saved(figure, path)


def stick_figures(strips: Mapping[str, Motion], every: int, path: Path) -> Path:
    """Draw motions below each other in profile, one figure in ``every`` frames, to a PNG; OutputError if impossible."""
    figure = Figure(figsize=(13, 2.3 * len(strips)), layout="constrained")
    axes = figure.subplots(len(strips), 1, squeeze=False)
    for axis, (title, motion) in zip(axes.flat, strips.items(), strict=True):
        skeleton = skeleton_of(motion)
        points = positions(motion)[::every] / skeleton.height
        for number, pose in enumerate(points - points[:, :1] * [1, 0, 1]):
            for i, joint in enumerate(skeleton.joints[1:], start=1):
                (_, y0, z0), (_, y1, z1) = pose[joint.parent], pose[i]
                axis.plot([SPACING * number + z0, SPACING * number + z1], [y0, y1], color="black", linewidth=0.9)
        axis.set_title(title, loc="left")
        axis.set_aspect("equal")
        axis.axis("off")
    return _saved(figure, path)


def _saved(figure: Figure, path: Path) -> Path:
    try:
        path.parent.mkdir(exist_ok=True)
        figure.savefig(path, dpi=110)
    except OSError as error:
        raise OutputError(f"cannot write plots to {path.parent}: {error.strerror}") from error
    return path
