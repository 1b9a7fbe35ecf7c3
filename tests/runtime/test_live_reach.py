"""Who a live page reaches: by keys, by fingers, by a screen reader, with reduced motion, in two tabs; in Chromium."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from browser import CHROMIUM, Browser
from figures import walker

import motet
from motet.steering.model import SteerModel

PRESSED = "document.querySelector('#{}').ariaPressed"
GONE = "(() => { for (let n = 0; n < 90; n++) motet.tick(motet.command()); return motet.figures[0].root; })()"

LED = "new Promise((done) => { (function look() { motet.pilot ? done(motet.pilot.goal) : setTimeout(look, 5); })(); })"
"""The goal of the tap that was made, as soon as the page has handled it."""

DRAWN = "new Promise((done) => setTimeout(() => requestAnimationFrame(() => requestAnimationFrame(done)), 100))"
ROUND = "(({ x, y, width }) => [x, y, width])(document.querySelector('#stick').getBoundingClientRect())"
BEYOND = """[...document.querySelectorAll("button, summary, #text")].filter((one) => {
  const { left, right, bottom } = one.getBoundingClientRect();
  return one.checkVisibility() && (left < 0 || right > innerWidth || bottom > innerHeight);
}).map((one) => one.textContent)"""
"""What is pressed and cannot be seen without scrolling."""


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory, steer_model: SteerModel) -> Path:
    """A live page."""
    if CHROMIUM is None:
        pytest.skip("there is no Chromium")
    found = tmp_path_factory.mktemp("reach") / "live.html"
    motet.write_live_page(found, steer_model)
    return found


@pytest.fixture
def page(file: Path, tmp_path: Path) -> Iterator[Browser]:
    with Browser(tmp_path / "profile") as browser:
        browser.open(file, ready="window.motet")
        browser.value("motet.state.pause = true")
        yield browser
        assert browser.errors == []


def press(page: Browser, code: str, key: str) -> None:
    """Press and release a key."""
    for down in (True, False):
        page.key(code, key, down=down)


def test_all_can_be_done_by_keys(page: Browser) -> None:
    letters = {"strafe": "g", "trails": "v", "contacts": "c", "follows": "f"}
    for name, letter in letters.items():
        states = [page.value(PRESSED.format(name))]
        for _ in range(2):
            press(page, f"Key{letter.upper()}", letter)
            states.append(page.value(PRESSED.format(name)))
        assert states[0] == states[2] != states[1]
    press(page, "Space", " ")
    assert page.value("motet.state.pause") is False
    zoom = page.value("motet.view.zoom")
    press(page, "Equal", "+")
    press(page, "KeyT", "t")
    assert page.value("motet.view.zoom") == pytest.approx(1.1 * zoom)
    assert page.value("document.documentElement.dataset.theme") == "dark"
    press(page, "KeyR", "r")
    assert page.value("motet.view.zoom") == page.value("motet.stage.FIRST_VIEW.zoom")
    press(page, "Slash", "/")
    assert page.value("document.activeElement.id") == "text"
    press(page, "KeyG", "g")  # a letter of a sentence
    assert page.value(PRESSED.format("strafe")) == "false"
    press(page, "Escape", "Escape")
    assert page.value("document.activeElement.id") == "canvas"


def test_all_that_is_pressed_can_have_the_focus_and_is_large(page: Browser) -> None:
    page.value("document.querySelector('#more').open = true")
    sizes = page.value("""[...document.querySelectorAll("button, select, summary, #text, #pace")].map((one) => {
      one.focus();
      return [one.id || one.textContent, document.activeElement === one, one.getBoundingClientRect().height];
    })""")
    assert len(sizes) > 18
    assert [name for name, focused, height in sizes if not focused or height < 43.9] == []


def test_fingers_do_all_on_a_phone_held_upright(file: Path, tmp_path: Path) -> None:
    with Browser(tmp_path / "profile") as page:
        page.phone(390, 844)
        page.open(file, ready="window.motet?.hands.buttons[9]")
        page.value("motet.state.pause = true, motet.pilot = null")
        assert page.value(BEYOND) == []
        x, y, wide = page.value(ROUND)
        page.touch("touchStart", (x + wide / 2, y + wide / 2))
        page.touch("touchMove", (x + wide / 2, y))
        assert np.hypot(*page.value("motet.hands.pushed")) == pytest.approx(1, abs=0.02)
        assert page.value("Math.hypot(motet.command().x, motet.command().z)") > 2
        page.touch("touchEnd")
        assert page.value("motet.hands.pushed") == [0, 0]
        before = page.value("motet.view")
        page.touch("touchStart", (150, 200))
        page.touch("touchMove", (190, 200))
        page.touch("touchEnd")
        assert page.value("motet.view.yaw") == pytest.approx(before["yaw"] - 16)
        page.touch("touchStart", (150, 200), (250, 200))
        page.touch("touchMove", (150, 200), (300, 200))
        page.touch("touchEnd")
        assert page.value("motet.view.zoom") == pytest.approx(1.5 * before["zoom"])
        assert page.value("motet.pilot") is None
        page.value(DRAWN)
        page.touch("touchStart", (250, 600))
        page.touch("touchEnd")
        goal = page.value(LED)
        for _ in range(20):
            root = page.value(GONE)
            if page.value("motet.pilot === null"):
                break
        assert np.hypot(*np.subtract(root[:2], goal)) < 0.02
        assert page.errors == []


def test_a_screen_reader_is_told_names_and_states(page: Browser) -> None:
    page.value("document.querySelector('#more').open = true")
    page.value("document.querySelector('#text').value = 'wave', document.querySelector('#say').requestSubmit()")
    told = page.accessible()
    buttons = {node["name"]: node.get("pressed") for node in told if node["role"] == "button"}
    assert {"Walk": "true", "Run": "false", "Hurry": "false", "Ways": "true", "Do it": None}.items() <= buttons.items()
    assert not any(name[-1].isdigit() or name.endswith("shift") for name in buttons)  # keys are no part of the names
    names = {node["role"]: node["name"] for node in told}
    assert names["application"].startswith("A figure that is steered: W A S D to go")
    assert names["combobox"] in ("What the figure is to do", "Others")
    assert names["slider"] == "Slow motion"
    live = [node for node in told if node.get("live") == "polite" and node.get("root") is None]
    assert [node["role"] for node in live if node["role"] == "status"] == ["status"]  # answers, and not the speed


def test_with_reduced_motion_nothing_moves_by_itself(file: Path, tmp_path: Path) -> None:
    motet.write(tmp_path / "walk.html", walker())
    with Browser(tmp_path / "profile") as browser:
        for reduced in (True, False):
            browser.emulate(prefers_reduced_motion="reduce" if reduced else "no-preference")
            browser.open(file, ready="window.motet")
            assert (np.hypot(*browser.value(GONE)[:2]) < 0.2) == reduced
            browser.open(tmp_path / "walk.html", ready="document.querySelector('#facts')?.textContent")
            assert browser.value("state.playing") != reduced


def test_a_page_opened_twice_is_two_pages(page: Browser, file: Path) -> None:
    page.value("motet.state.gait = 1, motet.pilot = null")
    first = page.tab()
    page.open(file, ready="window.motet")
    assert page.value("motet.state.gait") == 0
    away = page.value(GONE)
    assert np.hypot(*away[:2]) > 0.5  # of a figure of eight
    page.session = first
    assert page.value("motet.state.gait") == 1
    assert np.hypot(*page.value(GONE)[:2]) < 3
    assert page.value("motet.ticks") >= 90
