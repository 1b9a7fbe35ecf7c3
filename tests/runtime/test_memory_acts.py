"""Acts of long recordings: what is shown of them where no length is asked for."""

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from fake_codes import END, PARTS, memory_tables, source
from numpy.typing import NDArray

from motet.generate.codes import CodesSettings, Writer, draw_codes
from motet.generate.memory import Memory, MemorySettings

Array = NDArray[Any]
REMEMBERED = CodesSettings(memory=1.0)
STEPS = np.stack(np.meshgrid(np.arange(5), np.arange(4), np.arange(4), indexing="ij"), axis=-1).reshape(-1, PARTS)
END_STEP = np.array([[END, 0, 0]])
IDLE, ROUND = np.repeat(STEPS[:1], 4, axis=0), np.random.default_rng(0).permutation(STEPS[1:])[:41]
SITS = np.concatenate([IDLE, ROUND, IDLE, ROUND, IDLE, ROUND, IDLE, END_STEP])
"""Someone who stands, does something and stands again, three times."""


def drawn_from(motions: list[tuple[int, Array]], exactly: int = 0, seeds: int = 6) -> list[list[list[int]]]:
    given = replace(source(), remember=partial(Memory.of, *memory_tables(motions)))
    writer = Writer(given, [np.random.default_rng(seed) for seed in range(seeds)], REMEMBERED)
    found = draw_codes(writer, np.full(seeds, motions[0][0]), exactly or 300, exactly > 0)
    return [codes.tolist() for codes in found]


def test_of_a_recording_that_shows_the_same_again_and_again_one_act_is_shown() -> None:
    for codes in drawn_from([(1, SITS)]):
        assert MemorySettings.act_steps - len(IDLE) <= len(codes) < 60  # who stands may do so for less long
        assert codes[-1] == STEPS[0].tolist()
        assert str(ROUND.tolist())[1:-1] in str(codes)
    for codes in drawn_from([(1, SITS)], exactly=100):
        assert len(codes) == 100
        assert str(ROUND.tolist())[1:-1] in str(codes)


def test_what_shows_much_is_shown_and_what_is_short_is_shown_whole() -> None:
    once = np.concatenate([np.random.default_rng(3).permutation(STEPS)[:60], END_STEP])
    assert all(len(codes) > MemorySettings.act_steps for codes in drawn_from([(1, once)]))
    short = np.concatenate([once[:44], END_STEP])
    assert drawn_from([(1, short)]) == [once[:44].tolist()] * 6


def test_pieces_of_a_recording_are_one() -> None:
    """As windows of a long one are remembered: the second begins within the first."""
    steps, *tables = memory_tables([(1, SITS)])
    pieces = np.concatenate([steps[:70], steps[40:]])
    shown = []
    for table in (steps, pieces):
        given = replace(source(), remember=partial(Memory.of, table, *tables))
        found = draw_codes(Writer(given, [np.random.default_rng(0)], REMEMBERED), np.array([1]), 300)
        shown.append(found[0].tolist())
    assert shown[0] == shown[1]
