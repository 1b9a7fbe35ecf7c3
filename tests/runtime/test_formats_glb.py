import struct

import numpy as np
import pytest
from figures import walker
from gltf_player import Played

from motet.figures.humanoid import HUMANOID
from motet.formats import read_motion, write_motion
from motet.motion.kinematics import positions
from motet.motion.motion import Motion
from motet.motion.skeleton import Joint, Skeleton


def written(folder, motion):
    write_motion(folder / "motion.glb", motion)
    file = Played(folder / "motion.glb")
    return file.play(file.clip())


@pytest.mark.parametrize(("unit", "factor"), [(1.0, 1.0), (0.0564, 0.0564), (None, 1.0)])
def test_a_viewer_gets_the_positions(tmp_path, unit, factor):
    motion = walker(metres_per_unit=unit)
    file = written(tmp_path, motion)
    assert file.names == [*motion.skeleton.names, "body"]
    assert np.abs(file.places(*motion.skeleton.names) - factor * positions(motion)).max() < 1e-5
    assert file.document["asset"]["extras"]["length_unit"] == ("m" if unit else "unknown")


def test_a_human_figure_of_unknown_unit_is_written_in_metres(tmp_path):
    channels = tuple(f"hips.t{axis}" for axis in "xyz")
    places = np.array([[0.0, 0.98, 0.1], [0.1, 0.98, 0.2]])
    centimetres = Motion(places, channels, ("length",) * 3, 30.0, HUMANOID).scaled(0.01)
    write_motion(tmp_path / "motion.bvh", centimetres)
    file = written(tmp_path, read_motion(tmp_path / "motion.bvh"))
    assert np.abs(file.places(*centimetres.skeleton.names) - 0.01 * positions(centimetres)).max() < 1e-5
    assert file.document["asset"]["extras"]["length_unit"] == "m"


def test_parts_and_arrays_are_what_they_are_declared_as(tmp_path):
    file = written(tmp_path, walker())
    magic, version, length, json_length, json_kind = struct.unpack_from("<4sIII4s", file.content)
    assert (magic, version, length, json_kind) == (b"glTF", 2, len(file.content), b"JSON")
    bin_length, bin_kind = struct.unpack_from("<I4s", file.content, 20 + json_length)
    assert (bin_kind, json_length % 4, bin_length % 4) == (b"BIN\0", 0, 0)
    assert len(file.binary) == bin_length == file.document["buffers"][0]["byteLength"]
    bounded = [i for i, accessor in enumerate(file.document["accessors"]) if "min" in accessor]
    assert bounded
    for index in bounded:
        accessor, array = file.document["accessors"][index], file.array(index)
        assert accessor["min"] == array.min(axis=0).tolist()
        assert accessor["max"] == array.max(axis=0).tolist()


def test_times_and_quaternions(tmp_path):
    file = written(tmp_path, walker(frames=80))
    for sampler in file.document["animations"][0]["samplers"]:
        assert file.array(sampler["input"])[:, 0] == pytest.approx(np.arange(80) / 40)
    for (_, kind), values in file.tracks.items():
        if kind == "rotation":
            assert np.linalg.norm(values, axis=1) == pytest.approx(1, abs=1e-6)
            assert (values[1:] * values[:-1]).sum(1).min() > 0.9


def test_only_what_moves_is_animated(tmp_path):
    motion = walker()
    tracks = written(tmp_path, motion).tracks
    turning = {name.split(".")[0] for name in motion.channels}
    assert {name for name, kind in tracks if kind == "rotation"} == turning
    assert [name for name, kind in tracks if kind == "translation"] == ["hips"]


def test_joint_that_stretches_is_animated(tmp_path):
    skeleton = Skeleton((Joint("root", -1, (0.5, 0, 0)), Joint("arm", 0, (0, 1, 0)), Joint("arm_end", 1, (1, 0, 0))))
    motion = Motion([[1.0, 90.0], [2.0, -90.0]], ("arm.tx", "root.rz"), ("length", "deg"), 10, skeleton)
    assert written(tmp_path, motion).places(*skeleton.names) == pytest.approx(positions(motion), abs=1e-6)


def test_body_follows_the_joints_and_faces_outwards(tmp_path):
    file = written(tmp_path, walker())
    (primitive,) = file.document["meshes"][0]["primitives"]
    arrays = {name: file.array(index) for name, index in primitive["attributes"].items()}
    assert np.all(arrays["WEIGHTS_0"] == [1, 0, 0, 0])
    assert arrays["JOINTS_0"].max() < 14
    assert np.linalg.norm(arrays["NORMAL"], axis=1) == pytest.approx(1, abs=1e-6)
    (body,) = file.skinned()
    distance = np.linalg.norm(file.skin(body)[:, :, None] - positions(walker())[:, None], axis=-1).min(-1)
    assert distance.max() < 0.2
    triangles = file.array(primitive["indices"]).astype(int).reshape(-1, 3)
    a, b, c = (arrays["POSITION"][triangles[:, n]] for n in range(3))
    facing = (np.cross(b - a, c - a) * arrays["NORMAL"][triangles].sum(1)).sum(-1)
    assert facing.min() > 0


def test_a_single_frame_is_written(tmp_path):
    assert len(written(tmp_path, walker(frames=1)).worlds) == 1
