from pathlib import Path

import pytest

import motet
from motet.generate.model import CodesModel
from motet.motion import MIXAMO, Motion
from motet.steering.model import SteerModel


@pytest.fixture(scope="session")
def clips() -> Path:
    """The folder of the three CMU trials that the project carries."""
    return Path(__file__).parents[2] / "train" / "motet_train" / "data" / "cmu"


@pytest.fixture(scope="session")
def steer_model() -> SteerModel:
    """The shipped figure that is steered."""
    return motet.load("control")


@pytest.fixture(scope="session")
def codes_model() -> CodesModel:
    """The shipped model that generates."""
    return motet.load("generate")


@pytest.fixture(scope="session")
def walk(clips: Path) -> Motion:
    """A walk of 3.3 seconds on CMU's own skeleton, at 120 fps."""
    return motet.read(clips / "39_14.amc")


@pytest.fixture(scope="session")
def mixamo(walk: Motion) -> Motion:
    """The walk on a skeleton of Mixamo's names, without thumbs and with another number of joints in the neck."""
    return motet.from_humanoid(motet.to_humanoid(walk).motion, MIXAMO)


@pytest.fixture
def out(tmp_path: Path) -> Path:
    """An empty folder for results."""
    place = tmp_path / "out"
    place.mkdir()
    return place
