import io
from dataclasses import replace

import numpy as np
import pytest
from figures import walker

from motet.draw.figure import figure_of
from motet.draw.raster import Stage, palette
from motet.errors import MotionError
from motet.formats import gif, write_motion
from motet.motion.resample import resampled


def frames_of(content):
    image = pytest.importorskip("PIL.Image").open(io.BytesIO(content))
    frames, delays = [], []
    for n in range(image.n_frames):
        image.seek(n)
        frames.append(np.array(image.convert("RGB")))
        delays.append(image.info["duration"])
    return np.array(frames), delays, image.info["loop"]


def test_gif_keeps_real_time_and_loops(tmp_path):
    write_motion(tmp_path / "walk.gif", walker(frames=60))
    frames, delays, loop = frames_of((tmp_path / "walk.gif").read_bytes())
    assert frames.shape == (30, 320, 320, 3)
    assert delays == [50] * 30
    assert loop == 0


def test_every_frame_reads_back_as_drawn(tmp_path):
    motion = walker(frames=20, fps=20)
    figure = figure_of(motion)
    gif.write(tmp_path / "walk.gif", motion, size=96)
    frames, _, _ = frames_of((tmp_path / "walk.gif").read_bytes())
    stage, targets = Stage(96, figure.heading + gif.YAW), gif._targets(figure.points[:, 0, ::2], 20)
    for shown, pose, target in zip(frames, figure.points, targets, strict=True):
        drawn = palette()[stage.picture(pose, figure.bones, target)].astype(float)
        assert np.linalg.norm(shown - drawn, axis=-1).max() <= gif.NOTICED


def test_figure_stands_in_the_picture(tmp_path):
    gif.write(tmp_path / "walk.gif", walker(frames=40), size=128)
    frames, _, _ = frames_of((tmp_path / "walk.gif").read_bytes())
    orange = (frames[..., 0] > 150) & (frames[..., 2] < 100)
    blue = (frames[..., 2] > 150) & (frames[..., 0] < 100)
    assert orange.sum(axis=(1, 2)).min() > 50
    assert blue.sum(axis=(1, 2)).min() > 50
    assert not (orange | blue)[:, [0, -1]].any()
    assert np.any(frames[0] != frames[-1])


@pytest.mark.parametrize(("fps", "delay"), [(120, 5), (40, 5), (30, 5), (25, 4), (20, 5), (12.5, 8), (10, 10), (7, 5)])
def test_delay(fps, delay):
    assert gif.delay_of(fps) == delay


def test_slow_motion_is_interpolated():
    figure = figure_of(walker(frames=14, fps=7))
    points = resampled(figure.points, 7 / 20)
    assert len(points) == 38
    assert points[0] == pytest.approx(figure.points[0])
    assert points[20] == pytest.approx(figure.points[7])
    assert points[-1] == pytest.approx(figure.points[13], abs=0.05)


@pytest.mark.parametrize("seed", range(6))
def test_compression_is_undone_by_pillow(seed):
    random = np.random.default_rng(seed)
    height, width = random.integers(1, 130, 2)
    picture = random.integers(0, (1, 2, 63)[seed % 3] + 1, (height, width)).astype(np.uint8) % 63
    if seed < 3:
        picture[: height // 2] = 7
    size = 130
    full = np.zeros((size, size), np.uint8)
    full[:height, :width] = picture
    content = gif._head(size) + gif._frame(full, np.ones((size, size), bool), 5) + b";"
    frames, _, _ = frames_of(content)
    assert np.all(frames[0] == palette()[full])


def test_frame_without_change_is_tiny():
    shown = np.full((50, 50), 3, np.uint8)
    assert len(gif._frame(shown, np.zeros((50, 50), bool), 5)) < 32


def test_still_camera_for_a_figure_that_stays():
    path = np.array([[0.0, 0.0], [0.2, 0.1], [0.1, 0.4]])
    assert np.all(gif._targets(path, 20) == [0.1, 0.2])
    walk = np.stack([np.linspace(0, 5, 50), np.zeros(50)], axis=1)
    assert gif._targets(walk, 20) == pytest.approx(walk)


def test_what_cannot_be_shown_is_refused(tmp_path):
    with pytest.raises(MotionError, match="no skeleton"):
        gif.write(tmp_path / "bad.gif", replace(walker(), skeleton=None))
    with pytest.raises(MotionError, match="no frames"):
        gif.write(tmp_path / "bad.gif", walker()[:0])
    assert not list(tmp_path.iterdir())
