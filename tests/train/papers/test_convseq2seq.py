"""The convolutional sequence-to-sequence predictor: sizes, naive twins, and what its switches do."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from motet_train.data.errors import DataError
from motet_train.descent import Training
from motet_train.papers.li2018.convseq2seq import LEAKY_SLOPE, Config, Convolution, ConvSeq2Seq, Discriminator
from motet_train.papers.li2018.recipe import Adversary
from motet_train.papers.li2018.stepwise import Stepwise, free_run

Array = NDArray[Any]
SMALL = Config(45, filters=(3, 4, 5), units=8)


def count(module: torch.nn.Module) -> int:
    return sum(parameter.numel() for parameter in module.parameters())


def small(**changes: Any) -> ConvSeq2Seq:
    torch.manual_seed(0)
    return ConvSeq2Seq(replace(SMALL, **changes)).eval()


def test_sizes_are_those_of_the_paper() -> None:
    net = ConvSeq2Seq(Config(70))
    assert net.long_term.linear.in_features == 6 * 4 * 128  # type: ignore[union-attr]
    assert net.short_term.linear.in_features == 2 * 4 * 128
    assert count(net) == 3_348_806  # "about 3.37 M"
    human = ConvSeq2Seq(Config(54, padding="same"))
    assert count(human) == 5_830_966  # "about 5.93 M"


def naive_convolution(image: Array, weight: Array, same: bool) -> Array:
    """(inputs, T, D) to (outputs, T', D'), place by place; same: as TensorFlow defines it."""
    height, width = weight.shape[2:]
    if same:
        borders = []
        for length, size in zip(image.shape[1:], (height, width), strict=True):
            total = max(0, (int(np.ceil(length / 2)) - 1) * 2 + size - length)
            borders.append((total // 2, total - total // 2))
        image = np.pad(image, [(0, 0), *borders])
    tops, lefts = (range(0, n - k + 1, 2) for n, k in zip(image.shape[1:], (height, width), strict=True))
    out = np.array(
        [[[(image[:, t : t + height, d : d + width] * kernel).sum() for d in lefts] for t in tops] for kernel in weight]
    )
    return np.where(out > 0, out, LEAKY_SLOPE * out)


@pytest.mark.parametrize("padding", ["valid", "same"])
@pytest.mark.parametrize("kernel", [(2, 7), (4, 4), (7, 2)])
def test_convolution_is_the_naive_one(kernel: tuple[int, int], padding: Any) -> None:
    torch.manual_seed(0)
    layer, image = Convolution(2, 3, kernel, padding), torch.randn(1, 2, 13, 16)
    found = layer(image)[0].detach().numpy()
    np.testing.assert_allclose(
        found, naive_convolution(image[0].numpy(), layer.weight.detach().numpy(), padding == "same"), atol=1e-5
    )


def test_a_frame_is_the_last_one_plus_what_the_decoder_says_of_both_contexts() -> None:
    net, seed = small(), torch.randn(3, 50, 45)
    state = net.begin(seed)
    torch.testing.assert_close(state["window"], seed[:, 30:])
    torch.testing.assert_close(state["long_term"], net.long_term(seed[:, :49]))  # type: ignore[misc]
    both = torch.cat([state["long_term"], net.short_term(seed[:, 30:])], dim=1)
    torch.testing.assert_close(net.predict(state)[0], seed[:, -1] + net.decoder(both))
    frame = torch.randn(3, 45)
    torch.testing.assert_close(net.push(state, frame)["window"], torch.cat([seed[:, 31:], frame[:, None]], dim=1))


def test_a_free_run_feeds_back_its_frames_mixed_with_true_ones() -> None:
    net, windows, own = small(predicted_share=0.7), torch.randn(2, 55, 45), 0.7
    seen, truth, state = windows[:, :50], windows[:, 50:], net.begin(windows[:, :50])
    expected = []
    for n in range(5):
        expected.append(net.predict({**state, "window": seen[:, -20:]})[0])
        mixed = own * expected[-1] + (1 - own) * truth[:, n]
        seen = torch.cat([seen, mixed[:, None]], dim=1)
    torch.testing.assert_close(net.imagine(windows, 50), torch.stack(expected, dim=1))
    torch.testing.assert_close(net.loss(windows, 50), (torch.stack(expected, dim=1) - truth).square().mean())


def test_the_loss_can_be_the_mean_distance_of_frames() -> None:
    net, windows = small(loss="distance"), torch.randn(2, 55, 45)
    apart = (net.imagine(windows, 50) - windows[:, 50:]).detach().numpy()
    distances = [[np.sqrt((frame**2).sum() / 45) for frame in row] for row in apart]
    assert net.loss(windows, 50).item() == pytest.approx(np.mean(distances), rel=1e-5)
    exact = torch.zeros(1, 5, 45, requires_grad=True)
    net.error(exact, torch.zeros(1, 5, 45)).backward()  # type: ignore[no-untyped-call]
    assert torch.isfinite(exact.grad).all()


@pytest.mark.parametrize(
    "changes",
    [
        {"long_term": "none"},
        {"long_term": "recurrent"},
        {"kernel": (4, 4), "padding": "same"},
        {"kernel": (7, 2), "padding": "same"},
        {"window": 5, "padding": "same"},
        {"window": 10, "padding": "same"},
    ],
)
def test_every_ablation_sees_what_it_should(changes: dict[str, Any]) -> None:
    net, seed = small(**changes), torch.randn(2, 50, 45)
    window = changes.get("window", 20)
    early, inside = seed.clone(), seed.clone()
    early[:, :25] += 1
    inside[:, 50 - window] += 1
    before = free_run(net, seed, 3)
    assert torch.equal(free_run(net, early, 3), before) == (changes.get("long_term") == "none")
    assert not torch.equal(free_run(net, inside, 1), before[:, :1])


def test_windows_without_padding_must_be_long_enough() -> None:
    with pytest.raises(DataError, match=r"5 frames of 45 channels are too few .* use padding 'same'"):
        small(window=5)


def test_the_adversary_is_taught_first_and_then_heard() -> None:
    torch.manual_seed(0)
    net = Stepwise(small(dropout=(0.0, 0.0, 0.0), decoder_dropout=0.0), 45, range(45), 50)
    judge = Discriminator(replace(SMALL, dropout=(0.0, 0.0, 0.0)), 75)
    adversary, windows = Adversary(net, judge, Training(steps=1, adversary=0.01)), torch.randn(4, 75, 45)
    predicted = net.system.imagine(windows, 50)
    false = torch.cat([windows[:, :50], predicted], dim=1)

    def doubt() -> float:
        return float(-torch.cat([judge(windows), -judge(false)]).sigmoid().log().mean().detach())

    before, squared = doubt(), float((predicted - windows[:, 50:]).square().mean().detach())
    (term,) = adversary.loss(windows)
    assert doubt() < before
    opinion = float(-judge(false).sigmoid().log().mean().detach())
    np.testing.assert_allclose(term.losses.detach(), squared + 0.01 * opinion, rtol=1e-5)
    judge.zero_grad()
    term.losses.backward()  # type: ignore[no-untyped-call]
    assert all(parameter.grad is None for parameter in judge.parameters())
