"""The skeleton: a tree of joints with offsets, each joint's rotation convention and side, and the unit of lengths."""

import math
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from operator import index
from typing import Any

import numpy as np

from motet.errors import MotionError, UnitError
from motet.motion.rotations import Array, Indices, euler_to_rotmat

END_SUFFIX = "_end"

Triple = tuple[float, float, float]
"""x, y and z."""

Names = tuple[str, ...]
"""Names of joints or channels, or units of channels, in their order."""

METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "inch": 0.0254}
"""Name of a unit of length -> its metres."""

LEFT = "left"
MIDDLE = "middle"
RIGHT = "right"


@dataclass(frozen=True)
class Joint:
    """One joint, with the bone that leads to it.

    offset: (x, y, z) from the parent joint at rest, in the skeleton's length unit; y points up.
    order: the Euler order of its rotation, see :mod:`motet.motion.rotations`; a channel that a motion lacks counts as
    0.
    axis: Euler angles of order "zyx" in degrees, given as (x, y, z): the frame its rotation is expressed in (the
        ``axis`` of an ASF file). The local rotation is C M C^T with C from ``axis`` and M from the channels.
    """

    name: str
    parent: int
    offset: Triple
    order: str = "zyx"
    axis: Triple = (0.0, 0.0, 0.0)

    @cached_property
    def frame(self) -> Array:
        """C, the rotation matrix (3, 3) of ``axis``."""
        return euler_to_rotmat(np.radians(self.axis[::-1]), "zyx")


@dataclass(frozen=True, repr=False)
class Skeleton:
    """Joints, parents before children; the first is the root.

    A joint whose name ends in ``_end`` marks the tip of its parent's last bone and has no channels.
    metres_per_unit: metres per unit of the offsets, or None if the file does not state it.
    """

    joints: tuple[Joint, ...]
    metres_per_unit: float | None = None

    def __post_init__(self) -> None:
        if not self.joints:
            raise MotionError("a skeleton needs at least one joint")
        if self.metres_per_unit is not None and not 0 < self.metres_per_unit < np.inf:
            raise MotionError(f"a length unit must be a positive number of metres, not {self.metres_per_unit}")
        double = repeated(joint.name for joint in self.joints)
        if double:
            raise MotionError(f"joint names must be unique; repeated: {', '.join(double)}")
        if not np.isfinite([[*joint.offset, *joint.axis] for joint in self.joints]).all():
            raise MotionError("offsets and axes of joints must be finite")
        for i, joint in enumerate(self.joints):
            if not (joint.parent == -1 if i == 0 else 0 <= joint.parent < i):
                raise MotionError(f"joint {joint.name!r} must come after its parent, and only the first has none")
            if sorted(joint.order) != ["x", "y", "z"]:
                raise MotionError(f"joint {joint.name!r}: {joint.order!r} is not an Euler order of three axes")

    def __repr__(self) -> str:
        unit = "unit unknown" if self.metres_per_unit is None else f"unit {self.metres_per_unit:g} m"
        return f"Skeleton({len(self.joints)} joints, root {self.joints[0].name!r}, {unit})"

    @cached_property
    def names(self) -> Names:
        """The joints' names, in order."""
        return tuple(joint.name for joint in self.joints)

    @cached_property
    def places(self) -> dict[str, int]:
        """The joints' indices by name."""
        return {name: i for i, name in enumerate(self.names)}

    @cached_property
    def offsets(self) -> Array:
        """The joints' offsets (J, 3)."""
        return np.array([joint.offset for joint in self.joints], dtype=np.float64)

    @cached_property
    def children(self) -> tuple[tuple[int, ...], ...]:
        """For each joint the indices of its children."""
        children: list[list[int]] = [[] for _ in self.joints]
        for i, joint in enumerate(self.joints[1:], start=1):
            children[joint.parent].append(i)
        return tuple(map(tuple, children))

    @cached_property
    def levels(self) -> tuple[Indices, ...]:
        """Indices of the joints by their number of ancestors, without the root."""
        depth = np.zeros(len(self.joints), dtype=np.intp)
        for i, joint in enumerate(self.joints[1:], start=1):
            depth[i] = depth[joint.parent] + 1
        return tuple(np.flatnonzero(depth == level) for level in range(1, depth.max() + 1))

    @cached_property
    def parents(self) -> Indices:
        """For each joint the index of its parent, -1 for the root."""
        return np.array([joint.parent for joint in self.joints], dtype=np.intp)

    @cached_property
    def rest_positions(self) -> Array:
        """Positions of the joints (J, 3) with every angle 0 and the root at the origin."""
        positions = np.zeros((len(self.joints), 3))
        for i, joint in enumerate(self.joints[1:], start=1):
            positions[i] = positions[joint.parent] + joint.offset
        return positions

    @cached_property
    def height(self) -> float:
        """The largest extent of the rest pose along x, y or z, in the skeleton's length unit."""
        return float(np.ptp(self.rest_positions, axis=0).max())

    def index(self, name: str) -> int:
        """Index of the joint called ``name``; MotionError if there is none."""
        if name not in self.places:
            raise MotionError(f"the skeleton has no joint {name!r}; it has {', '.join(self.names)}")
        return self.places[name]

    def below(self, joint: int) -> list[int]:
        """Indices of a joint and all that hangs on it, in order."""
        joints = [joint]
        for i in joints:
            joints.extend(self.children[i])
        return sorted(joints)

    def ancestors(self, joint: int) -> list[int]:
        """Indices of a joint and all that it hangs on, upwards to the root."""
        chain = [joint]
        while chain[-1]:
            chain.append(self.joints[chain[-1]].parent)
        return chain

    def scaled(self, metres_per_unit: float) -> "Skeleton":
        """The same skeleton in another length unit; MotionError if its own unit is not known."""
        factor = self.unit_factor(metres_per_unit)
        return replace(self.with_offsets(self.offsets * factor), metres_per_unit=metres_per_unit)

    def with_offsets(self, offsets: Array) -> "Skeleton":
        """The same skeleton with other offsets (J, 3)."""
        joints = []
        for joint, offset in zip(self.joints, offsets.tolist(), strict=True):
            joints.append(replace(joint, offset=tuple(offset)))
        return replace(self, joints=tuple(joints))

    def is_like(self, other: "Skeleton", tolerance: float, first: int = 0) -> bool:
        """Whether another skeleton has the same joints and unit, and from the ``first`` joint on offsets that differ by
        no more than a share of its height."""
        if len(self.joints) != len(other.joints) or self.with_offsets(other.offsets) != other:
            return False
        differences = np.abs(self.offsets - other.offsets)[first:]
        return bool(differences.max(initial=0.0) <= tolerance * other.height)

    def unit_factor(self, metres_per_unit: float) -> float:
        """The factor from this skeleton's unit to the other unit."""
        if self.metres_per_unit is None:
            raise UnitError("the length unit of this skeleton is unknown: set it, as in motion.with_unit(0.01)")
        return self.metres_per_unit / metres_per_unit

    def to_json(self) -> dict[str, Any]:
        """A JSON object that :meth:`from_json` reads back without loss."""
        joints = self.outline()
        for row, joint in zip(joints, self.joints, strict=True):
            row |= {"order": joint.order, "axis": list(joint.axis)}
        return {"metres_per_unit": self.metres_per_unit, "joints": joints}

    def outline(self) -> list[dict[str, Any]]:
        """Of each joint its name, its parent's index, -1 for none, and its offset, for JSON."""
        return [{"name": joint.name, "parent": joint.parent, "offset": list(joint.offset)} for joint in self.joints]

    @staticmethod
    def from_json(data: Mapping[str, Any]) -> "Skeleton":
        """The inverse of :meth:`to_json`; MotionError if it is not a skeleton."""
        try:
            joints = []
            for row in data["joints"]:
                offset = _triple(row["offset"])
                joints.append(
                    Joint(str(row["name"]), index(row["parent"]), offset, str(row["order"]), _triple(row["axis"]))
                )
            metres = data["metres_per_unit"]
            return Skeleton(tuple(joints), None if metres is None else float(metres))
        except (KeyError, TypeError, ValueError) as error:
            raise MotionError(f"not a skeleton: {error}") from error


def _triple(values: Iterable[float]) -> Triple:
    x, y, z = map(float, values)
    return x, y, z


def repeated(names: Iterable[str]) -> list[str]:
    """The names that are there more than once, in alphabetical order."""
    return sorted(name for name, count in Counter(names).items() if count > 1)


def metres(unit: str | float) -> float:
    """Metres of a unit of length: one of :data:`METRES`, or a number of metres; MotionError for anything else."""
    value = METRES.get(unit, math.nan) if isinstance(unit, str) else float(unit)
    if not (math.isfinite(value) and value > 0):
        raise MotionError(f"expected a length unit ({', '.join(METRES)}) or a number of metres, not {unit!r}")
    return value


def partners_of(names: Sequence[str]) -> tuple[int, ...]:
    """For each name the index of its partner on the other side, or its own if there is none."""
    return tuple(partner for partner, _ in _partners(tuple(names)))


def sides_of(names: Sequence[str]) -> Names:
    """:data:`LEFT`, :data:`RIGHT` or :data:`MIDDLE` for each name; one without a partner is in the middle."""
    return tuple(side for _, side in _partners(tuple(names)))


@lru_cache(maxsize=16)
def _partners(names: Names) -> tuple[tuple[int, str], ...]:
    """For each name the index of its partner and the side that it is on itself."""
    places = {name: place for place, name in enumerate(names)}
    return tuple(_partner(place, name, places) for place, name in enumerate(names))


SIDE_PATTERNS = (
    r"left|Left|LEFT|right|Right|RIGHT",  # LeftArm, arm_left, mixamorig:RightHand
    r"(?<![A-Za-z])[lLrR](?![A-Za-z])",  # L_Arm, arm.R, "Bip01 L Thigh"
    r"^[lr](?=[A-Za-z])|^[LR](?=[A-Z])",  # lfemur, RThigh
    r"(?<=[a-z])[LR]$",  # armL
)
"""Patterns of the words for sides in names of joints, the clearest first."""

SIDE_WORDS = (
    ("l", "r"),
    ("L", "R"),
    ("left", "right"),
    ("Left", "Right"),
    ("LEFT", "RIGHT"),
)
"""Words for the left and for the right."""

OTHER_SIDE = dict(SIDE_WORDS) | {right: left for left, right in SIDE_WORDS}
"""For each word for a side the word for the other."""


def _partner(place: int, name: str, places: Mapping[str, int]) -> tuple[int, str]:
    """The index of a name's partner and the side of the name itself; its own index and the middle if there is none."""
    for pattern in SIDE_PATTERNS:
        for match in re.finditer(pattern, name):
            swapped = name[: match.start()] + OTHER_SIDE[match[0]] + name[match.end() :]
            if swapped in places:
                return places[swapped], LEFT if match[0][0] in "lL" else RIGHT
    return place, MIDDLE
