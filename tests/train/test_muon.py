"""Muon for the matrices of a net, AdamW for all else."""

from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional
from trainings import same

from motet_train.descent import GradientLearner, Term, Terms, Training
from motet_train.models.net import Net
from motet_train.muon import NEWTON_SCHULZ, Muon, Orthogonal, orthogonal
from motet_train.trainer import train


class Lines(Net):
    """Two matrices, of which Muon may train one, and biases."""

    def __init__(self) -> None:
        super().__init__(1)
        self.first, self.second = nn.Linear(4, 5), nn.Linear(5, 3)

    def matrices(self) -> list[Tensor]:
        return [self.first.weight]

    def loss(self, rows: Tensor) -> Terms:
        found = self.second(self.first(rows).tanh()) - rows[:, 1:]
        return (Term(found.square().mean(dim=1), len(rows)),)

    def graphs(self) -> dict[str, tuple[nn.Module, object]]:  # type: ignore[override]
        return {}


MUON = Training(steps=6, every=2, batch=8, optimiser="muon", learning_rate=0.03, weight_decay=0.1, falling=0.5)


def lines(training: Training = MUON) -> GradientLearner:
    torch.manual_seed(0)
    model = Lines()

    def batches(rng: np.random.Generator) -> Iterator[Tensor]:
        yield torch.from_numpy(rng.normal(size=(training.batch, 4)).astype(np.float32))

    return GradientLearner(model, training, model.loss, batches)


def test_muon_trains_matrices_and_adamw_all_else(tmp_path: Path) -> None:
    learner = lines()
    train(learner, 3, tmp_path)
    torch.manual_seed(0)
    model = Lines()
    matrices, rest = [model.first.weight], [model.second.weight]
    biases = [model.first.bias, model.second.bias]
    muon = torch.optim.Muon(matrices, lr=0.03, weight_decay=0.1, adjust_lr_fn="match_rms_adamw")
    decayed = torch.optim.AdamW(rest, lr=0.03, weight_decay=0.1, betas=(0.9, 0.98))
    others = torch.optim.AdamW(biases, lr=0.03, weight_decay=0.0, betas=(0.9, 0.98))
    for chunk in range(3):
        rng = np.random.default_rng((3, chunk))
        for step in (2 * chunk, 2 * chunk + 1):
            rate = 0.03 * min(1.0, (6 - step) / 3)
            rows = torch.from_numpy(rng.normal(size=(8, 4)).astype(np.float32))
            for optimiser in (muon, decayed, others):
                optimiser.param_groups[0]["lr"] = rate
                optimiser.zero_grad()
            model.loss(rows)[0].losses.mean().backward()
            for optimiser in (muon, decayed, others):
                optimiser.step()
    for name, value in model.state_dict().items():
        # torch's Muon rounds to bfloat16, to 8 bits: of all six steps of a matrix, .03 each, to a few thousandths
        off = {"rtol": 0.0, "atol": 4e-3} if name == "first.weight" else {"rtol": 1e-3, "atol": 1e-3}
        torch.testing.assert_close(learner.kept.state_dict()[name], value, msg=name, **off)


def test_the_matrices_of_muon_are_those_of_its_polynomial_on_singular_values() -> None:
    a, b, c = NEWTON_SCHULZ
    for shape in ((4, 7), (7, 4), (5, 5), (1, 3)):
        matrix = torch.randn(shape, dtype=torch.float64, generator=torch.Generator().manual_seed(sum(shape)))
        left, values, right = torch.linalg.svd(matrix / matrix.norm(), full_matrices=False)
        for _ in range(5):
            values = a * values + b * values**3 + c * values**5
        expected = left @ torch.diag(values) @ right
        torch.testing.assert_close(orthogonal(matrix), expected)
        assert ((values > 0.6) & (values < 1.3)).all()
        torch.testing.assert_close(orthogonal(matrix.float()), expected.float(), rtol=1e-4, atol=1e-5)
    assert not orthogonal(torch.zeros(2, 3)).any()


def test_a_step_of_muon_is_torchs_but_for_its_rounding() -> None:
    rng = torch.Generator().manual_seed(1)
    ours, theirs = (nn.Parameter(torch.ones(6, 4)) for _ in range(2))
    one = Orthogonal([{"params": [ours], "weight_decay": 0.5}], lr=0.1)
    other = torch.optim.Muon([theirs], lr=0.1, weight_decay=0.5, adjust_lr_fn="match_rms_adamw")
    for _ in range(4):
        ours.grad = theirs.grad = torch.randn(6, 4, generator=rng)
        one.step()
        other.step()
        torch.testing.assert_close(ours, theirs, rtol=0.0, atol=2e-3)
    same = other.state_dict()["state"][0]["momentum_buffer"]
    assert torch.equal(one.state_dict()["state"][0]["momentum_buffer"], same)


def test_a_resumed_muon_goes_on_to_the_same_bits(tmp_path: Path) -> None:
    for name in ("whole", "parts"):
        (tmp_path / name).mkdir()
    whole, parts = lines(), lines(Training(**{**asdict(MUON), "steps": 2, "falling": 0.0}))
    train(whole, 3, tmp_path / "whole")
    train(parts, 3, tmp_path / "parts")
    again = lines()
    train(again, 3, tmp_path / "parts")
    assert same(whole.kept.state_dict(), again.kept.state_dict())
    assert not torch.equal(parts.kept.state_dict()["first.weight"], again.kept.state_dict()["first.weight"])


def test_muon_does_with_matrices_alone_or_without_any() -> None:
    weight, bias = nn.Parameter(torch.eye(3)), nn.Parameter(torch.zeros(3))
    for groups in ([{"params": [weight], "muon": True}], [{"params": [bias]}]):
        optimiser = Muon(groups, lr=0.1)
        assert len(optimiser.parts) == len(optimiser.param_groups) == 1
        before = groups[0]["params"][0].detach().clone()  # type: ignore[index]
        functional.linear(torch.ones(1, 3), weight, bias).square().sum().backward()
        optimiser.step()
        assert not torch.equal(groups[0]["params"][0], before)  # type: ignore[index]
        optimiser.zero_grad()
        assert groups[0]["params"][0].grad is None  # type: ignore[index]
