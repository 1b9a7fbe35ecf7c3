"""A motion as a strip of poses: the player's body in a few moments with its shadow, as triangles, and in SVG."""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from motet.draw.body import INKS
from motet.draw.figure import YAW, camera_axes
from motet.draw.mesh import Mesh, normals_of
from motet.draw.skinned import Skinned, person, skinned
from motet.motion.motion import Motion
from motet.motion.rotations import Array, unit

SUN = unit(np.array([0.42, 1.0, 0.5]))
"""Towards the sun."""

POSE_WIDTH = 110
POSE_HEIGHT = 190
"""Pixels of a pose."""


class Shape(NamedTuple):
    """A pose as it is seen, from the ground under its root: triangles (F, 3, 2) in heights, y up, those behind first;
    their colours (F, 3), 0 to 255; and the triangles of its shadow (S, 3, 2)."""

    triangles: Array
    inks: Array
    shadow: Array


def strip(motion: Motion, poses: int = 5) -> str:
    """The SVG of a motion in some of its poses, from its first frame to its last. MotionError as of the page."""
    drawn = [_drawn(shape, number) for number, shape in enumerate(shapes(motion, poses))]
    return f'<svg viewBox="0 0 {POSE_WIDTH * poses} {POSE_HEIGHT}" xmlns="http://www.w3.org/2000/svg">{"".join(drawn)}</svg>'


def shapes(motion: Motion, poses: int) -> Iterator[Shape]:
    """The shapes of :func:`strip`."""
    figure = skinned(motion)
    figure = replace(figure, mesh=person(1)) if figure.mesh is person() else figure
    turns, places = figure.frames()
    places = places - places[:, :1] * [1, 0, 1]
    for at in np.linspace(0, len(turns) - 1, poses).round().astype(int):
        yield _shape(figure, figure.corners(turns[at], places[at]))


def _shape(figure: Skinned, corners: Array) -> Shape:
    """A figure with corners (V, 3) in heights."""
    triangles = figure.mesh.triangles
    right, up, toward = camera_axes(figure.heading + YAW)
    axes = np.stack([right, up], axis=1)
    # the triangles that face the camera, the furthest first
    a, b, c = corners[triangles.T]
    normals = unit(np.cross(b - a, c - a))
    order = np.argsort((a + b + c) @ toward)
    shown = order[(normals @ toward)[order] > 0]
    # the shadow is of those that face the sun
    flat = corners - corners[:, 1:2] * SUN / SUN[1]
    shadow = (flat @ axes)[triangles[normals @ SUN > 0]]
    return Shape((corners @ axes)[triangles[shown]], lit(figure.mesh, corners)[shown], shadow)


def lit(mesh: Mesh, corners: Array) -> Array:
    """The colours of a mesh's triangles (F, 3) as light falls on them, whose corners are rounded off."""
    normals = unit(normals_of(corners, mesh.triangles)[mesh.triangles].sum(axis=1))
    light = 0.55 + 0.1 * normals[:, 1] + 0.45 * np.maximum(normals @ SUN, 0)
    inks = INKS[mesh.parts[mesh.triangles[:, 0]]]
    return np.clip(inks * light[:, None], 0, 255)


def _drawn(shape: Shape, number: int) -> str:
    """A pose of the strip by its number, after its shadow."""
    origin = [POSE_WIDTH * (number + 0.5), POSE_HEIGHT - 14]
    # from one pose to the next 0.75 of a height
    scale = POSE_WIDTH / 0.75 * np.array([1, -1])
    shadow = "".join(_paths(origin + scale * shape.shadow))
    body = []
    for path, ink in zip(_paths(origin + scale * shape.triangles), shape.inks.astype(np.uint8), strict=True):
        body.append(f'<path d="{path}" style="--c:#{ink.tobytes().hex()}"/>')
    return f'<path d="{shadow}" opacity=".2"/><g class="body">{"".join(body)}</g>'


def _paths(corners: Array) -> list[str]:
    """Triangles (F, 3, 2) as the commands of paths, to a tenth of a pixel."""
    return [f"M{a:.1f} {b:.1f}L{c:.1f} {d:.1f} {e:.1f} {f:.1f}Z" for a, b, c, d, e, f in corners.reshape(-1, 6)]
