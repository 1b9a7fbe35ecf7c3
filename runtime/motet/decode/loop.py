"""The record of a decoding loop: the verb it is for, and its settings with their ranges."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from motet.bundle.fields import is_number
from motet.errors import BundleError, DecodingError


@dataclass(frozen=True)
class Setting:
    """A number between ``low`` and ``high``; ``default`` is its value where a bundle does not say it, if any."""

    low: float
    high: float
    whole: bool = False
    default: float | None = None


@dataclass(frozen=True)
class Loop:
    """A decoding loop of a verb; :mod:`motet.decode.loops` lists all, by the names that manifests use.

    run: the loop itself. What it takes is the same for all loops of a verb: see
        :class:`motet.models.describe.DescribeModel`, GenerateModel and PredictModel. Settings are given by name.
    inputs, outputs: what the step graph takes beside its states, and gives beside them: :mod:`motet.bundle.signature`.
    batch: how many rows it decodes at once; more bring no speed and take memory.
    """

    verb: str
    run: Callable[..., Any]
    inputs: Mapping[str, str]
    outputs: Mapping[str, str]
    settings: Mapping[str, Setting]
    batch: int = 64

    def defaults(self, given: Mapping[str, Any]) -> dict[str, float]:
        """The settings of a bundle; BundleError for one that is missing, not a number or out of range."""
        found = {}
        for name, setting in self.settings.items():
            value = given.get(name, setting.default)
            if value is None:
                raise BundleError(f"manifest, defaults.{name}: is missing")
            try:
                found[name] = self.check(name, value)
            except DecodingError as error:
                raise BundleError(f"manifest, defaults.{name}: {error}") from error
        return found

    def settled(self, defaults: Mapping[str, float], given: Mapping[str, float | None]) -> dict[str, float]:
        """All settings: those that a user gives, and the defaults in place of None; DecodingError as :meth:`check`."""
        chosen = {name: value for name, value in given.items() if value is not None}
        return {**defaults, **{name: self.check(name, value) for name, value in chosen.items()}}

    def check(self, name: str, value: Any) -> float:
        """A setting's value as int or float; DecodingError for one out of range, or that the loop does not have."""
        if name not in self.settings:
            raise DecodingError(f"this model's decoding has no setting {name!r}, only {', '.join(self.settings)}")
        low, high, whole = self.settings[name].low, self.settings[name].high, self.settings[name].whole
        number = value.item() if isinstance(value, np.generic) else value
        if not is_number(number) or not low <= number <= high:
            raise DecodingError(f"{name} must be between {low:g} and {high:g}, not {value}")
        if whole and number != int(number):
            raise DecodingError(f"{name} must be a whole number, not {value}")
        return int(number) if whole else float(number)
