"""What all models that are controlled live share: they run scripts."""

from abc import abstractmethod
from typing import Any

from motet.models.base import BundleModel
from motet.motion.motion import Motion


class ControlModel(BundleModel):
    """A model of the verb control."""

    VERB = "control"

    @abstractmethod
    def run(self, script: str, start: Motion | str | None = None, **settings: Any) -> Motion:
        """The motion of one figure that runs a script; ControlError for a setting that the model does not have."""

    @abstractmethod
    def captions(self, script: str) -> list[tuple[float, str]]:
        """When each part of a script begins, in seconds, and how a viewer calls it; ScriptError as :meth:`run`."""
