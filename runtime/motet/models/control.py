"""Control: figures that move tick by tick as they are told; what both kinds of models have in common."""

from abc import abstractmethod
from typing import Any

from motet.models.base import BundleModel
from motet.motion.motion import Motion


class ControlModel(BundleModel):
    """A model of figures that are controlled: :class:`motet.models.steer.SteerModel` or
    :class:`motet.models.tdbn_control.TdbnModel`, by the bundle's loop. Both take scripts, each in its own words."""

    VERB = "control"

    @abstractmethod
    def run(self, script: str, *args: Any, **settings: Any) -> Motion:
        """The motion of one figure that runs a script, with the settings of the kind; ScriptError where it does not
        parse."""

    @abstractmethod
    def captions(self, script: str) -> list[tuple[float, str]]:
        """When each part of a script begins, in seconds, and how a viewer calls it; ScriptError as :meth:`run`."""
