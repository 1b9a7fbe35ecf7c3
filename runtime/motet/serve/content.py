"""The content of answers: the bytes of motion files, as commands write them, and motions as JSON."""

import json
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from motet.draw.page import Captions
from motet.draw.page import write as write_page
from motet.files import Json
from motet.formats import Character, shaped, write_all_on, write_on
from motet.motion.kinematics import local_rotations, local_translations, skeleton_of
from motet.motion.motion import Motion
from motet.motion.rotations import Array, rotmat_to_quat
from motet.serve.uploads import Upload

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


@dataclass(frozen=True)
class Order:
    """What an answer with a motion is to be, as plain values.

    form: a format out of MEDIA. title: of a page, or of the clip in a character's file. captions: of a page.
    onto: whether the character itself is given with the motion. details: the other entries of an answer in JSON.
    """

    form: str
    title: str
    fps: float | None = None
    in_place: bool = False
    onto: bool = False
    captions: Captions | None = None
    details: Json = field(default_factory=dict)


def content_of(motion: Motion, order: Order, character: Character | None) -> bytes:
    """The content of an answer: a motion, on a character if there is one, as it is ordered; errors as of writers."""
    motion = shaped(motion, character, order.fps, order.in_place)
    if order.form == "json":
        return as_json({**order.details, "seconds": motion.duration, **figure_of(motion), **frames_of(motion)})
    file = Upload(b"", f"motion.{order.form}")
    if order.onto and character:
        write_all_on(file, {order.title: motion}, character)
    elif order.form == "html":
        write_page(file, motion, order.captions, order.title)
    else:
        write_on(file, motion, character)
    return file.getvalue()


def frames_of(motion: Motion) -> Json:
    """The frames of a motion for JSON: of each joint that moves from its parent its "translations" (T, 3) by name, in
    the skeleton's unit, and "rotations" (T, J, 4) of all joints, quaternions (x, y, z, w) in the parent's frame."""
    moving = dict.fromkeys(name[:-3] for name in motion.channels if name[-3:] in (".tx", ".ty", ".tz"))
    places = local_translations(motion)
    skeleton = skeleton_of(motion)
    return {
        "translations": {name: rounded(places[:, skeleton.places[name]]) for name in moving if name in skeleton.places},
        "rotations": rounded(rotmat_to_quat(local_rotations(motion))),
    }


def figure_of(motion: Motion) -> Json:
    """The skeleton and the frame rate of a motion, for JSON."""
    skeleton = skeleton_of(motion)
    return {"fps": motion.fps, "metres_per_unit": skeleton.metres_per_unit, "joints": skeleton.outline()}


def rounded(values: Array) -> list[Any]:
    """Values for JSON, to five decimals: hundredths of millimetres."""
    lists: list[Any] = np.round(values, 5).tolist()
    return lists


def as_json(value: Any) -> bytes:
    """What is said as JSON that is as short as it can be."""
    return json.dumps(value, separators=(",", ":"), allow_nan=False).encode()
