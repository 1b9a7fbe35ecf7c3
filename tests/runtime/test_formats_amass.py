from pathlib import Path
from typing import Any

import numpy as np
import pytest

from motet.errors import FormatError
from motet.figures.humanoid.bones import HUMANOID
from motet.figures.humanoid.retarget import to_humanoid
from motet.formats import npz, read_motion
from motet.motion.kinematics import positions
from motet.motion.rotations import Array, rotmat_to_rotvec, rotvec_to_rotmat

Z_TO_Y = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])

STANDING = np.array([np.pi / 2, 0.0, 0.0])
"""The root's rotation vector of a figure that stands in a world with z up: it faces -y there, +z here."""


def poses(frames: int = 8) -> tuple[Array, Array]:
    """Rotation vectors (T, 156) of a body that walks one metre along -y and lifts its left arm; and its path."""
    vectors, trans = np.zeros((frames, 156)), np.zeros((frames, 3))
    vectors[:, :3] = STANDING
    vectors[:, 3 * 16 + 2] = np.linspace(0, 1.3, frames)
    trans[:, 1], trans[:, 2] = np.linspace(0, -1, frames), 0.93
    return vectors, trans


def test_a_body_stands_up_and_walks_forward(tmp_path: Path) -> None:
    vectors, trans = poses()
    np.savez(tmp_path / "a.npz", poses=vectors, trans=trans, mocap_framerate=120.0, betas=np.zeros(16), gender="male")
    motion = read_motion(tmp_path / "a.npz")
    assert (len(motion), motion.fps) == (8, 120)
    humanoid = to_humanoid(motion)
    assert humanoid.convention == "SMPL, SMPL-H, SMPL-X (AMASS)"
    place = dict(zip(HUMANOID.names, np.moveaxis(positions(humanoid.motion), 1, 0), strict=True))
    assert place["head"][0, 1] > 1.4
    assert place["leftHand"][0, 0] > 0.6
    assert place["leftHand"][-1, 1] > place["head"][-1, 1]
    assert place["leftToes"][0, 2] > place["leftFoot"][0, 2] + 0.05
    assert place["hips"][-1, 2] - place["hips"][0, 2] == pytest.approx(1.0, abs=0.05)
    assert place["hips"][-1, 0] == pytest.approx(place["hips"][0, 0])


def test_the_newer_names_of_arrays_are_known(tmp_path: Path) -> None:
    vectors, trans = poses()
    np.savez(tmp_path / "a.npz", poses=vectors, trans=trans, mocap_framerate=60.0)
    split = {"root_orient": vectors[:, :3], "pose_body": vectors[:, 3:66], "trans": trans, "mocap_frame_rate": 60}
    np.savez(tmp_path / "b.npz", **split)
    old, new = npz.read(tmp_path / "a.npz"), npz.read(tmp_path / "b.npz")
    np.testing.assert_array_equal(old.values, new.values)
    assert old.fps == new.fps == 60


def test_mocap_of_videos_is_read(tmp_path: Path) -> None:
    """Of ROMP, WHAM and others, whose y is up: as vectors in one array or two, and as matrices."""
    vectors, trans = poses()
    np.savez(tmp_path / "amass.npz", poses=vectors, trans=trans, mocap_framerate=30.0)
    wanted = npz.read(tmp_path / "amass.npz")
    root = rotmat_to_rotvec(Z_TO_Y @ rotvec_to_rotmat(vectors[:, :3]))
    body = vectors[:, 3:66].reshape(-1, 21, 3)
    more = np.concatenate([body, np.zeros((len(body), 2, 3))], axis=1)  # hands, which are left out
    ways = {
        "vectors": {"global_orient": root, "body_pose": body.reshape(-1, 63)},
        "joints": {"global_orient": root[:, None], "body_pose": more},
        "matrices": {"global_orient": rotvec_to_rotmat(root)[:, None], "body_pose": rotvec_to_rotmat(body)},
        "one matrix": {"global_orient": rotvec_to_rotmat(root), "body_pose": rotvec_to_rotmat(body)},
    }
    for name, arrays in ways.items():
        np.savez(tmp_path / "video.npz", transl=trans @ Z_TO_Y.T, betas=np.zeros((8, 10)), **arrays)
        found = read_motion(tmp_path / "video.npz", fps=30)
        np.testing.assert_allclose(positions(found), positions(wanted), atol=1e-9, err_msg=name)
    with pytest.raises(FormatError, match=r"no frame rate.*--fps-in"):
        read_motion(tmp_path / "video.npz")


def test_poses_of_joints_and_a_rate_that_is_given(tmp_path: Path) -> None:
    vectors, trans = poses()
    np.savez(tmp_path / "a.npz", poses=vectors[:, :72].reshape(-1, 24, 3), trans=trans)
    assert read_motion(tmp_path / "a.npz", fps=25).fps == 25
    np.savez(tmp_path / "a.npz", poses=vectors, trans=trans, mocap_framerate=50.0)
    assert read_motion(tmp_path / "a.npz", fps=50).fps == 50
    with pytest.raises(FormatError, match="states 50 fps, but 60 was given"):
        read_motion(tmp_path / "a.npz", fps=60)


WRONG = {
    "poses that are not finite": ({"poses": np.full((8, 66), np.nan)}, "poses holds numbers that are not finite"),
    "matrices that are none": (
        {"global_orient": np.ones((8, 1, 3, 3)), "body_pose": np.ones((8, 21, 3, 3))},
        "global_orient holds matrices that are no rotations",
    ),
    "no rate": ({"poses": np.zeros((8, 66)), "fps": None}, "no frame rate"),
    "few joints": ({"poses": np.zeros((8, 60))}, "20 joints, expected"),
    "a few joints": ({"global_orient": np.zeros((8, 3)), "body_pose": np.zeros((8, 30))}, "11 joints, expected 22"),
    "another shape": ({"poses": np.zeros((8, 65))}, r"poses of shape \(8, 65\): expected"),
    "a path of another length": ({"poses": np.zeros((8, 66)), "trans": np.zeros((5, 3))}, r"trans must be \(8, 3\)"),
    "no path": ({"poses": np.zeros((8, 66)), "trans": None}, "no translation of the root"),
    "places alone": ({"joints": np.zeros((8, 22, 3)), "trans": None}, "places of joints, as of HumanML3D"),
    "a shape alone": ({"betas": np.zeros(16), "trans": None}, "a body's shape without its poses"),
    "a rate of 10^6": ({"poses": np.zeros((8, 66)), "fps": 1e6}, r"frame rate 1e\+06 is out of range"),
}


@pytest.mark.parametrize(("arrays", "reason"), WRONG.values(), ids=WRONG)
def test_what_is_wrong_is_named(tmp_path: Path, arrays: dict[str, Any], reason: str) -> None:
    given = {"trans": np.zeros((8, 3)), "fps": 30.0, **arrays}
    np.savez(tmp_path / "a.npz", **{name: values for name, values in given.items() if values is not None})
    with pytest.raises(FormatError, match=reason):
        npz.read(tmp_path / "a.npz")


def test_more_frames_than_the_size_of_a_file_speaks_for_are_refused_before_they_are_unpacked(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    for frames, reason in ((45_000, "no frame rate"), (60_000, "60000 frames are too many for a file of")):
        shaped = {"trans": np.zeros((frames, 3), "f4"), "poses": np.zeros((frames, 66), "i1")}
        np.savez_compressed(path, **shaped)
        with pytest.raises(FormatError, match=reason):
            read_motion(path)
