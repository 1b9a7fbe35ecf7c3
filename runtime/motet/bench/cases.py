"""What is measured of each kind of model: complete calls, as a user makes them, and some of their parts."""

import itertools
import tempfile
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import cache, partial, singledispatch
from pathlib import Path
from typing import Any

import numpy as np

from motet.bench.measure import Call, Case
from motet.bundle.graph import Arrays, Floats, Graph
from motet.files import Json
from motet.formats import read_motion, write_motion
from motet.generate.model import CodesModel
from motet.models.base import BundleModel
from motet.models.describe import DescribeModel
from motet.models.language import LanguageModel
from motet.motion.motion import Motion
from motet.motion.skeleton import Skeleton
from motet.papers.mixture_model import MixtureModel
from motet.papers.tdbn_control import TdbnModel
from motet.predict.fill import FillModel
from motet.predict.model import PredictModel
from motet.representation.contract import MotionContract
from motet.representation.placed import placed
from motet.search.model import SearchModel
from motet.steering.model import SteerModel
from motet.text.vocabulary import EOS, SPECIALS

CASE_BEAMS = 5
CASE_WORDS = 10
CASE_SECONDS = 7.0
"""Lengths of all descriptions and motions, so that the speed does not depend on what a model produces."""


@singledispatch
def cases(model: BundleModel, file: Path | None = None) -> list[Case]:
    """The calls that are measured of a model.

    file: the motion file that it reads; by default one of 2.8 s that is made for it.
    """
    raise NotImplementedError(f"what to measure of {model!r} is not defined")


@cases.register
def tdbn_cases(model: TdbnModel, _: Path | None = None) -> list[Case]:
    """One character's tick, of the net alone, of a smooth session whose control stays, and of one whose control changes
    at every tick; and frames of many characters, plain and sampled."""
    changing = model.start()
    controls = itertools.cycle([np.ones(len(model.labels)), np.zeros(len(model.labels))])

    def changed() -> None:
        changing.set_control(next(controls))
        changing.step()

    cases = [
        Case("control.tick", model.start(smooth=False).step, "us"),
        Case("control.tick_smooth", model.start().step, "us"),
        Case("control.tick_changing", changed, "us"),
    ]
    for name, variety in (("control.frames", 0.0), ("control.frames_sampled", 1.0)):
        for batch in (64, 256, 512, 1024, 2048, 4096):
            session = model.start(characters=batch, variety=variety, smooth=False)
            cases.append(Case(name, session.step, "frames/s", batch))
    return cases


@cases.register
def steer_cases(model: SteerModel, _: Path | None = None) -> list[Case]:
    """A tick of one character that walks, and of 1000 that go all ways, without and with the foot lock; and the
    positions of all joints of the crowd. Of one character, only one tick in a few searches the table."""
    cases = []
    for name, characters, unit in (("tick", 1, "us"), ("crowd", 1000, "ms")):
        for kind, hold_feet in (("", False), ("_locked", True)):
            session = model.start(characters=characters, hold_feet=hold_feet)
            session.control(speed=model.usual[model.gaits[0]], direction=np.arange(characters) * 360 / characters)
            cases.append(Case(f"control.{name}{kind}", session.tick, unit))
    return [*cases, Case("control.crowd_positions", session.tick().positions)]


@cases.register
def _(model: DescribeModel, file: Path | None = None) -> list[Case]:
    cases = describe_cases(model)
    if file is None and model.contract.skeleton is None:
        return cases
    path = file or _written("describe.amc", _wandering(model.contract, round(2.8 * model.fps)).resample(120.0))
    return [*cases, Case("describe.file", lambda: model.describe(read_motion(path)))]


def describe_cases(model: DescribeModel) -> list[Case]:
    """Descriptions of :data:`CASE_WORDS` words a second that the net writes, many at once and one alone; encoder and
    step of one alone. By beam search; and one by consensus of 100 draws."""
    motion = _noise(model.contract, model.fps)
    manifest = replace(model.manifest, defaults={"beams": CASE_BEAMS, "max_words": CASE_WORDS}, loop="beam")
    graphs = {name: graph for name, graph in model.graphs.items() if name != "space"}  # it writes nothing
    endless = _Steady(model.graphs["step"], {"log_probabilities": _never(model.vocabulary.ids[EOS])})
    steady = DescribeModel(manifest, {**graphs, "step": endless})
    return [
        *_batches("describe.descriptions", lambda size: steady.describe([motion] * size), "motions/s", (32, 128)),
        Case("describe.one", lambda: steady.describe(motion)),
        Case("describe.consensus", lambda: steady.describe(motion, draws=100)),
        Case("describe.encoder", lambda: model.embed(motion)),
        Case("describe.step", _step_call(model.graphs["step"])),
    ]


@cases.register
def mixture_cases(model: MixtureModel, _: Path | None = None) -> list[Case]:
    """Motions of :data:`CASE_SECONDS` a second, many at once and one alone; encoder and step of one alone."""
    text = _text(model)
    step = _Steady(model.graphs["step"], {"active": np.ones_like})
    manifest = replace(
        model.manifest, defaults={**model.defaults, "hypotheses": CASE_BEAMS, "max_seconds": CASE_SECONDS}
    )
    steady = MixtureModel(manifest, {**model.graphs, "step": step})
    return [
        *_batches("generate.motions", lambda size: steady.generate([text] * size), "motions/s", (16, 64)),
        Case("generate.one", lambda: steady.generate(text)),
        Case("generate.encoder", lambda: model.embed(text)),
        Case("generate.step", _step_call(model.graphs["step"])),
    ]


@cases.register
def codes_cases(model: CodesModel, _: Path | None = None) -> list[Case]:
    """The first frames of a stream, and :data:`CASE_SECONDS` of motion, alone and many at once."""
    text = _text(model)
    made = partial(model.generate, seconds=CASE_SECONDS)
    return [
        *_batches("generate.motions", lambda size: made([text] * size), "motions/s", (16, 64)),
        Case("generate.one", lambda: made(text)),
        Case("generate.first_frame", lambda: next(model.stream(text))),
    ]


@cases.register
def predict_cases(model: PredictModel, file: Path | None = None) -> list[Case]:
    """For one figure, the first frame after a new one, a whole horizon, that of a motion on the model's figure and of a
    file, and of another figure that is pushed at 100 Hz; and figures' horizons a second."""
    # seeds as the net was trained on
    size = (512, model.seed_frames, len(model.contract.channels))
    seeds = np.random.default_rng(0).normal(model.contract.mean, model.contract.std, size).astype(np.float32)
    motion = model.contract.motion(np.tile(seeds[0], (10, 1)))
    cases = [
        Case("predict.first_frame", lambda: model.next_frames(seeds[:1], 1), "us"),
        Case("predict.horizon", lambda: model.next_frames(seeds[:1]), "us"),
        Case("predict.motion", lambda: model.predict(motion)),
        *_batches("predict.horizons", lambda size: model.next_frames(seeds[:size]), "figures/s", (128, 512)),
    ]
    # files and streams need a figure
    if motion.skeleton is None:
        return cases
    path = file or _written("predict.bvh", motion)
    return [
        *cases,
        Case("predict.streamed", _streamed(model, motion, motion.skeleton)),
        Case("predict.file", lambda: model.predict(read_motion(path))),
    ]


def _streamed(model: PredictModel, motion: Motion, skeleton: Skeleton) -> Callable[[], None]:
    """A frame of a larger figure that is pushed at 100 Hz, and its prediction."""
    joints = [replace(joint, offset=(*(1.1 * np.array(joint.offset)),)) for joint in skeleton.joints]
    larger = replace(motion, skeleton=replace(skeleton, joints=tuple(joints))).resample(100.0)
    session = model.stream(larger)

    def pushed() -> None:
        session.push(larger.values[-1])
        session.predict()

    return pushed


@cases.register
def fill_cases(model: FillModel, _: Path | None = None) -> list[Case]:
    """The frames of a gap of a second, between placed frames, and in a motion of five on the model's own figure."""
    count = round(model.fps)
    motion = _wandering(model.contract, 5 * count)
    frames = placed(motion)
    past = frames[: 2 * count]
    after = frames[3 * count :]
    return [
        Case("fill.second", lambda: model.frames_between(past, after, count)),
        Case("fill.motion", lambda: model.fill(motion, [(2.0, 3.0)])),
    ]


@cases.register
def search_cases(model: SearchModel, _: Path | None = None) -> list[Case]:
    """A sentence of :data:`CASE_WORDS` words, a motion of :data:`CASE_SECONDS`, and a question to 100,000 vectors."""
    text = _text(model)
    motion = _noise(model.contract, model.fps)
    vectors = np.random.default_rng(0).normal(size=(100_000, model.sizes["E"])).astype(np.float32)
    return [
        Case("search.text", lambda: model.embed_text(text)),
        Case("search.motion", lambda: model.embed(motion)),
        Case("search.nearest", lambda: model.loop.run(vectors @ vectors[0], 5)),
    ]


def _batches(name: str, call: Callable[[int], object], unit: str, sizes: Iterable[int]) -> list[Case]:
    return [Case(name, partial(call, size), unit, size) for size in sizes]


def _written(name: str, motion: Motion) -> Path:
    """A file of the motion, with four decimals as recordings have them, which lasts as long as the process."""
    path = Path(_folder().name) / name
    write_motion(path, motion)
    written = read_motion(path)  # in the file's own angles
    write_motion(path, replace(written, values=written.values.round(4)))
    return path


@cache
def _folder() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="motet-bench-")


def _wandering(contract: MotionContract, frames: int) -> Motion:
    """A random walk from near the mean of the training data."""
    steps = contract.std * np.random.default_rng(0).normal(size=(frames, len(contract.channels)))
    return contract.motion(contract.mean + 0.1 * steps.cumsum(axis=0), plant=False)


def _noise(contract: MotionContract, fps: float) -> Motion:
    """Frames of :data:`CASE_SECONDS` that are drawn one by one."""
    size = (round(CASE_SECONDS * fps), len(contract.channels))
    return contract.features(np.random.default_rng(0).normal(contract.mean, contract.std, size))


def _text(model: LanguageModel) -> str:
    return " ".join(model.vocabulary.words[len(SPECIALS) :][:CASE_WORDS])


def _never(word: int) -> Callable[[Floats], Floats]:
    """What makes a word as good as impossible in log-probabilities (N, V), in place."""

    def changed(log_probabilities: Floats) -> Floats:
        log_probabilities[:, word] = -1e9
        return log_probabilities

    return changed


def _step_call(step: Graph) -> Call:
    """One call of a step for all beams of one request."""
    rng = np.random.default_rng(0)
    feeds = {tensor.name: tensor.example(rng, CASE_BEAMS) for tensor in step.spec.inputs}
    return lambda: step(feeds)


class _Steady:
    """A graph some of whose outputs are changed: so that sentences and motions are all of one length."""

    def __init__(self, graph: Graph, changes: dict[str, Callable[..., Any]]) -> None:
        self.spec = graph.spec
        self._graph = graph
        self._changes = changes

    def __call__(self, feeds: Arrays) -> Json:
        outputs = self._graph(feeds)
        return {**outputs, **{name: change(outputs[name]) for name, change in self._changes.items()}}
