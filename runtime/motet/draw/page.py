"""Self-contained pages: a template with the parts that all pages share, and the data for its script.

A motion is written as one HTML page with a player: no network, no other file, any browser with WebGL 2. The page is
``player.html`` with bodies and figures inserted as JSON; arrays are base64 of little-endian bytes. A body is a mesh
(:mod:`motet.draw.mesh`) in body heights: corners as int16 in steps of ``step``, normals as int8, the weights of
a corner's joints as uint8. A figure holds the path of its root as float32 (T, 3); of each joint that turns its
quaternion x, y, z, w in the parent's frame as int16 (T, N, 4); and of each joint that moves in its parent's frame its
place there as int16 (T, M, 3) in steps of ``step`` heights.
"""

import json
import math
import re
from base64 import b64encode
from collections.abc import Sequence
from html import escape
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motet.draw.mesh import Mesh
from motet.draw.skinned import Skinned, person, skinned
from motet.errors import MotionError
from motet.files import File, Json, place_of, write_whole
from motet.motion.motion import Motion
from motet.motion.rotations import Array, rotmat_to_quat

LARGEST_INT16 = 32767
"""The largest int16."""

SCOPE = "const openStage = (() => {{\n{}\nreturn openStage;\n}})();"
"""What keeps the names of the stage's scripts apart from those of a page."""

Captions = Sequence[tuple[float, str]]
"""Timed captions: (start in seconds, text), each shown until the next starts."""


def write(file: File, motion: Motion, captions: Captions | None = None, title: str | None = None) -> None:
    """Write the page of one motion, with timed captions and a title (the file's name if None).

    MotionError for a motion without skeleton or frames, OutputError if the file cannot be written.
    """
    _write(file, [(skinned(motion), "", captions)], title)


def write_many(
    file: File, motions: Sequence[Motion], names: Sequence[str], title: str | None = None, bare: Sequence[str] = ()
) -> None:
    """Write one page of several motions side by side on one clock, each with its name; errors like :func:`write`.

    bare: names of those that are shown as the bones of their own skeletons, even if they are people.
    """
    if not motions or len(motions) != len(names):
        raise MotionError(f"a page needs motions and a name for each, not {len(motions)} and {len(names)} names")
    shown = zip(motions, names, strict=True)
    _write(file, [(skinned(motion, name in bare), name, None) for motion, name in shown], title)


def _write(file: File, shown: Sequence[tuple[Skinned, str, Captions | None]], title: str | None) -> None:
    title = place_of(file).stem if title is None else title
    meshes = []
    bodies = []
    figures = []
    for figure, name, captions in shown:
        if figure.mesh not in meshes:  # bodies of people are one
            meshes.append(figure.mesh)
            bodies.append(body_data(figure.mesh, figure.rest))
        figures.append({"body": meshes.index(figure.mesh), **figure_data(figure, name, captions)})
    write_whole(file, filled(source("motet.draw", "player.html"), title, {"bodies": bodies, "figures": figures}))


def figure_data(figure: Skinned, name: str, captions: Captions | None = None) -> Json:
    """A figure in the player's format, ready for JSON; see the module's docstring."""
    return {
        "name": name,
        "fps": figure.fps,
        "frames": len(figure.turns),
        "heading": figure.heading,
        "captions": _captions_data(captions or ()),
        "parents": figure.skeleton.parents.tolist(),
        "offsets": np.round(figure.moves[0], 5).tolist(),
        "scales": np.round(figure.scales, 4).tolist(),
        "root": _text(figure.moves[:, 0], "<f4"),
        **_turns_data(figure.turns),
        **_moves_data(figure.moves),
    }


def _captions_data(captions: Captions) -> list[list[Any]]:
    starts = [start for start, _ in captions]
    if not all(map(math.isfinite, starts)) or starts != sorted(starts):
        raise MotionError(f"caption start times must not decrease: {starts}")
    return [[float(start), text] for start, text in captions]


def _turns_data(turns: Array) -> Json:
    """The joints that turn, and their quaternions."""
    turning = np.abs(turns - np.eye(3)).max(axis=(0, 2, 3)) >= 1e-6
    quaternions = rotmat_to_quat(turns[:, turning])
    return {"turning": np.flatnonzero(turning).tolist(), "turns": _text(np.round(quaternions * LARGEST_INT16), "<i2")}


def _moves_data(moves: Array) -> Json:
    """The joints that move in their parents' frames, and their places there in steps."""
    moving = np.flatnonzero(np.ptp(moves[:, 1:], axis=0).max(axis=-1) > 1e-5) + 1
    step = float(max(1e-4, np.abs(moves[:, moving]).max(initial=0) / LARGEST_INT16))
    return {"step": step, "moving": moving.tolist(), "moves": _text(np.round(moves[:, moving] / step), "<i2")}


def body_data(mesh: Mesh, rest: Array) -> Json:
    """A mesh in heights and where its joints rest (K, 3), as pages hold them, see the module's docstring; of the body
    of people also coarser ones, each within the last, for shadows and for figures that are small."""
    body: Json = {"rest": np.round(rest, 5).tolist(), **_mesh_data(mesh)}
    if mesh is person():
        finer = body
        for level in (1, 2):
            coarse = _mesh_data(person(level))
            finer["coarse"] = coarse
            finer = coarse
    return body


def _mesh_data(mesh: Mesh) -> Json:
    step = float(np.abs(mesh.places).max() / LARGEST_INT16)
    return {
        "step": step,
        "places": _text(np.round(mesh.places / step), "<i2"),
        "normals": _text(np.round(mesh.normals * 127), "<i1"),
        "joints": _text(mesh.joints, "<u2"),
        "weights": _text(mesh.shares, "<u1"),
        "parts": _text(mesh.parts, "<u1"),
        "triangles": _text(mesh.triangles, "<u4"),
    }


def _text(values: NDArray[Any], kind: str) -> str:
    return b64encode(values.astype(kind).tobytes()).decode()


def filled(template: str, title: str, data: Json, **parts: str) -> str:
    """The HTML of a template: ``{{TITLE}}``, ``{{DATA}}`` (as JSON), the parts of all pages, and ``parts`` by name."""
    stage = "\n".join(source("motet.draw", file) for file in ("gl.js", "skin.js", "ground.js", "scene.js"))
    texts = {
        "STYLE": source("motet.draw", "page.css"),
        "NUMBERS": source("motet.draw", "numbers.js"),
        "STAGE": f"{source('motet.draw', 'stage.js')}\n{SCOPE.format(stage)}",
        "TITLE": escape(title),
        "DATA": json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c"),
        **parts,
    }
    return re.sub(r"\{\{([A-Z]+)\}\}", lambda place: texts[place[1]], template)


def source(package: str, file: str) -> str:
    """A text file of a package."""
    return (files(package) / file).read_text(encoding="utf-8").rstrip("\n")
