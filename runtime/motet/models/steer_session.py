"""A session of steered figures: commands in, a pose per tick out."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from motet.decode.matching import Playback, Rows
from motet.decode.steering import tick
from motet.errors import ControlError, ControlWarning, warn
from motet.models.steer_command import Command
from motet.models.steer_script import Order, parse_orders
from motet.motion.feet.lock import FootLock, FootLockSettings
from motet.motion.humanoid import BONES
from motet.motion.motion import Motion
from motet.motion.pose import Pose
from motet.motion.rotations import Array, quat_to_rotmat, wrapped

if TYPE_CHECKING:
    from motet.models.steer import SteerModel

LARGEST = 1e6
"""Largest number of a command: metres, m/s, degrees."""


@dataclass(frozen=True, eq=False, repr=False)
class SteerSnapshot:
    """The whole state of a session."""

    playback: Playback
    command: Command
    lock: FootLock | None
    poses: tuple[Pose, Pose] | None
    ahead: float

    def __repr__(self) -> str:
        return f"SteerSnapshot({len(self.command.gait)} characters)"


class SteerSession:
    """Characters that move in one batch, each steered separately; holds their whole state.

    A tick is 1 / ``model.fps`` seconds. Angles are degrees about the vertical: 0 along z, positive to the left.
    """

    def __init__(self, model: "SteerModel", playback: Playback, gait: int, hold_feet: bool, strict: bool) -> None:
        self.model, self.characters, self.strict = model, len(playback.row), strict
        self._playback = playback
        self._command = Command.standing(self.characters, gait)
        self._target = np.zeros((self.characters, 3))
        self._lock = self._new_lock() if hold_feet else None
        self._poses: tuple[Pose, Pose] | None = None
        self._ahead = 0.0
        self._said: set[str] = set()

    def _new_lock(self) -> FootLock:
        return FootLock(self.characters, 1 / self.model.fps, self.model.settings(FootLockSettings))

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
        """Set where the characters go from now on, a number for all or one for each; values not given stay.

        gait: one of ``model.gaits``. speed: m/s. direction: of travel, in degrees. facing: in degrees; if only the
        direction is given, they face it. velocity: (2,) or (characters, 2) along x and z in m/s, for example from a
        gamepad's stick, instead of speed and direction; (0, 0) stops, facing as before.
        A speed outside the gait's range is clamped with one warning (ControlWarning), or refused if the session is
        strict; a gait that only goes forward faces the way it goes. ControlError for values that are not numbers or do
        not fit; the control is unchanged then.
        """
        given = {"speed": speed, "direction": direction, "facing": facing}
        numbers = {name: self._numbers(name, values) for name, values in given.items() if values is not None}
        numbers |= {name: np.radians(numbers[name]) for name in ("direction", "facing") if name in numbers}
        kinds = None if gait is None else self._gaits(gait)
        if velocity is None:
            self._tell(self._command.told(kinds, **numbers))
            return
        if speed is not None or direction is not None:
            raise ControlError("give a velocity, or speed and direction, not both")
        self._tell(self._command.steered(self._rows("a velocity needs x and z", velocity, 2), kinds, **numbers))

    @property
    def target(self) -> Array:
        """The characters' targets (characters, 3), within their gaits' limits: velocity along x and z, m/s, and facing,
        radians."""
        return self._target.copy()

    def _tell(self, command: Command) -> None:
        target, beyond = command.target(self.model.abilities)
        for gait, said in beyond:
            if self.strict:
                raise ControlError(said)
            if gait not in self._said:
                self._said.add(gait)
                warn(said, ControlWarning)
        changed = (np.abs(target - self._target).max(axis=1) > 1e-4) | (command.gait != self._command.gait)
        self._playback.ticks_to_search[changed] = 0  # what is told is searched for at once
        self._target, self._command = target, command

    def _numbers(self, name: str, values: ArrayLike) -> Array:
        try:
            found = np.array(np.broadcast_to(np.asarray(values, dtype=np.float64), (self.characters,)))
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
        return np.array([self.model.abilities.number(name) for name in each])

    def tick(self) -> Pose:
        """The next pose of all characters, 1 / ``model.fps`` seconds later."""
        return self.tick_to(self._target)

    def tick_to(self, target: Array) -> Pose:
        """A tick with a raw target (characters, 3): velocity along x and z in m/s, facing in radians; not checked."""
        model = self.model
        pose = tick(model.matcher, model.pose_codes, self._playback, target, self._command.gait)
        return pose if self._lock is None else self._lock.held(pose)

    def advance(self, seconds: float) -> Pose:
        """The pose ``seconds`` later, for a display of any frame rate: interpolated between two ticks.

        A command shows within a tick. ControlError unless 0 <= seconds <= 1.
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
        """Push the characters by a velocity (2,) or (characters, 2) along x and z, m/s, from which they recover."""
        pushed = self._rows("a velocity needs x and z", velocity, 2)
        self._playback.spring[:, :2] += pushed
        self._playback.ticks_to_search[:] = 0

    def put(self, places: ArrayLike) -> None:
        """Place the characters elsewhere: (3,) or (characters, 3) x and z in metres, facing in degrees."""
        wanted = self._rows("places need x, z and facing", places, 3)
        wanted[:, 2] = wrapped(np.radians(wanted[:, 2]))
        self._playback.root = wanted
        self._playback.spring[:, 2] = wanted[:, 2]
        self._command = self._command.put(wanted[:, 2])
        self._target, _ = self._command.target(self.model.abilities)
        self._poses = None  # nothing lies between there and here
        if self._lock is not None:
            self._lock = self._new_lock()

    def take(self, pose: Pose) -> None:
        """Continue from a changed pose: its rotations and height, one for all characters or one for each.

        Their positions and velocities stay. ControlError for a pose that does not fit.
        """
        if len(pose) not in (1, self.characters) or pose.rotations.shape[1:] != (len(BONES), 4):
            raise ControlError(f"a pose of {pose.rotations.shape} does not fit {self.characters} characters")
        if not (np.isfinite(pose.rotations).all() and np.isfinite(pose.height).all()):
            raise ControlError("a pose must be finite numbers")
        codes = self.model.pose_codes.encode(pose.rotations, pose.height)
        self.model.matcher.pose(self._playback, np.broadcast_to(codes, (self.characters, codes.shape[1])))

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
        told = self._command
        facing, speed = told.heading, told.speed
        aside = wrapped(np.where(told.faces_way, 0, told.direction - facing))
        if order.way is not None:
            aside = np.full(self.characters, np.radians(order.way))
        if order.speed is None:
            gait = told.gait if order.gait is None else self._gaits(order.gait)
            speed = self.model.abilities.speeds[gait, 1]
        elif order.speed >= 0:
            speed = np.full(self.characters, order.speed)
        degrees = np.degrees(facing) + order.turn
        self.control(gait=order.gait, speed=speed, direction=degrees + np.degrees(aside), facing=degrees)

    def frames_of(self, poses: Sequence[Pose]) -> Array:
        """Frames (characters, T, D) in the contract's units of consecutive poses."""
        ground = np.stack([pose.ground for pose in poses], axis=1)
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
        """The whole state, to be restored later."""
        lock = None if self._lock is None else replace(self._lock)  # its arrays are replaced, never written into
        return SteerSnapshot(self._playback.copy(), self._command, lock, self._poses, self._ahead)

    def restore(self, snapshot: SteerSnapshot) -> None:
        """Go back to a snapshot of this session or of one like it: the same model, as many characters, and the same
        ``hold_feet``; ControlError for another."""
        command = snapshot.command
        if len(command.gait) != self.characters:
            raise ControlError(f"a snapshot of {len(command.gait)} characters does not fit {self.characters}")
        if (snapshot.lock is None) != (self._lock is None):
            has, lacks = ("without", "with") if snapshot.lock is None else ("with", "without")
            raise ControlError(f"a snapshot {has} held feet does not fit a session {lacks} them (hold_feet)")
        self._playback, self._poses, self._ahead = snapshot.playback.copy(), snapshot.poses, snapshot.ahead
        self._command, (self._target, _) = command, command.target(self.model.abilities)
        self._lock = None if snapshot.lock is None else replace(snapshot.lock)


def _check_size(name: str, values: Array) -> None:
    """ControlError for numbers that are not finite or too large."""
    if not (np.abs(values) <= LARGEST).all():
        raise ControlError(f"{name} must be finite numbers, no larger than {LARGEST:g}")
