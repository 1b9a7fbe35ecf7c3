"""The programs in examples/ run as their first lines say, and do what they say."""

import csv
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import motet
from motet.motion import HUMANOID, Motion, positions

ROOT = Path(__file__).parents[1]


def run(program: str, *given: str | Path) -> str:
    done = subprocess.run(
        [sys.executable, ROOT / "examples" / program, *given], capture_output=True, text=True, check=False, timeout=120
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def walk() -> Motion:
    """Two seconds straight ahead on the humanoid."""
    return motet.load("control").run("walk 2s")


def test_captions(tmp_path: Path, walk: Motion) -> None:
    motet.write(tmp_path / "walk.bvh", walk)
    (tmp_path / "none.bvh").write_text("HIERARCHY\n")
    ((name, sentence),) = csv.reader(run("captions.py", tmp_path).splitlines())
    assert name == "walk.bvh"
    best = motet.load("describe").describe(motet.read(tmp_path / "walk.bvh"))[0]
    assert sentence == (best.text if best.confident else "")


def test_game_loop() -> None:
    ticks, x, z, away = map(float, re.findall(r"-?[\d.]+", run("game_loop.py", "2"))[:4])
    assert ticks == 60
    assert 0.3 < away < 2.5  # the friend comes along
    assert x > 0.5  # it went to its left
    assert z > 0.5


def test_robot_loop(tmp_path: Path, walk: Motion) -> None:
    """The robot is slowest where the person, by the recording, comes nearest: it cannot be faster than that allows."""
    motet.write(tmp_path / "walk.bvh", walk)
    low, high = (int(one) / 100 for one in re.findall(r"(\d+)%", run("robot_loop.py", tmp_path / "walk.bvh"))[:2])
    hand = np.array([0.0, 1.0, 2.5])
    nearest = np.linalg.norm(positions(walk)[:, : len(HUMANOID.names)] - hand, axis=-1).min()
    assert abs(low - np.clip((nearest - 0.5) / 1.5, 0, 1)) < 0.15
    assert high > low + 0.2
