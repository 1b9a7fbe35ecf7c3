"""Pictures of a figure, drawn by Pillow: round bones on a ground with squares and a shadow, the camera beside it."""

import numpy as np
from PIL import Image, ImageDraw, ImageFilter

from motet.draw.body import COLOURS, Bone
from motet.motion.rotations import Array

Colour = tuple[int, int, int]

BACK, GRID, SHADOW = (232, 235, 241), (150, 158, 176), (166, 172, 186)
CELL, GRID_REACH = 0.5, 2.2
"""Side of the ground's squares, and how far from the target they have faded away, in heights."""

DISTANCE, FOCAL, PITCH, TARGET_HEIGHT = 3.4, 2.35, np.radians(12.0), 0.47
LIGHT = np.array([0.35, 1.0, 0.45])
"""Where the light comes from."""

DRAWN_LARGER = 3
"""Pictures are drawn larger by this factor and scaled down, for smooth edges."""

CIRCLE = np.stack([np.cos(np.arange(12) * np.pi / 6), 0 * np.arange(12), np.sin(np.arange(12) * np.pi / 6)], axis=1)


class Stage:
    """A square picture of ``size`` pixels, seen from ``yaw`` (radians about y; 0 looks at the +z side)."""

    def __init__(self, size: int, yaw: float) -> None:
        self.size, self.pixels = size, size * DRAWN_LARGER
        sin, cos = np.sin(yaw), np.cos(yaw)
        toward = np.array([np.cos(PITCH) * sin, np.sin(PITCH), np.cos(PITCH) * cos])
        right = np.array([cos, 0.0, -sin])
        self.axes = np.stack([right, np.cross(toward, right), toward])

    def picture(self, points: Array, bones: tuple[Bone, ...], target: Array) -> Image.Image:
        """The points (P, 3), in heights, joined by bones, with the camera at ``target`` (x, z) on the ground."""
        image = Image.new("RGB", (self.pixels, self.pixels), BACK)
        draw = ImageDraw.Draw(image)
        local = points - [target[0], 0.0, target[1]]
        self._draw_ground(draw, target)
        image.paste(SHADOW, mask=self._shadow(local, bones))
        screen, scale = self._seen(local)
        for bone in sorted(bones, key=lambda bone: float(scale[bone.start] + scale[bone.end])):
            ends = [bone.start, bone.end]
            radii = np.array([bone.start_radius, bone.end_radius]) * scale[ends]
            for share, light in ((1.0, 0.68), (0.82, 0.86), (0.5, 1.0)):  # a rim, the side, and what faces the light
                lifted = screen[ends] - np.array([0.25, 0.3]) * ((1 - share) * radii)[:, None]
                _capsule(draw, lifted, share * radii, _lit(COLOURS[bone.side], light))
        return image.resize((self.size, self.size), Image.Resampling.BOX)

    def _seen(self, places: Array) -> tuple[Array, Array]:
        """Pixels (N, 2) where places (N, 3) from the target are seen, and how many pixels a height has there (N,)."""
        view = (places - [0.0, TARGET_HEIGHT, 0.0]) @ self.axes.T
        scale = FOCAL * self.pixels / np.maximum(DISTANCE - view[:, 2], 0.2)
        return self.pixels / 2 + view[:, :2] * [1, -1] * scale[:, None], scale

    def _draw_ground(self, draw: ImageDraw.ImageDraw, target: Array) -> None:
        """Lines of the squares, piece by piece, each fainter the further it is from the target."""
        steps = np.arange(-GRID_REACH, GRID_REACH + CELL, CELL / 2)
        for axis in (0, 1):
            across = np.ceil((steps + target[axis]) / CELL) * CELL - target[axis]
            for place in np.unique(np.round(across, 9)):
                line = np.zeros((len(steps), 3))
                line[:, 2 * axis], line[:, 2 - 2 * axis] = place, steps
                fade = np.clip(1 - np.hypot(place, (steps[1:] + steps[:-1]) / 2) / GRID_REACH, 0, 1) ** 1.2
                seen = self._seen(line)[0].tolist()
                for start, end, part in zip(seen[:-1], seen[1:], fade.tolist(), strict=True):
                    draw.line([*start, *end], fill=_mixed(BACK, GRID, part), width=DRAWN_LARGER - 1)

    def _shadow(self, points: Array, bones: tuple[Bone, ...]) -> Image.Image:
        """How much of a shadow there is at each pixel."""
        mask = Image.new("L", (self.pixels, self.pixels))
        draw = ImageDraw.Draw(mask)
        flat = points - points[:, 1:2] * LIGHT / LIGHT[1]
        for bone in bones:
            rings = [flat[end] + radius * CIRCLE for end, radius in _ends(bone)]
            start, end = (list(map(tuple, self._seen(ring)[0].tolist())) for ring in rings)
            for i in range(len(CIRCLE)):
                draw.polygon([start[i - 1], start[i], end[i], end[i - 1]], fill=255)
            draw.polygon(start, fill=255)
            draw.polygon(end, fill=255)
        return mask.filter(ImageFilter.GaussianBlur(self.pixels / 160))


def _ends(bone: Bone) -> tuple[tuple[int, float], tuple[int, float]]:
    return (bone.start, bone.start_radius), (bone.end, bone.end_radius)


def _capsule(draw: ImageDraw.ImageDraw, ends: Array, radii: Array, colour: Colour) -> None:
    """Two discs at ``ends`` (2, 2), and all between them."""
    way = ends[1] - ends[0]
    beside = np.array([-way[1], way[0]]) / max(float(np.hypot(*way)), 1e-9)
    (a, b), (c, d) = ends + beside * radii[:, None], ends - beside * radii[:, None]
    draw.polygon([tuple(corner) for corner in (a.tolist(), b.tolist(), d.tolist(), c.tolist())], fill=colour)
    for (x, y), radius in zip(ends.tolist(), radii.tolist(), strict=True):
        draw.ellipse([x - radius, y - radius, x + radius, y + radius], fill=colour)


def _lit(colour: Colour, light: float) -> Colour:
    return _mixed((0, 0, 0), colour, light)


def _mixed(under: Colour, over: Colour, part: float) -> Colour:
    red, green, blue = (round(a + (b - a) * part) for a, b in zip(under, over, strict=True))
    return red, green, blue
