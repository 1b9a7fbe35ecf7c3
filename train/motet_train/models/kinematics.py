"""Forward kinematics in torch, for losses and features: where the joints of a figure are.

Letters in shapes: B rows, T frames, D channels, J joints, K of them with rotations of their own.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from motet.figures.humanoid import LEFT_RIGHT, sided
from motet.motion.kinematics import AXES
from motet.motion.skeleton import END_SUFFIX, Joint, Skeleton, partners_of
from motet.representation.contract import MotionContract
from motet.representation.root_block import ROOT_BLOCK, VECTOR_KINDS
from motet.representation.root_sixd import SIXD_KINDS
from motet_train.models.net import constants

Offsets = tuple[tuple[float, ...], ...]
"""For each joint (x, y, z) from its parent."""


def forward_kinematics(parents: Sequence[int], offsets: Tensor, local: Tensor, bones: Sequence[int]) -> Tensor:
    """Places (N, J, 3) from the root of the joints of N poses, all those of one depth at once.

    parents: each joint's, before it; -1 for the root. offsets: (J, 3) from the parents. local: rotations (3, 3, K, N)
    of ``bones``, among them all joints that have children; that of the root, the first, is in the world.
    """
    level = [0]
    turned = local[:, :, :1]
    place = local.new_zeros(3, 1, 1, local.shape[-1])
    joints = [0]
    places = [place]
    while inner := [joint for joint in level if joint in parents]:
        # the rotations of the joints that have children; the root's are in the world
        if inner != [0]:
            rows = _places_in(level, inner)
            turned = product(_at(turned, rows), _at(local, _places_in(bones, inner)))
            place = _at(place, rows)

        # the places of these children
        level = [joint for joint, parent in enumerate(parents) if parent in inner]
        rows = [inner.index(parents[joint]) for joint in level]
        turned = _at(turned, rows)
        place = _at(place, rows) + product(turned, offsets[level].T[:, None, :, None])
        joints = joints + level
        places.append(place)
    return _in_order(torch.cat(places, dim=2), joints)


def _places_in(joints: Sequence[int], some: Sequence[int]) -> list[int]:
    """Where some joints are among others."""
    return [joints.index(joint) for joint in some]


def _in_order(places: Tensor, joints: list[int]) -> Tensor:
    """Places (3, 1, J, N) of ``joints`` as (N, J, 3), in the order of the joints."""
    count = len(joints)
    order: list[int] = []
    for row in _places_in(joints, range(count)):
        order += (row, row + count, row + 2 * count)
    return torch.unflatten(_at(places.flatten(0, 2), order, dim=0).T, 1, (-1, 3))


def _at(x: Tensor, rows: Sequence[int], dim: int = 2) -> Tensor:
    """Some rows of an axis: exported as one Gather, or none where it would be all of them."""
    return x if [*rows] == [*range(x.shape[dim])] else x.index_select(dim, torch.tensor(rows, device=x.device))


def product(left: Tensor, right: Tensor) -> Tensor:
    """Matrices (3, 3, ...) times matrices (3, M, ...): sums of elementwise products, each of long rows.

    ONNX Runtime and torch multiply thousands of small matrices one by one.
    """
    columns = torch.split(left, 1, dim=1)
    rows = torch.split(right, 1, dim=0)
    return columns[0] * rows[0] + columns[1] * rows[1] + columns[2] * rows[2]


@dataclass(frozen=True)
class Tree:
    """The tree of J joints. parents: index of each joint's parent, -1 for the root. offsets: (x, y, z) from it, metres.

    bones: the joints that have axes in the frames, in the order of the frames' channels.
    """

    parents: tuple[int, ...] = ()
    offsets: Offsets = ()
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
        constants(self, offsets=torch.tensor(tree.offsets))
        self.bones = tree.bones
        self.parents = tree.parents

    def forward(self, sixd: Tensor) -> Tensor:
        """Axes (..., 6 K) of the K bones to places (..., J, 3) in metres from the root, in the frame of the facing."""
        axes = torch.unflatten(sixd.reshape(-1, sixd.shape[-1]).T, 0, (-1, len(SIXD_KINDS))).transpose(0, 1)
        joints = forward_kinematics(self.parents, self.offsets, axes_to_rotmat(axes), self.bones)
        return joints.reshape(*sixd.shape[:-1], len(self.parents), 3)


def axes_to_rotmat(axes: Tensor) -> Tensor:
    """Two axes (6, ...) to matrices (3, 3, ...), as :func:`motet.representation.root_sixd.sixd_to_rotmat`."""
    x = functional.normalize(axes[:3], dim=0, eps=1e-6)
    y = axes[3:]
    y = functional.normalize(y - (x * y).sum(0) * x, dim=0, eps=1e-6)
    # torch.linalg.cross is exported as gathers of single numbers
    x_onward = _at(x, [1, 2, 0], dim=0)
    y_onward = _at(y, [1, 2, 0], dim=0)
    x_back = _at(x, [2, 0, 1], dim=0)
    y_back = _at(y, [2, 0, 1], dim=0)
    return torch.stack([x, y, x_onward * y_back - x_back * y_onward], dim=1)


@dataclass(frozen=True)
class VectorFigure:
    """The figure of J joints that D channels in ``root_vectors`` move.

    parents: index of each joint's parent, -1 for the root. offsets: (x, y, z) from the parent in metres. bones: the
    joints that have exponential maps or children, the root first. vectors: the channels of the maps of all bones but
    the root, three each; D where there is none and the bone turns with its parent. root: the channels of the root
    block. fps: frames per second. partners: for each joint that on the other side, or itself; none where sides are not
    known.
    """

    parents: tuple[int, ...] = ()
    offsets: Offsets = ()
    bones: tuple[int, ...] = ()
    vectors: tuple[int, ...] = ()
    root: tuple[int, ...] = ()
    fps: float = 30.0
    partners: tuple[int, ...] = ()


def vector_figure_of(contract: MotionContract) -> VectorFigure:
    """The figure that frames of ``root_vectors`` move, with the tips of its bones."""
    assert contract.skeleton is not None
    joints = contract.skeleton.scaled(1.0).joints
    parents = tuple(joint.parent for joint in joints)
    bones = [0]
    vectors: list[int] = []
    for number, joint in enumerate(joints[1:], start=1):
        columns = _columns(contract, [f"{joint.name}.{kind}" for kind in VECTOR_KINDS])
        if number in parents or columns[0] < len(contract.channels):
            bones.append(number)
            vectors += columns
    return VectorFigure(
        parents,
        tuple(joint.offset for joint in joints),
        tuple(bones),
        tuple(vectors),
        tuple(_columns(contract, ROOT_BLOCK)),
        contract.fps,
        partners_of(contract.skeleton.names),
    )


MARKER = 0.1
"""Metres from a bone's joint to its marker."""

MARKER_UP = (0.0, MARKER, 0.0)
MARKER_AHEAD = (0.0, 0.0, MARKER)
"""Where markers are, in the axes of their bones."""


class VectorPoints(nn.Module):
    """Points that tell how a figure in ``root_vectors`` stands: P in all, the J joints, then for each bone a marker
    that shows how it is turned about itself, and a tip for a bone without a child to aim at.

    A bone is aimed at its first child, one in the middle if the bone is, or at its tip. Its rotation follows from that
    and from its marker.
    """

    offsets: Tensor
    rest: Tensor
    seen_from_aims: Tensor
    lengths: Tensor
    ground: Tensor
    plane: Tensor

    def __init__(self, figure: VectorFigure) -> None:
        super().__init__()
        self.figure = figure
        parents = list(figure.parents)
        offsets = list(figure.offsets)
        partners = list(figure.partners or range(len(parents)))
        self.joints = len(parents)

        # a marker for each bone, across the way to its child, and a tip where it has none
        self.aims = [_aim(bone, parents, partners) for bone in figure.bones]
        self.markers: list[int] = []
        for bone, aim in zip(figure.bones, self.aims, strict=True):
            self.markers.append(len(parents))
            parents.append(bone)
            x, y, z = figure.offsets[aim] if aim >= 0 else MARKER_UP
            offsets.append(MARKER_UP if abs(z) > max(abs(x), abs(y)) else MARKER_AHEAD)
        for row, bone in enumerate(figure.bones):
            if self.aims[row] < 0:
                self.aims[row] = len(parents)
                parents.append(bone)
                offsets.append(MARKER_UP)

        # those of the other side: of a bone's points those of its partner
        others = [figure.bones.index(partners[bone]) for bone in figure.bones]
        partners += [self.markers[other] for other in others]
        partners += [self.aims[other] for aim, other in zip(self.aims, others, strict=True) if aim >= self.joints]
        self.parents = tuple(parents)
        self.partners = partners
        in_rest = torch.tensor(offsets)
        aimed = torch.cat([in_rest[self.aims].T, in_rest[self.markers].T])
        rest = axes_to_rotmat(aimed).transpose(0, 1)[..., None]
        # where joints are from their parents, in axes along the aims of these
        rows = [max(0, self._row(parent)) for parent in figure.parents]
        seen_from_aims = product(_at(rest, rows), in_rest[: self.joints].T[:, None, :, None])
        constants(
            self,
            offsets=in_rest,
            rest=rest[..., None],
            seen_from_aims=seen_from_aims[..., None],
            lengths=in_rest.norm(dim=1)[None, :, None, None],
            ground=torch.tensor([1.0, 0.0, 1.0]),
            plane=torch.tensor([-1.0, 1.0, 1.0]),
        )
        self.root = list(figure.root)
        self.vectors = list(figure.vectors)

    def _row(self, joint: int) -> int:
        """The number of the bone of a joint, -1 where it has none."""
        return self.figure.bones.index(joint) if joint in self.figure.bones else -1

    def mirror(self, points: Tensor) -> Tensor:
        """Points (..., P, 3) with left and right exchanged."""
        return _at(points, self.partners, dim=-2) * self.plane

    def forward(self, frames: Tensor, last: int) -> Tensor:
        """Frames (B, T, D) in the contract's units to points (B, T, P, 3) in metres.

        The origin is on the ground below the root in frame ``last``, and the figure faces z there.
        """
        root = frames[..., self.root]
        facing = root[..., 2].cumsum(1) / self.figure.fps
        facing = facing - facing[:, last, None]
        path = self._path(root, facing)
        path = path - self.ground * path[:, last, None]
        return self._points(frames, facing) + path[..., None, :]

    def _points(self, frames: Tensor, facing: Tensor) -> Tensor:
        """Points (B, T, P, 3) around the root, by its rotation and those of all other bones."""
        root = frames[..., self.root]
        turned = product(product(_turn(facing, 1), _turn(root[..., 4], 0)), _turn(root[..., 5], 2))
        # bones without a map turn with their parents: they see a column of zeros
        bones = self.figure.bones
        vectors = functional.pad(frames, (0, 1))[..., self.vectors].reshape(-1, len(bones) - 1, 3)
        local = torch.cat([turned.reshape(3, 3, 1, -1), rotvec_to_rotmat(vectors.permute(2, 1, 0))], dim=2)
        points = forward_kinematics(self.parents, self.offsets, local, bones)
        return points.reshape(*frames.shape[:-1], -1, 3)

    def _path(self, root: Tensor, facing: Tensor) -> Tensor:
        """Places (B, T, 3) of the root by its channels (B, T, 6): it goes where it faced in the frame before."""
        fps = self.figure.fps
        before = facing - root[..., 2] / fps
        sin = before.sin()
        cos = before.cos()
        x = (root[..., 0] * sin + root[..., 1] * cos).cumsum(1) / fps
        z = (root[..., 0] * cos - root[..., 1] * sin).cumsum(1) / fps
        return torch.stack([x, root[..., 3], z], dim=-1)

    def from_parents(self, points: Tensor, dim: int = -2) -> Tensor:
        """Points (..., P, ...) as vectors from their parents; that of the root stays."""
        parents = [max(parent, 0) for parent in self.parents]
        root = points.narrow(dim, 0, 1)
        others = points - _at(points, parents, dim=dim)
        return torch.cat([root, others.narrow(dim, 1, len(parents) - 1)], dim=dim)

    def frames(self, vectors: Tensor, last: Tensor) -> Tensor:
        """The frames (B, N, D) that are as near to points as bones allow.

        vectors: (B, 1 + N, P, 3) of the points from their parents in the last frame before and in these, all seen from
        it. last: (B, 1, D) that frame, whose other channels stay.
        """
        rotations = self._aimed(vectors.permute(3, 2, 0, 1))
        parents = _places_in(self.figure.bones, [self.figure.parents[bone] for bone in self.figure.bones[1:]])
        local = product(_at(rotations, parents).transpose(0, 1), rotations[:, :, 1:])[..., 1:]
        root, maps = self._root_and_maps(vectors[:, :, 0], rotations[:, :, 0], local)
        maps = maps.permute(2, 3, 1, 0).flatten(2)

        # each channel from the root block, the maps or the last frame
        values = torch.cat([root, maps, last.expand(-1, root.shape[1], -1)], dim=-1)
        return _at(values, self._sources(last.shape[-1]), dim=-1)

    def _sources(self, channels: int) -> list[int]:
        """Where each channel is among the root block, the maps, and the channels of the last frame."""
        known = [*self.root, *self.vectors]
        return [known.index(n) if n in known else len(known) + n for n in range(channels)]

    def _aimed(self, vectors: Tensor) -> Tensor:
        """Rotations (3, 3, K, ...) in the world of the bones of points, by vectors (3, P, ...) from their parents.

        From the root outwards each bone is aimed at the point of its child from where its joint has come to be.
        """
        bones = self.figure.bones
        level = [0]
        apart = torch.zeros_like(vectors[:, :1])  # of the points of joints from where these are
        order: list[int] = []
        all_aims: list[Tensor] = []
        while inner := [joint for joint in level if joint in bones]:
            # the aims of the bones of this depth
            rows = _places_in(bones, inner)
            targets = [self.aims[row] for row in rows]
            aims = _at(vectors, targets, dim=1) + _at(apart, _places_in(level, inner), dim=1)
            order += rows
            all_aims.append(aims)

            # how far the points of their children are from these: of one that is aimed at, by the bone's length alone
            level = [joint for joint in range(self.joints) if self.parents[joint] in inner]
            if not level:
                break
            rows = [inner.index(self.parents[joint]) for joint in level]
            if [targets[row] for row in rows] == level:
                reached = functional.normalize(aims, dim=0, eps=1e-6) * self.lengths[:, targets]
                apart = _at(aims - reached, rows, dim=1)
            else:
                across = _at(vectors, [self.markers[bones.index(joint)] for joint in inner], dim=1)
                along = _at(axes_to_rotmat(torch.cat([aims, across])), rows)
                offsets = product(along, _at(self.seen_from_aims, level))[:, 0]
                starts = _at(vectors, level, dim=1) + _at(aims - _at(vectors, targets, dim=1), rows, dim=1)
                apart = starts - offsets
        aimed = torch.cat(
            [
                _at(torch.cat(all_aims, dim=1), _places_in(order, range(len(bones))), dim=1),
                _at(vectors, self.markers, dim=1),
            ]
        )
        return product(axes_to_rotmat(aimed), self.rest)

    def _root_and_maps(self, places: Tensor, rotations: Tensor, local: Tensor) -> tuple[Tensor, Tensor]:
        """The root block (B, N, 6) and the maps (3, K - 1, B, N) of the other bones.

        places, rotations: (B, 1 + N, 3) and (3, 3, B, 1 + N) of the root, the first of the frame before. local: (3, 3,
        K - 1, B, N), rotations seen from the parents.
        """
        fps = self.figure.fps
        now = rotations[..., 1:]
        sin, cos = functional.normalize(torch.stack([rotations[0, 2], rotations[2, 2]]), dim=0, eps=1e-6)
        sin_before = sin[:, :-1]
        cos_before = cos[:, :-1]
        sin = sin[:, 1:]
        cos = cos[:, 1:]

        # pitch, roll, how far the root turns since the frame before, and the angles of maps
        ahead = (now[0, 2].square() + now[2, 2].square()).sqrt()
        turn_sine = sin * cos_before - cos * sin_before
        turn_cosine = cos * cos_before + sin * sin_before
        axis, sine, cosine = _turned(local)
        sines = torch.stack([-now[1, 2], now[1, 0], turn_sine])
        cosines = torch.stack([ahead, now[1, 1], turn_cosine])
        angles = _angle(torch.cat([sines, sine]), torch.cat([cosines, cosine]))
        pitch, roll, turn = angles[:3]

        # the root goes as it faced before
        x, _, z = places.diff(dim=1).unbind(-1)
        forward = x * sin_before + z * cos_before
        left = x * cos_before - z * sin_before
        root = torch.stack([forward * fps, left * fps, turn * fps, places[:, 1:, 1], pitch, roll], dim=-1)
        return root, axis * angles[3:]


def _aim(bone: int, parents: Sequence[int], partners: Sequence[int]) -> int:
    """The child that a bone is aimed at; -1 where there is none."""
    for joint, parent in enumerate(parents):
        in_the_middle = partners[joint] == joint
        if parent == bone and (in_the_middle or partners[bone] != bone):
            return joint
    return -1


def _angle(sine: Tensor, cosine: Tensor) -> Tensor:
    """Angles (..., N) in radians by multiples of their sines and cosines.

    Each row of N is filled up to a multiple of 16, which kernels compute at once: they compute what is left over in
    another way, and so a row would depend on how many there are.
    """
    count = sine.shape[-1]
    spare = -count % 16
    filled = torch.atan2(functional.pad(sine, (0, spare)), functional.pad(cosine, (0, spare), value=1.0))
    return filled[..., :count]


def _turn(angle: Tensor, axis: int) -> Tensor:
    """Rotations (3, 3, ...) by angles (...) in radians about the axis 0, 1 or 2."""
    unit = torch.ones_like(angle)
    zero = torch.zeros_like(angle)
    sin = angle.sin()
    cos = angle.cos()
    rows = {
        0: (unit, zero, zero, zero, cos, -sin, zero, sin, cos),
        1: (cos, zero, sin, zero, unit, zero, -sin, zero, cos),
        2: (cos, -sin, zero, sin, cos, zero, zero, zero, unit),
    }
    return torch.unflatten(torch.stack(rows[axis]), 0, (3, 3))


def rotvec_to_rotmat(vectors: Tensor) -> Tensor:
    """Rotation vectors (3, ...) to matrices (3, 3, ...) by Rodrigues' formula, with gradients at 0."""
    # a limit, not a sum: the exporter drops what is as small as that
    squared = vectors.square().sum(0).clamp_min(1e-12)
    angle = squared.sqrt()
    x, y, z = vectors
    zero = torch.zeros_like(x)
    # the matrix of the cross product
    cross = torch.unflatten(torch.stack([zero, -z, y, z, zero, -x, -y, x, zero]), 0, (3, 3))
    eye = torch.eye(3, dtype=vectors.dtype, device=vectors.device).reshape(3, 3, *[1] * angle.dim())
    return eye + angle.sin() / angle * cross + (1 - angle.cos()) / squared * product(cross, cross)


def rotmat_to_rotvec(rotations: Tensor) -> Tensor:
    """Matrices (3, 3, ..., N) to rotation vectors (3, ..., N) of at most half a turn."""
    axis, sine, cosine = _turned(rotations)
    return axis * _angle(sine, cosine)


def _turned(rotations: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Of matrices (3, 3, ...) the axis (3, ...), and twice the sine and the cosine (...) of the angle."""
    trace = rotations[0, 0] + rotations[1, 1] + rotations[2, 2]
    swept = torch.stack(
        [rotations[2, 1] - rotations[1, 2], rotations[0, 2] - rotations[2, 0], rotations[1, 0] - rotations[0, 1]]
    )
    # near half a turn the sine vanishes: there the axis is a column of R + R^T + (1 - trace) E, which is 4 q q^T
    diagonal = torch.stack([rotations[0, 0], rotations[1, 1], rotations[2, 2]])
    largest = diagonal.argmax(0)
    eye = torch.eye(3, device=rotations.device).reshape(3, 3, *[1] * (rotations.dim() - 2))
    columns = rotations + rotations.transpose(0, 1) + (1 - trace) * eye
    column = torch.where(largest == 0, columns[0], torch.where(largest == 1, columns[1], columns[2]))
    column = column * torch.where((column * swept).sum(0) < 0, -1.0, 1.0)
    axis = torch.where(trace < -0.9, column, swept)
    length = axis.square().sum(0).clamp_min(1e-20).sqrt()
    return axis / length, swept.square().sum(0).sqrt(), trace - 1


@dataclass(frozen=True)
class Figure:
    """The tree of J joints, and where in D channels their Euler angles are.

    parents: index of each joint's parent, -1 for the root. offsets: (x, y, z) from the parent in metres. orders: of the
    angles, "zyx" for Rz Ry Rx. columns: the channels of these angles, in degrees, in that order; D where there is none
    and the angle is 0. root: the channels of the root block.
    """

    parents: tuple[int, ...] = ()
    offsets: Offsets = ()
    orders: tuple[str, ...] = ()
    columns: tuple[tuple[int, ...], ...] = ()
    root: tuple[int, ...] = ()


def figure_of(contract: MotionContract) -> Figure:
    """The figure that frames of ``root_angles`` move, without the tips of its bones; one without joints for other
    contracts, or where lengths are unknown."""
    skeleton = contract.skeleton
    if contract.representation != "root_angles" or skeleton is None or skeleton.metres_per_unit is None:
        return Figure()
    joints = _without_tips(skeleton)
    if any(any(joint.axis) for joint in joints):
        return Figure()
    orders = ["yxz"]
    columns = [_columns(contract, ("", "root.pitch", "root.roll"))]  # the heading about y is left out
    for joint in joints[1:]:
        orders.append(joint.order)
        columns.append(_columns(contract, [f"{joint.name}.r{axis}" for axis in joint.order]))
    return Figure(
        tuple(_parents_among(joints, skeleton)),
        tuple(joint.offset for joint in joints),
        tuple(orders),
        tuple(map(tuple, columns)),
        tuple(_columns(contract, ROOT_BLOCK)),
    )


def _without_tips(skeleton: Skeleton) -> list[Joint]:
    """The joints of a figure in metres, without the tips of its bones."""
    return [joint for joint in skeleton.scaled(1.0).joints if not joint.name.endswith(END_SUFFIX)]


def _parents_among(joints: Sequence[Joint], skeleton: Skeleton) -> list[int]:
    """The index among some joints of each one's parent, -1 for the root, by their indices in the skeleton."""
    names = [joint.name for joint in joints]
    return [names.index(skeleton.names[joint.parent]) if joint.parent >= 0 else -1 for joint in joints]


def _columns(contract: MotionContract, channels: Iterable[str]) -> list[int]:
    """The columns of channels of a contract; D for those that it lacks."""
    columns = {channel: column for column, channel in enumerate(contract.channels)}
    return [columns.get(channel, len(columns)) for channel in channels]


class EulerPlaces(nn.Module):
    """Places of the joints of a figure, seen from the root.

    The angles of one pose differ between people by how their skeletons were fitted; places differ less.
    """

    columns: Tensor
    offsets: Tensor
    units: Tensor
    entries: Tensor

    def __init__(self, figure: Figure) -> None:
        super().__init__()
        self.parents = figure.parents
        joints = len(figure.parents)
        axes = torch.tensor([list(map(AXES.index, order)) for order in figure.orders])
        # angles about axes that are a mirror image of x, y, z count the other way round
        signs = torch.linalg.det(torch.eye(3)[axes])
        # the entry (i, j) of a joint's matrix lies where i and j are in its order
        place = axes.argsort(dim=1).T
        entries = (3 * place[:, None] + place) * joints + torch.arange(joints)
        constants(
            self,
            columns=torch.tensor(figure.columns).T.flatten(),
            offsets=torch.tensor(figure.offsets),
            units=torch.deg2rad(signs)[:, None],
            entries=entries.flatten(),
        )

    def forward(self, frames: Tensor) -> Tensor:
        """Frames (B, T, D), angles in degrees, to places (B, T, 3 (J - 1)) in metres from the root of the others."""
        padded = functional.pad(frames.flatten(0, 1).T, (0, 0, 0, 1))
        angles = torch.unflatten(padded.index_select(0, self.columns), 0, (3, -1)) * self.units
        joints = forward_kinematics(self.parents, self.offsets, self._local(angles), range(len(self.parents)))
        return joints[:, 1:].reshape(*frames.shape[:2], -1)

    def _local(self, angles: Tensor) -> Tensor:
        """Rotations (3, 3, J, N) by angles (3, J, N) in radians about the axes in each joint's order: Rx Ry Rz with
        rows and columns in that order."""
        sin_x, sin_y, sin_z = angles.sin()
        cos_x, cos_y, cos_z = angles.cos()
        sin_xz = sin_x * sin_z
        cos_xz = cos_x * cos_z
        sin_cos = sin_x * cos_z
        cos_sin = cos_x * sin_z
        # row by row
        rows = [cos_y * cos_z, -cos_y * sin_z, sin_y]
        rows += [sin_y * sin_cos + cos_sin, cos_xz - sin_y * sin_xz, -sin_x * cos_y]
        rows += [sin_xz - sin_y * cos_xz, sin_y * cos_sin + sin_cos, cos_x * cos_y]
        return torch.unflatten(torch.cat(rows).index_select(0, self.entries), 0, (3, 3, -1))


def smooth_length(vectors: Tensor, least: float) -> Tensor:
    """Lengths (...) of vectors (..., K), with gradients at 0. least: what is added to their squares."""
    return (vectors.square().sum(-1) + least).sqrt()


def joint_weights(contract: MotionContract, parts: tuple[str, ...], times: float) -> Tensor:
    """The weights (J,) of joints in a loss, mean 1: those of some parts of both sides weigh ``times`` the others."""
    assert contract.skeleton is not None
    heavy: list[str] = []
    for side in LEFT_RIGHT:
        heavy += [sided(side, part) for part in parts]
    weights = np.array([times if name.startswith(tuple(heavy)) else 1.0 for name in contract.skeleton.names])
    return torch.from_numpy(weights / weights.mean()).float()
