"""Other figures on the command line: --humanoid, --map, --like, and VRM Animation as an output."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from command_line import check_refused, run
from small_character import character
from test_retarget import SKELETONS

import motet
from motet.motion import HUMANOID

MIXAMO = SKELETONS / "mixamo.bvh"


def test_convert_brings_a_file_to_the_humanoid_and_says_what_it_found(tmp_path: Path) -> None:
    out = tmp_path / "a.npz"
    result = run("-v", "convert", SKELETONS / "rokoko.bvh", out, "--humanoid")
    assert result.exit_code == 0
    assert "motet: brought to the humanoid: joints of Rokoko, confidence 1.00" in result.stderr
    assert motet.read(out).skeleton == HUMANOID
    assert run("convert", SKELETONS / "rokoko.bvh", out, "--humanoid").stderr == ""


def human(motion: motet.Motion) -> motet.Motion:
    return motet.to_humanoid(motion).motion


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (("--like", MIXAMO), lambda motion: motet.from_humanoid(human(motion), motet.read(MIXAMO))),
        (("--hold-feet",), lambda motion: motet.motion.hold_feet(human(motion))),
        (
            ("--hold-feet", "--like", MIXAMO),
            lambda motion: motet.from_humanoid(motet.motion.hold_feet(human(motion)), motet.read(MIXAMO)),
        ),
        (("--fps", 30, "--loop"), lambda motion: motet.motion.looped(motion.resample(30))),
    ],
)
def test_convert_gives_what_the_library_gives(
    options: tuple[object, ...], expected: Callable[[motet.Motion], motet.Motion], tmp_path: Path, clips: Path
) -> None:
    out, source = tmp_path / "a.npz", clips / "39_14.amc"
    assert run("convert", source, out, *options).exit_code == 0
    np.testing.assert_array_equal(motet.read(out).values, expected(motet.read(source)).values)


def test_a_motion_without_a_loop_is_refused(tmp_path: Path, clips: Path) -> None:
    refused = run("convert", clips / "02_06.amc", tmp_path / "b.npz", "--loop")
    check_refused(refused, "02_06.amc: no loop found", tmp_path, code=1)


def test_a_map_says_which_joint_is_which(tmp_path: Path) -> None:
    plain = motet.read(MIXAMO)
    found = motet.to_humanoid(plain).joints
    entries = {bone: list(names) if bone in ("spine", "neck") else names[0] for bone, names in found.items()}
    (tmp_path / "map.json").write_text(json.dumps(entries))
    out = tmp_path / "a.npz"
    result = run("-v", "convert", MIXAMO, out, "--map", tmp_path / "map.json")
    assert result.exit_code == 0
    assert "joints of map.json, confidence 1.00" in result.stderr
    np.testing.assert_allclose(motet.read(out).values, motet.to_humanoid(plain).motion.values, atol=1e-9)


def test_results_are_put_onto_a_character(tmp_path: Path, clips: Path) -> None:
    names = motet.read(MIXAMO).skeleton.names
    for command in (
        ("generate", "a person walks", "--max-seconds", 2),
        ("predict", clips / "39_14.amc", "--frames", 5),
        ("control", "walk .5s"),
    ):
        out = tmp_path / f"{command[0]}.bvh"
        assert run(*command, "-o", out, "--like", MIXAMO).exit_code == 0
        assert motet.read(out).skeleton.names[0] == "mixamorig_Hips"
        assert len(motet.read(out).skeleton.names) == len(names)
    page = tmp_path / "control.html"
    assert run("control", "walk .5s", "-o", page, "--like", MIXAMO).exit_code == 0
    other = tmp_path / "other.html"
    assert run("control", "walk .5s", "-o", other).exit_code == 0
    assert page.read_text() != other.read_text()


def test_generate_writes_a_character_with_a_clip_for_each_sentence(tmp_path: Path) -> None:
    avatar, out = character(tmp_path / "avatar.glb", [{"scale": [0.01] * 3}]), tmp_path / "out.glb"
    texts = ("a person walks", "a person jumps", "a person jumps")
    result = run("generate", *texts, "--max-seconds", 2, "--onto", avatar, "-o", out)
    assert result.exit_code == 0
    assert result.stdout.count("out.glb: ") == 3
    assert motet.clips(out) == ("a person walks", "a person jumps", "a person jumps_2", "old")
    found = motet.load("generate").generate(texts, seed=[0, 1, 2], max_seconds=2)
    names = motet.clips(out)[:3]
    motions = {name: best.motion for name, (best, *_) in zip(names, found, strict=True)}
    motet.write(tmp_path / "library.glb", motions, onto=avatar)
    assert (tmp_path / "library.glb").read_bytes() == out.read_bytes()
    assert (
        run("generate", *texts[:2], "--max-seconds", 2, "--onto", avatar, "-o", tmp_path / "{name}.glb").exit_code == 0
    )
    assert [motet.clips(tmp_path / f"{n}.glb")[0] for n in (1, 2)] == list(texts[:2])


def test_convert_writes_a_character_with_a_clip_for_each_file(tmp_path: Path) -> None:
    avatar, out = character(tmp_path / "avatar.glb"), tmp_path / "out.glb"
    sources = (SKELETONS / "rokoko.bvh", f"{avatar}#old", SKELETONS / "unreal.bvh", tmp_path / "none.bvh")
    result = run("convert", *sources, "--unit", "cm", "--mirror", "--onto", avatar, "-o", out)
    assert result.exit_code == 1
    assert "none.bvh: no such file" in result.stderr
    assert motet.clips(out) == ("rokoko", "old", "unreal")
    assert run("convert", SKELETONS / "rokoko.bvh", "--onto", avatar, "-o", tmp_path / "{name}.glb").exit_code == 0
    assert motet.clips(tmp_path / "rokoko.glb") == ("rokoko", "old")


def test_every_command_writes_a_character(tmp_path: Path, clips: Path) -> None:
    avatar, source = character(tmp_path / "avatar.glb"), clips / "39_14.amc"
    for name, command in {
        "39_14": ("predict", source, "--frames", 5),
        "39_14 ": ("fill", source, "--gap", "1:1.5"),
        "39_14 39_14": ("join", source, source),
        "walk .5s": ("control", "walk .5s"),
    }.items():
        out = tmp_path / f"{command[0]}.glb"
        assert run(*command, "-o", out, "--onto", avatar).exit_code == 0
        assert motet.clips(out) == (name.strip(), "old")


def test_what_cannot_be_written_onto_is_said_before_work(tmp_path: Path, out: Path) -> None:
    avatar = character(tmp_path / "avatar.glb")
    for options, said in (
        (("--onto", avatar, "-o", out / "a.bvh"), "cannot write files of type '.bvh'; expected one of .glb .vrm"),
        (("--onto", "mixamo", "-o", out / "a.glb"), "--onto takes a character with its mesh (.glb .gltf .vrm)"),
        (("--onto", avatar, "--like", avatar, "-o", out / "a.glb"), "give one of the two"),
        (("--onto", tmp_path / "none.glb", "-o", out / "a.glb"), "none.glb: no such file"),
        (("--onto", avatar, "-o", out / "a.vrm"), "avatar.glb: not a VRM avatar: write it to a .glb"),
        (("--onto", avatar, "-o", avatar), "avatar.glb is an input and would be overwritten: name another file"),
    ):
        check_refused(run("control", "walk .5s", *options), said, out)


def test_generate_writes_vrm_animation(tmp_path: Path) -> None:
    out, bvh = tmp_path / "walk.vrma", tmp_path / "walk.bvh"
    assert run("generate", "a person walks", "-o", out, "--max-seconds", 3).exit_code == 0
    assert run("generate", "a person walks", "-o", bvh, "--max-seconds", 3).exit_code == 0
    written, source = motet.read(out), motet.to_humanoid(motet.read(bvh, unit="m")).motion
    assert len(written) == len(source)
    np.testing.assert_allclose(
        motet.motion.positions(motet.to_humanoid(written).motion), motet.motion.positions(source), atol=2e-3
    )


@pytest.mark.parametrize("command", [("convert", MIXAMO), ("control", "walk 1s", "-o")])
def test_a_character_that_is_none_is_refused(tmp_path: Path, command: tuple[object, ...]) -> None:
    refused = run(*command, tmp_path / "a.bvh", "--like", tmp_path / "none.glb")
    check_refused(refused, "none.glb: no such file", tmp_path)
