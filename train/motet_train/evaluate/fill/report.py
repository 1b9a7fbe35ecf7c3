"""Gaps cut into trials of people never seen: how far what fills them is from what was there, how feet stand and how
sharply joints move, of a model and of plain ways through."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from motet.models.fill import FillModel
from motet.motion.feet.contacts import ContactSettings, ground_speeds, standing
from motet.motion.humanoid import HUMANOID, LEFT_RIGHT, sided
from motet.motion.rotations import Array
from motet.representation.placed import ROOT_PLACE, bridge, placed_by_way, straight
from motet_train.data.errors import DataError
from motet_train.data.store import Store, split
from motet_train.evaluate.tables import Goals, Report, gathered
from motet_train.models.kinematics import SixdPlaces, tree_of

GAP_SECONDS = (0.5, 1.0, 2.0)
"""Of the gaps."""

FOOT_JOINTS = [HUMANOID.index(sided(side, part)) for side in LEFT_RIGHT for part in ("Foot", "Toes")]

FEET_STAND = ContactSettings(heights=(0.15, 0.15), speeds=(0.2, 0.2))
"""Joints of feet: the ankle of a foot that stands is 8 cm above the ground."""

GOING = 0.5
"""Metres a second that the hips go over the ground, from one end of a gap to the other, of a figure on its way."""

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


@dataclass(frozen=True)
class Window:
    """Placed frames before a gap, in it and after it: (P, E), (N, E), (A, E)."""

    past: Array
    truth: Array
    after: Array


def fill_report(model: FillModel, store: Store) -> Report:
    """The figures of a model on the test part of a store in ``root_sixd``; DataError for another store.

    Of each gap, "gap_0.5" and so on: joints' mean distance in the world "cm", and in gaps where the figure is on its
    way (:data:`GOING`) "cm_going", the speed of feet that stood "slide" in cm a second, "jerk" over the recorded; each
    of the model as it is, of :data:`PLAIN_WAYS` with their names behind, and of the recording.
    """
    if store.representation != "root_sixd":
        raise DataError(f"gaps are measured in root_sixd (motet prepare --for codes), not in {store.representation}")
    return gathered(_parts(model, store), model.manifest.name)


def _parts(model: FillModel, store: Store) -> Iterator[Report]:
    joints = SixdPlaces(tree_of(store.contract((0,))))
    for seconds in GAP_SECONDS:
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
    speeds = np.linalg.norm(np.diff(feet, axis=1), axis=-1) * fps
    stands = standing(feet[:, 1:, :, 1], speeds, FEET_STAND)
    ways = np.array([np.linalg.norm((one.after[0] - one.past[-1])[[0, 2]]) for one in windows])
    going = ways * fps / (len(windows[0].truth) + 1) > GOING
    found: dict[str, float] = {
        "gaps": float(len(windows)),
        "gaps_going": float(going.sum()),
        "jerk_recorded": _jerk(true) * fps**3,
    }
    for name, fill in systems.items():
        places = _places(joints, windows, [fill(one.past, one.after, len(one.truth)) for one in windows])
        off = np.linalg.norm(places - true, axis=-1)[:, MARGIN:-MARGIN]
        tail = f"_{name}" if name else ""
        found[f"cm{tail}"] = 100 * float(off.mean())
        found[f"cm_going{tail}"] = 100 * float(off[going].mean()) if going.any() else float("nan")
        found[f"slide{tail}"] = _slide(places, stands, fps)
        found[f"jerk{tail}"] = _jerk(places) / _jerk(true)
    found["slide_recorded"] = _slide(true, stands, fps)
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


def _slide(places: Array, stands: NDArray[np.bool_], fps: float) -> float:
    """Centimetres a second over the ground of feet while those recorded stand."""
    over = ground_speeds(places[:, :, FOOT_JOINTS], fps)
    return 100 * float(over[stands].mean()) if stands.any() else float("nan")


def _jerk(places: Array) -> float:
    """The mean length of the third difference of joints, metres per frame cubed."""
    return float(np.linalg.norm(np.diff(places, n=3, axis=1), axis=-1).mean())
