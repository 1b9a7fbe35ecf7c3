"""A session of steered figures: commands in, within what gaits allow, and a pose per tick out."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motet.errors import ControlError, ControlWarning, TextError, needs, warn
from motet.figures.humanoid import BONES, LEFT_RIGHT
from motet.models.control import LARGEST_CROWD
from motet.motion.motion import Motion, is_many
from motet.motion.rotations import Array, quat_to_rotmat, wrapped
from motet.motion.scalar_or_batch import single
from motet.settings import is_number
from motet.steering.action_layer import ActionLayer, ActOrder
from motet.steering.acts import Act, ActSettings
from motet.steering.avoidance import AvoidanceSettings
from motet.steering.crowd import picked
from motet.steering.events import Event, Happenings
from motet.steering.foot_lock import FootLock, FootLockSettings
from motet.steering.gaits import Command
from motet.steering.idle import IdleLayer, IdleSettings
from motet.steering.look_layer import LookLayer, LookSettings
from motet.steering.matching import Flags, Matched, Playback, Rows
from motet.steering.paths import ArrivalSettings, Going, Ways, rolling_distance
from motet.steering.pose import Pose
from motet.steering.reach_layer import ReachLayer, ReachSettings
from motet.steering.saying import Saying
from motet.steering.scripts import Order, parse_orders
from motet.steering.spoken import Reading
from motet.steering.step import tick
from motet.steering.stepping import Plan, StepSettings, planned
from motet.steering.style_layer import StyleLayer, StyleSettings
from motet.steering.styles import PACES, STYLE_NAMES, style_number
from motet.steering.targets import CharacterIds, checked_path, chosen_ids, numbers_of
from motet.steering.terrain import GroundHeight, Terrain, TerrainLayer, TerrainSettings
from motet.steering.turn_limit import TurnLimit, TurnSettings
from motet.text.clauses import Shown

if TYPE_CHECKING:
    from motet.steering.model import SteerModel
    from motet.steering.sentence_acts import SaidActs

Action = Motion | Act | str | None
"""What can be acted."""


@dataclass(eq=False, repr=False)
class SteerSnapshot:
    """The whole state of a session; of its parts only playback and actions are written into."""

    playback: Playback
    actions: ActionLayer
    style: StyleLayer
    idle: IdleLayer
    command: Command
    lock: FootLock | None
    terrain: TerrainLayer
    look: LookLayer
    left: ReachLayer
    """The left hands."""
    right: ReachLayer
    """The right hands."""
    turns: TurnLimit
    going: Going
    happenings: Happenings
    target: Array
    """(characters, 3) what they are steered to, on their ways and around others."""
    room: float = 0.0
    """Metres that characters keep apart, 0 for none."""
    poses: tuple[Pose, Pose] | None = None
    """The last two ticks, of a display with another frame rate."""
    ahead: float = 0.0
    """How far the display is from the first to the second, in ticks."""
    late: tuple[Event, ...] = ()
    """Events of a tick that was to be shown next when characters were put elsewhere."""
    saying: Saying | None = None
    """What was said, as long as something of it is to come."""

    def copy(self) -> "SteerSnapshot":
        """A copy that changes independently."""
        saying = None if self.saying is None else self.saying.copy()
        return replace(self, playback=self.playback.copy(), actions=self.actions.copy(), saying=saying)

    def __repr__(self) -> str:
        return f"SteerSnapshot({len(self.command.gait)} characters)"


class SteerSession:
    """Characters that move in one batch, each steered separately; holds their whole state. A tick is 1 / ``model.fps``
    seconds. Angles are degrees about the vertical: 0 along z, positive to the left. ``ids``: the numbers of the
    characters that are meant, from 0; by default all."""

    def __init__(
        self,
        model: "SteerModel",
        playback: Playback,
        gait: int,
        hold_feet: bool,
        strict: bool,
        words: "SaidActs | None",
    ) -> None:
        characters = len(playback.row)
        zero = np.zeros(characters)
        self.model = model
        self.strict = strict
        self._words = words
        self._terrain: Terrain | None = None
        self._warned: set[str] = set()  # gaits whose limits a warning has named
        self._state = SteerSnapshot(
            playback=playback,
            actions=ActionLayer.none(model.matcher, model.pose_codes, playback),
            style=StyleLayer.none(characters),
            idle=IdleLayer.none(characters),
            command=Command(np.full(characters, gait), zero, zero, zero, zero > 0),
            lock=FootLock.none(characters) if hold_feet else None,
            terrain=TerrainLayer.none(characters),
            look=LookLayer.none(characters),
            left=ReachLayer.none(0, characters),
            right=ReachLayer.none(1, characters),
            turns=TurnLimit.none(characters),
            going=Going.none(characters),
            happenings=Happenings.none(characters),
            target=np.zeros((characters, 3)),
        )

    @property
    def characters(self) -> int:
        """Number of characters."""
        return len(self._state.target)

    def control(
        self,
        *,
        gait: str | Sequence[str] | None = None,
        speed: ArrayLike | None = None,
        direction: ArrayLike | None = None,
        facing: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        style: str | Sequence[str] | None = None,
    ) -> None:
        """Set where and how the characters go from now on, a value for all or one for each; values not given stay.

        gait: one of ``model.gaits``. speed: m/s. direction: of travel, in degrees. facing: in degrees; if only the
        direction is given, they face it. velocity: (2,) or (characters, 2) along x and z in m/s, for example from a
        gamepad's stick, instead of speed and direction; (0, 0) stops, facing as before. style: one of ``model.styles``,
        such as "limping", in which they go and stand, at the same speed and on their ways; "none" ends it.
        A speed outside the gait's range is clamped with one warning (ControlWarning), or refused if the session is
        strict; a gait that only goes forward faces the way it goes. ControlError for values that are not numbers or do
        not fit; the control is unchanged then.
        """
        numbers = self._command_numbers(speed, direction, facing)
        gaits = self._gaits(gait)
        styles = self._styles(style)
        if velocity is not None:
            if speed is not None or direction is not None:
                raise ControlError("give a velocity, or speed and direction, not both")
            numbers |= self._by_velocity(velocity)
        # a direction is faced until a facing is given
        if "facing" in numbers:
            numbers["faces_way"] = np.zeros(self.characters, dtype=bool)
        elif direction is not None:
            numbers["faces_way"] = np.ones(self.characters, dtype=bool)
        # a style alone leaves them on their ways
        if numbers or gait is not None:
            self._set(replace(self._state.command, gait=gaits, **numbers).turned())
        self._state.style = replace(self._state.style, wanted=styles)

    def _by_velocity(self, velocity: ArrayLike) -> dict[str, NDArray[Any]]:
        """The speed, the direction and what is faced of a velocity; standing figures keep the last two."""
        before = self._state.command
        x, z = self._numbers("a velocity needs x and z", velocity, 2).T
        speed = np.hypot(x, z)
        goes = speed > 0
        direction = np.where(goes, np.arctan2(x, z), before.direction)
        return {"speed": speed, "direction": direction, "faces_way": before.faces_way | goes}

    def _styles(self, names: str | Sequence[str] | None) -> Rows:
        """The numbers of styles (characters,), None for the present ones."""
        if names is None:
            return self._state.style.wanted
        return np.array([style_number(name) for name in self._for_each("styles", names)])

    @property
    def target(self) -> Array:
        """Velocity along x and z, m/s, and facing, radians (characters, 3), within the limits of gaits."""
        return self._state.target.copy()

    @property
    def places(self) -> Array:
        """Where the characters are (characters, 3): x and z in metres, facing in degrees, as :meth:`put` takes them."""
        places = self._state.playback.root.copy()
        places[:, 2] = np.degrees(places[:, 2])
        return places

    @property
    def gaits(self) -> list[str]:
        """The gait of each character."""
        return [self.model.gaits[gait] for gait in self._state.command.gait.tolist()]

    @property
    def styles(self) -> list[str]:
        """The style of each character, "none" of those that go as recorded."""
        return [STYLE_NAMES[style] for style in self._state.style.wanted.tolist()]

    def say(self, text: str, here: ArrayLike = (0.0, 0.0)) -> Reading:
        """Let all characters do what a sentence says: "wave", "walk slowly, then bow twice", "turn left and run".

        It is read by the table of acts and orders that ships (docs/steer.md). Of a sentence that has an unknown part
        nothing is done: the reading names that part and the three nearest acts, and its ``caption`` says so. Steps
        follow each other as the session ticks, until another command comes.
        here: x and z in metres, where "come here" leads. ControlError for another.
        """
        needs(text, str, "a sentence")
        (point,) = numbers_of("here needs x and z", here, 1, 2)
        reading = self.model.read_said(text)
        if reading.steps:
            self._continue(Saying(reading.steps, (float(point[0]), float(point[1]))))
        return reading

    def _continue(self, saying: Saying) -> None:
        """Begin the steps of what was said that are next, and keep it as long as more is to come."""
        saying.tick(self)
        self._state.saying = None if saying.is_over else saying

    def _command_numbers(
        self, speed: ArrayLike | None, direction: ArrayLike | None, facing: ArrayLike | None
    ) -> dict[str, NDArray[Any]]:
        """What a command gives of speed, direction and facing, angles in radians."""
        numbers = dict[str, NDArray[Any]]()
        for name, value in (("speed", speed), ("direction", direction), ("facing", facing)):
            if value is not None:
                values = self._numbers(f"{name} needs a number", value)
                numbers[name] = values if name == "speed" else np.radians(values)
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
        state = self._state
        changed = (np.abs(target - state.target).max(axis=1) > 1e-4) | (command.gait != state.command.gait)
        state.playback.hasten(changed)
        state.target = target
        state.command = command
        state.going = state.going.ended()
        state.saying = None

    def _gaits(self, names: str | Sequence[str] | None) -> Rows:
        """The numbers of gaits (characters,), None for the present ones."""
        if names is None:
            return self._state.command.gait
        return np.array([self.model.abilities.number(name) for name in self._for_each("gaits", names)])

    def _for_each(self, what: str, names: str | Sequence[str]) -> list[str]:
        """A name for each character, of one for all or one for each."""
        each = list(names) if isinstance(names, Iterable) and not isinstance(names, str) else [names] * self.characters
        if len(each) != self.characters:
            raise ControlError(f"{len(each)} {what} do not fit {self.characters} characters")
        return each

    def tick(self) -> Pose:
        """The next pose of all characters, 1 / ``model.fps`` seconds later."""
        if self._state.saying is not None:
            self._continue(self._state.saying)
        state = self._state
        # those that are on a path go on, and those that move keep apart
        if state.going.goes.any() or state.room:
            model = self.model
            ways = Ways(model.abilities, model.settings(ArrivalSettings), model.settings(AvoidanceSettings))
            state.going, state.command, state.target = ways.lead(
                state.going, state.room, state.playback, state.command, state.target, 1 / model.fps
            )
        return self.tick_to(self._way)

    @property
    def _way(self) -> Array:
        """The target as gaits approach it."""
        state = self._state
        return self.model.abilities.curved(state.target, state.command.gait, state.playback.root[:, 2])

    def _slowed(self, target: Array) -> Array:
        """Targets (characters, 3), slower where they lead uphill."""
        if self._terrain is None:
            return target
        return self._terrain.slowed(target, self._state.playback.root, self.model.settings(TerrainSettings))

    def tick_to(self, target: Array) -> Pose:
        """A tick with a raw target (characters, 3): velocity along x and z in m/s, facing in radians; not checked."""
        model = self.model
        matcher = model.matcher
        codes = model.pose_codes
        settings = model.settings
        seconds = 1 / model.fps
        state = self._state
        playback = state.playback
        gait = state.command.gait
        root_before = playback.root
        target = self._slowed(target)
        # acts go on, begin and end; legs that an act has led so far get a row to continue from
        changed = state.actions.begin(matcher, codes, settings(ActSettings), playback, target, gait)
        # search, playback, springs, warping: the pose of the recordings, and the root
        pose = tick(matcher, codes, playback, target, gait)
        # idle: figures that stand keep their place
        if state.lock is not None:
            acts = state.actions.whole
            state.idle = state.idle.update(pose, playback, root_before, target, acts, settings(IdleSettings), seconds)
        # actions: acts are laid over the pose, and lead whole bodies
        pose = state.actions.update(pose, playback, root_before, changed, settings(ActSettings), model.fps)
        self._face_as_acted()
        # style: laid over who moves or stands
        if state.style.shows:
            whole = state.actions.whole
            state.style, pose = state.style.update(pose, whole, state.actions.plays, settings(StyleSettings), seconds)
        # idle, again: breath; foot lock: standing feet stay in place
        if state.lock is not None:
            pose = state.idle.breathe(pose, settings(IdleSettings), seconds)
            plan = self._plan(target, gait, acts)
            state.lock, pose = state.lock.update(pose, settings(FootLockSettings), seconds, plan)
        # terrain: feet, legs and hips follow the ground
        if self._terrain is not None:
            state.terrain, pose = state.terrain.update(pose, self._terrain, settings(TerrainSettings), seconds)
        # look and reach: heads and arms
        state.look, pose = state.look.update(pose, settings(LookSettings), seconds)
        state.left, pose = state.left.update(pose, settings(ReachSettings), seconds)
        state.right, pose = state.right.update(pose, settings(ReachSettings), seconds)
        # turn limit: no joint jumps
        state.turns, pose = state.turns.update(pose, settings(TurnSettings), seconds)
        # what has happened since the last tick
        return replace(pose, events=self._events(pose)).read_only()

    def _plan(self, target: Array, gait: Rows, acts: Flags) -> Plan | None:
        """Whose steps are planned in a tick, None for nobody's. acts: (characters,) whether an act leads the body."""
        state = self._state
        settings = self.model.settings(StepSettings)
        creeps, stops = planned(self.model.matcher, state.playback, target, gait)
        plans = (creeps | stops) & ~acts
        if not plans.any():
            return None
        settled = stops & (state.idle.share > settings.rests)
        return Plan(settings, single(plans), single(settled))

    def _face_as_acted(self) -> None:
        """After a full-body act an idle character keeps the act's final facing."""
        state = self._state
        if not state.actions.acts:
            return
        stands = state.actions.whole & (state.command.speed == 0)
        facing = np.where(stands, state.playback.root[:, 2], state.command.facing)
        direction = np.where(stands, facing, state.command.direction)
        state.command = replace(state.command, direction=direction, facing=facing)
        standing_target = np.insert(np.zeros((len(facing), 2)), 2, facing, axis=1)
        state.target = np.where(stands[:, None], standing_target, state.target)

    def _events(self, pose: Pose) -> tuple[Event, ...]:
        state = self._state
        gait = state.command.gait
        shows = self.model.matcher.table.shows[state.playback.row, gait]
        before = state.happenings
        state.happenings = before.after(pose.contacts, gait, shows, state.going.arrived, state.actions.done)
        return tuple(state.happenings.events(before, self.model.gaits))

    @property
    def matched(self) -> Matched:
        """The rows that are played, what they cost, and the desired path."""
        state = self._state
        return self.model.matcher.matched(state.playback, self._slowed(self._way), state.command.gait)

    def go_to(
        self,
        points: ArrayLike | None,
        facing: ArrayLike | None = None,
        *,
        gait: str | None = None,
        speed: ArrayLike | None = None,
        ids: CharacterIds = None,
    ) -> None:
        """Let characters go to points on the ground and stand there, or None: stand where they are.

        points: (2,) or one for each (n, 2), x and z in metres. facing: in degrees, how they are to face there, one or
        one for each; by default as they come. gait: by default the one that they have. speed: m/s, by default the
        gait's usual one. They slow down to the end, and :attr:`arrived` tells when they are there; :meth:`control` ends
        it. ControlError for values that are not numbers or do not fit, and for a gait that goes nowhere; nothing has
        changed then.
        """
        characters = self._chosen(ids)
        if points is None:
            self._send(characters, self._resting_places[characters, None], None, None, None)
            return
        ends = self._numbers("points need x and z", points, 2, count=len(characters))
        self._send(characters, ends[:, None], facing, gait, speed)

    def go_along(
        self,
        points: ArrayLike,
        facing: ArrayLike | None = None,
        *,
        gait: str | None = None,
        speed: ArrayLike | None = None,
        ids: CharacterIds = None,
    ) -> None:
        """Let characters go along a path on the ground, from where they are to its first point, and so on to its last,
        where they stand. Everything else is like :meth:`go_to`.

        points: a path (P, 2) for all, or one for each (n, P, 2), x and z in metres, of up to 10,000 points.
        """
        characters = self._chosen(ids)
        self._send(characters, checked_path(points, len(characters)), facing, gait, speed)

    @property
    def _resting_places(self) -> Array:
        """Where characters come to rest (characters, 2) that are to stand from now on."""
        playback = self._state.playback
        return playback.root[:, :2] + rolling_distance(playback, self.model.abilities.settings)

    def _send(
        self,
        characters: Rows,
        paths: Array,
        facing: ArrayLike | None,
        gait: str | None,
        speed: ArrayLike | None,
    ) -> None:
        """Let characters (n,) go along paths (n, P, 2) from where they are."""
        state = self._state
        state.saying = None
        abilities = self.model.abilities
        count = len(characters)
        # NaN faces the way
        facings = np.full(count, np.nan)
        if facing is not None:
            facings = np.radians(self._numbers("facing needs a number", facing, count=count))
        speeds = None
        if speed is not None:
            speeds = self._numbers("speed needs a number", speed, count=count)
            if not (speeds > 0).all():
                raise ControlError("speed must be above 0 m/s; points of None let characters stand")
        # from where each would come to rest
        gaits = self._gaits(gait)[characters]
        usual = abilities.usual(gaits)
        starts = self._resting_places[characters, None]
        state.going = state.going.sent(
            characters,
            list(np.concatenate([starts, paths], axis=1)),
            facing=wrapped(facings),
            gait=gaits,
            speed=usual if speeds is None else speeds,
        )

    @property
    def arrived(self) -> Flags:
        """Which characters (characters,) stand, within 8 cm and 8 degrees, where they were last sent."""
        return self._state.going.arrived.copy()

    def keep_apart(self, room: float | None = 0.8) -> None:
        """Let the characters of the session that move keep ``room`` metres from all others, 0.1 to 5, by going around
        them, as far as there is room; None lets them go through each other. ControlError for another number."""
        if room is not None and not (isinstance(room, int | float) and 0.1 <= room <= 5):
            raise ControlError(f"characters keep 0.1 to 5 m apart, or None, not {room!r}")
        self._state.room = room or 0.0

    def look_at(self, points: ArrayLike | None, *, ids: CharacterIds = None) -> None:
        """Let characters look at points in the world from now on, or None: ahead again, as they are recorded.

        points: (3,) or one for each (n, 3), x, y and z in metres. Head, neck and upper spine share the turn, up to 85
        degrees aside and 50 up or down; a point nearer to the eyes than 20 cm is not looked at. It may move: steps of
        the gaze of up to 10 degrees a tick are followed at once, others within half a second. ControlError for values
        that are not numbers or do not fit; nothing has changed then.
        """
        state = self._state
        state.look = replace(state.look, points=self._with_points(state.look.points, points, ids))

    def reach(self, hand: Literal["left", "right"], points: ArrayLike | None, *, ids: CharacterIds = None) -> None:
        """Let a hand of characters be at points in the world from now on, or None: as it is recorded.

        points: (3,) or one for each (n, 3), x, y and z in metres, for the middle of the hand. Only the arm moves. The
        hand goes as near as it can to a point that is too far, and lets go of one behind the back or at the shoulder;
        :attr:`out_of_reach` tells. ControlError like :meth:`look_at`.
        """
        if hand not in LEFT_RIGHT:
            raise ControlError(f"unknown hand {hand!r}; expected left or right")
        layer: ReachLayer = getattr(self._state, hand)
        setattr(self._state, hand, replace(layer, points=self._with_points(layer.points, points, ids)))

    @property
    def out_of_reach(self) -> Flags:
        """Whether what the left and the right hand reach for was out of reach in the last tick (characters, 2)."""
        return np.stack([self._state.left.beyond, self._state.right.beyond], axis=1)

    def _with_points(self, before: Array, points: ArrayLike | None, ids: CharacterIds) -> Array:
        """Points (B, 3) with new ones for some characters, NaN for None."""
        characters = self._chosen(ids)
        after = before.copy()
        after[characters] = np.nan
        if points is not None:
            after[characters] = self._numbers("points need x, y and z", points, 3, count=len(characters))
        return after

    def _chosen(self, ids: CharacterIds) -> Rows:
        return chosen_ids(ids, self.characters)

    def _numbers(self, needed: str, values: Any, *columns: int, count: int | None = None) -> Array:
        """Numbers for all characters or for each; by default for all of the session (:func:`numbers_of`)."""
        return numbers_of(needed, values, self.characters if count is None else count, *columns)

    def act(
        self, what: Action | Sequence[Action], *, ids: CharacterIds = None, upper: bool | None = None
    ) -> list[Shown]:
        """Begin an act in the next tick, in place of the present one.

        what: a motion of any human figure, without the rest at both ends; an act, made of a motion once by
            :meth:`motet.steering.model.SteerModel.act_of`; the name of a gait that goes nowhere, such as "jump", which
            is done once, forward by characters that move; or a sentence: an act by name, such as "wave with the left
            hand" or "kick twice", or what the session's ``words`` generate, once. None ends the present act. One for
            all, or one for each of ``ids``.
        ids: numbers of characters, by default all.
        upper: by the upper body alone, while the legs go on; or by the whole body (False), which goes its own way over
            the ground. By default by the whole body where a character stands, until it is steered elsewhere; or
            where the act is one of the legs, such as a kick, after which a character that moves goes on.
        Returns how each sentence is shown, and warns (TextWarning) of words that are left out.
        MotionError for a motion that is not of a human figure, TextError for a sentence that is no act that is known
        or, in a strict session, with words that are left out, ControlError for a motion of less than three ticks and
        for unknown characters; nothing changes then.
        """
        characters = self._chosen(ids).tolist()
        each = list(what) if is_many(what) and not isinstance(what, Action) else [what] * len(characters)
        if len(each) != len(characters):
            raise ControlError(f"{len(each)} acts do not fit {len(characters)} characters")
        # make each act once
        shown: list[Shown] = []
        made = dict[int, tuple[Act, ...]]()
        for action in each:
            if id(action) not in made:
                made[id(action)] = self._acts_of(action, shown)
        self._state.saying = None
        for character, action in zip(characters, each, strict=True):
            chosen = self._take(character, made[id(action)])
            self._state.actions.orders[character] = ActOrder(chosen, upper)
        return shown

    def _take(self, character: int, acts: tuple[Act, ...]) -> Act | None:
        """The act that leads the farthest if the character moves, else the least far; None of none."""
        choose = max if self._state.target[character, :2].any() else min
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
        act, shown_as = self.model.act_said(what) or self._made_act(what)
        shown.append(shown_as)
        return act

    def _made_act(self, sentence: str) -> tuple[Act, Shown]:
        """The act that the session's model of words makes of a sentence that is not known by name."""
        if self._words is None:
            reading = self.model.read_said(sentence)
            order = f"{sentence!r} is no single act: say it, by session.say."
            reason = order if reading.steps else reading.caption.removeprefix("? ")
            raise TextError(f"{reason} Other sentences need start(words=motet.load('generate'))")
        return self._words.shown(sentence, self.strict)

    @property
    def acting(self) -> list[tuple[str, float] | None]:
        """The act of each character: its name and the seconds that are left; None for characters without an act."""
        actions = self._state.actions
        acting = list[tuple[str, float] | None]()
        for playing, order in zip(actions.playing, actions.orders, strict=True):
            act = None if playing is None else playing.act
            frame = 0 if playing is None else playing.frame
            if order is not None:
                act = order.act
                frame = 0
            acting.append(None if act is None else (act.name, (len(act) - 1 - frame) / self.model.fps))
        return acting

    def advance(self, seconds: float) -> Pose:
        """The pose ``seconds`` later, for a display of any frame rate: interpolated between two ticks. Its
        events are those since the pose before. A command shows within a tick. ControlError unless 0 <= seconds <= 1."""
        if not is_number(seconds) or not 0 <= seconds <= 1:
            raise ControlError(f"a session advances by 0 to 1 s, not {seconds}")
        state = self._state
        events = state.late
        state.late = ()
        if state.poses is None:
            state.poses = (self.tick(), self.tick())
            events += state.poses[0].events
        state.ahead += seconds * self.model.fps
        while state.ahead >= 1:
            events += state.poses[1].events
            state.poses = (state.poses[1], self.tick())
            state.ahead -= 1
        first, second = state.poses
        return replace(first.towards(second, state.ahead), events=events)

    def set_ground(self, ground: GroundHeight | None) -> None:
        """Let the characters go over ground that is not flat, from the next tick on; None for the plane y = 0.

        ground: the height in metres at places x and z, float64 arrays of one shape, such as
            ``lambda x, z: 0.3 * np.sin(x)``. Heights of poses are then above y = 0, too, and uphill they go slower.
        A session keeps it when it is restored. ControlError for what is no function; what it raises, and heights that
        are none, are ControlErrors of the ticks.
        """
        self._terrain = None if ground is None else Terrain(ground)
        self._state.terrain = TerrainLayer.none(self.characters)

    def push(self, velocity: ArrayLike) -> None:
        """Push the characters by a velocity (2,) or (characters, 2) along x and z, m/s, from which they recover."""
        playback = self._state.playback
        playback.spring[:, :2] += self._numbers("a velocity needs x and z", velocity, 2)
        playback.hasten(np.ones(self.characters, dtype=bool))

    def put(self, places: ArrayLike) -> None:
        """Place the characters elsewhere: (3,) or (characters, 3) x and z in metres, facing in degrees."""
        state = self._state
        numbers = self._numbers("places need x, z and facing", places, 3)
        facing = wrapped(np.radians(numbers[:, 2]))
        state.playback.root = np.column_stack([numbers[:, :2], facing])
        state.playback.spring[:, 2] = facing
        # standing ones move the way they face
        before = state.command
        direction = np.where(before.speed > 0, before.direction, facing)
        no_way = np.zeros_like(before.faces_way)
        state.command = replace(before, direction=direction, facing=facing, faces_way=no_way)
        state.target, _ = self.model.abilities.target(state.command)
        self._begin_anew()
        # nothing lies between there and here
        if state.poses is not None:
            state.late += state.poses[1].events
        state.poses = None

    def _begin_anew(self) -> None:
        """Without acts and ways, and with feet that have not stood yet."""
        state = self._state
        state.actions = self._no_acts()
        state.going = state.going.ended()
        if state.lock is not None:
            state.lock = FootLock.none(self.characters)
        state.terrain = TerrainLayer.none(self.characters)

    def _no_acts(self) -> ActionLayer:
        return ActionLayer.none(self.model.matcher, self.model.pose_codes, self._state.playback)

    def _become(self, state: SteerSnapshot) -> None:
        """Go on from a state."""
        self._state = state

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
        # new characters search in the turns that follow those of the present ones
        turns = self.model.phases(total) if phases is None else None
        phases = phases if turns is None else turns[self.characters :]
        state = self._state
        hold_feet = state.lock is not None
        # a session of their own, whose state is joined to this one
        more = self.model.start(gait, characters=count, places=new_places, hold_feet=hold_feet, phases=phases)
        more._terrain = self._terrain
        if state.poses is not None:
            more.advance(0)
        numbers = list(range(self.characters, total))
        self._become(picked([state, more._state], [self.characters, count], np.arange(total)))
        return numbers

    def remove(self, ids: int | Sequence[int]) -> None:
        """Remove characters. The others keep their order, and the numbers of later ones become smaller. ControlError
        for unknown characters, and for all of them: one stays."""
        if ids is None:
            raise ControlError("ids must be the numbers of the characters that go")
        stay = np.delete(np.arange(self.characters), self._chosen(ids))
        if not len(stay):
            raise ControlError("a session keeps one character at least")
        self._become(picked([self._state], [self.characters], stay))

    def take(self, pose: Pose) -> None:
        """Continue from a changed pose: its rotations and height, one for all characters or one for each. Their
        positions and velocities stay. ControlError for a pose that does not fit."""
        if len(pose) not in (1, self.characters) or pose.rotations.shape[1:] != (len(BONES), 4):
            raise ControlError(f"a pose of {pose.rotations.shape} does not fit {self.characters} characters")
        if not (np.isfinite(pose.rotations).all() and np.isfinite(pose.height).all()):
            raise ControlError("a pose must be finite numbers")
        codes = self.model.pose_codes.encode(pose.rotations, pose.height)
        self.model.matcher.pose(self._state.playback, np.broadcast_to(codes, (self.characters, codes.shape[1])))
        self._state.actions = self._no_acts()
        self._state.turns = TurnLimit.none(self.characters)

    def run(self, script: str) -> list[Motion]:
        """Run a script (:mod:`motet.steering.scripts`) for all characters; one motion for each."""
        frames = self.frames_of(list(self.follow(parse_orders(script, self.model.gaits))))
        plant = self._state.lock is not None and self._terrain is None
        return [self.model.contract.motion(each, plant=plant) for each in frames]

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
        # a turn and a way are relative to the present facing
        before = self._state.command
        facing = np.where(before.faces_way, before.direction, before.facing)
        aside = wrapped(before.direction - facing) if order.way is None else np.radians(order.way)
        # a gait alone means its usual speed; a negative speed keeps the present one
        if order.speed is None:
            speed = self.model.abilities.speeds[self._gaits(order.gait), 1] * PACES[self._styles(order.style)]
        elif order.speed >= 0:
            speed = np.full(self.characters, order.speed)
        else:
            speed = before.speed
        degrees = np.degrees(facing) + order.turn
        direction = degrees + np.degrees(aside)
        self.control(gait=order.gait, speed=speed, direction=direction, facing=degrees, style=order.style)

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
        return self._state.copy()

    def restore(self, snapshot: SteerSnapshot) -> None:
        """Go back to a snapshot of this session or of one like it, of the same model and the same ``hold_feet``, else
        ControlError. The session has as many characters then as the snapshot."""
        needs(snapshot, SteerSnapshot, "a snapshot of a session")
        holds_feet = self._state.lock is not None
        if snapshot.lock is None and holds_feet:
            raise ControlError("a snapshot without held feet does not fit a session with them (hold_feet)")
        if snapshot.lock is not None and not holds_feet:
            raise ControlError("a snapshot with held feet does not fit a session without them (hold_feet)")
        self._become(snapshot.copy())


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
