"""Files of several figures: each is read as if it were alone, by name, by number and by every door."""

import copy
import json
import logging
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import check_refused, run
from fbx_files import Bone, Curves, ascii_fbx, document
from gltf_files import read_document, write_clips, write_document
from test_named_clips import swinging

import motet
from motet.errors import FormatError
from motet.motion.motion import Motion

NAMES = ("Alice", "Bob")


def write_bvh(path: Path, roots: list[tuple[str, Motion]]) -> Path:
    """A BVH file with a ROOT for each motion, from the files of each alone."""
    trees, rows = [], []
    for name, motion in roots:
        alone = path.with_name("alone.bvh")
        motet.write(alone, motion)
        tree, _, frames = alone.read_text().partition("MOTION\n")
        trees.append(tree.removeprefix("HIERARCHY\n").replace("ROOT hips", f"ROOT {name}"))
        rows.append(frames.splitlines()[2:])
    head = f"MOTION\nFrames: {len(rows[0])}\nFrame Time: {1 / roots[0][1].fps!r}\n"
    together = "\n".join(" ".join(frame) for frame in zip(*rows, strict=True))
    path.write_text("HIERARCHY\n" + "".join(trees) + head + together + "\n")
    return path


def write_gltf(path: Path, motions: list[Motion]) -> Path:
    """A GLB with a skin for each motion, each moved by an animation of its own, "Clip 0", "Clip 1", ..."""
    together: dict[str, Any] = {"asset": {"version": "2.0"}}
    together |= {kind: [] for kind in ("nodes", "skins", "animations", "bufferViews", "accessors")}
    content = b""
    for number, motion in enumerate(motions):
        document, binary = read_document(write_clips(path, [(f"Clip {number}", motion)]))
        document = copy.deepcopy(document)
        node, view, accessor = (len(together[kind]) for kind in ("nodes", "bufferViews", "accessors"))
        for each in document["nodes"]:
            each["children"] = [child + node for child in each.get("children", [])]
        document["nodes"][0]["name"] = NAMES[number]
        for skin in document["skins"]:
            skin["joints"] = [joint + node for joint in skin["joints"]]
        for animation in document["animations"]:
            for channel in animation["channels"]:
                channel["target"]["node"] += node
            for sampler in animation["samplers"]:
                sampler["input"] += accessor
                sampler["output"] += accessor
        for each in document["accessors"]:
            each["bufferView"] += view
        content += b"\0" * (-len(content) % 4)
        for each in document["bufferViews"]:
            each["byteOffset"] = each.get("byteOffset", 0) + len(content)
        content += binary
        for kind in ("nodes", "skins", "animations", "bufferViews", "accessors"):
            together[kind] += document[kind]
    return write_document(path, together, content)


@pytest.fixture
def pair() -> list[Motion]:
    return [swinging(9, 2.0), swinging(9, 3.0)]


def test_each_root_of_bvh_is_read_as_alone(
    pair: list[Motion], tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = write_bvh(tmp_path / "duet.bvh", list(zip(NAMES, pair, strict=True)))
    assert motet.figures_in(path) == NAMES
    assert motet.clips(path) == ()
    for number, (name, motion) in enumerate(zip(NAMES, pair, strict=True), start=1):
        motet.write(tmp_path / "alone.bvh", motion)
        alone = motet.read(tmp_path / "alone.bvh")
        for read in (motet.read(path, figure=name), motet.read(path, figure=number), motet.read(f"{path}#{name}")):
            np.testing.assert_array_equal(read.values, alone.values)
            assert read.channels == tuple(channel.replace("hips.", f"{name}.") for channel in alone.channels)
    with caplog.at_level(logging.WARNING, "motet"):
        assert motet.read(path).channels[0] == "Alice.tx"
    assert caplog.messages == [f"{path}: reading the first of 2 figures, 'Alice'; the next is duet.bvh#Bob"]
    with pytest.raises(FormatError, match="no figure 'Carol': expected 'Alice', 'Bob', or 1 to 2"):
        motet.read(path, figure="Carol")


def test_fifty_roots_of_one_name_are_fifty_figures(tmp_path: Path) -> None:
    motions = [swinging(3, 1.0 + number) for number in range(50)]
    path = write_bvh(tmp_path / "crowd.bvh", [("hips", motion) for motion in motions])
    assert motet.figures_in(path) == ("hips", *(f"hips_{number}" for number in range(2, 51)))
    for figure, motion in ((50, motions[49]), ("hips_31", motions[30])):
        motet.write(tmp_path / "alone.bvh", motion)
        alone = motet.read(tmp_path / "alone.bvh")
        read = motet.read(path, figure=figure)
        assert read.channels == tuple(
            channel.replace("hips.", f"{read.channels[0][:-3]}.") for channel in alone.channels
        )
        np.testing.assert_array_equal(read.values, alone.values)


def test_a_figure_of_gltf_comes_with_the_clip_that_moves_it(pair: list[Motion], tmp_path: Path) -> None:
    path = write_gltf(tmp_path / "duet.glb", pair)
    assert (motet.figures_in(path), motet.clips(path)) == (NAMES, ("Clip 0", "Clip 1"))
    for number, (name, motion) in enumerate(zip(NAMES, pair, strict=True)):
        alone = motet.read(write_clips(tmp_path / "alone.glb", [("a", motion)]))
        clip = f"Clip {number}"
        chosen = [
            {"figure": name},
            {"figure": number + 1},
            {"clip": name},
            {"clip": clip},
            {"clip": clip, "figure": name},
        ]
        for options in chosen:
            read = motet.read(path, **options)  # type: ignore[arg-type]  # text or numbers
            assert read.channels[0] == f"{name}.tx"
            np.testing.assert_array_equal(read.values, alone.values)
        np.testing.assert_array_equal(motet.read(f"{path}#{name}").values, alone.values)
    with pytest.raises(FormatError, match="its clip 'Clip 1' does not move the figure 'Alice': expected 'Clip 0'"):
        motet.read(path, clip="Clip 1", figure="Alice")
    with pytest.raises(FormatError, match="no figure 3: expected 'Alice', 'Bob', or 1 to 2"):
        motet.read(path, figure=3)


def test_a_figure_of_fbx_comes_with_the_take_that_moves_it(tmp_path: Path) -> None:
    pytest.importorskip("ufbx")
    bones, takes = [], []
    for number, name in enumerate(NAMES):
        first = len(bones)
        bones.append(Bone(name, -1, (100.0 * number, 90.0, 0.0)))
        bones += [Bone(f"{name}_{i}", first + i - 1, (0.0, 20.0, 0.0)) for i in range(1, 4)]
        angles = np.linspace([0.0, 0, 0], [40.0, 10, 0], 13 + number)
        times = np.arange(13 + number) / 24
        takes.append(Curves(f"take of {name}", list(times), {(first + 1, "R"): angles}))
    path = tmp_path / "duet.fbx"
    path.write_bytes(ascii_fbx(document(bones, takes)))
    assert (motet.figures_in(path), motet.clips(path)) == (NAMES, ("take of Alice", "take of Bob"))
    for number, name in enumerate(NAMES):
        for read in (motet.read(path, figure=name), motet.read(f"{path}#{name}")):
            assert read.skeleton is not None
            assert read.skeleton.names[0] == name
            assert len(read) == 13 + number
            assert np.ptp(read.values, axis=0).max() == pytest.approx(40, abs=1)
    with pytest.raises(FormatError, match="does not move the figure 'Bob': expected 'take of Bob'"):
        motet.read(path, clip=1, figure="Bob")


def test_the_command_line_takes_one_figure_or_all(pair: list[Motion], tmp_path: Path) -> None:
    bvh = write_bvh(tmp_path / "duet.bvh", list(zip(NAMES, pair, strict=True)))
    glb = write_gltf(tmp_path / "duet.glb", pair)
    for file in (bvh, glb):
        run("convert", file, tmp_path / "{clip}.npz", "--figure", "all")
        label = "{}" if file is bvh else "Clip {number}-{}"
        for number, name in enumerate(NAMES):
            written = motet.read(tmp_path / f"{label.format(name, number=number)}.npz")
            np.testing.assert_array_equal(written.values, motet.read(file, figure=name).values)
    run("convert", f"{bvh}#2", tmp_path / "second.npz")
    assert motet.read(tmp_path / "second.npz").channels[0] == "Bob.tx"
    (tmp_path / "none").mkdir()
    refused = run("convert", glb, tmp_path / "none" / "a.npz", "--figure", "Carol")
    check_refused(refused, "no figure 'Carol'", tmp_path / "none", code=1)


def test_a_look_at_a_file_lists_its_figures(pair: list[Motion], tmp_path: Path) -> None:
    path = write_gltf(tmp_path / "duet.glb", pair)
    checked = motet.check(path, figure="Bob")
    assert (checked.figure, checked.figures, checked.clip) == ("Bob", NAMES, "Clip 1")
    assert motet.check(path).figure is None
    assert "Bob, of 2: Alice, Bob (--figure)" in run("check", path, "--figure", "Bob").output
    rows = json.loads(run("check", path, "--figure", "all", "--json").output)
    assert [(row["figure"], row["clip"]) for row in rows] == [("Alice", "Clip 0"), ("Bob", "Clip 1")]


def test_a_format_of_one_figure_refuses_the_option(tmp_path: Path) -> None:
    motet.write(tmp_path / "a.npz", replace(swinging(3), fps=30.0))
    assert motet.figures_in(tmp_path / "a.npz") == ()
    with pytest.raises(
        FormatError, match=r"'figure' is an option for \.bvh \.glb \.gltf \.vrm \.vrma \.fbx files only"
    ):
        motet.read(tmp_path / "a.npz", figure=1)
