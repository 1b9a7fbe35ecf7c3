"""How fast a model runs here: complete calls, as a user makes them."""

import itertools
import os
import platform
import re
import tempfile
import time
import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import singledispatch
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from motet.bundle.graph import Arrays, Graph
from motet.errors import TextWarning
from motet.formats import read_motion, write_motion
from motet.jobs import cores
from motet.models.base import BundleModel
from motet.models.describe import DescribeModel
from motet.models.fill import FillModel
from motet.models.generate import MixtureModel
from motet.models.generate_codes import CodesModel
from motet.models.language import EOS, SPECIALS, LanguageModel
from motet.models.predict import PredictModel
from motet.models.search import SearchModel
from motet.models.steer import SteerModel
from motet.models.tdbn_control import TdbnModel
from motet.motion.motion import Motion
from motet.representation.contract import MotionContract
from motet.representation.placed import placed

BEAMS, WORDS, SECONDS = 5, 10, 7.0
"""Lengths of all descriptions and motions, so that the speed does not depend on what a model produces."""

SCALE = {"s": 1.0, "ms": 1e3, "us": 1e6}
"""Of units where less is better."""

Call = Callable[[], object]
Figure = tuple[float, str]
Figures = dict[str, Figure]

ROUNDS = 3
"""How often all figures are measured, in turn with those of torch, so that what else runs disturbs both alike."""


@dataclass(frozen=True)
class Row:
    """One figure; ``baseline`` is the same figure of torch eager where torch is present, ``ratio`` how much better."""

    name: str
    value: float
    unit: str
    baseline: float | None = None
    ratio: float | None = None


def compared(models: Sequence[BundleModel], seconds: float, file: Path | None = None) -> list[Row]:
    """The figures of a model and of a baseline, if there is one, measured in turn: medians of :data:`ROUNDS`, and the
    median of the rounds' ratios. A ratio above 1 favours the model, for times and rates alike."""
    rounds = [[figures(model, seconds / ROUNDS, file) for model in models] for _ in range(ROUNDS)]
    result = []
    for name, (_, unit) in rounds[0][0].items():
        values = np.array([[one[name][0] for one in found] for found in rounds])
        middle = np.median(values, axis=0).tolist()
        if len(models) < 2:
            result.append(Row(name, middle[0], unit))
            continue
        ratio = better(np.median(values[:, 0] / values[:, 1]), unit)
        result.append(Row(name, middle[0], unit, middle[1], ratio))
    return result


def better(quotient: float, unit: str) -> float | None:
    """How much better a figure is than another one, of their quotient; None where more is neither better nor worse."""
    return None if unit == "characters" else float(1 / quotient if unit in SCALE else quotient)


@dataclass(frozen=True)
class Machine:
    """Where figures were measured, and its ceilings in the same run: float32 products in GFLOP/s and copies in GB/s, by
    numpy. load: processes that wanted a core when it began, beside this one; None where the system does not tell."""

    processor: str
    cores: int
    versions: dict[str, str]
    load: float | None
    gflops: float
    gigabytes: float

    @property
    def busy(self) -> bool:
        """Whether others work here, so that figures may be far too low."""
        return self.load is not None and self.load > 0.3

    @staticmethod
    def here() -> "Machine":
        """This one, measured for half a second."""
        load = os.getloadavg()[0] if hasattr(os, "getloadavg") else None
        one, much = np.ones((768, 768), np.float32), np.ones(16_000_000, np.float32)
        product, copy = durations(lambda: one @ one, 0.25).min(), durations(much.copy, 0.25).min()
        versions = {name: version(name) for name in ("motet", "onnxruntime", "numpy")}
        ceilings = 2 * 768**3 / product / 1e9, 2 * much.nbytes / copy / 1e9
        return Machine(processor(), cores(), versions, load, *ceilings)


def processor() -> str:
    """The processor's name, as far as the system tells it."""
    with suppress(OSError):
        found = re.search(r"model name\s*:\s*(.+)", Path("/proc/cpuinfo").read_text(encoding="utf-8"))
        if found:
            return found[1]
    return platform.processor() or platform.machine()


def durations(call: Call, seconds: float, least: int = 3) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Seconds of each call, over about ``seconds`` (at least ``least`` calls) after a warm-up of a tenth of that."""
    for limit, count in ((seconds / 10, 1), (seconds, least)):
        taken, end = list[float](), time.perf_counter() + limit
        while len(taken) < count or time.perf_counter() < end:
            start = time.perf_counter()
            call()
            taken.append(time.perf_counter() - start)
    return np.array(taken)


def timed(call: Call, seconds: float, unit: str = "ms") -> Figure:
    """The median time of a call."""
    return float(np.median(durations(call, seconds))) * SCALE[unit], unit


def rate(count: int, call: Call, seconds: float, unit: str, least: int = 2) -> Figure:
    """How many things a second a call does that does ``count`` at once."""
    return count / float(np.median(durations(call, seconds, least))), unit


@singledispatch
def figures(model: BundleModel, seconds: float, file: Path | None = None) -> Figures:
    """The figures of a model by name, each measured for about ``seconds``: values and units.

    file: the motion file that is described; by default one of 2.8 s that is made for it.
    """
    raise NotImplementedError(f"no figures of {model!r} are defined")


@figures.register
def tdbn_figures(model: TdbnModel, seconds: float, _: Path | None = None) -> Figures:
    """One character's tick (median and 99th percentile) and the frame rate at the best batch, plain and sampled. Of the
    net alone; and of a smooth session whose control stays, and of one whose control changes at every tick."""
    tick = durations(model.start(smooth=False).step, seconds) * SCALE["us"]
    smooth, changing = model.start(), model.start()
    controls = itertools.cycle([np.ones(len(model.labels)), np.zeros(len(model.labels))])

    def changed() -> None:
        changing.set_control(next(controls))
        changing.step()

    found = {
        "control.tick": (float(np.median(tick)), "us"),
        "control.tick_p99": (float(np.percentile(tick, 99)), "us"),
        "control.tick_smooth": timed(smooth.step, seconds, "us"),
        "control.tick_changing": timed(changed, seconds, "us"),
    }
    for name, variety in (("control.frames", 0.0), ("control.frames_sampled", 1.0)):
        rates = {}
        for batch in (64, 256, 512, 1024, 2048, 4096):
            session = model.start(characters=batch, variety=variety, smooth=False)
            rates[rate(batch, session.step, seconds / 3, "frames/s", least=3)] = batch
        best = max(rates)
        found |= {name: best, f"{name}_batch": (float(rates[best]), "characters")}
    return found


@figures.register
def steer_figures(model: SteerModel, seconds: float, _: Path | None = None) -> Figures:
    """A tick of one character that walks, and of 1000 that go all ways, without and with the foot lock; and the
    positions of all joints of the crowd.

    Of ticks the median, the mean and the 99th percentile: of one character, only one in a few searches the table.
    """
    found: Figures = {}
    for name, characters, unit in (("tick", 1, "us"), ("crowd", 1000, "ms")):
        for kind, hold_feet in (("", False), ("_locked", True)):
            session = model.start(characters=characters, hold_feet=hold_feet)
            session.control(speed=model.usual[model.gaits[0]], direction=np.arange(characters) * 360 / characters)
            ticks = durations(session.tick, seconds) * SCALE[unit]
            of = {"": np.median(ticks), "_mean": ticks.mean(), "_p99": np.percentile(ticks, 99)}
            found |= {f"control.{name}{kind}{which}": (float(value), unit) for which, value in of.items()}
    return {**found, "control.crowd_positions": timed(session.tick().positions, seconds)}


@figures.register
def _(model: DescribeModel, seconds: float, file: Path | None = None) -> Figures:
    found = describe_figures(model, seconds)
    if file or model.contract.skeleton:
        with tempfile.TemporaryDirectory() as folder:
            path = file or Path(folder) / "motion.amc"
            if file is None:
                write_motion(path, _wandering(model.contract, round(2.8 * model.fps)).resample(120.0))
            found["describe.file"] = timed(lambda: model.describe(read_motion(path)), seconds)
    return found


def describe_figures(model: DescribeModel, seconds: float) -> Figures:
    """Descriptions of :data:`WORDS` words a second that the net writes, many at once and one alone; encoder and step of
    one alone. By beam search; and one by consensus of 100 draws."""
    end, motion = model.vocabulary.ids[EOS], _noise(model.contract, model.fps)
    never = {"log_probabilities": lambda found: np.where(np.arange(found.shape[1]) == end, np.float32(-1e9), found)}
    manifest = replace(model.manifest, defaults={"beams": BEAMS, "max_words": WORDS}, loop="beam")
    graphs = {name: graph for name, graph in model.graphs.items() if name != "space"}  # it writes nothing
    steady = DescribeModel(manifest, {**graphs, "step": _Steady(model.graphs["step"], never)})
    return {
        "describe.descriptions": rate(128, lambda: steady.describe([motion] * 128), seconds, "motions/s"),
        "describe.one": timed(lambda: steady.describe(motion), seconds),
        "describe.consensus": timed(lambda: steady.describe(motion, draws=100), seconds),
        "describe.encoder": timed(lambda: model.embed(motion), seconds),
        "describe.step": timed(_step_call(model.graphs["step"]), seconds),
    }


@figures.register
def mixture_figures(model: MixtureModel, seconds: float, _: Path | None = None) -> Figures:
    """Motions of :data:`SECONDS` a second, many at once and one alone; encoder and step of one alone."""
    text, step = _text(model), _Steady(model.graphs["step"], {"active": np.ones_like})
    manifest = replace(model.manifest, defaults={**model.defaults, "hypotheses": BEAMS, "max_seconds": SECONDS})
    steady = MixtureModel(manifest, {**model.graphs, "step": step})
    return {
        "generate.motions": rate(64, lambda: steady.generate([text] * 64), seconds, "motions/s"),
        "generate.one": timed(lambda: steady.generate(text), seconds),
        "generate.encoder": timed(lambda: model.embed(text), seconds),
        "generate.step": timed(_step_call(model.graphs["step"]), seconds),
    }


@figures.register
def codes_figures(model: CodesModel, seconds: float, _: Path | None = None) -> Figures:
    """The first frames of a stream, and :data:`SECONDS` of motion, alone and many at once."""
    text = _text(model)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", TextWarning)
        return {
            "generate.motions": rate(64, lambda: model.generate([text] * 64, seconds=SECONDS), seconds, "motions/s"),
            "generate.one": timed(lambda: model.generate(text, seconds=SECONDS), seconds),
            "generate.first_frame": timed(lambda: next(model.stream(text)), seconds),
        }


@figures.register
def predict_figures(model: PredictModel, seconds: float, _: Path | None = None) -> Figures:
    """The first frame after a new one, one of a whole horizon, and a horizon of a motion on the model's figure, for one
    figure; figures' horizons a second."""
    size = (512, model.seed_frames, len(model.contract.channels))
    seeds = np.random.default_rng(0).normal(model.contract.mean, model.contract.std, size).astype(np.float32)
    motion = model.contract.motion(np.tile(seeds[0], (10, 1)))
    return {
        "predict.first_frame": timed(lambda: model.next_frames(seeds[:1], 1), seconds, "us"),
        "predict.frame": (timed(lambda: model.next_frames(seeds[:1]), seconds, "us")[0] / model.horizon, "us"),
        "predict.motion": timed(lambda: model.predict(motion), seconds),
        "predict.horizons": rate(len(seeds), lambda: model.next_frames(seeds), seconds, "figures/s", least=3),
    }


@figures.register
def fill_figures(model: FillModel, seconds: float, _: Path | None = None) -> Figures:
    """The frames of a gap of a second, between placed frames, and in a motion of five on the model's own figure."""
    count = round(model.fps)
    motion = _wandering(model.contract, 5 * count)
    frames = placed(motion)
    past, after = frames[: 2 * count], frames[3 * count :]
    return {
        "fill.second": timed(lambda: model.frames_between(past, after, count), seconds),
        "fill.motion": timed(lambda: model.fill(motion, [(2.0, 3.0)]), seconds),
    }


@figures.register
def search_figures(model: SearchModel, seconds: float, _: Path | None = None) -> Figures:
    """A sentence of :data:`WORDS` words, a motion of :data:`SECONDS`, and a question to 100,000 vectors."""
    text, motion = _text(model), _noise(model.contract, model.fps)
    vectors = np.random.default_rng(0).normal(size=(100_000, model.sizes["E"])).astype(np.float32)
    return {
        "search.text": timed(lambda: model.embed_text(text), seconds),
        "search.motion": timed(lambda: model.embed(motion), seconds),
        "search.nearest": timed(lambda: model.loop.run(vectors @ vectors[0], 5), seconds),
    }


def _wandering(contract: MotionContract, frames: int) -> Motion:
    """A random walk from near the mean of the training data."""
    steps = contract.std * np.random.default_rng(0).normal(size=(frames, len(contract.channels)))
    return contract.motion(contract.mean + 0.1 * steps.cumsum(axis=0), plant=False)


def _noise(contract: MotionContract, fps: float) -> Motion:
    """Frames of :data:`SECONDS` that are drawn one by one."""
    size = (round(SECONDS * fps), len(contract.channels))
    return contract.features(np.random.default_rng(0).normal(contract.mean, contract.std, size))


def _text(model: LanguageModel) -> str:
    return " ".join(model.vocabulary.words[len(SPECIALS) :][:WORDS])


def _step_call(step: Graph) -> Call:
    """One call of a step for all beams of one request."""
    rng = np.random.default_rng(0)
    feeds = {tensor.name: tensor.example(rng, BEAMS) for tensor in step.spec.inputs}
    return lambda: step(feeds)


class _Steady:
    """A graph some of whose outputs are changed: so that sentences and motions are all of one length."""

    def __init__(self, graph: Graph, changes: dict[str, Callable[..., Any]]) -> None:
        self.spec, self._graph, self._changes = graph.spec, graph, changes

    def __call__(self, feeds: Arrays) -> dict[str, Any]:
        outputs = self._graph(feeds)
        return {**outputs, **{name: change(outputs[name]) for name, change in self._changes.items()}}
