"""Gaps cut into trials of unseen people: how far filled frames are from the recorded ones, how feet stand and how
sharply joints move, for a model and for simple interpolations."""

from collections.abc import Callable, Iterator, Mapping
from itertools import product
from typing import NamedTuple

import numpy as np
import torch

from motet.figures.feet.contacts import ContactSettings, ground_speeds, standing
from motet.figures.humanoid import HUMANOID, LEFT_RIGHT, sided
from motet.motion.rotations import Array
from motet.predict.fill import FillModel
from motet.representation.placed import ROOT_PLACE, bridge, placed_by_way, straight
from motet_train.data.errors import DataError
from motet_train.data.store import Store, split
from motet_train.evaluate.positions import Flags, jerk, length
from motet_train.evaluate.tables import Figures, Report, gathered, read_goals
from motet_train.models.kinematics import SixdPlaces, tree_of

FOOT_JOINTS = [HUMANOID.index(sided(side, part)) for side, part in product(LEFT_RIGHT, ("Foot", "Toes"))]

MARGIN = 3
"""Frames before and after a gap that are measured with it, so that the seams count."""

FILL_GOALS = read_goals("fill")

PLAIN_WAYS: Mapping[str, "Fill"] = {
    "hermite": bridge,
    "interpolation": straight,
    "standing": lambda past, after, count: np.repeat(past[-1:], count, axis=0),
}
"""Baselines: slerp of the joints with the root on a cubic Hermite curve, or on a line; and the last frame held."""

Fill = Callable[[Array, Array, int], Array]


class Window(NamedTuple):
    """Placed frames before a gap, in it and after it: (P, E), (N, E), (A, E)."""

    past: Array
    truth: Array
    after: Array


def fill_report(model: FillModel, store: Store) -> Report:
    """The figures of a model on the test part of a store in ``root_sixd``; DataError for another store.

    For each gap length, "gap_0.5" and so on: the mean distance of joints in the world, "cm"; the same for gaps across
    which the figure travels at .5 m/s or more, "cm_going"; the speed of the feet that stand in the recording, "slide"
    in cm a second; and "jerk" relative to the recording. Plain keys are the model's; those of :data:`PLAIN_WAYS` and of
    the recording have its name as a suffix.
    """
    store.needs_sixd("gaps are measured in")
    return gathered(_parts(model, store), model.manifest.name)


def _parts(model: FillModel, store: Store) -> Iterator[Report]:
    joints = SixdPlaces(tree_of(store.contract((0,))))
    systems: dict[str, Fill] = {"": model.frames_between, **PLAIN_WAYS}
    for seconds in (0.5, 1.0, 2.0):
        windows = list(_windows(model, store, round(seconds * model.fps)))
        if not windows:
            raise DataError(f"no test trial is long enough for a gap of {seconds:g} s")
        yield {f"gap_{seconds:g}": _figures(joints, systems, windows, model.fps)}


def _windows(model: FillModel, store: Store, frames: int) -> Iterator[Window]:
    """Adjacent gaps in the trials that were held out in training."""
    by = str(model.manifest.training.get("split", {}).get("by", "subject"))
    context = model.context
    for record in split(store.records, 0, by).test:
        sequence = np.array(store.sequence(record), np.float64)
        placed = placed_by_way(sequence, store.fps)
        for start in range(context, len(placed) - context - frames + 1, frames):
            stop = start + frames
            yield Window(placed[start - context : start], placed[start:stop], placed[stop : stop + context])


def _figures(joints: SixdPlaces, systems: Mapping[str, Fill], windows: list[Window], fps: float) -> Figures:
    # what was recorded: which feet stand, and across which gaps the figure travels
    recorded = _places(joints, windows, [window.truth for window in windows])
    stands = _standing_feet(recorded, fps)
    going = _going(windows, fps)
    figures = {"gaps": float(len(windows)), "gaps_going": going.sum(), "jerk_recorded": jerk(recorded, fps)}

    # every system, relative to the recording
    for name, fill in systems.items():
        filled = [fill(window.past, window.after, len(window.truth)) for window in windows]
        places = _places(joints, windows, filled)
        suffix = f"_{name}" if name else ""
        for key, value in _distances(length(places - recorded), going).items():
            figures[f"{key}{suffix}"] = value
        figures[f"slide{suffix}"] = _slide(places, stands, fps)
        figures[f"jerk{suffix}"] = jerk(places, fps) / figures["jerk_recorded"]

    figures["slide_recorded"] = _slide(recorded, stands, fps)
    for key in ("", "_going"):
        figures[f"of_interpolation{key}"] = figures[f"cm{key}"] / figures[f"cm{key}_interpolation"]
    return figures


def _distances(distances: Array, going: Flags) -> Figures:
    """Mean distances (W, T, J) of joints in all gaps, and in those across which the figure travels, centimetres."""
    inside = distances[:, MARGIN:-MARGIN]
    return {
        "cm": 100 * inside.mean(),
        "cm_going": 100 * inside[going].mean() if going.any() else np.nan,
    }


def _going(windows: list[Window], fps: float) -> Flags:
    """Whether the figure travels across each gap (W,)."""
    crossings = np.array([(window.after[0] - window.past[-1])[[0, 2]] for window in windows])
    return length(crossings) * fps / (len(windows[0].truth) + 1) > 0.5


def _standing_feet(places: Array, fps: float) -> Flags:
    """Whether each of :data:`FOOT_JOINTS` stands after each step (W, T - 1, 4), by joints (W, T, J, 3)."""
    feet = places[:, :, FOOT_JOINTS]
    speeds = length(np.diff(feet, axis=1)) * fps
    # the ankle of a standing foot is 8 cm above the ground
    low_and_slow = ContactSettings(heights=(0.15, 0.15), speeds=(0.2, 0.2))
    return standing(feet[:, 1:, :, 1], speeds, low_and_slow)


def _slide(places: Array, stands: Flags, fps: float) -> float:
    """The mean speed over the ground of feet while those recorded stand, centimetres a second; NaN if none does."""
    speeds = ground_speeds(places[:, :, FOOT_JOINTS], fps)
    return 100 * speeds[stands].mean() if stands.any() else np.nan


def _places(joints: SixdPlaces, windows: list[Window], filled: list[Array]) -> Array:
    """Joints (W, MARGIN + N + MARGIN, J, 3) in metres."""
    rows = []
    for window, gap in zip(windows, filled, strict=True):
        rows.append(np.concatenate([window.past[-MARGIN:], gap, window.after[:MARGIN]]))
    frames = torch.from_numpy(np.stack(rows).astype(np.float32))
    with torch.inference_mode():
        root = frames[..., None, :ROOT_PLACE]
        places: Array = (joints(frames[..., ROOT_PLACE:]) + root).numpy().astype(np.float64)
    return places
