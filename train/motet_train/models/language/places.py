"""Where the joints are, seen from the root: what frames of joint angles look like, whoever moves.

Angles of one pose differ from person to person by how its skeleton was fitted; places differ less, so that nets which
compare motions see both.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from motet.motion.kinematics import AXES
from motet.motion.skeleton import Skeleton
from motet.representation.contract import MotionContract

TILT = ("root.roll", "root.pitch")
"""How the root is turned but for its heading: its angles about z and x of the order "yxz"."""


@dataclass(frozen=True)
class Figure:
    """The tree of J joints, and where in D channels their angles are.

    parents: index of each joint's parent, -1 for the root. offsets: (x, y, z) from the parent in metres. orders: of the
    Euler angles, "zyx" for Rz Ry Rx. columns: the channels of the angles about x, y and z in degrees, D where there is
    none and the angle is 0.
    """

    parents: tuple[int, ...] = ()
    offsets: tuple[tuple[float, ...], ...] = ()
    orders: tuple[str, ...] = ()
    columns: tuple[tuple[int, ...], ...] = ()


def figure_of(contract: MotionContract) -> Figure:
    """The figure that frames in Euler angles move; one without joints where the contract has no such frames."""
    skeleton = contract.skeleton
    if contract.representation != "root_angles" or skeleton is None or any(any(j.axis) for j in skeleton.joints):
        return Figure()
    at = {channel: column for column, channel in enumerate(contract.channels)}
    names = [[f"{joint.name}.r{axis}" for axis in AXES] for joint in skeleton.joints]
    names[0] = [TILT[1], "", TILT[0]]
    columns = tuple(tuple(at.get(name, len(at)) for name in row) for row in names)
    return Figure(
        tuple(joint.parent for joint in skeleton.joints),
        tuple(tuple(offset) for offset in _metres(skeleton)),
        ("yxz", *(joint.order for joint in skeleton.joints[1:])),
        columns,
    )


def _metres(skeleton: Skeleton) -> Sequence[tuple[float, float, float]]:
    return [joint.offset for joint in (skeleton.scaled(1.0) if skeleton.metres_per_unit else skeleton).joints]


class Places(nn.Module):
    """Forward kinematics of a figure."""

    columns: Tensor
    offsets: Tensor
    orders: Tensor

    def __init__(self, figure: Figure) -> None:
        super().__init__()
        self.parents = figure.parents
        orders = [[AXES.index(axis) for axis in order] for order in figure.orders]
        for name, values in (("columns", figure.columns), ("orders", orders), ("offsets", figure.offsets)):
            self.register_buffer(name, torch.tensor(values), persistent=False)

    def forward(self, frames: Tensor) -> Tensor:
        """Frames (B, T, D), angles in degrees, to places (B, T, 3 J) in metres from the root, the heading taken out."""
        angles = torch.cat([frames, torch.zeros_like(frames[..., :1])], dim=-1)[..., self.columns.flatten()]
        local = self._rotations(torch.deg2rad(angles).unflatten(-1, (-1, 3)))
        turned: list[Tensor] = [local[..., 0, :, :]]
        found: list[Tensor] = [torch.zeros_like(turned[0][..., 0])]
        for joint, parent in enumerate(self.parents[1:], start=1):
            found.append(found[parent] + turned[parent] @ self.offsets[joint])
            turned.append(turned[parent] @ local[..., joint, :, :])
        return torch.cat(found, dim=-1)

    def _rotations(self, angles: Tensor) -> Tensor:
        """Angles (..., J, 3) about x, y, z to the matrices (..., J, 3, 3) of their product in each joint's order."""
        cos, sin, one, none = angles.cos(), angles.sin(), torch.ones_like(angles), torch.zeros_like(angles)
        rows = []
        for axis in range(3):
            c, s, o, n = cos[..., axis], sin[..., axis], one[..., axis], none[..., axis]
            matrix = ([o, n, n, n, c, -s, n, s, c], [c, n, s, n, o, n, -s, n, c], [c, -s, n, s, c, n, n, n, o])[axis]
            rows.append(torch.stack(matrix, dim=-1))
        about = torch.stack(rows, dim=-2)  # (..., J, axis, 9)
        joints = torch.arange(len(self.parents), device=angles.device)
        first, second, third = (
            about[..., joints, self.orders[:, place], :].unflatten(-1, (3, 3)) for place in range(3)
        )
        return first @ second @ third
