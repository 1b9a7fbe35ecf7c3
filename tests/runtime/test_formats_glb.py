import json
import struct
from dataclasses import replace

import numpy as np
import pytest
from figures import walker

from motet.errors import MotionError
from motet.formats import glb, write_motion
from motet.motion.kinematics import positions
from motet.motion.motion import Motion
from motet.motion.rotations import quat_to_rotmat
from motet.motion.skeleton import Joint, Skeleton

TYPES = {5121: "<u1", 5126: "<f4", 5123: "<u2", 5125: "<u4"}
WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}


class Glb:
    def __init__(self, path):
        content = path.read_bytes()
        magic, version, length, json_length, json_kind = struct.unpack_from("<4sIII4s", content)
        assert (magic, version, length, json_kind) == (b"glTF", 2, len(content), b"JSON")
        self.document = json.loads(content[20 : 20 + json_length])
        bin_length, bin_kind = struct.unpack_from("<I4s", content, 20 + json_length)
        assert (bin_kind, json_length % 4, bin_length % 4) == (b"BIN\0", 0, 0)
        self.binary = content[28 + json_length :]
        assert len(self.binary) == bin_length == self.document["buffers"][0]["byteLength"]

    def array(self, index):
        accessor = self.document["accessors"][index]
        view = self.document["bufferViews"][accessor["bufferView"]]
        part = self.binary[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
        array = np.frombuffer(part, TYPES[accessor["componentType"]]).reshape(accessor["count"], -1)
        assert array.shape[1] == WIDTHS[accessor["type"]]
        if "min" in accessor:
            assert accessor["min"] == array.min(0).tolist()
            assert accessor["max"] == array.max(0).tolist()
        return array

    def tracks(self):
        animation = self.document["animations"][0]
        samplers = [(self.array(s["input"])[:, 0], self.array(s["output"])) for s in animation["samplers"]]
        return {(c["target"]["node"], c["target"]["path"]): samplers[c["sampler"]] for c in animation["channels"]}

    def globals(self):
        """World matrices (T, J, 4, 4) of the joints: as a viewer computes them."""
        tracks, skin = self.tracks(), self.document["skins"][0]
        frames = len(next(iter(tracks.values()))[0])
        world = np.tile(np.eye(4), (frames, len(skin["joints"]), 1, 1))
        parents = {child: n for n, node in enumerate(self.document["nodes"]) for child in node.get("children", [])}
        for n in skin["joints"]:
            node, local = self.document["nodes"][n], np.tile(np.eye(4), (frames, 1, 1))
            local[:, :3, 3] = tracks.get((n, "translation"), (None, node["translation"]))[1]
            local[:, :3, :3] = quat_to_rotmat(
                np.float64(tracks.get((n, "rotation"), (None, np.float64([0, 0, 0, 1])))[1])
            )
            world[:, n] = world[:, parents[n]] @ local if n in parents else local
        return world


def written(path, motion):
    write_motion(path / "motion.glb", motion)
    return Glb(path / "motion.glb")


@pytest.mark.parametrize(("unit", "factor"), [(1.0, 1.0), (0.0564, 0.0564), (None, 1.0)])
def test_a_viewer_gets_the_positions(tmp_path, unit, factor):
    motion = walker(metres_per_unit=unit)
    file = written(tmp_path, motion)
    assert np.abs(file.globals()[:, :, :3, 3] - factor * positions(motion)).max() < 1e-5
    assert file.document["asset"]["extras"]["length_unit"] == ("m" if unit else "unknown")
    assert [node["name"] for node in file.document["nodes"]] == [*motion.skeleton.names, "body"]


def test_times_and_quaternions(tmp_path):
    motion = walker(frames=80)
    for (_, kind), (times, values) in written(tmp_path, motion).tracks().items():
        assert times == pytest.approx(np.arange(80) / 40)
        if kind == "rotation":
            assert np.linalg.norm(values, axis=1) == pytest.approx(1, abs=1e-6)
            assert (values[1:] * values[:-1]).sum(1).min() > 0.9


def test_only_what_moves_is_animated(tmp_path):
    motion = walker()
    tracks = written(tmp_path, motion).tracks()
    turning = {name.split(".")[0] for name in motion.channels}
    assert {motion.skeleton.names[n] for n, kind in tracks if kind == "rotation"} == turning
    assert [n for n, kind in tracks if kind == "translation"] == [0]


def test_joint_that_stretches_is_animated(tmp_path):
    skeleton = Skeleton((Joint("root", -1, (0.5, 0, 0)), Joint("arm", 0, (0, 1, 0)), Joint("arm_end", 1, (1, 0, 0))))
    motion = Motion([[1.0, 90.0], [2.0, -90.0]], ("arm.tx", "root.rz"), ("length", "deg"), 10, skeleton)
    assert written(tmp_path, motion).globals()[:, :, :3, 3] == pytest.approx(positions(motion), abs=1e-6)


def test_body_follows_the_joints(tmp_path):
    file = written(tmp_path, walker())
    (primitive,) = file.document["meshes"][0]["primitives"]
    arrays = {name: file.array(index) for name, index in primitive["attributes"].items()}
    corners, joints, weights = arrays["POSITION"], arrays["JOINTS_0"][:, 0], arrays["WEIGHTS_0"]
    assert np.all(weights == [255, 0, 0, 0])
    assert joints.max() < 14
    assert np.linalg.norm(arrays["NORMAL"], axis=1) == pytest.approx(1, abs=1e-6)
    inverse = file.array(file.document["skins"][0]["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)
    moves = (file.globals() @ inverse)[:, joints]
    skinned = (moves @ np.concatenate([corners, np.ones((len(corners), 1))], axis=1)[..., None])[..., :3, 0]
    distance = np.linalg.norm(skinned[:, :, None] - positions(walker())[:, None], axis=-1).min(-1)
    assert distance.max() < 0.2


def test_triangles_face_outwards(tmp_path):
    file = written(tmp_path, walker())
    (primitive,) = file.document["meshes"][0]["primitives"]
    corners, normals = (file.array(primitive["attributes"][name]) for name in ("POSITION", "NORMAL"))
    triangles = file.array(primitive["indices"]).reshape(-1, 3)
    a, b, c = (corners[triangles[:, n]] for n in range(3))
    facing = (np.cross(b - a, c - a) * normals[triangles].sum(1)).sum(-1)
    assert facing.min() > 0


def test_single_frame_and_refusals(tmp_path):
    assert len(written(tmp_path, walker(frames=1)).globals()) == 1
    with pytest.raises(MotionError, match="no frames"):
        glb.write(tmp_path / "bad.glb", walker()[:0])
    with pytest.raises(MotionError, match="no skeleton"):
        glb.write(tmp_path / "bad.glb", replace(walker(), skeleton=None))
    assert not (tmp_path / "bad.glb").exists()
