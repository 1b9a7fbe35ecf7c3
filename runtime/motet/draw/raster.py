"""Pictures of a figure as arrays of palette indices: round bones on a ground with squares and a shadow.

The camera looks at a target from a fixed direction, so what each pixel sees of the ground is computed once.
"""

import numpy as np
from numpy.typing import NDArray

from motet.draw.body import COLOURS, Bone
from motet.motion.rotations import Array

Pixels = NDArray[np.float32]
Indices = NDArray[np.uint8]

BACK, GRID, SHADOW = (232, 235, 241), (150, 158, 176), (166, 172, 186)
CELL, REACH = 0.5, 2.2
"""Side of the ground's squares, and how far from the target they have faded away, in heights."""

DISTANCE, FOCAL, PITCH, TARGET_HEIGHT = 3.4, 2.35, np.radians(12.0), 0.47
LIGHT = np.array([0.35, 1.0, 0.45]) / np.linalg.norm([0.35, 1.0, 0.45])
SOFT = 0.05
"""How far the edge of the shadow fades, in heights."""

MARGIN = 0.1
"""How far from a bone's ends its shadow can reach, in heights."""

GROUND, SHADES, EDGES = 9, 8, 4
"""Colours in the palette for the ground, for the light on each side, and for each side's edges."""


def palette() -> Indices:
    """Colours (64, 3), sRGB: the ground, then each side's shades, and edges half mixed with the back; unused black."""
    ground = np.concatenate([_ramp(BACK, SHADOW, 5), _ramp(BACK, GRID, 4)])
    light = np.linspace(0.3, 1.15, SHADES, dtype=np.float32)
    sides = [_lit(light, np.array(colour, np.float32)) for colour in COLOURS.values()]
    edges = [(side[:: SHADES // EDGES] + BACK) / 2 for side in sides]
    colours = np.concatenate([ground, *sides, *edges])
    return np.concatenate([colours, np.zeros((64 - len(colours), 3))]).astype(np.uint8)


def _ramp(start: tuple[int, int, int], end: tuple[int, int, int], count: int) -> Array:
    return np.linspace(start, end, count)


def _lit(light: Pixels, colour: Pixels) -> Pixels:
    """Colours (..., 3) under light (...): darker below 1, towards white above."""
    light = light[..., None]
    dark, bright = np.minimum(light, 1), np.maximum(light - 1, 0)
    lit: Pixels = colour * dark + (255 - colour) * (2 * bright)
    return lit


def nearest() -> Indices:
    """For each colour in steps of 8 (32, 32, 32) the index of the nearest one of the palette."""
    used = palette()[: _used()].astype(np.float32)
    axis = np.arange(32, dtype=np.float32) * 8 + 4
    cube = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 1, 3)
    indices: Indices = ((cube - used) ** 2).sum(-1).argmin(-1).astype(np.uint8).reshape(32, 32, 32)
    return indices


def _used() -> int:
    return GROUND + 3 * (SHADES + EDGES)


class Stage:
    """A square picture of ``size`` pixels, seen from ``yaw`` (radians about y; 0 looks at the +z side)."""

    def __init__(self, size: int, yaw: float) -> None:
        self.size = size
        sin, cos = np.sin(yaw), np.cos(yaw)
        toward = np.array([np.cos(PITCH) * sin, np.sin(PITCH), np.cos(PITCH) * cos])
        right = np.array([cos, 0.0, -sin])
        self.axes = np.stack([right, np.cross(toward, right), toward])
        lamp = self.axes @ LIGHT + [-0.3, 0.0, 0.6]
        self.lamp = lamp / np.linalg.norm(lamp)
        self.nearest = nearest()
        self._see_ground()

    def _see_ground(self) -> None:
        """Which pixels see the ground near the target, where (from the target), and how wide a pixel is there."""
        centre = (np.arange(self.size) + 0.5 - self.size / 2) / (FOCAL * self.size)
        x, y = np.meshgrid(centre, -centre)
        rays = x[..., None] * self.axes[0] + y[..., None] * self.axes[1] - self.axes[2]
        eye = DISTANCE * self.axes[2] + [0.0, TARGET_HEIGHT, 0.0]
        along = np.where(rays[..., 1] < -1e-3, -eye[1] / np.minimum(rays[..., 1], -1e-3), 1e3)
        places = (eye + along[..., None] * rays)[..., [0, 2]]
        widths = np.stack([np.hypot(*np.gradient(places[..., axis])) for axis in (0, 1)], axis=-1)
        away = np.linalg.norm(places, axis=-1)
        self.seen = np.flatnonzero(away < REACH)
        self.places = places.reshape(-1, 2)[self.seen].astype(np.float32)
        self.widths = np.maximum(widths.reshape(-1, 2)[self.seen], 1e-6).astype(np.float32)
        self.fade = ((1 - away.ravel()[self.seen] / REACH) ** 1.2).astype(np.float32)

    def picture(self, points: Array, bones: tuple[Bone, ...], target: Array) -> Indices:
        """Palette indices (size, size) of the points (P, 3) with the camera at ``target`` (x, z) on the ground."""
        image = np.empty((self.size, self.size, 3), np.float32)
        image[:] = BACK
        local = points - [target[0], 0.0, target[1]]
        self._draw_ground(image, local, bones, target)
        self._draw_bones(image, local, bones)
        red, green, blue = np.moveaxis(image.astype(np.uint8) >> 3, -1, 0)
        indices: Indices = self.nearest[red, green, blue]
        return indices

    def _draw_ground(self, image: Pixels, points: Array, bones: tuple[Bone, ...], target: Array) -> None:
        cells = (self.places + target.astype(np.float32)) / np.float32(CELL)
        away = np.abs(cells - np.round(cells)) * np.float32(CELL) / self.widths
        line = np.clip(1 - away.min(axis=-1), 0, 1) * self.fade
        colour = _mixed(np.array(BACK, np.float32), GRID, line)
        near, dark = self._shadow(points, bones)
        colour[near] = _mixed(colour[near], SHADOW, dark)
        image.reshape(-1, 3)[self.seen] = colour

    def _shadow(self, points: Array, bones: tuple[Bone, ...]) -> tuple[NDArray[np.intp], Pixels]:
        """Which of the seen pixels are near the figure's shadow, and how dark it is there."""
        flat = (points[:, [0, 2]] - points[:, 1:2] * (LIGHT[[0, 2]] / LIGHT[1])).astype(np.float32)
        near = _between(self.places, flat.min(axis=0) - MARGIN, flat.max(axis=0) + MARGIN)
        places, distance = self.places[near], np.full(len(near), SOFT, np.float32)
        for bone in bones:
            ends = flat[[bone.start, bone.end]]
            inside = _between(places, ends.min(axis=0) - MARGIN, ends.max(axis=0) + MARGIN)
            along, across, radius = _capsule(places[inside], ends, (bone.start_radius, bone.end_radius))
            distance[inside] = np.minimum(distance[inside], np.hypot(along, across) - radius)
        return near, np.clip(0.5 - distance / SOFT, 0, 1)

    def _draw_bones(self, image: Pixels, points: Array, bones: tuple[Bone, ...]) -> None:
        view = (points - [0.0, TARGET_HEIGHT, 0.0]) @ self.axes.T
        depth = DISTANCE - view[:, 2]
        scale = FOCAL * self.size / np.maximum(depth, 0.2)
        screen = np.stack([self.size / 2 + view[:, 0] * scale, self.size / 2 - view[:, 1] * scale], axis=-1)
        for bone in sorted(bones, key=lambda bone: -(depth[bone.start] + depth[bone.end])):
            ends = [bone.start, bone.end]
            radii = (bone.start_radius * float(scale[bone.start]), bone.end_radius * float(scale[bone.end]))
            self._draw_bone(image, screen[ends], radii, view[bone.end] - view[bone.start], bone.side)

    def _draw_bone(self, image: Pixels, ends: Array, radii: tuple[float, float], offset: Array, side: str) -> None:
        low = np.clip(np.floor(ends.min(axis=0) - max(radii) - 1), 0, self.size).astype(int)
        high = np.clip(np.ceil(ends.max(axis=0) + max(radii) + 1), 0, self.size).astype(int)
        if np.any(low >= high):
            return
        patch = image[low[1] : high[1], low[0] : high[0]]
        pixels = np.stack(np.meshgrid(*(np.arange(a, b) + 0.5 for a, b in zip(low, high, strict=True))), axis=-1)
        along, across, radius = _capsule(pixels.astype(np.float32), ends.astype(np.float32), radii)
        outside = np.hypot(along, across) - radius
        light = self._light(across / radius, ends, offset)
        light[outside > -1.2] *= 0.8
        colour = _lit(light, np.array(COLOURS[side], np.float32))
        patch[:] = _mixed(patch, colour, np.clip(0.5 - outside, 0, 1))

    def _light(self, across: Pixels, ends: Array, offset: Array) -> Pixels:
        """Light on a cylinder at places across it, from -1 to 1."""
        axis = offset / max(float(np.linalg.norm(offset)), 1e-9)
        way = ends[1] - ends[0]
        way = way / max(float(np.hypot(*way)), 1e-9)
        sideways = np.array([-way[1], -way[0], 0.0])
        front = np.array([0.0, 0.0, 1.0]) - 0.8 * axis[2] * axis
        place = np.clip(across, -1, 1)
        beside, before = float(sideways @ self.lamp), float(front @ self.lamp / np.linalg.norm(front))
        toward = place * beside + np.sqrt(1 - place * place) * before
        light: Pixels = 0.34 + 0.78 * ((1 + toward) / 2) ** 1.5
        return light


def _between(places: Pixels, low: Pixels, high: Pixels) -> NDArray[np.intp]:
    """Indices of the places (N, 2) in a rectangle."""
    x, y = places[:, 0], places[:, 1]
    return np.flatnonzero((x > low[0]) & (x < high[0]) & (y > low[1]) & (y < high[1]))


def _capsule(places: Pixels, ends: Pixels, radii: tuple[float, float]) -> tuple[Pixels, Pixels, Pixels]:
    """For places (..., 2) how far each is beyond the ends, how far across (signed), and the radius there."""
    way = ends[1] - ends[0]
    length = max(float(np.hypot(*way)), 1e-6)
    x, y = (places[..., 0] - ends[0, 0], places[..., 1] - ends[0, 1])
    along, across = (x * way[0] + y * way[1]) / length, (y * way[0] - x * way[1]) / length
    inside = np.clip(along, 0, length)
    return along - inside, across, radii[0] + (radii[1] - radii[0]) * inside / np.float32(length)


def _mixed(under: Pixels, over: NDArray[np.float32] | tuple[int, int, int], part: Pixels) -> Pixels:
    """Colours (..., 3) with ``part`` (...) of the second one."""
    mixed: Pixels = under + (np.asarray(over, np.float32) - under) * part[..., None]
    return mixed
