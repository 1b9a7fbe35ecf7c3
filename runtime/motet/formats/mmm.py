"""MMM motion (Master Motor Map), the XML files of the KIT Motion-Language data. The skeleton is not in the file.

The first ``Motion`` is read: the angles of its ``JointOrder`` in radians, each channel named like the joint in the
file, and the root's pose. MMM has z up, millimetres, and figures facing y; here y is up, and they face z.
"""

from array import array
from collections.abc import Iterator
from typing import Any
from xml.etree import ElementTree

import numpy as np

from motet.files import File
from motet.formats.text import ContentError, frame_rate, names_file, numbers, read_bytes
from motet.motion.motion import Motion
from motet.motion.rotations import Array

MAX_NESTING = 64
MAX_ELEMENTS = 10**5
"""Elements inside each other, MMM has seven; and before a frame ends, of which JointOrder has one per joint."""

PIECE = 2**20
"""Bytes that are parsed at once: the parser restarts on a longer token, so few large pieces are fast."""

READ_ELEMENTS = frozenset({"JointOrder", "MotionFrame"})
"""Elements of which all is read, at their end."""


@names_file
def read(file: File) -> Motion:
    """Read the first motion of an MMM file, without skeleton.

    Channels: "root.tx" to "root.tz" in "m", "root.rx" to "root.rz" in "rad" with R = Ry Rz Rx, then one for each joint
    in "rad". The frame rate comes from the time steps. FormatError names the file and the line or frame at fault.
    """
    joints, rows = _joints_and_rows(file)
    # a motion has joints, each once, and frames
    if len(set(joints)) != len(joints) or not all(joints):
        raise ContentError("joint names in the JointOrder must be unique and not empty")
    if not joints or not len(rows):
        raise ContentError("not an MMM motion: expected a Motion with JointOrder and MotionFrames")
    # the file is in millimetres, z up, and its angles are roll, pitch and yaw, R = Rz Ry Rx
    x, y, z = rows[:, 1:4].T * 0.001
    roll, pitch, yaw = rows[:, 4:7].T
    values = np.column_stack([-x, z, y, -roll, yaw, pitch, rows[:, 7:]])
    names = ("root.tx", "root.ty", "root.tz", "root.rx", "root.ry", "root.rz", *joints)
    units = ("m",) * 3 + ("rad",) * (3 + len(joints))
    return Motion(values, names, units, _rate_of_times(rows[:, 0]))


def _joints_and_rows(file: File) -> tuple[list[str], Array]:
    """The joints of the JointOrder and, of each frame, the time, the root's pose and the angles (T, 7 + J)."""
    joints: list[str] = []
    values = array("d")  # frame after frame
    count = 0
    for event, element in _events(file):
        if event != "end":
            continue
        if element.tag == "Motion":  # the first one is read
            break
        if element.tag == "JointOrder":
            if joints or count:
                raise ContentError("a motion must have one JointOrder, before its frames")
            joints = [joint.get("name", "") for joint in element.iter("Joint")]
        elif element.tag == "MotionFrame":
            values.extend(_frame(element, len(joints), count))
            count += 1
    return joints, np.array(values).reshape(count, 7 + len(joints))


def _rate_of_times(times: Array) -> float:
    """The frame rate of times (T,) in seconds; FormatError where they are not evenly spaced."""
    # steps may differ from their mean by half of it
    steps = np.diff(times)
    if not len(steps):
        raise ContentError("cannot tell the frame rate from a single frame")
    uneven = np.flatnonzero(np.abs(steps - steps.mean()) > 0.5 * abs(steps.mean()))
    if steps.mean() <= 0 or len(uneven):
        raise ContentError(f"frame {uneven[0] + 1 if len(uneven) else 1}: the time steps are uneven")
    return frame_rate(round(float(1 / steps.mean()), 3))


@names_file
def motion_name(file: File) -> str:
    """The name of the first motion, in KIT's files the performer's; empty if it has none."""
    begun = (element for event, element in _events(file) if event == "start")
    return next((element.get("name", "") for element in begun if element.tag == "Motion"), "")


def _events(file: File) -> Iterator[tuple[str, ElementTree.Element]]:
    """("start", element) and ("end", element) in order, read piece by piece; of elements that are not KEPT, or within
    one of these, the content is dropped."""
    content = read_bytes(file)
    parser: ElementTree.XMLPullParser[Any] = ElementTree.XMLPullParser(["start", "end"])
    opened = _Opened()
    try:
        # what has been read is let go, piece by piece
        for start in range(0, len(content), PIECE):
            parser.feed(content[start : start + PIECE])
            events: Iterator[Any] = parser.read_events()
            for event, element in events:
                opened.follow(event, element)
                yield event, element
            opened.empty()
        parser.close()
    except ElementTree.ParseError as error:
        raise ContentError(f"not XML, or truncated: {error.msg.split(':')[0]}", error.position[0]) from error
    except (LookupError, ValueError) as error:  # an encoding unknown to Python or its XML parser
        raise ContentError(f"unknown encoding: {error}", 1) from error


class _Opened:
    """The elements that have begun and not ended."""

    def __init__(self) -> None:
        self._elements: list[ElementTree.Element] = []
        self._since = 0  # elements since one of KEPT ended

    def follow(self, event: str, element: ElementTree.Element) -> None:
        """Count an element that begins or ends; FormatError for too many inside each other, or before a frame ends."""
        if event == "end":
            self._elements.pop()
            self._since = 0 if element.tag in READ_ELEMENTS else self._since
            return
        self._elements.append(element)
        self._since += 1
        if len(self._elements) > MAX_NESTING:
            raise ContentError(f"over {MAX_NESTING} elements inside each other")
        if self._since > MAX_ELEMENTS:
            raise ContentError(f"over {MAX_ELEMENTS} elements before a frame")

    def empty(self) -> None:
        """Drop what is in them, of the outer ones."""
        for element in self._elements:
            if element.tag in READ_ELEMENTS:
                return
            del element[:]


def _frame(element: ElementTree.Element, joints: int, number: int) -> list[float]:
    """Time step, root position and rotation, and the joints' angles of one frame."""
    values = []
    for tag, count in {"Timestep": 1, "RootPosition": 3, "RootRotation": 3, "JointPosition": joints}.items():
        # each part of a frame has its number of values
        words = (element.findtext(tag) or "").split()
        if len(words) != count:
            raise ContentError(f"frame {number}: {tag} needs {count} values, not {len(words)}")
        try:
            values += numbers(words, None)
        except ContentError as error:
            raise ContentError(f"frame {number}: {tag}: {error}") from error
    return values
