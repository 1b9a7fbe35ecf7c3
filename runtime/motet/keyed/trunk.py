"""Hips, legs, trunk and head of a drawn act, laid over a figure. The feet stay where they are in the base, but for what
keys say of them.

Letters in shapes: T frames, J bones of the humanoid.
"""

from dataclasses import dataclass, replace

import numpy as np

from motet.figures.humanoid import BONES, HUMANOID, LEFT_RIGHT, LEG, limb_of, sided
from motet.figures.two_bones import TwoBones
from motet.keyed.draw import Drawn
from motet.motion.rotations import Array, axis_to_rotmat, inverse, product, quat_to_rotmat, rotated
from motet.motion.scalar_or_batch import joined, parts

SPINE_SHARES = {"spine": 0.3, "chest": 0.35, "upperChest": 0.35}
HEAD_SHARES = {"neck": 0.4, "head": 0.6}
"""How much of a turn each bone takes."""


@dataclass(frozen=True)
class Figure:
    """A motion of the humanoid as arrays.

    local: rotations (T, J, 3, 3) in the parents' frames. root: places (T, 3) of the hips in metres. facing: rotations
    (T, 3, 3) about the vertical axis, from the way that the base faces to the world. floor: (T, 3) the place under the
    hips of the base.
    """

    local: Array
    root: Array
    facing: Array
    floor: Array

    def chain(self, bones: tuple[str, ...]) -> tuple[Array, Array]:
        """Rotations (T, n, 3, 3) in the world, and places (T, n, 3), of bones from the hips on."""
        turned = self.local[:, 0]
        place = self.root
        rotations = [turned]
        places = [place]
        for bone in bones[1:]:
            offset = HUMANOID.offsets[HUMANOID.index(bone)]
            place = place + turned @ offset
            turned = product(turned, self.local[:, BONES.index(bone)])
            rotations.append(turned)
            places.append(place)
        return np.stack(rotations, axis=1), np.stack(places, axis=1)

    def with_local(self, rotations: dict[str, Array]) -> "Figure":
        """The figure with other rotations (T, 3, 3) of some bones in their parents' frames."""
        local = self.local.copy()
        for bone, turned in rotations.items():
            local[:, BONES.index(bone)] = turned
        return replace(self, local=local)


def turn_of(bend: Array, turn: Array, lean: Array) -> Array:
    """Rotations (T, 3, 3) of degrees (T,): bent forward, turned to the left, leaned to the left, in this order."""
    about_x = axis_to_rotmat("x", np.radians(bend))
    about_y = axis_to_rotmat("y", np.radians(turn))
    about_z = axis_to_rotmat("z", -np.radians(lean))
    return product(about_y, product(about_x, about_z))


def with_feet(figure: Figure, act: Drawn) -> Figure:
    """The figure with its hips moved and turned, on legs whose feet are where keys want them."""
    moved = _with_hips(figure, act)
    for side in LEFT_RIGHT:
        legs = ("hips", *limb_of(side, LEG[:3]))
        base_rotations, base_places = figure.chain(legs)
        target = base_places[:, 3] + rotated(figure.facing, _foot_offset(act, side))
        foot = product(_foot_turn(act, side, figure.facing), base_rotations[:, 3])
        moved = _with_leg(moved, legs, target, foot)
    return moved


def _with_hips(figure: Figure, act: Drawn) -> Figure:
    turn = turn_of(*(act.number("hips", name) for name in ("bend", "turn", "lean")))
    world_turn = product(product(figure.facing, turn), inverse(figure.facing))
    offset = np.stack([act.number("hips", "left"), -act.number("hips", "down"), act.number("hips", "forward")], axis=1)
    moved = replace(figure, root=figure.root + rotated(figure.facing, offset))
    return moved.with_local({"hips": product(world_turn, figure.local[:, 0])})


def _foot_offset(act: Drawn, side: str) -> Array:
    """How far a foot is from where it is in the base (T, 3), seen along the way that the figure faces."""
    part = f"{side}_foot"
    out = act.number(part, "out") * (1 if side == "left" else -1)
    return np.stack([out, act.number(part, "up"), act.number(part, "forward")], axis=1)


def _foot_turn(act: Drawn, side: str, facing: Array) -> Array:
    """The rotations (T, 3, 3) in the world of a foot that turns out and points down."""
    part = f"{side}_foot"
    out = act.number(part, "turn") * (1 if side == "left" else -1)
    turn = turn_of(act.number(part, "point"), out, np.zeros_like(out))
    return product(product(facing, turn), inverse(facing))


def _with_leg(figure: Figure, bones: tuple[str, ...], target: Array, foot: Array) -> Figure:
    """The figure with an ankle at targets (T, 3), and its foot's rotations (T, 3, 3) in the world."""
    rotations, places = figure.chain(bones)
    hips, thigh, shin, _ = np.moveaxis(rotations, 1, 0)

    # the knee is a hinge about the shin's x axis
    hip, knee, ankle = (parts(places[:, joint]) for joint in (1, 2, 3))
    leg = TwoBones(hip, knee, ankle, parts(shin[:, :, 0]))
    turn_thigh, turn_shin = leg.turns(leg.eased(parts(target)))

    # thigh and shin turn in the world, then each is seen from the joint above it
    thigh = product(quat_to_rotmat(joined(turn_thigh)), thigh)
    shin = product(quat_to_rotmat(joined(turn_shin)), shin)
    return figure.with_local(
        {
            bones[1]: product(inverse(hips), thigh),
            bones[2]: product(inverse(thigh), shin),
            bones[3]: product(inverse(shin), foot),
        }
    )


def with_trunk(figure: Figure, act: Drawn) -> Figure:
    """The figure with trunk and head bent, turned and leaned."""
    chest = [act.number("chest", name) for name in ("bend", "turn", "lean")]
    head = [act.number("head", name) for name in ("nod", "turn", "tilt")]
    turned = {}
    # each bone of the spine and of the neck turns by its share
    for degrees, shares in ((chest, SPINE_SHARES), (head, HEAD_SHARES)):
        for bone, share in shares.items():
            turn = turn_of(*(share * angle for angle in degrees))
            turned[bone] = product(turn, figure.local[:, BONES.index(bone)])
    # collar bones rise on both sides
    up = np.radians(act.number("shoulders", "up"))
    for side, sign in zip(LEFT_RIGHT, (1, -1), strict=True):
        bone = sided(side, "Shoulder")
        turned[bone] = product(axis_to_rotmat("z", sign * up), figure.local[:, BONES.index(bone)])
    return figure.with_local(turned)
