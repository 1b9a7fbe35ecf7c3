"""The structural RNN against a plain numpy twin, its parts against the CMU files' columns, and its training's noise."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from torch import nn
from twins import Array, array, linear, squash

from motet_train.data.errors import DataError
from motet_train.papers.li2018.expmap import CMU_LAYOUT, H36M_LAYOUT
from motet_train.papers.li2018.srnn import SRNN, Config, parts_of
from motet_train.papers.li2018.stepwise import noise_at, noisy
from motet_train.run_folder import has_bfloat16

TINY = Config(9, ((8, 0, 4), (1, 2), (5, 6), (3,), (7,)), linear=6, units=5, narrow=4)
MIRROR = [0, 5, 6, 7, 4, 1, 2, 3, 8]
RANGES = "0-5 9-13 15-19 27-31 33-37 42-59 66-68 70-72 75-77 80-80 84-86 93-95 97-99 102-104 107-107 111-113"
KEPT = [c for first, last in (span.split("-") for span in RANGES.split()) for c in range(int(first), int(last) + 1)]
"""The columns of the CMU files that vary."""


def made(config: Config = TINY) -> SRNN:
    torch.manual_seed(0)
    return SRNN(config).eval()


def cell(lstm: nn.Module, x: Array, state: Array) -> Array:
    """Hidden units and memory after one step of an LSTM (Hochreiter and Schmidhuber, with forget gates)."""
    h, c = np.split(state, 2)
    both = array(lstm.weight_ih_l0) @ x + array(lstm.bias_ih_l0) + array(lstm.weight_hh_l0) @ h + array(lstm.bias_hh_l0)
    i, f, g, o = np.split(both, 4)
    c = squash(f) * c + squash(i) * np.tanh(g)
    return np.concatenate([squash(o) * np.tanh(c), c])


def neighbours(part: int) -> list[tuple[str, list[tuple[int, int]]]]:
    """For a part, each type of spatial edge to it, and the edges of that type, spine first or its own end first."""
    arms, legs = (1, 2), (3, 4)
    if part == 0:
        return [("spine_arm", [(0, n) for n in arms]), ("spine_leg", [(0, n) for n in legs])]
    name, pair = ("arm", arms) if part in arms else ("leg", legs)
    other = pair[0] if part == pair[1] else pair[1]
    return [(f"spine_{name}", [(0, part)]), (f"{name}_{name}", [(part, other)])]


def twin(net: SRNN, now: Array, before: Array, states: dict[tuple[int, str], Array]) -> Array:
    """The next frame (D), part by part and edge by edge; changes the states of (part, type of its RNN)."""
    frame, parts, h = np.zeros(len(now)), [list(part) for part in net.config.parts], net.config.units
    for n, part in enumerate(parts):
        kind = ("spine", "arm", "arm", "leg", "leg")[n]
        given = [(kind, np.concatenate([before[part], now[part]]))]
        for name, edges in neighbours(n):
            given.append((name, sum(np.concatenate([now[parts[a]], now[parts[b]]]) for a, b in edges)))
        known = [now[part]]
        for name, features in given:
            edge = net.edges[name]
            x = linear(edge.hidden, np.maximum(linear(edge.inward, features), 0))
            states[n, name] = cell(edge.lstm, x, states[n, name])
            known.append(states[n, name][:h])
        node = net.nodes[kind]
        states[n, "node"] = cell(node.lstm, np.concatenate(known), states[n, "node"])
        x = np.maximum(linear(node.hidden[0], states[n, "node"][:h]), 0)
        frame[part] = linear(node.outward, np.maximum(linear(node.hidden[2], x), 0))
    return frame


def test_frames_are_those_of_a_twin_that_loops_over_parts_and_edges() -> None:
    net, frames = made(), torch.randn(3, 6, 9)
    found = array(net.follow(frames)[0])
    for row, truth in enumerate(array(frames)):
        names = {n: [name for name, _ in neighbours(n)] for n in range(5)}
        kinds = dict(enumerate(("spine", "arm", "arm", "leg", "leg")))
        states = {(n, name): np.zeros(10) for n in names for name in (*names[n], kinds[n], "node")}
        for t in range(6):
            expected = twin(net, truth[t], truth[max(0, t - 1)], states)
            np.testing.assert_allclose(found[row, t], expected, atol=1e-5)


def test_a_whole_sequence_is_what_pushes_of_true_frames_give() -> None:
    net, frames = made(), torch.randn(3, 8, 9)
    whole, state = net.follow(frames)[0], net.begin(frames[:, :3])
    for t in range(2, 8):
        assert {name: tuple(value.shape[1:]) for name, value in state.items()} == net.carried
        found, carried = net.predict(state)
        torch.testing.assert_close(found, whole[:, t])
        if t < 7:
            state = net.push({**state, **carried}, frames[:, t + 1])


def test_mirrored_parts_share_their_weights() -> None:
    net, frames = made(), torch.randn(2, 5, 9)
    torch.testing.assert_close(net.follow(frames[..., MIRROR])[0], net.follow(frames)[0][..., MIRROR])
    assert list(net.edges) == ["spine", "arm", "leg", "spine_arm", "spine_leg", "arm_arm", "leg_leg"]
    assert list(net.nodes) == ["spine", "arm", "leg"]


def test_the_published_net_has_the_layers_of_the_paper() -> None:
    net = SRNN(Config(70, parts_of(CMU_LAYOUT, KEPT)))
    widths = {"spine": 48, "arm": 26, "leg": 20, "spine_arm": 37, "spine_leg": 34, "arm_arm": 26, "leg_leg": 20}
    for name, edge in net.edges.items():
        assert [tuple(p.shape) for p in edge.parameters()][:5:2] == [(256, widths[name]), (256, 256), (2048, 256)]
    for name, node in net.nodes.items():
        width = widths[name] // 2
        assert tuple(node.lstm.weight_ih_l0.shape) == (2048, width + 3 * 512)
        shapes = [tuple(layer.weight.shape) for layer in (node.hidden[0], node.hidden[2], node.outward)]
        assert shapes == [(256, 512), (100, 256), (width, 100)]


def test_the_parts_cover_the_columns_of_the_cmu_files_once() -> None:
    parts = parts_of(CMU_LAYOUT, KEPT)
    assert [len(part) for part in parts] == [24, 13, 13, 10, 10]
    assert sorted(n for part in parts for n in part) == list(range(70))
    spine, *limbs = ([KEPT[n] for n in part] for part in parts)
    assert spine == [*range(6), *range(42, 60)]
    assert [(limb[0], limb[-1]) for limb in limbs] == [(66, 86), (93, 113), (9, 19), (27, 37)]
    assert [c + 27 for c in limbs[0]] == limbs[1]
    assert [c + 18 for c in limbs[2]] == limbs[3]


def test_the_parts_of_human36m_are_those_of_jain() -> None:
    """The ranges of features in the code of Jain et al. 2016: torso, left and right arm, left and right leg."""
    spine, *limbs = parts_of(H36M_LAYOUT, range(99))
    assert spine == (*range(6), *range(36, 51))
    assert limbs == [tuple(range(51, 75)), tuple(range(75, 99)), tuple(range(21, 36)), tuple(range(6, 21))]


def test_layouts_that_do_not_fit_are_refused() -> None:
    with pytest.raises(DataError, match="h36m-expmap: columns kept from 51 and from 75 on are not the same"):
        parts_of(H36M_LAYOUT, range(54))
    with pytest.raises(DataError, match="cmu-expmap does not say which columns"):
        parts_of(replace(CMU_LAYOUT, pairs=()), KEPT)
    with pytest.raises(DataError, match="from 63 and from 90 on are not the same"):
        parts_of(CMU_LAYOUT, KEPT[:-1])


def test_noise_grows_with_the_training_and_falls_on_half_of_the_frames() -> None:
    assert [noise_at(share) for share in (0, 0.06, 0.0625, 0.25, 0.5, 0.825, 1)] == [0, 0, 0.01, 0.1, 0.3, 0.7, 0.7]
    torch.manual_seed(0)
    frames = torch.ones(20, 200, 50)
    assert noisy(frames, 0.0) is frames
    noise = noisy(frames, 0.3) - 1
    noised = (noise != 0).all(dim=-1)
    assert bool((noised == (noise != 0).any(dim=-1)).all())
    assert abs(noised.float().mean() - 0.5) < 0.03
    assert abs(noise[noised].std() - 0.3) < 0.003


def test_the_loss_is_of_next_frames_and_noisy_in_training_only() -> None:
    net, windows = made(), torch.randn(2, 6, 9)
    clean = net.loss(windows, 4)
    torch.testing.assert_close(clean, (net.follow(windows)[0][:, :-1] - windows[:, 1:]).square().mean())
    net.progress(1.0)
    assert net.loss(windows, 4) == clean
    assert net.train().loss(windows, 4) != clean


@pytest.mark.skipif(not has_bfloat16("cpu"), reason="this processor has no products in bfloat16")
def test_the_loss_in_mixed_precision_is_about_the_same() -> None:
    net, windows = made().eval(), torch.randn(2, 6, 9)
    with torch.autocast("cpu", torch.bfloat16):
        mixed = net.loss(windows, 4)
    assert mixed.dtype == torch.float32
    assert abs(mixed - net.loss(windows, 4)) < 0.02


def test_training_learns_a_repeated_motion() -> None:
    net = made(replace(TINY, linear=16, units=16, narrow=16)).train()
    phase = torch.arange(20)[:, None] * 0.6 + torch.arange(9)
    windows = torch.stack([torch.sin(phase), torch.sin(phase + 1)])
    optimizer, losses = torch.optim.Adam(net.parameters(), 0.01), []
    for _ in range(80):
        losses.append(net.loss(windows, 10))
        optimizer.zero_grad()
        losses[-1].backward()
        optimizer.step()
    assert losses[-1] < 0.05 * losses[0]
