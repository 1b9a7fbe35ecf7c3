"""motet: sequence models of human motion, run by numpy and onnxruntime.

``motet.load("cmu-control")`` gives a model, ``motet.read`` and ``motet.write`` take motion files.
"""

from importlib.metadata import version

from motet.bundle.bundle import Bundle, list_bundles
from motet.errors import (
    BundleError,
    ControlError,
    DecodingError,
    FormatError,
    MotetError,
    MotionError,
    OutputError,
    ScriptError,
    TextError,
    TextWarning,
)
from motet.formats import read_motion as read
from motet.formats import write_motion as write
from motet.models.control import ControlModel, ControlSession, Snapshot
from motet.models.describe import DescribeModel, Description
from motet.models.generate import Generated, GenerateModel
from motet.models.load import load
from motet.models.predict import PredictModel, PredictSession
from motet.models.text import Vocabulary
from motet.motion.heading import without_heading
from motet.motion.kinematics import positions
from motet.motion.mirror import mirror
from motet.motion.motion import Motion
from motet.motion.root_path import lay_root_path
from motet.motion.skeleton import Joint, Skeleton
from motet.representation.root_block import from_root_block, plant_feet, to_root_block

__version__ = version("motet")

__all__ = [
    "Bundle",
    "BundleError",
    "ControlError",
    "ControlModel",
    "ControlSession",
    "DecodingError",
    "DescribeModel",
    "Description",
    "FormatError",
    "GenerateModel",
    "Generated",
    "Joint",
    "MotetError",
    "Motion",
    "MotionError",
    "OutputError",
    "PredictModel",
    "PredictSession",
    "ScriptError",
    "Skeleton",
    "Snapshot",
    "TextError",
    "TextWarning",
    "Vocabulary",
    "from_root_block",
    "lay_root_path",
    "list_bundles",
    "load",
    "mirror",
    "plant_feet",
    "positions",
    "read",
    "to_root_block",
    "without_heading",
    "write",
]
