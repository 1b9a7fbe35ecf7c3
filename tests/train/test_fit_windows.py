"""The training loop of published systems: what a step does, what is kept, and going on after a stop."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from motet_train.checkpoint import CHECKPOINT, LOG, WEIGHTS
from motet_train.fit_windows import Fitting, Learner, fit_windows, rate
from torch import Tensor, nn

from motet_train.models.predict.stepwise import State, Stepwise, System, squared_error
from motet_train.runs import RunError

FITTING = Fitting(steps=12, batch=8, learning_rate=0.02, every=3)


class Velocity(System):
    """The last frame and a learned share of the last step."""

    def __init__(self) -> None:
        super().__init__()
        self.carried, self.constant = {"last": (4,), "step": (4,)}, {}
        self.share = nn.Linear(4, 4)
        self.dropout = nn.Dropout(0.1)
        self.shares: list[float] = []

    def begin(self, seed: Tensor) -> State:
        return {"last": seed[:, -1], "step": seed[:, -1] - seed[:, -2]}

    def predict(self, state: State) -> tuple[Tensor, State]:
        return state["last"] + self.dropout(self.share(state["step"])), {"step": state["step"]}

    def push(self, state: State, frame: Tensor) -> State:
        return {"last": frame, "step": frame - state["last"]}

    def progress(self, share: float) -> None:
        self.shares.append(share)


def draw(rng: np.random.Generator, batch: int) -> Tensor:
    """Straight lines: 6 frames given, 3 to come."""
    start, step = (rng.normal(size=(batch, 1, 4)).astype(np.float32) for _ in range(2))
    return torch.from_numpy(start + 0.3 * step * np.arange(9, dtype=np.float32)[:, None])


def learner(fitting: Fitting = FITTING) -> Learner:
    torch.manual_seed(0)
    return Learner(Stepwise(Velocity(), 4, range(4), 6), fitting)


def train(
    folder: Path,
    fitting: Fitting = FITTING,
    validate: Callable[[], float] | None = None,
    progress: Callable[[int, float], object] = lambda steps, loss: None,
) -> Learner:
    folder.mkdir(exist_ok=True)
    trained = learner(fitting)
    windows = draw(np.random.default_rng(9), 32)

    def error() -> float:
        with torch.no_grad():
            return float(trained.net.system.loss(windows, 6))

    fit_windows(trained, draw, validate or error, 5, folder, progress)
    return trained


def same(one: nn.Module, other: nn.Module) -> bool:
    return all(torch.equal(a, b) for a, b in zip(one.parameters(), other.parameters(), strict=True))


@pytest.mark.parametrize("stop", [2, 5, 9, 11])
def test_stopped_and_resumed_is_the_same_to_the_bit_as_never_stopped(tmp_path: Path, stop: int) -> None:
    def progress(steps: int, loss: float) -> None:
        if steps == stop:
            raise KeyboardInterrupt

    whole = train(tmp_path / "whole")
    with pytest.raises(KeyboardInterrupt):
        train(tmp_path / "parts", progress=progress)
    parts = train(tmp_path / "parts")
    assert same(whole.net, parts.net)
    assert [line["loss"] for line in whole.log] == [line["loss"] for line in parts.log]
    assert [line["step"] for line in map(json.loads, (tmp_path / "parts" / LOG).read_text().splitlines())] == [
        3,
        6,
        9,
        12,
    ]


def test_it_learns_and_is_told_how_far_it_is(tmp_path: Path) -> None:
    trained = train(tmp_path / "run", replace(FITTING, steps=300, every=100))
    lines = draw(np.random.default_rng(9), 32)
    standing_still = float(squared_error(lines[:, 5:6], lines[:, 6:]))
    assert trained.log[-1]["validation_error"] < 0.1 * standing_still
    system = trained.net.system
    assert isinstance(system, Velocity)
    np.testing.assert_allclose(system.shares, np.arange(300) / 300)


def test_the_weights_of_the_best_validation_are_kept_and_patience_ends_it(tmp_path: Path) -> None:
    errors = iter([0.5, 0.3, 0.4, 0.35, 0.2])
    folder = tmp_path / "run"
    trained = train(folder, replace(FITTING, steps=100, patience=2), validate=lambda: next(errors))
    assert [line["validation_error"] for line in trained.log] == [0.5, 0.3, 0.4, 0.35]
    second = train(tmp_path / "second", replace(FITTING, steps=6, falling=0.0), validate=lambda: 1 / len(trained.log))
    state = torch.load(folder / WEIGHTS, weights_only=True)
    assert torch.equal(state["system.share.weight"], trained.net.state_dict()["system.share.weight"])
    last = torch.load(folder / CHECKPOINT, weights_only=True)["states"]["net"]
    assert not torch.equal(last["system.share.weight"], state["system.share.weight"])
    assert len(second.log) == 2


def test_l2_is_a_term_of_the_loss_and_leaves_biases_alone() -> None:
    fitting = Fitting(optimiser="sgd", learning_rate=0.1, l2=0.03)
    one, other, windows = learner(fitting), learner(fitting), draw(np.random.default_rng(0), 4)
    one.net.eval(), other.net.eval()
    one.step(windows)
    weight = other.net.system.share.weight  # type: ignore[union-attr]
    loss = other.net.system.loss(windows, 6) + 0.03 * weight.square().sum()  # type: ignore[operator]
    gradients = torch.autograd.grad(loss, list(other.net.parameters()))
    for stepped, before, gradient in zip(one.net.parameters(), other.net.parameters(), gradients, strict=True):
        torch.testing.assert_close(stepped, before - 0.1 * gradient)


def test_the_gradient_is_clipped() -> None:
    fitting = Fitting(optimiser="sgd", learning_rate=1.0, clip=1e-3)
    trained, before = learner(fitting), learner(fitting)
    trained.step(draw(np.random.default_rng(0), 4))
    moved = [a - b for a, b in zip(trained.net.parameters(), before.net.parameters(), strict=True)]
    np.testing.assert_allclose(float(torch.cat([part.flatten() for part in moved]).norm().detach()), 1e-3, rtol=1e-3)


def test_learning_rates() -> None:
    falling = Fitting(steps=100, learning_rate=1.0, falling=0.5)
    np.testing.assert_allclose([rate(falling, step) for step in (0, 50, 75, 99)], [1, 1, 0.5, 0.02])
    decaying = Fitting(learning_rate=1.0, decay=(0.95, 10))
    np.testing.assert_allclose([rate(decaying, step) for step in (9, 10, 35)], [1, 0.95, 0.95**3])


def test_bad_trainings_are_named(tmp_path: Path) -> None:
    bad = learner()
    with pytest.raises(RunError, match="no longer finite"):
        bad.step(torch.full((2, 9, 4), float("nan")))
    train(tmp_path / "run")
    (tmp_path / "run" / CHECKPOINT).write_bytes(b"nothing")
    with pytest.raises(RunError, match="cannot be read"):
        train(tmp_path / "run")
