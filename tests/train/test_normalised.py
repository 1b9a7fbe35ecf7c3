"""What nets see of frames: nothing of dead channels, and nothing further off than the limit."""

import numpy as np
import pytest
import torch
from test_predict_model import stirred

from motet.representation.contract import Z_LIMIT, MotionContract
from motet_train.models.motion_to_language import MotionToLanguage, MotionToLanguageConfig
from motet_train.models.net import normalised
from motet_train.models.predictor import Predictor, PredictorConfig

MEAN, STD = np.array([1.0, -20.0, 7.1]), np.array([0.5, 12.0, 0.0])
CONTRACT = MotionContract("angles", ("a.rx", "b.rx", "lfingers.rx"), ("deg",) * 3, 10.0, MEAN, STD, None)


def test_it_is_what_the_contract_says() -> None:
    frames = np.random.default_rng(0).normal(size=(4, 5, 3)) * 20
    frames[0, 0, 0], frames[1, 1, 1] = 1e6, -1e6
    found = normalised(*(torch.tensor(values) for values in (frames, MEAN, STD)))
    np.testing.assert_allclose(found.numpy(), CONTRACT.normalised(frames), atol=1e-12)
    assert (found[0, 0, 0], found[1, 1, 1]) == (Z_LIMIT, -Z_LIMIT)
    assert not found[..., 2].any()


@pytest.mark.parametrize("finger", [0.0, 8.0, 1e5])
def test_a_finger_that_never_moved_in_training_changes_no_description(finger: float) -> None:
    torch.manual_seed(0)
    sizes = {"encoder_units": (8,), "decoder_units": (8,), "embedding": 4}
    net = MotionToLanguage(MotionToLanguageConfig(channels=3, words=12, **sizes)).eval()
    net.mean.copy_(torch.tensor(MEAN))
    net.scale.copy_(torch.tensor(STD))
    frames = torch.tensor(MEAN + np.random.default_rng(1).normal(size=(1, 30, 3)) * STD).float()
    other = frames.clone()
    other[..., 2] = finger
    lengths = torch.tensor([30])
    assert torch.equal(net.encode(other, lengths), net.encode(frames, lengths))
    frames[0, 3, 0], other[0, 3, 0] = 1e4, 1e8
    assert torch.equal(net.encode(other, lengths), net.encode(frames, lengths))


def test_a_predictor_sees_no_further_either() -> None:
    net = stirred(Predictor, PredictorConfig(4, (0, 1, 2, 3)))
    frames = torch.randn(2, 10, 4)
    frames[0, 4, 1] = 2 * Z_LIMIT
    further = frames.clone()
    further[0, 4, 1] = 1e6
    assert torch.equal(net(further), net(frames))
