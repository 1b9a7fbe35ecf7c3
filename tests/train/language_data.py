"""A small corpus of made-up walkers with sentences, for tests of training between motion and language."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from stores import prepare

from motet.motion.motion import Motion
from motet.motion.skeleton import Joint, Skeleton
from motet_train.data.corpus import Record
from motet_train.data.preparation import Preparation
from motet_train.data.store import Store

SKELETON = Skeleton(
    (
        Joint("hips", -1, (0.0, 0.0, 0.0), "xyz"),
        Joint("left_leg", 0, (0.1, -0.05, 0.0), axis=(0.0, 0.0, 20.0)),
        Joint("left_leg_end", 1, (0.0, -0.8, 0.0)),
        Joint("right_leg", 0, (-0.1, -0.05, 0.0), axis=(0.0, 0.0, -20.0)),
        Joint("right_leg_end", 3, (0.0, -0.8, 0.0)),
        Joint("spine", 0, (0.0, 0.3, 0.0), "yzx"),
        Joint("spine_end", 5, (0.0, 0.4, 0.0)),
    ),
    metres_per_unit=1.0,
)

TURNING = ("hips", "left_leg", "right_leg", "spine")


def walker(seed: int, frames: int, fps: float = 30.0) -> Motion:
    """A person that walks, swings its limbs and turns, each seed in another way."""
    rng = np.random.default_rng(seed)
    time = np.arange(frames) / fps
    root = np.stack([0.1 * np.sin(6 * time), 0.93 + 0.02 * np.cos(12 * time), rng.uniform(0.5, 3) * time], axis=1)
    swings = [rng.uniform(5, 20) * np.sin(6 * time + phase) for phase in range(3 * len(TURNING))]
    swings[1] = rng.uniform(-90, 90) * time
    channels = [f"hips.t{axis}" for axis in "xyz"] + [f"{joint}.r{axis}" for joint in TURNING for axis in "xyz"]
    units = ["length"] * 3 + ["deg"] * len(swings)
    return Motion(np.column_stack([root, *swings]), tuple(channels), tuple(units), fps, SKELETON)


def records(count: int) -> Iterator[Record]:
    """Motions of 20 to 35 frames at 30 Hz, each with three sentences; every fifth has a word of its own."""
    for i in range(count):
        side = "left" if i % 2 else "right"
        extra = f"odd{chr(97 + i)}" if i % 5 == 0 else "plain"
        sentences = (f"A person turns {side}.", f"Someone walks at a right angle to the {side}", f"walks {extra}")
        yield Record(f"{i:02}", f"{i % 4}", walker(i, 20 + i % 16), sentences)


def small_store(folder: Path, count: int = 20) -> Store:
    """The corpus prepared at 10 fps with three offsets and the root block, in ``folder``/store."""
    return prepare(records(count), folder / "store", Preparation("root_angles", humanoid=False, trim=False, cut=False))
