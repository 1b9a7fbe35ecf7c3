"""Small graphs of a model that writes motions as codes: numpy functions of random matrices."""

from functools import partial
from typing import Any

import numpy as np
from fake_models import FakeGraph, spec
from numpy.typing import NDArray

from motet.generate.codes import Source
from motet.generate.memory import Memory

Array = NDArray[Any]
MOVES, BODY, GROUPS, ACTIONS = 5, 4, 2, 3
"""Root moves, of which one more is the end, codes of each of the body's groups, and actions."""

PARTS, KNOWN = GROUPS + 1, 6
END, NULL_ACTION = MOVES, ACTIONS
NEVER = -1e4


def numbers_of(codes: Array) -> Array:
    """Numbers (B, L) of steps (B, P): far apart for different steps, 0 for no step and for an end."""
    return 2.0 * (codes + 1) * (codes[:, :1] < END)


def step(seed: int = 0) -> FakeGraph:
    """A recurrent net over steps of codes, each with its action and its age."""
    rng = np.random.default_rng(seed)
    moves, body = rng.normal(size=(MOVES + 2, KNOWN)), rng.normal(size=(GROUPS, BODY, KNOWN))
    actions, ages = rng.normal(size=(ACTIONS + 1, KNOWN)), rng.normal(size=(64, KNOWN))

    def run(codes: Array, action: Array, age: Array, state: Array) -> tuple[Array, Array]:
        for step in range(codes.shape[1]):
            seen = moves[codes[:, step, 0]] + ages[np.minimum(age[:, step], 63)]
            for group in range(GROUPS):
                seen = seen + body[group][codes[:, step, group + 1]]
            state = np.tanh(0.6 * state + seen).astype(np.float32)
        return state + actions[action[:, -1]], state

    sizes = {"P": PARTS, "H": KNOWN}
    given = {"codes": "*batch steps P", "action": "*batch steps", "age": "*batch steps", "state": "batch H"}
    return FakeGraph(spec(given, {"known": "batch H", "next_state": "batch H"}, sizes), run)


def part(seed: int = 1, sharpness: float = 1.0, ending: float = 0.0) -> FakeGraph:
    """The parts of a step, each knowing those before it; ``ending`` is added to the logit of an end."""
    rng = np.random.default_rng(seed)
    sizes = [MOVES + 1] + [BODY] * GROUPS
    heads = [rng.normal(size=(KNOWN, size)) for size in sizes]
    before = rng.normal(size=(PARTS, MOVES + 2, KNOWN))

    def run(known: Array, codes: Array) -> tuple[Array]:
        found, told = np.full((len(known), PARTS, max(sizes)), NEVER), known.astype(float)
        for place, (head, size) in enumerate(zip(heads, sizes, strict=True)):
            logits = sharpness * (told[:, :, None] * head).sum(axis=1)
            logits[:, END:] += ending * (place == 0)
            found[:, place, :size] = logits - np.log(np.exp(logits).sum(axis=1, keepdims=True))
            told = told + before[place][codes[:, place]]
        return (found,)

    names = {"P": PARTS, "H": KNOWN, "K": max(sizes)}
    given = {"known": "batch H", "codes": "*batch P"}
    return FakeGraph(spec(given, {"log_probabilities": "batch P K"}, names), run)


def remembered(seed: int = 2, motions: int = 6, steps: int = 7) -> list[tuple[int, Array]]:
    """Motions in codes (N, P), the end included, each with its action; no step comes twice."""
    rng = np.random.default_rng(seed)
    every = np.stack(np.meshgrid(np.arange(MOVES), *[np.arange(BODY)] * GROUPS, indexing="ij"), axis=-1)
    drawn = rng.permutation(every.reshape(-1, PARTS))[: motions * steps].reshape(motions, steps, PARTS)
    last = np.array([[END, *[0] * GROUPS]])
    return [(number % ACTIONS, np.concatenate([codes, last])) for number, codes in enumerate(drawn)]


def memory_tables(motions: list[tuple[int, Array]]) -> tuple[Array, Array, Array, int]:
    """The tables that hold some motions: steps, numbers of moves and of codes; and how many actions there are."""
    steps = [(*code, action, age) for action, codes in motions for age, code in enumerate(codes)]
    moves, body = (2.0 * np.arange(1, count + 1, dtype=np.float32)[:, None] for count in (MOVES, BODY))
    return np.array(steps, dtype=np.int16), moves, body, ACTIONS


def source(sharpness: float = 1.0, ending: float = 0.0) -> Source:
    """What writers draw from."""
    remember = partial(Memory.of, *memory_tables(remembered()))
    parts = part(sharpness=sharpness, ending=ending)
    return Source(step(), parts, END, NULL_ACTION, remember, np.arange(NULL_ACTION + 1))
