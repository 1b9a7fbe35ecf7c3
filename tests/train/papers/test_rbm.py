"""RBM learning against a twin in scalar loops."""

import math

import numpy as np
import torch

from motet_train.papers.tdbn.rbm import (
    RBM,
    Ascent,
    Epoch,
    Learning,
    RBMLayer,
    balanced,
    block_mask,
    reconstruct,
    schedule,
)


def small_rbm() -> RBM:
    rbm = RBM(block_mask([0, 0, 1], hidden_per_part=2))
    generator = torch.Generator().manual_seed(0)
    for value in (rbm.weight, rbm.visible_bias, rbm.hidden_bias):
        value.normal_(0, 0.5, generator=generator)
    rbm.weight.mul_(rbm.mask)
    return rbm


def test_the_mask_joins_units_of_one_part() -> None:
    assert block_mask([0, 0, 1], 2).tolist() == [[1, 1, 0, 0], [1, 1, 0, 0], [0, 0, 1, 1]]


def test_reconstruction_is_a_sample_and_then_means() -> None:
    rbm = small_rbm()
    hidden = torch.tensor([[1.0, 0.0, 1.0, 1.0]])
    noise, jitter = torch.full((1, 1, 4), 0.4), torch.tensor([[[0.3, -0.2, 0.1]]])
    end, end_hidden = reconstruct(rbm, hidden, noise, jitter, temperature=0.7)

    w, a, b = rbm.weight.tolist(), rbm.visible_bias.tolist(), rbm.hidden_bias.tolist()

    def means(h: list[float]) -> list[float]:
        return [a[i] + sum(w[i][j] * h[j] for j in range(4)) for i in range(3)]

    def probabilities(v: list[float]) -> list[float]:
        return [1 / (1 + math.exp(-(b[j] + sum(w[i][j] * v[i] for i in range(3))) / 0.7)) for j in range(4)]

    visible = [m + x for m, x in zip(means([1, 0, 1, 1]), [0.3, -0.2, 0.1], strict=True)]
    sampled = [float(p > 0.4) for p in probabilities(visible)]
    expected = means(sampled)
    np.testing.assert_allclose(end[0], expected, atol=1e-6)
    np.testing.assert_allclose(end_hidden[0], probabilities(expected), atol=1e-6)


def test_the_thesis_procedure_is_one_reconstruction() -> None:
    """Thesis 3.2: hidden units of the data, visible units of these, and hidden units of those; then the update."""
    rbm, frames = small_rbm(), torch.tensor([[0.5, -1.0, 0.3]])
    before = {name: value.clone() for name, value in rbm.named_parameters()}
    learning = Learning(1, rate=0.1, batch=1, decay=0.0, temperature=(1.0, 1.0))
    layer = RBMLayer(rbm, frames, torch.ones(1), learning, torch.Generator().manual_seed(3))
    layer.epoch(0)
    generator = torch.Generator().manual_seed(3)
    torch.multinomial(torch.ones(1), 1, replacement=True, generator=generator)
    noise = torch.rand(1, 1, 1, 4, generator=generator)[0, 0]

    def hidden(visible: torch.Tensor) -> torch.Tensor:
        return torch.sigmoid(visible @ before["weight"] + before["hidden_bias"])

    first = (noise < hidden(frames)).float()
    again = first @ before["weight"].T + before["visible_bias"]
    learned = 0.1 * (frames.T @ first - again.T @ hidden(again)) * rbm.mask
    np.testing.assert_allclose(rbm.weight - before["weight"], learned, atol=1e-6)
    np.testing.assert_allclose(rbm.visible_bias - before["visible_bias"], 0.1 * (frames - again)[0], atol=1e-6)


def test_ascent_has_momentum_and_decay() -> None:
    value = torch.tensor([[1.0, -2.0]])
    ascent = Ascent(value, decay=0.5)
    data = (torch.tensor([[2.0]]), torch.tensor([[1.0, 3.0]]))
    model = (torch.tensor([[1.0]]), torch.tensor([[1.0, 1.0]]))
    weight, velocity = np.array([1.0, -2.0]), np.zeros(2)
    for momentum in (0.0, 0.9):
        ascent.contrast(data, model, Epoch(0.1, momentum, 1.0, torch.empty(0)))
        velocity = momentum * velocity + 0.1 * (2 * np.array([1, 3]) - np.array([1, 1]))
        weight = weight * (1 - 0.1 * 0.5) + velocity
    np.testing.assert_allclose(value[0], weight, rtol=1e-6)


def test_learning_follows_the_schedule() -> None:
    learning = Learning(epochs=9, rate=0.1, final_rate=0.01, batch=5, momentum_after=2, temperature=(1.0, 0.5))
    generator, uniform = torch.Generator().manual_seed(0), torch.full((40,), 1 / 40)
    found = [schedule(learning, number, uniform, generator) for number in range(9)]
    assert [epoch.momentum for epoch in found] == [0.0, 0.0] + [0.9] * 7
    np.testing.assert_allclose([epoch.rate for epoch in found], np.geomspace(0.1, 0.001, 9))
    np.testing.assert_allclose([epoch.temperature for epoch in found], np.geomspace(1.0, 0.5, 9))
    assert {tuple(epoch.batches.shape) for epoch in found} == {(8, 5)}


def test_draws_are_balanced_over_motions() -> None:
    probabilities = balanced([torch.ones(10), torch.tensor([3.0, 1.0])])
    np.testing.assert_allclose(probabilities, [0.05] * 10 + [0.375, 0.125])


def test_training_reconstructs_what_it_saw_within_its_parts() -> None:
    generator = torch.Generator().manual_seed(0)
    phase = torch.linspace(0, 20, 300)
    frames = torch.stack([phase.sin(), phase.cos(), (2 * phase).sin()], dim=1) * 2
    rbm = RBM(block_mask([0, 0, 1], hidden_per_part=12))
    rbm.weight.normal_(0, 0.01, generator=generator).mul_(rbm.mask)
    learning = Learning(epochs=150, rate=5e-3)
    layer = RBMLayer(rbm, frames, torch.full((300,), 1 / 300), learning, generator)
    errors = [layer.epoch(number) for number in range(150)]
    error = (rbm.decode(rbm.encode(frames, 0.6)) - frames).pow(2).mean().sqrt()
    assert error < 0.6 * frames.pow(2).mean().sqrt()
    assert (rbm.weight[rbm.mask == 0] == 0).all()
    assert np.mean(errors[-10:]) < 0.8 * np.mean(errors[:10])
