"""Gaps cut into trials of people never seen: how far what fills them is from what was there, how feet stand and how
sharply joints move, of a model and of plain ways through."""

from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

import numpy as np
import torch

from motet.models.fill import FillModel
from motet.motion.feet.contacts import ContactSettings, ground_speeds, standing
from motet.motion.humanoid import HUMANOID, LEFT_RIGHT, sided
from motet.motion.rotations import Array
from motet.representation.placed import ROOT_PLACE, bridge, placed_by_way, straight
from motet_train.data.errors import DataError
from motet_train.data.store import Store, split
from motet_train.evaluate.positions import jerk, length
from motet_train.evaluate.tables import Goals, Report, gathered
from motet_train.models.kinematics import SixdPlaces, tree_of

FOOT_JOINTS = [HUMANOID.index(sided(side, part)) for side in LEFT_RIGHT for part in ("Foot", "Toes")]

MARGIN = 3
"""Frames before and after a gap whose joints are looked at with it, so that joins count."""

FILL_GOALS: Goals = {"gap_1.of_interpolation": (None, 0.5)}
"""Figure -> (least, most) that the model that comes with motet is to reach."""

PLAIN_WAYS: Mapping[str, "Fill"] = {
    "hermite": bridge,
    "interpolation": straight,
    "standing": lambda past, after, count: np.repeat(past[-1:], count, axis=0),
}
"""Plain ways: joints by slerp and the root on a cubic Hermite curve, or on a line; and the last frame held."""

Fill = Callable[[Array, Array, int], Array]


class Window(NamedTuple):
    """Placed frames before a gap, in it and after it: (P, E), (N, E), (A, E)."""

    past: Array
    truth: Array
    after: Array


def fill_report(model: FillModel, store: Store) -> Report:
    """The figures of a model on the test part of a store in ``root_sixd``; DataError for another store.

    Of each gap, "gap_0.5" and so on: joints' mean distance in the world "cm", and in gaps where the figure is on its
    way, .5 m/s from one end to the other, "cm_going"; the speed of feet that stood "slide" in cm a second, "jerk" over
    the recorded; each of the model as it is, of :data:`PLAIN_WAYS` with their names behind, and of the recording.
    """
    if store.representation != "root_sixd":
        raise DataError(f"gaps are measured in root_sixd (motet prepare --for codes), not in {store.representation}")
    return gathered(_parts(model, store), model.manifest.name)


def _parts(model: FillModel, store: Store) -> Iterator[Report]:
    joints = SixdPlaces(tree_of(store.contract((0,))))
    for seconds in (0.5, 1.0, 2.0):
        windows = list(_windows(model, store, round(seconds * model.fps)))
        if not windows:
            raise DataError(f"no test trial is long enough for a gap of {seconds:g} s")
        systems: dict[str, Fill] = {"": model.frames_between, **PLAIN_WAYS}
        yield {f"gap_{seconds:g}": _figures(joints, systems, windows, model.fps)}


def _windows(model: FillModel, store: Store, frames: int) -> Iterator[Window]:
    """Gaps side by side in the trials that the model did not see."""
    by = str(model.manifest.training.get("split", {}).get("by", "subject"))
    context = model.context
    for record in split(store.records, 0, by).test:
        sequence = np.array(store.sequence(record), np.float64)
        placed = placed_by_way(sequence, store.fps)
        for start in range(context, len(placed) - context - frames + 1, frames):
            stop = start + frames
            yield Window(placed[start - context : start], placed[start:stop], placed[stop : stop + context])


def _figures(joints: SixdPlaces, systems: Mapping[str, Fill], windows: list[Window], fps: float) -> dict[str, float]:
    true = _places(joints, windows, [one.truth for one in windows])
    feet = true[:, :, FOOT_JOINTS]
    # the ankle of a foot that stands is 8 cm above the ground
    low_and_slow = ContactSettings(heights=(0.15, 0.15), speeds=(0.2, 0.2))
    stands = standing(feet[:, 1:, :, 1], length(np.diff(feet, axis=1)) * fps, low_and_slow)

    def slide(places: Array) -> float:
        """Centimetres a second over the ground of feet while those recorded stand."""
        over = ground_speeds(places[:, :, FOOT_JOINTS], fps)
        return 100 * float(over[stands].mean()) if stands.any() else np.nan

    ways = length(np.array([(one.after[0] - one.past[-1])[[0, 2]] for one in windows]))
    going = ways * fps / (len(windows[0].truth) + 1) > 0.5
    found = {"gaps": float(len(windows)), "gaps_going": float(going.sum()), "jerk_recorded": jerk(true, fps)}
    for name, fill in systems.items():
        places = _places(joints, windows, [fill(one.past, one.after, len(one.truth)) for one in windows])
        off = length(places - true)[:, MARGIN:-MARGIN]
        tail = f"_{name}" if name else ""
        found[f"cm{tail}"] = 100 * float(off.mean())
        found[f"cm_going{tail}"] = 100 * float(off[going].mean()) if going.any() else np.nan
        found[f"slide{tail}"] = slide(places)
        found[f"jerk{tail}"] = jerk(places, fps) / found["jerk_recorded"]
    found["slide_recorded"] = slide(true)
    found["of_interpolation"] = found["cm"] / found["cm_interpolation"]
    found["of_interpolation_going"] = found["cm_going"] / found["cm_going_interpolation"]
    return found


def _places(joints: SixdPlaces, windows: list[Window], filled: list[Array]) -> Array:
    """Joints (W, MARGIN + N + MARGIN, J, 3) in metres."""
    rows = [
        np.concatenate([one.past[-MARGIN:], gap, one.after[:MARGIN]]) for one, gap in zip(windows, filled, strict=True)
    ]
    frames = torch.from_numpy(np.stack(rows).astype(np.float32))
    with torch.inference_mode():
        found: Array = (joints(frames[..., ROOT_PLACE:]) + frames[..., None, :ROOT_PLACE]).numpy().astype(np.float64)
    return found
