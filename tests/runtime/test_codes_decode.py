"""Codes drawn one by one: from a nucleus, from memory, row by row as alone, to an end or as long as is asked."""

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from fake_codes import ACTIONS, END, KNOWN, NULL_ACTION, PARTS, memory_tables, numbers_of, remembered, source
from numpy.typing import NDArray

from motet.generate.codes import CodesSettings, Source, Writer, draw_codes, drawn_actions, drawn_steps, nucleus
from motet.generate.memory import Memory, MemorySettings

pytestmark = pytest.mark.numeric

Array = NDArray[Any]
PLAIN = CodesSettings()
SETTINGS = MemorySettings()
DRAWINGS = [
    PLAIN,
    CodesSettings(temperature=0.8, first_temperature=0.3, top_p=0.7, guidance=2.5),
    CodesSettings(temperature=1.5, first_temperature=2.0, top_p=0.95, guidance=0.0),
]


def rngs(*seeds: int) -> list[np.random.Generator]:
    return [np.random.default_rng(seed) for seed in seeds]


def naive_chances(log_weights: Sequence[float], temperature: float, top_p: float) -> list[float]:
    """What a nucleus leaves: the likeliest until they make up the share, the last one whole."""
    weights = np.exp(np.array(log_weights) / temperature)
    weights /= weights.sum()
    kept: list[int] = []
    for thing in sorted(range(len(weights)), key=lambda one: -weights[one]):
        if sum(weights[one] for one in kept) < top_p:
            kept.append(thing)
    return [float(weight) if thing in kept else 0.0 for thing, weight in enumerate(weights)]


def naive_nucleus(log_weights: Sequence[float], uniform: float, temperature: float, top_p: float) -> int:
    chances = naive_chances(log_weights, temperature, top_p)
    left = uniform * sum(chances)
    for thing, chance in enumerate(chances):
        left -= chance
        if left < 0:
            return thing
    return max(thing for thing, chance in enumerate(chances) if chance)


@pytest.mark.parametrize("top_p", [0.01, 0.5, 0.9, 1.0])
@pytest.mark.parametrize("temperature", [0.3, 1.0, 4.0])
def test_what_is_drawn_has_its_share_of_the_nucleus(temperature: float, top_p: float) -> None:
    weights = np.random.default_rng(0).normal(size=9) * 1.5
    uniform = (np.arange(9999) + 0.5) / 9999
    found = nucleus(np.tile(weights, (9999, 1)), uniform, temperature, top_p)
    chances = np.array(naive_chances(weights, temperature, top_p))
    shares = np.bincount(found, minlength=9) / 9999
    np.testing.assert_allclose(shares, chances / chances.sum(), atol=2e-4)
    assert not shares[chances == 0].any()
    assert found[::97].tolist() == [naive_nucleus(weights, one, temperature, top_p) for one in uniform[::97]]


def test_each_row_has_its_own_weights_number_and_temperature() -> None:
    rng = np.random.default_rng(1)
    weights, uniform, temperature = rng.normal(size=(300, 7)), rng.random(300), rng.uniform(0.2, 3, 300)
    found = nucleus(weights, uniform, temperature, 0.8)
    expected = [naive_nucleus(*row, 0.8) for row in zip(weights, uniform.tolist(), temperature.tolist(), strict=True)]
    assert found.tolist() == expected
    # what cannot be is never drawn, at either end of the numbers
    weights[:, [0, 6]] = -np.inf
    for edge in (0.0, 1 - 2**-24):
        assert set(nucleus(weights, np.full(300, edge), 1.0, 1.0).tolist()) <= {1, 2, 3, 4, 5}


def test_an_action_is_drawn_by_its_probability_to_a_power() -> None:
    chances = np.log(np.array([[0.5, 0.3, 0.2]], dtype=np.float32))
    found = drawn_actions(source(), np.repeat(chances, 4000, axis=0), rngs(*range(4000)), 2.0)
    expected = np.array([0.25, 0.09, 0.04]) / 0.38
    np.testing.assert_allclose(np.bincount(found, minlength=3) / 4000, expected, atol=0.02)
    first = np.random.default_rng(7).random((PARTS + 2,), np.float32)[0]
    assert drawn_actions(source(), chances, rngs(7), 2.0)[0] == naive_nucleus(2 * chances[0], float(first), 1.0, 1.0)


MOTIONS = remembered()
SHORTEST = min(len(codes) - 1 for _, codes in MOTIONS)
STARTS = np.cumsum([0, *(len(codes) for _, codes in MOTIONS)])


def memory() -> Memory:
    return Memory.of(*memory_tables(MOTIONS))


def recent_of(codes: Array, at: int) -> list[Array]:
    """Numbers of the steps before one, the latest first, as many as are looked at."""
    return list(numbers_of(codes[max(0, at - SETTINGS.past_steps) : at])[::-1])


def test_a_memory_starts_where_motions_of_the_action_start() -> None:
    known = memory()
    for action in range(ACTIONS):
        found = [known.next(action, [], 0, True, (one + 0.5) / 100) for one in range(100)]
        starts = [int(start) for start, (of, _) in zip(STARTS, MOTIONS, strict=False) if of == action]
        assert [found.count(start) for start in starts] == [50, 50]


def test_a_memory_goes_on_in_the_motion_whose_past_is_the_present() -> None:
    known = memory()
    for start, (action, codes) in zip(STARTS, MOTIONS, strict=False):
        for at in range(1, len(codes)):
            for uniform in (0.001, 0.5, 0.999):
                over = naive_parts(codes)[at]
                assert known.next(action, recent_of(codes, at), at, True, uniform, over) == start + at


def test_a_memory_follows_the_action_whatever_was_before() -> None:
    known, (_, codes) = memory(), MOTIONS[0]
    for action in range(ACTIONS):
        for uniform in np.linspace(0, 0.99, 20):
            place = known.next(action, recent_of(codes, 4), 4, True, uniform, 0.5)
            assert MOTIONS[np.searchsorted(STARTS, place, side="right") - 1][0] == action


CLOSE = 0.2
"""By which remembered places are brought together, so that several resemble the present."""


def naive_parts(codes: Array) -> list[float]:
    """The share of a motion's movement that is over before each of its steps, and after the last."""
    counts = [0.125]
    for before, step in pairwise(codes):
        body = numbers_of(np.stack([before, step]))[:, 1:]
        counts.append(0.125 + float(((body[1] - body[0]) ** 2).sum()) * (step[0] != END))
    return [sum(counts[:at]) / sum(counts) for at in range(len(counts) + 1)]


def naive_shares(action: int, recent: list[Array], age: int, ends: bool, done: float) -> dict[int, float]:
    """How often each remembered place is gone on with, in the most literal way."""
    found = {}
    for start, (of, codes) in zip(STARTS.tolist(), MOTIONS, strict=False):
        for at in range(len(codes)) if of == action else ():
            over = naive_parts(codes)[at]
            if not (at > 0 if age else over < 0.3) or over > done + SETTINGS.skip:
                continue
            off = (at - age) ** 2 / 64 if ends else min((at - age) ** 2 / 64, 2.0)
            for back, weight in enumerate((1.0, 0.5, 0.25), start=1):
                known = CLOSE * numbers_of(codes[[max(at - back, 0)]])[0]
                off += weight * float(((known - recent[min(back, len(recent)) - 1]) ** 2).sum())
            found[start + at] = float(np.exp(-2 * off))
    total = sum(found.values())
    return {place: chance / total for place, chance in found.items()}


@pytest.mark.parametrize(
    ("age", "ends", "done"),
    [(0, False, 0.0), (1, True, 0.2), (3, False, 0.4), (3, True, 1.0), (3, True, 0.0), (40, False, 0.8)],
)
def test_a_memory_goes_on_where_the_past_resembles_the_present(age: int, ends: bool, done: float) -> None:
    """Amid all remembered places, as often at each as it is near."""
    known, rng = memory(), np.random.default_rng(age)
    known = replace(known, moves=np.float32(CLOSE) * known.moves, body=np.float32(CLOSE) * known.body)
    middle = CLOSE * np.mean([numbers_of(codes[:-1]).mean(axis=0) for _, codes in MOTIONS], axis=0)
    count = min(age or 3, SETTINGS.past_steps)
    recent = [(middle + 0.1 * rng.normal(size=middle.shape)).astype(np.float32) for _ in range(count)]
    found = [known.next(1, recent, age, ends, (one + 0.5) / 2000, done) for one in range(2000)]
    shares = naive_shares(1, recent, age, ends, done)
    assert sum(share > 0.02 for share in shares.values()) > 1
    for place, share in shares.items():
        assert found.count(place) / 2000 == pytest.approx(share, abs=2e-3)
    assert set(found) <= shares.keys()


def naive_row(
    given: Source, action: int, seed: int, drawing: CodesSettings, longest: int, exactly: bool = False
) -> list[list[int]]:
    """One motion, drawn number by number, nothing from memory: told and not told what it shows, each by itself."""
    rng, last, age, steps = np.random.default_rng(seed), [given.end + 1, 0, 0], 0, list[list[int]]()
    states = {who: np.zeros((1, KNOWN), np.float32) for who in (action, NULL_ACTION)}
    for length in range(longest):
        known = {}
        for who in (action, NULL_ACTION):
            feeds = {"codes": np.array([[last]]), "action": np.array([[who]]), "age": np.array([[age]])}
            out = given.step({**feeds, "state": states[who]})
            known[who], states[who] = out["known"], out["next_state"]
        uniform = rng.random((PARTS + 2,), np.float32)[2:]
        temperature = drawing.temperature if age else drawing.first_temperature
        codes, again = [0] * PARTS, False
        for part in range(PARTS):
            told, untold = (
                given.part({"known": known[who], "codes": np.array([codes])})["log_probabilities"][0, part].astype(
                    float
                )
                for who in (action, NULL_ACTION)
            )
            chances = untold + drawing.guidance * (told - untold)
            codes[part] = naive_nucleus(chances, float(uniform[part]), temperature, drawing.top_p)
            if part == 0 and (exactly or age < 0.7 * SHORTEST):
                ended, chances[END] = codes[0] == END, -np.inf
                other = float(uniform[0]) * 1024 % 1 if ended else float(uniform[0])
                codes[0] = naive_nucleus(chances, other, temperature, drawing.top_p)
                again = ended and (exactly or length == 0)
        if codes[0] == END:
            break
        steps.append(codes)
        last, age = codes, 0 if again else age + 1
    return steps


@pytest.mark.parametrize("drawing", DRAWINGS)
@pytest.mark.parametrize("exactly", [False, True])
def test_codes_are_drawn_as_by_a_naive_twin(drawing: CodesSettings, exactly: bool) -> None:
    given, actions = source(ending=2.5), np.array([0, 1, 2, 0, 1, 2])
    found = draw_codes(Writer(given, rngs(*range(6)), drawing), actions, 15, exactly)
    expected = [naive_row(given, int(action), row, drawing, 15, exactly) for row, action in enumerate(actions)]
    assert [codes.tolist() for codes in found] == expected
    lengths = {len(codes) for codes in found}
    assert lengths == {15} if exactly else min(lengths) < 15


def test_plain_drawing_is_ancestral_sampling() -> None:
    """With guidance 1 what is not told makes no difference: first steps come by the chain rule."""
    given, count = source(ending=-50.0), 3000
    found = draw_codes(Writer(given, rngs(*range(count)), PLAIN), np.full(count, 1), 1)
    start = {"codes": np.array([[[given.end + 1, 0, 0]]]), "action": np.array([[1]]), "age": np.array([[0]])}
    known = given.step({**start, "state": np.zeros((1, KNOWN), np.float32)})["known"]
    seen: dict[tuple[int, ...], int] = {}
    for codes in found:
        seen[tuple(codes[0].tolist())] = seen.get(tuple(codes[0].tolist()), 0) + 1
    for codes, times in seen.items():
        chances = given.part({"known": known, "codes": np.array([codes])})["log_probabilities"][0]
        chance = float(np.exp(sum(chances[part, code] for part, code in enumerate(codes))))
        assert times / count == pytest.approx(chance, abs=4 * np.sqrt(chance / count) + 1e-3)


@pytest.mark.parametrize("memory", [0.0, 0.6])
@pytest.mark.parametrize("exactly", [False, True])
def test_a_row_of_a_batch_gets_what_it_gets_alone(memory: float, exactly: bool) -> None:
    given, actions, drawing = (
        source(ending=1.0),
        np.array([2, 0, 1, 1, 0, 2, 2, 0, 1]),
        replace(DRAWINGS[0], memory=memory),
    )
    together = draw_codes(Writer(given, rngs(*range(9)), drawing), actions, 20, exactly)
    for row, codes in enumerate(together):
        (alone,) = draw_codes(Writer(given, rngs(row), drawing), actions[row : row + 1], 20, exactly)
        np.testing.assert_array_equal(alone, codes)
        one_by_one = drawn_steps(Writer(given, rngs(row), drawing), actions[row : row + 1], 20, exactly)
        assert [step[0].tolist() for _, step in one_by_one] == codes.tolist()
    assert len({len(codes) for codes in together}) == 1 if exactly else len({len(codes) for codes in together}) > 1


def test_a_motion_is_as_long_as_is_asked_and_no_shorter_than_its_action() -> None:
    given, actions = source(ending=30.0), np.array([0, 1, 2])  # it would always end
    for memory in (0.0, 1.0):
        drawing = replace(PLAIN, memory=memory)
        for codes in draw_codes(Writer(given, rngs(0, 1, 2), drawing), actions, 23, exactly=True):
            assert codes.shape == (23, PARTS)
            assert (codes[:, 0] != END).all()
    least = 1 + math.ceil(0.7 * SHORTEST)  # the first step ended, too: it begins again
    found = draw_codes(Writer(given, rngs(0, 1, 2), PLAIN), actions, 23)
    assert [len(codes) for codes in found] == [least] * 3


def test_all_from_memory_is_a_remembered_motion_to_its_end() -> None:
    given, actions = source(), np.repeat(np.arange(ACTIONS), 5)
    calls = given.part.calls  # type: ignore[attr-defined]
    found = draw_codes(Writer(given, rngs(*range(15)), replace(PLAIN, memory=1.0)), actions, 50)
    assert given.part.calls == calls  # type: ignore[attr-defined]  # the net is not asked
    played = set()
    for action, codes in zip(actions, found, strict=True):
        known = [row[:-1].tolist() for of, row in MOTIONS if of == action]
        assert codes.tolist() in known
        played.add(str(codes.tolist()))
    assert len(played) == len(MOTIONS)


def particular() -> list[tuple[int, Array]]:
    """Motions of which only those of action 1 have the last code of the body."""
    return [(of, np.where((of != 1) & (np.arange(PARTS) > 0), np.minimum(codes, 2), codes)) for of, codes in MOTIONS]


def naive_acts(motions: list[tuple[int, Array]]) -> list[list[float]]:
    """The share of what is particular in each motion that is over before each of its steps, and after the last."""
    every = [step.tolist() for _, codes in motions for step in codes if step[0] != END]

    def rarity(step: list[int]) -> float:
        having = [
            {action for action, codes in motions if any(one[0] != END and one[part] == step[part] for one in codes)}
            for part in (1, 2)
        ]
        return sum(math.log(ACTIONS / len(actions)) for actions in having)

    mean, spread, found = np.mean([*map(rarity, every)]), np.std([*map(rarity, every)]), []
    for _, codes in motions:
        counts = []
        for before, step in zip([codes[0], *codes], codes, strict=False):
            body = numbers_of(np.stack([before, step]))[:, 1:]
            rare = math.exp((rarity(step.tolist()) - mean) / spread) if step[0] != END else 0.0
            counts.append((1.0 + float(((body[1] - body[0]) ** 2).sum())) * rare)
        found.append([sum(counts[:at]) / sum(counts) for at in range(len(counts) + 1)])
    return found


@pytest.mark.parametrize("steps", [1, 2, 4, 6])
def test_of_a_longer_action_the_most_of_its_act_is_shown(steps: int) -> None:
    motions = particular()
    known, best = Memory.of(*memory_tables(motions)), set()
    for start, (action, codes), acts in zip(STARTS.tolist(), motions, naive_acts(motions), strict=False):
        np.testing.assert_allclose(known.acts[start : start + len(codes)], acts[:-1])
        shown = [acts[at + steps] - acts[at] for at in range(len(codes) - steps)]
        good = [start + at for at, one in enumerate(shown) if one >= 0.95 * max(shown)]
        if action == 1:
            best.add(good[len(good) // 2])
    assert {known.busiest(1, [], steps, uniform) for uniform in np.linspace(0, 0.99, 20)} == best
    assert known.busiest(1, [], 50, 0.0) == STARTS[1]  # as long as it is: from the start


def test_an_act_is_played_a_little_faster_or_slower() -> None:
    motions = particular()
    known = Memory.of(*memory_tables(motions))
    for action in range(ACTIONS):
        wholes, acts = [], []
        for (of, codes), over in zip(motions, naive_acts(motions), strict=True):
            if of == action:
                wholes.append(sum(codes[:, 0] != END))
                acts.append(
                    min(b - a for a in range(len(over)) for b in range(a, len(over)) if over[b] - over[a] >= 0.8)
                )
        act, whole = int(np.median(acts)), int(np.median(wholes))
        for steps in range(1, 20):
            found = act if act / 1.2 <= steps < act else whole if whole < steps <= 1.2 * whole else steps
            assert known.paced(action, steps) == found
    assert known.paced(ACTIONS, 7) == 7  # of which nothing is remembered


def test_a_short_motion_begins_where_its_action_shows_most() -> None:
    given, actions = source(), np.repeat(np.arange(ACTIONS), 4)
    for share in (0.01, 1.0):  # the first step is remembered, however few others are
        writer = Writer(given, rngs(*range(12)), replace(PLAIN, memory=share))
        _, codes = next(drawn_steps(writer, actions, 3, exactly=True))
        for row, action in enumerate(actions.tolist()):
            starts = {given.memory.busiest(action, [], 3, uniform) for uniform in np.linspace(0, 0.99, 20)}
            (place,) = (one for one in starts if given.memory.codes[one].tolist() == codes[row].tolist())
            assert writer.age[row] == given.memory.ages[place] + 1
    plain = Writer(given, rngs(*range(12)), PLAIN)
    next(drawn_steps(plain, actions, 3, exactly=True))
    assert (plain.age == 1).all()


def test_a_share_of_steps_is_remembered() -> None:
    given = source(ending=-50.0)
    found = draw_codes(Writer(given, rngs(*range(200)), replace(PLAIN, memory=0.25)), np.full(200, 1), 1)
    starts = [row[0].tolist() for of, row in MOTIONS if of == 1]
    by_net = draw_codes(Writer(given, rngs(*range(200)), PLAIN), np.full(200, 1), 1)
    drawn = np.array([np.random.default_rng(seed).random((PARTS + 2,), np.float32)[0] for seed in range(200)])
    for share, codes, other in zip(drawn, found, by_net, strict=True):
        assert codes[0].tolist() in starts if share < 0.25 else codes[0].tolist() == other[0].tolist()


@pytest.mark.parametrize("seed", range(6))
def test_an_action_takes_over_where_the_last_one_ends(seed: int) -> None:
    """The end is not among what was before, and neither are the states that knew of it."""
    given = source(sharpness=0.6, ending=1.5)
    writer, first, ages = Writer(given, rngs(seed), PLAIN), list[Array](), [0]
    for _, step in drawn_steps(writer, np.array([0]), 60):
        first.append(step[0])
        ages.append(int(writer.age[0]))
    assert 1 <= len(first) < 60
    second = [step[0].tolist() for _, step in drawn_steps(writer, np.array([2]), 60)]
    rng = np.random.default_rng(seed)
    for _ in range(len(first) + 1):  # of the end, too
        rng.random((PARTS + 2,), np.float32)
    other = Writer(given, [rng], PLAIN)
    other.states = [_seen(given, first, ages)]
    other.last = first[-1][None]
    assert [step[0].tolist() for _, step in drawn_steps(other, np.array([2]), 60)] == second
    assert second


def _seen(given: Source, steps: list[Array], ages: list[int]) -> dict[str, Array]:
    """States of a writer that drew some steps for action 0, before the last of them is seen."""
    last, state = np.array([[[given.end + 1, 0, 0]]] * 2), np.zeros((2, KNOWN), np.float32)
    for age, following in zip(ages, steps, strict=False):
        feeds = {"codes": last, "action": np.array([[0], [NULL_ACTION]]), "age": np.full((2, 1), age), "state": state}
        state, last = given.step(feeds)["next_state"], np.tile(following, (2, 1, 1))
    return {"state": state}


def test_what_was_done_before_is_gone_on_with() -> None:
    given, (action, codes) = source(), MOTIONS[2]
    writer = Writer(given, rngs(0), replace(PLAIN, memory=1.0))
    early = math.ceil(0.3 * len(codes)) - 1
    writer.see(codes[:early])
    # the age says that the action has just begun, but the past decides where in its early part
    found = [step[0].tolist() for _, step in drawn_steps(writer, np.array([action]), 50)]
    assert found == codes[early:-1].tolist()
    fed = Writer(given, rngs(0), PLAIN)
    fed.see(codes[:2])
    state = np.zeros((2, KNOWN), np.float32)
    for before in ([given.end + 1, 0, 0], codes[0]):
        steps = np.tile(before, (2, 1, 1))
        feeds = {"codes": steps, "action": np.full((2, 1), NULL_ACTION), "age": np.zeros((2, 1), np.int64)}
        state = given.step({**feeds, "state": state})["next_state"]
    fed._known(np.array([0]))
    np.testing.assert_array_equal(fed.states[0]["state"], state)
    assert fed.last.tolist() == [codes[1].tolist()]


class Prompt(Writer):
    """A writer whose net reads every step as it comes."""

    def _advance(self, actions: Array) -> None:
        super()._advance(actions)
        self._known_of_all = super()._known(np.arange(len(self.states)))

    def _known(self, rows: Array) -> Array:
        return self._known_of_all[rows]


@pytest.mark.parametrize("memory", [0.0, 0.5, 0.95])
@pytest.mark.parametrize("exactly", [False, True])
def test_a_net_that_reads_late_draws_what_it_draws_step_by_step(memory: float, exactly: bool) -> None:
    given = source(sharpness=0.6)
    drawing = replace(PLAIN, memory=memory, guidance=1.7)
    actions = np.arange(8) % ACTIONS
    late = draw_codes(Writer(given, rngs(*range(8)), drawing), actions, 40, exactly)
    prompt = draw_codes(Prompt(given, rngs(*range(8)), drawing), actions, 40, exactly)
    assert [codes.tolist() for codes in late] == [codes.tolist() for codes in prompt]
    assert max(map(len, late)) > 6
