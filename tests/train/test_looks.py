"""What motions look like: known figures, a naive twin, and what makes no difference."""

from dataclasses import replace

import numpy as np
import pytest
from language_models import CHANNELS, FPS, FRAMES, KINDS, STORE, UNITS, moving, told

from motet.motion.kinematics import positions
from motet.representation.root_block import from_root_block
from motet_train.evaluate.language.motions import Looks
from motet_train.evaluate.language.split_store import SplitStore, split_as

TURN = KINDS["walks and turns left"]


@pytest.fixture(scope="module")
def looks() -> Looks:
    return Looks(split_as(told(STORE, "describe"), STORE))


def test_places_are_seen_from_the_root(looks: Looks) -> None:
    places, speeds, path = looks.arrays(moving(*TURN))
    walked = positions(from_root_block(moving(0.0, 0.0, 0.0)))
    np.testing.assert_allclose(places.reshape(walked.shape), walked, atol=1e-9)
    np.testing.assert_allclose(path, np.tile([1.0, 0.0, 45.0], (FRAMES, 1)))
    foot = walked[:, 2]
    np.testing.assert_allclose(speeds[1:, 2], np.linalg.norm(foot[1:] - foot[:-1], axis=1) * FPS)
    assert (speeds[:, 0] == 0).all()  # the root never moves as seen from itself, but for its height
    assert looks.arrays(moving(0.0, 0.0, 0.5))[1][10, 0] == pytest.approx(0.5 * FPS)


def test_training_motions_are_the_scale_and_each_kind_weighs_the_same(looks: Looks) -> None:
    corpus = looks.corpus
    found = looks.features(corpus.motions(corpus.parts.train))
    sizes = [frames.shape[1] for frames in looks.arrays(corpus.motion(0))]
    assert sizes == [3 * 7, 7, 3]
    np.testing.assert_allclose(found.mean(axis=0), 0, atol=1e-9)
    deviation = found.std(axis=0) * np.repeat(np.sqrt(sizes), [2 * size for size in sizes])
    assert ((deviation < 1 + 1e-9) | np.isclose(deviation, 1)).all()
    means = np.array([corpus.motion(record).values[:, 2].mean() for record in corpus.parts.train])  # degrees a second
    turning = 2 * (21 + 7) + 2
    np.testing.assert_allclose(found[:, turning] * np.sqrt(3), (means - means.mean()) / means.std())


def test_without_a_root_block_channels_are_seen() -> None:
    angles = replace(STORE, frames=STORE.frames[:, 6:], channels=CHANNELS[6:], units=UNITS[6:], skeletons=())
    entries = tuple(replace(entry, skeleton=None) for entry in STORE.records)
    angles = replace(angles, representation="angles", records=entries)
    corpus: SplitStore = split_as(told(angles, "describe"), angles)
    (seen,) = Looks(corpus).arrays(corpus.motion(3))
    np.testing.assert_allclose(seen, corpus.contract.normalised(corpus.contract.frames(corpus.motion(3))))
    assert Looks(corpus).features(corpus.motions([3, 4])).shape == (2, 4)
