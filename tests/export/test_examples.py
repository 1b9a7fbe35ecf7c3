"""What the ladder feeds to graphs: a predictor's frames resemble its data, and its states are its encoder's."""

from importlib import import_module
from typing import Any

import numpy as np
import pytest

from motet.bundle.fields import Fields
from motet.bundle.graph import Arrays, Graph, GraphSpec, TensorSpec
from motet.bundle.manifest import Manifest, read_contract
from motet.models.load import KINDS
from motet_export.decoded import golden_run, runs_of
from motet_export.exporter import ExportError
from motet_export.parity import Once, check_carried, check_far, examples, walks

MOTION = {
    "representation": "angles",
    "channels": ["a", "b"],
    "units": ["rad", "length"],
    "fps": 60.0,
    "mean": [0.5, -40.0],
    "std": [0.1, 6.0],
    "skeleton": None,
}
STEP = GraphSpec(
    (TensorSpec("context", ("batch", 1)), TensorSpec("state", ("batch", 2))),
    (TensorSpec("frame", ("batch", 2)), TensorSpec("next_state", ("batch", 2))),
    {"state": "next_state"},
)


def manifest(verb: str, loop: str) -> Manifest:
    named = {"name": "x", "verb": verb, "model": "x", "loop": loop, "defaults": {}}
    return Manifest.from_json({**named, "motion": MOTION, "vocabulary": ["a", "b"]})


class Codes:
    """An encoder whose codes are the frames."""

    def __init__(self, spec: GraphSpec = STEP) -> None:
        self.spec = spec

    def __call__(self, feeds: Arrays) -> dict[str, np.ndarray]:
        return {"codes": feeds["frames"]}


class Means:
    """An encoder whose state is the mean frame."""

    spec = GraphSpec((TensorSpec("frames", ("batch", 8, 2)),), STEP.inputs)

    def __call__(self, feeds: Arrays) -> dict[str, np.ndarray]:
        mean = feeds["frames"].mean(axis=1)
        return {"context": mean[:, :1], "state": mean}


class Turn:
    """A step that multiplies the state on a circle of length 1, and errs by a little."""

    spec = STEP

    def __init__(self, slip: float = 0.0, times: int = 1) -> None:
        self.slip, self.times = np.float32(slip), times

    def __call__(self, feeds: Arrays) -> dict[str, np.ndarray]:
        state = self.times * feeds["state"] % 1 + self.slip
        return {"frame": state, "next_state": state}


def test_a_predictors_step_is_asked_about_what_its_encoder_makes_of_frames_like_the_datas() -> None:
    graphs: dict[str, Graph] = {"encoder": Means(), "step": Turn()}
    draws = examples(manifest("predict", "free_run"), graphs)
    frames = draws["encoder"](np.random.default_rng(0), 500)["frames"]
    np.testing.assert_array_equal(
        draws["step"](np.random.default_rng(0), 500)["state"], graphs["encoder"]({"frames": frames})["state"]
    )
    np.testing.assert_allclose(frames.mean(axis=(0, 1)), MOTION["mean"], rtol=0.02)
    assert (np.abs(frames - np.array(MOTION["mean"])) < 2 * np.array(MOTION["std"])).all()


def test_inputs_far_from_all_data_are_zeros_ones_negatives_and_single_numbers() -> None:
    graphs: dict[str, Graph] = {"encoder": Means(), "step": Turn()}
    frames = examples(manifest("predict", "free_run"), graphs, far=True)["encoder"](np.random.default_rng(0), 500)[
        "frames"
    ]
    assert frames[0].max() == frames[0].min() == 0
    assert frames[1].max() == frames[1].min() == 1
    assert frames[2].max() <= 0
    np.testing.assert_allclose(np.median(frames[3:], axis=(0, 1)), MOTION["mean"], rtol=0.02)
    off = np.abs(frames[3:] - np.array(MOTION["mean"])) / np.array(MOTION["std"])
    assert 0.005 < (off > 2).mean() < 0.02  # one of a hundred
    assert 9.9 < off[off > 2].min() < 20
    assert 500 < off.max() < 1010


class Inverse:
    """A step whose division makes much of the last bits of small numbers."""

    spec = STEP

    def __init__(self, slip: float = 0.0) -> None:
        self.slip = np.float32(slip)

    def __call__(self, feeds: Arrays) -> dict[str, np.ndarray]:
        state = 1 / (feeds["state"] - np.float32(0.7)) + self.slip
        return {"frame": state, "next_state": state}


def test_equal_calls_are_computed_once_and_others_again() -> None:
    calls = []

    class Counted(Inverse):
        def __call__(self, feeds: Arrays) -> dict[str, np.ndarray]:
            calls.append(feeds)
            return super().__call__(feeds)

    once = Once(Counted())
    state = np.ones((3, 2), np.float32)
    first = once({"state": state})
    np.testing.assert_array_equal(once({"state": state.copy()})["frame"], first["frame"])
    assert (once.spec, len(calls)) == (STEP, 1)
    np.testing.assert_array_equal(once({"state": state + 1})["frame"], Inverse()({"state": state + 1})["frame"])
    assert len(calls) == 2


def test_far_inputs_are_held_to_the_rounding_of_torch() -> None:
    def draw(rng: np.random.Generator, rows: int) -> Arrays:
        return {"state": (0.7 + rng.uniform(0.001, 0.002, (rows, 2))).astype(np.float32)}

    report = check_far("step", Inverse(), Inverse(), draw)
    assert report["bound"] == pytest.approx(10 * report["rounding"]) != 1e-5
    with pytest.raises(ExportError, match=r"step\.far"):
        check_far("step", Inverse(20.0), Inverse(), draw)
    with pytest.raises(ExportError, match=r"step\.far: the error is 1\.0"):
        check_far("step", Turn(1e-4), Turn(), lambda rng, rows: {"state": rng.random((rows, 2), np.float32)})


def test_frames_of_other_graphs_are_like_the_datas_and_the_rest_is_what_their_contract_allows() -> None:
    spec = GraphSpec(
        (
            TensorSpec("frames", ("batch", "time", 3)),
            TensorSpec("history", ("batch", 5, 2)),
            TensorSpec("words", ("batch", "time"), "int64"),
            TensorSpec("noise", ("batch", 4)),
        ),
        (),
    )
    graphs: dict[str, Graph] = {"encoder": Codes(), "step": Codes(spec)}
    found = examples(manifest("control", "session"), graphs)["step"](np.random.default_rng(0), 300)
    assert found["frames"].shape[::2] == (300, 3)
    assert (found["frames"][:, :, 2] == 1).all()  # the flag of a normalised frame
    assert 0.05 < found["frames"][:, :, :2].std() < 1
    history = (found["history"] - np.array(MOTION["mean"])) / MOTION["std"]
    assert np.abs(history.mean(axis=(0, 1))).max() < 0.05
    assert 0.05 < history.std() < 1
    assert set(found["words"].ravel()) == {0, 1}
    assert 0.05 <= found["noise"].min() < found["noise"].max() < 1


def test_walks_go_on_from_frame_to_frame() -> None:
    contract = read_contract(Fields(MOTION, "motion"))
    pace = np.diff(walks(contract, np.random.default_rng(0), 200, 20), axis=1).std(axis=(0, 1))
    np.testing.assert_allclose(pace, 0.1 * contract.std, rtol=0.05)


def test_a_state_is_carried_to_the_horizon_that_a_predictor_has() -> None:
    pair = Turn(1e-6), Turn()
    assert check_carried(*pair, horizon=5)["error"] == pytest.approx(5e-6, rel=0.1)
    with pytest.raises(ExportError, match="carried"):
        check_carried(*pair)


def test_a_step_that_amplifies_rounding_is_held_to_what_torch_makes_of_it() -> None:
    def check(slip: float, horizon: int) -> dict[str, Any]:
        return check_carried(Turn(slip, times=2), Turn(times=2), horizon=horizon)

    report = check(1e-7, 12)
    assert report["bound"] == pytest.approx(10 * report["rounding"])
    assert 1e-4 < report["error"] < report["bound"]
    with pytest.raises(ExportError, match="carried"):
        check(1e-5, 12)
    with pytest.raises(ExportError, match="the bound 1e-02"):
        check(1e-7, 20)  # by then torch is as far from itself, and nothing can be told


def test_every_kind_of_model_has_a_golden_run_and_whole_runs() -> None:
    for by_loop in KINDS.values():
        for place in by_loop.values():
            module, _, name = place.rpartition(".")
            kind = getattr(import_module(f"motet.{module}"), name)
            for runs in (golden_run, runs_of):
                assert runs.dispatch(kind) is not runs.dispatch(object)
