"""Clips for a character's own nodes, and characters with clips in them, played by kinematics that are not motet's."""

import base64
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltf_player import Array, Played
from small_character import QUARTER, TEXTURE, Node, character, packed
from test_formats_gltf import parts
from test_retarget import SKELETONS, dancing

import motet
from motet.errors import FormatError, MotionError
from motet.figures.humanoid.bones import HUMANOID, LEFT_RIGHT, MIXAMO
from motet.formats import Character, gltf_character, read_character

SCALE: Node = {"scale": [0.01] * 3}
TURN: Node = {"rotation": [QUARTER, 0, 0, QUARTER]}
BACK: Node = {"rotation": [-QUARTER, 0, 0, QUARTER]}
MATRIX: Node = {"matrix": [0, 0, -2, 0, 0, 2, 0, 0, 2, 0, 0, 0, 5, 1, -3, 1]}

CHARACTERS: dict[str, dict[str, Any]] = {
    "nothing above": {},
    "scale": {"above": [SCALE]},
    "turn": {"above": [TURN]},
    "scale and turn": {"above": [SCALE | TURN]},
    "turned back": {"above": [BACK | SCALE]},
    "two nodes, one a matrix": {"above": [MATRIX, SCALE | TURN | {"translation": [0.3, -1, 2]}]},
    "tiny": {"above": [SCALE], "size": 0.18},
    "tall": {"above": [SCALE], "size": 1.3},
    "a giant": {"above": [SCALE], "size": 38.0},
    "faces backwards": {"above": [BACK | SCALE], "backwards": True},
}

LIMBS = [("UpLeg", "Leg"), ("Leg", "Foot"), ("Arm", "ForeArm"), ("ForeArm", "Hand")]


def walk() -> motet.Motion:
    """The humanoid on its feet while all its joints move, with its soles on the ground."""
    motion = dancing()
    soles = motet.figures.humanoid.bones.sole_points(*motet.motion.global_transforms(motion))
    values = np.array(motion.values)
    values[:, motion.channels.index("hips.ty")] -= motet.figures.humanoid.bones.ground_under(soles)
    return motet.Motion(values, motion.channels, motion.units, motion.fps, HUMANOID)


def directions(places: Array, names: list[str]) -> Array:
    """Of the bones of both arms and legs, (T, 8, 3)."""
    pairs = [[names.index(f"mixamorig:{s.capitalize()}{part}") for part in limb] for s in LEFT_RIGHT for limb in LIMBS]
    bones = np.stack([places[:, end] - places[:, start] for start, end in pairs], axis=1)
    unit: Array = bones / np.linalg.norm(bones, axis=-1, keepdims=True)
    return unit


def check(played: Played, motion: motet.Motion, size: float = 1.0, backwards: bool = False) -> None:
    """The played character does what the humanoid does, on its own soles."""
    names = list(MIXAMO.names)
    front = np.array([-1, 1, -1]) if backwards else np.ones(3)
    places, human = played.places(*names) * front, motet.motion.positions(motion)
    np.testing.assert_allclose(directions(places, names), directions(human, names), atol=2e-4)
    path = (places[:, 0] - places[0, 0])[:, [0, 2]]
    np.testing.assert_allclose(path, size * (human[:, 0] - human[0, 0])[:, [0, 2]], atol=2e-4 * size)
    lowest = played.skin(len(played.names) - 1)[..., 1].min(axis=1)
    assert lowest.min() == pytest.approx(-0.005 * size, abs=1e-3 * size)


@pytest.mark.parametrize("settings", CHARACTERS.values(), ids=CHARACTERS)
def test_a_clip_plays_by_the_names_of_the_characters_nodes_and_in_the_character(
    tmp_path: Path, settings: dict[str, Any]
) -> None:
    avatar, motion = character(tmp_path / "avatar.glb", **settings), walk()
    size, backwards = settings.get("size", 1.0), settings.get("backwards", False)
    motet.write(tmp_path / "clip.glb", motion, like=avatar)
    clip = Played(tmp_path / "clip.glb")
    check(Played(avatar).play(clip.clip()), motion, size, backwards)
    assert sorted(clip.names) == sorted(Played(avatar).names)
    # at rest, and by itself, the clip is the character, too
    names = MIXAMO.names
    np.testing.assert_allclose(clip.places(*names), Played(avatar).places(*names), atol=1e-6 * size)
    # the body that is drawn in the mesh's place goes with the joints
    alone = clip.play(clip.clip())
    corners, joints = alone.skin(len(alone.names) - 1)[::10], alone.places(*names)[::10]
    assert np.linalg.norm(corners[:, :, None] - joints[:, None], axis=-1).min(axis=-1).max() < 0.25 * size
    motet.write(tmp_path / "out.glb", motion, onto=avatar)
    out = Played(tmp_path / "out.glb")
    check(out.play(out.clip()), motion, size, backwards)


def test_nodes_that_are_animated_have_no_matrices(tmp_path: Path) -> None:
    avatar, motion = character(tmp_path / "avatar.glb", [SCALE | TURN], matrices=True), walk()
    motet.write(tmp_path / "out.glb", motion, onto=avatar)
    out = Played(tmp_path / "out.glb")
    moved = {channel["target"]["node"] for channel in out.document["animations"][0]["channels"]}
    assert not any("matrix" in out.document["nodes"][node] for node in moved)
    assert any("matrix" in node for node in Played(avatar).document["nodes"])
    check(out.play(out.clip()), motion)


@pytest.mark.parametrize(("above", "left"), [(0.04, 0.0), (-0.04, 0.0), (0.4, 0.4)])
def test_a_motion_that_floats_a_little_is_laid_on_the_ground(tmp_path: Path, above: float, left: float) -> None:
    avatar, motion = character(tmp_path / "avatar.glb"), walk()
    values = np.array(motion.values)
    values[:, motion.channels.index("hips.ty")] += above
    motet.write(tmp_path / "out.glb", replace(motion, values=values), onto=avatar)
    out = Played(tmp_path / "out.glb")
    lowest = out.play(out.clip()).skin(len(out.names) - 1)[..., 1].min(axis=1)
    assert lowest.min() == pytest.approx(left, abs=0.01)


def test_without_a_mesh_the_soles_are_told_by_the_joints(tmp_path: Path) -> None:
    motion = walk()
    for meshed in (True, False):
        avatar = character(tmp_path / "avatar.glb", meshed=meshed)
        motet.write(tmp_path / f"{meshed}.glb", motion, like=avatar)
    with_mesh, without = (Played(tmp_path / f"{meshed}.glb") for meshed in (True, False))
    hips = [clip.play(clip.clip()).places("mixamorig:Hips")[:, 0] for clip in (with_mesh, without)]
    apart = hips[0] - hips[1]
    np.testing.assert_allclose(apart[:, [0, 2]], 0, atol=1e-5)
    assert np.median(apart[:, 1]) == pytest.approx(0.03, abs=0.015)  # the mesh's soles are 3 cm thicker


def test_all_else_in_the_file_stays(tmp_path: Path) -> None:
    avatar = character(tmp_path / "avatar.glb", [MATRIX, SCALE | TURN])
    motions = {"a person walks": walk(), "stays": walk()[:1], "日本/語": walk()[::2]}
    motet.write(tmp_path / "out.glb", motions, onto=avatar)
    before, after = Played(avatar), Played(tmp_path / "out.glb")
    named = [animation["name"] for animation in after.document["animations"]]
    assert named == ["a person walks", "stays", "日本/語", "old"]
    assert after.binary.startswith(before.binary[: before.document["buffers"][0]["byteLength"]])
    assert TEXTURE in after.binary
    assert all(view["byteOffset"] % 4 == 0 for view in after.document["bufferViews"])
    changed = {"animations", "accessors", "bufferViews", "buffers"}
    for key in before.document.keys() - changed:
        assert after.document[key] == before.document[key], key
    for key in ("accessors", "bufferViews"):
        assert after.document[key][: len(before.document[key])] == before.document[key]
    assert after.document["animations"][-1] == before.document["animations"][0]
    assert motet.clips(tmp_path / "out.glb") == tuple(named)


def test_a_clip_of_the_same_name_takes_the_place_of_the_old_one(tmp_path: Path) -> None:
    avatar = character(tmp_path / "avatar.glb")
    motet.write(tmp_path / "out.glb", {"old": walk()}, onto=avatar)
    assert motet.clips(tmp_path / "out.glb") == ("old",)
    motet.write(tmp_path / "out.glb", {"more": walk()}, onto=tmp_path / "out.glb")
    assert motet.clips(tmp_path / "out.glb") == ("more", "old")


def test_a_motion_of_the_characters_own_goes_back_onto_it(tmp_path: Path) -> None:
    avatar, motion = character(tmp_path / "avatar.glb", [SCALE | TURN]), walk()
    motet.write(tmp_path / "out.glb", motion, onto=avatar)
    own = motet.read(tmp_path / "out.glb")
    motet.write(tmp_path / "again.glb", own, onto=avatar)
    first, again = (Played(tmp_path / name) for name in ("out.glb", "again.glb"))
    np.testing.assert_allclose(again.play(again.clip()).worlds, first.play(first.clip()).worlds, atol=1e-5)


def test_what_is_no_character_is_refused(tmp_path: Path) -> None:
    avatar, motion, out = character(tmp_path / "avatar.glb"), walk(), tmp_path / "out.glb"
    bvh = SKELETONS / "mixamo.bvh"
    document = Played(avatar).document
    (tmp_path / "apart.glb").write_bytes(packed(document | {"images": [{"uri": "skin.png"}]}, Played(avatar).binary))
    flat = [dict(node) for node in document["nodes"]]
    flat[0]["scale"] = [0, 0, 0]
    (tmp_path / "flat.glb").write_bytes(packed(document | {"nodes": flat}, Played(avatar).binary))
    bent = [dict(node) for node in document["nodes"]]
    turns = np.random.default_rng(1).normal(size=(len(bent), 4))
    for node, turn in zip(bent, turns, strict=True):
        node["rotation"] = (turn / np.linalg.norm(turn)).tolist()
    (tmp_path / "bent.glb").write_bytes(packed(document | {"nodes": bent}, Played(avatar).binary))
    for onto, place, error, said in (
        (
            tmp_path / "bent.glb",
            out,
            MotionError,
            "not a standing body: use a file of this figure that rests in a T-pose",
        ),
        (
            tmp_path / "apart.glb",
            out,
            FormatError,
            "its image 'skin.png' is a separate file, which requires a .gltf",
        ),
        (tmp_path / "flat.glb", out, FormatError, "flat.glb: .*scale 0"),
        (bvh, out, FormatError, "cannot write onto files of type '.bvh'; expected one of .glb .gltf .vrm"),
        (Character(motet.read(bvh)), out, MotionError, "no mesh"),
        (avatar, tmp_path / "out.vrm", FormatError, "avatar.glb: not a VRM avatar"),
        (avatar, tmp_path / "out.bvh", FormatError, "cannot write files of type '.bvh'; expected one of .glb .vrm"),
        (tmp_path / "none.glb", out, FormatError, "none.glb: no such file"),
    ):
        with pytest.raises(error, match=said):
            motet.write(place, motion, onto=onto)
        assert not place.exists()
    with pytest.raises(MotionError, match="no frames"):
        motet.write(out, motion[:0], onto=avatar)
    with pytest.raises(MotionError, match="onto="):
        motet.write(out, {"a": motion})


@pytest.mark.parametrize("inside", [False, True])
def test_a_character_in_text_becomes_one_file(tmp_path: Path, inside: bool) -> None:
    avatar, motion = character(tmp_path / "avatar.glb"), walk()
    document, binary = parts(avatar)
    uri = "data:application/octet-stream;base64," + base64.b64encode(binary).decode() if inside else "avatar.bin"
    (tmp_path / "avatar.bin").write_bytes(binary)
    (tmp_path / "skin%1.png").write_bytes(TEXTURE)
    document["buffers"] = [{"byteLength": len(binary), "uri": uri}, {"byteLength": 8, "uri": "more.bin"}]
    (tmp_path / "more.bin").write_bytes(b"12345678")
    document["images"].append({"uri": "skin%251.png"})
    (tmp_path / "avatar.gltf").write_text(json.dumps(document))
    motet.write(tmp_path / "wanted.glb", motion, onto=avatar)
    motet.write(tmp_path / "out.glb", motion, onto=tmp_path / "avatar.gltf")
    wanted, found = Played(tmp_path / "wanted.glb"), Played(tmp_path / "out.glb")
    np.testing.assert_array_equal(found.play(found.clip()).worlds, wanted.play(wanted.clip()).worlds)
    check(found.play(found.clip()), motion)
    written, content = parts(tmp_path / "out.glb")
    assert content[: len(binary)] == binary
    assert "uri" not in written["buffers"][0]
    media, _, text = written["images"][1]["uri"].partition(",")
    assert (media, base64.b64decode(text)) == ("data:image/png;base64", TEXTURE)
    assert base64.b64decode(written["buffers"][1]["uri"].partition(",")[2]) == b"12345678"


@pytest.mark.parametrize(
    ("uri", "said"),
    [
        ("../skin.png", "its image '../skin.png' is not a file in its folder"),
        ("link.png", "its image 'link.png' is not a file in its folder"),
        ("notes.txt", "its image 'notes.txt' is no PNG, JPEG, WebP or KTX picture"),
        ("none.png", "its image 'none.png' is not a file in its folder"),
    ],
)
def test_pictures_of_a_character_are_pictures_in_its_folder(tmp_path: Path, uri: str, said: str) -> None:
    folder = tmp_path / "inside"
    folder.mkdir()
    document, binary = parts(character(tmp_path / "avatar.glb"))
    (folder / "avatar.bin").write_bytes(binary)
    (folder / "notes.txt").write_text("secret")
    (tmp_path / "skin.png").write_bytes(TEXTURE)
    (folder / "link.png").symlink_to(tmp_path / "skin.png")
    document["buffers"] = [{"byteLength": len(binary), "uri": "avatar.bin"}]
    document["images"].append({"uri": uri})
    (folder / "avatar.gltf").write_text(json.dumps(document))
    with pytest.raises(FormatError, match=said):
        motet.write(tmp_path / "out.glb", walk(), onto=folder / "avatar.gltf")
    assert not (tmp_path / "out.glb").exists()


def test_a_clip_for_nodes_without_names_says_that_it_will_not_play(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    avatar = character(tmp_path / "avatar.glb")
    motet.write(tmp_path / "clip.glb", walk(), like=avatar)
    assert not caplog.messages
    document, binary = parts(avatar)
    for node in document["nodes"]:
        node.pop("name", None)
    (tmp_path / "bare.glb").write_bytes(packed(document, binary))
    motet.write(tmp_path / "clip.glb", walk(), like=tmp_path / "bare.glb")
    assert "bare.glb: its nodes have no names, by which a clip plays: use --onto" in caplog.messages[-1]


SHARED = {
    "a mesh": lambda document: document["nodes"].extend({"mesh": 0} for _ in range(1500)),
    "a mesh with its skin": lambda document: document["nodes"].extend({"mesh": 0, "skin": 0} for _ in range(1500)),
    "a primitive": lambda document: document["meshes"][0].update(primitives=document["meshes"][0]["primitives"] * 1500),
}


@pytest.mark.parametrize("share", SHARED.values(), ids=SHARED)
def test_what_many_nodes_share_is_computed_once_and_what_is_too_much_is_not(
    tmp_path: Path,
    share: Callable[[dict[str, Any]], None],
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    file = character(tmp_path / "avatar.glb")
    document, binary = parts(file)
    plain = read_character(file).skin
    share(document)
    file.write_bytes(packed(document, binary))
    computed = list[int]()
    skinned = gltf_character._skinned
    monkeypatch.setattr(gltf_character, "_skinned", lambda *given: computed.append(1) or skinned(*given))
    shared = read_character(file).skin
    assert len(computed) == 1
    assert shared.keys() == plain.keys()
    if "mesh" not in document["nodes"][-1] or "skin" in document["nodes"][-1]:
        for joint, points in plain.items():
            np.testing.assert_array_equal(shared[joint], points)
    monkeypatch.setattr(gltf_character, "MAX_PRIMITIVES", 1000)
    with caplog.at_level("INFO", logger="motet"):
        assert read_character(file).skin == {}
    assert "its nodes have more than 1000 primitives of meshes" in caplog.text
    assert len(computed) == 1


def test_meshes_with_too_many_points_are_not_computed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """The soles are then told by the joints, as of a character without a mesh."""
    monkeypatch.setattr(gltf_character, "MAX_POINTS", 5)
    monkeypatch.setattr(gltf_character, "_skinned", None)
    with caplog.at_level("INFO", "motet"):
        assert read_character(character(tmp_path / "avatar.glb")).skin == {}
    assert "6 points, more than 5" in caplog.text


def test_a_loop_of_links_is_no_buffer(tmp_path: Path) -> None:
    (tmp_path / "a.bin").symlink_to(tmp_path / "b.bin")
    (tmp_path / "b.bin").symlink_to(tmp_path / "a.bin")
    document, binary = parts(character(tmp_path / "avatar.glb"))
    document["buffers"] = [{"byteLength": len(binary), "uri": "a.bin"}]
    (tmp_path / "a.gltf").write_text(json.dumps(document))
    with pytest.raises(FormatError, match=r"cannot be read|is not a file in its folder"):
        motet.read(tmp_path / "a.gltf")
