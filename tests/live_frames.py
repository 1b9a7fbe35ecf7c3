"""How soon and how often the live page draws in Chromium without a graphics card: tests/live_frames.py [SECONDS].

First the seconds from navigation until a figure is drawn, in a browser that is new and in one that has shown the page
before: medians and ranges of five. Then frames a second of 1, 8 and 50 figures in a window of 960 by 640, for so many
seconds after ten in which the page finds how well it can draw in time. Beside it how many pixels it draws for one of
the page, and the milliseconds of all processes of Chromium that a frame takes, which depend less on what else runs.
"""

import os
import sys
import tempfile
from pathlib import Path
from statistics import median
from time import perf_counter, sleep

sys.path.insert(0, str(Path(__file__).parent / "runtime"))
from browser import Browser

import motet
from motet.steering.model import SteerModel

COUNT = """(() => {
  const frame = motet.frame.bind(motet);
  window.frames = 0;
  motet.frame = (now) => { frame(now); window.frames++; };
})()"""
DRAWN = """(() => {
  const context = WebGL2RenderingContext.prototype, draw = context.drawElements;
  context.drawElements = function (...given) {
    draw.apply(this, given);
    context.drawElements = draw;
    requestAnimationFrame(() => {
      this.readPixels(0, 0, 1, 1, this.RGBA, this.UNSIGNED_BYTE, new Uint8Array(4));
      window.drawn = performance.now() / 1000;
    });
  };
})()"""
"""Tells when the frame after the first with a figure, of which triangles are drawn, is there."""

TICKS = os.sysconf("SC_CLK_TCK")


def main(seconds: int = 5) -> None:
    """Print everything."""
    model = motet.load_as(SteerModel, "control")
    for kind, found in zip(("new", "known"), zip(*(first(model) for _ in range(5)), strict=True), strict=True):
        print(f"{kind}: first figure {median(found):.2f} s ({min(found):.2f} to {max(found):.2f})", flush=True)
    for characters in (1, 8, 50):
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
            page = Path(folder) / "live.html"
            motet.write_live_page(page, model, characters)
            with Browser(Path(folder) / "profile") as browser:
                browser.open(page, "window.motet")
                browser.value(COUNT)
                sleep(10)
                start, before, spent = perf_counter(), browser.value("frames"), busy(browser.pid)
                sleep(seconds)
                frames = browser.value("frames") - before
                rate, cost = frames / (perf_counter() - start), 1000 * (busy(browser.pid) - spent) / frames
                ratio = browser.value("motet.scene.painter.ratio")
        print(f"{characters}: {rate:.0f} a second, {ratio:.2f} pixels for one, {cost:.0f} ms of processors", flush=True)


def first(model: SteerModel) -> list[float]:
    """Seconds until one figure is drawn, twice in one browser."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        page, found = Path(folder) / "live.html", list[float]()
        motet.write_live_page(page, model)
        with Browser(Path(folder) / "profile") as browser:
            browser.before(DRAWN)
            for _ in range(2):
                browser.open(page, "window.drawn")
                found.append(browser.value("drawn"))
                sleep(2)
        return found


def busy(process: int) -> float:
    """Seconds that a process and all that it started have computed, on Linux."""
    own = Path(f"/proc/{process}")
    user, system = own.joinpath("stat").read_text().rsplit(")", 1)[1].split()[11:13]
    children = [child for task in own.glob("task/*/children") for child in task.read_text().split()]
    return (int(user) + int(system)) / TICKS + sum(busy(int(child)) for child in children)


if __name__ == "__main__":
    main(*(int(given) for given in sys.argv[1:]))
