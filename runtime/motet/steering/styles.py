"""The styles in which a steered figure goes and stands, such as "limping": ``styles.json``, made once by
``motet_train.recipes.styles`` of acts by key poses.

A style has a pose, or two between which it goes to and fro; each has :data:`STYLE_WIDTH` numbers.
"""

import json
from importlib.resources import files
from typing import Any

import numpy as np

from motet.errors import ControlError
from motet.figures.humanoid import ARM, LEFT_RIGHT, SPINE, limb_of
from motet.motion.rotations import Array

TURNED = ("hips", *SPINE, "neck", "head", "leftShoulder", "rightShoulder")
"""Bones that a style turns, beyond what is played."""

ARMS = (*limb_of("left", ARM[1:]), *limb_of("right", ARM[1:]))
"""Bones whose rotations in their parents' frames a style gives."""

TURNS = slice(0, 4 * len(TURNED))
"""Columns of a pose: quaternions of :data:`TURNED`, from what is played; of the hips seen from the facing."""

ARM_TURNS = slice(TURNS.stop, TURNS.stop + 4 * len(ARMS))
"""Quaternions of :data:`ARMS`; zeros of an arm that is as it is played."""

FOOT_TURNS = slice(ARM_TURNS.stop, ARM_TURNS.stop + 4 * len(LEFT_RIGHT))
"""Quaternions of the feet, from what is played, seen from the facing."""

FOOT_OFFSETS = slice(FOOT_TURNS.stop, FOOT_TURNS.stop + 3 * len(LEFT_RIGHT))
"""Metres by which the ankles are moved to the left, up and forward."""

HIPS_LOWER = FOOT_OFFSETS.stop
"""Metres by which the hips are lower."""

STYLE_WIDTH = HIPS_LOWER + 1

STEPS_OF_STYLE = 1000
"""In a unit of each number in the file."""

STYLES: dict[str, Any] = json.loads((files("motet.steering") / "styles.json").read_text(encoding="utf-8"))
"""The file: of each style by its name its pace, a share of a gait's usual speed, the
seconds in which it goes from the first pose to the second and back, 0 where it goes with the steps, and its poses, one
or two. Of one that goes with the steps the second is taken as the left foot stands, the first as the right one does."""

NO_STYLE = "none"
"""The name of going as recorded."""

STYLE_NAMES = (NO_STYLE, *STYLES)
"""The names by their numbers in a session."""

FIRST_POSES = [style["poses"][0] for style in STYLES.values()]
LAST_POSES = [style["poses"][-1] for style in STYLES.values()]
NO_POSE = np.zeros((1, 2, STYLE_WIDTH))

POSES: Array = np.concatenate([NO_POSE, np.stack([FIRST_POSES, LAST_POSES], axis=1)]) / STEPS_OF_STYLE
"""(S, 2, STYLE_WIDTH) the poses by the numbers of styles."""

PACES = np.array([1.0, *(style["pace"] for style in STYLES.values())])
"""(S,) by the numbers of styles."""

SECONDS = np.array([0.0, *(style["seconds"] for style in STYLES.values())])
"""(S,) by the numbers of styles."""


def style_number(name: str) -> int:
    """The number of a style; ControlError for an unknown one."""
    if name not in STYLE_NAMES:
        raise ControlError(f"unknown style {name!r:.60}; expected one of {', '.join(STYLE_NAMES)}")
    return STYLE_NAMES.index(name)
