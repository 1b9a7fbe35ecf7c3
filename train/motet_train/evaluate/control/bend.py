"""The thesis' third experiment: a motion with an end, executed and interrupted (section 5.4, figures 5.9 and 5.10)."""

import numpy as np
from numpy.typing import NDArray

from motet.motion.rotations import Array
from motet_train.evaluate.control.lab import Lab, Recording
from motet_train.evaluate.control.measures import upsample

DOWN, RISEN, NEAR = 0.8, 0.3, 0.5
"""Depth that counts as down, depth after it that counts as risen, z to the clip's deepest poses."""

MOMENTS = {"early": 0.3, "middle": 0.6, "late": 0.95}
"""When the bend is interrupted: at this share of its largest depth."""


def clip(lab: Lab) -> Array:
    """One sequence (T, D) of the bend's training motion."""
    assert lab.bend is not None
    return lab.reference.motions[lab.bend][0]


def deepest(lab: Lab) -> int:
    """The frame of the training motion that is farthest from its first one."""
    z = lab.reference.z(clip(lab))
    return int(((z - z[0]) ** 2).sum(axis=1).argmax())


def depth(lab: Lab, frames: Array) -> Array:
    """How far down frames (..., D) are, in z along a line: 0 the training motion's first pose, 1 its deepest."""
    z = lab.reference.z(clip(lab))
    line = z[deepest(lab)] - z[0]
    along: Array = (lab.reference.z(frames) - z[0]) @ line / (line @ line)
    return along


def executed(lab: Lab, frames: Array) -> NDArray[np.bool_]:
    """Which of frames (T, B, D) bend: down to the training motion's deepest poses, and then up again."""
    bottom = deepest(lab)
    near = lab.reference.distance(frames, upsample(clip(lab)[bottom - 4 : bottom + 5])) < NEAR
    down = near & (depth(lab, frames) > DOWN)
    first = np.where(down.any(axis=0), down.argmax(axis=0), len(frames))
    after = np.arange(len(frames))[:, None] > first
    risen: NDArray[np.bool_] = np.any(after & (depth(lab, frames) < RISEN), axis=0)
    return risen


def bends(lab: Lab, count: int = 40, seconds: float = 6.0) -> dict[str, float]:
    """Bend from equal phases of walking and of running: the share executed within ``seconds``, the least depth."""
    figures = {}
    for role, key in (("walk", ""), ("run", "_from_run")):
        frames = lab.hold(lab.phases(role, count)[0], "bend", seconds).frames
        figures[f"share{key}"] = float(executed(lab, frames).mean())
        figures[f"depth{key}"] = float(depth(lab, frames).max(axis=0).min())
    return figures


def interruptions(lab: Lab, count: int = 10) -> dict[str, float]:
    """Walk, bend, and run in the middle of it: the longest time until running, for each moment and over all."""
    seconds = {
        f"{name}_s": float(lab.reaches(run.frames, "run").max()) for name, run in interrupted(lab, count).items()
    }
    return {"interrupt_s": max(seconds.values()), **seconds}


def interrupted(lab: Lab, count: int) -> dict[str, Recording]:
    """The runs after the interruption, for each of the :data:`MOMENTS`."""
    bend = lab.hold(lab.phases("walk", count)[0], "bend", 6.0)
    taps, down = lab.model.taps, depth(lab, bend.frames)
    runs = {}
    for name, share in MOMENTS.items():
        at = (down[taps:] > share * down.max(axis=0)).argmax(axis=0) + taps
        history = np.concatenate([bend.histories([time], taps, row) for row, time in enumerate(at)])
        runs[name] = lab.hold(history, "run", 4.0)
    return runs
