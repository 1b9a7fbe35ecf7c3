"""motet: sequence models of human motion, run by numpy and onnxruntime.

``motet.load("control")`` gives a model, ``motet.read`` and ``motet.write`` take motion files; geometry is in
:mod:`motet.motion`. What happens on the way is logged by the logger "motet".
"""

import logging
from importlib.metadata import version

from motet import motion
from motet.bundle.bundle import Bundle, list_bundles
from motet.bundle.graph import SessionOptions
from motet.checked import Checked, check
from motet.decode.acts import Act
from motet.decode.matched import Matched
from motet.demo import write_demo
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
from motet.formats import Character, clips, figures_in
from motet.formats import read_motion as read
from motet.formats import write_motion as write
from motet.live.page import live_page, write_live_page
from motet.models.base import BundleModel, ControlModel
from motet.models.compose import Composition, Met
from motet.models.composition import Passage, Shown
from motet.models.describe import DescribeModel, Description, Part
from motet.models.fill import FillModel
from motet.models.generate import Generated, GenerateModel, GenerateSettings, MixtureModel
from motet.models.generate_codes import CodesModel, Story, StorySettings, Understood
from motet.models.load import load, load_as
from motet.models.plans import Moment, parse_plan, read_plan
from motet.models.predict import PredictModel, PredictSession
from motet.models.quantities import Quantities
from motet.models.said_acts import SaidActs
from motet.models.search import Hit, Index, SearchModel
from motet.models.steer import SteerModel
from motet.models.steer_session import SteerSession, SteerSnapshot
from motet.models.tdbn_control import TdbnModel, TdbnSession, TdbnSnapshot
from motet.motion.events import Event
from motet.motion.humanoid import Humanoid, from_humanoid, read_map, to_humanoid
from motet.motion.motion import Motion
from motet.motion.pose import Pose

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
    "UnitError", "check", "clips", "figures_in", "from_humanoid", "list_bundles", "live_page", "load", "load_as",
    "motion", "parse_plan", "read", "read_map", "read_plan", "to_humanoid", "write", "write_demo", "write_live_page",
]
# fmt: on

logging.getLogger("motet").addHandler(logging.NullHandler())
