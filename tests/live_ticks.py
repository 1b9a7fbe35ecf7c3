"""Sizes and times of docs/results/speed.md: python tests/live_ticks.py [BUNDLE]. Needs node.

Times are of a tick, medians and 90th percentiles of 30 s of walking, running and standing.
"""

import json
import subprocess
import sys
from pathlib import Path
from time import perf_counter

import numpy as np

import motet
from motet.draw.page import source
from motet.live.page import net_data
from motet.live.protocol import ClientSession
from motet.steering.model import SteerModel

TICKS = 300
ORDERS = [("walk", 1.3, 0), ("run", 3.0, 90), ("walk", 0.0, 90)]
"""Gait, m/s and direction in degrees, each for TICKS."""


def main(bundle: str = "control") -> None:
    """Print everything."""
    model = motet.load_as(SteerModel, bundle)
    print(f"page: {len(motet.live_page(model).encode()) / 1e6:.2f} MB")
    version = subprocess.run(["node", "--version"], capture_output=True, text=True, check=True).stdout.strip()
    print(f"one figure, node {version}: {shown(node_ticks(model))}")
    for characters in (1, 16):
        times, size = python_ticks(ClientSession(model, characters))
        print(f"{characters} in Python, with the message: {shown(times)}; {size / 1000:.1f} kB")


def shown(milliseconds: list[float]) -> str:
    """Median and 90th percentile: in one tick of six the table is searched."""
    median, slow = np.percentile(milliseconds, (50, 90))
    return f"{median:.2f} ms ({slow:.2f})"


def node_ticks(model: SteerModel) -> list[float]:
    """Milliseconds of each tick of the page's loop."""
    controls = []
    for gait, speed, degrees in ORDERS:
        way = np.radians(degrees)
        told = {"x": speed * np.sin(way), "z": speed * np.cos(way), "facing": way, "gait": model.gaits.index(gait)}
        controls += [told] * TICKS
    given = json.dumps({"script": source("motet.live", "control.js"), "net": net_data(model), "controls": controls})
    command = ["node", str(Path(__file__).parent / "runtime" / "live_loop.mjs")]
    done = subprocess.run(command, input=given, capture_output=True, text=True, check=True)
    found: list[float] = json.loads(done.stdout)["milliseconds"]
    return found


def python_ticks(client: ClientSession) -> tuple[list[float], int]:
    """Milliseconds of each tick of the server with its message, and the bytes of one."""
    times, sent = [], ""
    for gait, speed, degrees in ORDERS:
        client.handle(json.dumps({"type": "control", "gait": gait, "speed": speed, "direction": degrees}))
        for _ in range(TICKS):
            start = perf_counter()
            sent = client.frame(client.tick())
            times.append(1000 * (perf_counter() - start))
    return times, len(sent)


if __name__ == "__main__":
    main(*sys.argv[1:])
