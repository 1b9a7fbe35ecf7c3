"""The record of a decoding loop: what it runs, and its settings with their ranges."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from motet.errors import DecodingError, SettingError
from motet.settings import Settings


@dataclass(frozen=True)
class Loop:
    """A decoding loop; :mod:`motet.decode.loops` lists all, by the names that manifests use.

    run: the loop itself. What it takes is the same for all loops of a verb: see
        :class:`motet.models.describe.DescribeModel`, GenerateModel and PredictModel. Settings are given by name.
    inputs, outputs: what the step graph takes beside its states, and gives beside them: :mod:`motet.bundle.signature`.
    settings: what a bundle has defaults of, and a user may choose anew for each call.
    batch: rows decoded at once; more cost memory without gaining speed.
    """

    run: Callable[..., Any]
    inputs: Mapping[str, str]
    outputs: Mapping[str, str]
    settings: type[Settings] = Settings
    batch: int = 64

    def defaults(self, given: Mapping[str, Any]) -> dict[str, float]:
        """The settings of a bundle; BundleError for one that is missing, not a number or out of range."""
        own = {name: given[name] for name in self.settings.RANGES if given.get(name) is not None}
        return dict(vars(self.settings.read(own, "defaults")))

    def settled(self, defaults: Mapping[str, float], given: Mapping[str, float | None]) -> dict[str, float]:
        """All settings: the user's, and the defaults in place of None.

        DecodingError for one that is unknown or out of range.
        """
        try:
            chosen = {name: self.settings.check(name, value) for name, value in given.items() if value is not None}
        except SettingError as error:
            raise DecodingError(str(error)) from error
        return {**defaults, **chosen}
