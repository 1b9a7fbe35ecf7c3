"""Control: figures that move tick by tick under control; the base of both kinds of models."""

from abc import abstractmethod
from typing import Any

from motet.models.base import BundleModel
from motet.motion.motion import Motion


class ControlModel(BundleModel):
    """A model of controllable figures: :class:`motet.models.steer.SteerModel` or
    :class:`motet.models.tdbn_control.TdbnModel`, depending on the bundle's loop. Each has its own script syntax."""

    VERB = "control"

    @abstractmethod
    def run(self, script: str, *args: Any, **settings: Any) -> Motion:
        """The motion of one figure that runs a script, with the settings of the subclass; ScriptError where it does not
        parse."""

    @abstractmethod
    def captions(self, script: str) -> list[tuple[float, str]]:
        """The start of each part of a script, in seconds, and its caption; ScriptError like :meth:`run`."""
