"""Small untrained nets as runs that can be exported, and what every bundle of a run promises."""

from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch

from motet.bundle.bundle import Bundle
from motet.bundle.graph import OnnxGraph
from motet.models.load import verify
from motet.text.vocabulary import NEW_MODEL_RULES, SPECIALS
from motet_export.bundles import export_run, parity_of
from motet_export.parity import example
from motet_train.models.motion_to_language import MotionToLanguage, MotionToLanguageConfig
from motet_train.papers.plappert2017.language_to_motion import LanguageToMotion, LanguageToMotionConfig
from motet_train.runs import Run

WORDS = [*SPECIALS, "a", "person", "walks", "runs", "left", "right", "slowly"]
MOTION = {
    "representation": "angles",
    "channels": ["hip", "knee", "ankle"],
    "units": ["rad"] * 3,
    "fps": 10.0,
    "mean": [0.1, 0.2, 0.3],
    "std": [0.5, 1.0, 2.0],
    "skeleton": None,
}


def language_run(verb: str, motion: Mapping[str, Any], **sizes: Any) -> Run:
    """A net that describes, or one that generates, motions of a contract."""
    torch.manual_seed(0)
    sizes = {"channels": len(motion["channels"]), "words": len(WORDS), **sizes}
    net: MotionToLanguage | LanguageToMotion
    if verb == "describe":
        net = MotionToLanguage(MotionToLanguageConfig(**sizes))
        model, loop, defaults = "motion-to-language", "beam", {"beams": 5, "max_words": 40}
    else:
        net = LanguageToMotion(LanguageToMotionConfig(**sizes, components=2))
        model, loop = "language-to-motion", "mixture"
        defaults = {"hypotheses": 5, "candidates": 4, "temperature": 1.0, "max_seconds": 15}
    net.measure_by(np.array(motion["mean"]), np.array(motion["std"]))
    manifest = {"name": f"small-{verb}", "verb": verb, "model": model, "loop": loop, "motion": motion}
    known = {"text": NEW_MODEL_RULES.to_json(), "vocabulary": WORDS, "config": asdict(net.config), "defaults": defaults}
    return Run({**manifest, **known, "licence": {}, "training": {}}, net.train())


def language_bundles(run: Callable[[str], Run], folder: Path) -> dict[str, Path]:
    """The bundles of both directions."""
    for verb in ("describe", "generate"):
        export_run(run(verb), folder / f"{verb}.zip")
    return {verb: folder / f"{verb}.zip" for verb in ("describe", "generate")}


def check_parity(bundle: Bundle, run: Run, rungs: set[str], golden: float = 1e-5, share: float = 0.5) -> None:
    """The golden vectors come out, the manifest has these rungs of the ladder, with room, and they come out again."""
    assert max(verify(bundle).errors.values()) < golden
    report = bundle.manifest.parity
    assert rungs <= report.keys()
    assert all(report[rung]["error"] < share * report[rung]["bound"] for rung in rungs)
    again = parity_of(run, bundle)
    assert {rung: again[rung] for rung in rungs} == {rung: report[rung] for rung in rungs}


def check_rows_alone(graph: OnnxGraph, below: dict[str, int], tolerance: float = 1e-6) -> None:
    """A row of a batch that is padded on the right gets what it gets alone."""
    feeds = example(graph.spec, np.random.default_rng(0), batch=6, below=below)
    padded = graph.spec.inputs[0].name
    together = graph(feeds)
    for row in range(6):
        single = {name: array[row : row + 1] for name, array in feeds.items()}
        if "lengths" in feeds:
            single[padded] = single[padded][:, : int(feeds["lengths"][row])]
        for name, array in graph(single).items():
            np.testing.assert_allclose(array, together[name][row : row + 1], atol=tolerance, err_msg=name)
