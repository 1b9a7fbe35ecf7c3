"""Geometry: motions, skeletons, rotations, and operations on them that need no model."""

from typing import TYPE_CHECKING

from motet.lazy import lazily

if TYPE_CHECKING:
    from motet.figures.feet.contacts import feet_of, ground_of, has_feet, lay_root_path
    from motet.figures.feet.hold import hold_feet
    from motet.figures.feet.treadmill import is_in_place, with_travel
    from motet.figures.humanoid import HUMANOID, MIXAMO, Humanoid, JointMap, from_humanoid, read_map, rig, to_humanoid
    from motet.figures.root_motion import in_place
    from motet.motion.kinematics import (
        global_transforms,
        heading,
        local_rotations,
        local_translations,
        positions,
        without_heading,
    )
    from motet.motion.looping import looped
    from motet.motion.mirroring import lateral_axis, mirror
    from motet.motion.motion import UNITS, Motion
    from motet.motion.skeleton import Joint, Skeleton, partners_of, sides_of

__all__ = [
    "HUMANOID",
    "MIXAMO",
    "UNITS",
    "Humanoid",
    "Joint",
    "JointMap",
    "Motion",
    "Skeleton",
    "feet_of",
    "from_humanoid",
    "global_transforms",
    "ground_of",
    "has_feet",
    "heading",
    "hold_feet",
    "in_place",
    "is_in_place",
    "lateral_axis",
    "lay_root_path",
    "local_rotations",
    "local_translations",
    "looped",
    "mirror",
    "partners_of",
    "positions",
    "read_map",
    "rig",
    "sides_of",
    "to_humanoid",
    "with_travel",
    "without_heading",
]

_PLACES = {
    "motet.figures.feet.contacts": "feet_of ground_of has_feet lay_root_path",
    "motet.figures.feet.hold": "hold_feet",
    "motet.figures.feet.treadmill": "is_in_place with_travel",
    "motet.figures.humanoid": "HUMANOID MIXAMO Humanoid JointMap from_humanoid read_map rig to_humanoid",
    "motet.figures.root_motion": "in_place",
    "motet.motion.kinematics": "global_transforms heading local_rotations local_translations positions without_heading",
    "motet.motion.looping": "looped",
    "motet.motion.mirroring": "lateral_axis mirror",
    "motet.motion.motion": "UNITS Motion",
    "motet.motion.skeleton": "Joint Skeleton partners_of sides_of",
}
"""Module -> the public names that it has, each imported when it is first used."""

if not TYPE_CHECKING:
    __getattr__ = lazily(__name__, _PLACES)

    def __dir__() -> list[str]:
        return sorted({*globals(), *__all__})
