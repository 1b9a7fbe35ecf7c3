"""Files that motet wrote come back into every verb as they were, with no word about their unit."""

from pathlib import Path

import numpy as np
import pytest

import motet
from motet.motion import HUMANOID, Motion, positions
from motet.motion.rotations import Array
from motet.predict.model import PredictModel

BUNDLES = ("describe", "predict", "search", "control")
EXTENSIONS = (".amc", ".bvh", ".glb", ".npz", ".vrma")


@pytest.fixture(scope="module")
def walk(clips: Path) -> Motion:
    return motet.to_humanoid(motet.read(clips / "39_14.amc").resample(30)).motion


@pytest.mark.parametrize("bundle", BUNDLES)
@pytest.mark.parametrize("extension", EXTENSIONS)
def test_a_models_frames_of_a_file_are_those_of_the_motion(
    bundle: str, extension: str, walk: Motion, tmp_path: Path
) -> None:
    motet.write(tmp_path / f"walk{extension}", walk)
    contract = motet.load(bundle).contract
    found, expected = contract.frames(motet.read(tmp_path / f"walk{extension}")), contract.frames(walk)
    np.testing.assert_allclose(found, expected, atol=2e-3)


def test_a_file_of_the_models_own_joints_is_continued_in_its_own_channels(walk: Motion, tmp_path: Path) -> None:
    model = motet.load_as(PredictModel, "predict")
    motet.write(tmp_path / "walk.bvh", walk)
    own = motet.read(tmp_path / "walk.bvh")
    for found, expected in (
        (model.predict(own, frames=40, append=True), model.predict(walk, frames=40, append=True)),
        (model.predict(own, frames=40), model.predict(walk, frames=40)),
    ):
        np.testing.assert_allclose(_places(found), _places(expected), atol=1e-3)


def test_the_length_of_the_legs_tells_the_unit_of_a_file_of_other_proportions(clips: Path, tmp_path: Path) -> None:
    walk = motet.read(clips / "39_14.amc")
    for metres in (1.0, 0.01, 0.0254):
        motet.write(tmp_path / "walk.bvh", walk.scaled(metres))
        frames = motet.load("language-to-motion").contract.frames(motet.read(tmp_path / "walk.bvh"))
        np.testing.assert_allclose(frames, motet.load("language-to-motion").contract.frames(walk), atol=2e-3)


def _places(motion: Motion) -> Array:
    """Positions (T, J, 3) of the humanoid's joints, whatever order the file has them in."""
    assert motion.skeleton is not None
    return positions(motion)[:, [motion.skeleton.index(name) for name in HUMANOID.names]]
