"""FBX as ufbx and motet read it, against kinematics by plain matrices."""

import io
import logging
import random
import subprocess
import sys
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from fbx_files import Bone, Curves, ascii_fbx, binary_fbx, document, places, turned

import motet
from motet.errors import FormatError
from motet.formats import fbx, read_character
from motet.motion.motion import Motion
from motet.motion.rotations import Array

ARM = (
    Bone("Armature", -1, (3.0, 0.0, 5.0), (0.0, 90.0, 0.0), kind="Null"),
    Bone("hips", 0, (0.0, 90.0, 0.0), (10.0, 20.0, 30.0)),
    Bone("spine", 1, (0.0, 40.0, 0.0), (0.0, 5.0, 0.0), pre=(0.0, 0.0, 25.0)),
    Bone("arm", 2, (15.0, 5.0, 0.0), (0.0, 0.0, -70.0), pre=(-30.0, 60.0, 0.0), order=4),
    Bone("hand", 3, (50.0, 0.0, 2.0), order=5),
    Bone("leg", 1, (-9.0, -2.0, 0.0), (180.0, 0.0, 0.0), order=1),
    Bone("foot", 5, (0.0, 42.0, 0.0)),
)
Y_UP = {"UpAxis": 1, "UpAxisSign": 1, "FrontAxis": 2, "FrontAxisSign": 1, "CoordAxis": 0, "CoordAxisSign": 1}
Z_UP = {"UpAxis": 2, "UpAxisSign": 1, "FrontAxis": 1, "FrontAxisSign": -1, "CoordAxis": 0, "CoordAxisSign": 1}


def swing(name: str = "Walk", frames: int = 13, fps: float = 24.0, bone: int = 1) -> Curves:
    """A take in which a bone moves and turns and two others turn."""
    time = np.arange(frames) / fps
    turns = {(i, "R"): 40 * np.sin(np.stack([time + i, 2 * time, 3 * time - i], axis=1)) for i in (bone, 3, 5)}
    return Curves(name, list(time), turns | {(bone, "T"): np.stack([30 * time, 90 - time, 60 * time], axis=1)})


def settings(axes: dict[str, int], centimetres: float = 1.0, mode: int = 11) -> dict[str, float]:
    """mode: FBX's number of a frame rate; 11 is 24 fps, 6 is 30, 3 is 60."""
    return {**axes, "UnitScaleFactor": centimetres, "TimeMode": mode}


def load(content: bytes, clip: str | int | None = None) -> Motion:
    pytest.importorskip("ufbx")
    return motet.read(io.BytesIO(content), format="fbx", clip=clip)


def check(motion: Motion, expected: Array, names: list[str], **tolerances: Any) -> None:
    assert motion.skeleton is not None
    found = motet.motion.positions(motion)[:, [motion.skeleton.names.index(name) for name in names]]
    np.testing.assert_allclose(found, expected, **({"atol": 1e-5} | tolerances))


@pytest.mark.parametrize("encode", [ascii_fbx, binary_fbx])
@pytest.mark.parametrize(("axes", "unit"), [(Y_UP, 1.0), (Z_UP, 2.54), (Y_UP, 100.0)])
def test_joints_are_where_plain_matrices_put_them(encode: Any, axes: dict[str, int], unit: float) -> None:
    take = swing()
    motion = load(encode(document(ARM, [take], settings(axes, unit))))
    expected = places(ARM, take, take.times)[:, 1:] * unit / 100
    if axes is Z_UP:
        expected = np.stack([expected[..., 0], expected[..., 2], -expected[..., 1]], axis=-1)
    check(motion, expected, [bone.name for bone in ARM[1:]], atol=3e-6 * unit)
    assert (motion.fps, len(motion), motion.skeleton and motion.skeleton.metres_per_unit) == (24.0, 13, 1.0)


def test_takes_are_clips_in_any_script() -> None:
    lengths = {"歩く/1": 9, "Run|Run": 12, "歩く/2": 5}
    takes = [replace(swing(frames=frames), name=name) for name, frames in lengths.items()]
    camera = Bone("camera", -1, (0.0, 0.0, 0.0), kind="Camera")
    look = Curves("camera", [0.0, 1.0], {(len(ARM), "T"): np.eye(3)[:2]})
    content = ascii_fbx(document([*ARM, camera], [look, *takes, replace(look, name="none", values={})], settings(Y_UP)))
    pytest.importorskip("ufbx")
    assert fbx.contents(io.BytesIO(content)).clips == tuple(lengths)
    for number, (name, frames) in enumerate(lengths.items(), start=1):
        assert len(load(content, name if number % 2 else number)) == frames
    with pytest.raises(FormatError, match="no clip 'Jump': expected '歩く/1', "):
        load(content, "Jump")


def test_a_clip_is_named_behind_the_path(tmp_path: Path) -> None:
    pytest.importorskip("ufbx")
    path = tmp_path / "a.fbx"
    path.write_bytes(binary_fbx(document(ARM, [swing("a/b", 9), swing("c", 12)], settings(Y_UP))))
    assert motet.clips(path) == ("a/b", "c")
    assert [len(motet.read(f"{path}#{clip}")) for clip in ("a/b", "c", "2")] == [9, 12, 12]


def test_a_few_curves_of_dense_keys_do_not_tell_the_rate() -> None:
    """As those that a program baked at 300 a second, among a figure's at the file's own rate."""
    pytest.importorskip("ufbx")
    from motet.formats import fbx_to_gltf

    def curve(fps: float) -> Any:
        return SimpleNamespace(keyframes=[SimpleNamespace(time=i / fps) for i in range(round(fps) + 1)])

    scene: Any = SimpleNamespace(scene=SimpleNamespace(settings=SimpleNamespace(frames_per_second=30.0)))
    for dense, wanted in ((3, 30.0), (7, 300.0)):
        take: Any = SimpleNamespace(curves=[curve(300)] * dense + [curve(30)] * (10 - dense))
        fps, note = fbx_to_gltf.frame_rate(scene, take)
        assert fps == pytest.approx(wanted)
        assert bool(note) == (wanted == 300.0)
    still: Any = SimpleNamespace(curves=[])
    assert fbx_to_gltf.frame_rate(scene, still) == (30.0, "")
    scene.scene.settings.frames_per_second = 1e6
    assert fbx_to_gltf.frame_rate(scene, still) == (
        30.0,
        "it states 1e+06 fps: reading 30, as rates are above 0 and at most 1000",
    )


def test_keys_denser_than_the_file_s_rate_tell_the_rate(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING, "motet"):
        assert load(ascii_fbx(document(ARM, [swing(frames=121, fps=120)], settings(Y_UP)))).fps == 120.0
    assert [record.message for record in caplog.records] == [
        "<file object>: it states 24 fps, but most of its curves have 120 keys a second: reading these"
    ]
    sparse = swing(frames=5, fps=2)
    motion = load(ascii_fbx(document(ARM, [sparse], settings(Y_UP, mode=6))))
    assert (motion.fps, len(motion)) == (30.0, 61)
    check(motion, places(ARM, sparse, np.arange(61) / 30)[:, 1:] / 100, [bone.name for bone in ARM[1:]])


def test_a_take_lasts_as_long_as_its_keys() -> None:
    for span in ((-5.0, 9.0), (0.0, 0.0)):
        assert len(load(ascii_fbx(document(ARM, [replace(swing(), span=span)], settings(Y_UP))))) == 13
    assert len(load(ascii_fbx(document(ARM, [replace(swing(), span=(0.125, 0.25))], settings(Y_UP))))) == 4
    assert len(load(ascii_fbx(document(ARM, [swing(frames=1)], settings(Y_UP))))) == 1


def test_without_a_take_it_is_the_rest_pose() -> None:
    motion = load(binary_fbx(document(ARM, [], settings(Y_UP))))
    rest = places(ARM, Curves("", [], {}), [0.0])[:, 1:] / 100
    check(motion, rest, [bone.name for bone in ARM[1:]])
    np.testing.assert_allclose(motion.values[:, 3:], 0, atol=1e-9)


def test_a_skin_rests_as_it_is_bound() -> None:
    """Every bone is bound as a T-pose has it, whatever the pose that the nodes were saved in."""
    straight = [replace(bone, turn=(0.0, 0.0, 0.0), pre=(0.0, 0.0, 0.0)) for bone in ARM]
    offsets = places(straight, Curves("", [], {}), [0.0])[0]
    bound = {}
    for i in range(1, len(ARM)):
        bound[i] = np.eye(4)
        bound[i][:3, :3] = turned((0.0, 0.0, 15.0 * i), 0)
        bound[i][:3, 3] = offsets[i]
    take = swing()
    motion = load(binary_fbx(document(ARM, [take], settings(Y_UP), bound)))
    assert motion.skeleton is not None
    for i, joint in enumerate(motion.skeleton.joints[1:], start=1):
        at = [bone.name for bone in ARM].index(joint.name)
        np.testing.assert_allclose(joint.offset, np.array(ARM[at].place) / 100, atol=1e-6, err_msg=f"{i}")
    check(motion, places(ARM, take, take.times)[:, 1:] / 100, [bone.name for bone in ARM[1:]])


def test_the_rest_pose_can_be_that_of_another_file(tmp_path: Path) -> None:
    pytest.importorskip("ufbx")
    straight = [replace(bone, turn=(0.0, 0.0, 0.0), pre=(0.0, 0.0, 0.0)) for bone in ARM]
    (tmp_path / "rest.fbx").write_bytes(binary_fbx(document(straight, [], settings(Y_UP))))
    take = swing()
    (tmp_path / "a.fbx").write_bytes(binary_fbx(document(ARM, [take], settings(Y_UP))))
    motion = motet.read(tmp_path / "a.fbx", rest=tmp_path / "rest.fbx")
    assert motion.skeleton is not None
    offsets = {bone.name: np.array(bone.place) / 100 for bone in ARM}
    for joint in motion.skeleton.joints[1:]:
        np.testing.assert_allclose(joint.offset, offsets[joint.name], atol=1e-6)
    check(motion, places(ARM, take, take.times)[:, 1:] / 100, [bone.name for bone in ARM[1:]])


def test_of_two_skeletons_the_one_that_moves_is_taken(caplog: pytest.LogCaptureFixture) -> None:
    still = [replace(bone, name=f"still_{bone.name}", parent=bone.parent and bone.parent + 10) for bone in ARM[1:]]
    bones = [*ARM, *(replace(bone, parent=-1 if bone.parent <= 0 else bone.parent - 4) for bone in still)]
    with caplog.at_level(logging.WARNING, "motet"):
        motion = load(ascii_fbx(document(bones, [swing()], settings(Y_UP))))
    assert motion.skeleton is not None
    assert motion.skeleton.names[0] == "hips"
    assert [record.message for record in caplog.records] == [
        "<file object>: of 2 skeletons, reading that of 'hips', which moves the most; figure= or --figure takes another"
    ]


def test_a_character_of_fbx_takes_motions(tmp_path: Path) -> None:
    pytest.importorskip("ufbx")
    path = tmp_path / "a.fbx"
    path.write_bytes(ascii_fbx(document(ARM, [swing()], settings(Z_UP))))
    character = read_character(path)
    assert character.rest.skeleton is not None
    assert character.rest.skeleton.names == tuple(bone.name for bone in ARM[1:])


def test_without_the_extra_it_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fbx, "find_spec", lambda name: None)
    with pytest.raises(FormatError, match=r"install the extra with  pip install 'motet\[fbx\]'"):
        motet.read(io.BytesIO(b""), format="fbx")


def test_a_file_that_is_too_large_is_not_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fbx, "FBX_MAX_BYTES", 1000)
    (tmp_path / "a.fbx").write_bytes(bytes(1001))
    for file in (tmp_path / "a.fbx", io.BytesIO(bytes(1001))):
        with pytest.raises(FormatError, match="too large: expected at most 1000 bytes"):
            motet.read(file, format="fbx")


@pytest.mark.parametrize(
    ("program", "said"),
    [
        ("import os, signal; os.kill(os.getpid(), signal.SIGTERM)", "ufbx crashes on it"),
        ("import time; time.sleep(60)", "reading it takes over 0.2 s"),
        ("import sys; sys.stderr.write('why'); sys.exit(1)", "broken FBX file: why"),
    ],
)
def test_a_process_that_breaks_down_is_a_broken_file(
    program: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("ufbx")
    (tmp_path / "program.py").write_text(program)
    monkeypatch.setattr(fbx, "FBX_PROGRAM", tmp_path / "program.py")
    monkeypatch.setattr(fbx, "FBX_SECONDS", 0.2 if "sleep" in program else 60)
    with pytest.raises(FormatError, match=said):
        load(b"")


def test_without_an_interpreter_it_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fbx, "find_spec", lambda name: True)
    monkeypatch.setattr(fbx.sys, "executable", "/no/python")
    with pytest.raises(FormatError, match="cannot start a process to read it: No such file"):
        motet.read(io.BytesIO(b""), format="fbx")


def test_broken_files_are_refused() -> None:
    whole = binary_fbx(document(ARM, [swing()], settings(Y_UP)))
    long = Curves("Walk", [0.0, 1e7], {(1, "R"): np.eye(3)[:2]})
    for content, said in (
        (b"", "broken FBX file"),
        (b"\0" * 100, "broken FBX file"),
        (b"v 0 0 0\nf 1 1 1\n", "broken FBX file|no skeleton"),
        (whole[: len(whole) // 2], "broken FBX file"),
        (ascii_fbx(document(ARM, [long], settings(Y_UP))), "1e.07 s at 24 fps is too many frames"),
        (ascii_fbx(document([], [], settings(Y_UP))), "no skeleton"),
    ):
        with pytest.raises(FormatError, match=said):
            load(content)


def test_mutants_are_read_or_refused() -> None:
    whole, chance = binary_fbx(document(ARM, [swing()], settings(Y_UP))), random.Random(5)
    for _ in range(8):
        mutant = bytearray(whole)
        for _ in range(chance.choice([1, 4, 40])):
            mutant[chance.randrange(len(mutant))] = chance.randrange(256)
        with suppress(FormatError):
            assert len(load(bytes(mutant))) > 0


def test_files_of_other_makers(shared: Path) -> None:
    pytest.importorskip("ufbx")
    if not (shared / "figures" / "mixamo-rig.fbx").exists():
        pytest.skip("needs ../shared/data/figures")
    for name, frames, unit, maker in (
        ("cmu_91_48", 110, "cm", "CMU in BVH, 43 joints (Poser, DAZ)"),
        ("mixamo-rig", 148, None, "Mixamo"),
    ):
        human = motet.motion.to_humanoid(motet.read(shared / "figures" / f"{name}.fbx", unit=unit))
        assert (human.convention, human.confidence, len(human.motion)) == (maker, 1.0, frames)
        assert abs(motet.motion.positions(human.motion)[..., 1].min()) < 0.02


UFBX = """
class Anything:
    def __getattr__(self, name):
        return self

def __getattr__(name):
    return Anything()

def load_memory(content, **settings):
    bytearray(2**28 + 33 * len(content))
    raise ValueError("it fits")
"""


@pytest.mark.skipif(sys.platform != "linux", reason="limits of memory are Linux's")
def test_the_memory_of_the_process_is_bounded_by_the_size_of_the_file(tmp_path: Path) -> None:
    (tmp_path / "ufbx.py").write_text(UFBX)
    command = [sys.executable, "-P", str(fbx.FBX_PROGRAM), "0"]
    environment = {"PYTHONPATH": str(tmp_path)}
    done = subprocess.run(command, input=bytes(1000), env=environment, capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (1, b"MemoryError")


@pytest.mark.parametrize(
    ("nodes", "seconds", "size", "fits"),
    [
        (10, 332, 0, True),
        (10, 335, 0, False),
        (10, 335, 10_000, True),
        (100, 3_330, 10**9, True),
        (100, 3_340, 10**9, False),
    ],
)
def test_frames_are_bounded_by_the_size_of_the_file(nodes: int, seconds: float, size: int, fits: bool) -> None:
    pytest.importorskip("ufbx")
    from motet.formats import fbx_to_gltf

    rate = SimpleNamespace(settings=SimpleNamespace(frames_per_second=30.0))
    scene: Any = SimpleNamespace(size=size, near=range(nodes), scene=rate)
    curve = SimpleNamespace(min_time=0.0, max_time=seconds, keyframes=())
    take: Any = SimpleNamespace(curves=[curve], stack=SimpleNamespace(time_begin=0.0, time_end=seconds))
    if fits:
        assert len(fbx_to_gltf.frame_times(scene, take)) == 30 * seconds + 1
        return
    with pytest.raises(ValueError, match=f"{seconds} s at 30 fps is too many frames"):
        fbx_to_gltf.frame_times(scene, take)
