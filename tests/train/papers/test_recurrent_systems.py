"""The recurrent systems against numpy twins of their equations, and their training on motions small enough to learn."""

import gc
import weakref
from collections.abc import Iterator

import numpy as np
import pytest
import torch
from torch import Tensor, nn
from twins import Array, array, linear, squash

from motet_train.papers.li2018.recurrent import (
    LSTMAE,
    RRNN,
    EncoderRecurrentDecoder,
    LSTM3LRConfig,
    LSTMAEConfig,
    Reused,
    RRNNConfig,
    one_gradient,
)
from motet_train.papers.li2018.stepwise import System, free_run, noise_at

D, SEED = 5, 6


def made(kind: str) -> System:
    torch.manual_seed(0)
    small = {"encoder": (7,), "layers": 3, "units": 6}
    erd = {"encoder": (7, 6), "layers": 2, "units": 8, "decoder": (7, 4), "rectified": True}
    return {
        "rrnn": lambda: RRNN(RRNNConfig(D, 9)),
        "erd": lambda: EncoderRecurrentDecoder(LSTM3LRConfig(D, **erd)),
        "lstm_3lr": lambda: EncoderRecurrentDecoder(LSTM3LRConfig(D, **small)),
        "lstm_ae": lambda: LSTMAE(LSTMAEConfig(D, **small, autoencoder=(9, 4, 9))),
    }[kind]().eval()


KINDS = pytest.mark.parametrize("kind", ["rrnn", "erd", "lstm_3lr", "lstm_ae"])


def windows(rows: int = 4, frames: int = 12) -> Tensor:
    """Sines of all channels, each row at its own time."""
    time = torch.arange(frames) + 2.0 * torch.arange(rows)[:, None]
    return torch.sin(0.4 * time[..., None] + torch.arange(D))


def linears(module: nn.Module) -> list[nn.Linear]:
    return [part for part in module.modules() if isinstance(part, nn.Linear)]


def test_rrnn_is_the_gru_of_cho_with_a_residual_link() -> None:
    net, frames = made("rrnn"), array(windows(1))[0]
    w, b, u, v = (array(x) for x in (net.inward.weight, net.bias, net.gates.weight, net.candidate.weight))
    hidden, last, found = np.zeros(9), None, []
    for n in range(SEED + 3):
        last = frames[n] if n < SEED else found[-1]
        z, r = np.split(squash(last @ w[:, :18] + b[:18] + hidden @ u), 2)
        hidden = z * hidden + (1 - z) * np.tanh(last @ w[:, 18:] + b[18:] + (r * hidden) @ v)
        if n >= SEED - 1:
            found.append(last + linear(net.outward, hidden))
    expected = array(free_run(net, windows(1)[:, :SEED], 4))[0]
    np.testing.assert_allclose(expected, found, atol=1e-6)


@pytest.mark.parametrize("kind", ["erd", "lstm_3lr", "lstm_ae"])
def test_the_others_are_lstms_between_layers_of_frames(kind: str) -> None:
    net, frames = made(kind), array(windows(1))[0]
    rectify = (lambda x: np.maximum(x, 0)) if kind == "erd" else (lambda x: x)
    states = [(np.zeros(n), np.zeros(n)) for n in [6 + 2 * (kind == "erd")] * len(net.recurrent)]
    found: list[Array] = []
    for n in range(SEED + 3):
        x = frames[n] if n < SEED else found[-1]
        for layer in linears(net.encoder):
            x = rectify(linear(layer, x))
        for k, lstm in enumerate(net.recurrent):
            gates = linear(lstm.inward, x) + states[k][0] @ array(lstm.recurrence.weight)
            i, f, o, g = np.split(gates, 4)
            cell = squash(f) * states[k][1] + squash(i) * np.tanh(g)
            x = squash(o) * np.tanh(cell)
            states[k] = x, cell
        if n >= SEED - 1:
            found.append(shown(net, x, rectify))
    np.testing.assert_allclose(array(free_run(net, windows(1)[:, :SEED], 4))[0], found, atol=1e-6)


def shown(net: EncoderRecurrentDecoder, x: Array, rectify: object) -> Array:
    assert callable(rectify)
    *before, outward = linears(net.decoder)
    for layer in before:
        x = rectify(linear(layer, x))
    frame = linear(outward, x)
    if isinstance(net, LSTMAE):
        *before, outward = linears(net.filter)
        for layer in before:
            frame = np.maximum(linear(layer, frame), 0)
        frame = linear(outward, frame)
    return np.asarray(frame)


@KINDS
def test_beginning_is_pushing_frame_after_frame(kind: str) -> None:
    net, seed = made(kind), windows()[:, :SEED]
    state = net.begin(seed[:, :1])
    for n in range(1, SEED):
        state = {**state, **net.push(state, seed[:, n])}
    expected = net.begin(seed)
    assert {name: tuple(value.shape[1:]) for name, value in expected.items()} == net.carried
    for name, value in expected.items():
        torch.testing.assert_close(state[name], value)


@pytest.mark.parametrize("kind", ["erd", "lstm_3lr"])
def test_training_sees_the_true_frames_one_by_one(kind: str) -> None:
    net, true = made(kind), windows()
    expected = [net.predict(net.begin(true[:, :n]))[0] for n in range(1, 12)]
    torch.testing.assert_close(net.follow(true[:, :-1])[0], torch.stack(expected, dim=1))
    torch.testing.assert_close(net.loss(true, SEED), (torch.stack(expected, dim=1) - true[:, 1:]).square().mean())


def test_rrnn_trains_on_its_own_samples() -> None:
    net, true = made("rrnn"), windows()
    off = free_run(net, true[:, :SEED], 6) - true[:, SEED:]
    torch.testing.assert_close(net.loss(true, SEED), off.square().mean())


def test_noise_grows_and_is_for_training_only() -> None:
    net, true = made("lstm_3lr"), windows()
    clean = net.loss(true, SEED)
    for share in (0.0, 0.5, 1.0):
        net.progress(share)
        assert net.noise == noise_at(share)
    torch.testing.assert_close(net.loss(true, SEED), clean, rtol=0, atol=0)
    assert not torch.equal(net.train().loss(true, SEED), clean)


@pytest.fixture
def leak() -> Iterator[nn.ModuleDict]:
    torch.manual_seed(0)
    net = nn.ModuleDict({"once": Reused(4, 3), "again": Reused(3, 4)})
    yield net
    assert all(part.gathered is None for part in net.values())


def products(net: nn.ModuleDict, x: Tensor) -> Tensor:
    for _ in range(3):
        x = torch.tanh(net["again"](torch.tanh(net["once"](x))))
    return x.square().sum()


@pytest.mark.parametrize("half", [False, True])
def test_one_gradient_is_the_sum_of_all(leak: nn.ModuleDict, half: bool) -> None:
    x = torch.randn(6, 4, requires_grad=True)
    weights = [x, *leak.parameters()]
    with torch.autocast("cpu", torch.bfloat16, enabled=half):
        expected = products(leak, x)
        with one_gradient(leak):
            found = products(leak, x)
    rounding = {"rtol": 0.03, "atol": 0.03} if half else {"rtol": 1e-5, "atol": 1e-6}
    torch.testing.assert_close(found, expected, **rounding)
    pairs = zip(torch.autograd.grad(found, weights), torch.autograd.grad(expected, weights), strict=True)
    for one, other in pairs:
        assert one.dtype == torch.float32
        torch.testing.assert_close(one, other, **rounding)


def test_nothing_of_a_training_step_stays(leak: nn.ModuleDict) -> None:
    held = []
    gc.disable()  # what only the collector finds would pile up
    try:
        for through in (True, False):
            with one_gradient(leak):
                held.append(weakref.ref(leak["once"].gathered[1]))
                found = products(leak, torch.randn(6, 4))
            if through:
                found.backward()
            del found
        assert [ref() for ref in held] == [None, None]
    finally:
        gc.enable()


def test_one_gradient_ends_where_an_error_leaves_it(leak: nn.ModuleDict) -> None:
    with pytest.raises(RuntimeError), one_gradient(leak):
        leak["once"](torch.ones(2, 5))


@KINDS
@pytest.mark.parametrize("half", [False, True])
def test_training_learns(kind: str, half: bool) -> None:
    net, true = made(kind).train(), windows()
    optimiser = torch.optim.Adam(net.parameters(), 0.01)
    losses = []
    for _ in range(60):
        with torch.autocast("cpu", torch.bfloat16, enabled=half):
            loss = net.loss(true, SEED)
        assert loss.dtype == torch.float32
        optimiser.zero_grad()
        loss.backward()
        assert all(parameter.grad is not None for parameter in net.parameters())
        optimiser.step()
        losses.append(loss.item())
    assert np.mean(losses[-5:]) < 0.6 * losses[0]


def test_the_autoencoder_filters() -> None:
    """Frames of one sine's phases lie on a plane; noise off it is what the filter takes away."""
    torch.manual_seed(0)
    net = LSTMAE(LSTMAEConfig(20, encoder=(4,), layers=1, units=4, autoencoder=(40, 8, 40)))
    optimiser = torch.optim.Adam(net.filter.parameters(), 0.01)
    frames = torch.sin(torch.rand(500, 1) * 6.283 + torch.arange(20))
    for _ in range(200):
        loss = (net.restored(frames) - frames).square().mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
    noise = 0.5 * torch.randn_like(frames)
    left = net.eval().restored(frames + noise) - frames
    assert left.square().mean() < 0.5 * noise.square().mean()


def test_each_part_of_lstm_ae_has_its_own_loss() -> None:
    net, true = made("lstm_ae"), windows()
    apart = EncoderRecurrentDecoder.loss(net, true, SEED) + (net.restored(true) - true).square().mean()
    torch.testing.assert_close(net.loss(true, SEED), apart)
    with torch.no_grad():
        for parameter in net.filter.parameters():
            parameter.mul_(3.0)
    others = [parameter for name, parameter in net.named_parameters() if not name.startswith("filter")]
    scaled = torch.autograd.grad(net.loss(true, SEED), others)
    alone = torch.autograd.grad(EncoderRecurrentDecoder.loss(net, true, SEED), others)
    assert all(torch.equal(one, other) for one, other in zip(scaled, alone, strict=True))
