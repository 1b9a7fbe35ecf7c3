"""Forward kinematics of frames of ``root_sixd``, for losses: where joints are, seen from the facing."""

from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional

from motet.motion.skeleton import END_SUFFIX
from motet.representation.contract import MotionContract
from motet.representation.root_sixd import SIXD_KINDS
from motet_train.models.tree import levels


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
    skeleton = contract.skeleton
    assert skeleton is not None
    assert contract.representation == "root_sixd"
    joints = skeleton.scaled(1.0).joints
    bones = tuple(i for i, joint in enumerate(joints) if not joint.name.endswith(END_SUFFIX))
    return Tree(tuple(joint.parent for joint in joints), tuple(joint.offset for joint in joints), bones)


class SixdPlaces(nn.Module):
    """Forward kinematics of a tree."""

    offsets: Tensor

    def __init__(self, tree: Tree) -> None:
        super().__init__()
        self.register_buffer("offsets", torch.tensor(tree.offsets), persistent=False)
        self.bones, self.parents = list(tree.bones), tree.parents
        self.levels = levels(tree.parents)

    def forward(self, sixd: Tensor) -> Tensor:
        """Axes (..., 6 K) of the K bones to places (..., J, 3) in metres from the root, in the frame of the facing."""
        local = axes_to_rotmat(sixd.reshape(*sixd.shape[:-1], len(self.bones), len(SIXD_KINDS)))
        count, lead = len(self.parents), local.shape[:-3]
        turned: list[Tensor | None] = [None] * count
        places: list[Tensor] = [sixd.new_zeros(*lead, 3)] * count
        at = {joint: place for place, joint in enumerate(self.bones)}
        turned[0] = local[..., 0, :, :]
        for level in self.levels:
            parents = torch.stack([_known(turned[self.parents[joint]]) for joint in level], dim=-3)
            moved = (parents @ self.offsets[level][..., None])[..., 0]
            bones = [joint for joint in level if joint in at]
            rows = [level.index(joint) for joint in bones]
            new = parents[..., rows, :, :] @ local[..., [at[joint] for joint in bones], :, :]
            for place, joint in enumerate(bones):
                turned[joint] = new[..., place, :, :]
            for place, joint in enumerate(level):
                places[joint] = places[self.parents[joint]] + moved[..., place, :]
        return torch.stack(places, dim=-2)


def _known(rotation: Tensor | None) -> Tensor:
    assert rotation is not None
    return rotation


def axes_to_rotmat(axes: Tensor) -> Tensor:
    """Two axes (..., 6) to matrices (..., 3, 3), as :func:`motet.representation.root_sixd.sixd_to_rotmat`."""
    x = functional.normalize(axes[..., :3], dim=-1, eps=1e-6)
    y = axes[..., 3:]
    y = functional.normalize(y - (x * y).sum(-1, keepdim=True) * x, dim=-1, eps=1e-6)
    return torch.stack([x, y, torch.linalg.cross(x, y)], dim=-1)
