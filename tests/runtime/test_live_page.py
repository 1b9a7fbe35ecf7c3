import json
import re
import shutil
import subprocess
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from browser import CHROMIUM, Browser

import motet
from motet.draw.page import source
from motet.errors import BundleError, ControlError, OutputError
from motet.figures.humanoid import BONES, T_POSE
from motet.live.page import live_body, net_data
from motet.steering.model import SteerModel

NODE = shutil.which("node")
PLAN = [
    ("walk", 1.3, 0, 0),
    ("walk", 1.2, 80, 80),
    ("walk", 0.2, 60, 80),
    ("run", 3, 80, 80),
    ("run", 1.5, -120, -60),
    ("walk", 0, 0, -70),
]
"""Gait, m/s, direction and facing in degrees, for a second and a half each."""


def test_a_page_needs_no_other_file(tmp_path: Path, steer_model: SteerModel) -> None:
    motet.write_live_page(tmp_path / "live.html", steer_model, 2, title="a <b> </script>")
    text = (tmp_path / "live.html").read_text(encoding="utf-8")
    assert len(text) < 2_500_000
    assert not re.search(r"https?:|//[a-z]+\.|@import|url\(|\ssrc=|\{\{", text)
    assert "default-src 'none'" in text
    assert "<title>a &lt;b&gt; &lt;/script&gt;</title>" in text
    assert text.count("</script>") == 2
    assert motet.live_page(steer_model) == motet.live_page(steer_model)


def test_what_cannot_be_steered_is_refused(tmp_path: Path, steer_model: SteerModel) -> None:
    for characters in (0, 51, 2.5):
        with pytest.raises(ControlError, match="characters must be a whole number from 1 to 50"):
            motet.write_live_page(tmp_path / "live.html", steer_model, characters)  # type: ignore[arg-type]
    with pytest.raises(BundleError, match="is not steered"):
        motet.live_page(motet.load("tdbn"))
    with pytest.raises(OutputError):
        motet.write_live_page(tmp_path / "none" / "live.html", steer_model)
    assert not list(tmp_path.iterdir())


def test_the_body_stands_where_the_humanoid_does() -> None:
    body = live_body()
    assert np.array(body["rest"]) * body["height"] == pytest.approx(T_POSE, abs=1e-4)
    assert body["height"] == pytest.approx(1.76)


@pytest.mark.skipif(NODE is None, reason="there is no node")
def test_the_script_of_the_page_does_what_python_does(steer_model: SteerModel) -> None:
    session, controls, poses = steer_model.start(), [], []
    session.tick()  # a figure of the page is shown from its first tick on
    for gait, speed, way, towards in PLAN:
        session.control(gait=gait, speed=speed, direction=way, facing=towards)
        x, z, facing = session.target[0].tolist()
        told = {"x": x, "z": z, "facing": facing, "gait": steer_model.gaits.index(gait)}
        controls += [told] * 45
        poses += [session.tick() for _ in range(45)]
    found = run_loop({"script": source("motet.live", "control.js"), "net": net_data(steer_model), "controls": controls})
    assert np.ptp([pose.ground[0, :2] for pose in poses], axis=0).min() > 1.5  # it goes somewhere
    for ours, pose in zip(poses, found["poses"], strict=True):
        np.testing.assert_allclose(pose["ground"], ours.ground[0], atol=1e-9)
        np.testing.assert_allclose(pose["places"], ours.positions()[0], atol=1e-5)
        np.testing.assert_allclose(pose["rotations"], ours.rotations[0].ravel(), atol=1e-5)
        # those of planned steps are heights of feet over 4.5 cm, and rounded as these are
        np.testing.assert_allclose(pose["contacts"], ours.contacts[0], atol=1e-5)


def run_loop(given: dict[str, Any]) -> Any:
    assert NODE is not None
    command = [NODE, str(Path(__file__).with_name("live_loop.mjs"))]
    done = subprocess.run(command, input=json.dumps(given), capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory, steer_model: SteerModel) -> Any:
    """The page of three figures in a browser."""
    if CHROMIUM is None:
        pytest.skip("there is no Chromium")
    folder = tmp_path_factory.mktemp("live")
    motet.write_live_page(folder / "live.html", steer_model, 3)
    with Browser(folder / "profile") as browser:
        browser.emulate(prefers_reduced_motion="reduce")
        browser.open(folder / "live.html", ready="window.motet")
        yield browser


def ticks(page: Browser, count: int = 45) -> SimpleNamespace:
    """Where the steered figure is, and how its speed is, after so many ticks with what is pressed."""
    told = f"(() => {{ for (let n = 0; n < {count}; n++) motet.tick(motet.command());"
    told += " const { root, velocity } = motet.figures[0]; return { root, velocity }; })()"
    figure = page.value(told)
    return SimpleNamespace(place=np.array(figure["root"][:2]), facing=figure["root"][2], going=figure["velocity"])


def test_keys_steer_the_figure(page: Browser) -> None:
    page.value("motet.state.pause = true")
    away = np.radians(page.value("motet.view.yaw")) + np.pi
    ahead, left = (np.array([np.sin(way), np.cos(way)]) for way in (away, away + np.pi / 2))
    first = ticks(page)
    assert np.hypot(*first.place) < 0.2  # nothing is pressed
    page.key("KeyW", "w", down=True)
    walked = ticks(page, 60)
    assert 1.5 < (walked.place - first.place) @ ahead < 3
    assert np.cos(walked.facing - away) > 0.9
    page.key("ShiftLeft", "Shift", down=True)
    assert (ticks(page, 60).place - walked.place) @ ahead > 3
    page.key("ShiftLeft", "Shift", down=False)
    page.key("KeyW", "w", down=False)
    page.key("ArrowLeft", "ArrowLeft", down=True)
    before = ticks(page, 60)
    turned = ticks(page, 30)
    assert (turned.place - before.place) @ left > 0.7
    assert np.cos(turned.facing - away - np.pi / 2) > 0.9
    page.key("ArrowLeft", "ArrowLeft", down=False)
    stopped, later = ticks(page, 75), ticks(page, 30)
    assert np.hypot(*stopped.going) < 0.02
    assert np.hypot(*(later.place - stopped.place)) < 0.2  # it shifts its weight
    assert page.errors == []


def test_a_sentence_lets_the_figure_go_in_a_style(page: Browser) -> None:
    page.value("motet.state.pause = true")
    chest = BONES.index("chest")
    held = f"[...motet.figures[0].pose.rotations.slice({4 * chest}, {4 * chest + 4})]"
    bends = []
    for said, read in (("walk", "walk"), ("walk like an old man", "walk (old)"), ("walk normally", "walk")):
        assert page.value(f"motet.obey({said!r})") == read
        ticks(page, 60)
        bends.append(page.value(held)[0])
    assert bends[1] > max(bends[0], bends[2]) + 0.05
    page.value("motet.obey('stop')")
    ticks(page, 60)


RUNS = """new Promise((done) => {
  const start = motet.ticks;
  const look = () => (motet.ticks >= start + 10 ? done(true) : setTimeout(look, 10));
  look();
})"""


def test_the_page_runs_and_draws(page: Browser) -> None:
    page.value("motet.state.pause = false")
    assert page.value(RUNS)
    # both colours, each from where it is seen: how far the figures have gone depends on the clock
    yaw = page.value("motet.view.yaw")
    colours = []
    for turn in (0, 90, 180, 270):
        page.value(f"motet.view.yaw = {yaw + turn}")
        colours.append(page.coloured())
    page.value(f"motet.view.yaw = {yaw}")
    assert np.max(colours, axis=0).min() > 30
    assert page.picture().startswith(b"\x89PNG")


DRAWN = """(async () => {
  const { painter } = motet.scene, draw = painter.draw.bind(painter);
  const frame = () => new Promise((done) => requestAnimationFrame(done));
  let count = 0;
  painter.draw = (...given) => { draw(...given); count++; };
  const inFrames = async (frames, enough) => {
    count = 0;
    for (let n = 0; n < frames && count < enough; n++) await frame();
    return count;
  };
  const calm = async () => { for (let n = 0; n < 60 && await inFrames(30, Infinity); n++); };
  motet.state.pause = true;
  await calm();
  const counts = [await inFrames(30, Infinity)];
  for (const change of [() => motet.stage.turn(5, 0), () => document.body.click()]) {
    change();
    counts.push(await inFrames(600, 1));
    await calm();
  }
  delete painter.draw;
  return counts;
})()"""
"""Pictures that are drawn while a paused page is left alone, is turned, and is clicked."""


def test_a_paused_page_draws_only_what_changes(page: Browser) -> None:
    still, turned, clicked = page.value(DRAWN)
    assert still == 0
    assert min(turned, clicked) > 0


def test_buttons_and_the_stick(page: Browser) -> None:
    page.value("motet.state.pause = true")
    assert page.value("[...document.querySelectorAll('button')].every((b) => b.textContent.trim() || b.ariaLabel)")
    names = page.value("[...document.querySelectorAll('#gaits button')].map((b) => b.firstChild.textContent)")
    assert [name.lower() for name in names] == page.value("motet.net.gaits")
    page.key("Digit2", "2", down=True)
    page.key("Digit2", "2", down=False)
    assert page.value("[...document.querySelectorAll('#gaits button')].map((b) => b.ariaPressed)")[1] == "true"
    page.value("document.querySelector('#more').open = true")
    page.value("document.querySelector('#others').value = 1, document.querySelector('#others').onchange()")
    assert page.value("motet.figures.length") == 2
    page.value("document.querySelector('#others').focus()")  # letters steer there, too
    page.key("KeyS", "s", down=True)
    assert page.value("Math.hypot(motet.command().x, motet.command().z)") > 1
    page.key("KeyS", "s", down=False)
    box = page.value("(({ x, y, width }) => [x, y, width])(document.querySelector('#stick').getBoundingClientRect())")
    x, y = box[0] + box[2] / 2, box[1] + box[2] / 2
    page.mouse("mousePressed", x, y)
    page.mouse("mouseMoved", x, y - 0.4 * box[2])
    pushed = page.value("motet.command()")
    page.mouse("mouseReleased", x, y)
    usual = page.value("motet.net.speeds.run[1]")
    assert np.hypot(pushed["x"], pushed["z"]) == pytest.approx(0.8 * usual, rel=0.05)
    assert page.value("motet.command()")["x"] == 0
    assert page.errors == []


@pytest.mark.parametrize("told", ["", "Jump!"])
def test_a_jump_is_done_once_and_the_gait_goes_on(page: Browser, told: str) -> None:
    page.value("motet.state.pause = true, motet.state.gait = 0, motet.figures[0].act(null)")
    jump = page.value("motet.net.gaits.indexOf('jump')")
    page.value("for (let n = 0; n < 120; n++) motet.tick({ gait: 0, x: 0, z: 1.3, facing: 0 })")
    if told:
        assert page.value(f"motet.obey('{told}')") == "jump"
    else:
        page.value(f"document.querySelectorAll('#gaits button')[{jump}].click()")
    lowest = page.value("""(() => {
      const found = [];
      for (let n = 0; n < 90; n++) {
        motet.tick({ gait: 0, x: 0, z: 1.3, facing: 0 });
        found.push([Math.max(...motet.figures[0].pose.contacts), motet.figures[0].root[1]]);
      }
      return found;
    })()""")
    contacts, ways = np.transpose(lowest)
    assert (contacts[:20] < 0.1).any()
    assert np.diff(np.flatnonzero(contacts < 0.1)).max() == 1  # one flight
    assert (ways[-1] - ways[-31]) == pytest.approx(1.3, abs=0.15)
    assert page.value("motet.state.gait") == 0
    assert page.value("motet.figures[0].acting") is None


GAMEPAD = """(async () => {
  const given = (buttons, axes) => [{ mapping: "standard", axes, buttons: Array.from({ length: 17 }, (_, n) => (
    { pressed: buttons.includes(n) })) }];
  const frames = async (pads) => {
    navigator.getGamepads = () => pads;
    for (let n = 0; n < 3; n++) await new Promise(requestAnimationFrame);
  };
  document.querySelector("#gaits button").click();
  const pushes = [];
  for (const push of [0.16, 0.7, 1]) {
    await frames(given([], [0, -push, 0, 0]));
    pushes.push(motet.command());
  }
  await frames(given([], [0, 0.05, 0, 0]));
  const yaw = motet.view.yaw, asked = [motet.command()];
  await frames(given([7], [0, -0.8, 1, 0]));
  asked.push(motet.command());
  const turned = motet.view.yaw - yaw;
  await frames(given([5], [0, 0, 0, 0]));
  const gait = motet.state.gait;
  await frames(given([], [1, 0, 0, 0]));
  await frames([null]);
  asked.push(motet.command());
  return { asked, turned, gait, pushes };
})()"""
"""A gamepad: pushed ever farther; at rest; its trigger and both sticks pushed; a shoulder button; then it is gone."""


def test_a_gamepad(page: Browser) -> None:
    page.value("motet.state.pause = true")
    found = page.value(GAMEPAD)
    still, runs, gone = found["asked"]
    speeds, gaits = page.value("motet.net.speeds"), page.value("motet.net.gaits")
    assert (still["x"], still["z"], still["gait"]) == (0, 0, 0)
    assert (gone["x"], gone["z"]) == (0, 0)
    assert gaits[runs["gait"]] == "run"
    assert np.hypot(runs["x"], runs["z"]) == pytest.approx(0.8 * speeds["run"][1])
    slow, walk, run = (np.hypot(one["x"], one["z"]) for one in found["pushes"])
    assert [slow, walk, run] == pytest.approx([0.12, speeds["walk"][1], speeds["run"][1]], abs=0.01)
    assert [gaits[one["gait"]] for one in found["pushes"]] == ["walk", "walk", "run"]
    assert found["turned"] < 0
    assert found["gait"] == 1
    assert page.errors == []
