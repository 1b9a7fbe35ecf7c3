"""MMM motion (Master Motor Map), the XML files of the KIT Motion-Language data. The skeleton is not in the file.

The first ``Motion`` is read: the angles of its ``JointOrder`` in radians, each channel named like the joint in the
file, and the root's pose. MMM has z up, millimetres, and figures facing y; here y is up, and they face z.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal
from xml.etree import ElementTree

import numpy as np

from motet.errors import FormatError
from motet.files import File, place_of
from motet.formats.text import frame_rate, numbers, read_bytes
from motet.motion.motion import Motion


def read(file: File) -> Motion:
    """Read the first motion of an MMM file, without skeleton.

    Channels: "root.tx" to "root.tz" in "m", "root.rx" to "root.rz" in "rad" with R = Ry Rz Rx, then one for each joint
    in "rad". The frame rate comes from the time steps. FormatError names the file and the line or frame at fault.
    """
    path = place_of(file)
    joints: list[str] = []
    frames: list[list[float]] = []
    for element in _elements(file):
        if element.tag == "JointOrder":
            if joints or frames:
                raise FormatError(path, "a motion must have one JointOrder, before its frames")
            joints = [joint.get("name", "") for joint in element.iter("Joint")]
        elif element.tag == "MotionFrame":
            frames.append(_frame(path, element, len(joints), len(frames)))
            element.clear()
    if len(set(joints)) != len(joints) or not all(joints):
        raise FormatError(path, "joint names in the JointOrder must be unique and not empty")
    if not joints or not frames:
        raise FormatError(path, "not an MMM motion: expected a Motion with JointOrder and MotionFrames")
    rows = np.array(frames)
    # the file's angles are roll, pitch and yaw, R = Rz Ry Rx
    (x, y, z), (roll, pitch, yaw) = rows[:, 1:4].T * 0.001, rows[:, 4:7].T
    values = np.column_stack([-x, z, y, -roll, yaw, pitch, rows[:, 7:]])
    names = ("root.tx", "root.ty", "root.tz", "root.rx", "root.ry", "root.rz", *joints)
    steps = np.diff(rows[:, 0])
    if not len(steps):
        raise FormatError(path, "cannot tell the frame rate from a single frame")
    uneven = np.flatnonzero(np.abs(steps - steps.mean()) > 0.5 * abs(steps.mean()))
    if steps.mean() <= 0 or len(uneven):
        raise FormatError(path, f"frame {uneven[0] + 1 if len(uneven) else 1}: the time steps are uneven")
    fps = frame_rate(round(float(1 / steps.mean()), 3), path)
    return Motion(values, names, ("m",) * 3 + ("rad",) * (3 + len(joints)), fps)


def motion_name(file: File) -> str:
    """The name of the first motion, in KIT's files the performer's; empty if it has none."""
    return next((element.get("name", "") for element in _elements(file, "start") if element.tag == "Motion"), "")


def _elements(file: File, event: Literal["start", "end"] = "end") -> Iterator[ElementTree.Element]:
    """The elements up to the end of the first motion, in order; nothing after it is read."""
    path, content = place_of(file), read_bytes(file)
    parser: ElementTree.XMLPullParser[Any] = ElementTree.XMLPullParser([event])
    size = 2**20  # bytes per call: the parser restarts on a longer token, so few large pieces are fast
    try:
        for start in range(0, len(content), size):
            parser.feed(content[start : start + size])
            events: Iterator[Any] = parser.read_events()
            for _, element in events:
                yield element
                if element.tag == "Motion":
                    return
        parser.close()
    except ElementTree.ParseError as error:
        raise FormatError(path, f"not XML, or truncated: {error.msg.split(':')[0]}", error.position[0]) from error
    except (LookupError, ValueError) as error:  # an encoding unknown to Python or its XML parser
        raise FormatError(path, f"unknown encoding: {error}", 1) from error


def _frame(path: Path, element: ElementTree.Element, joints: int, number: int) -> list[float]:
    """Time step, root position and rotation, and the joints' angles of one frame."""
    found: list[float] = []
    for tag, count in {"Timestep": 1, "RootPosition": 3, "RootRotation": 3, "JointPosition": joints}.items():
        words = (element.findtext(tag) or "").split()
        if len(words) != count:
            raise FormatError(path, f"frame {number}: {tag} needs {count} values, not {len(words)}")
        try:
            found += numbers(words, path, None)
        except FormatError as error:
            raise FormatError(path, f"frame {number}: {tag}: {error.reason}") from error
    return found
