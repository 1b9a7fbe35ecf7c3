"""Where a long motion changes, beside the most literal way to find out."""

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise, product
from pathlib import Path

import numpy as np
import pytest
from fake_models import CHANNELS, CONTRACT, FPS, SKELETON, VOCABULARY, describe_model, moving
from memory import traced

from motet.bundle.manifest import Manifest
from motet.errors import MotionError
from motet.formats import read_motion
from motet.models.describe import DescribeModel, Description, TimelineSettings, best_path, edges, near_scores, windows
from motet.models.load import load_as
from motet.motion.motion import Motion
from motet.text.vocabulary import EOS, SOS

ONE, OTHER = (1.0, 4.0, -2.0), (3.0, 2.0, -4.0)
"""Poses, in standard deviations from the mean, of which the small model says different things."""


@pytest.mark.parametrize(("frames", "fps"), [(0, 10), (1, 10), (15, 10), (16, 10), (403, 10), (999, 23.976), (50, 1)])
def test_windows_overlap_from_the_first_frame_to_the_last(frames: int, fps: float) -> None:
    settings = TimelineSettings()
    spans = windows(frames, fps, settings)
    assert (spans[0][0], spans[-1][1]) == (0, frames)
    assert {stop - start for start, stop in spans} == {min(frames, max(2, round(settings.window * fps)))}
    assert all(0 < two - one <= max(1, round(settings.hop * fps)) for (one, _), (two, _) in pairwise(spans))


def test_the_best_path_is_that_of_all_paths() -> None:
    rng = np.random.default_rng(0)
    lengths = set()
    for change in (0.0, 0.7, 1.5, 4.0, 50.0):
        scores = rng.normal(size=(6, 3))
        scores[rng.random(scores.shape) < 0.2] = -np.inf
        scores[:, 0] = rng.normal(size=6)

        def worth(path: tuple[int, ...], scores: np.ndarray = scores, change: float = change) -> float:
            return float(scores[range(6), path].sum() - change * sum(a != b for a, b in pairwise(path)))

        found = best_path(scores, change)
        assert worth(tuple(found)) == pytest.approx(max(map(worth, product(range(3), repeat=6))))
        assert all(best_path(scores, change, at_once) == found for at_once in (1, 2, 4))
        lengths.add(sum(a != b for a, b in pairwise(found)))
    assert len(lengths) > 2


def test_a_path_that_is_decided_is_not_kept() -> None:
    """A path through as many windows as 24 hours have, found in the memory of a few hundred."""

    def rows(count: int) -> Iterator[np.ndarray]:
        likely = np.random.default_rng(1).normal(size=(7, 200))
        return (likely[place // 100 % 7] for place in range(count))

    assert best_path(rows(1000), 3.0, 100) == best_path(list(rows(1000)), 3.0, 10_000)
    found = traced(lambda: best_path(rows(20_000), 3.0, 100))
    assert found < traced(lambda: best_path(rows(1000), 3.0, 100)) + 20_000 * 16 + 100_000


def test_parts_meet_in_the_middle_between_windows() -> None:
    spans = [(0, 15), (5, 20), (10, 25), (15, 30)]
    assert edges(spans, [3, 3, 3, 3]) == [0, 30]
    assert edges(spans, [3, 1, 1, 3]) == [0, 10, 20, 30]
    assert edges([(0, 9)], [2]) == [0, 9]


@pytest.mark.parametrize("rows", [1, 4, 512])
def test_sentences_are_scored_for_windows_near_theirs(rows: int) -> None:
    model, motions = describe_model(), [constant(9, level, -level, 1.0) for level in (0.5, 1.0, 2.0, 3.0, 4.0)]
    texts = ["a person walks", "walks", "a person walks", "left", "walks left"]
    start, end = (VOCABULARY.ids[word] for word in (SOS, EOS))
    said = [(start, *VOCABULARY.encode(text)[0].tolist(), end) for text in texts]
    told: list[tuple[int, int]] = []
    found = near_scores(
        model.graphs["step"],
        {"context": model.embed(motions)},
        said,
        1,
        lambda done, total: told.append((done, total)),
        rows,
    )
    assert told[-1] == (5, 5)
    by_ids = dict(zip(said, texts, strict=True))
    for row, motion in enumerate(motions):
        near = set(texts[max(0, row - 1) : row + 2])
        for column, ids in enumerate(sorted(by_ids)):
            expected = model.score(motion, by_ids[ids]) if by_ids[ids] in near else -np.inf
            assert found[row, column] == pytest.approx(expected, abs=1e-4)


def constant(frames: int, *z: float) -> Motion:
    """A motion that stands still, at a number of standard deviations from the mean."""
    values = CONTRACT.mean + np.array(z) * CONTRACT.std
    return Motion(np.tile(values, (frames, 1)), CHANNELS, CONTRACT.units, FPS, SKELETON)


def joined(*motions: Motion) -> Motion:
    return replace(motions[0], values=np.concatenate([motion.values for motion in motions]))


def test_a_timeline_is_cut_where_the_motion_changes() -> None:
    model = describe_model()
    motion = joined(constant(100, *ONE), constant(80, *OTHER), constant(120, *ONE))
    parts = model.timeline(motion)
    assert len(parts) == 3
    np.testing.assert_allclose([part.start for part in parts], [0, 10, 18], atol=0.75)
    assert [part.stop for part in parts] == [*(part.start for part in parts[1:]), 30.0]
    for part in parts:
        best = model.describe(motion.cut(part.start, part.stop))[0]
        assert (part.text, part.log_probability) == (best.text, pytest.approx(best.log_probability, abs=1e-4))
    assert parts[0].text == parts[2].text != parts[1].text
    for fps in (1.0, 23.976, 40.0):
        others = model.timeline(motion.resample(fps))
        assert [part.text for part in others] == [part.text for part in parts]


def test_where_the_same_is_said_there_is_one_part(monkeypatch: pytest.MonkeyPatch) -> None:
    model, motion = describe_model(), constant(950, *ONE)
    told: list[tuple[int, int]] = []
    (part,) = model.timeline(motion, progress=lambda done, total: told.append((done, total)))
    assert (part.start, part.stop) == (0, 95)
    count = len(windows(950, FPS, TimelineSettings()))
    assert told[-1] == (count, count)
    monkeypatch.setattr("motet.models.describe.best_path", lambda scores, change: list(range(len(scores))))
    assert model.timeline(motion) == [part]
    (slow,) = model.timeline(replace(motion[:60], fps=2.0))  # of whose frames no two would be in a part
    assert slow.stop == pytest.approx(30, abs=1)


def test_a_part_over_thirty_seconds_is_described_by_its_middle(monkeypatch: pytest.MonkeyPatch) -> None:
    model, motion = describe_model(), moving(950)
    monkeypatch.setattr("motet.models.describe.best_path", lambda scores, change: [0] * len(scores))
    (part,) = model.timeline(motion)
    best = model.describe(motion[325:625])[0]
    assert (part.stop, part.text) == (95, best.text)
    assert part.log_probability == pytest.approx(best.log_probability, abs=1e-4)


def test_what_has_no_timeline() -> None:
    model = describe_model()
    with pytest.raises(MotionError, match="needs two frames at 10 fps, but the motion has 1"):
        model.timeline(constant(1, *ONE))


def test_a_description_is_believed_from_the_log_probability_of_its_bundle_on() -> None:
    model, motion = describe_model(), moving(20)
    found = model.describe(motion)
    for n, limit in enumerate(one.log_probability for one in found):
        settings = {"settings": {"confidence": {"log_probability": limit}}}
        other = DescribeModel(Manifest.from_json({**model.manifest.source, **settings}), model.graphs)
        assert [one.confident for one in other.describe(motion)] == [place <= n for place in range(len(found))]
    expected = {"text": "a", "log_probability": -99.0, "score": 1.0, "confident": False}
    assert Description("a", -99.0, 1.0, False).to_json() == {**expected, "probability": pytest.approx(math.exp(-99))}


def test_the_settings_of_a_bundle_cut_its_timelines() -> None:
    model = describe_model()
    motion = joined(constant(100, *ONE), constant(80, *OTHER), constant(120, *ONE))
    settings = {"settings": {"timeline": {"change": 1000}}}
    other = DescribeModel(Manifest.from_json({**model.manifest.source, **settings}), model.graphs)
    assert (len(model.timeline(motion)), len(other.timeline(motion))) == (3, 1)


def test_the_bundle_that_ships_tells_a_walk_from_a_run_in_one_motion(clips: Path) -> None:
    model = load_as(DescribeModel, "describe")
    walk, run = (model.prepared(read_motion(clips / name)) for name in ("39_14.amc", "09_07.amc"))
    parts = model.timeline(joined(walk, run, run, walk))
    assert [("walk" in part.text, "jog" in part.text) for part in parts] == [(1, 0), (0, 1), (1, 0)]
    ends = np.cumsum([walk.duration, 2 * run.duration, walk.duration])
    np.testing.assert_allclose([part.stop for part in parts], ends, atol=1)
    assert all(part.confident for part in parts)
