from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def clips() -> Path:
    """The folder of the three CMU trials that the project carries."""
    return Path(__file__).parents[2] / "train" / "motet_train" / "data" / "cmu"
