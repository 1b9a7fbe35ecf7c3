"""Forward kinematics in torch, for losses and features: where the joints of a figure are.

In exported graphs lengths are ``vector_norm``, and there are no means along the last axis: some kernels compute square
roots and sums by where a row lies in memory, so that its last bits would differ between batches.

Letters in shapes: B rows, T frames, D channels, J joints, K of them with rotations of their own.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from motet.figures.humanoid import LEFT_RIGHT, sided
from motet.motion.kinematics import AXES
from motet.motion.skeleton import END_SUFFIX, partners_of
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


@dataclass(frozen=True)
class MarkedTree:
    """The tree of P points: the J joints of a figure, then for each of its K bones a marker, which shows how it is
    turned about itself, and a tip for a bone without a child to aim at.

    parents, offsets: of the points, as those of joints. aims: of each bone the point that it is aimed at, its first
    child, one in the middle if the bone is, or its tip. markers: of each bone its marker. partners: for each point that
    on the other side, or itself.
    """

    parents: Sequence[int]
    offsets: Sequence[tuple[float, ...]]
    aims: Mapping[int, int]
    markers: Mapping[int, int]
    partners: Sequence[int]


def marked_tree(figure: VectorFigure) -> MarkedTree:
    """The tree of a figure with markers and tips."""
    joints = len(figure.parents)
    partners = figure.partners or range(joints)
    aims = {bone: _aim(bone, figure.parents, partners) for bone in figure.bones}
    tips = [bone for bone, aim in aims.items() if aim < 0]
    markers = {bone: joints + row for row, bone in enumerate(aims)}
    for row, bone in enumerate(tips):
        aims[bone] = joints + len(aims) + row
    offsets = [*figure.offsets, *[MARKER_AHEAD] * len(aims), *[MARKER_UP] * len(tips)]
    for bone, marker in markers.items():
        x, y, z = offsets[aims[bone]]
        if abs(z) > abs(x) + abs(y):  # a marker is across the way to the child
            offsets[marker] = MARKER_UP
    # of a bone's points those of its partner are on the other side
    sides = [*partners, *(markers[partners[bone]] for bone in markers), *(aims[partners[bone]] for bone in tips)]
    return MarkedTree([*figure.parents, *markers, *tips], offsets, aims, markers, sides)


def _aim(bone: int, parents: Sequence[int], partners: Sequence[int]) -> int:
    """The child that a bone is aimed at; -1 where there is none."""
    for joint, parent in enumerate(parents):
        in_the_middle = partners[joint] == joint
        if parent == bone and (in_the_middle or partners[bone] != bone):
            return joint
    return -1


class VectorPoints(nn.Module):
    """Points that tell how a figure in ``root_vectors`` stands: those of its :class:`MarkedTree`.

    The rotation of a bone follows from the point that it is aimed at and from its marker.
    """

    offsets: Tensor
    rest: Tensor
    offsets_along_aims: Tensor
    plane: Tensor

    def __init__(self, figure: VectorFigure) -> None:
        super().__init__()
        self.figure = figure
        self.joints = len(figure.parents)
        self.tree = marked_tree(figure)
        self.aims = list(self.tree.aims.values())
        self.markers = list(self.tree.markers.values())
        self.bone_parents = _places_in(figure.bones, [figure.parents[bone] for bone in figure.bones[1:]])
        offsets = torch.tensor(self.tree.offsets)
        at_rest = torch.cat([offsets[self.aims].T, offsets[self.markers].T])
        rest = axes_to_rotmat(at_rest).transpose(0, 1)[..., None]
        parents = _places_in(figure.bones, [max(parent, 0) for parent in figure.parents])
        # where joints are from their parents, in axes along the aims of these
        along = product(_at(rest, parents), offsets[: self.joints].T[:, None, :, None])
        constants(
            self,
            offsets=offsets,
            rest=rest[..., None],
            offsets_along_aims=along[..., None],
            plane=torch.tensor([-1.0, 1.0, 1.0]),
        )

    def mirror(self, points: Tensor) -> Tensor:
        """Points (..., P, 3) with left and right exchanged."""
        return _at(points, self.tree.partners, dim=-2) * self.plane

    def forward(self, frames: Tensor, last: int) -> Tensor:
        """Frames (B, T, D) in the contract's units to points (B, T, P, 3) in metres.

        The origin is on the ground below the root in frame ``last``, and the figure faces z there.
        """
        root = _at(frames, self.figure.root, dim=-1)
        facing = root[..., 2].cumsum(1) / self.figure.fps
        facing = facing - facing[:, last, None]
        facing_before = facing - root[..., 2] / self.figure.fps
        angles = torch.stack([facing, root[..., 4], root[..., 5], facing_before])
        sin = in_whole_registers(torch.sin, angles)
        cos = in_whole_registers(torch.cos, angles)
        return self._points(frames, sin[:3], cos[:3]) + self._path(root, sin[3], cos[3], last)[..., None, :]

    def _points(self, frames: Tensor, sin: Tensor, cos: Tensor) -> Tensor:
        """Points (B, T, P, 3) around the root, by its rotation and those of all other bones.

        sin, cos: (3, B, T) of the root's facing, pitch and roll.
        """
        # facing, pitch and roll are about y, x and z: axes of a mirror image, about which angles count the other way
        entries = euler_entries(-sin, cos)
        turned = torch.stack([entries[place] for place in (4, 3, 5, 1, 0, 2, 7, 6, 8)])
        # bones without a map turn with their parents: they see a column of zeros
        bones = self.figure.bones
        vectors = _at(functional.pad(frames, (0, 1)), self.figure.vectors, dim=-1).reshape(-1, len(bones) - 1, 3)
        local = torch.cat([turned.reshape(3, 3, 1, -1), rotvec_to_rotmat(vectors.permute(2, 1, 0))], dim=2)
        points = forward_kinematics(self.tree.parents, self.offsets, local, bones)
        return points.reshape(*frames.shape[:-1], -1, 3)

    def _path(self, root: Tensor, sin: Tensor, cos: Tensor, last: int) -> Tensor:
        """Places (B, T, 3) of the root by its channels (B, T, 6), seen from frame ``last``: it goes where it faced in
        the frame before, by that angle's sine and cosine (B, T)."""
        fps = self.figure.fps
        x = (root[..., 0] * sin + root[..., 1] * cos).cumsum(1) / fps
        z = (root[..., 0] * cos - root[..., 1] * sin).cumsum(1) / fps
        return torch.stack([x - x[:, last, None], root[..., 3], z - z[:, last, None]], dim=-1)

    def from_parents(self, points: Tensor, dim: int = -2) -> Tensor:
        """Points (..., P, ...) as vectors from their parents; that of the root stays."""
        parents = self.tree.parents[1:]
        others = points.narrow(dim, 1, len(parents)) - _at(points, parents, dim=dim)
        return torch.cat([points.narrow(dim, 0, 1), others], dim=dim)

    def frames(self, vectors: Tensor, last: Tensor) -> Tensor:
        """The frames (B, N, D) that are as near to points as bones allow.

        vectors: (B, 1 + N, P, 3) of the points from their parents in the last frame before and in these, all seen from
        it. last: (B, 1, D) that frame, whose other channels stay.
        """
        rotations = self._aimed(vectors.permute(3, 2, 0, 1))
        local = product(_at(rotations, self.bone_parents).transpose(0, 1), rotations[:, :, 1:])[..., 1:]
        ahead = torch.stack([rotations[0, 2, 0], rotations[2, 2, 0]])
        heading = functional.normalize(ahead, dim=0, eps=1e-6)  # its sine and cosine
        angles, axis = _angles(rotations[:, :, 0], heading, local)
        root = self._root(vectors[:, :, 0], heading, angles)
        maps = (axis * angles[3:]).permute(2, 3, 1, 0).flatten(2)

        # each channel from the root block, the maps or the last frame
        values = torch.cat([root, maps, last.expand(-1, root.shape[1], -1)], dim=-1)
        return _at(values, self._sources(last.shape[-1]), dim=-1)

    def _sources(self, channels: int) -> list[int]:
        """Where each channel is among the root block, the maps, and the channels of the last frame."""
        known = [*self.figure.root, *self.figure.vectors]
        return [known.index(n) if n in known else len(known) + n for n in range(channels)]

    def _aimed(self, vectors: Tensor) -> Tensor:
        """Rotations (3, 3, K, ...) in the world of the bones of points, by vectors (3, P, ...) from their parents.

        From the root outwards each bone is aimed at the point of its child from where its joint has come to be.
        """
        bones = self.figure.bones
        level = [0]
        apart = torch.zeros_like(vectors[:, :1])  # of the points of joints from where these are
        order: list[int] = []
        aims: list[Tensor] = []
        while inner := [joint for joint in level if joint in bones]:
            # the aims of the bones of this depth, and how far the points of their children are from these
            apart = _at(apart, _places_in(level, inner), dim=1)
            aims.append(_at(vectors, [self.tree.aims[bone] for bone in inner], dim=1) + apart)
            order += inner
            level = [joint for joint in range(self.joints) if self.figure.parents[joint] in inner]
            if level:
                apart = self._apart(vectors, aims[-1], inner, level)
        axes = [_at(torch.cat(aims, dim=1), _places_in(order, bones), dim=1), _at(vectors, self.markers, dim=1)]
        return product(axes_to_rotmat(torch.cat(axes)), self.rest)

    def _apart(self, vectors: Tensor, aims: Tensor, bones: list[int], children: list[int]) -> Tensor:
        """How far (3, C, ...) the points of the children of R bones are from where these come to be.

        vectors: as :meth:`_aimed` takes them. aims: (3, R, ...) of the bones.
        """
        targets = [self.tree.aims[bone] for bone in bones]
        parents = _places_in(bones, [self.figure.parents[child] for child in children])
        # a child that is aimed at is on the aim, by the bone's length
        if [targets[parent] for parent in parents] == children:
            reached = functional.normalize(aims, dim=0, eps=1e-6) * self.offsets_along_aims[0][:, targets]
            return _at(aims - reached, parents, dim=1)
        # the others turn with the bone
        markers = [self.tree.markers[bone] for bone in bones]
        along = axes_to_rotmat(torch.cat([aims, _at(vectors, markers, dim=1)]))
        turned = product(_at(along, parents), _at(self.offsets_along_aims, children))[:, 0]
        starts = _at(aims - _at(vectors, targets, dim=1), parents, dim=1)
        return starts + _at(vectors, children, dim=1) - turned

    def _root(self, places: Tensor, heading: Tensor, angles: Tensor) -> Tensor:
        """The root block (B, N, 6) by places (B, 1 + N, 3) and headings (2, B, 1 + N) of the root, the first of the
        frame before; and by pitch, roll and turn, the first three of (.., B, N) angles."""
        fps = self.figure.fps
        pitch, roll, turn = angles[:3]
        # it goes as it faced before
        sin, cos = heading[..., :-1]
        x, _, z = places.diff(dim=1).unbind(-1)
        forward = (x * sin + z * cos) * fps
        left = (x * cos - z * sin) * fps
        return torch.stack([forward, left, turn * fps, places[:, 1:, 1], pitch, roll], dim=-1)


def _angles(root: Tensor, heading: Tensor, local: Tensor) -> tuple[Tensor, Tensor]:
    """The root's pitch, roll and turn since the frame before, and the angles of the other bones (3 + K - 1, B, N); and
    the axes (3, K - 1, B, N) of these.

    root: (3, 3, B, 1 + N), its rotations, the first of the frame before. heading: (2, B, 1 + N), the sine and cosine of
    where it faces. local: (3, 3, K - 1, B, N), rotations seen from the parents. All angles are computed at once.
    """
    sin_before, cos_before = heading[..., :-1]
    sin, cos = heading[..., 1:]
    now = root[..., 1:]
    ahead = now[:, 2]
    level = torch.linalg.vector_norm(ahead[::2], dim=0)
    sines = torch.stack([-ahead[1], now[1, 0], sin * cos_before - cos * sin_before])
    cosines = torch.stack([level, now[1, 1], cos * cos_before + sin * sin_before])
    axis, sine, cosine = _turned(local)
    angles = in_whole_registers(torch.atan2, torch.cat([sines, sine]), torch.cat([cosines, cosine]))
    return angles, axis


def in_whole_registers(function: Callable[..., Tensor], *inputs: Tensor) -> Tensor:
    """An elementwise function of rows (..., N), each filled up with ones to a multiple of 16.

    Kernels compute 16 numbers at once, and what is left over in another way; so a row would depend on its batch.
    """
    count = inputs[0].shape[-1]
    filled = [functional.pad(x, (0, -count % 16), value=1.0) for x in inputs]
    computed: Tensor = function(*filled)
    return computed[..., :count]


def euler_entries(sin: Tensor, cos: Tensor) -> list[Tensor]:
    """The nine entries (...) of Rx Ry Rz, row by row, by the sines and cosines (3, ...) of the angles."""
    sin_x, sin_y, sin_z = sin
    cos_x, cos_y, cos_z = cos
    sin_xz = sin_x * sin_z
    cos_xz = cos_x * cos_z
    sin_cos = sin_x * cos_z
    cos_sin = cos_x * sin_z
    first_row = [cos_y * cos_z, -cos_y * sin_z, sin_y]
    second_row = [sin_y * sin_cos + cos_sin, cos_xz - sin_y * sin_xz, -sin_x * cos_y]
    third_row = [sin_xz - sin_y * cos_xz, sin_y * cos_sin + sin_cos, cos_x * cos_y]
    return first_row + second_row + third_row


def rotvec_to_rotmat(vectors: Tensor) -> Tensor:
    """Rotation vectors (3, ...) to matrices (3, 3, ...) by Rodrigues' formula, with gradients at 0."""
    # a limit, not a sum: the exporter drops what is as small as that
    angle: Tensor = torch.linalg.vector_norm(vectors, dim=0).clamp_min(1e-6)
    squared = angle.square()
    x, y, z = vectors
    zero = torch.zeros_like(x)
    # the matrix of the cross product
    cross = torch.unflatten(torch.stack([zero, -z, y, z, zero, -x, -y, x, zero]), 0, (3, 3))
    eye = torch.eye(3, dtype=vectors.dtype, device=vectors.device).reshape(3, 3, *[1] * angle.dim())
    sin = in_whole_registers(torch.sin, angle)
    cos = in_whole_registers(torch.cos, angle)
    return eye + sin / angle * cross + (1 - cos) / squared * product(cross, cross)


def _turned(rotations: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Of matrices (3, 3, ...) the axis (3, ...), and twice the sine and the cosine (...) of the angle."""
    diagonal = torch.stack([rotations[0, 0], rotations[1, 1], rotations[2, 2]])
    trace = diagonal.sum(0)
    swept = torch.stack(
        [rotations[2, 1] - rotations[1, 2], rotations[0, 2] - rotations[2, 0], rotations[1, 0] - rotations[0, 1]]
    )
    # near half a turn the sine vanishes, and an axis along it
    column = _column(rotations, diagonal)
    to_its_side = torch.where((column * swept).sum(0) < 0, -1.0, 1.0)
    axis = torch.where(trace < -0.9, column * to_its_side, swept)
    return functional.normalize(axis, dim=0, eps=1e-10), torch.linalg.vector_norm(swept, dim=0), trace - 1


def _column(rotations: Tensor, diagonal: Tensor) -> Tensor:
    """The column (3, ...) of R + R^T + (1 - trace) E, which is 4 q q^T, with the largest number on the diagonal."""
    eye = torch.eye(3, device=rotations.device).reshape(3, 3, *[1] * (diagonal.dim() - 1))
    columns = rotations + rotations.transpose(0, 1) + (1 - diagonal.sum(0)) * eye
    largest = diagonal.argmax(0)
    return torch.where(largest == 0, columns[0], torch.where(largest == 1, columns[1], columns[2]))


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
    joints = [joint for joint in skeleton.scaled(1.0).joints if not joint.name.endswith(END_SUFFIX)]
    names = [joint.name for joint in joints]
    if any(any(joint.axis) for joint in joints):
        return Figure()
    orders = ["yxz"]
    columns = [_columns(contract, ("", "root.pitch", "root.roll"))]  # the heading about y is left out
    for joint in joints[1:]:
        orders.append(joint.order)
        columns.append(_columns(contract, [f"{joint.name}.r{axis}" for axis in joint.order]))
    return Figure(
        tuple(names.index(skeleton.names[joint.parent]) if joint.parent >= 0 else -1 for joint in joints),
        tuple(joint.offset for joint in joints),
        tuple(orders),
        tuple(map(tuple, columns)),
        tuple(_columns(contract, ROOT_BLOCK)),
    )


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
        entries = torch.cat(euler_entries(angles.sin(), angles.cos()))
        return torch.unflatten(entries.index_select(0, self.entries), 0, (3, 3, -1))


def smooth_length(vectors: Tensor, least: float) -> Tensor:
    """Lengths (...) of vectors (..., K), with gradients at 0. least: what is added to their squares."""
    return (vectors.square().sum(-1) + least).sqrt()


def joint_weights(contract: MotionContract, parts: tuple[str, ...], times: float) -> Tensor:
    """The weights (J,) of joints in a loss, mean 1: those of some parts, of both sides, weigh ``times`` the others."""
    assert contract.skeleton is not None
    heavy = list(parts)
    for side in LEFT_RIGHT:
        heavy += [sided(side, part) for part in parts]
    weights = np.array([times if name.startswith(tuple(heavy)) else 1.0 for name in contract.skeleton.names])
    return torch.from_numpy(weights / weights.mean()).float()
