"""The thesis' figures 5.2 to 5.7 and 5.10, drawn from a control model."""

from collections.abc import Callable
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from motet.motion.rotations import Array
from motet_train.evaluate.figures import SPACING, Drawings, bodies, panels
from motet_train.papers.tdbn.experiments import gait_run, interrupted, late_left_leg, ramp
from motet_train.papers.tdbn.study import ControlStudy, Leg, Recording

WALK_COLOUR = "#2f6fdb"
RUN_COLOUR = "#d2452f"
BEND_COLOUR = "#2f9e5b"


def drawings(study: ControlStudy) -> Drawings:
    """The figures that the clips allow: most need two gaits, some legs, the last a motion that ends."""
    figures: dict[str, Callable[[ControlStudy], Figure]] = {"figure-5.2-limit-cycle": limit_cycle}
    if study.legs:
        figures["figure-5.3-perturbed-walk"] = perturbed_walk
        figures["figure-5.4-synchronisation"] = synchronisation
    if study.run:
        figures["figure-5.5-transition"] = transition
        figures["figure-5.6-hysteresis"] = hysteresis
        figures["figure-5.7-bifurcation"] = bifurcation
    if study.run and study.bend:
        figures["figure-5.10-interruption"] = interruption
    return {name: partial(draw, study) for name, draw in figures.items()}


def limit_cycle(study: ControlStudy) -> Figure:
    """Figure 5.2: a hundred noisy starts end on one loop; their first and last frames."""
    rng = np.random.default_rng(0)
    clean = np.repeat(study.phases("walk", 20)[0], 5, axis=0)
    frames = study.hold(clean + rng.standard_normal(clean.shape), "walk", 3.0).frames
    figure, (left, right) = panels(1, 2, (9, 4.5), "100 starts with Gaussian noise on the past codes")
    plane = _plane(study, study.loop_frames("walk"), left, right)
    for row in range(frames.shape[1]):
        left.plot(*plane(frames[:, row]).T, color=WALK_COLOUR, linewidth=0.4, alpha=0.5)
    _dots(right, plane(frames[0]), RUN_COLOUR, "first frame")
    _dots(right, plane(frames[-1]), WALK_COLOUR, "after 3 s")
    right.legend()
    return figure


def perturbed_walk(study: ControlStudy) -> Figure:
    """Figure 5.3: a walk whose left leg is suddenly half a cycle late."""
    before, after = _made_late(study, 0.6)
    title = "The left leg is forced to be half a cycle late where the line is"
    return _strip(study, np.concatenate([before, after[: study.frames(1.2)]]), len(before), title)


def synchronisation(study: ControlStudy) -> Figure:
    """Figure 5.4: the thigh's angle of both legs, before and after the left one is made late."""
    before, after = _made_late(study, 2.0)
    frames = np.concatenate([before, after])
    spread = study.loop_frames("walk").std(axis=0)
    figure, (axes,) = panels(1, 1, (9, 3.5), "The right leg follows the left one")
    for leg, colour, name in zip(study.legs, (RUN_COLOUR, WALK_COLOUR), ("left", "right"), strict=True):
        thigh = _thigh(study, leg, spread)
        axes.plot(np.arange(len(frames)) / study.fps, frames[:, thigh], color=colour, label=name)
    axes.axvline(len(before) / study.fps, color="grey", linestyle=":")
    axes.set(xlabel="seconds", ylabel="thigh, degrees")
    axes.legend()
    return figure


def _thigh(study: ControlStudy, leg: Leg, spread: Array) -> int:
    """The channel of a leg's topmost joint with the largest standard deviation (D,)."""
    joints = [channel.rpartition(".")[0] for channel in study.model.contract.channels]
    channels: list[int] = [channel for channel in leg.channels.tolist() if joints[channel] == joints[leg.channels[0]]]
    return max(channels, key=lambda channel: float(spread[channel]))


def _made_late(study: ControlStudy, seconds: float) -> tuple[Array, Array]:
    """Frames (T, D) before and after the left leg is made late."""
    history = study.loop("walk").histories([study.model.taps], study.model.taps)
    return study.hold(history, "walk", seconds).frames[:, 0], late_left_leg(study, 1)[0][:, 0]


def transition(study: ControlStudy) -> Figure:
    """Figure 5.5: from walking to running, one figure in four frames."""
    before = study.frames(1.0)
    after = study.frames(1.2)
    track = np.repeat([0.0, 1.0], [before, after])
    frames = gait_run(study, track).frames[:, 0]
    return _strip(study, frames, before, "Control changes from walking to running at the line")


def hysteresis(study: ControlStudy) -> Figure:
    """Figure 5.6: the first principal component over time on ramps up and down, and over the gait parameter."""
    gait = ramp(study)
    frames = gait_run(study, gait).frames[:, 0]
    loops = np.concatenate(list(map(study.loop_frames, ("walk", "run"))))
    line = _plane(study, loops)(frames)[:, 0]
    half = len(gait) // 2
    figure, axes = panels(1, 3, (13, 3.8), "A gait parameter from 0 (walk) to 1 (run) and back in 5 s")
    # over time on the way up and down
    seconds = np.arange(half) / study.fps
    for panel, part in zip(axes, (slice(0, half), slice(half, None)), strict=False):
        panel.plot(seconds, line[part], color=WALK_COLOUR)
        panel.twinx().plot(seconds, gait[part], color="grey", linestyle=":")
        panel.set(xlabel="seconds", ylabel="first component")
    _sweeps(axes[2], gait, line, study.frames(5.0))
    return figure


def _sweeps(axes: Axes, gait: Array, line: Array, sweep: int) -> None:
    """A line over the gait parameter on the way up and down, ``sweep`` frames each."""
    half = len(gait) // 2
    axes.plot(gait[:sweep], line[:sweep], color=WALK_COLOUR, label="up")
    axes.plot(gait[half : half + sweep], line[half : half + sweep], color=RUN_COLOUR, label="down")
    axes.set(xlabel="gait parameter", ylabel="first component")
    axes.legend()


def bifurcation(study: ControlStudy) -> Figure:
    """Figure 5.7: between the loops, by a sudden switch, a slow ramp, and four times sampled."""
    loops = list(map(study.loop_frames, ("walk", "run")))
    start = study.phases("walk", 1)[0]
    runs = {
        "sudden": study.hold(start, "run", 2.0),
        "5 s ramp": gait_run(study, ramp(study)[: study.frames(6.0)]),
        "sampled, four runs": study.hold(start.repeat(4, axis=0), "run", 2.0, variety=1.0),
    }
    figure, axes = panels(1, 3, (13, 4.3), "From the walking loop (blue) to the running loop (red)")
    plane = _plane(study, np.concatenate(loops), *axes)
    for panel, (name, run) in zip(axes, runs.items(), strict=True):
        for loop, colour in zip(loops, (WALK_COLOUR, RUN_COLOUR), strict=True):
            panel.plot(*plane(loop).T, color=colour, linewidth=2.5, alpha=0.5)
        # one line for each run
        for path in np.moveaxis(run.frames, 1, 0):
            panel.plot(*plane(path).T, ".-", color="black", linewidth=0.7, markersize=2.5)
        panel.set_title(name)
    return figure


def interruption(study: ControlStudy) -> Figure:
    """Figure 5.10: walk, bend, run; the bend completed, and interrupted late, in the middle and early."""
    training = [study.reference.motions[label][0] for label in (study.walk, study.bend, study.run) if label]
    runs = {"completed": _bend_and_run(study), **dict(reversed(interrupted(study, 1).items()))}
    figure, axes = panels(1, len(runs), (15, 4.2), "Training motions (dots) and the path of a run (line)")
    plane = _plane(study, np.concatenate(training), *axes)
    for panel, (name, run) in zip(axes, runs.items(), strict=True):
        for clip, colour in zip(training, (WALK_COLOUR, BEND_COLOUR, RUN_COLOUR), strict=True):
            _dots(panel, plane(clip), colour)
        panel.plot(*plane(run.frames[:, 0]).T, color="black", linewidth=0.8)
        panel.set_title(name)
    return figure


def _bend_and_run(study: ControlStudy) -> Recording:
    """Bend from a walk, and run after the bend is completed."""
    both = np.stack([study.control(bend=1.0), study.control(run=1.0)])
    track = np.repeat(both, [study.frames(5.0), study.frames(2.0)], axis=0)
    return study.play(study.start(study.phases("walk", 1)[0]), track)


def _plane(study: ControlStudy, frames: Array, *shown: Axes) -> Callable[[Array], Array]:
    """The projection onto the first two principal components of frames in z units; labels the axes."""
    z = study.reference.z(frames)
    mean = z.mean(axis=0)
    components = np.linalg.svd(z - mean, full_matrices=False)[2][:2]
    largest = components[np.arange(2), np.abs(components).argmax(axis=1)]
    components *= np.sign(largest)[:, None]  # of the two signs always the same
    for panel in shown:
        panel.set(xlabel="first component, z", ylabel="second component, z")
    return lambda points: (study.reference.z(points) - mean) @ components.T


def _dots(axes: Axes, points: Array, colour: str, label: str | None = None) -> None:
    axes.scatter(points[:, 0], points[:, 1], s=8, color=colour, alpha=0.6, label=label)


def _strip(study: ControlStudy, frames: Array, changed: int, title: str) -> Figure:
    """Every fourth frame as the player's body, with a line where something changed."""
    motion = study.model.contract.features(frames[::4])
    figure, (axes,) = panels(1, 1, (13, 2.6), title)
    bodies(axes, motion, len(motion))
    axes.axvline(SPACING * (changed / 4 - 0.5), color=RUN_COLOUR, linewidth=1)
    return figure
