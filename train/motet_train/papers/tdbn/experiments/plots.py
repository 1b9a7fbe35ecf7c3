"""The thesis' figures 5.2 to 5.7 and 5.10, drawn from a control model."""

from collections.abc import Callable
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from motet.motion.kinematics import positions, skeleton_of
from motet.motion.rotations import Array
from motet_train.evaluate.figures import SPACING, Drawings, bones_of, in_profile, panels, stick_figures
from motet_train.papers.tdbn.experiments.bend import interrupted
from motet_train.papers.tdbn.experiments.gaits import gait_control, late_left_leg, ramp
from motet_train.papers.tdbn.experiments.study import ControlStudy

WALK_COLOUR, RUN_COLOUR, BEND_COLOUR = "#2f6fdb", "#d2452f", "#2f9e5b"


def drawings(study: ControlStudy) -> Drawings:
    """The figures that the clips allow: most need two gaits, some legs, the last a motion that ends."""
    found: dict[str, Callable[[ControlStudy], Figure]] = {"figure-5.2-limit-cycle": limit_cycle}
    if study.legs is not None:
        found["figure-5.3-perturbed-walk"] = perturbed_walk
        found["figure-5.4-synchronisation"] = synchronisation
    if study.run is not None:
        found["figure-5.5-transition"] = transition
        found["figure-5.6-hysteresis"] = hysteresis
        found["figure-5.7-bifurcation"] = bifurcation
    if study.run is not None and study.bend is not None:
        found["figure-5.10-interruption"] = interruption
    return {name: partial(draw, study) for name, draw in found.items()}


def limit_cycle(study: ControlStudy) -> Figure:
    """Figure 5.2: a hundred noisy starts end on one loop; where they start and end."""
    rng = np.random.default_rng(0)
    clean = np.repeat(study.phases("walk", 20)[0], 5, axis=0)
    noisy = clean + rng.standard_normal(clean.shape)
    frames = study.hold(noisy, "walk", 3.0).frames
    plane = _plane(study, study.loop("walk").frames[:, 0])
    figure, (left, right) = panels(1, 2, (9, 4.5), "100 starts with Gaussian noise on the past codes")
    for row in range(frames.shape[1]):
        left.plot(*plane(frames[:, row]).T, color=WALK_COLOUR, linewidth=0.4, alpha=0.5)
    _dots(right, plane(frames[0]), RUN_COLOUR, "first frame")
    _dots(right, plane(frames[-1]), WALK_COLOUR, "after 3 s")
    right.legend()
    _label(left, right)
    return figure


def perturbed_walk(study: ControlStudy) -> Figure:
    """Figure 5.3: stick figures of a walk whose left leg is suddenly half a cycle late."""
    before = study.hold(study.loop("walk").histories([study.model.taps], study.model.taps), "walk", 0.6).frames[:, 0]
    after = late_left_leg(study, 1)[0][: study.frames(1.2), 0]
    figure, (axes,) = panels(1, 1, (13, 2.6), "The left leg is forced to be half a cycle late where the line is")
    _sticks(study, axes, np.concatenate([before, after])[::4])
    axes.axvline(SPACING * (len(before) / 4 - 0.5), color=RUN_COLOUR, linewidth=1)
    return figure


def synchronisation(study: ControlStudy) -> Figure:
    """Figure 5.4: the thigh's angle of both legs, before and after the left one is made late."""
    before = study.hold(study.loop("walk").histories([study.model.taps], study.model.taps), "walk", 2.0).frames[:, 0]
    frames = np.concatenate([before, late_left_leg(study, 1)[0][:, 0]])
    figure, (axes,) = panels(1, 1, (9, 3.5), "The right leg follows the left one")
    for leg, colour, name in zip(_thighs(study), (RUN_COLOUR, WALK_COLOUR), ("left", "right"), strict=True):
        axes.plot(np.arange(len(frames)) / study.fps, frames[:, leg], color=colour, label=name)
    axes.axvline(len(before) / study.fps, color="grey", linestyle=":")
    axes.set(xlabel="seconds", ylabel="thigh, degrees")
    axes.legend()
    return figure


def transition(study: ControlStudy) -> Figure:
    """Figure 5.5: from walking to running, one stick figure in four frames."""
    track = np.concatenate([np.zeros(study.frames(1.0)), np.ones(study.frames(1.2))])
    frames = study.play(study.start(study.phases("walk", 1)[0]), gait_control(study, track)).frames[:, 0]
    figure, (axes,) = panels(1, 1, (13, 2.6), "Control changes from walking to running at the line")
    _sticks(study, axes, frames[::4])
    axes.axvline(SPACING * (study.frames(1.0) / 4 - 0.5), color=RUN_COLOUR, linewidth=1)
    return figure


def hysteresis(study: ControlStudy) -> Figure:
    """Figure 5.6: the first principal component over time on ramps up and down, and over the gait parameter."""
    gait = ramp(study)
    frames = study.play(study.start(study.phases("walk", 1)[0]), gait_control(study, gait)).frames[:, 0]
    loops = np.concatenate([study.loop(role).frames[:, 0] for role in ("walk", "run")])
    line = _plane(study, loops)(frames)[:, 0]
    half, sweep = len(gait) // 2, study.frames(5.0)
    figure, axes = panels(1, 3, (13, 3.8), "A gait parameter from 0 (walk) to 1 (run) and back in 5 s")
    for panel, part in zip(axes, (slice(0, half), slice(half, None)), strict=False):
        panel.plot(np.arange(half) / study.fps, line[part], color=WALK_COLOUR)
        panel.twinx().plot(np.arange(half) / study.fps, gait[part], color="grey", linestyle=":")
        panel.set(xlabel="seconds", ylabel="first component")
    axes[2].plot(gait[:sweep], line[:sweep], color=WALK_COLOUR, label="up")
    axes[2].plot(gait[half : half + sweep], line[half : half + sweep], color=RUN_COLOUR, label="down")
    axes[2].set(xlabel="gait parameter", ylabel="first component")
    axes[2].legend()
    return figure


def bifurcation(study: ControlStudy) -> Figure:
    """Figure 5.7: between the loops, by a sudden switch, a slow ramp, and four times sampled."""
    loops = [study.loop(role).frames[:, 0] for role in ("walk", "run")]
    plane = _plane(study, np.concatenate(loops))
    start = study.phases("walk", 1)[0]
    gait = ramp(study)[: study.frames(6.0)]
    paths = [
        [study.hold(start, "run", 2.0).frames[:, 0]],
        [study.play(study.start(start), gait_control(study, gait)).frames[:, 0]],
        list(np.moveaxis(study.hold(start.repeat(4, axis=0), "run", 2.0, variety=1.0).frames, 1, 0)),
    ]
    figure, axes = panels(1, 3, (13, 4.3), "From the walking loop (blue) to the running loop (red)")
    for panel, runs, name in zip(axes, paths, ("sudden", "5 s ramp", "sampled, four runs"), strict=True):
        for loop, colour in zip(loops, (WALK_COLOUR, RUN_COLOUR), strict=True):
            panel.plot(*plane(loop).T, color=colour, linewidth=2.5, alpha=0.5)
        for run in runs:
            panel.plot(*plane(run).T, ".-", color="black", linewidth=0.7, markersize=2.5)
        panel.set_title(name)
    _label(*axes)
    return figure


def interruption(study: ControlStudy) -> Figure:
    """Figure 5.10: walk, bend, run; the bend completed, and interrupted late, in the middle and early."""
    assert study.bend is not None
    training = [study.reference.motions[label][0] for label in (study.walk, study.bend, study.run) if label]
    plane = _plane(study, np.concatenate(training))
    start = study.phases("walk", 1)[0]
    whole = np.repeat(
        np.stack([study.control(bend=1.0), study.control(run=1.0)]), [study.frames(5.0), study.frames(2.0)], axis=0
    )
    runs = {"completed": study.play(study.start(start), whole).frames[:, 0]}
    runs |= {name: run.frames[:, 0] for name, run in reversed(interrupted(study, 1).items())}
    figure, axes = panels(1, len(runs), (15, 4.2), "Training motions (dots) and the path of a run (line)")
    for panel, (name, frames) in zip(axes, runs.items(), strict=True):
        for clip, colour in zip(training, (WALK_COLOUR, BEND_COLOUR, RUN_COLOUR), strict=True):
            _dots(panel, plane(clip), colour)
        panel.plot(*plane(frames).T, color="black", linewidth=0.8)
        panel.set_title(name)
    _label(*axes)
    return figure


def _plane(study: ControlStudy, frames: Array) -> Callable[[Array], Array]:
    """The projection on the first two principal components of frames, in z units."""
    z = study.reference.z(frames)
    mean = z.mean(axis=0)
    components = np.linalg.svd(z - mean, full_matrices=False)[2][:2]
    largest = components[np.arange(2), np.abs(components).argmax(axis=1)]
    components *= np.sign(largest)[:, None]  # of two directions always the same

    def project(points: Array) -> Array:
        projected: Array = (study.reference.z(points) - mean) @ components.T
        return projected

    return project


def _dots(axes: Axes, points: Array, colour: str, label: str | None = None) -> None:
    axes.scatter(points[:, 0], points[:, 1], s=8, color=colour, alpha=0.6, label=label)


def _label(*shown: Axes) -> None:
    for panel in shown:
        panel.set(xlabel="first component, z", ylabel="second component, z")


def _thighs(study: ControlStudy) -> list[int]:
    """For each leg the channel of its topmost joint that moves most while walking."""
    assert study.legs is not None
    names = study.model.contract.channels
    spread = study.loop("walk").frames[:, 0].std(axis=0)
    tops = [[c for c in leg.channels if names[c][:-3] == names[leg.channels[0]][:-3]] for leg in study.legs]
    return [int(top[np.argmax(spread[top])]) for top in tops]


def _sticks(study: ControlStudy, axes: Axes, frames: Array) -> None:
    """Stick figures in profile."""
    motion = study.model.contract.features(frames)
    skeleton = skeleton_of(motion)
    stick_figures(axes, in_profile(positions(motion), skeleton), bones_of(skeleton), ["black"] * len(frames))
