"""Write a motion as a looping animated GIF: a figure on a ground, the camera beside it. Pillow draws and packs it.

GIF delays are whole hundredths of a second, and viewers slow down those under 2. So the picture rate is the motion's
if that gives a whole delay of at least 4, else 20 per second; either way it plays in real time. The body is the
player's, the ground has squares and a shadow.
"""

import io

import numpy as np
from PIL import Image, ImageDraw, ImageFilter

from motet.draw.figure import YAW, camera_axes
from motet.draw.mesh import Mesh, normals_of
from motet.draw.skinned import skinned
from motet.draw.svg import SUN, lit
from motet.files import File, write_whole
from motet.motion.motion import Motion, resampled
from motet.motion.rotations import Array

Colour = tuple[int, int, int]

BACKGROUND = (232, 235, 241)

DRAWN_LARGER = 3
"""Pictures are drawn larger by this factor and scaled down, for smooth edges."""


def write(file: File, motion: Motion, size: int = 320) -> None:
    """Write a square GIF of ``size`` pixels; MotionError for a motion without skeleton or frames."""
    figure = skinned(motion)
    delay = delay_of(figure.fps)
    # corners go straight from frame to frame where turns and places do
    turns, places = (resampled(values, figure.fps * delay / 100) for values in figure.frames())
    stage = Stage(size, figure.heading + YAW)
    targets = _targets(places[:, 0, ::2], 100 / delay)
    bodies = map(figure.corners, turns, places)
    pictures = (stage.picture(figure.mesh, body, target) for body, target in zip(bodies, targets, strict=True))
    first = next(pictures).quantize(128)
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

    def picture(self, mesh: Mesh, corners: Array, target: Array) -> Image.Image:
        """A mesh with corners (V, 3), in heights, and the camera at ``target`` (x, z) on the ground."""
        image = Image.new("RGB", (self.pixels, self.pixels), BACKGROUND)
        draw = ImageDraw.Draw(image)
        local = corners - [target[0], 0.0, target[1]]
        self._draw_ground(draw, target)
        normals = normals_of(corners, mesh.triangles)[mesh.triangles[:, 0]]
        image.paste((166, 172, 186), mask=self._shadow(local[mesh.triangles[normals @ SUN > -0.3]]))
        self._draw_body(draw, mesh, corners, *self._seen(local))
        return image.resize((self.size, self.size), Image.Resampling.BOX)

    def _draw_body(self, draw: ImageDraw.ImageDraw, mesh: Mesh, corners: Array, screen: Array, scale: Array) -> None:
        """The triangles that face the camera, from the furthest to the nearest."""
        seen = screen[mesh.triangles]
        order = np.argsort(scale[mesh.triangles].sum(axis=1))
        is_facing = np.linalg.det(np.diff(seen, axis=1)) < 0
        shown = order[is_facing[order]]
        inks = lit(mesh, corners)[shown].astype(int)
        for triangle, ink in zip(seen[shown].reshape(-1, 6).tolist(), inks.tolist(), strict=True):
            draw.polygon(triangle, fill=tuple(ink))

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
            draw.line([*start, *end], fill=_mixed(BACKGROUND, (150, 158, 176), share), width=DRAWN_LARGER - 1)

    def _shadow(self, triangles: Array) -> Image.Image:
        """How much of a shadow of triangles (F, 3, 3) there is at each pixel."""
        mask = Image.new("L", (self.size, self.size))
        draw = ImageDraw.Draw(mask)
        flat = triangles - triangles[..., 1:2] * SUN / SUN[1]
        for triangle in (self._seen(flat.reshape(-1, 3))[0] / DRAWN_LARGER).reshape(-1, 6).tolist():
            draw.polygon(triangle, fill=255)
        return mask.filter(ImageFilter.GaussianBlur(self.size / 160)).resize((self.pixels, self.pixels))


def _mixed(under: Colour, over: Colour, part: float) -> Colour:
    red, green, blue = (round(a + (b - a) * part) for a, b in zip(under, over, strict=True))
    return red, green, blue
