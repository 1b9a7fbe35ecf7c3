"""The content of answers: the bytes of motion files, as commands write them, and motions as JSON."""

import json
from typing import Any

import numpy as np

from motet.draw.page import Captions
from motet.draw.page import write as write_page
from motet.formats import ONTO, Character, put_onto, read_character, write_all_on, write_on
from motet.motion.humanoid import rig
from motet.motion.kinematics import local_rotations, local_translations, skeleton_of
from motet.motion.motion import Motion
from motet.motion.root_motion import in_place
from motet.motion.rotations import Array, rotmat_to_quat
from motet.serve.asked import Asked, RequestError, Upload
from motet.serve.limits import Limits

MEDIA = {
    "bvh": "text/plain; charset=utf-8",
    "glb": "model/gltf-binary",
    "vrma": "model/gltf-binary",
    "vrm": "model/gltf-binary",
    "npz": "application/octet-stream",
    "csv": "text/csv; charset=utf-8",
    "html": "text/html; charset=utf-8",
    "json": "application/json",
}
"""The formats of answers, by their extensions, and their media types."""


def character_of(asked: Asked, form: str, limits: Limits) -> Character | None:
    """What a motion is to be put on: the file "like" or "onto", or the rig "like". RequestError where that does not go
    with the format, or the frame rate is out of range; FormatError for a file that is no character."""
    like, onto = asked.files.get("like") or asked.settings.get("like"), asked.files.get("onto")
    if not 0 < asked.settings.get("fps", 1.0) <= limits.fps:
        raise RequestError(f"fps: expected more than 0 and at most {limits.fps:g}, not {asked.settings['fps']:g}")
    if like and onto:
        raise RequestError("'like' gives only the motion, 'onto' the character with it: give one of the two")
    if onto is None and form == "vrm":
        raise RequestError("a .vrm is an avatar: give the file of one as 'onto', or ask for .vrma")
    if onto is not None and f".{form}" not in ONTO:
        raise RequestError(f"'onto' gives the character itself: ask for {' or '.join(ONTO)}, not .{form}")
    given = onto or like
    if isinstance(given, str):
        return Character(Motion(np.zeros((1, 0)), (), (), 1.0, rig(given)))
    return None if given is None else read_character(given)


def shaped(motion: Motion, asked: Asked, character: Character | None) -> Motion:
    """A motion as "like", "onto", "fps" and "in_place" ask for it."""
    motion = put_onto(motion, character) if character else motion
    motion = motion.resample(asked.settings["fps"]) if "fps" in asked.settings else motion
    return in_place(motion) if asked.settings.get("in_place") else motion


def file_of(
    motion: Motion, form: str, asked: Asked, character: Character | None, title: str, captions: Captions | None = None
) -> bytes:
    """The bytes of a motion file of a shaped motion, in a format out of MEDIA but JSON; errors as of its writer.

    title: of a page, or of the clip in a character's file. captions: of a page.
    """
    file = Upload(b"", f"motion.{form}")
    if "onto" in asked.files and character:
        write_all_on(file, {title: motion}, character)
    elif form == "html":
        write_page(file, motion, captions, title)
    else:
        write_on(file, motion, character)
    return file.getvalue()


def frames_of(motion: Motion) -> dict[str, Any]:
    """The frames of a motion for JSON: of each joint that moves from its parent its "translations" (T, 3) by name, in
    the skeleton's unit, and "rotations" (T, J, 4) of all joints, quaternions (x, y, z, w) in the parent's frame."""
    moving = dict.fromkeys(name[:-3] for name in motion.channels if name[-3:] in (".tx", ".ty", ".tz"))
    places, skeleton = local_translations(motion), skeleton_of(motion)
    return {
        "translations": {name: rounded(places[:, skeleton.places[name]]) for name in moving if name in skeleton.places},
        "rotations": rounded(rotmat_to_quat(local_rotations(motion))),
    }


def figure_of(motion: Motion) -> dict[str, Any]:
    """The skeleton and the frame rate of a motion, for JSON."""
    skeleton = skeleton_of(motion)
    joints = [{"name": one.name, "parent": one.parent, "offset": list(one.offset)} for one in skeleton.joints]
    return {"fps": motion.fps, "metres_per_unit": skeleton.metres_per_unit, "joints": joints}


def rounded(values: Array) -> list[Any]:
    """Values for JSON, to five decimals: hundredths of millimetres."""
    found: list[Any] = np.round(values, 5).tolist()
    return found


def as_json(said: Any) -> bytes:
    """What is said as JSON that is as short as it can be."""
    return json.dumps(said, separators=(",", ":"), allow_nan=False).encode()
