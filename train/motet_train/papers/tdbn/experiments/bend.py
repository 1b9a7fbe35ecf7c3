"""The thesis' third experiment: a motion with an end, executed and interrupted (section 5.4, figures 5.9 and 5.10)."""

import numpy as np
from numpy.typing import NDArray

from motet.motion.rotations import Array
from motet_train.papers.tdbn.experiments.measures import upsample
from motet_train.papers.tdbn.experiments.study import ControlStudy, Recording

BEND_DOWN, BEND_RISEN, BEND_NEAR = 0.8, 0.3, 0.5
"""Depth that counts as down, depth after it that counts as risen, z to the clip's deepest poses."""

MOMENTS = {"early": 0.3, "middle": 0.6, "late": 0.95}
"""When the bend is interrupted: at this share of its largest depth."""


def clip(study: ControlStudy) -> Array:
    """One sequence (T, D) of the bend's training motion."""
    assert study.bend is not None
    return study.reference.motions[study.bend][0]


def deepest(study: ControlStudy) -> int:
    """The frame of the training motion that is farthest from its first one."""
    z = study.reference.z(clip(study))
    return int(((z - z[0]) ** 2).sum(axis=1).argmax())


def depth(study: ControlStudy, frames: Array) -> Array:
    """How far down frames (..., D) are, in z along a line: 0 the training motion's first pose, 1 its deepest."""
    z = study.reference.z(clip(study))
    line = z[deepest(study)] - z[0]
    along: Array = (study.reference.z(frames) - z[0]) @ line / (line @ line)
    return along


def executed(study: ControlStudy, frames: Array) -> NDArray[np.bool_]:
    """Which of frames (T, B, D) bend: down to the training motion's deepest poses, and then up again."""
    bottom = deepest(study)
    near = study.reference.distance(frames, upsample(clip(study)[bottom - 4 : bottom + 5])) < BEND_NEAR
    down = near & (depth(study, frames) > BEND_DOWN)
    first = np.where(down.any(axis=0), down.argmax(axis=0), len(frames))
    after = np.arange(len(frames))[:, None] > first
    risen: NDArray[np.bool_] = np.any(after & (depth(study, frames) < BEND_RISEN), axis=0)
    return risen


def bends(study: ControlStudy, count: int = 40, seconds: float = 6.0) -> dict[str, float]:
    """Bend from equal phases of walking and of running: the share executed within ``seconds``, the least depth."""
    figures = {}
    for role, key in (("walk", ""), ("run", "_from_run")):
        frames = study.hold(study.phases(role, count)[0], "bend", seconds).frames
        figures[f"share{key}"] = float(executed(study, frames).mean())
        figures[f"depth{key}"] = float(depth(study, frames).max(axis=0).min())
    return figures


def interruptions(study: ControlStudy, count: int = 10) -> dict[str, float]:
    """Walk, bend, and run in the middle of it: the longest time until running, for each moment and over all."""
    seconds = {
        f"{name}_s": float(study.reaches(run.frames, "run").max()) for name, run in interrupted(study, count).items()
    }
    return {"interrupt_s": max(seconds.values()), **seconds}


def interrupted(study: ControlStudy, count: int) -> dict[str, Recording]:
    """The runs after the interruption, for each of the :data:`MOMENTS`."""
    bend = study.hold(study.phases("walk", count)[0], "bend", 6.0)
    taps, down = study.model.taps, depth(study, bend.frames)
    runs = {}
    for name, share in MOMENTS.items():
        at = (down[taps:] > share * down.max(axis=0)).argmax(axis=0) + taps
        history = np.concatenate([bend.histories([time], taps, row) for row, time in enumerate(at)])
        runs[name] = study.hold(history, "run", 4.0)
    return runs
