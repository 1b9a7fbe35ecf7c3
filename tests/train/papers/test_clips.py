import shutil
from pathlib import Path

import numpy as np
import pytest
from control_runs import control_run

from motet.errors import FormatError
from motet.formats import read_motion, write_motion
from motet_train.data import cmu_trials
from motet_train.data.cmu_trials import CMU_FOLDER
from motet_train.data.errors import DataError
from motet_train.papers.tdbn.clips import body_parts, read_clips
from motet_train.papers.tdbn.rbm import Learning
from motet_train.papers.tdbn.tdbn import TDBNConfig


def test_the_default_clips_are_the_thesis_trials() -> None:
    clips = read_clips()
    assert clips.labels == ("walk", "run", "bend")
    assert [len(found[0]) for found in clips.motions.values()] == [399, 138, 341]
    assert len(clips.channels) == 59
    assert len(read_clips(None, root_rotation=False).channels) == 56
    assert "NSF EIA-0196217" in clips.licence


def test_all_phases_of_a_faster_clip_are_data() -> None:
    clips = read_clips()
    walk, found = clips.motions["walk"][0], clips.frames(40.0)["walk"]
    assert [len(sequence) for sequence in found] == [133, 133, 133]
    np.testing.assert_array_equal(np.stack(found, axis=1).reshape(399, -1), walk.values)
    (slower,) = clips.frames(50.0)["walk"]
    assert len(slower) == round(399 / 120 * 50)


def test_the_body_has_five_parts() -> None:
    clips = read_clips()
    parts = body_parts(clips.skeleton, clips.channels)
    sizes = dict(zip(parts.names, np.bincount(parts.of_channel), strict=True))
    assert sizes == {"trunk": 21, "rclavicle": 12, "lclavicle": 12, "rhipjoint": 7, "lhipjoint": 7}
    assert [parts.names[leg] for leg in parts.legs] == ["lhipjoint", "rhipjoint"]


def own_clips(folder: Path) -> Path:
    """Clips of one's own: BVH files, one by its name and one by its folder's."""
    (folder / "jog").mkdir(parents=True)
    write_motion(folder / "stroll.bvh", read_motion(CMU_FOLDER / "39_14.amc"))
    write_motion(folder / "jog" / "first.bvh", read_motion(CMU_FOLDER / "09_07.amc"))
    return folder


def test_a_folder_of_bvh_is_trained_on(tmp_path: Path) -> None:
    clips = read_clips(own_clips(tmp_path))
    assert clips.labels == ("jog", "stroll")
    short = TDBNConfig(restarts=2, tries=1, rounds=1, rbm=Learning(epochs=1), crbm=Learning(epochs=1))
    run = control_run(clips, short)
    assert run.manifest["training"]["candidates"] == 2  # none of the untrained ones satisfies
    assert "cycle.energy" in run.manifest["training"]["missed"]
    assert run.manifest["control"]["labels"] == ["jog", "stroll"]
    assert run.manifest["licence"] == {"weights": None, "data": None}  # as nobody stated them
    assert run.manifest["loop"] == "session"


def test_a_length_unit_is_for_clips_that_do_not_state_theirs(tmp_path: Path) -> None:
    assert read_clips(own_clips(tmp_path)).skeleton.metres_per_unit is None
    assert read_clips(tmp_path, unit="cm").skeleton.metres_per_unit == 1.0
    assert read_clips(unit="cm").skeleton == read_clips().skeleton  # AMC files state theirs, which stays


def test_without_a_checkout_the_default_clips_are_asked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cmu_trials, "CMU_FOLDER", tmp_path)
    with pytest.raises(DataError, match=r"39_14 is not installed: run this in a checkout .* or give --data"):
        read_clips()


def test_clips_that_do_not_go_together_are_named(tmp_path: Path) -> None:
    own_clips(tmp_path)
    walk = read_motion(CMU_FOLDER / "39_14.amc")
    write_motion(tmp_path / "half.npz", walk.select(walk.channels[:30]))
    with pytest.raises(DataError, match=r"first\.bvh does not match .*half\.npz: only one of them has"):
        read_clips(tmp_path)


def test_a_folder_without_clips_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no folder"):
        read_clips(tmp_path / "none")
    with pytest.raises(DataError, match="no clips in"):
        read_clips(tmp_path)
    (tmp_path / "walk.bvh").write_text("no motion")
    with pytest.raises(FormatError, match=r"walk\.bvh"):
        read_clips(tmp_path)
    (tmp_path / "walk.bvh").unlink()
    shutil.copy(CMU_FOLDER / "39_14.amc", tmp_path / "my-walk.amc")
    with pytest.raises(DataError, match="'my-walk'"):
        read_clips(tmp_path)


def test_a_clip_that_is_too_short_is_refused(tmp_path: Path) -> None:
    write_motion(tmp_path / "walk.bvh", read_motion(CMU_FOLDER / "39_14.amc")[:12])
    with pytest.raises(DataError, match="4 frames"):
        control_run(read_clips(tmp_path), TDBNConfig())
