"""Scores of known sequences, beside the step asked word by word and frame by frame."""

import itertools

import numpy as np
import pytest
from fake_models import CHANNELS, STATE, FakeGraph, describe_model, generate_model, log_likelihood

from motet.decode.beam import score_words
from motet.errors import DecodingError
from motet.generate.base import GenerateModel
from motet.papers.mixture import score_frames

SAID = np.array([[1, 4, 5, 2, 0], [1, 4, 5, 6, 2], [1, 4, 2, 0, 0], [1, 4, 5, 2, 0], [1, 2, 0, 0, 0]])
ROWS = np.array([0, 0, 0, 1, 1])


def test_sequences_score_what_the_step_says_word_by_word() -> None:
    step = describe_model().graphs["step"]
    contexts = np.random.default_rng(0).normal(size=(2, 3)).astype(np.float32)
    expected = []
    for row, words in zip(ROWS, SAID, strict=True):
        state, total = np.zeros((1, STATE), np.float32), 0.0
        for word, coming in itertools.pairwise(words):
            out = step({"word": np.array([word]), "context": contexts[row : row + 1], "state": state})
            state = out["next_state"]
            total += float(out["log_probabilities"][0, coming]) if coming else 0.0
        expected.append(total)
    asked: list[int] = []

    def counted(word: np.ndarray, context: np.ndarray, state: np.ndarray) -> tuple[np.ndarray, ...]:
        asked.append(len(word))
        return tuple(step({"word": word, "context": context, "state": state}).values())

    found = score_words(FakeGraph(step.spec, counted), {"context": contexts}, ROWS, SAID)
    np.testing.assert_allclose(found, expected, atol=1e-5)
    assert asked == [2, 2, 2, 2]  # what begins alike is asked once, and a single row twice
    for n, row in enumerate(ROWS):
        assert score_words(step, {"context": contexts}, np.array([row]), SAID[n : n + 1])[0] == found[n]


def test_frames_score_what_the_step_says_frame_by_frame() -> None:
    step = generate_model().graphs["step"]
    rng = np.random.default_rng(0)
    context, frames = (rng.normal(size=size).astype(np.float32) for size in ((4,), (7, len(CHANNELS))))
    state, given, expected = np.zeros((1, STATE), np.float32), np.ones((1, 1 + len(CHANNELS)), np.float32), 0.0
    for n in range(len(frames) + 1):
        out = step({"frame": given, "context": context[None], "state": state})
        state, given = out["next_state"], np.zeros_like(given)
        if n < len(frames):
            given[0] = [*frames[n], 1]
        expected += log_likelihood(given[0], out, 0)
    assert score_frames(step, context, frames) == pytest.approx(expected, abs=1e-4)


def test_what_knows_no_likelihoods_scores_no_motion() -> None:
    with pytest.raises(DecodingError, match="models of the loop 'mixture' cannot score motions"):
        GenerateModel.score(generate_model(), "walks", None)  # type: ignore[arg-type]
