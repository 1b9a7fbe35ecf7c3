"""Smooth frames without delay: a character of a batch moves as it would alone, whatever the others are told."""

import numpy as np
import pytest

from motet.bundle.graph import Floats
from motet.papers.lookahead import Lookahead, LookaheadSettings, Run

pytestmark = pytest.mark.numeric

FPS, TICKS, CHANNELS = 30.0, 150, 4
TURNS = np.ones(CHANNELS, dtype=np.float32)
SETTINGS = LookaheadSettings(fastest=0.05 * FPS)
"""A change of the control moves the net's frames faster than that."""


def track_of(character: int) -> Floats:
    """A control (T, 1, 1) that changes at times of this character alone, the last one's never."""
    at = np.arange(TICKS) // (29 + 12 * character) if character < 2 else np.zeros(TICKS)
    return (at % 3).astype(np.float32)[:, None, None]


def shown(track: Floats) -> Floats:
    """The frames (T, B, D) of a net whose rows know nothing of each other, for a control (T, B, 1)."""

    def run_at(control: Floats) -> Run:
        def run(history: Floats, later: int) -> tuple[Floats, Floats]:
            following = np.float32(0.8) * history + np.float32(0.3) * np.tanh(control[:, None] * history[:, ::-1] + 1)
            return following[:, -1], following

        return run

    history = np.tile(np.linspace(-1, 1, 2 * CHANNELS, dtype=np.float32).reshape(1, 2, -1), (track.shape[1], 1, 1))
    past = np.swapaxes(history, 0, 1)
    lookahead = Lookahead(SETTINGS, FPS, TURNS)
    now = lookahead.begun(run_at(track[0]), history, past, track[0])
    found = []
    for control in track:
        now = lookahead.ticked(now, run_at(control), control)
        found.append(now.shown)
    return np.stack(found)


def test_a_character_moves_as_it_would_alone_to_the_bit() -> None:
    tracks = [track_of(character) for character in range(3)]
    together = shown(np.concatenate(tracks, axis=1))
    steps = np.abs(np.diff(together, axis=0))
    assert (steps.max(axis=(0, 2)) > 0.049).all()  # all are held back at first, ...
    assert (steps[100:, 2] < 0.01).all()  # ... and not for ever
    for character, track in enumerate(tracks):
        np.testing.assert_array_equal(together[:, character], shown(track)[:, 0])
