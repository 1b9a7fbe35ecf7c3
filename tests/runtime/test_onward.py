"""Going on with codes of which nothing is said: which actions they look like, and the pace that is kept."""

import math
from itertools import islice
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from fake_codes import ACTIONS, END, MOVES, numbers_of, remembered, source

from motet.generate.codes import CodesSettings
from motet.generate.continue_codes import ContinuationSettings, Continuer, Pace

MOTIONS, RULES = remembered(), ContinuationSettings()
DRAWING = CodesSettings(memory=0.5)
SECONDS = 0.2
BOOK = np.array([[0.1 * move, 0.0, 0.0] for move in range(MOVES)])
"""Each move goes .5 m/s faster than the one before it, straight on."""

TURNING = np.array([[0.2, 0.0, turn] for turn in (-0.4, -0.2, 0.0, 0.2, 0.4)])


def continuer(book: Any = BOOK, drawing: CodesSettings = DRAWING) -> Continuer:
    codec: Any = SimpleNamespace(book=book, seconds=SECONDS)
    return Continuer(source(), codec, drawing, RULES)


def drawn(pace: Pace, seed: int = 0, steps: int = 60, book: Any = BOOK) -> Any:
    return np.stack(list(islice(continuer(book).steps(MOTIONS[0][1][:4], 4, pace, seed), steps)))


def test_numbers_of_steps_are_those_of_the_memory() -> None:
    codes = MOTIONS[1][1][:-1]
    np.testing.assert_array_equal(source().memory.numbers(codes), numbers_of(codes))


def naive_distance(shown: Any, action: int) -> float:
    """Of the place of an action whose last steps were most like the ones shown, in the most literal way."""
    best = math.inf
    for of, codes in MOTIONS:
        for at in range(len(codes)) if of == action else ():
            off = total = 0.0
            for back in range(1, min(RULES.context_steps, len(shown)) + 1):
                known = numbers_of(codes[[max(at - back, 0)]])[0]
                off += RULES.context_fading ** (back - 1) * float(
                    ((known - numbers_of(shown[-back:][:1])[0]) ** 2).sum()
                )
                total += RULES.context_fading ** (back - 1)
            best = min(best, off / total)
    return best


@pytest.mark.parametrize("length", [1, 3, 6])
def test_actions_are_as_likely_as_their_nearest_place_is_near(length: int) -> None:
    shown = np.concatenate([MOTIONS[4][1][:3], MOTIONS[2][1][:3]])[:length]
    actions, _, weights = continuer().likely(numbers_of(shown))
    assert sorted(actions.tolist()) == list(range(ACTIONS))
    assert (np.diff(weights) <= 0).all()
    for action, weight in zip(actions.tolist(), weights, strict=True):
        assert -RULES.action_scale * weight == pytest.approx(naive_distance(shown, action), rel=1e-5)


@pytest.mark.parametrize("number", range(len(MOTIONS)))
def test_what_was_remembered_is_known_again_and_how_old_it_is(number: int) -> None:
    action, codes = MOTIONS[number]
    found, ages, _ = continuer().likely(numbers_of(codes[:5]))
    assert (found[0], ages[0]) == (action, 5)


def test_a_place_is_farther_off_the_more_its_motion_goes_on_at_another_speed() -> None:
    steps, pace, found = round(RULES.moment / SECONDS), Pace(0.8, 0.0), []
    for _, codes in MOTIONS:
        for at in range(len(codes)):
            moves = [0.1 * float(move) for move in codes[at : at + steps, 0] if move != END]
            off = abs(math.log((sum(moves) / (steps * SECONDS) + RULES.speed_floor) / (pace.speed + RULES.speed_floor)))
            found.append(RULES.speed_cost * off)
    np.testing.assert_allclose(continuer().paces_off(pace), found)


@pytest.mark.parametrize("speed", [0.6, 0.9, 1.2])
def test_the_speed_is_kept(speed: float) -> None:
    codes = drawn(Pace(speed, 0.0))
    assert BOOK[codes[:, 0], 0].sum() / (len(codes) * SECONDS) == pytest.approx(speed, rel=0.1)


@pytest.mark.parametrize("turn", [-0.5, 0.0, 0.5])
def test_the_course_is_kept(turn: float) -> None:
    codes = drawn(Pace(1.0, turn), book=TURNING)
    assert TURNING[codes[:, 0], 2].sum() == pytest.approx(turn * len(codes) * SECONDS, abs=math.radians(25))


def test_a_seed_gives_the_same_again_and_more_steps_begin_with_the_fewer() -> None:
    first, other = drawn(Pace(1.0, 0.0), 3), drawn(Pace(1.0, 0.0), 4)
    np.testing.assert_array_equal(drawn(Pace(1.0, 0.0), 3), first)
    np.testing.assert_array_equal(drawn(Pace(1.0, 0.0), 3, 25), first[:25])
    assert (first != other).any(axis=1).mean() > 0.3
    assert (first[:, 0] != END).all()


def test_steps_that_were_guessed_do_not_say_what_is_shown() -> None:
    shown, wrong = MOTIONS[2][1][:5], MOTIONS[3][1][:3]
    steps = continuer(drawing=CodesSettings(memory=1.0)).steps(np.concatenate([shown, wrong]), 5, Pace(1.0, 0.0), 0)
    found = list(islice(steps, 30))
    known = [codes[:-1].tolist() for action, codes in MOTIONS if action == MOTIONS[2][0]]
    own = sum(step.tolist() in [one for codes in known for one in codes] for step in found)
    assert own > 15  # all that is remembered of the action that was shown, but for a draw of another one


def test_the_pace_of_a_motion() -> None:
    rates = np.tile([[0.6, 0.8, 0.1]], (60, 1))
    for scale, turn in ((1, 0.0), (9, 0.9)):
        pace = Pace.of(rates * [1, 1, scale], 30.0, RULES)
        assert pace.speed == pytest.approx(1.0)
        assert pace.turn == pytest.approx(turn)
    assert Pace.of(rates * 0.9 * RULES.going, 30.0, RULES).turn is None
