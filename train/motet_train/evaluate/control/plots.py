"""The thesis' figures 5.2 to 5.7 and 5.10, drawn from a control model."""

from collections.abc import Callable
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from sklearn.decomposition import PCA

from motet.errors import OutputError
from motet.motion.kinematics import positions, skeleton_of
from motet.motion.rotations import Array
from motet_train.data.errors import DataError
from motet_train.evaluate.control.bend import interrupted
from motet_train.evaluate.control.gaits import gait_control, late_left_leg, ramp
from motet_train.evaluate.control.lab import Lab

mpl.use("Agg")

WALK, RUN, BEND = "#2f6fdb", "#d2452f", "#2f9e5b"

SPACING = 0.6
"""Body heights from one stick figure to the next."""


def draw_all(lab: Lab, folder: Path) -> list[Path]:
    """Draw every figure into an existing or a new folder; returns the files. DataError without a second gait."""
    if lab.run is None:
        raise DataError("the figures need clips of two periodic motions, such as walking and running")
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise OutputError(f"cannot write plots to {folder}: {error.strerror}") from error
    drawings: dict[str, Callable[[Lab], Figure]] = {
        "figure-5.2-limit-cycle": limit_cycle,
        "figure-5.5-transition": transition,
        "figure-5.6-hysteresis": hysteresis,
        "figure-5.7-bifurcation": bifurcation,
    }
    if lab.legs is not None:
        drawings["figure-5.3-perturbed-walk"] = perturbed_walk
        drawings["figure-5.4-synchronisation"] = synchronisation
    if lab.bend is not None:
        drawings["figure-5.10-interruption"] = interruption
    paths = []
    for name, draw in drawings.items():
        paths.append(folder / f"{name}.png")
        draw(lab).savefig(paths[-1], dpi=110)
    return paths


def limit_cycle(lab: Lab) -> Figure:
    """Figure 5.2: a hundred noisy starts end on one loop; where they start and end."""
    rng = np.random.default_rng(0)
    clean = np.repeat(lab.phases("walk", 20)[0], 5, axis=0)
    noisy = clean + rng.standard_normal(clean.shape)
    frames = lab.hold(noisy, "walk", 3.0).frames
    plane = _plane(lab, lab.loop("walk").frames[:, 0])
    figure, (left, right) = _axes(1, 2, "100 starts with Gaussian noise on the past codes")
    for row in range(frames.shape[1]):
        left.plot(*plane(frames[:, row]).T, color=WALK, linewidth=0.4, alpha=0.5)
    _dots(right, plane(frames[0]), RUN, "first frame")
    _dots(right, plane(frames[-1]), WALK, "after 3 s")
    right.legend()
    _label(left, right)
    return figure


def perturbed_walk(lab: Lab) -> Figure:
    """Figure 5.3: stick figures of a walk whose left leg is suddenly half a cycle late."""
    before = lab.hold(lab.loop("walk").histories([lab.model.taps], lab.model.taps), "walk", 0.6).frames[:, 0]
    after = late_left_leg(lab, 1)[0][: lab.frames(1.2), 0]
    figure, (axes,) = _axes(1, 1, "The left leg is forced to be half a cycle late where the line is", size=(13, 2.6))
    _sticks(lab, axes, np.concatenate([before, after])[::4])
    axes.axvline(SPACING * (len(before) / 4 - 0.5), color=RUN, linewidth=1)
    return figure


def synchronisation(lab: Lab) -> Figure:
    """Figure 5.4: the thigh's angle of both legs, before and after the left one is made late."""
    before = lab.hold(lab.loop("walk").histories([lab.model.taps], lab.model.taps), "walk", 2.0).frames[:, 0]
    frames = np.concatenate([before, late_left_leg(lab, 1)[0][:, 0]])
    figure, (axes,) = _axes(1, 1, "The right leg follows the left one", size=(9, 3.5))
    for leg, colour, name in zip(_thighs(lab), (RUN, WALK), ("left", "right"), strict=True):
        axes.plot(np.arange(len(frames)) / lab.fps, frames[:, leg], color=colour, label=name)
    axes.axvline(len(before) / lab.fps, color="grey", linestyle=":")
    axes.set(xlabel="seconds", ylabel="thigh, degrees")
    axes.legend()
    return figure


def transition(lab: Lab) -> Figure:
    """Figure 5.5: from walking to running, one stick figure in four frames."""
    track = np.concatenate([np.zeros(lab.frames(1.0)), np.ones(lab.frames(1.2))])
    frames = lab.play(lab.start(lab.phases("walk", 1)[0]), gait_control(lab, track)).frames[:, 0]
    figure, (axes,) = _axes(1, 1, "Control changes from walking to running at the line", size=(13, 2.6))
    _sticks(lab, axes, frames[::4])
    axes.axvline(SPACING * (lab.frames(1.0) / 4 - 0.5), color=RUN, linewidth=1)
    return figure


def hysteresis(lab: Lab) -> Figure:
    """Figure 5.6: the first principal component over time on ramps up and down, and over the gait parameter."""
    gait = ramp(lab)
    frames = lab.play(lab.start(lab.phases("walk", 1)[0]), gait_control(lab, gait)).frames[:, 0]
    loops = np.concatenate([lab.loop(role).frames[:, 0] for role in ("walk", "run")])
    line = _plane(lab, loops)(frames)[:, 0]
    half, sweep = len(gait) // 2, lab.frames(5.0)
    figure, axes = _axes(1, 3, "A gait parameter from 0 (walk) to 1 (run) and back in 5 s", size=(13, 3.8))
    for panel, part in zip(axes, (slice(0, half), slice(half, None)), strict=False):
        panel.plot(np.arange(half) / lab.fps, line[part], color=WALK)
        panel.twinx().plot(np.arange(half) / lab.fps, gait[part], color="grey", linestyle=":")
        panel.set(xlabel="seconds", ylabel="first component")
    axes[2].plot(gait[:sweep], line[:sweep], color=WALK, label="up")
    axes[2].plot(gait[half : half + sweep], line[half : half + sweep], color=RUN, label="down")
    axes[2].set(xlabel="gait parameter", ylabel="first component")
    axes[2].legend()
    return figure


def bifurcation(lab: Lab) -> Figure:
    """Figure 5.7: between the loops, by a sudden switch, a slow ramp, and four times sampled."""
    loops = [lab.loop(role).frames[:, 0] for role in ("walk", "run")]
    plane = _plane(lab, np.concatenate(loops))
    start = lab.phases("walk", 1)[0]
    gait = ramp(lab)[: lab.frames(6.0)]
    paths = [
        [lab.hold(start, "run", 2.0).frames[:, 0]],
        [lab.play(lab.start(start), gait_control(lab, gait)).frames[:, 0]],
        list(np.moveaxis(lab.hold(start.repeat(4, axis=0), "run", 2.0, variety=1.0).frames, 1, 0)),
    ]
    figure, axes = _axes(1, 3, "From the walking loop (blue) to the running loop (red)", size=(13, 4.3))
    for panel, runs, name in zip(axes, paths, ("sudden", "5 s ramp", "sampled, four runs"), strict=True):
        for loop, colour in zip(loops, (WALK, RUN), strict=True):
            panel.plot(*plane(loop).T, color=colour, linewidth=2.5, alpha=0.5)
        for run in runs:
            panel.plot(*plane(run).T, ".-", color="black", linewidth=0.7, markersize=2.5)
        panel.set_title(name)
    _label(*axes)
    return figure


def interruption(lab: Lab) -> Figure:
    """Figure 5.10: walk, bend, run; the bend completed, and interrupted late, in the middle and early."""
    assert lab.bend is not None
    training = [lab.reference.motions[label][0] for label in (lab.walk, lab.bend, lab.run) if label]
    plane = _plane(lab, np.concatenate(training))
    start = lab.phases("walk", 1)[0]
    whole = np.repeat(
        np.stack([lab.control(bend=1.0), lab.control(run=1.0)]), [lab.frames(5.0), lab.frames(2.0)], axis=0
    )
    runs = {"completed": lab.play(lab.start(start), whole).frames[:, 0]}
    runs |= {name: run.frames[:, 0] for name, run in reversed(interrupted(lab, 1).items())}
    figure, axes = _axes(1, len(runs), "Training motions (dots) and the path of a run (line)", size=(15, 4.2))
    for panel, (name, frames) in zip(axes, runs.items(), strict=True):
        for clip, colour in zip(training, (WALK, BEND, RUN), strict=True):
            _dots(panel, plane(clip), colour)
        panel.plot(*plane(frames).T, color="black", linewidth=0.8)
        panel.set_title(name)
    _label(*axes)
    return figure


def _plane(lab: Lab, frames: Array) -> Callable[[Array], Array]:
    """The projection on the first two principal components of frames, in z units."""
    pca = PCA(n_components=2, svd_solver="full").fit(lab.reference.z(frames))

    def project(points: Array) -> Array:
        projected: Array = pca.transform(lab.reference.z(points))
        return projected

    return project


def _axes(rows: int, columns: int, title: str, size: tuple[float, float] = (9, 4.5)) -> tuple[Figure, list[Axes]]:
    figure = Figure(figsize=size, layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False)
    figure.suptitle(title)
    return figure, list(axes.flat)


def _dots(axes: Axes, points: Array, colour: str, label: str | None = None) -> None:
    axes.scatter(points[:, 0], points[:, 1], s=8, color=colour, alpha=0.6, label=label)


def _label(*panels: Axes) -> None:
    for panel in panels:
        panel.set(xlabel="first component, z", ylabel="second component, z")


def _thighs(lab: Lab) -> list[int]:
    """For each leg the channel of its topmost joint that moves most while walking."""
    assert lab.legs is not None
    names = lab.model.contract.channels
    spread = lab.loop("walk").frames[:, 0].std(axis=0)
    tops = [[c for c in leg.channels if names[c][:-3] == names[leg.channels[0]][:-3]] for leg in lab.legs]
    return [int(top[np.argmax(spread[top])]) for top in tops]


def _sticks(lab: Lab, axes: Axes, frames: Array) -> None:
    """Stick figures in profile, each a little to the right of the one before."""
    motion = lab.model.contract.features(frames)
    skeleton = skeleton_of(motion)
    points = positions(motion) / skeleton.height
    for number, pose in enumerate(points):
        for i, joint in enumerate(skeleton.joints[1:], start=1):
            (_, y0, z0), (_, y1, z1) = pose[joint.parent], pose[i]
            axes.plot([SPACING * number + z0, SPACING * number + z1], [y0, y1], color="black", linewidth=0.9)
    axes.set_aspect("equal")
    axes.axis("off")
