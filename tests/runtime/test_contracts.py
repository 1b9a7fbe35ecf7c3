"""What every verb and every session promises, as two tables: rows are verbs and sessions, tests are promises."""

import pickle
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import motet
from motet.settings import silent

pytestmark = pytest.mark.numeric

Array = NDArray[Any]
CLIPS = Path(__file__).parents[2] / "train" / "motet_train" / "data" / "cmu"
SENTENCES = (
    "a person walks",
    "he jumps, then bows",
    "a person waves",
    "a person runs and turns left",
    "a person walks slowly to the right",
)
GAPS = ([(1.0, 1.5)], [(0.5, 0.9), (1.5, 1.8)], [(1.2, 1.6)])


@cache
def clips() -> list[motet.Motion]:
    """Three motions of different lengths and rates."""
    walk = motet.read(CLIPS / "39_14.amc")
    return [walk, motet.read(CLIPS / "02_06.amc")[:400], walk[60:].resample(50)]


@cache
def pieces() -> list[motet.Motion]:
    """Thirteen motions of the same length: more than the blocks in which matrices are multiplied."""
    return [clips()[0][start : start + 160] for start in range(0, 130, 10)]


def motions_of(rows: list[list[motet.Generated]]) -> list[Array]:
    """The frames and log-likelihoods of the two motions of each sentence, one after the other."""
    return [np.concatenate([np.append(motion.frames, motion.log_likelihood or 0.0) for motion in row]) for row in rows]


def lines_of(rows: list[list[motet.Description]]) -> list[Array]:
    """Sentences with their probabilities, for each motion: bytes of the texts as numbers, then the probabilities."""
    lines = []
    for row in rows:
        texts = np.frombuffer("\n".join(line.text for line in row).encode(), np.uint8)
        lines.append(np.concatenate([texts, [line.log_probability for line in row]]))
    return lines


def values_of(motions: list[motet.Motion]) -> list[Array]:
    return [motion.values for motion in motions]


@dataclass(frozen=True)
class Verb:
    """A verb of a bundle: results of things, each as an array."""

    bundle: str
    things: Callable[[], list[Any]]
    run: Callable[..., list[Array]]
    """(model, things, seed, progress) to an array for each thing; thing i has the seed + i."""

    draws: bool = False
    """Whether the result depends on the seed."""

    reports: bool = True
    """Whether it reports its progress."""

    tolerance: float = 0.0
    """How far a result in a batch may be from that alone: matrix products of a graph round by the size of the batch on
    some processors and in some versions of ONNX Runtime."""


VERBS = {
    "describe": Verb(
        "describe",
        clips,
        lambda model, things, _, progress: lines_of(model.describe(things, progress=progress)),
    ),
    "describe with beams": Verb(
        "motion-to-language",
        clips,
        lambda model, things, _, progress: lines_of(model.describe(things, beams=3, progress=progress)),
        tolerance=1e-4,
    ),
    "describe by draws": Verb(
        "describe",
        clips,
        lambda model, things, _, progress: lines_of(model.describe(things, draws=20, progress=progress)),
    ),
    "embed motions": Verb(
        "search", clips, lambda model, things, *_: list(model.embed(things)), reports=False, tolerance=1e-5
    ),
    "embed motions of a length": Verb(
        "search", pieces, lambda model, things, *_: list(model.embed(things)), reports=False
    ),
    "contexts of motions": Verb(
        "describe",
        clips,
        lambda model, things, *_: list(model.embed(things)) if things else [],
        reports=False,
    ),
    "contexts of sentences": Verb(
        "generate",
        lambda: list(SENTENCES),
        lambda model, things, *_: list(model.embed(things)) if things else [],
        reports=False,
    ),
    "embed sentences": Verb(
        "search",
        lambda: list(SENTENCES),
        lambda model, things, *_: list(model.embed_text(things)) if things else [],
        reports=False,
        tolerance=1e-5,
    ),
    "generate": Verb(
        "generate",
        lambda: list(SENTENCES),
        lambda model, things, seed, progress: motions_of(model.generate(things, 2, seed=seed, progress=progress)),
        draws=True,
    ),
    "generate by a mixture": Verb(
        "language-to-motion",
        lambda: ["a person walks", "a person jumps"],
        lambda model, things, seed, progress: motions_of(
            model.generate(things, 2, candidates=2, max_seconds=1.0, seed=seed, progress=progress)
        ),
        draws=True,
    ),
    "predict": Verb(
        "predict",
        clips,
        lambda model, things, _, progress: values_of(model.predict(things, frames=20, progress=progress)),
    ),
    "expected errors": Verb(
        "predict",
        pieces,
        lambda model, things, *_: list(model.expected_errors(things)),
        reports=False,
    ),
    "predict by ConvSeq2Seq": Verb(
        "convseq2seq",
        clips,
        lambda model, things, _, progress: values_of(model.predict(things, frames=30, progress=progress)),
        tolerance=0.01,  # degrees
    ),
    "fill": Verb(
        "fill",
        lambda: list(zip(clips(), GAPS, strict=True)),
        lambda model, things, _, progress: values_of(
            model.fill([motion for motion, _ in things], [gaps for _, gaps in things], progress=progress)
        ),
        tolerance=0.01,  # degrees
    ),
}


@pytest.fixture(scope="module", params=VERBS)
def verb(request: pytest.FixtureRequest) -> Verb:
    return VERBS[request.param]


@pytest.fixture(scope="module")
def model(verb: Verb) -> Any:
    return motet.load(verb.bundle)


@pytest.fixture(scope="module")
def results(verb: Verb, model: Any) -> list[Array]:
    """Of all things together, with the seed 5."""
    return verb.run(model, verb.things(), 5, silent)


def same(results: list[Array], others: list[Array], tolerance: float = 0.0) -> None:
    assert len(results) == len(others)
    for result, other in zip(results, others, strict=True):
        np.testing.assert_allclose(result, other, rtol=0, atol=tolerance)


def test_each_of_a_batch_gets_what_it_gets_alone(verb: Verb, model: Any, results: list[Array]) -> None:
    for i, thing in enumerate(verb.things()):
        for seed in (5 + i, [np.int64(5 + i)]):
            same(verb.run(model, [thing], seed, silent), [results[i]], verb.tolerance)


def test_nothing_gives_nothing(verb: Verb, model: Any) -> None:
    assert verb.run(model, [], 0, silent) == []


def test_a_seed_gives_the_same_again_and_another_one_differs(verb: Verb, model: Any, results: list[Array]) -> None:
    same(verb.run(model, verb.things(), 5, silent), results)
    others = verb.run(model, verb.things(), 50, silent)
    if not verb.draws:
        same(others, results)
        return
    for other, result in zip(others, results, strict=True):
        assert not np.array_equal(other, result)


def test_a_pickled_model_gives_the_same(verb: Verb, model: Any, results: list[Array]) -> None:
    same(verb.run(pickle.loads(pickle.dumps(model)), verb.things(), 5, silent), results)


def test_progress_goes_to_the_end(verb: Verb, model: Any) -> None:
    if not verb.reports:
        return
    reports: list[tuple[int, int]] = []
    things = verb.things()
    verb.run(model, things, 5, lambda done, total: reports.append((done, total)))
    assert reports == sorted(set(reports))
    assert reports[-1] == (len(things), len(things))
    assert {total for _, total in reports} == {len(things)}


@dataclass(frozen=True)
class Session:
    """A session of a bundle that is stepped: what its figures are doing, and what a step shows."""

    bundle: str
    start: Callable[..., Any]
    """(model, characters, seed) to a session."""

    begin: Callable[[Any, Array], object]
    """(session, numbers): what the figures of these numbers are told, each something else."""

    step: Callable[[Any], dict[str, Array]]
    """One step; arrays with a row for each figure."""

    draws: bool = False
    """Whether the steps depend on the seed."""


def tdbn(variety: float) -> Session:
    """Labels of the thesis' net, blended; frames are in degrees."""

    def start(model: Any, characters: int, seed: int) -> Any:
        return model.start(characters=characters, seed=np.arange(seed, seed + characters), variety=variety)

    def blends(session: Any, numbers: Array) -> None:
        session.control(walk=numbers / 10, run=1 - numbers / 10)

    return Session("tdbn", start, blends, lambda session: {"frame": session.step()}, variety > 0)


def steered(begin: Callable[[Any, Array], object]) -> Session:
    """Figures of motion matching that search in the same ticks."""

    def start(model: Any, characters: int, seed: int) -> Any:
        return model.start(characters=characters, phases=[0] * characters)

    def pose(session: Any) -> dict[str, Array]:
        pose = session.tick()
        return {part: getattr(pose, part) for part in ("ground", "height", "rotations", "contacts")}

    return Session("control", start, begin, pose)


def goes_by_gait(session: Any, numbers: Array) -> None:
    gaits = [("walk", "run", "zombie")[number % 3] for number in numbers]
    speeds = [(1.2, 2.5, 0.6)[number % 3] for number in numbers]
    session.control(gait=gaits, speed=speeds, direction=50.0 * numbers - 150)


def looks_and_reaches(session: Any, numbers: Array) -> None:
    for row, number in enumerate(numbers):
        session.look_at((2.0 - number, 1.0, 1.0), ids=row)
        session.reach("right", (-0.3, 1.0 + 0.1 * number, 0.3), ids=row)


@cache
def bend() -> motet.Motion:
    """Somebody who bends over."""
    return motet.to_humanoid(motet.read(CLIPS / "02_06.amc")).motion


def acts(session: Any, numbers: Array) -> None:
    for row, number in enumerate(numbers):
        session.act(bend()[120 : 300 + 20 * number], ids=row)


def goes_in_styles(session: Any, numbers: Array) -> None:
    styles = [("limping", "none", "drunk", "tiptoe")[number % 4] for number in numbers]
    session.control(speed=1.2, direction=50.0 * numbers, style=styles)


def goes_to_places(session: Any, numbers: Array) -> None:
    for row, number in enumerate(numbers):
        session.go_to((number - 3.0, 3.0), ids=row)


def goes_over_hills(session: Any, numbers: Array) -> None:
    session.set_ground(lambda x, z: 0.3 * np.sin(2 * z) + 0.1 * x)
    session.control(gait="walk", speed=1.2, direction=30.0 * numbers)


SESSIONS = {
    "the thesis' net, drawn": tdbn(1.0),
    "the thesis' net, its mean": tdbn(0.0),
    "stands": steered(lambda session, numbers: None),
    "goes by gait": steered(goes_by_gait),
    "looks and reaches": steered(looks_and_reaches),
    "acts": steered(acts),
    "goes in styles": steered(goes_in_styles),
    "goes to places": steered(goes_to_places),
    "goes over hills": steered(goes_over_hills),
}


@pytest.fixture(scope="module", params=SESSIONS)
def session(request: pytest.FixtureRequest) -> Session:
    return SESSIONS[request.param]


@pytest.fixture(scope="module")
def steppable(session: Session) -> Any:
    return motet.load(session.bundle)


def begun(session: Session, model: Any, numbers: tuple[int, ...] = (0,), seed: int = 0) -> Any:
    """A session of figures of these numbers after ten steps and the beginning of what they do."""
    running = session.start(model, len(numbers), seed)
    for _ in range(10):
        session.step(running)
    session.begin(running, np.array(numbers))
    return running


def test_a_snapshot_goes_on_to_the_bit_as_often_as_it_is_restored(session: Session, steppable: Any) -> None:
    running = begun(session, steppable, (1, 2))
    for _ in range(5):
        session.step(running)
    snapshot = running.snapshot()
    wanted = [session.step(running) for _ in range(20)]
    for _ in range(2):
        running.restore(snapshot)
        for step in wanted:
            again = session.step(running)
            for part, array in step.items():
                np.testing.assert_array_equal(again[part], array)


def test_each_of_a_crowd_moves_as_it_would_alone(session: Session, steppable: Any) -> None:
    numbers = (0, 1, 2, 3, 4, 5, 6)  # less than a whole vector of the processor, which rounds otherwise if any does
    crowd = begun(session, steppable, numbers, seed=4)
    alone = [begun(session, steppable, (number,), seed=4 + number) for number in numbers]
    for _ in range(40):
        together = session.step(crowd)
        for number, running in enumerate(alone):
            for part, array in session.step(running).items():
                np.testing.assert_array_equal(together[part][number], array[0])


def test_a_pickled_model_steps_the_same(session: Session, steppable: Any) -> None:
    sessions = [begun(session, model, seed=1) for model in (steppable, pickle.loads(pickle.dumps(steppable)))]
    for _ in range(5):
        first, second = (session.step(running) for running in sessions)
        for part, array in first.items():
            np.testing.assert_array_equal(second[part], array)


def test_a_seed_steps_the_same_again_and_another_one_differs(session: Session, steppable: Any) -> None:
    first, again, other = (session.step(begun(session, steppable, seed=seed)) for seed in (1, 1, 2))
    for part, array in first.items():
        np.testing.assert_array_equal(again[part], array)
    assert all(np.array_equal(other[part], array) for part, array in first.items()) != session.draws
