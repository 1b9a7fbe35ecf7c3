"""The golden vectors of a bundle that is being exported: inputs of its graphs and of one whole run of its verb."""

from collections.abc import Mapping
from functools import singledispatch
from typing import Any

import numpy as np

from motet.bundle.golden import TOLERANCE, vectors
from motet.bundle.graph import Arrays
from motet.decode.ancestral import noise_of
from motet.decode.noise import Recording
from motet.models.base import BundleModel
from motet.models.describe import DescribeModel
from motet.models.fill import FillModel
from motet.models.generate import GenerateModel
from motet.models.language import SPECIALS, LanguageModel
from motet.models.predict import PredictModel
from motet.models.search import SearchModel
from motet.models.steer import SteerModel
from motet.models.tdbn_control import TdbnModel
from motet_export.examples import Examples, sides, walks

FILE = "golden.npz"

ROWS, FRAMES, TICKS = 2, 20, 12
"""Of the inputs of a graph; of a motion that is described; of a control track."""

Run = tuple[Arrays, dict[str, Any]]
"""The inputs of a whole run, and its settings."""


def golden_vectors(model: BundleModel, draws: Mapping[str, Examples]) -> tuple[bytes, dict[str, Any]]:
    """The file of golden vectors, and what the manifest says of it."""
    rng = np.random.default_rng(5)
    feeds = {role: draws[role](rng, ROWS) for role in model.graphs}
    given, settings = golden_run(model, rng)
    entry = {"file": FILE, "tolerance": TOLERANCE, "run": settings}
    return vectors(model, feeds, given, settings), entry


@singledispatch
def golden_run(model: BundleModel, _: np.random.Generator) -> Run:
    """The whole run by which a bundle is verified, one that :meth:`BundleModel.replay` takes."""
    raise NotImplementedError(f"no golden run of {model!r} is defined")


@golden_run.register
def _tdbn(model: TdbnModel, rng: np.random.Generator) -> Run:
    """From the first label to each other one."""
    places = np.linspace(0, len(model.labels) - 1, TICKS)[:, None]
    track = np.maximum(0, 1 - np.abs(places - np.arange(len(model.labels)))).astype(np.float32)
    iterations = 2 if model.has_free_units else 1
    noise = rng.random((TICKS * iterations, model.sizes["N"]), np.float32)
    return {"track": track, "noise": noise}, {"iterations": iterations}


@golden_run.register
def _steer(_: SteerModel, rng: np.random.Generator) -> Run:
    """Off into any direction, and into another, at a walk's speeds."""
    asked = rng.uniform(-1.5, 1.5, (2, 3))
    return {"track": np.repeat(asked, TICKS, axis=0).astype(np.float32)}, {}


@golden_run.register
def _describe(model: DescribeModel, rng: np.random.Generator) -> Run:
    frames = walks(model.contract, rng, 1, FRAMES)[0]
    if "draws" not in model.defaults:
        return {"frames": frames}, {}
    return {"frames": frames, "noise": noise_of(model.limits(model.defaults), int(model.defaults["draws"]))}, {}


@golden_run.register
def _generate(model: GenerateModel, rng: np.random.Generator) -> Run:
    """Two seconds for a sentence of five words, with few hypotheses where the loop has such."""
    text = _text(model, rng)
    settings: dict[str, Any] = {
        name: 2 for name in ("hypotheses", "candidates", "max_seconds", "seconds") if name in model.defaults
    }
    noise = Recording(rng)
    model.decode(model.contexts([model.ids(text)]), [noise], {**model.defaults, **settings})
    given = {kind: np.array(drawn, dtype=np.float32) for kind, drawn in noise.drawn.items() if drawn}
    return given, {**settings, "text": text}


@golden_run.register
def _fill(model: FillModel, rng: np.random.Generator) -> Run:
    """Half a second between two parts of a random walk."""
    past, after = sides(model.contract, rng, model.context)
    return {"past": past, "after": after}, {"frames": round(model.fps / 2)}


@golden_run.register
def _predict(model: PredictModel, rng: np.random.Generator) -> Run:
    """One frame more than the horizon, so that the encoder is asked again."""
    return {"frames": walks(model.contract, rng, 1, model.seed_frames)[0]}, {"frames": model.horizon + 1}


@golden_run.register
def _search(model: SearchModel, rng: np.random.Generator) -> Run:
    """A motion, and a sentence of five words."""
    return {"frames": walks(model.contract, rng, 1, FRAMES)[0]}, {"text": _text(model, rng)}


def _text(model: LanguageModel, rng: np.random.Generator) -> str:
    return " ".join(rng.choice(model.vocabulary.words[len(SPECIALS) :], 5))
