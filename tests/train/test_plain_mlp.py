"""The plain rival of predictors: what it sees is the same wherever a figure is, and it learns a simple motion."""

import numpy as np
import pytest
import torch

from motet.figures.humanoid.bones import HUMANOID
from motet.motion.kinematics import places_of
from motet.motion.rotations import Array, axis_to_rotmat, rotvec_to_rotmat
from motet_train.evaluate.predict import plain_mlp
from motet_train.evaluate.predict.plain_mlp import MIRRORED_JOINTS, positions_after, seen_from_last, trained, with_bones

SEED, FRAMES = 4, 3


def standing(frames: int) -> Array:
    """Positions (T, J, 3) of a figure at rest that faces z."""
    places = np.zeros((len(HUMANOID.names), 3))
    for joint, parent in enumerate(HUMANOID.parents):
        if parent >= 0:
            places[joint] = places[parent] + HUMANOID.offsets[joint]
    places[:, 1] += 0.95
    return np.repeat(places[None], frames, axis=0)


def test_windows_are_seen_from_the_last_seed_frame() -> None:
    rng = np.random.default_rng(0)
    windows = standing(SEED + FRAMES)[None] + rng.normal(size=(5, SEED + FRAMES, len(HUMANOID.names), 3)) * 0.05
    elsewhere = windows @ axis_to_rotmat("y", np.radians(130.0)).T + (3.0, 0.0, -7.0)
    first, _, _ = seen_from_last(torch.from_numpy(windows).float(), SEED)
    second, origin, turned = seen_from_last(torch.from_numpy(elsewhere).float(), SEED)
    np.testing.assert_allclose(first, second, atol=1e-5)
    across = first[:, SEED - 1, plain_mlp.ACROSS[0]] - first[:, SEED - 1, plain_mlp.ACROSS[1]]
    np.testing.assert_allclose(across[:, 2], 0, atol=1e-6)
    assert (across[:, 0] > 0).all()
    back = second @ turned[:, None].transpose(-1, -2) + origin
    np.testing.assert_allclose(back, elsewhere, atol=1e-5)


@pytest.mark.parametrize("degrees", [0.0, 90.0])
def test_figures_that_glide_glide_on(monkeypatch: pytest.MonkeyPatch, degrees: float) -> None:
    monkeypatch.setattr(plain_mlp, "HIDDEN", 16)
    monkeypatch.setattr(plain_mlp, "AVERAGED", 0.9)
    glides = []
    for pace in np.linspace(0.0, 0.06, 8):
        path = np.arange(40)[:, None, None] * np.array([0.0, 0.0, pace])
        glides.append((standing(40) + path) @ axis_to_rotmat("y", pace * 30).T)
    net = trained(glides, SEED, FRAMES, steps=150)
    turn = axis_to_rotmat("y", np.radians(degrees)).T
    track = (standing(10) + np.arange(10)[:, None, None] * np.array([0.0, 0.0, 0.05])) @ turn
    found = positions_after(net, track[None, :SEED])[0]
    true = track[SEED : SEED + FRAMES]
    still = np.linalg.norm(track[SEED - 1] - true[-1], axis=-1).mean()
    assert np.linalg.norm(found[-1] - true[-1], axis=-1).mean() < 0.3 * still


def test_the_mirror_image_of_a_seed_is_predicted_as_the_mirror_image() -> None:
    rng = np.random.default_rng(1)
    seeds = standing(SEED)[None] + rng.normal(size=(3, SEED, len(HUMANOID.names), 3)) * 0.05
    torch.manual_seed(0)
    net = plain_mlp.PlainMLP(SEED, FRAMES)
    torch.nn.init.normal_(net.outward.weight, std=0.01)
    image = positions_after(net, seeds[:, :, MIRRORED_JOINTS] * (-1, 1, 1))
    np.testing.assert_allclose(image[:, :, MIRRORED_JOINTS] * (-1, 1, 1), positions_after(net, seeds), atol=1e-5)


def test_points_get_bones_of_their_lengths() -> None:
    turned = rotvec_to_rotmat(0.2 * np.random.default_rng(2).normal(size=(6, len(HUMANOID.names), 3)))
    for joint, parent in enumerate(HUMANOID.parents[1:], start=1):
        turned[:, joint] = turned[:, parent] @ turned[:, joint]
    posed = (places_of(HUMANOID, turned) + np.array([1.0, 1.0, -2.0])).reshape(2, 3, -1, 3)
    np.testing.assert_allclose(with_bones(posed), posed, atol=1e-9)
    # points that are drawn together get bones of full length, and those of the hips point as before
    hips = posed[:, :, :1]
    drawn = with_bones(hips + 0.9 * (posed - hips))
    lengths = np.linalg.norm(drawn[:, :, 1:] - drawn[:, :, HUMANOID.parents[1:]], axis=-1)
    rest = np.linalg.norm(HUMANOID.offsets[1:], axis=-1)
    np.testing.assert_allclose(lengths, np.broadcast_to(rest, lengths.shape), atol=1e-9)
    np.testing.assert_allclose(drawn[:, :, 1], posed[:, :, 1], atol=1e-9)
