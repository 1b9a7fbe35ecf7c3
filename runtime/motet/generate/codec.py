"""Codes of frames, and frames of codes as they come: as many as the decoder can give before it knows what follows.

A pose on the ground is (..., 3): x and z in metres, and the facing in radians about the vertical axis, 0 along z. A
move is (..., 3): forward and to the left in metres, and a turn to the left in radians, seen from the pose that it
starts from.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motet.bundle.graph import Graph
from motet.decode.loop import Ids
from motet.motion.rotations import Array
from motet.motion.springs import Inertializer

RADIAN_METRES = 0.5
"""Metres that count as much as a radian where moves are compared."""


def moved(pose: Array, move: Array) -> Array:
    """The poses (..., 3) that moves (..., 3) lead to."""
    sin = np.sin(pose[..., 2])
    cos = np.cos(pose[..., 2])
    x = pose[..., 0] + move[..., 0] * sin + move[..., 1] * cos
    z = pose[..., 1] + move[..., 0] * cos - move[..., 1] * sin
    poses: Array = np.stack([x, z, pose[..., 2] + move[..., 2]], axis=-1)
    return poses


def seen_from(pose: Array, other: Array) -> Array:
    """The moves (..., 3) that lead from poses (..., 3) to others: :func:`moved` undone. Turns are not wrapped."""
    sin = np.sin(pose[..., 2])
    cos = np.cos(pose[..., 2])
    x = other[..., 0] - pose[..., 0]
    z = other[..., 1] - pose[..., 1]
    moves: Array = np.stack([x * sin + z * cos, x * cos - z * sin, other[..., 2] - pose[..., 2]], axis=-1)
    return moves


def way_of(start: Array, moves: Array) -> Array:
    """The poses (..., N + 1, 3) on the way from ``start`` (..., 3) by moves (..., N, 3), both ends included."""
    # Facings first, as each move is made from one; then the places, adding up in the order of single moves.
    facing = np.cumsum(np.concatenate([start[..., None, 2], moves[..., 2]], axis=-1), axis=-1)
    sin = np.sin(facing[..., :-1])
    cos = np.cos(facing[..., :-1])
    forward = moves[..., 0]
    left = moves[..., 1]
    x = _added_in_turn(start[..., None, 0], forward * sin, left * cos)
    z = _added_in_turn(start[..., None, 1], forward * cos, -left * sin)
    return np.stack([x, z, facing], axis=-1)


def _added_in_turn(start: Array, first: Array, second: Array) -> Array:
    """The sums (..., N + 1) of a start (..., 1) and two terms (..., N) a step, the first before the second."""
    terms = np.stack([first, second], axis=-1).reshape(*first.shape[:-1], -1)
    sums: Array = np.cumsum(np.concatenate([start, terms], axis=-1), axis=-1)[..., ::2]
    return sums


def nearest_moves(poses: Array, book: Array) -> tuple[NDArray[np.int64], Array]:
    """Entries (..., N) int64 of a book (K, 3), and the way (..., N + 1, 3) they lead, along poses (..., N + 1, 3).

    The way starts at the first pose; each entry is the one that leads nearest to the next pose from where the way is.
    """
    scale = np.array([1.0, 1.0, RADIAN_METRES])
    way = [poses[..., 0, :]]
    entries = []
    for place in range(1, poses.shape[-2]):
        wanted = seen_from(way[-1], poses[..., place, :])
        off = ((wanted[..., None, :] - book) * scale) ** 2
        entry = off.sum(axis=-1).argmin(axis=-1)
        entries.append(entry)
        way.append(moved(way[-1], book[entry]))
    return np.stack(entries, axis=-1), np.stack(way, axis=-2)


PATH_CHANNELS = 3
"""Of the decoder's channels the first: the root's forward, left and turn, seen from where the moves have led."""


class ReceptiveField(NamedTuple):
    """Steps of codes the decoder looks back and ahead, and frames in a step."""

    back: int
    ahead: int
    hop: int


class Context(NamedTuple):
    """The end of the motion to continue: frames (G, D) in the contract's units, and their steps of codes (N, P)."""

    frames: Array
    codes: Ids


@dataclass(frozen=True, eq=False)
class Codec:
    """The graphs "decoder" and "tokens" of a model that writes codes, and how many moves of the root its codes have."""

    decoder: Graph
    tokens: Graph
    field: ReceptiveField
    moves: int
    fps: float
    half_life: float
    """Seconds of the spring by which decoded frames continue a motion."""

    @property
    def seconds(self) -> float:
        """Of a step."""
        return self.field.hop / self.fps

    @cached_property
    def book(self) -> Array:
        """The moves (K, 3) that codes stand for: metres forward and to the left, and radians to the left."""
        codes = np.zeros((2, self.moves, self.decoder.spec.input("codes").size(-1)), dtype=np.int64)
        codes[..., 0] = np.arange(self.moves)
        moves: Array = self.decoder({"codes": codes})["moves"][0].astype(np.float64)
        return moves

    def steps(self, seconds: float) -> int:
        """The number of steps that cover a duration, ignoring rounding errors."""
        return math.ceil(seconds * self.fps / self.field.hop - 1e-9)

    def codes_of(self, frames: Array) -> Ids:
        """Steps of codes (N, P) int64 of frames (T, D) in the contract's units; T is a multiple of a step's frames."""
        steps = frames.reshape(-1, self.field.hop, frames.shape[1]).astype(np.float32)
        body = self.tokens({"frames": np.stack([steps, steps])})["codes"][0]
        poses = way_of(
            np.zeros(PATH_CHANNELS), np.concatenate([frames[:, :PATH_CHANNELS], frames[-1:, :PATH_CHANNELS]]) / self.fps
        )[1:]
        moves, _ = nearest_moves(poses[:: self.field.hop], self.book)
        return np.concatenate([moves[:, None], body], axis=1)

    def decoded(self, codes: Ids) -> tuple[Array, Array]:
        """What the decoder makes of steps (N, P): frames (N, hop, D) with the root seen from the way; moves (N, 3)."""
        # a lone step is rounded differently, so it comes twice
        outputs = self.decoder({"codes": np.repeat(codes[None], 2 if len(codes) == 1 else 1, axis=0)})
        return outputs["frames"][0].astype(np.float64), outputs["moves"][0].astype(np.float64)

    def frames_of(self, codes: Ids) -> Array:
        """Frames (T, D) in the contract's units of steps of codes (N, P), from the origin."""
        decoder = StreamingDecoder(self)
        return np.concatenate([decoder.push(codes), decoder.finish()])


class Inertialization:
    """Lets decoded frames continue a motion: its last frames (2, D) differ from the decoded ones in their place by a
    jump, which becomes an offset of the frames that follow.

    The offset fades by a critically damped spring, so that neither poses nor velocities leap (Bollo 2016). That of the
    root's rates is a speed already, and its own rate of change is left out.
    """

    def __init__(self, last_frames: Array, decoded: Array, fps: float, half_life: float) -> None:
        self.seconds = 1 / fps
        self.inertializer = Inertializer(half_life)
        offset_before, self.offset = last_frames - decoded
        self.offset_rate = (self.offset - offset_before) * fps
        self.offset_rate[:PATH_CHANNELS] = 0

    def __call__(self, frames: Array) -> Array:
        """The next frames (T, D), with the offset."""
        joined = np.array(frames)
        for place in range(len(joined)):
            self.offset, self.offset_rate = self.inertializer.update(self.offset, self.offset_rate, self.seconds)
            joined[place] += self.offset
        return joined


class StreamingDecoder:
    """Frames (T, D) of steps of codes (N, P) that are pushed as they come; holds all state of one request.

    The root's forward, left and turn come as rates a second, from each frame to the next, so that adding them up gives
    the way. context: the end of a motion, which the frames continue without a leap.
    """

    def __init__(self, codec: Codec, context: Context | None = None) -> None:
        self.codec = codec
        self.codes = [] if context is None else list(context.codes)
        self.last_frames = None if context is None else context.frames[-2:]  # of the motion to be joined
        self.count = max(0, len(self.codes) - 1)  # steps whose frames are out; the context's last is joined
        self.way = np.zeros((1, 3))
        self.pose = np.zeros((0, PATH_CHANNELS))
        self.join: Inertialization | None = None

    def push(self, steps: Ids) -> Array:
        """Frames (T, D) that further steps settle; none at first."""
        self.codes += list(steps)
        frames = self._settled(len(self.codes) - self.codec.field.ahead)
        over = max(0, self.count - self.codec.field.back)  # out of sight
        self.codes = self.codes[over:]
        self.count -= over
        return frames

    def finish(self) -> Array:
        """The remaining frames, with nothing to follow."""
        return self._settled(len(self.codes))

    def _settled(self, until: int) -> Array:
        """The frames of steps up to one, which nothing that follows changes any more."""
        if until <= self.count:
            return np.empty((0, self.codec.decoder.spec.output("frames").size(-1)))
        # The steps, and those that the decoder looks back and ahead at.
        field = self.codec.field
        start = max(0, self.count - field.back)
        frames, moves = self.codec.decoded(np.array(self.codes[start : until + field.ahead]))
        new = slice(self.count - start, until - start)
        self.count = until
        # The root, which the decoder gives as seen from the way, as rates.
        frames = frames[new]
        rates = self._rates(moves[new], frames[..., :PATH_CHANNELS])
        body = frames.reshape(len(rates), -1)[:, PATH_CHANNELS:]
        return self._joined(np.concatenate([rates, body], axis=1))

    def _joined(self, frames: Array) -> Array:
        """Decoded frames (T, D), joined to the motion that they continue."""
        if self.last_frames is not None:
            # The first step is the motion's last one: the offset between the two fades from the frames after it.
            hop = self.codec.field.hop
            self.join = Inertialization(self.last_frames, frames[hop - 2 : hop], self.codec.fps, self.codec.half_life)
            self.last_frames = None
            frames = frames[hop:]
        return frames if self.join is None else self.join(frames)

    def _rates(self, moves: Array, root: Array) -> Array:
        """The root's rates (T, 3) a second in frames (N, T / N, 3) seen from the way by moves (N, 3)."""
        way = way_of(self.way[-1], moves)
        self.way = way[-1:]
        poses = moved(way[:-1, None], root).reshape(-1, PATH_CHANNELS)
        earlier = self.pose if len(self.pose) else poses[:1]
        rates = seen_from(np.concatenate([earlier, poses[:-1]]), poses) * self.codec.fps
        if not len(self.pose):
            rates[:1] = rates[1:2]
        self.pose = poses[-1:]
        return rates
