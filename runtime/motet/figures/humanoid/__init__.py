"""Any human figure to the humanoid and back: joint maps, rest poses, retargeting.

Two doors: :func:`to_humanoid` and :func:`from_humanoid`, with a :class:`Figure` measured once for more than one motion.
"""

from motet.figures.humanoid.bones import (
    ARM,
    BONES,
    FINGERS,
    HUMANOID,
    LEFT_RIGHT,
    LEG,
    MIXAMO,
    NECK,
    REQUIRED,
    RIGS,
    SOLE,
    SPINE,
    T_POSE,
    ground_under,
    is_mmm,
    leg_length,
    limb_of,
    rig,
    sided,
    sole_points,
    with_figure,
)
from motet.figures.humanoid.joint_map import JointMap, check_map, read_map
from motet.figures.humanoid.joint_tree import map_of
from motet.figures.humanoid.measure import LENGTH_UNITS, unit_by_legs
from motet.figures.humanoid.retarget import (
    SURE_OF_JOINTS,
    Figure,
    Humanoid,
    from_humanoid,
    grounded,
    on_humanoid,
    relaxed,
    to_humanoid,
)

__all__ = [
    "ARM",
    "BONES",
    "FINGERS",
    "HUMANOID",
    "LEFT_RIGHT",
    "LEG",
    "LENGTH_UNITS",
    "MIXAMO",
    "NECK",
    "REQUIRED",
    "RIGS",
    "SOLE",
    "SPINE",
    "SURE_OF_JOINTS",
    "T_POSE",
    "Figure",
    "Humanoid",
    "JointMap",
    "check_map",
    "from_humanoid",
    "ground_under",
    "grounded",
    "is_mmm",
    "leg_length",
    "limb_of",
    "map_of",
    "on_humanoid",
    "read_map",
    "relaxed",
    "rig",
    "sided",
    "sole_points",
    "to_humanoid",
    "unit_by_legs",
    "with_figure",
]
