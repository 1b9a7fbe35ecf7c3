"""Write a motion as a looping animated GIF: a figure on a ground, the camera beside it. Pillow draws and packs it.

GIF delays are whole hundredths of a second, and viewers slow down those under 2. So the picture rate is the motion's
if that gives a whole delay of at least 4, else 20 per second; either way it plays in real time. Bones are round, the
ground has squares and a shadow.
"""

import io

import numpy as np
from PIL import Image, ImageDraw, ImageFilter

from motet.draw.figure import COLOURS, YAW, Bone, camera_axes, figure_of
from motet.files import File, write_whole
from motet.motion.motion import Motion, resampled
from motet.motion.rotations import Array

Colour = tuple[int, int, int]

BACK = (232, 235, 241)
LINES = (150, 158, 176)
SHADE = (166, 172, 186)

LIGHT = np.array([0.35, 1.0, 0.45])
"""Towards the light."""

ANGLES = np.arange(12) * np.pi / 6
CIRCLE = np.stack([np.cos(ANGLES), 0 * ANGLES, np.sin(ANGLES)], axis=1)
"""On the ground."""

DRAWN_LARGER = 3
"""Pictures are drawn larger by this factor and scaled down, for smooth edges."""


def write(file: File, motion: Motion, size: int = 320) -> None:
    """Write a square GIF of ``size`` pixels; MotionError for a motion without skeleton or frames."""
    figure = figure_of(motion)
    delay = delay_of(figure.fps)
    points = resampled(figure.points, figure.fps * delay / 100)
    stage = Stage(size, figure.heading + YAW)
    targets = _targets(points[:, 0, ::2], 100 / delay)
    pictures = (stage.picture(pose, figure.bones, target) for pose, target in zip(points, targets, strict=True))
    first = next(pictures).quantize(64)
    rest = (picture.quantize(palette=first, dither=Image.Dither.NONE) for picture in pictures)
    content = io.BytesIO()
    first.save(content, "GIF", save_all=True, append_images=rest, duration=10 * delay, loop=0, optimize=False)
    write_whole(file, content.getvalue())


def delay_of(fps: float) -> int:
    """Hundredths of a second per picture for a motion of that frame rate."""
    whole = round(100 / fps)
    return whole if whole >= 4 and abs(whole * fps - 100) < 1e-6 else 5


def _targets(path: Array, fps: float) -> Array:
    """The camera's target (T, 2): the root's path (T, 2) without its sway, or the middle if it hardly moves."""
    if np.ptp(path, axis=0).max() < 0.5:  # within half a height the camera stands still
        return np.tile((path.min(axis=0) + path.max(axis=0)) / 2, (len(path), 1))
    sums = np.concatenate([np.zeros((1, 2)), np.cumsum(path, axis=0)])
    at = np.arange(len(path))
    reach = np.minimum(np.minimum(at, len(path) - 1 - at), round(fps / 2))
    smooth: Array = (sums[at + reach + 1] - sums[at - reach]) / (2 * reach + 1)[:, None]
    return smooth


class Stage:
    """A square picture of ``size`` pixels, seen from ``yaw`` (radians about y; 0 looks at the +z side)."""

    def __init__(self, size: int, yaw: float) -> None:
        self.size = size
        self.pixels = size * DRAWN_LARGER
        self.axes = camera_axes(yaw)

    def picture(self, points: Array, bones: tuple[Bone, ...], target: Array) -> Image.Image:
        """The points (P, 3), in heights, joined by bones, with the camera at ``target`` (x, z) on the ground."""
        image = Image.new("RGB", (self.pixels, self.pixels), BACK)
        draw = ImageDraw.Draw(image)
        local = points - [target[0], 0.0, target[1]]
        self._draw_ground(draw, target)
        image.paste(SHADE, mask=self._shadow(local, bones))
        # bones from the furthest to the nearest
        screen, scale = self._seen(local)
        for bone in sorted(bones, key=lambda bone: float(scale[bone.start] + scale[bone.end])):
            ends = [bone.start, bone.end]
            _draw_bone(draw, screen[ends], np.array([bone.start_radius, bone.end_radius]) * scale[ends], bone.side)
        return image.resize((self.size, self.size), Image.Resampling.BOX)

    def _seen(self, places: Array) -> tuple[Array, Array]:
        """Pixels (N, 2) where places (N, 3) from the target are seen, and how many pixels a height has there (N,).

        The camera is 3.4 heights away from a point .47 heights above the target.
        """
        view = (places - [0.0, 0.47, 0.0]) @ self.axes.T
        scale = 2.35 * self.pixels / np.maximum(3.4 - view[:, 2], 0.2)
        return self.pixels / 2 + view[:, :2] * [1, -1] * scale[:, None], scale

    def _draw_ground(self, draw: ImageDraw.ImageDraw, target: Array, cell: float = 0.5, reach: float = 2.2) -> None:
        """Lines of squares of ``cell`` heights, fainter the further they are from the target, up to ``reach``."""
        steps = np.arange(-reach, reach + cell, cell / 2)
        middles = (steps[1:] + steps[:-1]) / 2
        for axis in (0, 2):
            across = np.ceil((steps + target[axis // 2]) / cell) * cell - target[axis // 2]
            for place in np.unique(np.round(across, 9)):
                line = np.zeros((len(steps), 3))
                line[:, axis] = place
                line[:, 2 - axis] = steps
                self._draw_line(draw, line, np.clip(1 - np.hypot(place, middles) / reach, 0, 1) ** 1.2)

    def _draw_line(self, draw: ImageDraw.ImageDraw, line: Array, shares: Array) -> None:
        """A line through places (N, 3), each piece of it as dark as its share (N - 1,) of 1."""
        pixels = self._seen(line)[0].tolist()
        for start, end, share in zip(pixels[:-1], pixels[1:], shares.tolist(), strict=True):
            draw.line([*start, *end], fill=_mixed(BACK, LINES, share), width=DRAWN_LARGER - 1)

    def _shadow(self, points: Array, bones: tuple[Bone, ...]) -> Image.Image:
        """How much of a shadow there is at each pixel."""
        mask = Image.new("L", (self.pixels, self.pixels))
        draw = ImageDraw.Draw(mask)
        flat = points - points[:, 1:2] * LIGHT / LIGHT[1]
        for bone in bones:
            start = self._disc(flat[bone.start], bone.start_radius)
            end = self._disc(flat[bone.end], bone.end_radius)
            for i in range(len(start)):
                draw.polygon([start[i - 1], start[i], end[i], end[i - 1]], fill=255)
            draw.polygon(start, fill=255)
            draw.polygon(end, fill=255)
        return mask.filter(ImageFilter.GaussianBlur(self.pixels / 160))

    def _disc(self, middle: Array, radius: float) -> list[tuple[float, ...]]:
        """Pixels around a disc that lies on the ground."""
        return list(map(tuple, self._seen(middle + radius * CIRCLE)[0].tolist()))


def _draw_bone(draw: ImageDraw.ImageDraw, ends: Array, radii: Array, side: str) -> None:
    """A round bone between pixels (2, 2): a rim, the side, and what faces the light."""
    for share, light in ((1.0, 0.68), (0.82, 0.86), (0.5, 1.0)):
        lifted = ends - np.array([0.25, 0.3]) * ((1 - share) * radii)[:, None]
        _draw_capsule(draw, lifted, share * radii, _mixed((0, 0, 0), COLOURS[side], light))


def _draw_capsule(draw: ImageDraw.ImageDraw, ends: Array, radii: Array, colour: Colour) -> None:
    """Two discs at ``ends`` (2, 2), and all between them."""
    way = ends[1] - ends[0]
    beside = np.array([-way[1], way[0]]) / max(float(np.hypot(*way)), 1e-9)
    a, b = map(tuple, (ends + beside * radii[:, None]).tolist())
    c, d = map(tuple, (ends - beside * radii[:, None]).tolist())
    draw.polygon([a, b, d, c], fill=colour)
    for (x, y), radius in zip(ends.tolist(), radii.tolist(), strict=True):
        draw.ellipse([x - radius, y - radius, x + radius, y + radius], fill=colour)


def _mixed(under: Colour, over: Colour, part: float) -> Colour:
    red, green, blue = (round(a + (b - a) * part) for a, b in zip(under, over, strict=True))
    return red, green, blue
