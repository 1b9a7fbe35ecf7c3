"""motet: sequence models of human motion, run by numpy and onnxruntime.

``motet.load("control")`` gives a model, ``motet.read`` and ``motet.write`` take motion files; geometry is in
:mod:`motet.motion`. What happens on the way is logged by the logger "motet".
"""

import logging
from importlib.metadata import version

from motet import motion
from motet.bundle.bundle import Bundle, list_bundles
from motet.bundle.graph import SessionOptions
from motet.compose.compose import Composition, Met, compose
from motet.compose.plans import Moment, parse_plan, read_plan
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
from motet.generate.base import Generated, GenerateModel, GenerateSettings
from motet.generate.model import CodesModel, Story, StorySettings, Understood
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
from motet.text.clauses import Passage, Shown
from motet.text.numeric_phrases import Quantities

__version__ = version("motet")

# fmt: off
__all__ = [
    "Act", "ArgumentError", "Bundle", "BundleError", "BundleModel", "Character", "Checked", "CodesModel",
    "Composition", "ControlError", "ControlModel", "ControlWarning", "DecodingError", "DescribeModel", "Description",
    "Event", "FillModel", "FormatError", "GenerateModel", "GenerateSettings", "Generated", "Hit", "Humanoid", "Index",
    "Matched", "Met", "MixtureModel", "Moment", "MotetError", "Motion", "MotionError", "OutputError", "Part",
    "Passage", "Pose", "PredictModel", "PredictSession", "Quantities", "SaidActs", "ScriptError", "SearchModel",
    "SessionOptions", "SettingError", "Shown", "SteerModel", "SteerSession", "SteerSnapshot", "Story", "StorySettings",
    "TdbnModel", "TdbnSession", "TdbnSnapshot", "TextError", "TextWarning", "TravelWarning", "Understood",
    "UnitError", "check", "clips", "compose", "figures_in", "from_humanoid", "list_bundles", "live_page", "load",
    "load_as", "motion", "parse_plan", "read", "read_map", "read_plan", "to_humanoid", "write", "write_demo",
    "write_live_page",
]
# fmt: on

logging.getLogger("motet").addHandler(logging.NullHandler())
