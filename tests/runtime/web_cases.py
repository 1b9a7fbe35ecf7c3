"""Writes the golden cases of figures and files for runtime/web: ``python tests/runtime/web_cases.py``.

runtime/web/tests/cases.json holds files as text or base64, and what Python gives for them: positions on the humanoid
and back on the figure, frames for models, and a motion with its feet held.
"""

import base64
import json
from collections.abc import Mapping
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from gltf_files import read_document, write_clips, write_document
from renamed import names_of
from small_character import QUARTER, character, packed

from motet import load
from motet.figures.humanoid import BONES, HUMANOID, MIXAMO, from_humanoid, rig, to_humanoid
from motet.figures.humanoid.alignment import AXES_TURNS
from motet.formats import bvh, read_motion, write_motion
from motet.formats.text import with_names
from motet.motion.kinematics import global_transforms, motion_of, positions, skeleton_of
from motet.motion.motion import Motion
from motet.motion.rotations import Array, inverse, product, rotated
from motet.motion.skeleton import Joint, Skeleton

HERE = Path(__file__).parent
WEB = HERE.parents[1] / "runtime" / "web" / "tests"
CASES = WEB / "cases.json"

BACK = ("bandai-namco", "biped", "in line", "mixamo", "rigify", "unreal")
"""Skeletons that motions are brought back onto."""


def walking(frames: int, fps: float) -> Motion:
    """The humanoid walking along z on a bend, with arms that swing, in three seconds four steps; its feet slide."""
    time = np.arange(frames) / fps
    phase = 2 * np.pi * time / 1.5
    angles = {
        "hips.ry": 8 * np.sin(phase) + 6 * time,
        "spine.rx": 4 + 2 * np.sin(2 * phase),
        "head.ry": -5 * np.sin(phase),
    }
    for side, sign in (("left", 1.0), ("right", -1.0)):
        swing = sign * np.sin(phase)
        bend = np.maximum(0, sign * np.cos(phase))
        angles |= {f"{side}UpperLeg.rx": -25 * swing - 20 * bend, f"{side}LowerLeg.rx": 5 + 45 * bend}
        angles |= {f"{side}Foot.rx": 12 * swing - 8 * bend, f"{side}UpperArm.rz": -sign * 70 + 0 * time}
        angles |= {f"{side}UpperArm.ry": -sign * 20 * swing, f"{side}LowerArm.ry": -sign * 25 + 5 * swing}
    channels = [f"{bone}.r{axis}" for bone in BONES for axis in "xyz"]
    still = np.zeros(frames)
    place = [0.2 * np.sin(0.5 * time), 0.95 + 0.02 * np.cos(2 * phase), 1.1 * time]
    values = np.stack([*place, *(angles.get(name, still) for name in channels)], axis=1)
    names = (*(f"hips.t{axis}" for axis in "xyz"), *channels)
    return Motion(values, names, ("m",) * 3 + ("deg",) * len(channels), fps, HUMANOID)


def in_line(motion: Motion) -> Motion:
    """The same motion on joints with other axes, so that the rest pose is no body's."""
    skeleton, (turns, places) = skeleton_of(motion), global_transforms(motion)
    axes = AXES_TURNS[np.random.default_rng(5).integers(len(AXES_TURNS), size=len(skeleton.joints))]
    offsets = [axes[max(joint.parent, 0)].T @ np.array(joint.offset) for joint in skeleton.joints]
    joints = tuple(
        Joint(joint.name, joint.parent, (float(x), float(y), float(z)))
        for joint, (x, y, z) in zip(skeleton.joints, offsets, strict=True)
    )
    return motion_of(
        Skeleton(joints), product(turns, np.broadcast_to(axes, turns.shape)), {0: places[:, 0]}, motion.fps
    )


def lying_axes(motion: Motion) -> Motion:
    """The same motion with z up."""
    skeleton, (turns, places) = skeleton_of(motion), global_transforms(motion)
    turn = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    joints = tuple(
        replace(joint, offset=tuple(float(x) for x in turn @ np.array(joint.offset))) for joint in skeleton.joints
    )
    around = product(product(np.broadcast_to(turn, turns.shape), turns), inverse(np.broadcast_to(turn, turns.shape)))
    return motion_of(Skeleton(joints), around, {0: rotated(turn, places[:, 0])}, motion.fps)


def text_of(motion: Motion) -> str:
    file = BytesIO()
    bvh.write(file, motion)
    return file.getvalue().decode()


def rounded(values: Array) -> Any:
    return np.round(values, 5).tolist()


def texts() -> dict[str, str]:
    """BVH files of a walk, by name: plain; at rest in no body's pose; with z up; under other names."""
    walk = from_humanoid(walking(25, 16.0), MIXAMO)
    prefixed = [name.replace("mixamorig:", "Avatar01_") for name in skeleton_of(walk).names]
    found = {"walk": walk, "in line": in_line(walk), "z up": lying_axes(walk), "prefixed": with_names(walk, prefixed)}
    numbered = [f"12|{name}_{i:03}" for i, name in enumerate(skeleton_of(walk).names)]
    found["numbered"] = with_names(walk[:1], numbered)
    for title in ("MikuMikuDance", "Blender metarig"):
        found[title] = with_names(walk[:1], names_of(walk, title))
    return {name: text_of(motion) for name, motion in found.items()}


def figures(texts: Mapping[str, str]) -> dict[str, Any]:
    """What becomes of BVH files: those given, and the skeletons of the tests of retargeting."""
    motions = {file.stem: read_motion(file) for file in sorted((HERE / "skeletons").glob("*.bvh"))}
    motions |= {name: read_motion(BytesIO(text.encode()), format="bvh") for name, text in texts.items()}
    found: dict[str, Any] = {}
    for name, motion in motions.items():
        humanoid = to_humanoid(motion)
        found[name] = {"convention": humanoid.convention, "confidence": humanoid.confidence, "unit": humanoid.unit}
        found[name]["places"] = rounded(positions(humanoid.motion)[:: 4 if name in texts else 1])
        if name in texts:
            found[name]["text"] = texts[name]
        if name in BACK:
            found[name]["back"] = rounded(positions(from_humanoid(humanoid.motion[:4], motion)))
    return found


def files(folder: Path) -> dict[str, bytes]:
    """glTF files of a walk: a character whose hips hang below a scale and a turn, the same as a VRM avatar, a .vrma,
    a figure whose skin moves the head alone, and one whose chest has a scale that shears its arms."""
    tilted = ({"scale": [0.01] * 3, "rotation": [QUARTER, 0, 0, QUARTER]},)
    walk = walking(12, 30.0)
    write_motion(folder / "moving.glb", walk, onto=character(folder / "plain.glb", tilted))
    document, binary = read_document(folder / "moving.glb")
    bones = with_vrm_bones(document)
    (folder / "avatar.vrm").write_bytes(packed({**document, "extensions": bones}, binary))
    write_motion(folder / "walk.vrma", walk)
    write_clips(
        folder / "head.glb",
        [("motion", from_humanoid(walking(6, 30.0), rig("rigify")))],
        skin=("spine.004", "spine.006"),
    )
    document, binary = read_document(write_clips(folder / "plain.glb", [("motion", walking(6, 30.0))]))
    next(node for node in document["nodes"] if node["name"] == "chest")["scale"] = [1.2, 0.9, 1.1]
    write_document(folder / "sheared.glb", document, binary)
    names = ("moving.glb", "avatar.vrm", "walk.vrma", "head.glb", "sheared.glb")
    return {name: (folder / name).read_bytes() for name in names}


def scenes(files: Mapping[str, bytes]) -> dict[str, Any]:
    """Where the joints of glTF files are, and the humanoid's."""
    found = {}
    for name, content in files.items():
        motion = read_motion(BytesIO(content), format=Path(name).suffix, clip=1)
        found[name] = {
            "base64": base64.b64encode(content).decode(),
            "joints": list(skeleton_of(motion).names),
            "fps": motion.fps,
            "own": rounded(positions(motion)[::5]),
            "places": rounded(positions(to_humanoid(motion).motion)[::5]),
        }
    return found


def with_vrm_bones(document: dict[str, Any]) -> dict[str, Any]:
    """VRM's map of bones to the nodes of a small character, whose names then tell nothing; it has no finger."""
    known = to_humanoid(Motion(np.zeros((1, 0)), (), (), 1.0, MIXAMO)).joints
    of = {name: bone for bone, names in known.items() for name in names if bone not in ("spine", "neck")}
    of |= dict(zip(known["spine"], ("spine", "chest", "upperChest"), strict=True)) | {known["neck"][0]: "neck"}
    bones = {}
    for at, node in enumerate(document["nodes"]):
        if node.get("name") in of:
            bones[of[node["name"]]] = {"node": at}
            node["name"] = f"bone {at}"
    return {"VRMC_vrm": {"specVersion": "1.0", "humanoid": {"humanBones": bones}}}


def frames(text: str) -> dict[str, Any]:
    """Name of a bundle -> the frames that it takes of a BVH file, and where they put the humanoid's joints."""
    motion = read_motion(BytesIO(text.encode()), format="bvh")
    found: dict[str, Any] = {}
    for name in ("describe", "predict", "generate"):
        model = load(name)
        contract = model.contract
        values = contract.frames(contract.on_figure(model.at_own_rate(motion)) if name == "predict" else motion)
        found[name] = {
            "frames": rounded(values),
            "places": rounded(positions(contract.motion(values, plant=False))[::8]),
        }
    return found


def feet(frames: Array) -> dict[str, Any]:
    """Frames of the bundle generate with their feet held, and where they put the humanoid's joints."""
    contract = load("generate").contract
    held = contract.features(frames, plant=True)
    places = positions(contract.motion(frames))[::8]
    return {"frames": rounded(frames), "held": rounded(held.values), "places": rounded(places)}


def cases(texts: Mapping[str, str], files: Mapping[str, bytes], sliding: Array) -> dict[str, Any]:
    """All of them."""
    return {
        "figures": figures(texts),
        "scenes": scenes(files),
        "frames": frames(texts["walk"]),
        "feet": feet(sliding),
    }


if __name__ == "__main__":
    with TemporaryDirectory() as name:
        sliding = load("generate").contract.frames(walking(45, 30.0))
        found = cases(texts(), files(Path(name)), np.round(sliding, 5))
        CASES.write_text(json.dumps(found, separators=(",", ":")) + "\n", "utf-8")
