"""A session of steered figures: commands in, within what gaits allow, and a pose per tick out."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from motet.errors import ControlError, ControlWarning, needs, warn
from motet.figures.humanoid import BONES
from motet.models.control import LARGEST_CROWD
from motet.motion.motion import Motion, is_many
from motet.motion.rotations import Array, quat_to_rotmat, wrapped
from motet.settings import is_number
from motet.steering import crowd
from motet.steering.action_layer import ActionLayer
from motet.steering.acts import Act, ActSettings
from motet.steering.arrival import ArrivalSettings
from motet.steering.avoidance import AvoidanceSettings
from motet.steering.events import Event, Happenings
from motet.steering.foot_lock import FootLock, FootLockSettings
from motet.steering.gaits import Command
from motet.steering.idle import IdleLayer, IdleSettings
from motet.steering.look_layer import LookSettings
from motet.steering.matched import Matched, matched
from motet.steering.matching import Playback, Rows
from motet.steering.path_following import Ways, speed_of
from motet.steering.pose import Pose
from motet.steering.reach_layer import ReachSettings
from motet.steering.scripts import Order, parse_orders
from motet.steering.step import tick
from motet.steering.targets import CharacterIds, Guidance, Guided
from motet.text.clauses import Shown

if TYPE_CHECKING:
    from motet.steering.model import SteerModel
    from motet.steering.sentence_acts import SaidActs

Action = Motion | Act | str | None
"""What can be acted."""


@dataclass(frozen=True, eq=False, repr=False)
class SteerSnapshot:
    """The whole state of a session."""

    playback: Playback
    actions: ActionLayer
    idle: IdleLayer
    command: Command
    lock: FootLock | None
    poses: tuple[Pose, Pose] | None
    """The last two ticks, of a display with another frame rate."""
    ahead: float
    """How far the display is from the first to the second, in ticks."""
    guidance: Guidance
    happenings: Happenings
    late: tuple[Event, ...]
    """Events of a tick that was to be shown next when characters were put elsewhere."""

    def __repr__(self) -> str:
        return f"SteerSnapshot({len(self.command.gait)} characters)"


class SteerSession(Guided):
    """Characters that move in one batch, each steered separately; holds their whole state. A tick is 1 / ``model.fps``
    seconds. Angles are degrees about the vertical: 0 along z, positive to the left."""

    def __init__(
        self,
        model: "SteerModel",
        playback: Playback,
        gait: int,
        hold_feet: bool,
        strict: bool,
        words: "SaidActs | None",
    ) -> None:
        super().__init__(len(playback.row))
        zero = np.zeros(self.characters)
        self.model = model
        self.strict = strict
        self._words = words
        self._warned: set[str] = set()  # gaits whose limits a warning has named
        self._playback = playback
        self._command = Command(np.full(self.characters, gait), zero, zero, zero, zero > 0)
        self._target = np.zeros((self.characters, 3))
        self._actions = self._no_acts()
        self._idle = IdleLayer.none(self.characters)
        self._lock = self._new_lock() if hold_feet else None
        self._happenings = Happenings.none(self.characters)
        self._poses: tuple[Pose, Pose] | None = None
        self._ahead = 0.0
        self._late: tuple[Event, ...] = ()

    def _no_acts(self) -> ActionLayer:
        model = self.model
        return ActionLayer.of(self._playback, model.matcher, model.pose_codes, model.settings(ActSettings))

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
        numbers = self._command_numbers(speed, direction, facing)
        before = self._command
        gaits = None if gait is None else self._gaits(gait)
        if velocity is None:
            self._set(before.changed(gaits, **numbers))
            return
        if speed is not None or direction is not None:
            raise ControlError("give a velocity, or speed and direction, not both")
        x, z = self._numbers("a velocity needs x and z", velocity, 2).T
        numbers["speed"] = np.hypot(x, z)
        goes = numbers["speed"] > 0
        numbers["direction"] = np.where(goes, np.arctan2(x, z), before.direction)
        command = before.changed(gaits, **numbers)
        if facing is None:
            command = replace(command, faces_way=before.faces_way | goes)
        self._set(command)

    @property
    def target(self) -> Array:
        """Velocity along x and z, m/s, and facing, radians (characters, 3), within the limits of gaits."""
        return self._target.copy()

    def _command_numbers(
        self, speed: ArrayLike | None, direction: ArrayLike | None, facing: ArrayLike | None
    ) -> dict[str, Array]:
        """What a command gives of speed, direction and facing, angles in radians."""
        numbers = dict[str, Array]()
        for name, value in (("speed", speed), ("direction", direction), ("facing", facing)):
            if value is not None:
                numbers[name] = self._numbers(f"{name} needs a number", value)
        for name in numbers.keys() & {"direction", "facing"}:
            numbers[name] = np.radians(numbers[name])
        return numbers

    def _set(self, command: Command) -> None:
        """Obey a command; ControlError or one warning for each gait whose limits it exceeds."""
        target, exceeding = self.model.abilities.target(command)
        for gait, message in exceeding:
            if self.strict:
                raise ControlError(message)
            if gait not in self._warned:
                self._warned.add(gait)
                warn(message, ControlWarning)
        changed = (np.abs(target - self._target).max(axis=1) > 1e-4) | (command.gait != self._command.gait)
        self._playback.hasten(changed)
        self._target, self._command = target, command
        self._guidance = self._guidance.ended()

    def _gaits(self, names: str | Sequence[str]) -> Rows:
        each = list(names) if isinstance(names, Iterable) and not isinstance(names, str) else [names] * self.characters
        if len(each) != self.characters:
            raise ControlError(f"{len(each)} gaits do not fit {self.characters} characters")
        return np.array([self.model.abilities.number(name) for name in each])

    def tick(self) -> Pose:
        """The next pose of all characters, 1 / ``model.fps`` seconds later."""
        self._lead()
        return self.tick_to(self._way)

    @property
    def _way(self) -> Array:
        """The target as gaits approach it."""
        return self.model.abilities.curved(self._target, self._command.gait, self._playback.root[:, 2])

    def _lead(self) -> None:
        """Let those that are on a path go on, and those that move keep apart."""
        if not (self._guidance.going.goes.any() or self._guidance.room):
            return
        model = self.model
        ways = Ways(model.abilities, model.settings(ArrivalSettings), model.settings(AvoidanceSettings))
        self._guidance, self._command, self._target = ways.lead(
            self._guidance, self._playback, self._command, self._target, 1 / model.fps
        )

    def _start_of(self, gait: str | None, speed: Array | None, characters: Rows) -> tuple[Array, Rows, Array]:
        if gait is None:
            gaits = self._command.gait[characters]
        else:
            gaits = np.full(len(characters), self.model.abilities.number(gait))
        return self._playback.root[characters, :2], gaits, speed_of(self.model.abilities, gaits, speed)

    def tick_to(self, target: Array) -> Pose:
        """A tick with a raw target (characters, 3): velocity along x and z in m/s, facing in radians; not checked."""
        model = self.model
        playback = self._playback
        gait = self._command.gait
        root_before = playback.root
        seconds = 1 / model.fps
        # acts go on, begin and end; legs that an act has led so far get a row to continue from
        changed = self._actions.begin(playback, target, gait)
        # search, playback, springs, warping: the pose of the recordings, and the root
        pose = tick(model.matcher, model.pose_codes, playback, target, gait)
        # idle: figures that stand keep their place
        if self._lock is not None:
            settings = model.settings(IdleSettings)
            acts = self._actions.whole
            self._idle = self._idle.update(pose, playback, root_before, target, acts, settings, seconds)
        # actions: acts are laid over the pose, and lead whole bodies
        pose = self._actions.update(pose, playback, root_before, changed)
        self._face_as_acted()
        # idle, again: breath; foot lock: standing feet stay in place
        if self._lock is not None:
            pose = self._idle.breathe(pose, model.settings(IdleSettings), seconds)
            pose = self._lock.held(pose)
        # look and reach: heads and arms
        pose = self._point(pose, seconds)
        # what has happened since the last tick
        return replace(pose, events=self._happened(pose)).read_only()

    def _point(self, pose: Pose, seconds: float) -> Pose:
        """A pose with heads and arms turned to their targets."""
        before = self._guidance
        look, pose = before.look.update(pose, self.model.settings(LookSettings), seconds)
        reach_settings = self.model.settings(ReachSettings)
        left, pose = before.hands[0].update(pose, reach_settings, seconds)
        right, pose = before.hands[1].update(pose, reach_settings, seconds)
        if look is not before.look or (left, right) != before.hands:
            self._guidance = replace(before, look=look, hands=(left, right))
        return pose

    def _happened(self, pose: Pose) -> tuple[Event, ...]:
        gait = self._command.gait
        before = self._happenings
        shows = self.model.matcher.table.shows[self._playback.row, gait]
        self._happenings = before.after(pose.contacts, gait, shows, self.arrived, self._actions.done)
        return tuple(self._happenings.events(before, self.model.gaits))

    @property
    def matched(self) -> Matched:
        """The rows that are played, what they cost, and the desired path."""
        return matched(self.model.matcher, self._playback, self._way, self._command.gait)

    def _face_as_acted(self) -> None:
        """After a full-body act an idle character keeps the act's final facing."""
        if not self._actions.acts:
            return
        command = self._command
        stands = self._actions.whole & (command.speed == 0)
        if not stands.any():
            return
        facing = np.where(stands, self._playback.root[:, 2], command.facing)
        direction = np.where(stands, facing, command.direction)
        self._command = replace(command, direction=direction, facing=facing)
        standing_target = np.insert(np.zeros((len(facing), 2)), 2, facing, axis=1)
        self._target = np.where(stands[:, None], standing_target, self._target)

    def act(
        self, what: Action | Sequence[Action], *, who: CharacterIds = None, upper: bool | None = None
    ) -> list[Shown]:
        """Begin an act in the next tick, in place of the present one.

        what: a motion of any human figure, without the rest at both ends; an act, made of a motion once by
            :meth:`motet.steering.model.SteerModel.act_of`; the name of a gait that goes nowhere, such as "jump", which
            is done once, forward by characters that move; or a sentence such as "wave", for which the session's
            ``words`` generate a motion, once; None ends the present act. One for all, or one for each of ``who``.
        who: numbers of characters, by default all.
        upper: by the upper body alone, while the legs go on; or by the whole body (False), which goes its own way over
            the ground. By default by the whole body where a character stands, until it is steered elsewhere; or
            where the act is one of the legs, such as a kick, after which a character that moves goes on.
        Returns how each sentence is shown, and warns (TextWarning) of words that are left out.
        MotionError for a motion that is not of a human figure, TextError for a sentence that the model does not know
        or, in a strict session, with words that are left out, ControlError for a motion of less than three ticks, for
        unknown characters, and for a sentence without ``words``; nothing changes then.
        """
        characters = self._chosen(who).tolist()
        each = list(what) if is_many(what) and not isinstance(what, Action) else [what] * len(characters)
        if len(each) != len(characters):
            raise ControlError(f"{len(each)} acts do not fit {len(characters)} characters")
        # make each act once
        shown: list[Shown] = []
        made = dict[int, tuple[Act, ...]]()
        for action in each:
            if id(action) not in made:
                made[id(action)] = self._acts_of(action, shown)
        for character, action in zip(characters, each, strict=True):
            self._actions.orders[character] = (self._take(character, made[id(action)]), upper)
        return shown

    def _take(self, character: int, acts: tuple[Act, ...]) -> Act | None:
        """The act that leads the farthest if the character moves, else the least far; None of none."""
        choose = max if self._target[character, :2].any() else min
        return choose(acts, key=lambda act: act.reach) if acts else None

    def prepare(self, *sentences: str) -> list[Shown]:
        """Make acts of sentences, so that :meth:`act` has them at once; returns how they are shown. It may be called in
        another thread while the session ticks, such as by ``asyncio.to_thread(session.prepare, "wave")``. Errors and
        warnings are those of :meth:`act`."""
        shown: list[Shown] = []
        for sentence in sentences:
            self._acts_of(sentence, shown)
        return shown

    def _acts_of(self, what: Any, shown: list[Shown]) -> tuple[Act, ...]:
        """The acts of an action, among which a character does one; ``shown`` grows by how a sentence is shown."""
        needs(what, Action, "a motion, an act or a sentence")
        if what is None:
            return ()
        if isinstance(what, str) and what in self.model.takes:
            return self.model.takes[what]
        return (self._act_of(what, shown),)

    def _act_of(self, what: Motion | Act | str, shown: list[Shown]) -> Act:
        if isinstance(what, Act):
            return what
        if isinstance(what, Motion):
            return self.model.act_of(what)
        if self._words is None:
            raise ControlError("an act in words needs a model that makes it: start(words=motet.load('generate'))")
        act, shown_as = self._words.shown(what, self.strict)
        shown.append(shown_as)
        return act

    @property
    def acting(self) -> list[tuple[str, float] | None]:
        """The act of each character: its name and the seconds that are left; None for characters without an act."""
        acting = list[tuple[str, float] | None]()
        for playing in self._actions.playing:
            if playing is None:
                acting.append(None)
            else:
                acting.append((playing.act.name, (len(playing.act) - 1 - playing.frame) / self.model.fps))
        for character, (act, _) in self._actions.orders.items():
            acting[character] = None if act is None else (act.name, (len(act) - 1) / self.model.fps)
        return acting

    def advance(self, seconds: float) -> Pose:
        """The pose ``seconds`` later, for a display of any frame rate: interpolated between two ticks. Its
        events are those since the pose before. A command shows within a tick. ControlError unless 0 <= seconds <= 1."""
        if not is_number(seconds) or not 0 <= seconds <= 1:
            raise ControlError(f"a session advances by 0 to 1 s, not {seconds}")
        events = self._late
        self._late = ()
        if self._poses is None:
            first = self.tick()
            events += first.events
            self._poses = (first, self.tick())
        self._ahead += seconds * self.model.fps
        while self._ahead >= 1:
            events += self._poses[1].events
            self._poses = self._poses[1], self.tick()
            self._ahead -= 1
        return replace(self._poses[0].towards(self._poses[1], self._ahead), events=events)

    def push(self, velocity: ArrayLike) -> None:
        """Push the characters by a velocity (2,) or (characters, 2) along x and z, m/s, from which they recover."""
        self._playback.spring[:, :2] += self._numbers("a velocity needs x and z", velocity, 2)
        self._playback.hasten(np.ones(self.characters, dtype=bool))

    def put(self, places: ArrayLike) -> None:
        """Place the characters elsewhere: (3,) or (characters, 3) x and z in metres, facing in degrees."""
        numbers = self._numbers("places need x, z and facing", places, 3)
        facing = wrapped(np.radians(numbers[:, 2]))
        self._playback.root = np.column_stack([numbers[:, :2], facing])
        self._playback.spring[:, 2] = facing
        before = self._command
        direction = np.where(before.speed > 0, before.direction, facing)  # standing ones move the way they face
        no_way = np.zeros_like(before.faces_way)
        self._command = replace(before, direction=direction, facing=facing, faces_way=no_way)
        self._target, _ = self.model.abilities.target(self._command)
        self._actions = self._no_acts()
        self._guidance = self._guidance.ended()
        if self._poses is not None:
            self._late += self._poses[1].events
        self._poses = None  # nothing lies between there and here
        if self._lock is not None:
            self._lock = self._new_lock()

    def add(self, places: ArrayLike, *, gait: str | None = None, phases: ArrayLike | None = None) -> list[int]:
        """Add characters that stand at places: (3,) for one or (n, 3), x and z in metres, facing in degrees. Returns
        their numbers (n), which follow the present ones. Each moves as in a session of its own that starts now.

        gait, phases: like ``start`` and ``phases`` of :meth:`motet.steering.model.SteerModel.start`. ControlError for
        values out of range, and for more than 100,000 characters in all; nothing changes then.
        """
        new_places = _places(places)
        count = len(new_places)
        total = self.characters + count
        if not 0 < count <= LARGEST_CROWD - self.characters:
            raise ControlError(f"a session has 1 to {LARGEST_CROWD} characters; places of {count} make it {total}")
        turns = self.model.phases(total) if phases is None else None
        phases = phases if turns is None else turns[self.characters :]
        held = self._lock is not None
        more = self.model.start(gait, characters=count, places=new_places, hold_feet=held, phases=phases)
        if self._poses is not None:
            more.advance(0)
        numbers = list(range(self.characters, total))
        self.restore(crowd.picked([self.snapshot(), more.snapshot()], np.arange(total)))
        return numbers

    def remove(self, who: int | Sequence[int]) -> None:
        """Remove characters. The others keep their order, and the numbers of later ones become smaller. ControlError
        for unknown characters, and for all of them: one stays."""
        if who is None:
            raise ControlError("who must be the numbers of the characters that go")
        stay = np.delete(np.arange(self.characters), self._chosen(who))
        if not len(stay):
            raise ControlError("a session keeps one character at least")
        self.restore(crowd.picked([self.snapshot()], stay))

    def take(self, pose: Pose) -> None:
        """Continue from a changed pose: its rotations and height, one for all characters or one for each. Their
        positions and velocities stay. ControlError for a pose that does not fit."""
        if len(pose) not in (1, self.characters) or pose.rotations.shape[1:] != (len(BONES), 4):
            raise ControlError(f"a pose of {pose.rotations.shape} does not fit {self.characters} characters")
        if not (np.isfinite(pose.rotations).all() and np.isfinite(pose.height).all()):
            raise ControlError("a pose must be finite numbers")
        codes = self.model.pose_codes.encode(pose.rotations, pose.height)
        self.model.matcher.pose(self._playback, np.broadcast_to(codes, (self.characters, codes.shape[1])))
        self._actions = self._no_acts()

    def run(self, script: str) -> list[Motion]:
        """Run a script (:mod:`motet.steering.scripts`) for all characters; one motion for each."""
        poses = list(self.follow(parse_orders(script, self.model.gaits)))
        return [self.model.contract.motion(frames, plant=self._lock is not None) for frames in self.frames_of(poses)]

    def follow(self, orders: Sequence[Order]) -> Iterator[Pose]:
        """The poses of all characters that follow orders, tick by tick."""
        for order in orders:
            self._obey(order)
            for _ in range(max(1, round(order.seconds * self.model.fps))):
                yield self.tick()

    def _obey(self, order: Order) -> None:
        if order.act is not None:
            self.act(order.act)
            return
        if order.goal is not None:
            self.go_to(order.goal, order.facing, speed=order.speed)
            return
        before = self._command
        facing = np.where(before.faces_way, before.direction, before.facing)
        aside = wrapped(before.direction - facing) if order.way is None else np.radians(order.way)
        if order.speed is None:
            gaits = before.gait if order.gait is None else self._gaits(order.gait)
            speed = self.model.abilities.speeds[gaits, 1]
        elif order.speed >= 0:
            speed = np.full(self.characters, order.speed)
        else:
            speed = before.speed
        degrees = np.degrees(facing) + order.turn
        self.control(gait=order.gait, speed=speed, direction=degrees + np.degrees(aside), facing=degrees)

    def frames_of(self, poses: Sequence[Pose]) -> Array:
        """Frames (characters, T, D) in the contract's units of consecutive poses."""
        moved = [pose.moved_since(before) for before, pose in zip([*poses[:1], *poses[:-1]], poses, strict=True)]
        block = np.stack(moved, axis=1) * self.model.fps
        height = np.stack([pose.height for pose in poses], axis=1)[..., None]
        quats = np.stack([pose.rotations for pose in poses], axis=1).astype(np.float64)
        axes = np.swapaxes(quat_to_rotmat(quats)[..., :2], -1, -2).reshape(*height.shape[:2], -1)
        frames: Array = np.concatenate([block, height, axes], axis=-1)
        return frames

    def snapshot(self) -> SteerSnapshot:
        """The whole state, to be restored later."""
        return SteerSnapshot(
            playback=self._playback.copy(),
            actions=self._actions.copy(),
            idle=self._idle,
            command=self._command,
            lock=None if self._lock is None else replace(self._lock),  # its arrays are replaced, never written into
            poses=self._poses,
            ahead=self._ahead,
            guidance=self._guidance,
            happenings=self._happenings,
            late=self._late,
        )

    def restore(self, snapshot: SteerSnapshot) -> None:
        """Go back to a snapshot of this session or of one like it, of the same model and the same ``hold_feet``, else
        ControlError. The session has as many characters then as the snapshot."""
        needs(snapshot, SteerSnapshot, "a snapshot of a session")
        if snapshot.lock is None and self._lock is not None:
            raise ControlError("a snapshot without held feet does not fit a session with them (hold_feet)")
        if snapshot.lock is not None and self._lock is None:
            raise ControlError("a snapshot with held feet does not fit a session without them (hold_feet)")
        self.characters = len(snapshot.command.gait)
        self._playback = snapshot.playback.copy()
        self._actions = snapshot.actions.copy()
        self._idle = snapshot.idle
        self._command = snapshot.command
        self._target, _ = self.model.abilities.target(snapshot.command)
        self._poses = snapshot.poses
        self._ahead = snapshot.ahead
        self._guidance = snapshot.guidance
        self._happenings = snapshot.happenings
        self._late = snapshot.late
        self._lock = None if snapshot.lock is None else replace(snapshot.lock)


def _places(values: ArrayLike) -> Array:
    """Places (n, 3) of characters, of one (3,) or more; not yet whether they are finite."""
    needed = "places need x, z and facing, for each of the characters that are added"
    try:
        places = np.atleast_2d(np.array(values, dtype=np.float64))
    except (TypeError, ValueError) as error:
        raise ControlError(needed) from error
    if places.shape[1:] != (3,):
        raise ControlError(needed)
    return places
