"""The picture of README, docs/figures/live.png, from the page itself: python tests/live_picture.py. Needs Chromium."""

import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "runtime"))
from browser import Browser

import motet
from motet.steering.model import SteerModel

FIGURE = Path(__file__).parents[1] / "docs" / "figures" / "live.png"
STEPS = """(() => {
  motet.stage.view.yaw += 100;
  motet.stage.zoom(1.2);
  motet.goTo([-6, 6.5]);
  for (let i = 0; i < 215; i++) motet.tick(motet.command());
  motet.obey(document.getElementById("text").value = "walk and wave");
  for (let i = 0; i < 42; i++) motet.tick(motet.command());
  motet.scene.cut();
  document.getElementById("pause").click();
})()"""
"""Five figures walk up the hill, and the first one waves."""


def main() -> None:
    """Draw it anew."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        page = Path(folder) / "live.html"
        motet.write_live_page(page, motet.load_as(SteerModel, "control"), characters=5)
        with Browser(Path(folder) / "profile", 1100, 860) as browser:
            browser.open(page, "window.motet")
            browser.value(STEPS)
            browser.value("new Promise((done) => setTimeout(done, 5000))")
            FIGURE.write_bytes(browser.picture())


if __name__ == "__main__":
    main()
