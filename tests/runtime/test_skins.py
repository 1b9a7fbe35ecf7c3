"""Which nodes of a glTF file are joints where its skins do not list them all."""

import logging
from pathlib import Path

import numpy as np
import pytest
from gltf_files import read_document, write_clips, write_document

from motet.errors import MotionError
from motet.figures.humanoid import HUMANOID, from_humanoid, rig, to_humanoid
from motet.formats import read_character, read_motion
from motet.formats.text import with_names
from motet.motion.kinematics import positions, skeleton_of
from motet.motion.motion import Motion

RIGIFY = rig("rigify")

BARE = [f"b{i:02}" for i in range(len(RIGIFY.names))]


def waving() -> Motion:
    """Rigify's figure with its left arm going up, in 20 frames."""
    time = np.linspace(0, 1, 20)
    names = ("hips.tx", "hips.ty", "hips.tz", "leftUpperArm.rz", "head.ry", "rightLowerLeg.rx")
    values = np.stack([0 * time, 0.97 + 0 * time, time, 60 * time, 20 * time, 30 * time], axis=1)
    return from_humanoid(Motion(values, names, ("m",) * 3 + ("deg",) * 3, 30.0, HUMANOID), RIGIFY)


@pytest.mark.parametrize(
    "skins",
    [
        [["spine.004", "spine.006"]],
        [["spine.006"], ["hand.L"], ["toe.R", "foot.R"]],
        [["spine"]],
        [[]],
    ],
)
@pytest.mark.parametrize("named", [True, False])
def test_a_human_is_what_moves_where_the_skins_list_no_human(
    tmp_path: Path, skins: list[list[str]], named: bool
) -> None:
    motion = waving()
    motion = motion if named else with_names(motion, BARE)
    whole, path = write_clips(tmp_path / "whole.glb", [("wave", motion)]), tmp_path / "some.glb"
    document, binary = read_document(whole)
    known = [name.removeprefix("DEF-") for name in RIGIFY.names]
    document["skins"] = [{"joints": [known.index(name) for name in skin]} for skin in skins]
    write_document(path, document, binary)
    found, wanted = read_motion(path), read_motion(whole)
    assert skeleton_of(found).names == skeleton_of(wanted).names
    np.testing.assert_allclose(positions(found), positions(wanted), atol=1e-6)
    places, others = (positions(to_humanoid(each).motion) for each in (found, wanted))
    np.testing.assert_allclose(places, others, atol=1e-6)
    assert read_character(path).rest.skeleton == read_character(whole).rest.skeleton


def test_skins_of_what_is_no_human_are_read_as_they_are(tmp_path: Path) -> None:
    motion = waving()
    path = write_clips(tmp_path / "tail.glb", [("wave", motion)], skin=("spine.001", "spine.002", "spine.003"))
    document, binary = read_document(path)
    nodes = document["nodes"]
    for node in nodes:  # a worm, whose other nodes move but are nothing's limbs
        node["children"] = [child for child in node.get("children", []) if not nodes[child]["name"].endswith(".L")]
    nodes += [{"name": "things", "children": [i for i, node in enumerate(nodes) if node["name"].endswith("thigh.L")]}]
    document["nodes"] = [{key: value for key, value in node.items() if value != []} for node in nodes]
    write_document(path, document, binary)
    found = read_motion(path)
    assert {"DEF-spine.001", "DEF-spine.003"} <= set(skeleton_of(found).names)
    assert "DEF-foot.R" not in skeleton_of(found).names
    with pytest.raises(MotionError, match="no human"):
        to_humanoid(found)


def test_of_fifty_figures_the_one_that_moves_is_read(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = write_clips(tmp_path / "many.glb", [("wave", waving())])
    document, binary = read_document(path)
    nodes, count = list(document["nodes"]), len(document["nodes"])
    for k in range(1, 50):
        for node in nodes[:count]:
            copy = {**node, "name": f"{node['name']}.{k:03}"}
            if "children" in node:
                copy["children"] = [child + k * count for child in node["children"]]
            nodes.append(copy)
        document["skins"].append({"joints": [joint + k * count for joint in range(count)]})
    write_document(path, {**document, "nodes": nodes}, binary)
    with caplog.at_level(logging.WARNING):
        found = read_motion(path)
    assert "of 50 skeletons" in caplog.text
    assert len(skeleton_of(found).names) == count
    assert to_humanoid(found).convention == "Blender Rigify"
