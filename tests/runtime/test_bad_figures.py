"""Figures and files that nothing can be made of: one sentence each on the command line, and nothing is written."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import check_refused, run
from test_retarget import SKELETONS, dancing, limbless, skeleton_file

import motet
from motet.formats import glb
from motet.formats.gltf_data import parse
from motet.motion import HUMANOID
from motet.motion.kinematics import skeleton_of
from motet.motion.motion import Motion
from motet.motion.skeleton import Joint, Skeleton

MIXAMO = SKELETONS / "mixamo.bvh"


def mixamo() -> Motion:
    return skeleton_file("mixamo")


def two_hips() -> Motion:
    joints = [Joint("World", -1, (0.0, 0.0, 0.0))]
    for figure in "AB":
        start = len(joints)
        own = skeleton_of(skeleton_file("unity")).joints
        joints += [replace(j, name=f"{figure}:{j.name}", parent=j.parent + start if j.parent >= 0 else 0) for j in own]
    return Motion(np.zeros((2, 0)), (), (), 30.0, Skeleton(tuple(joints)))


def without_length(*ends: str) -> Motion:
    motion = mixamo()
    skeleton = skeleton_of(motion)
    joints = [replace(j, offset=(0.0, 0.0, 0.0)) if j.name.endswith(ends) else j for j in skeleton.joints]
    return replace(motion, skeleton=Skeleton(tuple(joints)))


def inside_out() -> Motion:
    motion = mixamo()
    values = np.repeat(motion.values[2:3], 5, axis=0)
    values[:, motion.channels.index("mixamorig:RightLeg.rx")] *= -1
    return replace(motion, values=values)


def mirrored() -> Motion:
    motion = mixamo()
    joints = [replace(j, offset=(-j.offset[0], *j.offset[1:])) for j in skeleton_of(motion).joints]
    return replace(motion, skeleton=Skeleton(tuple(joints)))


def lacking(*names: str) -> Callable[[], Motion]:
    return lambda: limbless(mixamo(), *(f"mixamorig:{name}" for name in names))


FIGURES: dict[str, tuple[Callable[[], Motion], str]] = {
    "two hips": (two_hips, "has two hips, 'A:Hips' and 'B:Hips': put each figure in a file of its own"),
    "no legs": (lacking("LeftUpLeg", "RightUpLeg"), "has no legs: a human needs hips with two legs, a spine"),
    "one arm": (lacking("RightForeArm"), "one side only: rightLowerArm, rightHand (the other side has leftLowerArm,"),
    "one hand": (lacking("LeftHand"), "one side only: leftHand (the other side has rightHand); export them, too, or"),
    "toes of one foot": (lacking("RightToeBase"), "one side only: rightToes (the other side has leftToes)"),
    "a giant": (lambda: mixamo().with_unit(1.0), "legs of 88.9 m: a human's are 0.2 to 1.6 m; its lengths look like"),
    "a thigh without length": (lambda: without_length("LeftLeg"), "bones of length zero: mixamorig:LeftUpLeg; a hum"),
    "a foot without length": (lambda: without_length("LeftToeBase"), "bones of length zero: mixamorig:LeftFoot; a h"),
    "no lengths": (lambda: without_length(""), "and 4 more; a human's limbs have lengths: export the skeleton with"),
    "knees forwards": (inside_out, "the knees bend forwards: the frames turn inside out (a wrong order of rotations?"),
    "left and right": (mirrored, "the feet point backwards: left and right are swapped, or the frames turn inside out"),
}
"""Name -> the figure, and what is said of it."""

CHARACTERS = ("knees forwards", "a giant")
"""What a character may be: it needs no frames, in which alone something may be wrong, and may be of any size."""

MAPS = {
    '{"hips": "Hipz"}': "map.json: hips: the skeleton has no joint 'Hipz'; it has mixamorig:Hips, mixamorig:Spine,",
    '{"tail": "mixamorig:Hips"}': "map.json: 'tail' is not a bone of the humanoid: expected hips, spine, head,",
    '{"hips": "mixamorig:Hips", "spine": ["mixamorig:Hips"]}': "named twice: mixamorig:Hips",
    '{"hips": "mixamorig:Hips", "hips": "mixamorig:Spine"}': "not a joint map in JSON: hips appears twice",
    '{"hips": "mixamorig:Hips"}': "map.json: this skeleton has no legs",
}
"""A map of Mixamo's joints, and what is said of it."""


@pytest.mark.parametrize("name", FIGURES)
def test_a_figure_that_is_no_humans_is_refused_and_is_no_character(name: str, tmp_path: Path, out: Path) -> None:
    figure, said = FIGURES[name]
    source = tmp_path / "in.npz"
    motet.write(source, figure())
    for options in ((out / "a.vrma",), (out / "a.bvh", "--like", SKELETONS / "rokoko.bvh")):
        refused = run("convert", source, *options)
        check_refused(refused, said, out, 1)
        assert refused.stderr.count("\n") == 1
    if name not in CHARACTERS:
        motet.write(tmp_path / "a.npz", dancing(4))
        check_refused(run("convert", tmp_path / "a.npz", out / "a.bvh", "--like", source), said, out, 1)


@pytest.mark.parametrize("entries", MAPS)
def test_a_map_that_does_not_fit_is_refused(entries: str, tmp_path: Path, out: Path) -> None:
    (tmp_path / "map.json").write_text(entries)
    refused = run("convert", MIXAMO, out / "a.bvh", "--map", tmp_path / "map.json")
    check_refused(refused, MAPS[entries], out, 1)
    assert refused.stderr.count("\n") == 1


@pytest.mark.parametrize("verb", [("convert",), ("describe",), ("predict", "--frames", "3")])
def test_a_glb_that_moves_a_thing_is_refused(verb: tuple[str, ...], tmp_path: Path, out: Path) -> None:
    source = tmp_path / "cube.glb"
    glb.write(source, dancing(4))
    gltf = parse(source)
    document = json.loads(json.dumps(gltf.document))
    del document["skins"], document["nodes"][len(HUMANOID.names)]["skin"]
    for channel in document["animations"][0]["channels"]:
        channel["target"]["node"] = len(HUMANOID.names)
    source.write_bytes(glb.container(document, gltf.buffers[0]))
    said = "cube.glb: no skeleton: its animations move only 'body', and nothing below; export the armature, too"
    given = () if verb == ("describe",) else ("-o", out / "a.bvh")
    check_refused(run(*verb, source, *given), said, out, 1)
