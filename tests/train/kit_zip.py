"""Zips in the format of the KIT Motion-Language data, of any size, with made-up motions."""

import json
import zipfile
from functools import cache
from pathlib import Path

import numpy as np

PARTS = {
    "B": ("LN", "P", "T", "UN"),
    "L": ("A", "E", "H", "K", "S", "W", "F", "M"),
    "R": ("A", "E", "H", "K", "S", "W", "F", "M"),
}
AXES = {"E": ("x", "z"), "K": ("x",), "W": ("x", "y"), "F": ("x",), "M": ("rot",)}
JOINTS = tuple(
    f"{side}{part}{axis}_joint" for side, parts in PARTS.items() for part in parts for axis in AXES.get(part, "xyz")
)
KINDS = (("walks slowly", 0.8), ("walks", 1.0), ("runs", 1.6), ("runs fast", 2.0))
DIRECTIONS = ("forward", "to the left", "to the right")


def write_kit_zip(path: Path, motions: int, seconds: tuple[float, float] = (1.0, 3.0), sentences: int = 2) -> Path:
    """Write ``motions`` motions at 100 Hz, of which the first and the last length are given, from two dozen different
    ones; each has ``sentences`` sentences that say how fast and which way."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for number in range(1, motions + 1):
            which = number % 24
            length = seconds[0] + (seconds[1] - seconds[0]) * which / 23
            text = f"A person {KINDS[which % 4][0]} {DIRECTIONS[which % 3]}."
            texts = [text, text.replace("A person", "Someone"), text.replace("A person", "The subject")]
            archive.writestr(f"{number:05}_annotations.json", json.dumps(texts[:sentences]))
            archive.writestr(f"{number:05}_meta.json", json.dumps({"nb_annotations": sentences}))
            archive.writestr(f"{number:05}_mmm.xml", mmm_xml(round(100 * length), which))
    return path


@cache
def mmm_xml(frames: int, which: int = 0, joints: tuple[str, ...] = JOINTS) -> str:
    """The text of an MMM file: joints that swing as fast as KINDS says, and a root that goes DIRECTIONS."""
    time = np.arange(frames) / 100
    phases = 7.0 * np.array([JOINTS.index(joint) for joint in joints])
    angles = 0.5 * np.sin(2 * np.pi * KINDS[which % 4][1] * time[:, None] + phases) + 0.01 * which
    order = "".join(f"<Joint name='{joint}'/>" for joint in joints)
    zeros = " ".join(["0"] * len(joints))
    body = "\n".join(
        f"<MotionFrame><Timestep>{t:g}</Timestep><RootPosition>{10 * t:g} {1000 * t:g} 970</RootPosition>"
        f"<RootRotation>0 0 {(0, 0.5, -0.5)[which % 3] * t:g}</RootRotation>"
        f"<JointPosition>{' '.join(f'{a:.6g}' for a in row)} </JointPosition>"
        f"<JointVelocity>{zeros} </JointVelocity><JointAcceleration>{zeros} </JointAcceleration></MotionFrame>"
        for t, row in zip(time.tolist(), angles.tolist(), strict=True)
    )
    return (
        f"<?xml version='1.0'?>\n<MMM>\n<Motion name='subject_id_{which % 5}'>\n<JointOrder>{order}</JointOrder>\n"
        f"<MotionFrames>\n{body}\n</MotionFrames>\n</Motion>\n</MMM>\n"
    )
