"""The MMCP server, by the protocol's own client over HTTP; motions against those of the library."""

import json
import re
import sys
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import motet
from motet.motion import HUMANOID, Motion, from_humanoid, global_transforms, rig
from motet.motion.rotations import Array

pytest.importorskip("motionmcp")
pytest.importorskip("uvicorn")
import uvicorn
from motionmcp import client

from motet.serve.application import app

WALK = {"type": "text", "prompt": "a person walks forward", "duration_frames": 60}
QUARTER = [0.0, 0.0, 0.5**0.5, 0.5**0.5]
"""A quarter turn about z."""

PAGE = Path(__file__).parents[2] / "docs/blender.md"


@pytest.fixture(scope="module")
def url() -> Iterator[str]:
    config = uvicorn.Config(app(mmcp=True), port=0, log_level="error")
    server = uvicorn.Server(config)
    thread = threading.Thread(target=server.run)
    thread.start()
    while not server.started:
        time.sleep(0.01)
    yield f"http://127.0.0.1:{server.servers[0].sockets[0].getsockname()[1]}/mmcp"
    server.should_exit = True
    thread.join()


@pytest.fixture(scope="module")
def skeleton(url: str) -> Any:
    (model,) = client.get_capabilities(url)["models"]
    return model["canonical_skeleton"]


def body(skeleton: Any, **request: Any) -> dict[str, Any]:
    """A request for a walk, but for what else it says."""
    return {"protocol_version": "1.0", "model": "motet", "skeleton": skeleton, "segments": [WALK], **request}


def ask(url: str, skeleton: Any, **request: Any) -> list[dict[str, Any]]:
    """The samples of an answer."""
    document = client.generate(url, body(skeleton, **{"options": {"seed": 5}, **request}))
    samples: list[dict[str, Any]] = client.parse_gltf_samples(document)
    return samples


def sent(skeleton: Any) -> dict[str, Any]:
    """A skeleton of motet's as the protocol has it."""
    joints = [
        {
            "name": joint.name,
            "parent": None if joint.parent < 0 else skeleton.names[joint.parent],
            "rest_translation": [one * skeleton.metres_per_unit for one in joint.offset],
            "rest_rotation": [0, 0, 0, 1],
        }
        for joint in skeleton.joints
    ]
    return {"joints": joints}


def positions(sample: dict[str, Any]) -> Array:
    """Positions (T, J, 3) of a sample's joints, by going down its tree."""
    places, turns = {}, {}
    for joint, (name, parent) in enumerate(sample["hierarchy"]):
        own, at = sample["local_rot_mats"][:, joint], sample["local_translations"][:, joint]
        if parent is None:
            turns[name], places[name] = own, at
        else:
            turns[name] = turns[parent] @ own
            places[name] = places[parent] + np.einsum("tij,tj->ti", turns[parent], at)
    return np.stack(list(places.values()), axis=1)


def told(seed: int, *texts: str, frames: int = 60) -> Motion:
    story = motet.load("generate").story(
        texts, seconds=[frames / 30] * (len(texts) - 1) + [(frames + 2) / 30], seed=seed
    )
    return story.motion[: frames * len(texts)]


def test_capabilities_say_what_it_can(url: str) -> None:
    (model,) = client.get_capabilities(url)["models"]
    assert [joint["name"] for joint in model["canonical_skeleton"]["joints"]] == list(HUMANOID.names)
    assert model["supported_constraints"] == ["root_path", "pose_keyframe"]
    assert model["supported_segments"] == ["text", "unconditioned"]
    assert model["supports_retargeting"]
    assert model["supports_loop"]
    assert not model["supports_segment_seed"]


def test_its_manuals_which_load_from_other_sites_are_off(url: str) -> None:
    for page in ("/docs", "/redoc", "/docs/oauth2-redirect"):
        with pytest.raises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(url + page)
        assert refused.value.code == 404
    document = json.load(urllib.request.urlopen(url + "/openapi.json"))
    assert {"/capabilities", "/generate"} <= document["paths"].keys()


def test_a_time_line_is_the_story_of_its_prompts(url: str, skeleton: Any) -> None:
    """Sample i of a request is the story with seed + i, on the humanoid frame by frame."""
    segments = [WALK, {**WALK, "prompt": "a person waves"}]
    samples = ask(url, skeleton, segments=segments, options={"seed": 5, "num_samples": 2})
    for seed, sample in zip((5, 6), samples, strict=True):
        expected = global_transforms(told(seed, WALK["prompt"], "a person waves"))[1]
        np.testing.assert_allclose(positions(sample), expected, atol=0.02)
        assert sample["fps"] == 30
    # a gap without a prompt is filled by standing
    (idle,) = ask(url, skeleton, segments=[{"type": "unconditioned", "duration_frames": 60}, WALK])
    assert np.abs(np.diff(positions(idle)[:45, 0], axis=0)).max() < 0.01
    assert np.abs(np.diff(positions(idle)[-15:, 0], axis=0)).max() > 0.02


def test_other_frame_rates_have_the_same_motion(url: str, skeleton: Any) -> None:
    (slow,) = ask(url, skeleton, segments=[{**WALK, "duration_frames": 20}], timing={"fps": 10})
    np.testing.assert_allclose(positions(slow), positions(ask(url, skeleton)[0])[::3], atol=0.02)


def test_a_seed_that_is_not_given_is_drawn_and_told(url: str, skeleton: Any) -> None:
    documents = [client.generate(url, body(skeleton)) for _ in range(2)]
    seeds = [int(one["extensions"]["MMCP_motion"]["notes"][0]["message"].split()[-1]) for one in documents]
    assert seeds[0] != seeds[1]
    again = ask(url, skeleton, options={"seed": seeds[0]})
    np.testing.assert_array_equal(positions(again[0]), positions(client.parse_gltf_samples(documents[0])[0]))


@pytest.mark.parametrize("name", ["mixamo", "unreal"])
def test_the_client_s_own_figure_gets_the_motion(url: str, name: str) -> None:
    """Also one whose hips hang below a root at the floor: its root moves, and all joints are where motet puts them."""
    own = rig(name)
    (sample,) = ask(url, sent(own))
    motion = from_humanoid(told(5, WALK["prompt"]), own)
    expected = global_transforms(motion)[1] * own.metres_per_unit
    below = own.below(own.index(next(one.rpartition(".")[0] for one in motion.channels if one.endswith(".tx"))))
    found = positions(sample)
    np.testing.assert_allclose(found[:, below], expected[:, below], atol=0.02)
    np.testing.assert_allclose(np.ptp(found[:, 0], axis=0), np.ptp(found[:, below[0]], axis=0), atol=1e-5)


def test_keys_are_met(url: str, skeleton: Any) -> None:
    pose = {"type": "pose_keyframe", "frame": 30, "joint_rotations": {"leftUpperArm": QUARTER}}
    path = {"type": "root_path", "frames": [0, 59], "positions_xz": [[1, 2], [3, 2]], "heading_radians": [1.5, 1.5]}
    (sample,) = ask(url, skeleton, constraints=[pose, path])
    turn = sample["local_rot_mats"][30, sample["joint_names"].index("leftUpperArm")]
    np.testing.assert_allclose(turn, [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-5)
    found = positions(sample)
    np.testing.assert_allclose(found[[0, 59], 0][:, [0, 2]], path["positions_xz"], atol=1e-4)
    hips = found[0, HUMANOID.index("leftUpperLeg")] - found[0, HUMANOID.index("rightUpperLeg")]
    assert abs(np.arctan2(-hips[2], hips[0]) - 1.5) < 0.2  # its left is a quarter turn from where it faces


@pytest.mark.parametrize("name", ["motet", "mixamo"])
def test_a_walk_is_steered_along_a_path(url: str, skeleton: Any, name: str) -> None:
    """Its feet stand, on any figure, though the path is not that of the prompt's own walk."""
    given = skeleton if name == "motet" else sent(rig(name))
    frames = list(range(0, 90, 3))
    path = [[0.02 * frame, 0.03 * frame] for frame in frames]
    constraint = {"type": "root_path", "frames": frames, "positions_xz": path}
    segment = {**WALK, "duration_frames": 90}
    (sample,) = ask(url, given, segments=[segment], constraints=[constraint])
    found = positions(sample)
    np.testing.assert_allclose(found[frames, 0][:, [0, 2]], path, atol=1e-4)
    toes = [i for i, one in enumerate(sample["joint_names"]) if one.endswith(("Toes", "ToeBase"))]
    speeds = 30 * np.linalg.norm(np.diff(found[:, toes][..., [0, 2]], axis=0), axis=-1)
    assert np.median(speeds.min(axis=1)) < 0.15  # m/s, of the foot that stands


def test_without_a_prompt_it_goes_from_key_pose_to_key_pose(url: str, skeleton: Any) -> None:
    keys = [
        {"type": "pose_keyframe", "frame": 0, "joint_rotations": {"leftUpperArm": [0, 0, 0, 1]}, "fill_mode": "rest"},
        {
            "type": "pose_keyframe",
            "frame": 40,
            "joint_rotations": {"leftUpperArm": QUARTER},
            "root_position": [0, 0.98, 1],
            "fill_mode": "rest",
        },
    ]
    (sample,) = ask(url, skeleton, segments=[], duration_frames=60, constraints=keys)
    found, arm = positions(sample), sample["joint_names"].index("leftUpperArm")
    np.testing.assert_allclose(sample["local_rot_mats"][0], np.tile(np.eye(3), (27, 1, 1)), atol=1e-5)
    np.testing.assert_allclose(sample["local_rot_mats"][40, arm][:, 0], [0, 1, 0], atol=1e-5)
    np.testing.assert_allclose(found[40:, 0], np.tile([0, 0.98, 1], (20, 1)), atol=0.02)
    assert (np.diff(found[5:35, 0, 2]) > 0).all()  # it goes there


def test_a_loop_ends_as_it_began(url: str, skeleton: Any) -> None:
    (sample,) = ask(url, skeleton, options={"seed": 5, "loop": True})
    turns, root = sample["local_rot_mats"], positions(sample)[:, 0]
    np.testing.assert_allclose(turns[-1], turns[0], atol=1e-6)
    assert root[-1, 1] == pytest.approx(root[0, 1])
    steps = np.linalg.norm(np.diff(root, axis=0), axis=1)
    assert len(turns) == 60
    assert steps.max() < 3 * np.median(steps)  # it walks on where it leads back


def test_unknown_words_are_noted(url: str, skeleton: Any) -> None:
    segments = [{**WALK, "prompt": "a person zorbs and walks"}]
    notes = client.generate(url, body(skeleton, segments=segments))["extensions"]["MMCP_motion"]["notes"]
    assert any(note["code"] == "unknown_words" and "zorbs" in note["message"] for note in notes)


def key(frame: int = 0, **fields: Any) -> dict[str, Any]:
    return {"type": "pose_keyframe", "frame": frame, "joint_rotations": {"leftUpperArm": QUARTER}, **fields}


def pin(x: Any, frame: int = 0) -> dict[str, Any]:
    return {"type": "root_path", "frames": [frame], "positions_xz": [[x, 0]]}


NAN = float("nan")
TREE = {"joints": [{"name": "trunk", "parent": None, "rest_translation": [0, 1, 0], "rest_rotation": [0, 0, 0, 1]}]}


@pytest.mark.parametrize(
    ("request_", "code", "said"),
    [
        ({"model": "other"}, "unknown_model", "other"),
        ({"skeleton": TREE}, "invalid_skeleton", "human"),
        ({"constraints": [key(joint_rotations={"tail": QUARTER})]}, "unknown_joint", "tail"),
        ({"constraints": [key(60)]}, "frame_out_of_range", "60"),
        ({"constraints": [pin(0), pin(1)]}, "invalid_request", "two constraints"),
        (
            {"constraints": [key(), key(joint_rotations={"leftUpperArm": [0, 0, 0, 1]})]},
            "invalid_request",
            "two constr",
        ),
        ({"constraints": [key(root_position=[0, 1, 0]), pin(1)]}, "invalid_request", "two constraints"),
        ({"constraints": [pin(NAN)]}, "invalid_request", "finite"),
        ({"constraints": [pin(9, 59)]}, "invalid_request", "9.0 m at up to 1.92 m/s take 5.0 s"),
        ({"constraints": [key(joint_rotations={"leftUpperArm": [NAN, 0, 0, 1]})]}, "invalid_request", "no rotation"),
        ({"constraints": [key(joint_rotations={"leftUpperArm": [0, 0, 0, 0]})]}, "invalid_request", "no rotation"),
        ({"constraints": [key(root_position=[0, NAN, 0])]}, "invalid_request", "root_position"),
        ({"constraints": [{**pin(0), "type": "effector_target"}]}, "schema_validation", ""),
        (
            {
                "constraints": [
                    {"type": "effector_target", "joint": "leftHand", "frames": [0], "positions": [[0, 1, 0]]}
                ]
            },
            "unsupported_constraint",
            "effector_target",
        ),
        ({"segments": [{**WALK, "duration_frames": 10**6}]}, "invalid_options", "duration"),
        ({"timing": {"fps": float("inf")}}, "invalid_options", "fps"),
        ({"segments": [{**WALK, "duration_frames": 10**9}], "timing": {"fps": 1e8}}, "invalid_options", "fps"),
        ({"segments": [{**WALK, "seed": 3}]}, "invalid_options", "options.seed"),
        ({"segments": [{**WALK, "prompt": "zorb"}]}, "invalid_request", "zorb"),
        ({"options": {"seed": -1}}, "invalid_options", "seed"),
        ({"options": {"num_samples": 9}}, "invalid_options", "num_samples"),
        ({"options": {"loop": True}, "constraints": [pin(0)]}, "invalid_options", "loop"),
        ({"segments": [], "duration_frames": 60, "constraints": [key()]}, "invalid_request", "give two, or a prompt"),
        (
            {"segments": [], "duration_frames": 90, "constraints": [key(), key(89)]},
            "invalid_request",
            "at most 2 s are",
        ),
    ],
)
def test_what_cannot_be_answered_is_refused(url: str, skeleton: Any, request_: Any, code: str, said: str) -> None:
    content = json.dumps(body(**{"skeleton": skeleton, **request_})).encode()
    post = urllib.request.Request(f"{url}/generate", content)  # the SDK's client sends no NaN
    with pytest.raises(urllib.error.HTTPError) as refused:
        urllib.request.urlopen(post)
    error = json.load(refused.value)["error"]
    assert error["code"] == code, error
    assert said in error["message"]


def test_skeletons_that_are_turned_or_hold_no_numbers_are_refused(url: str, skeleton: Any) -> None:
    for field, value in (("rest_rotation", QUARTER), ("rest_translation", [0, NAN, 0])):
        joints = [*skeleton["joints"][:-1], {**skeleton["joints"][-1], field: value}]
        test_what_cannot_be_answered_is_refused(url, skeleton, {"skeleton": {"joints": joints}}, "invalid_skeleton", "")


def test_the_page_s_lines_for_blender(url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What they hand to Blender's importer is the motion that was asked for."""
    (lines,) = re.findall(r"^```py\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    imported: list[Motion] = []
    scene = SimpleNamespace(gltf=lambda filepath: imported.append(motet.read(filepath)))
    monkeypatch.setitem(sys.modules, "bpy", SimpleNamespace(ops=SimpleNamespace(import_scene=scene)))
    monkeypatch.chdir(tmp_path)
    exec(lines.replace("http://localhost:8000/mmcp", url), {})
    (motion,) = imported
    assert len(motion) == 150
    turned, found = global_transforms(motion)
    np.testing.assert_allclose(found[0, 0, [0, 2]], [1.0, 0.0], atol=1e-4)
    assert motion.skeleton
    shoulder, upper, lower = map(motion.skeleton.index, ("leftShoulder", "leftUpperArm", "leftLowerArm"))
    arm = turned[120, shoulder].T @ (found[120, lower] - found[120, upper])
    np.testing.assert_allclose(arm / np.linalg.norm(arm), [0, 1, 0], atol=1e-3)
