"""Control models trained in a folder that is forgotten, for tests of what they do."""

import tempfile
from pathlib import Path
from typing import Any

from motet_train.papers.tdbn.clips import Clips
from motet_train.papers.tdbn.recipe import train_control
from motet_train.papers.tdbn.tdbn import TDBNConfig
from motet_train.recipes.recipe import Job, Recipe
from motet_train.runs import About, Run


def control_run(clips: Clips, config: Any, seed: int = 0) -> Run:
    """A run of the net of a configuration."""
    model = "tdbn" if isinstance(config, TDBNConfig) else "angle-crbm"
    with tempfile.TemporaryDirectory() as folder:
        recipe = Recipe("control", model, "session", config)
        return train_control(clips, Job(recipe, About("small", "a test", seed), Path(folder)))
