from pathlib import Path

import pytest

import motet
from motet.steering.model import SteerModel


@pytest.fixture(scope="session")
def clips() -> Path:
    """The folder of the three CMU trials that the project carries."""
    return Path(__file__).parents[2] / "train" / "motet_train" / "data" / "cmu"


@pytest.fixture(scope="session")
def steer_model() -> SteerModel:
    """The shipped figure that is steered."""
    return motet.load("control")
