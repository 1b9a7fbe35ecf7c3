"""A model of fill whose graph adds nothing to the plain way through a gap: what comes out is known beforehand."""

import numpy as np
from fake_models import FakeGraph, manifest, spec

from motet.figures.humanoid.bones import BONES, HUMANOID
from motet.motion.motion import Motion
from motet.predict.fill import FillModel
from motet.representation.contract import MotionContract
from motet.representation.placed import PLACED_CHANNELS
from motet.representation.root_sixd import ROOT_SIXD, ROOT_SIXD_UNITS, SIXD_KINDS

NAMES = (*ROOT_SIXD, *(f"{bone}.{kind}" for bone in BONES for kind in SIXD_KINDS))
D = len(NAMES)
CONTRACT = MotionContract(
    "root_sixd", NAMES, (*ROOT_SIXD_UNITS, *("1",) * (D - 4)), 30.0, np.zeros(D), np.ones(D), HUMANOID
)
DEFAULTS = {"context": 20, "least": 4, "longest": 60}


def fill_model(added: float = 0.0) -> FillModel:
    """A model that fills gaps plainly. added: metres that it lifts the hips by in the gap."""

    def filler(past: np.ndarray, plain: np.ndarray, after: np.ndarray) -> tuple[np.ndarray]:
        assert past.dtype == plain.dtype == after.dtype == np.float32
        return (plain + added * (np.arange(PLACED_CHANNELS) == 1),)

    inputs = {"past": "batch before E", "plain": "batch gap E", "after": "batch behind E"}
    graph = FakeGraph(spec(inputs, {"filled": "batch gap E"}, {"E": PLACED_CHANNELS}), filler)
    return FillModel(manifest("fill", "between", CONTRACT, DEFAULTS), {"filler": graph})


def glider(frames: int = 90, fps: float = 30.0, speed: float = 1.2) -> Motion:
    """The humanoid goes along x at an even speed, facing so, while each arm turns evenly."""
    time = np.arange(frames) / fps
    angles = {"hips.ry": np.full(frames, 90.0), "leftUpperArm.rx": 40 * time, "rightUpperArm.rz": 25 - 30 * time}
    joints = [f"{bone}.r{axis}" for bone in BONES for axis in "xyz"]
    values = [0.3 + speed * time, np.full(frames, 0.97), np.full(frames, -0.2)]
    values += [angles.get(name, np.zeros(frames)) for name in joints]
    names = (*(f"hips.t{axis}" for axis in "xyz"), *joints)
    return Motion(np.column_stack(values), names, ("m",) * 3 + ("deg",) * len(joints), fps, HUMANOID)
