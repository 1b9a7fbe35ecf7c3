import sys
from pathlib import Path

import numpy as np
import pytest

from motet.errors import MotionError
from motet.figures.humanoid.bones import HUMANOID
from motet.figures.humanoid.joint_map import map_by_names
from motet.figures.humanoid.retarget import to_humanoid
from motet.formats import clips, read_motion
from motet.motion.kinematics import global_transforms

sys.path.append(str(Path(__file__).parents[1]))
from retarget_figures import agreement, unpacked


@pytest.fixture(scope="module")
def trials(shared: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("trials")
    files = unpacked(shared, folder, ("cmu-bvh.zip", "cmu-bvh-more.zip", "accad-bvh.zip"))
    return {path.stem: path for path in files}


def test_trials_of_two_forms_agree_on_the_humanoid(cmu: Path, trials: dict[str, Path]) -> None:
    for name in ("07_01", "11_01"):
        apart, limbs = agreement(read_motion(trials[name]), read_motion(cmu / "amc" / f"{name}.amc"), 1)
        assert apart < 2
        assert max(limbs.values()) < 5
    apart, limbs = agreement(read_motion(trials["49_05"]), read_motion(cmu / "amc" / "49_05.amc"), 1)
    assert apart < 0.1
    assert max(limbs.values()) < 0.01


def test_every_clip_of_a_person_comes_in_and_none_of_a_beast(shared: Path) -> None:
    figures = shared / "figures"
    if not figures.is_dir():
        pytest.skip("needs ../shared/data/figures")
    for name in ("horse", "kaiju"):
        path = figures / f"{name}-animations.glb"
        for clip in clips(path):
            with pytest.raises(MotionError, match="bones are straight"):
                to_humanoid(read_motion(path, clip=clip))
    for clip in clips(figures / "many-clips.glb"):
        assert to_humanoid(read_motion(figures / "many-clips.glb", clip=clip)).confidence > 0.9


def test_every_skeleton_of_the_data_is_known(trials: dict[str, Path]) -> None:
    conventions = {}
    for name in ("07_01", "11_01", "60_01", "94_04", "141_16", "ACCAD_Male1_A1_Stand", "ACCAD_Female1_A01_Stand"):
        motion = read_motion(trials[name])
        assert motion.skeleton is not None
        found = map_by_names(motion.skeleton)
        assert found is not None
        conventions[name] = found.convention
    assert set(conventions.values()) == {
        "CMU in BVH, 31 joints (cgspeed, MotionBuilder)",
        "CMU in BVH, 43 joints (Poser, DAZ)",
        "ACCAD Open Motion Project",
    }


@pytest.mark.parametrize(
    "name", ["ACCAD_Male1_B3_Walk", "ACCAD_Male2_B3_Walk", "ACCAD_Female1_B03_Walk1", "60_01", "94_04", "10_04"]
)
def test_a_figure_stands_upright_with_its_knees_in_front(trials: dict[str, Path], name: str) -> None:
    """The humanoid's hinges: over all frames knees turn about the axis to the left, elbows about the one that is up."""
    if name not in trials:
        name = next(other for other in trials if other.startswith(name[:-1]))
    rotations, places = global_transforms(to_humanoid(read_motion(trials[name])).motion)
    index = HUMANOID.index
    assert np.median(places[:, index("head"), 1]) > 1.3
    for side in ("left", "right"):
        thigh, shin = (rotations[:, index(f"{side}{part}")] for part in ("UpperLeg", "LowerLeg"))
        knee = np.swapaxes(thigh, -1, -2) @ shin
        bend = np.degrees(np.arctan2(knee[:, 2, 1], knee[:, 1, 1]))
        assert np.median(bend) > -5
        assert np.quantile(bend, 0.95) > 30
        foot = places[:, index(f"{side}Toes")] - places[:, index(f"{side}Foot")]
        hips = rotations[:, index("hips")]
        assert np.median(np.sum(foot * hips[:, :, 2], axis=-1)) > 0.05
