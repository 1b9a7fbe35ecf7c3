"""Forward kinematics in torch, for losses and features: where the joints of a figure are.

Letters in shapes: B rows, T frames, D channels, J joints, K of them with rotations of their own.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from motet.motion.humanoid import LEFT_RIGHT, sided
from motet.motion.kinematics import AXES
from motet.motion.skeleton import END_SUFFIX
from motet.representation.contract import MotionContract
from motet.representation.root_block import ROOT_BLOCK, VECTOR_KINDS, joints_of
from motet.representation.root_sixd import SIXD_KINDS


def forward_kinematics(
    parents: Sequence[int], offsets: Tensor, root: tuple[Tensor, Tensor], local: Tensor, bones: Sequence[int]
) -> Tensor:
    """Places (..., J, 3) of joints, all those of one depth at once.

    parents: each joint's, before it; -1 for the root. offsets: (J, 3) from the parents. root: its place (..., 3) and
    rotation (..., 3, 3). local: rotations (..., K, 3, 3) of ``bones``; all other joints turn with their parents.
    """
    places, turned = [root[0]] * len(parents), [root[1]] * len(parents)
    at = {joint: row for row, joint in enumerate(bones)}
    level = [joint for joint, parent in enumerate(parents) if parent == 0]
    while level:
        above = torch.stack([turned[parents[joint]] for joint in level], dim=-3)
        moved = (above @ offsets[level][..., None])[..., 0]
        known = [joint for joint in level if joint in at]
        rows = [level.index(joint) for joint in known]
        new = above[..., rows, :, :] @ local[..., [at[joint] for joint in known], :, :]
        for row, joint in enumerate(level):
            places[joint], turned[joint] = places[parents[joint]] + moved[..., row, :], above[..., row, :, :]
        for row, joint in enumerate(known):
            turned[joint] = new[..., row, :, :]
        level = [joint for joint, parent in enumerate(parents) if parent in level]
    return torch.stack(places, dim=-2)


@dataclass(frozen=True)
class Tree:
    """The tree of J joints. parents: index of each joint's parent, -1 for the root. offsets: (x, y, z) from it, metres.

    bones: the joints that have axes in the frames, in the order of the frames' channels.
    """

    parents: tuple[int, ...] = ()
    offsets: tuple[tuple[float, ...], ...] = ()
    bones: tuple[int, ...] = ()


def tree_of(contract: MotionContract) -> Tree:
    """The tree that frames of ``root_sixd`` move."""
    assert contract.skeleton is not None
    assert contract.representation == "root_sixd"
    joints = contract.skeleton.scaled(1.0).joints
    bones = tuple(i for i, joint in enumerate(joints) if not joint.name.endswith(END_SUFFIX))
    return Tree(tuple(joint.parent for joint in joints), tuple(joint.offset for joint in joints), bones)


class SixdPlaces(nn.Module):
    """Places of the joints of a tree, seen from the facing."""

    offsets: Tensor

    def __init__(self, tree: Tree) -> None:
        super().__init__()
        self.register_buffer("offsets", torch.tensor(tree.offsets), persistent=False)
        self.bones, self.parents = tree.bones, tree.parents

    def forward(self, sixd: Tensor) -> Tensor:
        """Axes (..., 6 K) of the K bones to places (..., J, 3) in metres from the root, in the frame of the facing."""
        local = axes_to_rotmat(sixd.reshape(*sixd.shape[:-1], len(self.bones), len(SIXD_KINDS)))
        root = sixd.new_zeros(*local.shape[:-3], 3), local[..., 0, :, :]
        return forward_kinematics(self.parents, self.offsets, root, local, self.bones)


def axes_to_rotmat(axes: Tensor) -> Tensor:
    """Two axes (..., 6) to matrices (..., 3, 3), as :func:`motet.representation.root_sixd.sixd_to_rotmat`."""
    x = functional.normalize(axes[..., :3], dim=-1, eps=1e-6)
    y = axes[..., 3:]
    y = functional.normalize(y - (x * y).sum(-1, keepdim=True) * x, dim=-1, eps=1e-6)
    return torch.stack([x, y, torch.linalg.cross(x, y)], dim=-1)


class VectorPlaces(nn.Module):
    """Places of the joints of a contract in ``root_vectors``, in the world.

    The origin is on the ground below the root in the frame before the first.
    """

    offsets: Tensor

    def __init__(self, contract: MotionContract) -> None:
        super().__init__()
        assert contract.skeleton is not None
        skeleton = contract.skeleton.scaled(1.0)
        kept = [i for i, joint in enumerate(skeleton.joints) if not joint.name.endswith(END_SUFFIX)]
        self.parents = [kept.index(skeleton.joints[i].parent) if i else -1 for i in kept]
        self.register_buffer("offsets", torch.tensor([skeleton.joints[i].offset for i in kept]), persistent=False)
        channels, joints = list(contract.channels), joints_of(contract.channels)
        self.root = [channels.index(name) for name in ROOT_BLOCK]
        self.vectors = [channels.index(f"{joint}.{kind}") for joint in joints for kind in VECTOR_KINDS]
        names = [skeleton.names[i] for i in kept]
        self.bones = [names.index(joint) for joint in joints]
        self.fps = contract.fps

    def forward(self, frames: Tensor) -> Tensor:
        """Frames (B, T, D) in the contract's units to places (B, T, J, 3) in metres."""
        root = frames[..., self.root]
        facing = root[..., 2].cumsum(1) / self.fps
        before = facing - root[..., 2] / self.fps
        sin, cos = before.sin(), before.cos()
        x = (root[..., 0] * sin + root[..., 1] * cos).cumsum(1) / self.fps
        z = (root[..., 0] * cos - root[..., 1] * sin).cumsum(1) / self.fps
        turned = _turn(facing, 1) @ _turn(root[..., 4], 0) @ _turn(root[..., 5], 2)
        place = torch.stack([x, root[..., 3], z], dim=-1)
        local = rotvec_to_rotmat(frames[..., self.vectors].reshape(*frames.shape[:-1], -1, 3))
        return forward_kinematics(self.parents, self.offsets, (place, turned), local, self.bones)


def _turn(angle: Tensor, axis: int) -> Tensor:
    """Rotations (..., 3, 3) by angles (...) in radians about the axis 0, 1 or 2."""
    one, zero = torch.ones_like(angle), torch.zeros_like(angle)
    sin, cos = angle.sin(), angle.cos()
    rows = {
        0: (one, zero, zero, zero, cos, -sin, zero, sin, cos),
        1: (cos, zero, sin, zero, one, zero, -sin, zero, cos),
        2: (cos, -sin, zero, sin, cos, zero, zero, zero, one),
    }
    return torch.stack(rows[axis], dim=-1).reshape(*angle.shape, 3, 3)


def rotvec_to_rotmat(vectors: Tensor) -> Tensor:
    """Rotation vectors (..., 3) to matrices (..., 3, 3) by Rodrigues' formula, with gradients at 0."""
    squared = vectors.square().sum(-1, keepdim=True)[..., None] + 1e-12
    angle = squared.sqrt()
    x, y, z = vectors.unbind(-1)
    zero = torch.zeros_like(x)
    cross = torch.stack([zero, -z, y, z, zero, -x, -y, x, zero], dim=-1).reshape(*x.shape, 3, 3)
    eye = torch.eye(3, dtype=vectors.dtype, device=vectors.device)
    return eye + angle.sin() / angle * cross + (1 - angle.cos()) / squared * (cross @ cross)


@dataclass(frozen=True)
class Figure:
    """The tree of J joints, and where in D channels their Euler angles are.

    parents: index of each joint's parent, -1 for the root. offsets: (x, y, z) from the parent in metres. orders: of the
    angles, "zyx" for Rz Ry Rx. columns: the channels of these angles, in degrees, in that order; D where there is none
    and the angle is 0. root: the channels of the root block.
    """

    parents: tuple[int, ...] = ()
    offsets: tuple[tuple[float, ...], ...] = ()
    orders: tuple[str, ...] = ()
    columns: tuple[tuple[int, ...], ...] = ()
    root: tuple[int, ...] = ()


def figure_of(contract: MotionContract) -> Figure:
    """The figure that frames of ``root_angles`` move, without the tips of its bones; one without joints for other
    contracts, or where lengths are unknown."""
    skeleton = contract.skeleton
    if contract.representation != "root_angles" or skeleton is None or skeleton.metres_per_unit is None:
        return Figure()
    joints = [joint for joint in skeleton.scaled(1.0).joints if not joint.name.endswith(END_SUFFIX)]
    if any(any(joint.axis) for joint in joints):
        return Figure()
    names = [joint.name for joint in joints]
    orders = ("yxz", *(joint.order for joint in joints[1:]))
    channels = [[f"{name}.r{axis}" for axis in order] for name, order in zip(names, orders, strict=True)]
    channels[0] = ["", "root.pitch", "root.roll"]  # the heading about y is left out
    at = {channel: column for column, channel in enumerate(contract.channels)}
    return Figure(
        tuple(names.index(skeleton.names[joint.parent]) if joint.parent >= 0 else -1 for joint in joints),
        tuple(joint.offset for joint in joints),
        orders,
        tuple(tuple(at.get(channel, len(at)) for channel in row) for row in channels),
        tuple(at[channel] for channel in ROOT_BLOCK),
    )


class EulerPlaces(nn.Module):
    """Places of the joints of a figure, seen from the root.

    The angles of one pose differ between people by how their skeletons were fitted; places differ less.
    """

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


def joint_weights(contract: MotionContract, parts: tuple[str, ...], times: float) -> Tensor:
    """How much each joint counts in a loss (J,), mean 1: those of some parts of both sides so many times the others."""
    assert contract.skeleton is not None
    counted = tuple(sided(side, part) for side in LEFT_RIGHT for part in parts)
    found = np.array([times if name.startswith(counted) else 1.0 for name in contract.skeleton.names])
    return torch.from_numpy(found / found.mean()).float()
