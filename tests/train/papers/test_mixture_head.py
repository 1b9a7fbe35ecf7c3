"""The mixture against scipy's densities, in double precision and as products."""

import numpy as np
import pytest
import torch
from numpy.typing import NDArray
from scipy.stats import norm
from torch import Tensor

from motet_train.papers.plappert2017.language_to_motion import Mixture, MixtureHead

N, K, D = 6, 3, 4


def mixture(spread: float = 1.0) -> Mixture:
    generator = torch.Generator().manual_seed(0)
    weights, active = torch.randn(N, K, generator=generator), torch.randn(N, generator=generator)
    means, scales = (torch.randn(N, K, D, generator=generator) for _ in range(2))
    return Mixture(weights.log_softmax(-1), means, spread * scales.exp(), active)


def frames() -> Tensor:
    return torch.randn(N, D, generator=torch.Generator().manual_seed(1))


def densities(found: Mixture, x: Tensor) -> NDArray[np.float64]:
    """Of each channel under each component, eq. 9."""
    means, variances = found.means.double().numpy(), found.variances.double().numpy()
    return np.asarray(norm.pdf(x.double().numpy()[:, None], means, np.sqrt(variances)))


def test_the_likelihood_is_equation_8() -> None:
    found, x = mixture(), frames()
    weights, p = found.log_weights.double().exp().numpy(), found.active.double().sigmoid().numpy()
    flags = np.array([1, 0, 1, 1, 0, 1.0])
    joint = (weights * densities(found, x).prod(axis=2)).sum(axis=1)
    expected = np.where(flags, np.log(joint * p), np.log(1 - p))
    np.testing.assert_allclose(found.log_likelihood(x, torch.tensor(flags)), expected, rtol=1e-5)


def test_the_surrogate_is_equation_12() -> None:
    found, x = mixture(), frames()
    weights, p = found.log_weights.double().exp().numpy(), found.active.double().sigmoid().numpy()
    flags = np.array([1, 0, 1, 1, 0, 1.0])
    inner = (weights * np.log(densities(found, x) + 1e-8).sum(axis=2)).sum(axis=1)
    expected = np.where(flags, -inner, 0) - flags * np.log(p) - (1 - flags) * np.log(1 - p)
    np.testing.assert_allclose(found.surrogate_loss(x, torch.tensor(flags)), expected, rtol=1e-5)


def test_the_surrogate_bounds_the_likelihood() -> None:
    found, x = mixture(), frames()
    assert (found.surrogate(x) <= found.log_density(x) + 1e-5).all()  # Jensen


@pytest.mark.parametrize("distance", [0.0, 1e2, 1e4])
def test_losses_and_gradients_are_finite_where_products_are_not(distance: float) -> None:
    torch.manual_seed(0)
    head = MixtureHead(5, D, K, 1e-4, 0.0)
    outputs = 50 * torch.randn(N, 5)
    x = (frames() + distance).requires_grad_()
    for loss in (Mixture.surrogate_loss, lambda *given: -Mixture.log_likelihood(*given)):
        value = loss(head(outputs), x, torch.ones(N)).sum()
        head.zero_grad()
        value.backward()
        assert torch.isfinite(value)
        assert all(torch.isfinite(p.grad).all() for p in head.parameters() if p.grad is not None)


def test_flags_far_from_the_boundary_keep_their_logarithm() -> None:
    found = Mixture(torch.zeros(2, 1), torch.zeros(2, 1, 1), torch.ones(2, 1, 1), torch.tensor([200.0, -200.0]))
    assert found.log_flag(torch.tensor([0.0, 1.0])).tolist() == [-200.0, -200.0]
    assert found.log_flag(torch.tensor([1.0, 0.0])).tolist() == [0.0, 0.0]


def test_the_head_has_the_papers_sizes() -> None:
    torch.manual_seed(0)
    head = MixtureHead(1200, 44, 20, 1e-4, 0.1).eval()
    assert sum(p.numel() for p in head.parameters()) == 1781 * 1201
    found = head(torch.randn(7, 1200))
    assert found.log_weights.shape == (7, 20)
    assert found.means.shape == found.variances.shape == (7, 20, 44)
    assert found.active.shape == (7,)
    assert found.variances.min() >= 1e-4
    torch.testing.assert_close(found.log_weights.exp().sum(-1), torch.ones(7))
