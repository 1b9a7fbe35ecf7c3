"""Write a motion as a looping animated GIF: a figure on a ground, the camera beside it. Pillow draws and packs it.

GIF delays are whole hundredths of a second, and viewers slow down those under 2. So the picture rate is the motion's
if that gives a whole delay of at least 4, else 20 per second; either way it plays in real time.
"""

import io

import numpy as np
from PIL import Image

from motet.draw.figure import figure_of
from motet.draw.stage import Stage
from motet.files import File, write_whole
from motet.motion.motion import Motion, resampled
from motet.motion.rotations import Array

YAW = np.radians(40.0)
"""Camera yaw relative to the figure's facing direction."""


def write(file: File, motion: Motion, size: int = 320) -> None:
    """Write a square GIF of ``size`` pixels; MotionError for a motion without skeleton or frames."""
    figure = figure_of(motion)
    delay = delay_of(figure.fps)
    points = resampled(figure.points, figure.fps * delay / 100)
    stage, targets = Stage(size, figure.heading + YAW), _targets(points[:, 0, ::2], 100 / delay)
    pictures = (stage.picture(pose, figure.bones, target) for pose, target in zip(points, targets, strict=True))
    first = next(pictures).quantize(64)
    rest = (picture.quantize(palette=first, dither=Image.Dither.NONE) for picture in pictures)
    content = io.BytesIO()
    first.save(content, "GIF", save_all=True, append_images=rest, duration=10 * delay, loop=0, optimize=False)
    write_whole(file, content.getvalue())


def delay_of(fps: float) -> int:
    """Hundredths of a second per picture for a motion of that frame rate."""
    whole = round(100 / fps)
    if whole >= 4 and abs(whole * fps - 100) < 1e-6:
        return whole
    return 5


def _targets(path: Array, fps: float) -> Array:
    """The camera's target (T, 2): the root's path (T, 2) without its sway, or the middle if it hardly moves."""
    # within half a height the camera stands still
    if np.ptp(path, axis=0).max() < 0.5:
        return np.tile((path.min(axis=0) + path.max(axis=0)) / 2, (len(path), 1))
    half = round(fps / 2)
    sums = np.concatenate([np.zeros((1, 2)), np.cumsum(path, axis=0)])
    at = np.arange(len(path))
    reach = np.minimum(np.minimum(at, len(path) - 1 - at), half)
    smooth: Array = (sums[at + reach + 1] - sums[at - reach]) / (2 * reach + 1)[:, None]
    return smooth
