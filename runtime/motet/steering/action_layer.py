"""Acts of steered figures, laid over their steps (:mod:`motet.steering.acts`).

An act is begun where it is most like what the figure does, played to its end, and left for the recorded row that is
most like that. The whole body plays it, with its own way over the ground; or the upper body alone, turned as in the act
seen from the facing, while the legs go on. The jump of a pose at such a change is added to it and fades
(inertialization: Bollo 2018), and so is that of the velocity over the ground.

Letters in shapes as in :mod:`motet.steering.matching`; and J bones.
"""

from dataclasses import dataclass, replace
from itertools import product, starmap
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from motet.figures.humanoid import BONES, LEFT_RIGHT, LEG, sided
from motet.motion.rotations import Array, conjugate, continuous_rotvec, quat_product, wrapped
from motet.motion.springs import Inertializer
from motet.steering.acts import Act, ActSettings
from motet.steering.events import Done
from motet.steering.matching import TRAJECTORY, Flags, Matcher, Playback, Rows, Table
from motet.steering.pose import Pose
from motet.steering.step import PoseCodes, body

_LOWER = ("hips", *starmap(sided, product(LEFT_RIGHT, LEG)))
UPPER = np.array([bone not in _LOWER for bone in BONES])
"""Which bones (J,) are of the upper body."""

BELOW = np.append(np.repeat(~UPPER, 3), True)
"""Which numbers (3 J + 1) of a pose's offset are of the lower body."""

SPINE_BONE = BONES.index("spine")

HAND_FEATURES = slice(-6, None)
"""The last features, the places of the hands: how the upper body is."""

FADED = 1e-4
"""Offsets below this, in radians, metres or metres a second, are invisible and dropped."""


@dataclass(frozen=True, eq=False)
class Body:
    """Bodies of B figures, without their places."""

    rotations: NDArray[Any]
    """(B, J, 4) as of :class:`motet.steering.pose.Pose`."""
    height: NDArray[Any]
    """(B,) of the hips, metres."""

    def at(self, figures: Rows) -> "Body":
        """Those of some figures (n,), float64."""
        return Body(self.rotations[figures].astype(np.float64), self.height[figures].astype(np.float64))

    def put(self, figures: Rows, other: "Body") -> "Body":
        """With other bodies for some figures (n,)."""
        rotations = self.rotations.copy()
        height = self.height.copy()
        rotations[figures] = other.rotations
        height[figures] = other.height
        return Body(rotations, height)

    def since(self, other: "Body") -> Array:
        """The offset (B, 3 J + 1) from other bodies to these: rotation vectors in the frames of the parents, and
        height."""
        turns = quat_product(self.rotations, conjugate(other.rotations))
        turns = np.where(turns[..., 3:] < 0, -turns, turns)
        sine = np.linalg.norm(turns[..., :3], axis=-1, keepdims=True)
        angle = 2 * np.arctan2(sine, turns[..., 3:])
        vectors = turns[..., :3] * np.where(sine > 1e-9, angle / np.maximum(sine, 1e-9), 2.0)
        return np.column_stack([vectors.reshape(len(vectors), -1), self.height - other.height])

    def plus(self, offset: Array) -> "Body":
        """With an offset of :meth:`since` added."""
        vectors = offset[:, :-1].reshape(len(offset), -1, 3)
        angle = np.linalg.norm(vectors, axis=-1, keepdims=True)
        turns = np.concatenate([vectors * np.sinc(angle / (2 * np.pi)) / 2, np.cos(angle / 2)], axis=-1)
        return Body(quat_product(turns, self.rotations), self.height + offset[:, -1])


class Playing(NamedTuple):
    """The act that a figure plays."""

    act: Act
    frame: int
    """The frame that is shown."""
    age: int
    """Ticks since it was begun."""
    whole: bool
    """Whether the whole body plays it."""
    yields: bool
    """Whether the legs stop playing it as soon as the figure is steered elsewhere."""


class ActOrder(NamedTuple):
    """What a figure is to begin."""

    act: Act | None
    """None to end the present one."""
    upper: bool | None
    """Whether by the upper body alone; None for the whole body where it stands or where the act is one of the legs."""


@dataclass(eq=False)
class ActionLayer:
    """The acts of B figures; arrays are replaced, never written into."""

    playing: list[Playing | None]
    """What each figure plays."""
    orders: list[ActOrder | None]
    """What each figure is to begin in the next tick, None to go on."""
    base: Body
    """Bodies of the last tick without acts."""
    shown: Body
    """Bodies as they were shown in the last tick."""
    shown_before: Body
    """Bodies as they were shown in the tick before that."""
    led: Flags
    """(B,) whether an act led the whole body in the last tick."""
    offset: Array
    """(B, 3 J + 1) the inertialization offset, as :meth:`Body.since` gives it."""
    offset_rate: Array
    """(B, 3 J + 1) how fast the offset changes, a second."""
    stretch: Array
    """(B, 1) how many times as long as usual the offset takes to fade."""
    velocity: Array
    """(B, 3) over the ground, m/s along x and z and rad/s."""
    velocity_offset: Array
    """(B, 3) the part of the velocity that fades."""

    @staticmethod
    def none(matcher: Matcher, codes: PoseCodes, playback: Playback) -> "ActionLayer":
        """Figures that play no act."""
        played, _ = matcher.table.at(playback)
        figures = len(played)
        shown = Body(*body(codes, playback, played))
        no_offset = np.zeros((figures, 3 * len(BONES) + 1))
        return ActionLayer(
            playing=[None] * figures,
            orders=[None] * figures,
            base=shown,
            shown=shown,
            shown_before=shown,
            led=np.zeros(figures, dtype=bool),
            offset=no_offset,
            offset_rate=no_offset,
            stretch=np.ones((figures, 1)),
            velocity=np.zeros((figures, 3)),
            velocity_offset=np.zeros((figures, 3)),
        )

    def copy(self) -> "ActionLayer":
        """A copy that changes independently."""
        return replace(self, playing=list(self.playing), orders=list(self.orders))

    @property
    def acts(self) -> bool:
        """Whether any figure plays an act."""
        return self.playing.count(None) < len(self.playing)

    @property
    def done(self) -> list[Done | None]:
        """What each figure does."""
        return [playing and Done(playing.act.name, playing.age) for playing in self.playing]

    @property
    def plays(self) -> Flags:
        """Which figures (B,) play an act."""
        return np.array([playing is not None for playing in self.playing])

    @property
    def whole(self) -> Flags:
        """Which figures (B,) play an act with the whole body."""
        return np.array([playing is not None and playing.whole for playing in self.playing])

    def begin(
        self,
        matcher: Matcher,
        codes: PoseCodes,
        settings: ActSettings,
        playback: Playback,
        target: Array,
        gait: Rows,
    ) -> Rows:
        """Before a tick: go on by a frame, begin acts that are ordered, end those that are over. The figures (n,) that
        are shown something else from now on. Legs that no act moves any more continue from the row that fits best.

        target: (B, 3) velocity along x and z, and facing. gait: (B,).
        """
        if not self.acts and self.orders.count(None) == len(self.orders):
            return np.empty(0, dtype=np.int64)
        changed = list[int]()
        before = list(self.playing)
        goes = np.hypot(*target[:, :2].T) > 0
        for figure, (playing, order) in enumerate(zip(before, self.orders, strict=True)):
            if playing is None and order is None:
                continue
            if order is None:
                after = _continued(playing, bool(goes[figure]))
            else:
                after = _entered(order, playing, figure, bool(goes[figure]), playback, matcher, settings)
            self.playing[figure] = after
            # a pose jumps where an act begins or ends, or goes on by another part of the body
            if order is not None or after is None or after.whole != _is_whole(playing):
                changed.append(figure)
        self.orders = [None] * len(before)
        self._free(before, changed, matcher, codes, playback, target, gait)
        return np.array(changed, dtype=np.int64)

    def _free(
        self,
        before: list[Playing | None],
        changed: list[int],
        matcher: Matcher,
        codes: PoseCodes,
        playback: Playback,
        target: Array,
        gait: Rows,
    ) -> None:
        """Let legs that an act has led so far go on from the rows that fit best after the pose of the act. before: what
        figures have played. changed: those that play something else now."""
        freed = list[int]()
        features = list[Array]()
        for figure in changed:
            playing = before[figure]
            if playing is not None and playing.whole and not _is_whole(self.playing[figure]):
                freed.append(figure)
                features.append(playing.act.features[playing.frame])
        if not freed:
            return
        # search
        figures = np.array(freed)
        table = matcher.table
        slow_walk = matcher.is_slow_walk(target[figures], gait[figures])
        trajectory = matcher.desired_trajectory(playback, target, slow_walk, figures)
        desired = (np.concatenate([trajectory, np.stack(features)], axis=1) - table.mean) * table.scale
        row, mirror, _ = matcher.best(matcher.query(desired.astype(np.float32)), gait[figures])
        # and play the row, as if it had been played in the last tick, too
        playback.restart(figures, row, mirror)
        played, _ = table.at(playback, figures)
        self.base = self.base.put(figures, Body(*codes.decode(played[:, : table.codes])))

    def update(
        self, pose: Pose, playback: Playback, root_before: Array, changed: Rows, settings: ActSettings, fps: float
    ) -> Pose:
        """After a tick: its pose with acts laid over it, and the playback where they lead.

        root_before: (B, 3) before the tick. changed: (n,) of :meth:`begin`.
        """
        seconds = 1 / fps
        base_before = self.base
        self.base = Body(pose.rotations, pose.height)
        step = playback.root - root_before
        step[:, 2] = wrapped(step[:, 2])
        # without an act, an order or an offset, poses stay as they are
        if not (len(changed) or self.acts or self.led.any() or self.offset.any()):
            self._show(self.base, step / seconds)
            return pose

        # root motion: acts of the whole body lead it over the ground
        whole = self.whole
        contacts = self._step(playback, root_before, step, pose.contacts, whole)

        # transition: jumps of poses and velocities go into the inertialization offsets, which then fade
        if len(changed):
            self._transition(base_before, step / seconds, changed, whole, settings, fps)
        self.led = whole
        figures = self._active()
        if not len(figures):
            self._show(self.base, step / seconds)
            return pose
        self._fade(settings, seconds)

        # overlay: acts and offsets are laid over the pose, and the offset of the velocity over the root's
        acted = self._played(self.base, figures, 0).plus(self.offset[figures])
        self._show(self.base.put(figures, acted), step / seconds + self.velocity_offset)
        self._drift(playback, seconds)
        rotations = self.shown.rotations.astype(np.float32)
        return Pose(playback.root, rotations, self.shown.height.astype(np.float32), contacts)

    def _active(self) -> Rows:
        """The figures (n,) with an act or an offset."""
        return np.flatnonzero(self.plays | (np.abs(self.offset).max(axis=1) > 0))

    def _show(self, shown: Body, velocity: Array) -> None:
        """Remember what is shown in this tick."""
        self.shown_before = self.shown
        self.shown = shown
        self.velocity = velocity

    def _step(
        self, playback: Playback, root_before: Array, step: Array, contacts: NDArray[Any], whole: Flags
    ) -> NDArray[Any]:
        """Let whole bodies go where their acts do, in ``step`` and in the playback, and give the contacts of all."""
        contacts = contacts.copy()
        for figure in np.flatnonzero(whole).tolist():
            playing = cast(Playing, self.playing[figure])
            step[figure] = playing.act.step(playing.frame, root_before[figure, 2])
            contacts[figure] = playing.act.contacts[playing.frame]
            playback.root[figure] = root_before[figure] + step[figure]
        return contacts

    def _transition(
        self, base_before: Body, velocity: Array, figures: Rows, whole: Flags, settings: ActSettings, fps: float
    ) -> None:
        """Turn the jump in pose of figures (n,) into an inertialization offset: of the upper body, and where an act
        leads the whole body, or led it, of all of it and of the velocities (B, 3).

        base_before: bodies of the last tick without acts.
        """
        # the offset of the pose is its jump; legs that play no act keep theirs
        jump, jump_rate = self._jump(base_before, figures, fps)
        leads = (self.led | whole)[figures]
        keeps = ~leads[:, None] & BELOW
        offset = np.where(keeps, self.offset[figures], jump)
        offset_rate = np.where(keeps, self.offset_rate[figures], jump_rate)
        self.offset = _with(self.offset, figures, offset)
        self.offset_rate = _with(self.offset_rate, figures, offset_rate)
        self.stretch = _with(self.stretch, figures, _stretch(offset, settings))
        # that of the velocity is its jump as well
        led = figures[leads]
        self.velocity_offset = _with(self.velocity_offset, led, self.velocity[led] - velocity[led])

    def _jump(self, base_before: Body, figures: Rows, fps: float) -> tuple[Array, Array]:
        """The jump (n, 3 J + 1) from what figures (n,) now play to what was shown, and how fast it changes."""
        # in the last tick; and in this one, if what was shown had gone on
        shown = self.shown.at(figures)
        jump_before = shown.since(self._played(base_before, figures, 1))
        expected = shown.plus(shown.since(self.shown_before.at(figures)))
        jump_now = expected.since(self._played(self.base, figures, 0))
        jumps = np.stack([jump_before, jump_now])
        vectors = jumps[..., :-1].reshape(2, -1, 3)
        jumps[..., :-1] = continuous_rotvec(vectors).reshape(2, len(figures), -1)
        return jumps[0], (jumps[1] - jumps[0]) * fps

    def _fade(self, settings: ActSettings, seconds: float) -> None:
        """The offsets a tick later, dropped once they are invisible."""
        inertializer = Inertializer(settings.blend)
        offset, offset_rate = inertializer.update(self.offset, self.offset_rate, seconds, self.stretch)
        visible = (np.abs(offset).max(axis=1) > FADED)[:, None]
        self.offset = offset * visible
        self.offset_rate = offset_rate * visible
        self.velocity_offset = self.velocity_offset * visible * 0.5 ** (seconds / settings.blend)

    def _drift(self, playback: Playback, seconds: float) -> None:
        """Move figures on by the offset of their velocity; the springs of whole bodies that act go as they do."""
        drifts = (self.velocity_offset != 0).any(axis=1)
        playback.root[drifts] += self.velocity_offset[drifts] * seconds
        playback.root[:, 2] = wrapped(playback.root[:, 2])
        playback.spring[self.led] = np.column_stack([self.velocity[self.led, :2], playback.root[self.led, 2]])
        playback.spring_rate[self.led] = 0

    def _played(self, base: Body, figures: Rows, back: int) -> Body:
        """What figures (n,) play, over bases of all, ``back`` frames ago."""
        bodies = base.at(figures)
        rotations = bodies.rotations
        for n, figure in enumerate(figures):
            playing = self.playing[figure]
            if playing is None:
                continue
            acted = playing.act.rotations[playing.frame - back]
            if playing.whole:
                rotations[n] = acted
                bodies.height[n] = playing.act.height[playing.frame - back]
            else:
                rotations[n, UPPER] = acted[UPPER]
                # the spine as it is seen from the facing, whatever the hips do
                spine_from_facing = quat_product(acted[0], acted[SPINE_BONE])
                rotations[n, SPINE_BONE] = quat_product(conjugate(rotations[n, 0]), spine_from_facing)
        return bodies


def _is_whole(playing: Playing | None) -> bool:
    return playing is not None and playing.whole


def _continued(playing: Playing | None, goes: bool) -> Playing | None:
    """The next frame of an act, None after the last. goes: whether the figure is steered."""
    if playing is None or playing.frame + 1 >= len(playing.act):
        return None
    whole = playing.whole and not (goes and playing.yields)
    return playing._replace(frame=playing.frame + 1, age=playing.age + 1, whole=whole)


def _entered(
    order: ActOrder,
    before: Playing | None,
    figure: int,
    goes: bool,
    playback: Playback,
    matcher: Matcher,
    settings: ActSettings,
) -> Playing | None:
    """The act of an order, at the frame after the one that is most like the figure; None for none.

    before: what the figure plays. goes: whether it is steered.
    """
    act, upper = order
    if act is None:
        return None
    moves = goes or playback.pace[figure] > matcher.settings.idle
    keeps_moving = moves and act.legs  # its legs go on as it ends
    whole = not upper if upper is not None else bool(keeps_moving or not moves)
    # the first frames, compared with the figure as it is now
    most_skipped = min(round(settings.entry * matcher.fps), (len(act) - 1) // 3)
    entries = _scaled(matcher.table, act.features[: most_skipped + 1])
    difference = entries - _pose_features(matcher.table, playback, figure, before)
    cost = (difference[:, slice(None) if whole else HAND_FEATURES] ** 2).sum(axis=1)
    return Playing(act, int(cost.argmin()) + 1, 0, whole, upper is None and not keeps_moving)


def _stretch(offset: Array, settings: ActSettings) -> Array:
    """How many times as long as usual offsets (n, 3 J + 1) take to fade (n, 1): large jumps fade more slowly."""
    angles = np.linalg.norm(offset[:, :-1].reshape(len(offset), -1, 3), axis=2).max(axis=1)
    distance = np.maximum(angles, settings.height_weight * np.abs(offset[:, -1]))
    stretch: Array = (distance / settings.far).clip(1, settings.longest)[:, None]
    return stretch


def _pose_features(table: Table, playback: Playback, figure: int, playing: Playing | None) -> Array:
    """The scaled features (F - TRAJECTORY,) of a figure as it is shown."""
    row = playback.mirror[figure], playback.row[figure]
    features: Array = table.features[row][TRAJECTORY:].astype(np.float64)
    if playing is not None:
        acted = slice(None) if playing.whole else HAND_FEATURES
        features[acted] = _scaled(table, playing.act.features[playing.frame])[acted]
    return features


def _scaled(table: Table, features: Array) -> Array:
    """Features of poses (..., F - TRAJECTORY) as the table has them."""
    scaled: Array = (features - table.mean[TRAJECTORY:]) * table.scale[TRAJECTORY:]
    return scaled


def _with(values: Array, figures: Rows, changed: Array) -> Array:
    """A copy with other values for some figures (n,)."""
    values = values.copy()
    values[figures] = changed
    return values
