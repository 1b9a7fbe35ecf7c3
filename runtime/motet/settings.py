"""Settings: numbers that were tuned or may be chosen, each with a range and a unit.

Those of a feature are a frozen dataclass, with defaults beside the code that uses them::

    @dataclass(frozen=True)
    class FootLockSettings(Settings):
        FEATURE: ClassVar = "foot_lock"
        reach: Annotated[float, Range(0, 1, "m")] = 0.2

A bundle holds values of its own under ``settings.foot_lock`` of its manifest. Here is also what the arguments of all
verbs have in common: whole numbers that are checked, seeds, and reports of progress.
"""

import math
import operator
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import MISSING, dataclass, fields
from typing import Annotated, Any, ClassVar, NamedTuple, Self, SupportsIndex, get_args, get_origin, get_type_hints

import numpy as np

from motet.errors import BundleError, MotetError, SettingError

Progress = Callable[[int, int], object]
"""How long-running work reports its progress: called with the number done and the total."""

Seed = SupportsIndex | Sequence[SupportsIndex]
"""The first row's seed, counted up for the others; or one for each row. Integers of Python or numpy."""


class Range(NamedTuple):
    """The lowest and the highest value of a setting, and its unit where it has one."""

    low: float
    high: float
    unit: str = ""


@dataclass(frozen=True)
class Settings:
    """Base of every feature's settings, whose fields are ``Annotated[float or int, Range(...)]``. SettingError where a
    value is out of range, or not whole where its type is int."""

    FEATURE: ClassVar[str] = ""
    RANGES: ClassVar[Mapping[str, tuple[bool, Range]]] = {}
    """Of each setting by name: whether it is a whole number, and its range."""

    def __init_subclass__(cls) -> None:
        # fields without a range, such as class variables, are no settings
        hints = get_type_hints(cls, include_extras=True).items()
        ranges = {name: get_args(hint) for name, hint in hints if get_origin(hint) is Annotated}
        cls.RANGES = {name: (kind is int, limits) for name, (kind, limits) in ranges.items()}

    def __post_init__(self) -> None:
        for name in self.RANGES:
            object.__setattr__(self, name, self.check(name, getattr(self, name)))

    @classmethod
    def read(cls, values: Mapping[str, Any], path: str) -> Self:
        """The settings of a manifest's object at ``path``, and defaults for those that it does not name. BundleError
        with the key of one that is unknown, missing, or out of range."""
        # first the names, then the values, which the class itself checks
        for name in values:
            if name not in cls.RANGES:
                raise BundleError(f"manifest, {path}.{name}: is unknown; expected one of {', '.join(cls.RANGES)}")
        for field in fields(cls):
            if field.default is MISSING and field.name not in values:
                raise BundleError(f"manifest, {path}.{field.name}: is missing")
        try:
            return cls(**values)
        except SettingError as error:
            raise BundleError(f"manifest, {path}.{error}") from error

    @classmethod
    def check(cls, name: str, value: Any) -> float:
        """The value of a setting as int or float; SettingError where it is unknown or out of range."""
        if name not in cls.RANGES:
            raise SettingError(f"there is no setting {name!r}, only {', '.join(cls.RANGES)}")
        whole, (low, high, unit) = cls.RANGES[name]
        # numbers of numpy count as Python's
        number = value.item() if isinstance(value, np.generic) else value
        if not is_number(number) or not low <= number <= high:
            raise SettingError(f"{name} must be between {low:g} and {f'{high:g} {unit}'.strip()}, not {value}")
        if whole and number != int(number):
            raise SettingError(f"{name} must be a whole number, not {value}")
        return int(number) if whole else float(number)


def is_number(value: object) -> bool:
    """Whether a value is a finite number, and not true or false."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < math.inf


def checked_int(name: str, value: Any, low: int, high: int, error: type[MotetError] = SettingError) -> int:
    """A whole number of Python's or numpy's from ``low`` to ``high``; ``error`` for anything else, True and 2.0 too."""
    try:
        number = low - 1 if isinstance(value, bool) else operator.index(value)
    except TypeError:
        number = low - 1
    if not low <= number <= high:
        raise error(f"{name} must be a whole number from {low} to {high}, not {value!r}")
    return number


def seeds_of(seed: Seed, count: int, error: type[MotetError]) -> list[int]:
    """A seed for each of ``count`` rows; ``error`` for a negative one, another number of them, or another type."""
    try:  # arrays look like integers, too: iterables are asked for first
        numbers = seed if isinstance(seed, Iterable) else range(operator.index(seed), operator.index(seed) + count)
        seeds = list(map(operator.index, numbers))
    except TypeError:
        seeds = []
    if len(seeds) != count or min(seeds, default=0) < 0:
        raise error(f"expected a seed of 0 or more, or one for each of {count}, not {seed}")
    return seeds


def silent(done: int, total: int) -> None:
    """Report no progress."""
