"""What all decoding loops share: their record, a step graph whose outputs become its next inputs, and noise."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from motet.bundle.graph import Arrays, Floats, Graph
from motet.errors import BundleError, DecodingError, SettingError
from motet.settings import Settings


@dataclass(frozen=True)
class Loop:
    """A decoding loop; each class of models has its own, by the names that manifests use.

    run: the loop itself. What it takes is the same for all loops of a verb: see
        :class:`motet.models.describe.DescribeModel`, GenerateModel and PredictModel. Settings are given by name.
    inputs, outputs: what the step graph takes beside its states, and gives beside them: :mod:`motet.bundle.graph`.
    settings: what a bundle has defaults of, and a user may choose anew for each call.
    batch: rows decoded at once; more cost memory without gaining speed.
    """

    run: Callable[..., Any]
    inputs: Mapping[str, str]
    outputs: Mapping[str, str]
    settings: type[Settings] = Settings
    batch: int = 64

    def defaults(self, values: Mapping[str, Any]) -> dict[str, float]:
        """The settings of a bundle; BundleError for one that is missing, not a number or out of range."""
        known = {name: values[name] for name in self.settings.RANGES if values.get(name) is not None}
        return dict(vars(self.settings.read(known, "defaults")))

    def settled(self, defaults: Mapping[str, float], values: Mapping[str, float | None]) -> dict[str, float]:
        """All settings: the user's, and the defaults in place of None.

        DecodingError for one that is unknown or out of range.
        """
        try:
            chosen = {name: self.settings.check(name, value) for name, value in values.items() if value is not None}
        except SettingError as error:
            raise DecodingError(str(error)) from error
        return {**defaults, **chosen}


State = dict[str, NDArray[Any]]
Scores = NDArray[np.float64]
Ids = NDArray[np.int64]
Flags = NDArray[np.bool_]


def advance(step: Graph, state: State, inputs: Arrays) -> tuple[dict[str, NDArray[Any]], State]:
    """One time step for a whole batch: the step's outputs, and the state for the next one.

    ``state`` holds the fed back inputs by name, ``inputs`` all others. Neither is changed.
    """
    outputs = step({**state, **inputs})
    return outputs, {name: outputs[source] for name, source in step.spec.feedback.items()}


def zero_state(step: Graph, rows: int, provided: Collection[str] = ()) -> State:
    """The fed back inputs (rows, ...) of a step before the first one, but for those ``provided``: zeros.

    A state that grows starts with the sizes that the contract says, 0 along the axis that it grows on.
    """
    names = [name for name in step.spec.feedback if name not in provided]
    return {name: np.zeros((rows, *step.spec.start_shape(name)), dtype=step.spec.input(name).dtype) for name in names}


def taken(arrays: Arrays, rows: Ids) -> State:
    """Those rows of each array, in that order; some may come more than once."""
    return {name: np.take(array, rows, axis=0) for name, array in arrays.items()}


def two_rows(indices: Ids) -> Ids:
    """Indices of the rows to run, a single one twice.

    A matrix product rounds a single row differently from a row among others; so a row gives, to the bit and with one
    thread, what it gives in any batch.
    """
    return np.repeat(indices, 2) if len(indices) == 1 else indices


class Sample(NamedTuple):
    """A finished sequence: its frames (T, D), which loops give normalised, and the sum of its steps' log-likelihoods.

    None where a loop has no likelihoods. action: the number of the one that it shows, where a loop knows actions.
    """

    frames: NDArray[Any]
    log_likelihood: float | None
    action: int | None = None


class Noise(Protocol):
    """Where the random numbers of a row come from: a :class:`numpy.random.Generator`, or numbers that are given."""

    def standard_normal(self, size: tuple[int, ...], dtype: type[np.float32]) -> Floats:
        """Normal numbers."""

    def random(self, size: tuple[int, ...], dtype: type[np.float32]) -> Floats:
        """Uniform numbers in [0, 1)."""


def apart(noise: Sequence[Noise], count: int) -> list[Noise]:
    """Noise for each of several draws of each row. The first draw of a row has what it would draw alone; what is
    recorded is one for all."""
    noise_of_draws: list[Noise] = []
    for row in noise:
        others = row.spawn(count - 1) if isinstance(row, np.random.Generator) else [row] * (count - 1)
        noise_of_draws += [row, *others]
    return noise_of_draws


class Recorded:
    """The numbers of a recording, (calls, ...) of each kind, given again; BundleError where they do not fit."""

    def __init__(self, drawn: Mapping[str, NDArray[Any]]) -> None:
        self._left = {kind: iter(drawn.get(kind, ())) for kind in ("normal", "uniform")}

    def standard_normal(self, size: tuple[int, ...], dtype: type[np.float32]) -> Floats:
        """Normal numbers."""
        return self._next("normal", size, dtype)

    def random(self, size: tuple[int, ...], dtype: type[np.float32]) -> Floats:
        """Uniform numbers in [0, 1)."""
        return self._next("uniform", size, dtype)

    def _next(self, kind: str, size: tuple[int, ...], dtype: type[np.float32]) -> Floats:
        draw = next(self._left[kind], None)
        if draw is None or draw.shape != size:
            raise BundleError(f"the golden vectors lack {kind} numbers of shape {size}")
        numbers: Floats = draw.astype(dtype)
        return numbers


class Recording(Recorded):
    """A generator whose numbers are kept: ``drawn`` has them by kind ("normal", "uniform"), call by call."""

    def __init__(self, generator: np.random.Generator) -> None:
        self._draw: Mapping[str, Callable[..., Floats]]
        self._draw = {
            "normal": generator.standard_normal,
            "uniform": generator.random,
        }
        self.drawn: dict[str, list[Floats]] = {"normal": [], "uniform": []}

    def _next(self, kind: str, size: tuple[int, ...], dtype: type[np.float32]) -> Floats:
        self.drawn[kind].append(self._draw[kind](size, dtype))
        return self.drawn[kind][-1]


class RowNoise:
    """Uniform numbers in [0, 1) for each row and tick; row i depends on ``seeds[i]`` and the tick alone.

    There is no state to save: the numbers of a tick are the same whenever they are asked for.
    """

    BLOCK = 16  # ticks drawn at once

    def __init__(self, seeds: Sequence[int], width: int) -> None:
        self.seeds = tuple(seeds)
        self.width = width
        self._index = -1
        self._block = np.empty((0, 0, 0), dtype=np.float32)

    def at(self, tick: int) -> Floats:
        """The noise (rows, width) float32 of one tick."""
        index, place = divmod(tick, self.BLOCK)
        if index != self._index:
            generators = (np.random.Generator(np.random.PCG64([seed, index])) for seed in self.seeds)
            blocks = [generator.random((self.BLOCK, self.width), np.float32) for generator in generators]
            self._block = np.stack(blocks, axis=1)
            self._index = index
        noise: Floats = self._block[place]
        return noise


class RowsOfNoise:
    """Uniform numbers (ticks, width) that are given, for one row; BundleError for a tick beyond them."""

    def __init__(self, rows: NDArray[Any]) -> None:
        self._rows = rows.astype(np.float32)

    def at(self, tick: int) -> Floats:
        """See :meth:`RowNoise.at`."""
        if tick >= len(self._rows):
            raise BundleError(f"the golden vectors have noise for {len(self._rows)} ticks only")
        row: Floats = self._rows[tick : tick + 1]
        return row
