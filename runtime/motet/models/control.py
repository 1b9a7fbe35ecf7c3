"""What models of controllable figures share."""

from abc import abstractmethod
from collections.abc import Sequence
from itertools import accumulate
from typing import Any, Protocol

from motet.models.base import BundleModel
from motet.motion.motion import Motion

LONGEST_SCRIPT = 3600.0  # seconds: it is laid out in memory before it runs


LARGEST_CROWD = 100_000  # characters of one session, whose state is in memory


class ControlModel(BundleModel):
    """A model of controllable figures: :class:`motet.steering.model.SteerModel` or
    :class:`motet.papers.tdbn_control.TdbnModel`, depending on the bundle's loop. Each has its own script syntax."""

    VERB = "control"

    @abstractmethod
    def run(self, script: str, *args: Any, **settings: Any) -> Motion:
        """The motion of one figure that runs a script, with the settings of the subclass; ScriptError where it does not
        parse."""

    @abstractmethod
    def captions(self, script: str) -> list[tuple[float, str]]:
        """The start of each part of a script, in seconds, and its caption; ScriptError like :meth:`run`."""


class TimedPart(Protocol):
    """A part of a script."""

    @property
    def seconds(self) -> float:
        """How long it lasts."""

    @property
    def caption(self) -> str:
        """In words."""


def captions(parts: Sequence[TimedPart]) -> list[tuple[float, str]]:
    """When each part of a script starts, in seconds, and its caption."""
    starts = accumulate((part.seconds for part in parts), initial=0.0)
    return [(start, part.caption) for start, part in zip(starts, parts, strict=False)]
