"""Control models trained in a folder that is forgotten, for tests of what they do."""

import tempfile
from pathlib import Path
from typing import Any

from motet_train.data.clips import Clips
from motet_train.manifest import About
from motet_train.models.control.tdbn import TDBNConfig
from motet_train.recipes.control import train_control
from motet_train.recipes.recipe import Job, Recipe
from motet_train.runs import Run


def control_run(clips: Clips, config: Any, seed: int = 0) -> Run:
    """A run of the net of a configuration."""
    model = "tdbn" if isinstance(config, TDBNConfig) else "angle-crbm"
    with tempfile.TemporaryDirectory() as folder:
        recipe = Recipe("control", model, "session", config)
        return train_control(clips, Job(recipe, About("small", "a test", seed), Path(folder)))
