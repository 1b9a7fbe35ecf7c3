"""The recurrent layers against a plain numpy twin, one row and one step at a time."""

import numpy as np
import pytest
import torch
from twins import Array, array, squash

from motet_train.models.recurrent import GRU, Decoder, Encoder, WordEmbedding, mask
from motet_train.papers.plappert2017.language_to_motion import LayerNormGRU

LAYERS = pytest.mark.parametrize("layer", [GRU, LayerNormGRU])


def opened(x: Array, gates: str) -> Array:
    return np.clip(0.2 * x + 0.5, 0, 1) if gates == "hard" else squash(x)


def norm(module: torch.nn.Module, x: Array, direction: int) -> Array:
    normal = (x - x.mean()) / np.sqrt(x.var() + 1e-5)
    return normal * array(module.gain)[direction, 0] + array(module.bias)[direction, 0]


def twin(layer: GRU, x: Array, direction: int) -> Array:
    """States (T, N) of one direction for one row (T, I)."""
    w, b = array(layer.weight)[direction], array(layer.bias)[direction, 0]
    u, uh = array(layer.gate_recurrence)[direction], array(layer.candidate_recurrence)[direction]
    n, h, states = layer.units, np.zeros(layer.units), []
    for frame in x:
        both, candidate = np.split(frame @ w + b, [2 * n])
        if isinstance(layer, LayerNormGRU):
            both = norm(layer.input_gate_norm, both, direction) + norm(layer.gate_norm, h @ u, direction)
            z, r = np.split(opened(both, layer.gates), 2)
            candidate = norm(layer.input_candidate_norm, candidate, direction)
            candidate = np.tanh(candidate + r * norm(layer.candidate_norm, h @ uh, direction))
        else:
            z, r = np.split(opened(both + h @ u, layer.gates), 2)
            candidate = np.tanh(candidate + (r * h) @ uh)
        h = z * h + (1 - z) * candidate
        states.append(h)
    return np.array(states)


def made(layer: type[GRU], inputs: int, units: int, directions: int, gates: str = "sigmoid") -> GRU:
    torch.manual_seed(0)
    net = layer(inputs, units, directions, gates, 0.0)
    for parameter in net.parameters():  # gains and biases start as ones and zeros
        parameter.data += 0.1 * torch.randn_like(parameter)
    return net


@LAYERS
@pytest.mark.parametrize("gates", ["sigmoid", "hard"])
def test_a_layer_computes_what_its_twin_does(layer: type[GRU], gates: str) -> None:
    net = made(layer, 3, 4, 2, gates)
    x = torch.randn(2, 6, 5, 3)
    states = array(net(x))
    for direction in range(2):
        for row in range(5):
            expected = twin(net, array(x[direction, :, row]), direction)
            np.testing.assert_allclose(states[direction, :, row], expected, atol=1e-5)


@LAYERS
def test_parameters_are_those_of_one_bias(layer: type[GRU]) -> None:
    count = sum(p.numel() for p in layer(45, 64, 2, "sigmoid", 0.0).parameters())
    assert count == 2 * (3 * 64 * (45 + 64 + 1) + (12 * 64 if layer is LayerNormGRU else 0))


@LAYERS
def test_an_encoder_gives_forward_and_backward_ends_of_each_row(layer: type[GRU]) -> None:
    torch.manual_seed(1)
    net = Encoder(layer, 3, (4, 5), "sigmoid", 0.0)
    x, lengths = torch.randn(3, 7, 3), torch.tensor([7, 1, 4])
    contexts = array(net(x, lengths))
    assert contexts.shape == (3, 10)
    for row, length, context in zip(x, lengths, contexts, strict=True):
        below = array(row[:length])
        for stacked in net.layers:
            forward, backward = twin(stacked, below, 0), twin(stacked, below[::-1], 1)
            below = np.concatenate([forward, backward[::-1]], axis=1)
        np.testing.assert_allclose(context, np.concatenate([forward[-1], backward[-1]]), atol=1e-5)


@LAYERS
@pytest.mark.parametrize("twice", [False, True])
def test_a_decoder_steps_as_it_runs(layer: type[GRU], twice: bool) -> None:
    net = Decoder(layer, 3, 5, (4, 6), twice, "sigmoid", 0.0)
    sizes = [first.weight.shape[1] for first in net.layers]
    assert sizes == [3 * twice + 5 + 3, 4 + 5 + 3]
    tokens, context, state = torch.randn(2, 8, 3), torch.randn(2, 5), torch.zeros(2, 10)
    outputs = net(tokens, context)
    for t in range(8):
        state = net.step(tokens[:, t], context, state)
        torch.testing.assert_close(outputs[:, t], state, atol=1e-6, rtol=1e-5)


def test_layers_see_below_context_and_token_in_this_order() -> None:
    net = Decoder(GRU, 3, 5, (4, 6), True, "sigmoid", 0.0)
    below, context, token = [torch.full((1, 4), 1.0)], torch.full((1, 5), 2.0), torch.full((1, 3), 3.0)
    assert net._inputs(below, context, token).tolist() == [[1] * 4 + [2] * 5 + [3] * 3]
    assert net._inputs([], context, token).tolist() == [[3] * 3 + [2] * 5 + [3] * 3]


@LAYERS
def test_weights_start_as_published(layer: type[GRU]) -> None:
    torch.manual_seed(0)
    net = layer(30, 20, 2, "sigmoid", 0.0)
    eye = 1.21 * torch.eye(20)
    for direction in range(2):
        for gate in (*net.gate_recurrence[direction].split(20, dim=-1), net.candidate_recurrence[direction]):
            torch.testing.assert_close(gate @ gate.T, eye, atol=1e-5, rtol=0)
        for gate in net.weight[direction].split(20, dim=-1):
            bound = (6 / (30 + 20)) ** 0.5
            assert 0.9 * bound < gate.abs().max() <= bound
    assert not net.bias.any()


@LAYERS
def test_dropout_keeps_one_mask_for_a_whole_sequence(layer: type[GRU]) -> None:
    torch.manual_seed(0)
    net = layer(50, 4, 1, "sigmoid", 0.5)
    for weight in (net.gate_recurrence, net.candidate_recurrence):
        weight.data.zero_()
    net.weight.data[..., :8] = 0  # gates of 1/2: the state nears the candidate by half at each step
    x = torch.ones(1, 6, 30, 50)
    states = net(x)[0]
    halves = 1 - 0.5 ** torch.arange(1, 7.0)
    torch.testing.assert_close(states, 2 * states[:1] * halves[:, None, None], atol=1e-5, rtol=1e-4)
    assert len(states[0].unique(dim=0)) == 30
    assert len(net.eval()(x)[0, 0].unique(dim=0)) == 1


def test_dropout_of_the_state_acts_where_it_recurs() -> None:
    torch.manual_seed(0)
    net = GRU(3, 8, 1, "sigmoid", 0.5)
    keep = (torch.rand(1, 5, 8) < 0.5) * 2.0
    state, gates, candidate = torch.randn(1, 5, 8), torch.randn(1, 5, 16), torch.randn(1, 5, 8)
    found = net.cell(state, gates, candidate, keep)
    z, r = (gates + (state * keep) @ net.gate_recurrence).sigmoid().chunk(2, -1)
    expected = z * state + (1 - z) * torch.tanh(candidate + (r * state * keep) @ net.candidate_recurrence)
    torch.testing.assert_close(found, expected)


def test_embedding_drops_word_types() -> None:
    torch.manual_seed(0)
    net = WordEmbedding(50, 4, 0.4)
    assert 0.045 < net.weight.abs().max() <= 0.05
    words = torch.arange(50).repeat(2)[None].repeat(20, 1)
    vectors = net(words)
    dropped = (vectors == 0).all(dim=-1)
    assert torch.equal(dropped[:, :50], dropped[:, 50:])
    assert 0.3 < dropped.float().mean() < 0.5
    assert not torch.equal(dropped[0], dropped[1])
    torch.testing.assert_close(vectors[~dropped], (net.weight[words] / 0.6)[~dropped])
    assert torch.equal(net.eval()(words), net.weight[words])
    assert mask(net, 0.4, vectors, 3) is None
