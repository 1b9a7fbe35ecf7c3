"""Files of several motions, each by its name."""

import logging
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from gltf_files import node_places, read_document, write_clips, write_document

import motet
from motet.errors import FormatError
from motet.figures.humanoid.bones import BONES, HUMANOID
from motet.formats.text import part_names
from motet.motion.kinematics import skeleton_of
from motet.motion.motion import Motion


def swinging(frames: int, speed: float = 3.0) -> Motion:
    """A figure on the humanoid whose joints all turn."""
    time = np.linspace(0, 1, frames)
    names = ["hips.tx", "hips.ty", "hips.tz", *(f"{bone}.r{axis}" for bone in BONES for axis in "xyz")]
    columns = [time, 0.98 + 0 * time, time**2, *(25 * np.sin(speed * time + i) for i in range(len(names) - 3))]
    units = ("length",) * 3 + ("deg",) * (len(names) - 3)
    return Motion(np.stack(columns, axis=1), tuple(names), units, 24.0, HUMANOID)


def check_places(motion: Motion, path: Path, clip: int) -> None:
    """A motion's joints are where the file's nodes of these names are."""
    expected, skeleton = node_places(path, clip, len(motion)), skeleton_of(motion)
    for place, name in zip(np.moveaxis(motet.motion.positions(motion), 1, 0), skeleton.names, strict=True):
        np.testing.assert_allclose(place, expected[name], atol=2e-6, err_msg=name)


@pytest.mark.parametrize("skin", [True, False])
def test_each_clip_is_read_by_name_and_number(skin: bool, tmp_path: Path) -> None:
    lengths = {"Walk": 9, "Run": 12, "Idle": 5}
    clips = [(name, swinging(frames, frames)) for name, frames in lengths.items()]
    path = write_clips(tmp_path / "a.glb", clips, skin)
    assert motet.clips(path) == ("Walk", "Run", "Idle")
    for number, (name, frames) in enumerate(lengths.items(), start=1):
        by_name = motet.read(path, clip=name)
        assert len(by_name) == frames
        check_places(by_name, path, number - 1)
        for again in (
            motet.read(f"{path}#{name}"),
            motet.read(Path(f"{path}#{number}")),
            motet.read(path, clip=number),
        ):
            np.testing.assert_array_equal(again.values, by_name.values)


def test_without_a_clip_it_is_the_first_and_the_log_says_so(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = write_clips(tmp_path / "a.glb", [("Walk", swinging(9)), ("Run", swinging(12))])
    with caplog.at_level(logging.INFO, "motet"):
        assert len(motet.read(path)) == 9
    assert [record.message for record in caplog.records] == [
        f"{path}: reading the first of 2 clips, 'Walk'; the next is a.glb#Run",
        f"{path}: clips: 'Walk', 'Run'",
    ]
    caplog.clear()
    motet.read(path, clip="Walk")
    motet.read(write_clips(tmp_path / "b.glb", [("Walk", swinging(9))]))
    assert not caplog.records


@pytest.mark.parametrize(
    ("clip", "said"),
    [
        ("walk", r"no clip 'walk': expected 'Walk', 'Run', or 1 to 2"),
        ("", "no clip ''"),
        ("ru", r"no clip 'ru': expected 'Run', 'Walk', or 1 to 2"),
        ("rnu", r"no clip 'rnu': expected 'Walk', 'Run', or 1 to 2"),
        ("Rnu", r"no clip 'Rnu': expected 'Run', 'Walk', or 1 to 2"),
        ("3", "no clip '3'"),
        (0, "no clip 0"),
        (-1, "no clip -1"),
        ("9" * 5000, "no clip"),
        ("²", "no clip"),
    ],
)
def test_a_clip_that_is_not_there_is_refused_with_those_that_are(clip: str | int, said: str, tmp_path: Path) -> None:
    path = write_clips(tmp_path / "a.glb", [("Walk", swinging(9)), ("Run", swinging(12))])
    with pytest.raises(FormatError, match=said):
        motet.read(path, clip=clip)
    if isinstance(clip, str):
        with pytest.raises(FormatError, match=said):
            motet.read(f"{path}#{clip}")


def test_of_formats_without_clips_none_is_named_or_read(tmp_path: Path) -> None:
    motet.write(tmp_path / "a.npz", swinging(3))
    assert motet.clips(tmp_path / "a.npz") == ()
    with pytest.raises(FormatError, match=r"'clip' is an option for \.glb \.gltf \.vrm \.vrma"):
        motet.read(f"{tmp_path / 'a.npz'}#Walk")
    with pytest.raises(FormatError, match=r"^\S*none\.glb: no such file"):
        motet.read(tmp_path / "none.glb#Walk")


def test_names_are_made_plain_and_different() -> None:
    given = ["Walk", "", "Walk", " Walk ", "歩く", "a/b#c", "Line\nbreak \x1b[31m", "1", "clip2", "x" * 999]
    found = part_names(given)
    assert found[:7] == ("Walk", "clip2", "Walk_2", "Walk_3", "歩く", "a/b#c", "Line break [31m")
    assert found[7:9] == ("1", "clip2_2")
    assert len(set(found)) == len(given)
    assert max(map(len, found)) == 200


def test_names_are_found_whatever_is_in_them(tmp_path: Path) -> None:
    names = ["2", "歩く", "a/b#c", "Armature|Walk", "", "1"]
    path = write_clips(tmp_path / "a.glb", [(name, swinging(3 + i)) for i, name in enumerate(names)])
    for i, name in enumerate(motet.clips(path)):
        assert len(motet.read(f"{path}#{name}")) == 3 + i
    assert len(motet.read(path, clip=1)) == 3  # a number is a number, and text a name first
    assert len(motet.read(path, clip="3")) == 5


def test_a_file_with_the_mark_in_its_name_is_itself(tmp_path: Path) -> None:
    path = write_clips(tmp_path / "a#b.glb", [("Walk", swinging(9)), ("Run", swinging(12))])
    assert len(motet.read(path)) == 9
    assert len(motet.read(f"{path}#Run")) == 12
    write_clips(tmp_path / "c.glb#Run.glb", [("Walk", swinging(7)), ("Run", swinging(8))])
    assert len(motet.read(tmp_path / "c.glb#Run.glb")) == 7
    assert len(motet.read(f"{tmp_path / 'c.glb#Run.glb'}#Run")) == 8


def test_animations_that_move_no_joint_are_no_clips(tmp_path: Path) -> None:
    path = write_clips(tmp_path / "a.glb", [("Camera", swinging(4)), ("Walk", swinging(9))])
    document, binary = read_document(path)
    document["nodes"].append({"name": "camera", "camera": 0})
    for channel in document["animations"][0]["channels"]:
        channel["target"]["node"] = len(document["nodes"]) - 1
    write_document(path, document, binary)
    assert motet.clips(path) == ("Walk",)
    assert len(motet.read(path)) == 9
    del document["animations"][1]
    with pytest.raises(FormatError, match="its animations move no joint of its skeleton"):
        motet.read(write_document(path, document, binary))


def test_a_clip_of_no_length_is_one_frame(tmp_path: Path) -> None:
    path = write_clips(tmp_path / "a.glb", [("Pose", swinging(1)), ("Walk", swinging(9))])
    pose = motet.read(path, clip="Pose")
    assert (len(pose), pose.fps) == (1, 30.0)
    check_places(pose, path, 0)


def test_nodes_above_the_skeleton_move_it(tmp_path: Path) -> None:
    path = write_clips(tmp_path / "a.glb", [("Walk", swinging(9))])
    document, binary = read_document(path)
    nodes, channels = document["nodes"], document["animations"][0]["channels"]
    nodes.append({"name": "Armature", "scale": [0.01] * 3, "rotation": [-0.6, 0, 0, 0.8], "children": [0]})
    moving = next(c for c in channels if c["target"] == {"node": 0, "path": "translation"})
    turning = next(c for c in channels if c["target"] == {"node": 3, "path": "rotation"})
    channels += [c | {"target": c["target"] | {"node": len(nodes) - 1}} for c in (moving, turning)]
    write_document(path, document, binary)
    motion = motet.read(path)
    assert {*skeleton_of(motion).names} == {*HUMANOID.names}
    check_places(motion, path, 0)


@pytest.mark.parametrize("together", [True, False])
@pytest.mark.parametrize("skin", [True, False])
def test_of_two_figures_the_one_is_read_that_the_clip_moves(
    together: bool, skin: bool, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = write_clips(tmp_path / "a.glb", [("Walk", swinging(9)), ("Run", swinging(12))], skin)
    document, binary = read_document(path)
    count = len(document["nodes"])
    others = [
        node | {"name": f"B_{node['name']}", "children": [child + count for child in node.get("children", [])]}
        for node in document["nodes"]
    ]
    document["nodes"] += others
    if skin:
        document["skins"].append({"joints": list(range(count, 2 * count))})
    if together:
        document["nodes"].append({"name": "Root", "children": [0, count]})
    for channel in document["animations"][1]["channels"]:
        channel["target"]["node"] += count
    write_document(path, document, binary)
    first, second = motet.read(path, clip="Walk"), motet.read(path, clip="Run")
    check_places(first, path, 0)
    check_places(second, path, 1)
    if skin or not together:
        assert {*skeleton_of(first).names} == {*HUMANOID.names}
        assert {*skeleton_of(second).names} == {f"B_{name}" for name in HUMANOID.names}
        assert "of 2 skeletons, reading that of 'B_hips'" in caplog.text
    else:  # nothing tells that they are two
        assert len(skeleton_of(first).names) == 2 * count + 1


def test_skins_of_one_figure_are_one_skeleton(tmp_path: Path) -> None:
    path = write_clips(tmp_path / "a.glb", [("Walk", swinging(9))])
    document, binary = read_document(path)
    arms = {i for side in ("left", "right") for i in HUMANOID.below(HUMANOID.index(f"{side}UpperArm"))}
    legs = {i for side in ("left", "right") for i in HUMANOID.below(HUMANOID.index(f"{side}UpperLeg"))}
    for parts in ([arms, legs, set(range(len(HUMANOID.joints))) - arms - legs], [arms, legs]):
        document["skins"] = [{"joints": sorted(part)} for part in parts]
        motion = motet.read(write_document(path, document, binary))
        assert {*BONES} - {"head", "neck"} <= {*skeleton_of(motion).names}
        check_places(motion, path, 0)


def test_without_a_skin_bones_that_rest_belong_to_the_figure_and_things_do_not(tmp_path: Path) -> None:
    motion = swinging(9)
    still = [i for i, channel in enumerate(motion.channels) if channel.startswith(("leftHand", "head", "leftFoot"))]
    values = motion.values.copy()
    values[:, still] = 0.0
    path = write_clips(tmp_path / "a.glb", [("Walk", replace(motion, values=values))], skin=False)
    document, binary = read_document(path)
    assert not any(c["target"]["node"] == HUMANOID.index("head") for c in document["animations"][0]["channels"])
    things = [{"name": "sword", "mesh": 0}, {"name": "eye", "camera": 0}, {"name": "lamp", "extensions": {}}]
    things[2]["extensions"] = {"KHR_lights_punctual": {"light": 0}}
    document["nodes"] += things
    hand = document["nodes"][HUMANOID.index("leftHand")]
    hand["children"] = [*hand.get("children", []), *range(len(HUMANOID.joints), len(document["nodes"]))]
    read = motet.read(write_document(path, document, binary))
    assert {*skeleton_of(read).names} == {*HUMANOID.names}
    check_places(read, path, 0)
