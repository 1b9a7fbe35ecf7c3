"""Where the joints are, seen from the root: what frames of joint angles look like, whoever moves.

Angles of one pose differ from person to person by how its skeleton was fitted; places differ less, so that nets which
compare motions see both.
"""

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from motet.motion.kinematics import AXES
from motet.motion.skeleton import END_SUFFIX
from motet.representation.contract import MotionContract
from motet.representation.root_block import ROOT_BLOCK

ROOT_ORDER = "yxz"
TILT = {"x": "root.pitch", "z": "root.roll"}
"""The root's angles of that order, but for the heading about y."""


@dataclass(frozen=True)
class Figure:
    """The tree of J joints, and where in D channels their angles are.

    parents: index of each joint's parent, -1 for the root. offsets: (x, y, z) from the parent in metres. orders: of the
    Euler angles, "zyx" for Rz Ry Rx. columns: the channels of these angles, in degrees, in that order; D where there is
    none and the angle is 0. root: the channels of the root block.
    """

    parents: tuple[int, ...] = ()
    offsets: tuple[tuple[float, ...], ...] = ()
    orders: tuple[str, ...] = ()
    columns: tuple[tuple[int, ...], ...] = ()
    root: tuple[int, ...] = ()


def figure_of(contract: MotionContract) -> Figure:
    """The figure that frames of Euler angles move, without the tips of its bones.

    One without joints where the contract has no such frames, or says nothing of lengths.
    """
    skeleton = contract.skeleton
    if contract.representation != "root_angles" or skeleton is None or skeleton.metres_per_unit is None:
        return Figure()
    joints = [joint for joint in skeleton.scaled(1.0).joints if not joint.name.endswith(END_SUFFIX)]
    if any(any(joint.axis) for joint in joints):
        return Figure()
    names = [joint.name for joint in joints]
    orders = (ROOT_ORDER, *(joint.order for joint in joints[1:]))
    channels = [[f"{name}.r{axis}" for axis in order] for name, order in zip(names, orders, strict=True)]
    channels[0] = [TILT.get(axis, "") for axis in ROOT_ORDER]
    at = {channel: column for column, channel in enumerate(contract.channels)}
    return Figure(
        tuple(names.index(skeleton.names[joint.parent]) if joint.parent >= 0 else -1 for joint in joints),
        tuple(joint.offset for joint in joints),
        orders,
        tuple(tuple(at.get(channel, len(at)) for channel in row) for row in channels),
        tuple(at[channel] for channel in ROOT_BLOCK),
    )


class Places(nn.Module):
    """Forward kinematics of a figure."""

    columns: Tensor
    offsets: Tensor
    unit: Tensor
    along: Tensor
    across: Tensor

    def __init__(self, figure: Figure) -> None:
        super().__init__()
        self.parents = figure.parents
        axes = torch.eye(3)[torch.tensor([[AXES.index(axis) for axis in order] for order in figure.orders])]
        crosses = torch.linalg.cross(torch.eye(3).expand(*axes.shape[:2], 3, 3), axes[..., None, :], dim=-1)
        self.register_buffer("unit", torch.eye(3), persistent=False)
        self.register_buffer("columns", torch.tensor(figure.columns), persistent=False)
        self.register_buffer("offsets", torch.tensor(figure.offsets), persistent=False)
        self.register_buffer("along", axes[..., None] * axes[..., None, :], persistent=False)
        self.register_buffer("across", crosses, persistent=False)

    def forward(self, frames: Tensor) -> Tensor:
        """Frames (B, T, D), angles in degrees, to places (B, T, 3 (J - 1)) in metres from the root of the others."""
        padded = torch.cat([frames, torch.zeros_like(frames[..., :1])], dim=-1)
        angles = torch.deg2rad(padded[..., self.columns])[..., None, None]
        first, second, third = (self._about(place, angles[..., place, :, :]) for place in range(3))
        local = first @ second @ third
        turned, found = {0: local[..., 0, :, :]}, [torch.zeros_like(frames[..., :3])]
        for joint, parent in enumerate(self.parents[1:], start=1):
            found.append(found[parent] + turned[parent] @ self.offsets[joint])
            if joint in self.parents:
                turned[joint] = turned[parent] @ local[..., joint, :, :]
        return torch.cat(found[1:], dim=-1)

    def _about(self, place: int, angles: Tensor) -> Tensor:
        """Rotations (..., J, 3, 3) by angles (..., J, 1, 1) about the axis at a place in each joint's order."""
        along = self.along[:, place]
        return along + angles.cos() * (self.unit - along) + angles.sin() * self.across[:, place]
