"""How fast a model runs here: complete calls, as a user makes them."""

import itertools
import tempfile
import time
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import singledispatch
from pathlib import Path
from typing import Any

import numpy as np

from motet.bundle.graph import Arrays, Graph
from motet.errors import TextWarning
from motet.formats import read_motion, write_motion
from motet.models.base import BundleModel
from motet.models.describe import DescribeModel
from motet.models.fill import FillModel
from motet.models.generate import MixtureModel
from motet.models.generate_codes import CodesModel
from motet.models.language import EOS, SPECIALS, LanguageModel
from motet.models.predict import PredictModel
from motet.models.search import SearchModel
from motet.models.steer import SteerModel
from motet.models.steer_session import SteerSession
from motet.models.tdbn_control import TdbnModel
from motet.representation.placed import placed

BATCHES = (64, 256, 512, 1024, 2048, 4096)
"""Numbers of characters to find the best batch among."""

BEAMS, WORDS, SECONDS = 5, 10, 7.0
"""Lengths of all descriptions and motions, so that the speed does not depend on what a model produces."""

FILE_SECONDS = 2.8
"""How long the motion in the file is that is described."""

DRAWS = 100
"""Draws of a consensus."""

CROWD = 1000
"""Characters that are steered together."""

VECTORS = 100_000
"""Of motions that are searched."""

TIMES = ("us", "ms")
"""Units where less is better."""

Figures = dict[str, tuple[float, str]]


@dataclass(frozen=True)
class Row:
    """One figure; ``baseline`` is the same figure of torch eager where torch is present, ``ratio`` how much better."""

    name: str
    value: float
    unit: str
    baseline: float | None = None
    ratio: float | None = None


def durations(
    call: Callable[[], object], seconds: float, least: int = 3
) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Seconds of each call, over about ``seconds`` (at least ``least`` calls) after a warm-up of a tenth of that."""
    _until(call, seconds / 10, 1)
    return np.array(_until(call, seconds, least))


def _until(call: Callable[[], object], seconds: float, least: int) -> list[float]:
    taken: list[float] = []
    end = time.perf_counter() + seconds
    while len(taken) < least or time.perf_counter() < end:
        start = time.perf_counter()
        call()
        taken.append(time.perf_counter() - start)
    return taken


@singledispatch
def figures(model: BundleModel, seconds: float, file: Path | None = None) -> Figures:
    """The figures of a model by name, each measured for about ``seconds``: values and units.

    file: the motion file that is described; by default one of :data:`FILE_SECONDS` that is made for it.
    """
    raise NotImplementedError(f"no figures of {model!r} are defined")


def _made_file(model: DescribeModel, folder: Path) -> Path:
    """An AMC and its ASF at 120 frames per second: a random walk from near the mean of the training data."""
    rng, contract = np.random.default_rng(0), model.contract
    steps = rng.normal(size=(round(FILE_SECONDS * model.fps), len(contract.channels)))
    motion = contract.motion(contract.mean + 0.1 * contract.std * steps.cumsum(axis=0), plant=False)
    write_motion(folder / "motion.amc", motion.resample(120.0))
    return folder / "motion.amc"


@figures.register
def tdbn_figures(model: TdbnModel, seconds: float, _: Path | None = None) -> Figures:
    """One character's tick (median and 99th percentile) and the frame rate at the best batch, plain and sampled.

    Of the net alone; and of a smooth session whose control stays, and of one whose control changes at every tick.
    """
    tick = durations(model.start(smooth=False).step, seconds) * 1e6
    smooth, changing = model.start(), model.start()
    controls = itertools.cycle([np.ones(len(model.labels)), np.zeros(len(model.labels))])

    def changed() -> None:
        changing.set_control(next(controls))
        changing.step()

    figures = {
        "control.tick": (float(np.median(tick)), "us"),
        "control.tick_p99": (float(np.percentile(tick, 99)), "us"),
        "control.tick_smooth": (float(np.median(durations(smooth.step, seconds)) * 1e6), "us"),
        "control.tick_changing": (float(np.median(durations(changed, seconds)) * 1e6), "us"),
    }
    for name, variety in (("control.frames", 0.0), ("control.frames_sampled", 1.0)):
        rates = {batch: _rate(model, batch, variety, seconds / 3) for batch in BATCHES}
        best = max(rates, key=rates.__getitem__)
        figures[name] = (rates[best], "frames/s")
        figures[f"{name}_batch"] = (float(best), "characters")
    return figures


def _rate(model: TdbnModel, batch: int, variety: float, seconds: float) -> float:
    session = model.start(characters=batch, variety=variety, smooth=False)
    return batch / float(np.median(durations(session.step, seconds)))


@figures.register
def steer_figures(model: SteerModel, seconds: float, _: Path | None = None) -> Figures:
    """A tick of one character that walks, and of :data:`CROWD` that go all ways, without and with the foot lock; and
    the positions of all joints of the crowd.

    Of ticks the median, the mean and the 99th percentile: only one in a few searches the table, for all at once.
    """
    figures: Figures = {}
    for name, characters, unit, factor in (("tick", 1, "us", 1e6), ("crowd", CROWD, "ms", 1e3)):
        for kind, hold_feet in (("", False), ("_locked", True)):
            ticks = durations(_steered(model, characters, hold_feet).tick, seconds) * factor
            found = {"": np.median(ticks), "_mean": ticks.mean(), "_p99": np.percentile(ticks, 99)}
            figures |= {f"control.{name}{kind}{of}": (float(value), unit) for of, value in found.items()}
    pose = _steered(model, CROWD, False).tick()
    return {**figures, "control.crowd_positions": (_milliseconds(pose.positions, seconds), "ms")}


def _steered(model: SteerModel, characters: int, hold_feet: bool) -> SteerSession:
    session = model.start(characters=characters, hold_feet=hold_feet)
    gait = model.gaits[0]
    session.control(speed=model.usual[gait], direction=np.arange(characters) * 360 / characters)
    return session


@figures.register
def _(model: DescribeModel, seconds: float, file: Path | None = None) -> Figures:
    measured = describe_figures(model, seconds)
    if file or model.contract.skeleton:
        with tempfile.TemporaryDirectory() as folder:
            path = file or _made_file(model, Path(folder))
            measured["describe.file"] = (_milliseconds(lambda: model.describe(read_motion(path)), seconds), "ms")
    return measured


def describe_figures(model: DescribeModel, seconds: float) -> Figures:
    """Descriptions of :data:`WORDS` words a second, many at once and one alone; encoder and step of one alone.

    By beam search; and one by consensus of :data:`DRAWS` draws.
    """
    end = model.vocabulary.ids[EOS]
    never = {"log_probabilities": lambda found: np.where(np.arange(found.shape[1]) == end, np.float32(-1e9), found)}
    defaults = {"beams": BEAMS, "max_words": WORDS}
    steady = DescribeModel(replace(model.manifest, defaults=defaults, loop="beam"), _steady(model.graphs, never))
    size = (round(SECONDS * model.fps), len(model.contract.channels))
    motion = model.contract.features(np.random.default_rng(0).normal(model.contract.mean, model.contract.std, size))
    return {
        "describe.descriptions": (_batch_rate(steady.describe, [motion], 128, seconds), "motions/s"),
        "describe.one": (_milliseconds(lambda: steady.describe(motion), seconds), "ms"),
        "describe.consensus": (_milliseconds(lambda: steady.describe(motion, draws=DRAWS), seconds), "ms"),
        "describe.encoder": (_milliseconds(lambda: model.embed(motion), seconds), "ms"),
        "describe.step": (_milliseconds(_step_call(model.graphs["step"]), seconds), "ms"),
    }


@figures.register
def mixture_figures(model: MixtureModel, seconds: float, _: Path | None = None) -> Figures:
    """Motions of :data:`SECONDS` a second, many at once and one alone; encoder and step of one alone."""
    always = {"active": np.ones_like}
    defaults = {**model.defaults, "hypotheses": BEAMS, "max_seconds": SECONDS}
    steady, text = MixtureModel(replace(model.manifest, defaults=defaults), _steady(model.graphs, always)), _text(model)
    return {
        "generate.motions": (_batch_rate(steady.generate, [text], 64, seconds), "motions/s"),
        "generate.one": (_milliseconds(lambda: steady.generate(text), seconds), "ms"),
        "generate.encoder": (_milliseconds(lambda: model.embed(text), seconds), "ms"),
        "generate.step": (_milliseconds(_step_call(model.graphs["step"]), seconds), "ms"),
    }


@figures.register
def codes_figures(model: CodesModel, seconds: float, _: Path | None = None) -> Figures:
    """The first frames of a stream, and :data:`SECONDS` of motion, alone and many at once."""
    text = _text(model)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", TextWarning)
        rate = _batch_rate(lambda texts: model.generate(texts, seconds=SECONDS), [text], 64, seconds)
        return {
            "generate.motions": (rate, "motions/s"),
            "generate.one": (_milliseconds(lambda: model.generate(text, seconds=SECONDS), seconds), "ms"),
            "generate.first_frame": (_milliseconds(lambda: next(model.stream(text)), seconds), "ms"),
        }


def _text(model: LanguageModel) -> str:
    return " ".join(model.vocabulary.words[len(SPECIALS) :][:WORDS])


@figures.register
def predict_figures(model: PredictModel, seconds: float, _: Path | None = None) -> Figures:
    """The first frame after a new one, one of a whole horizon, and a horizon of a motion on the model's figure, for one
    figure; figures' horizons a second."""
    size = (512, model.seed_frames, len(model.contract.channels))
    seeds = np.random.default_rng(0).normal(model.contract.mean, model.contract.std, size).astype(np.float32)
    horizon = _milliseconds(lambda: model.next_frames(seeds[:1]), seconds)
    motion = model.contract.motion(np.tile(seeds[0], (10, 1)))
    return {
        "predict.first_frame": (1e3 * _milliseconds(lambda: model.next_frames(seeds[:1], 1), seconds), "us"),
        "predict.frame": (1e3 * horizon / model.horizon, "us"),
        "predict.motion": (_milliseconds(lambda: model.predict(motion), seconds), "ms"),
        "predict.horizons": (len(seeds) / _milliseconds(lambda: model.next_frames(seeds), seconds) * 1e3, "figures/s"),
    }


@figures.register
def fill_figures(model: FillModel, seconds: float, _: Path | None = None) -> Figures:
    """The frames of a gap of a second, between placed frames, and in a motion of five on the model's own figure."""
    count, rng = round(model.fps), np.random.default_rng(0)
    steps = model.contract.std * rng.normal(size=(5 * count, len(model.contract.channels)))
    motion = model.contract.motion(model.contract.mean + 0.1 * steps.cumsum(axis=0), plant=False)
    frames = placed(motion)
    past, after = frames[: 2 * count], frames[3 * count :]
    return {
        "fill.second": (_milliseconds(lambda: model.frames_between(past, after, count), seconds), "ms"),
        "fill.motion": (_milliseconds(lambda: model.fill(motion, [(2.0, 3.0)]), seconds), "ms"),
    }


@figures.register
def search_figures(model: SearchModel, seconds: float, _: Path | None = None) -> Figures:
    """A sentence of :data:`WORDS` words, a motion of :data:`SECONDS`, and a question to :data:`VECTORS` vectors."""
    rng, known = np.random.default_rng(0), model.vocabulary.words[len(SPECIALS) :]
    text, size = " ".join(rng.choice(known, WORDS)), (round(SECONDS * model.fps), len(model.contract.channels))
    motion = model.contract.features(rng.normal(model.contract.mean, model.contract.std, size))
    vectors = rng.normal(size=(VECTORS, model.sizes["E"])).astype(np.float32)
    return {
        "search.text": (_milliseconds(lambda: model.embed_text(text), seconds), "ms"),
        "search.motion": (_milliseconds(lambda: model.embed(motion), seconds), "ms"),
        "search.nearest": (_milliseconds(lambda: model.loop.run(vectors @ vectors[0], 5), seconds), "ms"),
    }


class _Steady:
    """A graph some of whose outputs are changed: so that sentences and motions are all of one length."""

    def __init__(self, graph: Graph, changes: Mapping[str, Callable[..., Any]]) -> None:
        self.spec, self._graph, self._changes = graph.spec, graph, changes

    def __call__(self, feeds: Arrays) -> dict[str, Any]:
        outputs = self._graph(feeds)
        return {**outputs, **{name: change(outputs[name]) for name, change in self._changes.items()}}


def _steady(graphs: Mapping[str, Graph], changes: Mapping[str, Callable[..., Any]]) -> dict[str, Graph]:
    return {**graphs, "step": _Steady(graphs["step"], changes)}


def _step_call(step: Graph) -> Callable[[], object]:
    """One call of a step for all beams of one request."""
    rng = np.random.default_rng(0)
    feeds = {tensor.name: tensor.example(rng, BEAMS) for tensor in step.spec.inputs}
    return lambda: step(feeds)


def _milliseconds(call: Callable[[], object], seconds: float) -> float:
    return float(np.median(durations(call, seconds))) * 1e3


def _batch_rate(call: Callable[[list[Any]], object], given: list[Any], batch: int, seconds: float) -> float:
    return batch / float(np.median(durations(lambda: call(given * batch), seconds, least=2)))


def rows(figures: Figures, baseline: Figures | None) -> list[Row]:
    """Figures beside those of the baseline; a ratio above 1 favours the figure, for times and rates alike."""
    result = []
    for name, (value, unit) in figures.items():
        other = baseline[name][0] if baseline else None
        ratio = None if other is None or unit == "characters" else (other / value if unit in TIMES else value / other)
        result.append(Row(name, value, unit, other, ratio))
    return result
