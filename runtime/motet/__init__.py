"""motet: sequence models of human motion, run by numpy and onnxruntime.

``motet.load("control")`` gives a model, ``motet.read`` and ``motet.write`` take motion files; geometry is in
:mod:`motet.motion`. What happens on the way is logged by the logger "motet".
"""

import logging
from importlib import import_module
from typing import TYPE_CHECKING, Any

from motet.lazy import lazily

if TYPE_CHECKING:
    from motet import motion
    from motet.bundle.bundle import Bundle, list_bundles
    from motet.bundle.graph import SessionOptions
    from motet.composition.compose import Composition, Met, compose
    from motet.composition.plans import Moment, parse_plan, read_plan
    from motet.corpus.checked import Checked, check
    from motet.errors import (
        ArgumentError,
        BundleError,
        ControlError,
        ControlWarning,
        DecodingError,
        FormatError,
        MotetError,
        MotionError,
        OutputError,
        ScriptError,
        SettingError,
        TextError,
        TextWarning,
        TravelWarning,
        UnitError,
    )
    from motet.figures.humanoid import Humanoid, from_humanoid, read_map, to_humanoid
    from motet.formats import Character, clips, figures_in
    from motet.formats import read_motion as read
    from motet.formats import write_motion as write
    from motet.generate.base import Generated, GenerateModel, GenerateSettings, Story, Understood
    from motet.generate.model import CodesModel, StorySettings
    from motet.live.demo import write_demo
    from motet.live.page import live_page, write_live_page
    from motet.models.base import BundleModel
    from motet.models.control import ControlModel
    from motet.models.describe import DescribeModel, Description, Part
    from motet.models.load import load, load_as
    from motet.motion.motion import Motion
    from motet.papers.mixture_model import MixtureModel
    from motet.papers.tdbn_control import TdbnModel, TdbnSession, TdbnSnapshot
    from motet.predict.fill import FillModel
    from motet.predict.model import PredictModel, PredictSession
    from motet.search.model import Hit, Index, SearchModel
    from motet.steering.acts import Act
    from motet.steering.events import Event
    from motet.steering.matching import Matched
    from motet.steering.model import SteerModel
    from motet.steering.pose import Pose
    from motet.steering.sentence_acts import SaidActs
    from motet.steering.session import SteerSession, SteerSnapshot
    from motet.steering.spoken import Reading
    from motet.text.clauses import Passage, Shown
    from motet.text.numeric_phrases import Quantities

    __version__: str

# fmt: off
__all__ = [
    "Act", "ArgumentError", "Bundle", "BundleError", "BundleModel", "Character", "Checked", "CodesModel",
    "Composition", "ControlError", "ControlModel", "ControlWarning", "DecodingError", "DescribeModel", "Description",
    "Event", "FillModel", "FormatError", "GenerateModel", "GenerateSettings", "Generated", "Hit", "Humanoid", "Index",
    "Matched", "Met", "MixtureModel", "Moment", "MotetError", "Motion", "MotionError", "OutputError", "Part",
    "Passage", "Pose", "PredictModel", "PredictSession", "Quantities", "Reading", "SaidActs", "ScriptError",
    "SearchModel", "SessionOptions", "SettingError", "Shown", "SteerModel", "SteerSession", "SteerSnapshot",
    "Story", "StorySettings", "TdbnModel", "TdbnSession", "TdbnSnapshot", "TextError", "TextWarning",
    "TravelWarning", "Understood", "UnitError", "check", "clips", "compose", "figures_in", "from_humanoid",
    "list_bundles", "live_page", "load", "load_as", "motion", "parse_plan", "read", "read_map", "read_plan",
    "to_humanoid", "write", "write_demo", "write_live_page",
]
# fmt: on

_PLACES = {
    "motet.bundle.bundle": "Bundle list_bundles",
    "motet.bundle.graph": "SessionOptions",
    "motet.composition.compose": "Composition Met compose",
    "motet.composition.plans": "Moment parse_plan read_plan",
    "motet.corpus.checked": "Checked check",
    "motet.errors": (
        "ArgumentError BundleError ControlError ControlWarning DecodingError FormatError MotetError "
        "MotionError OutputError ScriptError SettingError TextError TextWarning TravelWarning UnitError"
    ),
    "motet.figures.humanoid": "Humanoid from_humanoid read_map to_humanoid",
    "motet.formats": "Character clips figures_in read=read_motion write=write_motion",
    "motet.generate.base": "Generated GenerateModel GenerateSettings Story Understood",
    "motet.generate.model": "CodesModel StorySettings",
    "motet.live.demo": "write_demo",
    "motet.live.page": "live_page write_live_page",
    "motet.models.base": "BundleModel",
    "motet.models.control": "ControlModel",
    "motet.models.describe": "DescribeModel Description Part",
    "motet.models.load": "load load_as",
    "motet.motion.motion": "Motion",
    "motet.papers.mixture_model": "MixtureModel",
    "motet.papers.tdbn_control": "TdbnModel TdbnSession TdbnSnapshot",
    "motet.predict.fill": "FillModel",
    "motet.predict.model": "PredictModel PredictSession",
    "motet.search.model": "Hit Index SearchModel",
    "motet.steering.acts": "Act",
    "motet.steering.events": "Event",
    "motet.steering.matching": "Matched",
    "motet.steering.model": "SteerModel",
    "motet.steering.pose": "Pose",
    "motet.steering.sentence_acts": "SaidActs",
    "motet.steering.spoken": "Reading",
    "motet.steering.session": "SteerSession SteerSnapshot",
    "motet.text.clauses": "Passage Shown",
    "motet.text.numeric_phrases": "Quantities",
}
"""Module -> the public names that it has. Each is imported when it is first used, so that none waits for all."""

if not TYPE_CHECKING:  # to a type checker, a module with __getattr__ has any attribute
    _imported = lazily(__name__, _PLACES)

    def __getattr__(name: str) -> Any:
        return import_module("importlib.metadata").version(__name__) if name == "__version__" else _imported(name)

    def __dir__() -> list[str]:
        return sorted({*globals(), *__all__})


logging.getLogger("motet").addHandler(logging.NullHandler())
