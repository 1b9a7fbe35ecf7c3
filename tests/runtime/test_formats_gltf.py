import json
import os
import struct
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltf_files import read_document as parts

from motet.errors import FormatError, MotionError
from motet.figures.humanoid.bones import BONES, HUMANOID, MIXAMO, T_POSE, ground_under, sole_points
from motet.figures.humanoid.retarget import from_humanoid, grounded, to_humanoid
from motet.formats import glb, gltf, gltf_data, read_character, read_motion
from motet.motion.kinematics import global_transforms, local_rotations, positions, skeleton_of
from motet.motion.motion import Motion
from motet.motion.rotations import Array, quat_to_rotmat, rotmat_to_quat, rotmat_to_rotvec

SKELETONS = Path(__file__).parent / "skeletons"


def moving(frames: int = 12) -> Motion:
    time = np.linspace(0, 1, frames)
    names = ["hips.tx", "hips.ty", "hips.tz", *(f"{bone}.r{axis}" for bone in BONES for axis in "xyz")]
    columns = [time, 0.98 + 0 * time, time**2, *(25 * np.sin(3 * time + i) for i in range(len(names) - 3))]
    units = ("length",) * 3 + ("deg",) * (len(names) - 3)
    return Motion(np.stack(columns, axis=1), tuple(names), units, 24.0, HUMANOID)


def in_order(motion: Motion, names: list[str] | None = None) -> Array:
    """Positions (T, N, 3) of joints called so, of the humanoid's where not given."""
    skeleton = skeleton_of(motion)
    return positions(motion)[:, [skeleton.index(name) for name in names or HUMANOID.names]]


BONE_INDICES = [HUMANOID.index(bone) for bone in BONES]


def write_gltf(path: Path, document: dict[str, Any], binary: bytes = b"") -> Path:
    path.with_suffix(".bin").write_bytes(binary)
    document["buffers"] = [{"byteLength": len(binary), "uri": path.with_suffix(".bin").name}]
    path.write_text(json.dumps(document))
    return path


def test_what_is_written_as_glb_is_read_again(tmp_path: Path) -> None:
    motion = moving()
    glb.write(tmp_path / "a.glb", motion)
    again = gltf.read(tmp_path / "a.glb")
    assert again.fps == 24
    assert again.skeleton is not None
    assert set(again.skeleton.names) == set(HUMANOID.names)
    np.testing.assert_allclose(in_order(again), in_order(motion), atol=1e-6)


def test_vrma_holds_the_bones_of_the_humanoid(tmp_path: Path) -> None:
    glb.write_vrma(tmp_path / "a.vrma", moving())
    document, _ = parts(tmp_path / "a.vrma")
    extension = document["extensions"]["VRMC_vrm_animation"]
    assert extension["specVersion"] == "1.0"
    bones = {bone: document["nodes"][place["node"]] for bone, place in extension["humanoid"]["humanBones"].items()}
    fingers = glb.VRMA_SKELETON.names[len(HUMANOID.names) :]
    assert len(fingers) == 30
    assert {bone: node["name"] for bone, node in bones.items()} == {bone: bone for bone in (*BONES, *fingers)}
    assert bones["hips"]["translation"] == [0.0, 0.98, 0.0]
    assert not any("scale" in node or "rotation" in node for node in document["nodes"])
    moved = [c["target"]["node"] for c in document["animations"][0]["channels"] if c["target"]["path"] == "translation"]
    assert moved == [0]
    written = gltf.read(tmp_path / "a.vrma")
    turns = local_rotations(written)[:, [written.skeleton.index(bone) for bone in fingers]]
    bends = np.degrees(np.linalg.norm(rotmat_to_rotvec(turns), axis=-1))
    assert np.ptp(bends, axis=0).max() < 1e-4
    assert 5 < bends.min() < bends.max() < 35
    np.testing.assert_allclose(in_order(written), in_order(grounded(moving())), atol=1e-6)
    lowest = sole_points(*global_transforms(to_humanoid(written).motion))
    assert ground_under(lowest) == pytest.approx(0, abs=1e-6)


def test_vrma_takes_any_human_figure(tmp_path: Path) -> None:
    source = read_motion(SKELETONS / "lafan1.bvh")
    glb.write_vrma(tmp_path / "a.vrma", source)
    written = gltf.read(tmp_path / "a.vrma")
    np.testing.assert_allclose(in_order(written), in_order(to_humanoid(source).motion), atol=1e-5)
    with pytest.raises(MotionError, match="no frames"):
        glb.write_vrma(tmp_path / "b.vrma", moving()[:0])
    assert not (tmp_path / "b.vrma").exists()


def twisted(path: Path) -> Path:
    """A VRM 1 avatar of the humanoid's proportions, its bones with rest rotations of their own, under a scale."""
    random = np.random.default_rng(1)
    quats = random.normal(size=(len(HUMANOID.names), 4))
    quats /= np.linalg.norm(quats, axis=1, keepdims=True)
    turns = quat_to_rotmat(quats)
    nodes: list[dict[str, Any]] = [{"name": "Armature", "scale": [0.01] * 3, "children": [1]}]
    for i, joint in enumerate(HUMANOID.joints):
        above = turns[joint.parent] if i else np.eye(3)
        local = above.T @ turns[i]
        quat = rotmat_to_quat(local).tolist()
        children = {"children": [k + 1 for k in HUMANOID.children[i]]} if HUMANOID.children[i] else {}
        move = (100 * above.T @ np.array(joint.offset)).tolist()
        nodes.append({"name": f"J_{i}", "translation": move, "rotation": quat} | children)
    bones = {bone: {"node": HUMANOID.index(bone) + 1} for bone in BONES}
    vrm = {"VRMC_vrm": {"specVersion": "1.0", "humanoid": {"humanBones": bones}}}
    return write_gltf(path, {"asset": {"version": "2.0"}, "nodes": nodes, "extensions": vrm})


def test_an_avatar_with_rest_rotations_of_its_own_moves_as_the_humanoid(tmp_path: Path) -> None:
    avatar = twisted(tmp_path / "avatar.vrm")
    still = gltf.read(avatar)
    assert len(still) == 1
    np.testing.assert_allclose(in_order(still, list(BONES))[0], T_POSE[BONE_INDICES], atol=1e-6)
    character = read_character(avatar)
    motion = moving()
    out = from_humanoid(motion, character.rest, character.joint_map)
    assert out.skeleton is not None
    assert out.skeleton.names[0] == "J_0"
    place, expected = in_order(out, [f"J_{i}" for i in BONE_INDICES]), in_order(motion, list(BONES))
    np.testing.assert_allclose(place - place[:1, :1], expected - expected[:1, :1], atol=2e-6)
    # every angle 0 is the pose that the nodes rest in
    rest = from_humanoid(to_humanoid(still).motion, character.rest, character.joint_map)
    np.testing.assert_allclose(global_transforms(rest)[0], global_transforms(character.rest)[0], atol=1e-6)


def test_vrm_0_is_read_too(tmp_path: Path) -> None:
    document, binary = parts(moving_glb(tmp_path))
    bones = [{"bone": bone, "node": HUMANOID.index(bone)} for bone in BONES]
    bones += [{"bone": "jaw", "node": -1}]  # as UniVRM writes what is not set
    document["extensions"] = {"VRM": {"humanoid": {"humanBones": bones}}}
    for i, node in enumerate(document["nodes"]):
        node["name"] = f"n{i}"
    humanoid = to_humanoid(gltf.read(write_gltf(tmp_path / "old.vrm", document, binary)))
    assert humanoid.convention == "Unity Humanoid, VRM"
    np.testing.assert_allclose(positions(humanoid.motion)[:, 0, 0], positions(moving())[:, 0, 0], atol=1e-5)


def moving_glb(folder: Path) -> Path:
    glb.write(folder / "a.glb", moving())
    return folder / "a.glb"


@pytest.mark.parametrize("kind", ["STEP", "CUBICSPLINE"])
def test_interpolations_are_those_of_the_standard(tmp_path: Path, kind: str) -> None:
    document, binary = parts(moving_glb(tmp_path))
    animation = document["animations"][0]
    track = next(c for c in animation["channels"] if c["target"] == {"node": 0, "path": "translation"})
    times = np.array([0.0, 0.05, 0.1], "<f4")
    values = np.array([[0, 1, 0], [1, 1, 0], [2, 1, 0]], "<f4")
    if kind == "CUBICSPLINE":  # tangents of a straight line
        slopes = np.broadcast_to(np.array([20, 0, 0], "<f4"), (3, 3))
        values = np.stack([slopes, values, slopes], axis=1).reshape(-1, 3)
    start = len(binary) + (-len(binary) % 4)
    binary = binary.ljust(start, b"\0") + times.tobytes() + values.astype("<f4").tobytes()
    document["bufferViews"] += [
        {"buffer": 0, "byteOffset": start, "byteLength": 12},
        {"buffer": 0, "byteOffset": start + 12, "byteLength": values.size * 4},
    ]
    views = len(document["bufferViews"])
    document["accessors"] += [
        {"bufferView": views - 2, "componentType": 5126, "count": 3, "type": "SCALAR"},
        {"bufferView": views - 1, "componentType": 5126, "count": len(values), "type": "VEC3"},
    ]
    accessors = len(document["accessors"])
    animation["samplers"].append({"input": accessors - 2, "output": accessors - 1, "interpolation": kind})
    animation["channels"] = [track | {"sampler": len(animation["samplers"]) - 1}]
    motion = gltf.read(write_gltf(tmp_path / f"{kind}.gltf", document, binary))
    assert motion.fps == 20
    expected = [0.0, 1.0, 2.0]
    np.testing.assert_allclose(motion.values[:, motion.channels.index("hips.tx")], expected, atol=1e-6)


def test_broken_files_are_refused_in_words(tmp_path: Path) -> None:
    good = moving_glb(tmp_path)
    content = good.read_bytes()
    cases = {
        "truncated.glb": (content[:3000], "truncated GLB"),
        "text.glb": (b"no json", "not a glTF file"),
        "old.gltf": (b'{"asset": {"version": "1.0"}}', "version 1.0: expected 2.0"),
        "empty.gltf": (b'{"asset": {"version": "2.0"}}', "no skeleton: expected a skin with joints"),
        "ring.gltf": (
            b'{"asset": {"version": "2.0"}, "nodes":[{"children":[1]},{"children":[0]}],"skins":[{"joints":[0]}]}',
            "not a tree",
        ),
        "wrong.gltf": (b'{"asset": {"version": "2.0"}, "nodes": 5, "skins": [{"joints": [0]}]}', "broken glTF"),
    }
    for name, (bad, reason) in cases.items():
        (tmp_path / name).write_bytes(bad)
        with pytest.raises(FormatError, match=reason):
            gltf.read(tmp_path / name)
    document, binary = parts(good)
    del document["skins"], document["animations"]
    with pytest.raises(FormatError, match="no skeleton: expected a skin"):
        gltf.read(write_gltf(tmp_path / "skinless.gltf", document, binary))
    document, binary = parts(good)
    with pytest.raises(FormatError, match="truncated"):
        gltf.read(write_gltf(tmp_path / "short.gltf", document, binary[:1000]))


def test_mixamo_has_the_humanoids_proportions() -> None:
    motion = moving()
    out = from_humanoid(motion, MIXAMO)
    assert out.skeleton is not None
    assert out.skeleton.names[:2] == ("mixamorig:Hips", "mixamorig:Spine")
    np.testing.assert_allclose(positions(out) * 0.01, positions(motion), atol=1e-9)
    assert to_humanoid(out).convention == "Mixamo"


def test_a_file_object_is_read_and_its_buffer_must_be_in_it(tmp_path: Path) -> None:
    motion = moving()
    glb.write(tmp_path / "a.glb", motion)
    content = (tmp_path / "a.glb").read_bytes()
    np.testing.assert_array_equal(gltf.read(BytesIO(content)).values, gltf.read(tmp_path / "a.glb").values)
    beside = write_gltf(tmp_path / "b.gltf", *parts(tmp_path / "a.glb"))
    np.testing.assert_array_equal(gltf.read(beside).values, gltf.read(tmp_path / "a.glb").values)
    with pytest.raises(FormatError, match=r"its buffer 'b.bin' is a separate file, which requires a .gltf"):
        gltf.read(BytesIO(beside.read_bytes()))
    beside.with_suffix(".bin").unlink()
    with pytest.raises(FormatError, match=r"b.gltf: its buffer 'b.bin' is not a file in its folder"):
        gltf.read(beside)


@pytest.mark.parametrize("extension", [".gltf", ".glb", ".vrm", ".vrma"])
@pytest.mark.parametrize("way", ["absolute", "../", "%2e%2e%2f", "..%2F", "link", "sub/../../", "folder", "pipe"])
def test_a_buffer_is_no_file_outside_of_the_folder(tmp_path: Path, way: str, extension: str) -> None:
    document, binary = parts(moving_glb(tmp_path))
    secret, inside = tmp_path / "secret.bin", tmp_path / "inside"
    secret.write_bytes(binary)
    (inside / "sub").mkdir(parents=True)
    (inside / "link").symlink_to(secret)
    os.mkfifo(inside / "pipe")
    uri = {"absolute": str(secret), "link": "link", "folder": "sub", "pipe": "pipe"}.get(way, f"{way}secret.bin")
    document["buffers"] = [{"byteLength": len(binary), "uri": uri}]
    file = inside / f"a{extension}"
    file.write_bytes(json.dumps(document).encode() if extension == ".gltf" else glb.container(document, b""))
    with pytest.raises(FormatError, match=r"is not a file in its folder|requires a \.gltf"):
        read_motion(file)


def test_of_a_buffer_no_more_is_read_than_it_declares(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    document, binary = parts(moving_glb(tmp_path))
    file = write_gltf(tmp_path / "b.gltf", document, binary)
    (tmp_path / "b.bin").write_bytes(binary + b"secret")
    assert gltf_data.parse(file).buffers == (binary,)
    document["buffers"][0]["byteLength"] = 100
    file.write_text(json.dumps(document))
    assert gltf_data.parse(file).buffers == (binary[:100],)
    monkeypatch.setattr(gltf_data, "GLTF_MAX_BYTES", 1000)
    document["buffers"] *= 11
    file.write_text(json.dumps(document))
    with pytest.raises(FormatError, match="over 1000 bytes in total"):
        gltf_data.parse(file)


def test_a_file_of_many_alike_nodes_is_read_in_time_that_grows_with_it(tmp_path: Path) -> None:
    nodes: list[dict[str, Any]] = [{"name": "x", "children": [i + 1]} for i in range(1_999)] + [{"name": "x"}]
    document = {"asset": {"version": "2.0"}, "nodes": nodes, "skins": [{"joints": list(range(2_000))}]}
    (tmp_path / "deep.gltf").write_text(json.dumps(document))
    motion = gltf.read(tmp_path / "deep.gltf")
    assert motion.skeleton is not None
    assert motion.skeleton.names[-1] == "x_2000"
    long = document | {"nodes": [{"children": [i + 1]} for i in range(4_000)] + [{}]}
    for skins, said in (
        ([{"joints": [0, 4_000]}], "its skeleton has 4001 joints"),
        ([{}] * 1_001, "it has 1001 skins"),
    ):
        (tmp_path / "long.gltf").write_text(json.dumps(long | {"skins": skins}))
        with pytest.raises(FormatError, match=said):
            gltf.read(tmp_path / "long.gltf")
    nodes *= 20
    (tmp_path / "deep.gltf").write_text(json.dumps(document))
    with pytest.raises(FormatError, match="it has 40000 nodes"):
        gltf.read(tmp_path / "deep.gltf")


def test_arrays_that_overlap_are_refused(tmp_path: Path) -> None:
    document, binary = parts(moving_glb(tmp_path))
    animation, accessors = document["animations"][0], document["accessors"]
    sampler, channel = animation["samplers"][0], animation["channels"][0]
    own = range(len(accessors), len(accessors) + 5_000)  # an accessor for each sampler, all of the same place
    accessors += [accessors[sampler["output"]]] * len(own)
    animation["samplers"] = [sampler | {"output": index} for index in own]
    animation["channels"] = [channel | {"sampler": index} for index in range(len(own))]
    with pytest.raises(FormatError, match="its arrays overlap"):
        gltf.read(write_gltf(tmp_path / "many.gltf", document, binary))


def test_a_name_that_is_no_text_is_refused(tmp_path: Path) -> None:
    document, binary = parts(moving_glb(tmp_path))
    document["nodes"][0]["name"] = 64
    with pytest.raises(FormatError, match="the name of node 0 is not text"):
        gltf.read(write_gltf(tmp_path / "number.gltf", document, binary))


def test_an_animation_without_end_is_refused(tmp_path: Path) -> None:
    document, binary = parts(moving_glb(tmp_path))
    times = document["accessors"][document["animations"][0]["samplers"][0]["input"]]
    start = document["bufferViews"][times["bufferView"]]["byteOffset"] + 4 * (times["count"] - 1)
    binary = binary[:start] + struct.pack("<f", 1e9) + binary[start + 4 :]
    with pytest.raises(FormatError, match=r"1e\+09 s at 24 fps is too many frames"):
        gltf.read(write_gltf(tmp_path / "long.gltf", document, binary))
    binary = binary[:start] + struct.pack("<f", 1e5) + binary[start + 4 :]  # within reason, but for its 30 kB
    with pytest.raises(FormatError, match="100000 s at 24 fps is too many frames"):
        gltf.read(write_gltf(tmp_path / "sparse.gltf", document, binary))
