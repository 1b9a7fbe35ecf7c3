"""CRBM learning: without free units and with clamped control it is logistic regression on the past (thesis 4.1)."""

import numpy as np
import pytest
import torch
from torch.nn.functional import binary_cross_entropy_with_logits

from motet_train.papers.tdbn.rbm import CRBM, CRBMLayer, Learning, Past, transitions


def small_crbm(free: int = 0) -> CRBM:
    crbm = CRBM(visible=4, taps=2, control=3, free=free)
    generator = torch.Generator().manual_seed(0)
    for value in crbm.parameters():
        value.normal_(0, 0.3, generator=generator)
    return crbm


def sequences() -> list[list[torch.Tensor]]:
    generator = torch.Generator().manual_seed(1)
    return [
        [torch.rand(7, 4, generator=generator), torch.rand(5, 4, generator=generator)],
        [torch.rand(6, 4, generator=generator)],
    ]


def controls(expansion: torch.Tensor) -> list[list[torch.Tensor]]:
    """Those of labels: the same at all frames."""
    return [[units.expand(len(one), -1) for one in found] for units, found in zip(expansion, sequences(), strict=True)]


def test_windows_against_loops() -> None:
    expansion = torch.tensor([[1.0, 0.0, 0.0], [0.0, 1.0, 1.0]])
    data = transitions(sequences(), controls(expansion), taps=2, onsets=(1.0, 16.0))
    past, visible, control = [], [], []
    for label, found in enumerate(sequences()):
        for sequence in found:
            for t in range(2, len(sequence)):
                past.append(torch.cat([sequence[t - 2], sequence[t - 1]]))
                visible.append(sequence[t])
                control.append(expansion[label])
    for name, rows in (("past", past), ("visible", visible), ("control", control)):
        torch.testing.assert_close(getattr(data, name), torch.stack(rows), rtol=0, atol=0)
    np.testing.assert_allclose(data.probabilities[:8], 1 / 16)
    np.testing.assert_allclose(data.probabilities[8] / data.probabilities[11], 16, rtol=1e-5)


def three_groups() -> list[list[torch.Tensor]]:
    """Two motions that repeat and one that ends; each number is another."""
    lengths = [[7, 5], [6], [8]]
    numbers = iter(torch.arange(26 * 4).float().view(26, 4) / 1000)
    return [[torch.stack([next(numbers) for _ in range(n)]) for n in group] for group in lengths]


def test_gaits_are_each_others_rivals_and_a_motion_that_ends_has_none() -> None:
    frames = three_groups()
    units = [[row.expand(len(part), -1) for part in group] for row, group in zip(torch.eye(3), frames, strict=True)]
    data = transitions(frames, units, taps=2, onsets=(1.0, 1.0, 16.0))
    labels = [group for group, parts in enumerate(frames) for part in parts for _ in range(len(part) - 2)]
    assert data.repeats.tolist() == [label < 2 for label in labels]
    assert data.rival.argmax(dim=1).tolist() == [{0: 1, 1: 0, 2: 2}[label] for label in labels]
    alone = transitions(frames[1:], units[1:], taps=2, onsets=(1.0, 16.0))
    assert torch.equal(alone.rival, alone.control)


def test_windows_borrow_whole_body_parts_and_some_of_a_rivals_control() -> None:
    """Each part of a past is the window's or another's in all frames, and only gaits borrow."""
    frames = three_groups()
    units = [[row.expand(len(part), -1) for part in group] for row, group in zip(torch.eye(3), frames, strict=True)]
    data = transitions(frames, units, taps=2, onsets=(1.0, 1.0, 16.0))
    generator = torch.Generator().manual_seed(0)
    past = Past(borrowed=0.3, block=2, rival=0.4)
    layer = CRBMLayer(small_crbm(), data, Learning(1), generator, True, past)
    rows = torch.arange(len(data.past)).repeat(500)
    past, control = layer._windows(rows)
    # parts (N, K, 2, 2): taps, body parts, codes
    parts, recorded = past.view(-1, 2, 2, 2), data.past.view(-1, 2, 2, 2)
    changed = (parts != recorded[rows]).any(dim=3)
    assert not changed[~data.repeats[rows]].any()
    assert torch.equal(changed[:, 0], changed[:, 1])
    # a window seldom borrows from itself
    assert 0.26 < changed[data.repeats[rows]].float().mean() < 0.31
    for part in range(2):
        known = {tuple(window.flatten().tolist()) for window in recorded[:, :, part]}
        assert {tuple(window.flatten().tolist()) for window in parts[:, :, part]} <= known
    share = 1 - (control * data.control[rows]).sum(dim=1)
    assert share[~data.repeats[rows]].abs().max() < 1e-6
    gait = share[data.repeats[rows]]
    assert gait.min() >= 0
    assert 0.39 < gait.max() < 0.4
    assert 0.19 < gait.mean() < 0.21
    rival = (control * data.rival[rows]).sum(dim=1)[data.repeats[rows]]
    torch.testing.assert_close(rival, gait, rtol=0, atol=1e-6)


def test_nothing_is_drawn_for_what_is_not_borrowed() -> None:
    """So that recipes without it learn as before."""
    data = transitions(sequences(), controls(torch.eye(2, 3)), taps=2, onsets=(1.0, 1.0))
    generator = torch.Generator().manual_seed(0)
    layer = CRBMLayer(small_crbm(), data, Learning(1), generator, clamped=True, recall=Past())
    before = generator.get_state()
    past, control = layer._windows(torch.arange(4))
    assert torch.equal(generator.get_state(), before)
    assert torch.equal(past, data.past[:4])
    assert torch.equal(control, data.control[:4])


def test_controls_are_those_of_the_frame_that_they_drive() -> None:
    told = [[torch.arange(len(one))[:, None].float() for one in found] for found in sequences()]
    data = transitions(sequences(), told, taps=2, onsets=(1.0, 1.0))
    expected = [t for found in sequences() for one in found for t in range(2, len(one))]
    assert data.control[:, 0].tolist() == expected


def test_the_net_makes_the_end_of_its_past_itself() -> None:
    """Against loops over rows; how many frames it makes is drawn, and all numbers of them are."""
    told = [[torch.rand(len(one), 3, generator=torch.Generator().manual_seed(3)) for one in f] for f in sequences()]
    data = transitions(sequences(), told, taps=2, onsets=(1.0, 1.0), extra=2)
    windows = [(g, i, t) for g, f in enumerate(sequences()) for i, one in enumerate(f) for t in range(4, len(one))]
    crbm, generator = small_crbm(), torch.Generator().manual_seed(0)
    layer = CRBMLayer(crbm, data, Learning(1), generator, clamped=True, recall=Past(unrolled=2))
    made = set()
    for _ in range(20):
        past, control = layer._unroll(data.past, data.control, 1.0)
        first = sequences()[0][0]
        number = next(n for n in range(3) if _close(past[0], _with_own(crbm, first, told[0][0], 4, n)))
        made.add(number)
        for row, (group, item, t) in enumerate(windows):
            expected = _with_own(crbm, sequences()[group][item], told[group][item], t, number)
            torch.testing.assert_close(past[row], expected)
            torch.testing.assert_close(control[row], told[group][item][t])
            torch.testing.assert_close(data.visible[row], sequences()[group][item][t])
    assert made == {0, 1, 2}


def _with_own(crbm: CRBM, frames: torch.Tensor, told: torch.Tensor, t: int, number: int) -> torch.Tensor:
    found = list(frames[: t - number])
    for at in range(t - number, t):
        drive = torch.cat(found[-2:]) @ crbm.past_weight + told[at] @ crbm.hidden_weight + crbm.visible_bias
        found.append(torch.sigmoid(drive))
    return torch.cat(found[-2:])


def _close(one: torch.Tensor, other: torch.Tensor) -> bool:
    return bool(torch.allclose(one, other, atol=1e-5))


def test_an_update_is_the_gradient_of_the_cross_entropy() -> None:
    data = transitions(sequences(), controls(torch.eye(2, 3)), taps=2, onsets=(1.0, 1.0))
    crbm = small_crbm()
    past_weight, hidden_weight, bias = (
        p.detach().clone().requires_grad_() for p in (crbm.past_weight, crbm.hidden_weight, crbm.visible_bias)
    )
    learning = Learning(epochs=1, rate=0.1, batch=len(data.past), decay=0.0, temperature=(1.0, 1.0))
    rows = torch.multinomial(
        data.probabilities, len(data.past), replacement=True, generator=torch.Generator().manual_seed(5)
    )
    logits = bias + data.past[rows] @ past_weight + data.control[rows] @ hidden_weight
    loss = binary_cross_entropy_with_logits(logits, data.visible[rows], reduction="sum") / len(rows)
    loss.backward()  # type: ignore[no-untyped-call]
    CRBMLayer(crbm, data, learning, torch.Generator().manual_seed(5), clamped=True, recall=Past()).epoch(0)
    for learned, start in (
        (crbm.past_weight, past_weight),
        (crbm.hidden_weight, hidden_weight),
        (crbm.visible_bias, bias),
    ):
        torch.testing.assert_close(learned.detach(), start.detach() - 0.1 * start.grad, rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("free", [0, 5])
def test_clamping_free_units_and_more_steps_each_change_what_is_learned(free: int) -> None:
    data = transitions(sequences(), controls(torch.eye(2, 3)), taps=2, onsets=(1.0, 1.0))
    results = {}
    for clamped, steps in ((True, 1), (False, 1), (True, 3)):
        crbm = small_crbm(free)
        learning = Learning(epochs=20, rate=0.05, steps=steps)
        layer = CRBMLayer(crbm, data, learning, torch.Generator().manual_seed(2), clamped, Past())
        for number in range(20):
            layer.epoch(number)
        assert all(torch.isfinite(p).all() for p in crbm.parameters())
        results[clamped, steps] = crbm.hidden_weight
    assert not torch.equal(results[True, 1], results[False, 1])
    # without free units there is nothing to sample, so more Gibbs steps are the same step
    assert torch.equal(results[True, 1], results[True, 3]) == (free == 0)
