"""glTF as other programs write it: sparse arrays, frame rates of television, late starts, scales that shear limbs."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltf_files import node_places, read_document, write_clips, write_document
from test_retarget import dancing

import motet
from motet.errors import FormatError
from motet.formats import glb, gltf
from motet.motion.kinematics import positions, skeleton_of
from motet.motion.motion import Motion
from motet.motion.rotations import Array

Document = dict[str, Any]


def add_part(document: Document, binary: bytes, values: Array) -> tuple[int, bytes]:
    """The index of a new view of some values, and the binary part with them."""
    start = len(binary) + -len(binary) % 4
    view = {"buffer": 0, "byteOffset": start, "byteLength": values.nbytes}
    document["bufferViews"].append(view)
    return len(document["bufferViews"]) - 1, binary.ljust(start, b"\0") + values.tobytes()


def sparse(path: Path, out: Path, base: bool, changes: Document | None = None) -> None:
    """A file with every array of values sparse: over zeros, or over the array with every third row destroyed.

    changes: what to put into the sparse part of the first of them.
    """
    document, binary = read_document(path)
    outputs = [sampler["output"] for sampler in document["animations"][0]["samplers"]]
    for number, index in enumerate(outputs):
        accessor = document["accessors"][index]
        view = document["bufferViews"][accessor["bufferView"]]
        start = view.get("byteOffset", 0)
        shape = (accessor["count"], -1)
        values = np.frombuffer(binary, "<f4", view["byteLength"] // 4, start).reshape(shape)
        rows = np.arange(0, len(values), 3 if base else 1)
        if base:
            damaged = values.copy()
            damaged[rows] = 9.0
            binary = binary[:start] + damaged.tobytes() + binary[start + values.nbytes :]
        else:
            del accessor["bufferView"]
        indices, binary = add_part(document, binary, rows.astype("<u2"))
        kept, binary = add_part(document, binary, values[rows])
        accessor["sparse"] = {
            "count": len(rows),
            "indices": {"bufferView": indices, "componentType": 5123},
            "values": {"bufferView": kept},
        }
        if number == 0 and changes:
            accessor["sparse"].update(changes)
    write_document(out, document, binary)


@pytest.mark.parametrize("base", [True, False])
def test_sparse_arrays_are_read_as_plain_ones(base: bool, tmp_path: Path) -> None:
    plain = write_clips(tmp_path / "plain.glb", [("Walk", dancing(40))])
    sparse(plain, tmp_path / "sparse.glb", base)
    found, wanted = motet.read(tmp_path / "sparse.glb"), motet.read(plain)
    np.testing.assert_array_equal(found.values, wanted.values)


def test_an_array_without_values_is_zeros(tmp_path: Path) -> None:
    motion = dancing(40)
    document, binary = read_document(write_clips(tmp_path / "plain.glb", [("Walk", motion)]))
    channels = document["animations"][0]["channels"]
    moved = next(channel["sampler"] for channel in channels if channel["target"]["path"] == "translation")
    accessor = document["accessors"][document["animations"][0]["samplers"][moved]["output"]]
    del accessor["bufferView"]
    write_document(tmp_path / "zeros.glb", document, binary)
    assert not positions(motet.read(tmp_path / "zeros.glb"))[:, 0].any()
    accessor["count"] = 10**12
    write_document(tmp_path / "zeros.glb", document, binary)
    with pytest.raises(FormatError, match="has more zeros than the file has bytes"):
        motet.read(tmp_path / "zeros.glb")


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"count": 10**9}, "extends beyond its buffer"),
        ({"count": -1}, "extends beyond its buffer"),
        ({"count": 2.5}, "is broken"),
        ({"count": "x"}, "is broken"),
        ({"indices": {"bufferView": 0, "componentType": 5126}}, "its sparse indices are not unsigned integers"),
        ({"indices": {"bufferView": 0, "componentType": 5120}}, "its sparse indices are not unsigned integers"),
        ({"indices": {"bufferView": 0, "componentType": 5123}}, "its sparse indices do not rise, or reach beyond"),
        ({"indices": {"bufferView": 0, "componentType": 5125}}, "its sparse indices do not rise, or reach beyond"),
        ({"indices": {"bufferView": 10**6, "componentType": 5123}}, "is broken"),
        ({"values": {"bufferView": 0, "byteOffset": 10**9}}, "is broken|extends beyond"),
        ({"values": {}}, "is broken"),
    ],
)
def test_sparse_arrays_that_lie_are_refused(changes: Document, said: str, tmp_path: Path) -> None:
    plain = write_clips(tmp_path / "plain.glb", [("Walk", dancing(40))])
    sparse(plain, tmp_path / "sparse.glb", True, changes)
    with pytest.raises(FormatError, match=said):
        motet.read(tmp_path / "sparse.glb")


def test_counts_that_differ_are_refused_in_words(tmp_path: Path) -> None:
    document, binary = read_document(write_clips(tmp_path / "a.glb", [("Walk", dancing(40))]))
    channel = document["animations"][0]["channels"][3]
    output = document["animations"][0]["samplers"][channel["sampler"]]["output"]
    document["accessors"][output]["count"] = 20
    write_document(tmp_path / "b.glb", document, binary)
    name = document["nodes"][channel["target"]["node"]]["name"]
    said = f"its animation 'Walk' has 40 times and 20 values, not 40, for the rotation of '{name}': export it again"
    with pytest.raises(FormatError, match=said):
        motet.read(tmp_path / "b.glb")


@pytest.mark.parametrize("fps", [23.976, 24000 / 1001, 24, 25, 29.97, 30000 / 1001, 30, 60, 119.88, 120])
@pytest.mark.parametrize(("kind", "frames"), [("glb", 40), ("glb", 3000), ("vrma", 40)])
def test_frame_rates_are_read_as_written(fps: float, kind: str, frames: int, tmp_path: Path) -> None:
    motion = dancing(40)
    values = np.resize(motion.values, (frames, motion.values.shape[1]))
    motion = Motion(values, motion.channels, motion.units, fps, skeleton_of(motion))
    motet.write(tmp_path / f"a.{kind}", motion)
    found = motet.read(tmp_path / f"a.{kind}")
    assert found.fps == pytest.approx(fps, rel=2e-6)
    assert len(found) == frames


def test_a_rate_is_that_of_the_closest_keys_though_some_are_left_out() -> None:
    frames = np.arange(3000)
    kept = frames[(frames % 7 != 3) | (frames % 5 == 0)]
    for fps in (29.97, 30.0, 59.94):
        times = np.asarray(kept / fps, np.float32).astype(np.float64)
        assert gltf._rate([times, times[::2]]) == fps


def late(path: Path, out: Path, seconds: float) -> None:
    """A file with all keys later."""
    document, binary = read_document(path)
    for index in {sampler["input"] for sampler in document["animations"][0]["samplers"]}:
        view = document["bufferViews"][document["accessors"][index]["bufferView"]]
        start = view.get("byteOffset", 0)
        times = np.frombuffer(binary, "<f4", view["byteLength"] // 4, start) + np.float32(seconds)
        binary = binary[:start] + times.astype("<f4").tobytes() + binary[start + times.nbytes :]
    write_document(out, document, binary)


def test_an_animation_that_starts_late_is_cut_to_its_keys_with_a_note(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    plain = write_clips(tmp_path / "plain.glb", [("Walk", dancing(40))])
    late(plain, tmp_path / "soon.glb", 1 / 24)
    assert len(motet.read(tmp_path / "soon.glb")) == 40
    assert not caplog.messages
    late(plain, tmp_path / "late.glb", 8.0)
    found, wanted = motet.read(tmp_path / "late.glb"), motet.read(plain)
    assert caplog.messages == [f"{tmp_path / 'late.glb'}: its animation 'Walk' starts at 8 s: read from there"]
    np.testing.assert_allclose(positions(found), positions(wanted), atol=1e-4)


def test_limbs_below_unequal_scales_point_where_the_matrices_put_them(tmp_path: Path) -> None:
    motion = dancing(40)
    document, binary = read_document(write_clips(tmp_path / "a.glb", [("Walk", motion)]))
    chest = next(node for node in document["nodes"] if node["name"] == "chest")
    chest["scale"] = [1.2, 0.9, 1.1]
    write_document(tmp_path / "b.glb", document, binary)
    found = motet.read(tmp_path / "b.glb")
    names = skeleton_of(found).names
    wanted = node_places(tmp_path / "b.glb", 0, 40)
    places = positions(found)
    np.testing.assert_allclose(places, np.stack([wanted[name] for name in names], axis=1), atol=1e-5)
    # where the humanoid's limbs point, which are turned only
    human = motet.to_humanoid(found).motion
    joints = skeleton_of(human).names
    turned = positions(human)
    for side in ("left", "right"):
        for start, end in (("UpperArm", "LowerArm"), ("LowerArm", "Hand"), ("UpperLeg", "LowerLeg")):
            bone = turned[:, joints.index(side + end)] - turned[:, joints.index(side + start)]
            expected = wanted[side + end] - wanted[side + start]
            lengths = np.linalg.norm(bone, axis=1) * np.linalg.norm(expected, axis=1)
            assert np.arccos(np.clip(np.sum(bone * expected, axis=1) / lengths, -1, 1)).max() < 2e-3


def test_expressions_alone_are_no_motion(tmp_path: Path) -> None:
    glb.write(tmp_path / "a.glb", dancing(4))
    document, binary = read_document(tmp_path / "a.glb")
    animation = document["animations"][0]
    animation["channels"] = [channel for channel in animation["channels"] if channel["target"]["path"] == "translation"]
    document = {key: document[key] for key in ("asset", "animations", "accessors", "bufferViews")}
    document["nodes"] = [{"name": "happy"}]
    animation["channels"][0]["target"]["node"] = 0
    del animation["channels"][1:]
    happy = {"specVersion": "1.0", "expressions": {"preset": {"happy": {"node": 0}}}}
    document["extensions"] = {"VRMC_vrm_animation": happy}
    write_document(tmp_path / "b.vrma", document, binary)
    with pytest.raises(FormatError, match="it animates only expressions of a face, and no bones"):
        motet.read(tmp_path / "b.vrma")
