import io
from importlib.util import find_spec

import numpy as np
import pytest
from figures import walker

from motet.draw.figure import figure_of
from motet.errors import OutputError
from motet.formats import check_writable, write_motion

if find_spec("PIL") is None:
    pytest.skip("pictures need Pillow, out of the extra plot", allow_module_level=True)

from PIL import Image

from motet.draw import gif
from motet.draw.gif import DRAWN_LARGER, Stage
from motet.draw.skinned import skinned
from motet.motion.motion import resampled


def frames_of(content):
    image = Image.open(io.BytesIO(content))
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


def test_every_frame_reads_back_as_drawn_but_for_the_palette(tmp_path):
    motion = walker(frames=20, fps=20)
    figure = skinned(motion)
    gif.write(tmp_path / "walk.gif", motion, size=96)
    frames, _, _ = frames_of((tmp_path / "walk.gif").read_bytes())
    turns, places = figure.frames()
    stage, targets = Stage(96, figure.heading + gif.YAW), gif._targets(places[:, 0, ::2], 20)
    for shown, turned, place, target in zip(frames, turns, places, targets, strict=True):
        drawn = np.array(stage.picture(figure.mesh, figure.corners(turned, place), target), float)
        away = np.linalg.norm(shown - drawn, axis=-1)
        assert away.mean() < 4
        assert np.quantile(away, 0.99) < 42


def test_a_joint_is_drawn_where_the_camera_sees_it():
    """By hand: from the front (+z) x goes right, y up, and what is nearer is larger."""
    stage = Stage(100, 0.0)
    middle, right, up, near = np.array([[0, 0.47, 0], [0.1, 0.47, 0], [0, 0.57, 0], [0, 0.47, 1.0]])
    places, scale = stage._seen(np.array([middle, right, up, near]))
    assert places[0] == pytest.approx([50 * DRAWN_LARGER, 50 * DRAWN_LARGER])
    assert scale[0] == pytest.approx(2.35 * 100 * DRAWN_LARGER / 3.4)
    assert places[1] - places[0] == pytest.approx([0.1 * scale[0], 0])
    assert places[2][0] == pytest.approx(places[0][0])
    assert places[2][1] < places[0][1]
    assert scale[3] > scale[0]


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


def test_still_camera_for_a_figure_that_stays():
    path = np.array([[0.0, 0.0], [0.2, 0.1], [0.1, 0.4]])
    assert np.all(gif._targets(path, 20) == [0.1, 0.2])
    walk = np.stack([np.linspace(0, 5, 50), np.zeros(50)], axis=1)
    assert gif._targets(walk, 20) == pytest.approx(walk)


def test_without_pillow_the_command_that_installs_it_is_said(tmp_path, monkeypatch):
    monkeypatch.setattr("motet.formats.find_spec", lambda name: None)
    with pytest.raises(OutputError, match=r"the package PIL: install the extra with  pip install 'motet\[plot\]'"):
        check_writable(tmp_path / "a.gif")
