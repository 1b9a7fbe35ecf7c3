"""What steered figures are told to do, laid over their steps: acts (:mod:`motet.steering.acts`).

An act is begun where it is most like what the figure does, played to its end, and left for the recorded row that is
most like that. The whole body plays it, with its own way over the ground; or the upper body alone, turned as in the act
seen from the facing, while the legs go on. What a pose would lose at such a change is added to it and fades
(inertialization: Bollo 2018), and so is what the velocity over the ground would.

Letters in shapes as in :mod:`motet.steering.matching`; and J bones.
"""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from motet.figures.humanoid import BONES, LEFT_RIGHT, LEG, sided
from motet.motion.rotations import Array, conjugate, continuous_rotvec, quat_product, wrapped
from motet.motion.springs import damped, damping_of
from motet.steering.acts import Act, ActSettings
from motet.steering.events import Done
from motet.steering.matching import TRAJECTORY, Matcher, Playback, Rows
from motet.steering.pose import Pose
from motet.steering.step import PoseCodes, body

_LOWER = ("hips", *(sided(side, part) for side in LEFT_RIGHT for part in LEG))
UPPER = np.array([bone not in _LOWER for bone in BONES])
"""Which bones (J,) are of the upper body."""

BELOW = np.append(np.repeat(~UPPER, 3), True)
"""Which of the numbers (3 J + 1) that are added to a pose are of the lower body."""

SPINE = BONES.index("spine")

HANDS = slice(-6, None)
"""The last features, where the hands are: how the upper body is."""

METRE = 10.0
"""Radians that a metre of the hips' height counts as."""

LONGER = 1.75
"""Times as long that what is lost fades at most: who is to kneel at once is down in half a second."""

FADED = 1e-4
"""Radians, metres and metres a second of which nothing is seen: what is added is dropped then."""


class Body(NamedTuple):
    """rotations: (B, J, 4) as of :class:`motet.steering.pose.Pose`. height: (B,) of the hips."""

    rotations: NDArray[Any]
    height: NDArray[Any]

    def at(self, who: Rows) -> "Body":
        """Those of some figures (n,), float64."""
        return Body(self.rotations[who].astype(np.float64), self.height[who].astype(np.float64))

    def put(self, who: Rows, other: "Body") -> "Body":
        """With others in place of those of some figures (n,)."""
        found = self.rotations.copy(), self.height.copy()
        found[0][who], found[1][who] = other
        return Body(*found)

    def since(self, other: "Body") -> Array:
        """What is to be added (B, 3 J + 1) to other bodies to make them these: rotation vectors in the frames of the
        parents, and height."""
        turns = quat_product(self.rotations, conjugate(other.rotations))
        turns = np.where(turns[..., 3:] < 0, -turns, turns)
        sine = np.linalg.norm(turns[..., :3], axis=-1, keepdims=True)
        angle = 2 * np.arctan2(sine, turns[..., 3:])
        vectors = turns[..., :3] * np.where(sine > 1e-9, angle / np.maximum(sine, 1e-9), 2.0)
        return np.column_stack([vectors.reshape(len(vectors), -1), self.height - other.height])

    def plus(self, more: Array) -> "Body":
        """With what :meth:`since` gives added."""
        vectors = more[:, :-1].reshape(len(more), -1, 3)
        angle = np.linalg.norm(vectors, axis=-1, keepdims=True)
        turns = np.concatenate([vectors * np.sinc(angle / (2 * np.pi)) / 2, np.cos(angle / 2)], axis=-1)
        return Body(quat_product(turns, self.rotations), self.height + more[:, -1])


class Playing(NamedTuple):
    """What a figure plays. frame: that is shown. age: ticks since it was begun. whole: whether by the whole body.
    yields: whether the legs go as soon as they are told to."""

    act: Act
    frame: int
    age: int
    whole: bool
    yields: bool


@dataclass(eq=False)
class Acting:
    """The acts of B figures.

    playing: what each plays. asked: the act that a figure begins in the next tick, None to end what it plays, and
    whether by the upper body alone; None: by the whole body where it stands, or where the act is one of the legs. base:
    bodies of the last tick without acts. shown, before: as they were shown in the last tick and in the one before. led:
    (B,) whether an act led the whole body in the last tick. offset, offset_rate: (B, 3 J + 1) what is added, as
    :meth:`Body.since` gives it, and how fast it changes. damping: (B, 1) by which it fades. going: (B, 3) velocity over
    the ground, m/s along x and z and rad/s. drift: (B, 3) the part of it that fades.
    """

    matcher: Matcher
    codes: PoseCodes
    how: ActSettings
    playing: list[Playing | None]
    asked: dict[int, tuple[Act | None, bool | None]]
    base: Body
    shown: Body
    before: Body
    led: NDArray[np.bool_]
    offset: Array
    offset_rate: Array
    damping: Array
    going: Array
    drift: Array

    @staticmethod
    def of(playback: Playback, matcher: Matcher, codes: PoseCodes, how: ActSettings) -> "Acting":
        """Of figures that play none, and stand as they are played."""
        played, _ = matcher.table.at(playback)
        shown = Body(*body(codes, playback, played))
        off, still = np.zeros((len(played), 3 * len(BONES) + 1)), np.zeros((len(played), 3))
        led, damping = still[:, 0] > 0, still[:, :1]
        return Acting(
            matcher, codes, how, [None] * len(played), {}, shown, shown, shown, led, off, off, damping, still, still
        )

    def copy(self) -> "Acting":
        """One that changes by itself; arrays are replaced, never written into."""
        return replace(self, playing=list(self.playing), asked=dict(self.asked))

    @property
    def acts(self) -> bool:
        """Whether any figure plays an act."""
        return self.playing.count(None) < len(self.playing)

    @property
    def done(self) -> tuple[Done | None, ...]:
        """What each figure does."""
        if not self.acts:
            return (None,) * len(self.playing)
        return tuple(one and Done(one.act.name, one.age) for one in self.playing)

    @property
    def whole(self) -> NDArray[np.bool_]:
        """Which figures (B,) play an act with the whole body."""
        return np.array([one is not None and one.whole for one in self.playing])

    def begin(self, playback: Playback, target: Array, gait: Rows) -> Rows:
        """Before a tick: go on by a frame, begin what is asked, end what is over. The figures (n,) of which something
        else is shown from now on; legs that no act moves any more are at the row that fits best.

        target: (B, 3) velocity along x and z, and facing. gait: (B,).
        """
        if not self.asked and not self.acts:
            return np.empty(0, dtype=np.int64)
        changed, freed = list[int](), list[int]()
        goes, before = np.hypot(*target[:, :2].T) > 0, list(self.playing)
        for i, now in enumerate(before):
            if now is None and i not in self.asked:
                continue
            self.playing[i] = after = self._after(i, playback, bool(goes[i]))
            if i in self.asked or not after or not now or after.whole != now.whole:
                changed.append(i)
            if now and now.whole and not (after and after.whole):
                freed.append(i)
        self.asked = {}
        if freed:
            shown = np.stack([now.act.features[now.frame] for now in (before[i] for i in freed) if now])
            self._free(shown, playback, target, gait, np.array(freed))
        return np.array(changed, dtype=np.int64)

    def _after(self, figure: int, playback: Playback, goes: bool) -> Playing | None:
        """What a figure plays in the next tick."""
        now = self.playing[figure]
        if figure in self.asked:
            act, upper = self.asked[figure]
            return None if act is None else self._entered(figure, act, upper, playback, goes)
        if now is None or now.frame + 1 >= len(now.act):
            return None
        return now._replace(frame=now.frame + 1, age=now.age + 1, whole=now.whole and not (goes and now.yields))

    def _entered(self, figure: int, act: Act, upper: bool | None, playback: Playback, goes: bool) -> Playing:
        """The act that is asked for, at the frame after the one that is most like the figure."""
        now, table, how = self.playing[figure], self.matcher.table, self.how
        moves = goes or np.hypot(*playback.spring[figure, :2]) > self.matcher.settings.idle
        stays = moves and act.legs  # its legs go on as it ends
        whole = (stays or not moves) if upper is None else not upper
        is_now = table.features[playback.mirror[figure], playback.row[figure], TRAJECTORY:].astype(np.float64)
        if now is not None:
            known = slice(None) if now.whole else HANDS
            is_now[known] = self._scaled(now.act.features[now.frame])[known]
        entries = min(round(how.entry * self.matcher.fps), (len(act) - 1) // 3) + 1
        off = self._scaled(act.features[:entries]) - is_now
        cost = (off[:, slice(None) if whole else HANDS] ** 2).sum(axis=1)
        return Playing(act, int(cost.argmin()) + 1, 0, whole, upper is None and not stays)

    def _scaled(self, features: Array) -> Array:
        """Features of how figures are (..., F - TRAJECTORY) as the table has them."""
        table = self.matcher.table
        return (features - table.mean[TRAJECTORY:]) * table.scale[TRAJECTORY:]

    def _free(self, shown: Array, playback: Playback, target: Array, gait: Rows, who: Rows) -> None:
        """Let the legs of figures (n,) go on from the rows that fit best after what is shown, features of it."""
        matcher, table = self.matcher, self.matcher.table
        ahead = matcher.desired_trajectory(playback, target, matcher.is_slow_walk(target[who], gait[who]), who)
        wanted = (ahead - table.mean[:TRAJECTORY]) * table.scale[:TRAJECTORY]
        query = matcher.query(np.concatenate([wanted, self._scaled(shown)], axis=1).astype(np.float32))
        playback.row[who], playback.mirror[who], _ = matcher.best(query, gait[who])
        playback.part[who], playback.rate[who] = 0, 1
        playback.offset[who] = playback.offset_rate[who] = 0
        playback.warp[who] = playback.warp_rate[who] = playback.stride_rate[who] = 0
        playback.stride[who] = 1
        played, _ = table.at(playback, who)
        self.base = self.base.put(who, Body(*self.codes.decode(played[:, : table.codes])))

    def laid(self, pose: Pose, playback: Playback, root: Array, changed: Rows) -> Pose:
        """After a tick: its pose with acts laid over it, and the playback where they lead.

        root: (B, 3) before the tick. changed: (n,) as :meth:`begin` gave them.
        """
        dt, base, self.base = 1 / self.matcher.fps, self.base, Body(pose.rotations, pose.height)
        step = playback.root - root
        step[:, 2] = wrapped(step[:, 2])
        if not (len(changed) or self.acts or self.led.any() or self.offset.any()):
            self.before, self.shown, self.going = self.shown, self.base, step / dt
            return pose
        contacts = pose.contacts.copy()
        for i in np.flatnonzero(self.whole).tolist():
            one = cast(Playing, self.playing[i])
            step[i], contacts[i] = one.act.step(one.frame, root[i, 2]), one.act.contacts[one.frame]
            playback.root[i] = root[i] + step[i]
        self._lose(base, step / dt, changed)
        self.before, self.led = self.shown, self.whole
        who = np.flatnonzero([one is not None for one in self.playing] | (np.abs(self.offset).max(axis=1) > 0))
        if not len(who):
            self.shown, self.going = self.base, step / dt
            return pose
        self._fade(dt)
        self.shown = self.base.put(who, self._source(self.base, who, 0).plus(self.offset[who]))
        self.going = step / dt + self.drift
        self._lead(playback, dt)
        return replace(
            pose,
            ground=playback.root,
            rotations=self.shown.rotations.astype(np.float32),
            height=self.shown.height.astype(np.float32),
            contacts=contacts,
        )

    def _lose(self, base: Body, going: Array, who: Rows) -> None:
        """What figures (n,) lose from the last tick to this one is added to them: of the upper body, and where an act
        leads the whole body, or led it, of all of it and of velocities (B, 3).

        base: bodies of the last tick without acts.
        """
        if not len(who):
            return
        shown, source = self.shown.at(who), self._source(self.base, who, 0)
        off = shown.since(self._source(base, who, 1))
        ahead = shown.plus(shown.since(self.before.at(who))).since(source)
        both = np.stack([off, ahead])
        both[..., :-1] = continuous_rotvec(both[..., :-1].reshape(2, -1, 3)).reshape(2, len(who), -1)
        off, rate = both[0], (both[1] - both[0]) * self.matcher.fps
        leads = (self.led | self.whole)[who]
        kept = ~leads[:, None] & BELOW
        off, rate = np.where(kept, self.offset[who], off), np.where(kept, self.offset_rate[who], rate)
        turns = np.linalg.norm(off[:, :-1].reshape(len(who), -1, 3), axis=2).max(axis=1)
        far = np.maximum(turns, METRE * np.abs(off[:, -1])) / self.how.far
        names = ("offset", "offset_rate", "damping", "drift")
        self.offset, self.offset_rate, self.damping, self.drift = (getattr(self, name).copy() for name in names)
        self.offset[who], self.offset_rate[who] = off, rate
        self.damping[who, 0] = damping_of(self.how.blend) / far.clip(1, LONGER)
        self.drift[who[leads]] = self.going[who[leads]] - going[who[leads]]

    def _fade(self, dt: float) -> None:
        """What is added, a tick later; nothing where nothing is seen of it any more."""
        off, rate = damped(self.offset, self.offset_rate, self.damping, dt)
        left = (np.abs(off).max(axis=1) > FADED)[:, None]
        self.offset, self.offset_rate = off * left, rate * left
        self.drift = self.drift * left * 0.5 ** (dt / self.how.blend)

    def _lead(self, playback: Playback, dt: float) -> None:
        """Move figures on by what fades of their velocity; those whose whole body acts mean to go as they do."""
        drifts = (self.drift != 0).any(axis=1)
        playback.root[drifts] += self.drift[drifts] * dt
        playback.root[:, 2] = wrapped(playback.root[:, 2])
        whole = self.led
        playback.spring[whole] = np.column_stack([self.going[whole, :2], playback.root[whole, 2]])
        playback.spring_rate[whole] = 0

    def _source(self, base: Body, who: Rows, back: int) -> Body:
        """What figures (n,) play, over bases of all, so many frames before."""
        rotations, height = base.at(who)
        for k, one in enumerate(self.playing[i] for i in who):
            if one is None:
                continue
            played = one.act.rotations[one.frame - back]
            if one.whole:
                rotations[k], height[k] = played, one.act.height[one.frame - back]
            else:
                rotations[k, UPPER] = played[UPPER]
                seen = quat_product(played[0], played[SPINE])
                rotations[k, SPINE] = quat_product(conjugate(rotations[k, 0]), seen)
        return Body(rotations, height)
