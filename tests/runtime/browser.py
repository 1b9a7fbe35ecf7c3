"""A headless Chromium that tests drive by its debugging protocol, on pipes: pages, keys, expressions, pictures."""

import base64
import json
import os
import shutil
import subprocess
import time
from pathlib import Path
from typing import Any, Self

CHROMIUM = next(
    (found for name in ("chromium", "chromium-browser", "google-chrome") if (found := shutil.which(name))), None
)
OPTIONS = ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--remote-debugging-pipe")

COLOURED = """new Promise((done) => {
  view.dirty = true;
  requestAnimationFrame(() => {  // after the page's own, while what it drew is still there
    const drawn = document.querySelector("canvas"), copy = document.createElement("canvas"), counts = [0, 0];
    const ink = Object.assign(copy, { width: drawn.width, height: drawn.height }).getContext("2d");
    ink.drawImage(drawn, 0, 0);
    const { data } = ink.getImageData(0, 0, copy.width, copy.height);
    for (let i = 0; i < data.length; i += 4) {
      if (data[i] > data[i + 2] + 60) counts[0]++;
      if (data[i + 2] > data[i] + 60) counts[1]++;
    }
    const finer = drawn.clientWidth * drawn.clientHeight / (copy.width * copy.height);
    done(counts.map((count) => count * finer));
  });
})"""


class Browser:
    """One page of ``width`` by ``height`` pixels; use it with ``with``."""

    def __init__(self, folder: Path, width: int = 960, height: int = 640) -> None:
        assert CHROMIUM is not None
        to_browser, self._write = os.pipe()
        self._read, from_browser = os.pipe()

        def connect() -> None:  # the browser reads its descriptor 3 and writes 4
            first, second = os.dup(to_browser), os.dup(from_browser)
            os.dup2(first, 3)
            os.dup2(second, 4)

        command = [CHROMIUM, *OPTIONS, f"--user-data-dir={folder}", f"--window-size={width},{height}", "about:blank"]
        self._process = subprocess.Popen(
            command,
            close_fds=False,
            preexec_fn=connect,  # noqa: PLW1509  there are no threads here
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(to_browser)
        os.close(from_browser)
        self.pid = self._process.pid
        self._rest, self._count, self.session = b"", 0, ""
        self._moment = time.time()
        self.errors: list[str] = []

    def __enter__(self) -> Self:
        targets = self._call("Target.getTargets")["targetInfos"]
        self._attach(next(target["targetId"] for target in targets if target["type"] == "page"))
        return self

    def _attach(self, page: str) -> None:
        self.session = ""
        self.session = self._call("Target.attachToTarget", targetId=page, flatten=True)["sessionId"]
        self._call("Runtime.enable")
        self._call("Page.enable")

    def tab(self) -> str:
        """Go on in a new tab; the session of the one before, to which setting ``session`` leads back."""
        before, self.session = self.session, ""
        self._attach(self._call("Target.createTarget", url="about:blank")["targetId"])
        return before

    def accessible(self) -> list[dict[str, Any]]:
        """What screen readers are told: of each node its role, its name, and its properties."""
        nodes = self._call("Accessibility.getFullAXTree")["nodes"]
        return [
            {name: node.get(name, {}).get("value") for name in ("role", "name")}
            | {own["name"]: own["value"].get("value") for own in node.get("properties", ())}
            for node in nodes
            if not node["ignored"]
        ]

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.wait()
        os.close(self._write)
        os.close(self._read)

    def open(self, file: Path, ready: str) -> None:
        """Open a file, and wait until the expression ``ready`` is true."""
        self._call("Page.navigate", url=file.as_uri())
        waiting = (
            f"new Promise((done) => {{ const look = () => {ready} ? done(true) : setTimeout(look, 20); look(); }})"
        )
        assert self.value(waiting), self.errors
        self._moment = time.time()

    def before(self, script: str) -> None:
        """Run a script in the next pages before their own."""
        self._call("Page.addScriptToEvaluateOnNewDocument", source=script)

    def emulate(self, **features: str) -> None:
        """Media features of the next pages, such as ``prefers_reduced_motion="reduce"``."""
        named = [{"name": name.replace("_", "-"), "value": value} for name, value in features.items()]
        self._call("Emulation.setEmulatedMedia", features=named)

    def value(self, expression: str) -> Any:
        """What a JavaScript expression gives, as JSON; promises are awaited."""
        found = self._call("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in found, found["exceptionDetails"]
        return found["result"].get("value")

    def key(self, code: str, key: str, down: bool) -> None:
        """Press or release a key by its code, such as "KeyW"."""
        self._call("Input.dispatchKeyEvent", type="keyDown" if down else "keyUp", code=code, key=key)

    def mouse(self, kind: str, x: float, y: float) -> None:
        """A "mousePressed", "mouseMoved" or "mouseReleased" of the left button."""
        how = {"button": "left", "buttons": 1, "clickCount": 1}
        self._call("Input.dispatchMouseEvent", type=kind, x=x, y=y, timestamp=self._next_moment(), **how)

    def phone(self, width: int, height: int) -> None:
        """Be a phone with a screen of so many pixels, for the next pages."""
        self._call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=True)
        self._call("Emulation.setTouchEmulationEnabled", enabled=True, maxTouchPoints=2)

    def touch(self, kind: str, *points: tuple[float, float]) -> None:
        """A "touchStart" or "touchMove" of fingers at points, or a "touchEnd" of all of them."""
        fingers = [{"x": x, "y": y, "id": n} for n, (x, y) in enumerate(points)]
        self._call("Input.dispatchTouchEvent", type=kind, touchPoints=fingers, timestamp=self._next_moment())

    def _next_moment(self) -> float:
        """The page is told that each press and move comes 20 ms after the last, however busy the machine is."""
        self._moment += 0.02
        return self._moment

    def coloured(self) -> list[float]:
        """How many pixels of the page, in the first canvas, have the colour of the left side, and of the right one."""
        found: list[float] = self.value(COLOURED)
        return found

    def picture(self) -> bytes:
        """The page as PNG."""
        return base64.b64decode(self._call("Page.captureScreenshot", format="png")["data"])

    def _call(self, method: str, **parameters: Any) -> dict[str, Any]:
        self._count += 1
        wanted = {"id": self._count, "method": method, "params": parameters}
        text = json.dumps({**wanted, "sessionId": self.session} if self.session else wanted)
        os.write(self._write, text.encode() + b"\0")
        while (found := self._next()).get("id") != self._count:
            if found.get("method") == "Runtime.exceptionThrown":
                self.errors.append(json.dumps(found["params"]["exceptionDetails"]))
        assert "error" not in found, found
        result: dict[str, Any] = found["result"]
        return result

    def _next(self) -> dict[str, Any]:
        while b"\0" not in self._rest:
            part = os.read(self._read, 1 << 20)
            assert part, "the browser has gone"
            self._rest += part
        message, _, self._rest = self._rest.partition(b"\0")
        found: dict[str, Any] = json.loads(message)
        return found
