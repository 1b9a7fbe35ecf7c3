"""A session of figures that are steered: told where to go, they give a pose a tick."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from motet.arguments import warn
from motet.bundle.graph import Floats
from motet.decode.matching import Playing, Rows, tick
from motet.errors import ControlError, ControlWarning
from motet.models.steer_script import Order, parse_orders
from motet.motion.feet.lock import FootLock
from motet.motion.motion import Motion
from motet.motion.pose import Pose
from motet.motion.quaternions import wrapped
from motet.motion.rotations import Array, quat_to_rotmat

if TYPE_CHECKING:
    from motet.models.steer import SteerModel

LARGEST = 1e6
"""Of numbers that a session is told: metres, m/s, degrees."""

SECTORS = np.radians([60.0, 120.0])
"""Angles from the facing at which going forward ends, and going backwards begins."""

FORWARD = np.radians(30.0)
"""How far from its facing a gait goes that goes neither sideways nor backwards."""


@dataclass(frozen=True, eq=False, repr=False)
class SteerSnapshot:
    """All that changes in a session."""

    playing: Playing
    control: Floats
    gait: Rows
    lock: FootLock | None
    poses: tuple[Pose, Pose] | None
    ahead: float

    def __repr__(self) -> str:
        return f"SteerSnapshot({len(self.gait)} characters)"


class SteerSession:
    """Characters that move in one batch, each steered by itself; holds their whole state.

    A tick is 1 / ``model.fps`` seconds. Angles are degrees about the vertical: 0 along z, positive to the left.
    """

    def __init__(self, model: "SteerModel", playing: Playing, gait: str, hold_feet: bool, strict: bool) -> None:
        self.model, self.characters, self.strict = model, len(playing.row), strict
        self._playing = playing
        self._gait = np.full(self.characters, model.gait(gait))
        self._control = np.zeros((self.characters, 3), dtype=np.float32)
        self._lock = FootLock(self.characters, 1 / model.fps) if hold_feet else None
        self._poses: tuple[Pose, Pose] | None = None
        self._ahead = 0.0
        self._said: set[str] = set()

    def __repr__(self) -> str:
        return f"SteerSession({self.characters} characters, {self.model!r})"

    def control(
        self,
        *,
        gait: str | Sequence[str] | None = None,
        speed: ArrayLike | None = None,
        direction: ArrayLike | None = None,
        facing: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
    ) -> None:
        """Tell the characters where to go from now on, each a number for all or one for each; what is not named stays.

        gait: one of ``model.gaits``. speed: m/s. direction: of travel, in degrees. facing: in degrees; where only the
        direction is given, they face it. velocity: (2,) or (characters, 2) along x and z in m/s, such as a stick of a
        gamepad gives, instead of speed and direction; (0, 0) stops, facing as before.
        A speed that the gait does not have is brought into its range and said once (ControlWarning), or refused where
        the session is strict; a gait that only goes forward faces where it goes. ControlError for what is no number or
        does not fit; the control is then as it was.
        """
        kinds = self._gait if gait is None else self._gaits(gait)
        wanted = np.array(self._control, dtype=np.float64)
        pace, way = np.hypot(wanted[:, 0], wanted[:, 1]), np.arctan2(wanted[:, 0], wanted[:, 1])
        if velocity is not None:
            if speed is not None or direction is not None:
                raise ControlError("a velocity stands for speed and direction: give it or them")
            pace, way = self._of_velocity(velocity, way)
        still = pace < 1e-6
        way = np.where(still, wanted[:, 2], way) if velocity is None else way
        pace = pace if speed is None else self._numbers("speed", speed)
        way = way if direction is None else np.radians(self._numbers("direction", direction))
        if facing is not None:
            wanted[:, 2] = np.radians(self._numbers("facing", facing))
        elif direction is not None or velocity is not None:
            wanted[:, 2] = np.where(pace > 0, way, wanted[:, 2])
        wanted[:, 2] = self._faced(way, wanted[:, 2], kinds)
        pace = self._in_range(pace, way - wanted[:, 2], kinds)
        wanted[:, 0], wanted[:, 1] = pace * np.sin(way), pace * np.cos(way)
        self._set(wanted, kinds)

    @property
    def told(self) -> Floats:
        """What the characters were told (characters, 3), within what their gaits can do: velocity along x and z, m/s,
        and facing, radians."""
        return self._control.copy()

    def _set(self, control: Array, gait: Rows) -> None:
        control[:, 2] = wrapped(control[:, 2])
        changed = (np.abs(control - self._control).max(axis=1) > 1e-4) | (gait != self._gait)
        self._playing.due[changed] = 0  # what is told is searched for at once
        self._control, self._gait = control.astype(np.float32), gait

    def _of_velocity(self, velocity: ArrayLike, way: Array) -> tuple[Array, Array]:
        x, z = self._rows("a velocity needs x and z", velocity, 2).T
        pace = np.hypot(x, z)
        return pace, np.where(pace > 0, np.arctan2(x, z), way)

    def _numbers(self, name: str, values: ArrayLike) -> Array:
        try:
            found = np.broadcast_to(np.asarray(values, dtype=np.float64), (self.characters,))
        except (TypeError, ValueError) as error:
            raise ControlError(f"{name} needs a number or one for each of {self.characters} characters") from error
        _check_size(name, found)
        return found

    def _rows(self, needed: str, values: ArrayLike, columns: int) -> Array:
        """Numbers (columns,) or (characters, columns) as a new (characters, columns)."""
        try:
            found = np.array(values, dtype=np.float64)
            if found.shape not in ((columns,), (self.characters, columns)):
                raise ValueError(found.shape)
        except (TypeError, ValueError) as error:
            raise ControlError(f"{needed}, for all or for each of {self.characters} characters") from error
        _check_size(needed.partition(" need")[0], found)
        return np.array(np.broadcast_to(found, (self.characters, columns)))

    def _gaits(self, names: str | Sequence[str]) -> Rows:
        each = list(names) if isinstance(names, Iterable) and not isinstance(names, str) else [names] * self.characters
        if len(each) != self.characters:
            raise ControlError(f"{len(each)} gaits do not fit {self.characters} characters")
        return np.array([self.model.gait(name) for name in each])

    def _faced(self, way: Array, facing: Array, gait: Rows) -> Array:
        """Facings from which gaits can go in a direction, in radians: not all go sideways and backwards."""
        farthest = np.where(self.model.fastest[gait, 1:].min(axis=1) > 0, np.pi, FORWARD)
        found: Array = way - np.clip(wrapped(way - facing), -farthest, farthest)
        return found

    def _in_range(self, pace: Array, aside: Array, gait: Rows) -> Array:
        """Speeds within what gaits have at an angle from the facing; standing still is always possible."""
        sector = np.digitize(np.abs(wrapped(aside)), SECTORS)
        fastest = self.model.fastest[gait, sector]
        inside = np.where(pace > 0, np.clip(pace, np.minimum(self.model.slowest[gait], fastest), fastest), 0.0)
        off = np.flatnonzero(np.abs(inside - pace) > 1e-6)
        if len(off):
            name = self.model.gaits[gait[off[0]]]
            low, high = self.model.slowest[gait[off[0]]], fastest[off[0]]
            said = f"{pace[off[0]]:g} m/s is out of what {name!r} can do that way: 0, or {low:g} to {high:g}"
            if self.strict:
                raise ControlError(said)
            if name not in self._said:
                self._said.add(name)
                warn(said, ControlWarning)
        return inside

    def tick(self) -> Pose:
        """The next pose of all characters, 1 / ``model.fps`` seconds later."""
        return self.tick_to(self._control)

    def tick_to(self, control: Floats) -> Pose:
        """A tick with raw control (characters, 3): velocity along x and z in m/s, facing in radians; not checked."""
        found = tick(self.model.graphs["step"], self.model.matcher, self._playing, control, self._gait)
        pose = Pose(self._playing.states["root"][:, :3], found["rotations"], found["height"][:, 0], found["contacts"])
        return pose if self._lock is None else self._lock.held(pose)

    def advance(self, seconds: float) -> Pose:
        """The pose ``seconds`` later, for a display of any frame rate: between two ticks, of which the later is known.

        What is told shows within a tick. ControlError for a time that is not between 0 and 1 s.
        """
        if not 0 <= seconds <= 1:
            raise ControlError(f"a session advances by 0 to 1 s, not {seconds}")
        if self._poses is None:
            first = self.tick()
            self._poses = first, self.tick()
        self._ahead += seconds * self.model.fps
        while self._ahead >= 1:
            self._poses = self._poses[1], self.tick()
            self._ahead -= 1
        return self._poses[0].towards(self._poses[1], self._ahead)

    def push(self, velocity: ArrayLike) -> None:
        """Push the characters by a velocity (2,) or (characters, 2) along x and z, m/s, which they catch."""
        pace, way = self._of_velocity(velocity, np.zeros(self.characters))
        self._playing.states["course"][:, :2] += np.stack([pace * np.sin(way), pace * np.cos(way)], axis=1)
        self._playing.due[:] = 0

    def put(self, places: ArrayLike) -> None:
        """Set the characters down elsewhere: (3,) or (characters, 3) x and z in metres, facing in degrees."""
        wanted = self._rows("places need x, z and facing", places, 3)
        wanted[:, 2] = wrapped(np.radians(wanted[:, 2]))
        root = self._playing.states["root"].copy()  # the last pose shows the array itself
        root[:, :3] = wanted
        self._playing.states["root"] = root
        self._playing.states["course"][:, 4] = wanted[:, 2]
        self._poses = None  # nothing lies between there and here
        self._control[:, 2] = wanted[:, 2]
        if self._lock is not None:
            self._lock = FootLock(self.characters, 1 / self.model.fps)

    def take(self, pose: Pose) -> None:
        """Let the characters go on from a changed pose: its rotations and height, one for all or one for each.

        Where they are and how fast they go stays. ControlError for a pose that does not fit.
        """
        if len(pose) not in (1, self.characters) or pose.rotations.shape[1:] != (self.model.sizes["J"], 4):
            raise ControlError(f"a pose of {pose.rotations.shape} does not fit {self.characters} characters")
        if not (np.isfinite(pose.rotations).all() and np.isfinite(pose.height).all()):
            raise ControlError("a pose must be of finite numbers")
        asked = {"rotations": pose.rotations.astype(np.float32), "height": pose.height.astype(np.float32)[:, None]}
        codes = self.model.graphs["encoder"](asked)["codes"]
        self.model.matcher.bend(self._playing, np.broadcast_to(codes, (self.characters, codes.shape[1])))

    def run(self, script: str) -> list[Motion]:
        """Run a script (:mod:`motet.models.steer_script`) for all characters; one motion for each."""
        poses = list(self.follow(parse_orders(script, self.model.gaits)))
        return [self.model.contract.motion(frames, plant=self._lock is not None) for frames in self.frames_of(poses)]

    def follow(self, orders: Sequence[Order]) -> Iterator[Pose]:
        """The poses of all characters that follow orders, tick by tick."""
        for order in orders:
            self._obey(order)
            for _ in range(max(1, round(order.seconds * self.model.fps))):
                yield self.tick()

    def _obey(self, order: Order) -> None:
        x, z, facing = np.array(self._control, dtype=np.float64).T
        pace = np.hypot(x, z)
        aside = np.where(pace < 1e-6, 0.0, wrapped(np.arctan2(x, z) - facing))
        if order.way is not None:
            aside = np.full(self.characters, np.radians(order.way))
        if order.speed is None:
            names = [self.model.gaits[gait] if order.gait is None else order.gait for gait in self._gait]
            pace = np.array([self.model.usual[name] for name in names])
        elif order.speed >= 0:
            pace = np.full(self.characters, order.speed)
        facing = np.degrees(facing) + order.turn
        self.control(gait=order.gait, speed=pace, direction=facing + np.degrees(aside), facing=facing)

    def frames_of(self, poses: Sequence[Pose]) -> Array:
        """Frames (characters, T, D) in the contract's units of poses that follow each other."""
        ground = np.stack([pose.ground for pose in poses], axis=1).astype(np.float64)
        steps = np.diff(ground, axis=1, prepend=ground[:, :1])
        facing = ground[..., 2] - wrapped(steps[..., 2])
        sin, cos = np.sin(facing), np.cos(facing)
        forward, left = sin * steps[..., 0] + cos * steps[..., 1], cos * steps[..., 0] - sin * steps[..., 1]
        block = np.stack([forward, left, wrapped(steps[..., 2])], axis=-1) * self.model.fps
        height = np.stack([pose.height for pose in poses], axis=1)[..., None]
        quats = np.stack([pose.rotations for pose in poses], axis=1).astype(np.float64)
        axes = np.swapaxes(quat_to_rotmat(quats)[..., :2], -1, -2).reshape(*height.shape[:2], -1)
        found: Array = np.concatenate([block, height, axes], axis=-1)
        return found

    def snapshot(self) -> SteerSnapshot:
        """All that changes, to come back to."""
        lock = None if self._lock is None else self._lock.copy()
        control, gait = self._control.copy(), self._gait.copy()
        return SteerSnapshot(self._playing.copy(), control, gait, lock, self._poses, self._ahead)

    def restore(self, snapshot: SteerSnapshot) -> None:
        """Go back to a snapshot, of this session or of one with as many characters of the same model."""
        if len(snapshot.gait) != self.characters:
            raise ControlError(f"a snapshot of {len(snapshot.gait)} characters does not fit {self.characters}")
        self._playing, self._poses, self._ahead = snapshot.playing.copy(), snapshot.poses, snapshot.ahead
        self._control, self._gait = snapshot.control.copy(), snapshot.gait.copy()
        self._lock = None if snapshot.lock is None else snapshot.lock.copy()


def _check_size(name: str, values: Array) -> None:
    """ControlError where numbers are not finite, or so large that float32 knows no centimetres."""
    if not (np.abs(values) <= LARGEST).all():
        raise ControlError(f"{name} must be of finite numbers, no larger than {LARGEST:g}")
