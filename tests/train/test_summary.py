from dataclasses import replace

import numpy as np
import torch

from motet_train.data.batches import Batch
from motet_train.models.motion_to_language import summary
from motet_train.papers.plappert2017.language_to_motion import LanguageToMotion, LanguageToMotionConfig

SMALL = LanguageToMotionConfig(channels=3, words=9, encoder_units=(4,), decoder_units=(5,), embedding=4, components=2)


def batch() -> Batch:
    rng = np.random.default_rng(0)
    frames = torch.tensor(rng.normal(0, 3, (4, 6, 3)), dtype=torch.float32)
    return Batch(frames, torch.tensor([6, 1, 3, 5]), torch.tensor([[4, 5], [6, 0], [7, 8], [8, 0]]))


def test_a_summary_is_mean_deviation_and_length_of_each_motion_alone() -> None:
    given = batch()
    found = summary(given.frames, given.lengths).numpy()
    for row, frames, length in zip(found, given.frames.numpy(), given.lengths.tolist(), strict=True):
        real = frames[:length].clip(-5, 5)
        np.testing.assert_allclose(row, [*real.mean(axis=0), *real.std(axis=0), np.log(length)], atol=1e-6)


def test_the_loss_asks_the_context_and_is_there_in_training_only() -> None:
    torch.manual_seed(0)
    net = LanguageToMotion(replace(SMALL, summary=2.0, dropout=0.0))
    net.eval()
    plain = net.terms(batch())[0]
    net.train()
    given = batch()
    extra = 2 * net.summary.loss(net.encode(given.words, (given.words != 0).sum(dim=1)), given.frames, given.lengths)
    np.testing.assert_allclose(net.terms(given)[0].detach(), plain.detach(), rtol=1e-5)
    found = net.terms(given)[1]
    np.testing.assert_allclose(found.detach(), extra.detach(), rtol=1e-5)
    assert net.eval().terms(given)[1] is None
    assert {name.split(".")[0] for name in LanguageToMotion(SMALL).state_dict()}.isdisjoint({"summary"})


def test_frames_are_left_out_whole_and_about_as_often_as_asked_for() -> None:
    torch.manual_seed(0)
    net = LanguageToMotion(replace(SMALL, frame_dropout=0.3)).train()
    blurred = net._blurred(torch.ones(400, 50, 3))
    assert set(blurred.unique().tolist()) == {0.0, 1.0}
    assert (blurred[..., 0] == blurred[..., 2]).all()
    shares = (blurred[..., 0] == 0).float().mean(dim=1)
    assert abs(shares.mean() - 0.3) < 0.02
    assert shares.max() > 0.5  # some sequences lose most of what is fed back, some next to nothing
    assert shares.min() < 0.1
