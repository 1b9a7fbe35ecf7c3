"""Both directions between motion and language: sizes, losses, and the three graphs of each."""

from dataclasses import replace
from itertools import pairwise

import pytest
import torch
from torch import Tensor
from trainings import rebuilt

from motet_train.data.batches import Batch
from motet_train.models.motion_to_language import EOS, PAD, SOS, MotionToLanguage, MotionToLanguageConfig
from motet_train.papers.plappert2017.language_to_motion import LanguageToMotion, LanguageToMotionConfig

D, V = 3, 11
DESCRIBE = MotionToLanguageConfig(D, V, encoder_units=(4, 5), decoder_units=(6, 7), embedding=4)
ATTENTIVE = replace(DESCRIBE, attention=True)
GENERATE = LanguageToMotionConfig(D, V, encoder_units=(4, 5), decoder_units=(6, 7), embedding=4, components=2)


def describer(config: MotionToLanguageConfig = DESCRIBE) -> MotionToLanguage:
    torch.manual_seed(0)
    return normalised(MotionToLanguage(config))


def generator(config: LanguageToMotionConfig = GENERATE) -> LanguageToMotion:
    torch.manual_seed(0)
    return normalised(LanguageToMotion(config))


def normalised(net: torch.nn.Module) -> torch.nn.Module:
    net.mean.copy_(torch.tensor([1.0, 2.0, 3.0]))
    net.scale.copy_(torch.tensor([1.0, 0.5, 2.0]))
    return net


def batch() -> Batch:
    frames = torch.randn(3, 7, D, generator=torch.Generator().manual_seed(1)) + 2
    words = torch.tensor([[5, 4, 3, 10], [6, PAD, PAD, PAD], [7, 7, 8, PAD]])
    return Batch(frames, torch.tensor([7, 2, 5]), words)


def alone(rows: Batch, row: int) -> Batch:
    words = rows.words[row : row + 1, : int((rows.words[row] != PAD).sum())]
    return Batch(rows.frames[row : row + 1, : int(rows.lengths[row])], rows.lengths[row : row + 1], words)


def parameters(net: torch.nn.Module) -> dict[str, int]:
    return {name: sum(p.numel() for p in part.parameters()) for name, part in net.named_children()}


def test_parameters_are_exactly_those_of_the_paper() -> None:
    with torch.device("meta"):
        describe = MotionToLanguage(MotionToLanguageConfig(channels=44, words=1344))
        generate = LanguageToMotion(LanguageToMotionConfig(channels=44, words=1344))
    counts = parameters(describe)
    assert counts == {"encoder": 116_352, "embedding": 86_016, "decoder": 295_680, "output": 345_408}
    assert sum(counts.values()) == 843_456
    counts = parameters(generate)
    assert counts["head"] == 2_138_981
    assert counts["encoder"] + counts["decoder"] == 123_648 + 3_080_400 + 17_472
    assert sum(counts.values()) == 5_446_517
    assert [layer.weight.shape[1] for layer in generate.decoder.layers] == [218, 573, 573]


@pytest.mark.parametrize("net", [describer(), describer(ATTENTIVE), generator()])
def test_a_row_of_a_batch_loses_what_it_loses_alone(net: MotionToLanguage | LanguageToMotion) -> None:
    rows = batch()
    found = net.eval().terms(rows)[0]
    single = torch.cat([net.terms(alone(rows, row))[0] for row in range(3)])
    torch.testing.assert_close(found, single, atol=1e-5, rtol=1e-5)


def test_the_encoder_sees_the_way_so_far(monkeypatch: pytest.MonkeyPatch) -> None:
    net, rows = describer(replace(DESCRIBE, travelled=2)).eval(), batch()
    seen: list[Tensor] = []
    monkeypatch.setattr(net.encoder, "forward", lambda frames, lengths: seen.append(frames))
    net.encode(rows.frames, rows.lengths)
    normal = (rows.frames - net.mean) / net.scale
    torch.testing.assert_close(seen[0][..., :D], normal)
    for t in range(7):
        torch.testing.assert_close(seen[0][:, t, D : D + 2], normal[:, : t + 1, :2].sum(dim=1) / 10)
    assert (seen[0][..., D + 2 :] == 1).all()


@pytest.mark.parametrize("attention", [False, True])
def test_the_loss_of_words_is_the_cross_entropy_of_steps(attention: bool) -> None:
    net, rows = describer(replace(DESCRIBE, attention=attention)).eval(), batch()
    encoder, step = (net.graphs()[role][0] for role in ("encoder", "step"))
    if attention:
        known = [*encoder(rows.frames, rows.lengths), rows.lengths]
    else:
        known = [net.encode(rows.frames, rows.lengths)]
    sentences = [[SOS, *row[row != PAD].tolist(), EOS] for row in rows.words]
    expected = []
    for i, sentence in enumerate(sentences):
        state = torch.zeros(1, 13)
        of_row = [part[i : i + 1] for part in known]
        for word, following in pairwise(sentence):
            log_probabilities, state = step(torch.tensor([word]), *of_row, state)
            assert log_probabilities.exp().sum().item() == pytest.approx(1, abs=1e-5)
            expected.append(-log_probabilities[0, following])
    torch.testing.assert_close(net.terms(rows)[0], torch.stack(expected), atol=1e-5, rtol=1e-5)


@torch.no_grad()
def test_attention_is_the_softmax_of_products_over_the_states_of_a_row() -> None:
    net, rows = describer(ATTENTIVE).eval(), batch()
    _, states = net.encode_states(rows.frames, rows.lengths)
    queries = torch.randn(3, 4, 13, generator=torch.Generator().manual_seed(2))
    weights = net.attention.weights(queries, states, rows.lengths)
    attended = net.attention(queries, states, rows.lengths)
    for row, length in enumerate(rows.lengths.tolist()):
        for step in range(4):
            # frame by frame, of the row's own frames alone
            scores = [float(queries[row, step] @ net.attention.weight @ states[row, t]) for t in range(length)]
            shares = torch.tensor(scores).div(10**0.5).softmax(dim=0)
            torch.testing.assert_close(weights[row, step, :length], shares, atol=1e-6, rtol=1e-5)
            assert (weights[row, step, length:] == 0).all()
            wanted = sum(share * states[row, t] for t, share in enumerate(shares))
            torch.testing.assert_close(attended[row, step], wanted, atol=1e-6, rtol=1e-5)


def test_states_are_those_of_a_row_alone_and_end_with_it() -> None:
    net, rows = describer(ATTENTIVE).eval(), batch()
    context, states = net.encode_states(rows.frames, rows.lengths)
    assert torch.equal(context, net.encode(rows.frames, rows.lengths))
    for row, length in enumerate(rows.lengths.tolist()):
        single = alone(rows, row)
        torch.testing.assert_close(states[row, :length], net.encode_states(single.frames, single.lengths)[1][0])
        assert (states[row, length:] == 0).all()
        # forwards the last state is the context's, backwards the first one
        ends = torch.cat([states[row, length - 1, :5], states[row, 0, 5:]])
        torch.testing.assert_close(ends, context[row])


def test_the_likelihood_of_frames_is_that_of_steps() -> None:
    net, rows = generator().eval(), batch()
    step = net.graphs()["step"][0]
    context = net.encode(rows.words, (rows.words != PAD).sum(1))
    expected = []
    for i, length in enumerate(rows.lengths.tolist()):
        state, frame = torch.zeros(1, 13), torch.ones(1, D + 1)
        normal = torch.cat([(rows.frames[i, :length] - net.mean) / net.scale, torch.ones(length, 1)], dim=1)
        sequence = torch.cat([normal, torch.zeros(1, D + 1)])
        for target in sequence:
            log_weights, means, stds, active, state = step(frame, context[i : i + 1], state)
            density = torch.distributions.Normal(means[0], stds[0]).log_prob(target[:-1]).sum(-1)
            density = torch.logsumexp(log_weights[0] + density, 0) + active[0].log()
            expected.append(density if target[-1] else (1 - active[0]).log())
            frame = target[None]
    true = generator(replace(GENERATE, loss="likelihood")).eval()
    torch.testing.assert_close(true.terms(rows)[0], -torch.stack(expected), atol=1e-4, rtol=1e-5)


@pytest.mark.parametrize(
    "net", [describer(), describer(ATTENTIVE), generator(), generator(replace(GENERATE, loss="likelihood"))]
)
def test_a_few_steps_lower_the_loss(net: MotionToLanguage | LanguageToMotion) -> None:
    rows = batch()
    optimiser = torch.optim.NAdam(net.parameters(), lr=1e-2)
    losses: list[Tensor] = []
    for _ in range(12):
        losses.append(net.eval().terms(rows)[0].mean().detach())
        net.train().zero_grad()
        net.terms(rows)[0].mean().backward()
        assert all(p.grad is not None and torch.isfinite(p.grad).all() for p in net.parameters())
        optimiser.step()
    assert losses[-1] < losses[0] - 0.05


def test_training_drops_and_running_does_not() -> None:
    for net in (describer(), describer(ATTENTIVE), generator()):
        assert not torch.equal(net.terms(batch())[0], net.terms(batch())[0])
        net.eval()
        assert torch.equal(net.terms(batch())[0], net.terms(batch())[0])


@pytest.mark.parametrize(
    ("name", "net"),
    [
        ("motion-to-language", describer(replace(DESCRIBE, gates="hard"))),
        ("motion-to-language", describer(ATTENTIVE)),
        ("language-to-motion", generator(replace(GENERATE, loss="likelihood"))),
    ],
)
def test_a_net_is_rebuilt_from_its_configuration(name: str, net: MotionToLanguage | LanguageToMotion) -> None:
    again = rebuilt(name, net)
    assert again.config == net.config
    assert torch.equal(again.terms(batch())[0], net.eval().terms(batch())[0])
