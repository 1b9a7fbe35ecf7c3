"""Forward kinematics of frames of ``root_vectors``, for losses: where joints are in the world that a seed ends in.

Letters in shapes: B rows, T frames, C channels, J joints, K of them with exponential maps.
"""

import torch
from torch import Tensor, nn

from motet.motion.skeleton import END_SUFFIX
from motet.representation.contract import MotionContract
from motet.representation.root_block import ROOT_BLOCK
from motet.representation.root_vectors import VECTOR_KINDS, joints_of
from motet_train.models.tree import levels


class VectorPlaces(nn.Module):
    """Places of the joints of a contract's skeleton. The origin is on the ground below the root in the frame before."""

    offsets: Tensor

    def __init__(self, contract: MotionContract) -> None:
        super().__init__()
        assert contract.skeleton is not None
        skeleton = contract.skeleton.scaled(1.0)
        kept = [i for i, joint in enumerate(skeleton.joints) if not joint.name.endswith(END_SUFFIX)]
        self.parents = [kept.index(skeleton.joints[i].parent) if i else -1 for i in kept]
        self.register_buffer("offsets", torch.tensor([skeleton.joints[i].offset for i in kept]), persistent=False)
        self.levels = levels(self.parents)
        channels, joints = list(contract.channels), joints_of(contract.channels)
        self.root = [channels.index(name) for name in ROOT_BLOCK]
        names = [skeleton.names[i] for i in kept]
        self.vectors = [channels.index(f"{joint}.{kind}") for joint in joints for kind in VECTOR_KINDS]
        self.moved = [names.index(joint) for joint in joints]
        self.fps = contract.fps

    def forward(self, frames: Tensor) -> Tensor:
        """Frames (B, T, C) in the contract's units to places (B, T, J, 3) in metres."""
        root = frames[..., self.root]
        facing = root[..., 2].cumsum(1) / self.fps
        before = facing - root[..., 2] / self.fps
        sin, cos = before.sin(), before.cos()
        x = (root[..., 0] * sin + root[..., 1] * cos).cumsum(1) / self.fps
        z = (root[..., 0] * cos - root[..., 1] * sin).cumsum(1) / self.fps
        turned = [torch.empty(0)] * len(self.parents)
        places = list(turned)
        turned[0] = _turn(facing, 1) @ _turn(root[..., 4], 0) @ _turn(root[..., 5], 2)
        places[0] = torch.stack([x, root[..., 3], z], dim=-1)
        local = rotvec_to_rotmat(frames[..., self.vectors].reshape(*frames.shape[:-1], -1, 3))
        at = {joint: row for row, joint in enumerate(self.moved)}
        for level in self.levels:
            above = torch.stack([turned[self.parents[joint]] for joint in level], dim=-3)
            moved = (above @ self.offsets[level][..., None])[..., 0]
            known = [joint for joint in level if joint in at]
            rows = [level.index(joint) for joint in known]
            new = above[..., rows, :, :] @ local[..., [at[joint] for joint in known], :, :]
            for row, joint in enumerate(level):
                places[joint], turned[joint] = places[self.parents[joint]] + moved[..., row, :], above[..., row, :, :]
            for row, joint in enumerate(known):
                turned[joint] = new[..., row, :, :]
        return torch.stack(places, dim=-2)


def _turn(angle: Tensor, axis: int) -> Tensor:
    """Turns (..., 3, 3) by angles (...) in radians about the axis 0, 1 or 2."""
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
