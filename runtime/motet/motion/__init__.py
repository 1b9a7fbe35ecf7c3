"""Geometry: motions, skeletons, rotations, and what is done to them without a model."""

from motet.motion.feet import feet_of, ground_of, has_feet
from motet.motion.heading import heading, without_heading
from motet.motion.kinematics import global_transforms, local_rotations, local_translations, positions
from motet.motion.mirror import lateral_axis, mirror
from motet.motion.motion import UNITS, Motion
from motet.motion.root_path import lay_root_path
from motet.motion.sides import partners_of, sides_of
from motet.motion.skeleton import Joint, Skeleton

__all__ = [
    "UNITS",
    "Joint",
    "Motion",
    "Skeleton",
    "feet_of",
    "global_transforms",
    "ground_of",
    "has_feet",
    "heading",
    "lateral_axis",
    "lay_root_path",
    "local_rotations",
    "local_translations",
    "mirror",
    "partners_of",
    "positions",
    "sides_of",
    "without_heading",
]
