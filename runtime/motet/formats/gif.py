"""Write a motion as an animated GIF that loops: a figure on a ground, the camera beside it.

Delays of a GIF are whole hundredths of a second, and viewers slow down those under 2. So the picture rate is the
motion's where that gives a whole delay of at least 4, else 20 per second; real time is kept either way.
"""

import struct
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from motet.draw.figure import figure_of
from motet.draw.raster import GROUND, Indices, Stage, palette
from motet.files import write_whole
from motet.motion.motion import Motion
from motet.motion.resample import resampled
from motet.motion.rotations import Array

SIZE = 320
YAW = np.radians(40.0)
"""From how far beside its face the figure is seen."""

STILL = 0.5
"""A figure that stays within this many heights is seen by a camera that stands still."""

NOTICED = 28.0
"""A pixel of a bone keeps its colour until the right one is further from it than this: smaller files."""

BITS = 6
UNCHANGED = 2**BITS - 1
"""The palette's last index, shown as what was there before."""


def write(path: str | Path, motion: Motion, size: int = SIZE) -> None:
    """Write a square GIF of ``size`` pixels; MotionError for a motion without skeleton or frames."""
    figure = figure_of(motion)
    delay = delay_of(figure.fps)
    points = resampled(figure.points, figure.fps * delay / 100)
    visible = _visible()
    stage, targets = Stage(size, figure.heading + YAW), _targets(points[:, 0, ::2], 100 / delay)
    content = [_head(size)]
    shown = np.full((size, size), UNCHANGED, np.uint8)
    for pose, target in zip(points, targets, strict=True):
        picture = stage.picture(pose, figure.bones, target)
        changed = visible[shown, picture]
        shown = np.where(changed, picture, shown)
        content.append(_frame(shown, changed, delay))
    write_whole(path, b"".join(content) + b";")


def delay_of(fps: float) -> int:
    """Hundredths of a second from picture to picture for a motion of that frame rate."""
    whole = round(100 / fps)
    if whole >= 4 and abs(whole * fps - 100) < 1e-6:
        return whole
    return 5


def _targets(path: Array, fps: float) -> Array:
    """Where the camera looks (T, 2): the root's path (T, 2) without its sway, or the middle if it hardly moves."""
    if np.ptp(path, axis=0).max() < STILL:
        return np.tile((path.min(axis=0) + path.max(axis=0)) / 2, (len(path), 1))
    half = round(fps / 2)
    sums = np.concatenate([np.zeros((1, 2)), np.cumsum(path, axis=0)])
    at = np.arange(len(path))
    reach = np.minimum(np.minimum(at, len(path) - 1 - at), half)
    smooth: Array = (sums[at + reach + 1] - sums[at - reach]) / (2 * reach + 1)[:, None]
    return smooth


def _head(size: int) -> bytes:
    screen = struct.pack("<6sHHBBB", b"GIF89a", size, size, 0xF0 | (BITS - 1), 0, 0)
    forever = b"!\xff\x0bNETSCAPE2.0\x03\x01\x00\x00\x00"
    return screen + palette().tobytes() + forever


def _visible() -> NDArray[np.bool_]:
    """For two indices (64, 64) whether a pixel that shows the first must change to show the second."""
    colours = palette().astype(float)
    visible: NDArray[np.bool_] = np.linalg.norm(colours[:, None] - colours, axis=-1) > NOTICED
    ground = [*range(GROUND), UNCHANGED]
    visible[ground], visible[:, ground] = True, True
    return visible & ~np.eye(len(colours), dtype=bool)


def _frame(picture: Indices, changed: NDArray[np.bool_], delay: int) -> bytes:
    """One picture: only the rectangle that changed, and in it the pixels that did not as ``UNCHANGED``."""
    rows, columns = np.flatnonzero(changed.any(axis=1)), np.flatnonzero(changed.any(axis=0))
    top, bottom = (rows[0], rows[-1] + 1) if len(rows) else (0, 1)
    left, right = (columns[0], columns[-1] + 1) if len(columns) else (0, 1)
    part = np.where(changed, picture, UNCHANGED)[top:bottom, left:right]
    control = b"!\xf9\x04" + struct.pack("<BHBB", 0x05, delay, UNCHANGED, 0)
    place = b"," + struct.pack("<HHHHB", left, top, right - left, bottom - top, 0)
    return control + place + bytes([BITS]) + _blocks(compressed(part.tobytes(), BITS)) + b"\0"


def _blocks(content: bytes) -> bytes:
    parts = [content[start : start + 255] for start in range(0, len(content), 255)]
    return b"".join(bytes([len(part)]) + part for part in parts)


def compressed(pixels: bytes, bits: int) -> bytes:
    """Pixels under 2 ** bits by the LZW of GIF: codes of bits + 1 to 12 bits, the lowest bit first."""
    codes, widths = (np.array(numbers) for numbers in zip(*_codes(pixels, bits), strict=True))
    ends = np.cumsum(widths)
    first, shift = np.divmod(ends - widths, 8)
    shifted = codes << shift  # at most 12 + 7 bits: three bytes, and no two codes share a bit
    count = int(ends[-1] + 7) // 8 + 2
    parts = [np.bincount(first + byte, (shifted >> 8 * byte) & 255, count) for byte in range(3)]
    return bytes(np.sum(parts, axis=0).astype(np.uint8)[:-2])


def _codes(pixels: bytes, bits: int) -> list[tuple[int, int]]:
    """Codes with their widths; a full table of 4096 codes is dropped and starts anew."""
    clear, width = 1 << bits, bits + 1
    table: dict[int, int] = {}
    fresh = clear + 2
    codes = [(clear, width)]
    code = pixels[0]
    for pixel in pixels[1:]:
        key = code << 8 | pixel
        if key in table:
            code = table[key]
            continue
        codes.append((code, width))
        table[key] = fresh
        width += fresh == 1 << width
        fresh += 1
        if fresh == 4096:
            codes.append((clear, width))
            table, fresh, width = {}, clear + 2, bits + 1
        code = pixel
    last = width + (fresh == 1 << width and width < 12)
    return [*codes, (code, width), (clear + 1, last)]
