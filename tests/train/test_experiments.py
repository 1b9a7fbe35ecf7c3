"""The shipped model does what the thesis shows; what should fail, fails."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from control_runs import control_run
from numpy.typing import NDArray

from motet.bundle.graph import Arrays, GraphSpec, TensorSpec
from motet.models.control import ControlModel
from motet.models.load import load
from motet.representation.contract import MotionContract
from motet_train.data.clips import Clips, read_clips
from motet_train.evaluate.control.gaits import gait_transitions, limit_cycle
from motet_train.evaluate.control.lab import Lab
from motet_train.evaluate.control.report import GOALS, control_report, lab_of
from motet_train.evaluate.tables import reached
from motet_train.models.control.tdbn import TDBNConfig


@pytest.fixture(scope="module")
def clips() -> Clips:
    return read_clips()


def test_the_shipped_bundle_reaches_every_goal_and_says_what_is_measured(clips: Clips) -> None:
    model = load("cmu-control")
    report = control_report(lab_of(model, clips), lambda _: None)
    missed = {
        name: report[name.split(".")[0]][name.split(".")[1]]
        for name in GOALS
        if not reached(GOALS, name, _of(report, name))
    }
    assert missed == {}
    for name in GOALS:
        group, key = name.split(".")
        assert model.manifest["quality"][group][key] == pytest.approx(_of(report, name), rel=0.05, abs=0.05), name


@pytest.mark.parametrize(("clamped", "least", "most"), [(False, 1.5, np.inf), (True, 0.0, 1.0)])
def test_unclamped_control_units_make_the_state_leap(clips: Clips, clamped: bool, least: float, most: float) -> None:
    """The thesis' text unclamps them in the reconstruction; the switch is then a jump in one frame."""
    config = TDBNConfig().unclamped()
    config = replace(config, clamped=clamped, rbm=replace(config.rbm, epochs=300))
    run = control_run(clips, config)
    lab = lab_of(ControlModel(run.manifest, run.torch_graphs()), clips)
    assert least < gait_transitions(lab, count=8)["jump_ratio"] < most


def test_a_linear_autoregression_has_no_cycle(clips: Clips) -> None:
    lab = autoregression(lab_of(load("cmu-control"), clips))
    figures = limit_cycle(lab, seconds=60.0)
    # what is linear dies out or blows up: no motion of the right size and period is left after a minute
    assert not (0.7 <= figures["energy"] <= 1.1 and figures["period_error"] < 0.02)


def _of(report: Mapping[str, Mapping[str, float]], name: str) -> float:
    group, key = name.split(".")
    return report[group][key]


class Linear:
    """The next frame as a ridge regression on the last three: a control model's two graphs in numpy."""

    def __init__(self, contract: MotionContract, clips: list[NDArray[np.float64]]) -> None:
        self.mean, self.std = contract.mean, np.where(contract.std < 1e-3, 1, contract.std)
        z = [(clip - self.mean) / self.std for clip in clips]
        past = np.concatenate([np.concatenate([c[:-3], c[1:-2], c[2:-1], np.ones((len(c) - 3, 1))], axis=1) for c in z])
        target = np.concatenate([c[3:] for c in z])
        self.weight = np.linalg.solve(past.T @ past + 0.1 * np.eye(past.shape[1]), past.T @ target)

    def encode(self, feeds: Arrays) -> dict[str, NDArray[np.float32]]:
        return {"codes": ((feeds["frames"] - self.mean) / self.std).astype(np.float32)}

    def step(self, feeds: Arrays) -> dict[str, NDArray[np.float32]]:
        history = feeds["history"].astype(np.float64)
        one = np.ones((len(history), 1))
        code = np.concatenate([history.reshape(len(history), -1), one], axis=1) @ self.weight
        after = np.concatenate([history[:, 1:], code[:, None]], axis=1).clip(-1e6, 1e6)
        frame = code * self.std + self.mean
        return {"frame": frame.astype(np.float32), "next_history": after.astype(np.float32)}


def autoregression(lab: Lab) -> Lab:
    """The lab with an autoregression on the walk in place of its model."""
    contract, channels = lab.model.contract, len(lab.model.contract.channels)
    linear = Linear(contract, list(lab.reference.motions["walk"]))
    history = TensorSpec("history", ("batch", 3, channels))
    inputs = (history, TensorSpec("control", ("batch", 3)), TensorSpec("noise", ("batch", 1)))
    step = FunctionGraph(linear.step, GraphSpec(inputs, (), {"history": "next_history"}))
    model = ControlModel(lab.model.manifest, {"encoder": FunctionGraph(linear.encode, GraphSpec((), ())), "step": step})
    return Lab(model, lab.reference, lab.walk, lab.run, lab.bend, None)


class FunctionGraph:
    """Any function as a graph."""

    def __init__(self, function, spec: GraphSpec) -> None:  # type: ignore[no-untyped-def]
        self.function, self.spec = function, spec

    def __call__(self, feeds: Arrays) -> dict[str, NDArray[np.float32]]:
        result: dict[str, NDArray[np.float32]] = self.function(feeds)
        return result
