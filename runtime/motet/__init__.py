"""motet: sequence models of human motion, run by numpy and onnxruntime.

``motet.load("cmu-control")`` gives a model, ``motet.read`` and ``motet.write`` take motion files.
"""

from importlib.metadata import version

from motet.bundle import Bundle, list_bundles
from motet.control import ControlModel, ControlSession, Snapshot
from motet.errors import (
    BundleError,
    ControlError,
    FormatError,
    MotetError,
    MotionError,
    OutputError,
    ScriptError,
)
from motet.formats import read_motion as read
from motet.formats import write_motion as write
from motet.heading import without_heading
from motet.kinematics import positions
from motet.mirror import mirror
from motet.models import load
from motet.motion import Motion
from motet.root_path import lay_root_path
from motet.skeleton import Joint, Skeleton

__version__ = version("motet")

__all__ = [
    "Bundle",
    "BundleError",
    "ControlError",
    "ControlModel",
    "ControlSession",
    "FormatError",
    "Joint",
    "MotetError",
    "Motion",
    "MotionError",
    "OutputError",
    "ScriptError",
    "Skeleton",
    "Snapshot",
    "lay_root_path",
    "list_bundles",
    "load",
    "mirror",
    "positions",
    "read",
    "without_heading",
    "write",
]
