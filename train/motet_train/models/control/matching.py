"""A figure that is steered by motion matching: recorded poses in few codes, and the step that plays and bends them.

See :mod:`motet.decode.matching`, whose letters are used here; P = 4 J + 1 are the numbers of a pose.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional

from motet.bundle.graph import GraphSpec, TensorSpec
from motet_train.models.codes.sixd_places import SixdPlaces, Tree
from motet_train.models.net import Net, Part, tuples

FINE = 16.0
"""Steps of a feature in 8 bits, for each of its standard deviations."""


Speeds = tuple[float, float, float, float, float]
"""Of a gait in m/s: the slowest, the usual one, and the fastest forward, sideways and backwards; 0 where it does not go
that way."""


@dataclass(frozen=True)
class Steering:
    """How the step bends what is played. dt: seconds of a tick.

    velocity, facing, blend: half-lives in seconds of the springs of velocity and facing, and of what a jump leaves.
    turn: half-life of the error of the facing; turning: radians a second by which it is turned at most, where nothing
    moves, for each m/s, and for each rad/s of the recording. veer: radians by which the direction of travel is bent at
    most. rates: between which a recording is played slower or faster; strides: between which its steps are then made
    shorter or longer. idle: m/s, slower than which it is played as it is.
    """

    dt: float = 1 / 30
    velocity: float = 0.22
    facing: float = 0.18
    blend: float = 0.13
    turn: float = 0.15
    turning: tuple[float, float, float] = (0.1, 1.0, 0.5)
    veer: float = 0.35
    rates: tuple[float, float] = (0.8, 1.15)
    strides: tuple[float, float] = (0.8, 1.25)
    idle: float = 0.4


@dataclass(frozen=True)
class MatchingConfig:
    """rows: N. even, odd: codes of a pose that a mirror image has alike, and with the other sign. gaits: their names.

    speeds: of each gait. mean, scale: of the features. every: ticks between searches.
    """

    channels: int
    tree: Tree = field(default_factory=Tree)
    rows: int = 1
    even: int = 20
    odd: int = 16
    gaits: tuple[str, ...] = ()
    speeds: tuple[Speeds, ...] = ()
    mean: tuple[float, ...] = ()
    scale: tuple[float, ...] = ()
    every: int = 6
    steering: Steering = field(default_factory=Steering)


class Matching(Net):
    """The table and the step. What is trained: codes (N, K), and the poses that they stand for."""

    middle: Tensor
    rest: Tensor
    features: Tensor
    shown: Tensor
    left: Tensor
    signs: Tensor
    inverse: Tensor
    springs: Tensor
    quarter: Tensor

    def __init__(self, config: MatchingConfig) -> None:
        super().__init__(config.channels)
        self.config = config
        codes, poses = config.even + config.odd, 4 * len(config.tree.bones) + 1
        self.codes = nn.Parameter(torch.zeros(config.rows, codes))
        self.basis = nn.Parameter(torch.zeros(codes, poses))
        self.register_buffer("middle", torch.zeros(poses))
        # before training it is one recording of standing that shows all gaits, so that its speed can be measured
        self.register_buffer("rest", torch.tensor([0.0, 0.0, 0.0, 0.0, 1.0, 1.0]).repeat(config.rows, 1))
        self.register_buffer("features", torch.zeros(config.rows, len(config.mean), dtype=torch.int8))
        self.register_buffer("shown", torch.ones(config.rows, len(config.gaits)))
        self.register_buffer("left", torch.arange(config.rows).flip(0))
        signs = torch.cat([torch.ones(config.even), -torch.ones(config.odd), torch.tensor([1.0, -1.0, -1.0, 1.0])])
        self.register_buffer("signs", signs, persistent=False)
        self.register_buffer("inverse", torch.zeros(poses, codes), persistent=False)
        self.register_buffer("springs", _springs_of(config.steering), persistent=False)
        self.register_buffer("quarter", torch.tensor([[0.0, -1.0], [1.0, 0.0]]), persistent=False)
        self.places = SixdPlaces(config.tree)

    def values(self, codes: Tensor) -> Tensor:
        """Codes (..., K) to the numbers (..., P) of a pose: quaternions of any length, and the hips' height."""
        return self.middle + codes @ self.basis

    def poses(self, codes: Tensor) -> tuple[Tensor, Tensor]:
        """Codes (..., K) to unit quaternions (..., J, 4) of the bones and the hips' height (..., 1)."""
        values = self.values(codes)
        quats = values[..., :-1].reshape(*values.shape[:-1], -1, 4)
        return functional.normalize(quats, dim=-1), values[..., -1:]

    def encode(self, rotations: Tensor, height: Tensor) -> Tensor:
        """The codes (B, K) that stand for poses as :meth:`poses` gives them, as near as they can."""
        mean = self.middle[:-1].reshape(-1, 4)
        nearer = torch.where((rotations * mean).sum(dim=-1, keepdim=True) < 0, -rotations, rotations)
        values = torch.cat([nearer.flatten(1), height], dim=1)
        return (values - self.middle) @ self.inverse

    def points(self, quats: Tensor, height: Tensor) -> Tensor:
        """Places (..., J', 3) of all joints in metres, seen from the facing, of poses as :meth:`poses` gives them."""
        found = self.places(quat_to_sixd(quats).flatten(-2))
        return torch.cat([found[..., :1], found[..., 1:2] + height[..., None], found[..., 2:]], dim=-1)

    def table(self, row: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Rows (B,) to frames (B, K + 6), features (B, F), gaits (B, G) and the rows left (B,)."""
        frames = torch.cat([self.codes[row], self.rest[row]], dim=1)
        return frames, self.features[row].float() / FINE, self.shown[row], self.left[row]

    def step(
        self, recorded: Tensor, at: Tensor, control: Tensor, root: Tensor, course: Tensor, bend: Tensor
    ) -> tuple[Tensor, ...]:
        """One tick. recorded: (B, 2, K + 6) of a row and the one after it. at: (B, 2) the part of the way between them,
        and -1 for the mirror image. control: (B, 3) velocity x, z and facing that are asked for. States: root (B, 4) x,
        z, facing, and how fast it is played; course (B, 6) velocity, acceleration, facing and its speed, of the
        springs; bend (B, 2 K) what jumps have left, and its speed.

        Gives rotations (B, J, 4) in (x, y, z, w), height (B, 1), contacts (B, 2) of the left and right foot, and the
        next states.
        """
        how, count = self.config.steering, self.codes.shape[1]
        part, side = torch.split(at, 1, dim=1)
        place, facing, rate = torch.split(root, [2, 1, 1], dim=1)
        right = side < 0
        here, there = recorded[:, 0], recorded[:, 1]
        now, contacts = torch.split(here + part * (there - here), [count + 4, 2], dim=1)
        codes, moves, speed = torch.split(now * torch.where(right, self.signs, 1.0), [count, 3, 1], dim=1)
        contacts = torch.where(right, contacts.flip(1), contacts)
        course = self._springs(control, course)
        velocity = course[:, :2]
        pace = velocity.norm(dim=1, keepdim=True)
        moving = torch.minimum(speed, pace) > how.idle
        ratio = pace / speed.clamp_min(how.idle)
        stride = torch.where(moving, (ratio / rate).clamp(*how.strides), 1.0)
        steps, turn = torch.split(moves * (rate * how.dt), [2, 1], dim=1)
        error = _wrapped(course[:, 4:5] - facing)
        turned = _wrapped(facing + turn + self._turned(error, pace, turn))
        steps = self._veered(_in_world(steps * stride, facing), velocity, moving)
        root = torch.cat([place + steps, turned, torch.where(moving, ratio.clamp(*how.rates), 1.0)], dim=1)
        offset, drift = torch.split(bend, count, dim=1)
        offset, drift = _spring(offset, drift, how.blend, how.dt)
        rotations, height = self.poses(codes + offset)
        return rotations, height, contacts, root, course, torch.cat([offset, drift], dim=1)

    def _springs(self, control: Tensor, course: Tensor) -> Tensor:
        """The springs of velocity and facing a tick later: all of it is linear but for whole turns."""
        turns = torch.round((course[:, 4:5] - control[:, 2:]) / (2 * math.pi))
        return torch.cat([course, control, turns], dim=1) @ self.springs

    def _turned(self, error: Tensor, pace: Tensor, turn: Tensor) -> Tensor:
        """By how much (B, 1) the facing is turned towards what is asked for, in one tick."""
        how = self.config.steering
        still, by_pace, by_turn = how.turning
        most = still * how.dt + by_pace * how.dt * pace.clamp_max(1.5) + by_turn * turn.abs()
        return torch.maximum(torch.minimum(error * (1 - 0.5 ** (how.dt / how.turn)), most), -most)

    def _veered(self, steps: Tensor, velocity: Tensor, moving: Tensor) -> Tensor:
        """Steps (B, 2) turned towards a velocity (B, 2) by a small angle, where they do not go apart."""
        veer = self.config.steering.veer
        across = steps @ self.quarter
        dot, cross = (steps * velocity).sum(dim=1, keepdim=True), (across * velocity).sum(dim=1, keepdim=True)
        along = moving & (dot > 0.4 * cross.abs())
        angle = torch.atan(cross / dot.clamp_min(1e-6)).clamp(-veer, veer)
        return steps + torch.where(along, angle, 0.0) * across

    def graphs(self) -> dict[str, tuple[nn.Module, GraphSpec]]:
        """Poses to codes and back, the table, and the step with its states.

        Nothing here asks for "pose": it tells a program that has no ONNX Runtime what codes stand for.
        """
        self.inverse.copy_(torch.linalg.pinv(self.basis.detach()))
        codes, bones = self.codes.shape[1], len(self.config.tree.bones)
        row = TensorSpec("row", ("batch",), "int64")
        outputs = (
            TensorSpec("frames", ("batch", codes + 6)),
            TensorSpec("features", ("batch", len(self.config.mean))),
            TensorSpec("gaits", ("batch", len(self.config.gaits))),
            TensorSpec("left", ("batch",), "int64"),
        )
        states = {"root": 4, "course": 6, "bend": 2 * codes}
        given = {"at": 2, "control": 3, **states}
        inputs = tuple(TensorSpec(name, ("batch", size)) for name, size in given.items())
        inputs = (TensorSpec("recorded", ("batch", 2, codes + 6)), *inputs)
        pose = (TensorSpec("rotations", ("batch", bones, 4)), TensorSpec("height", ("batch", 1)))
        after = tuple(TensorSpec(f"next_{name}", ("batch", size)) for name, size in states.items())
        stepped = GraphSpec(
            inputs, (*pose, TensorSpec("contacts", ("batch", 2)), *after), {name: f"next_{name}" for name in states}
        )
        coded = TensorSpec("codes", ("batch", codes))
        return {
            "encoder": (Part(self, self.encode), GraphSpec(pose, (coded,))),
            "pose": (Part(self, self.values), GraphSpec((coded,), (TensorSpec("values", ("batch", 4 * bones + 1)),))),
            "rows": (Part(self, self.table), GraphSpec((row,), outputs)),
            "step": (Part(self, self.step), stepped),
        }


def _spring(off: Tensor, speed: Tensor, half: float, dt: float) -> tuple[Tensor, Tensor]:
    """What is left (B, ...) after a tick of a distance and its speed, by a critically damped spring of a half-life."""
    damping = 2 * math.log(2) / half
    rest, left = speed + off * damping, math.exp(-damping * dt)
    return left * (off + rest * dt), left * (speed - rest * damping * dt)


def _springs_of(how: Steering) -> Tensor:
    """The matrix (10, 6) of a tick of the springs: velocity, acceleration, facing, its speed, what is asked for, and
    whole turns, to the first six of them."""
    unit = torch.eye(10)
    velocity, change, wanted = unit[:, :2], unit[:, 2:4], unit[:, 6:8]
    facing, speed, asked = unit[:, 4:5] - 2 * math.pi * unit[:, 9:], unit[:, 5:6], unit[:, 8:9]
    off, change = _spring(velocity - wanted, change, how.velocity, how.dt)
    turned, speed = _spring(facing - asked, speed, how.facing, how.dt)
    return torch.cat([wanted + off, change, asked + turned, speed], dim=1)


def _in_world(velocity: Tensor, facing: Tensor) -> Tensor:
    """Forward and left (B, 2) to x and z (B, 2)."""
    cos, sin = torch.cos(facing), torch.sin(facing)
    forward, left = velocity[:, :1], velocity[:, 1:]
    return torch.cat([sin * forward + cos * left, cos * forward - sin * left], dim=1)


def _wrapped(angle: Tensor) -> Tensor:
    return angle - 2 * math.pi * torch.round(angle / (2 * math.pi))


def quat_to_sixd(quats: Tensor) -> Tensor:
    """Unit quaternions (..., 4) in (x, y, z, w) to the x and y axes (..., 6) of their frames."""
    x, y, z, w = quats.unbind(dim=-1)
    axis_x = [1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)]
    axis_y = [2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)]
    return torch.stack(axis_x + axis_y, dim=-1)


def from_config(config: Mapping[str, Any]) -> Matching:
    """An untrained net of a configuration as it stands in a manifest."""
    found = {name: tuples(value) for name, value in config.items() if name not in ("tree", "steering")}
    tree = Tree(**{name: tuples(value) for name, value in config["tree"].items()})
    steering = Steering(**{name: tuples(value) for name, value in config["steering"].items()})
    return Matching(MatchingConfig(**found, tree=tree, steering=steering))
