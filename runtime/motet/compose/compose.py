"""Compose: prompts on a time line, and places, facings and poses that are met at given times.

Walks and runs to a place are steered as by ``control``, all else is a story as of ``generate``; what then still lacks
at a place is added to the path, and at a pose to the joints around it; standing feet are held.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby, pairwise
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from motet.compose.keys import Key, Moves
from motet.compose.plans import Moment, time_line
from motet.compose.steered_segments import Leg, Walk, gait_of, walked
from motet.errors import MotionError, SettingError
from motet.figures.feet.hold import hold_feet
from motet.figures.humanoid import BONES, HUMANOID, on_humanoid, sole_points
from motet.motion.kinematics import (
    global_transforms,
    heading,
    local_rotations,
    local_translations,
    posed,
    positions,
)
from motet.motion.motion import Motion
from motet.motion.rotations import Array, wrapped
from motet.representation.placed import placed, pose_of, put_at, seen_from, unplaced
from motet.steering.model import SteerModel
from motet.text.clauses import Passage

if TYPE_CHECKING:
    from motet.generate.model import CodesModel, Story

REACH = 0.5
"""Seconds within which a figure comes to a pose, and leaves it."""

DRIFT = 0.5
"""Metres a second by which a motion that is not steered is moved at most: more is seen."""

DRAWS = 4
"""How often such a motion is drawn at most."""

FLAT = np.array([1.0, np.nan, 1.0])
"""Of a place, x and z: the height stays free."""

BURIED = 0.05
"""Metres that a pose may be under the ground, where soles are thinner than the humanoid's."""


What = Literal["place", "facing", "pose"]


class Met(NamedTuple):
    """How well something asked for was met.

    off: centimetres of a place; degrees of a facing; of a pose the mean distance of its joints in centimetres, with the
        figure's place and heading taken out. worst: of a pose, that of its worst joint. late: seconds from when it was
        asked to when it is nearest, within a centimetre or a degree.
    """

    at: float
    what: What
    off: float
    worst: float
    late: float

    def __str__(self) -> str:
        """In words."""
        unit = "degrees" if self.what == "facing" else "cm"
        worst = f" (worst joint {self.worst:.1f})" if self.what == "pose" else ""
        return f"{self.at:g} s {self.what}: {self.off:.1f} {unit} off{worst}, {self.late:.2f} s"


@dataclass(frozen=True, eq=False)
class Composition:
    """A motion of the humanoid at the models' rate; when each prompt is shown; how well all else was met."""

    motion: Motion
    passages: tuple[Passage, ...]
    met: tuple[Met, ...]


def _frame(at: float, fps: float) -> int:
    """The frame of a moment: the last one before it, since the next one begins what comes then."""
    return max(0, round(at * fps) - 1)


class _Part(NamedTuple):
    """A prompt, the frames in which it is shown, and, where it is steered to places, its walk."""

    text: str
    start: int
    stop: int
    walk: Walk | None


def compose(moments: Sequence[Moment], writer: "CodesModel", steer: SteerModel, seed: int, strict: bool) -> Composition:
    """See :meth:`motet.CodesModel.compose`."""
    fps = writer.fps
    if fps != steer.fps:
        raise SettingError(f"models of one frame rate are needed, not {fps:g} and {steer.fps:g}")
    line, motion, passages = time_line(moments), None, list[Passage]()
    poses = {_frame(one.at, fps): _pose(one) for one in line if one.pose is not None}
    start = _start(line[0])
    legs = [_leg(one, start, fps) for one in line[1:] if (one.place, one.facing) != (None, None)]
    for parts in _runs(_parts(line, legs, steer)):
        own = [leg for leg in legs if parts[0].start <= leg.frame < parts[-1].stop]
        if walk := parts[0].walk:
            motion = _led(motion, walked(steer, walk, motion), parts, own)
            passages.append(Passage(walk.text, walk.start / fps, walk.stop / fps, f"{walk.gait.name}, steered"))
        else:
            motion, story = _told(parts, own, writer, motion, seed, strict)
            begun = parts[0].start / fps
            passages += [replace(one, start=one.start + begun, stop=one.stop + begun) for one in story.passages]
    assert motion is not None
    motion = hold_feet(_through(moved(motion, line[0]), poses), ground=0.0)
    return Composition(motion, tuple(passages), met(motion, line))


def _leg(moment: Moment, start: Array, fps: float) -> Leg:
    """Where a moment asks to be, as it is seen from the start (3,): x, z and facing."""
    sin, cos = np.sin(start[2]), np.cos(start[2])
    x, z = np.array(moment.place or (0.0, 0.0)) - start[:2]
    place = np.array([x * cos - z * sin, z * cos + x * sin]) if moment.place else None
    return Leg(_frame(moment.at, fps), place, None if moment.facing is None else math.radians(moment.facing) - start[2])


def _parts(line: Sequence[Moment], legs: Sequence[Leg], steer: SteerModel) -> list[_Part]:
    """The prompts in order. One with a gait goes to its own places, then towards the next one that is asked for."""
    told = [one for one in line if one.text is not None]
    starts = [round(one.at * steer.fps) for one in (*told, line[-1])]
    gaits = [gait_of(str(one.text), steer) for one in told]
    found = []
    for i, (one, gait, (start, stop)) in enumerate(zip(told, gaits, pairwise(starts), strict=True)):
        until = next((starts[j] for j in range(i + 1, len(told)) if gaits[j]), starts[-1])
        ahead = [leg for leg in legs if start <= leg.frame < until]
        own = [leg for leg in ahead if leg.frame < stop]
        if not own or own[-1].frame < stop - 1:
            own += [leg._replace(frame=stop - 1) for leg in ahead[len(own) : len(own) + 1]]
        halts = i + 1 < len(told) and not gaits[i + 1]
        walk = Walk(str(one.text), start, stop, gait, own, halts) if gait and own else None
        found.append(_Part(str(one.text), start, stop, walk))
    return found


def _runs(parts: Sequence[_Part]) -> Iterator[list[_Part]]:
    """Each walk alone, and all parts between walks together."""
    for _, run in groupby(parts, lambda part: part.start if part.walk else -1):
        yield list(run)


def _told(
    parts: Sequence[_Part], legs: Sequence[Leg], writer: "CodesModel", after: Motion | None, seed: int, strict: bool
) -> tuple[Motion, "Story"]:
    """Prompts that are not steered, each as long as it is shown; drawn anew where a draw is too far from a place."""
    seconds = [(part.stop - part.start) / writer.fps for part in parts]
    texts = [part.text for part in parts]
    for again in reversed(range(DRAWS)):
        story = writer.story(texts, seconds=seconds, after=after, seed=seed, strict=strict)
        try:
            new = writer.contract.motion(story.frames, after=after, plant=False)
            return _led(after, new, parts, legs), story
        except MotionError:
            if not again:
                raise
        seed = int(np.random.SeedSequence(seed).generate_state(1)[0])
    raise AssertionError


def _through(motion: Motion, poses: Mapping[int, Array]) -> Motion:
    """The motion that comes to poses (1, E), where the figure is then, and leaves them."""
    moves, keys = _moves(motion), {}
    for at, pose in poses.items():
        here = unplaced(put_at(seen_from(pose, pose_of(pose[0])), pose_of(placed(motion[at])[0])), motion)
        height = np.array([np.nan, pose[0, 1], np.nan])
        keys[at] = Key(dict(enumerate(local_rotations(here)[0])), height, moves.facing[at])
    moves = moves.through(keys, round(REACH * motion.fps))
    turned = {name: moves.turns[:, joint] for joint, name in enumerate(HUMANOID.names)}
    return posed(motion, turned, {BONES[0]: moves.root}).continuous()


def _moves(motion: Motion) -> Moves:
    return Moves(local_rotations(motion), local_translations(motion)[:, 0], heading(motion))


def _led(before: Motion | None, own: Motion, parts: Sequence[_Part], legs: Sequence[Leg]) -> Motion:
    """A motion and the next parts, which are led to where they lack: turned on the way to a place, and moved.
    MotionError where that is too much, with the time it takes."""
    begun, last = parts[0].start, 0
    moves = _moves(own)
    for leg in legs:
        at = leg.frame - begun
        here = {last: Key(place=moves.root[last] * FLAT, facing=moves.facing[last])}
        place = FLAT * np.nan if leg.place is None else np.insert(leg.place, 1, np.nan)
        went, wanted = ((to - moves.root[last])[[0, 2]] for to in (moves.root[at], place))
        if leg.facing is None and np.hypot(*(wanted - went)) > DRIFT and np.hypot(*went) > DRIFT:
            turn, turned = np.arctan2(*wanted) - np.arctan2(*went), min(last + round(own.fps), at)
            moves = moves.through(here | {turned: Key(facing=moves.facing[turned] + turn)}, 1)
        lacks, seconds = float(np.hypot(*(place - moves.root[at])[[0, 2]])), (at - last) / own.fps
        if lacks > DRIFT * max(1.0, seconds):
            text = next(part.text for part in parts if leg.frame < part.stop)
            goes, far = (float(np.hypot(*way)) for way in (went, wanted))
            takes = "walk there first" if goes < DRIFT else f"it takes {far / goes * seconds:.1f} s"
            raise MotionError(
                f"{text!r} goes {goes:.1f} m in {seconds:.1f} s, and the place of {(leg.frame + 1) / own.fps:.3g} s "
                f"is {far:.1f} m away: {takes if goes < far else 'it does not stay so near'}"
            )
        moves = moves.through(here | {at: Key(place=place, facing=np.nan if leg.facing is None else leg.facing)}, 1)
        last = at
    root = BONES[0]
    found = posed(own, {root: moves.turns[:, 0]}, {root: moves.root})
    together = found.values if before is None else np.concatenate([before.values, found.values])
    return replace(own, values=together).continuous()


def _pose(moment: Moment) -> Array:
    """The placed frame (1, E) of a moment's pose; MotionError for one of no human, or under the ground."""
    assert moment.pose is not None
    try:
        one = on_humanoid(moment.pose)[int(moment.pose_at * moment.pose.fps)]
    except MotionError as error:
        raise MotionError(f"the pose of {moment.at:g} s: {error}") from error
    turned, places = global_transforms(one)
    low = min(float(places[..., 1].min()), float(sole_points(turned, places)[..., 1].min()))
    if low < -BURIED:
        raise MotionError(f"the pose of {moment.at:g} s is {-100 * low:.0f} cm under the ground")
    found: Array = placed(one)
    return found


def moved(motion: Motion, start: Moment) -> Motion:
    """A motion of the humanoid that begins at the origin, as it is seen where a moment says."""
    return unplaced(put_at(placed(motion), _start(start)), motion)


def _start(moment: Moment) -> Array:
    return np.array([*(moment.place or (0.0, 0.0)), math.radians(moment.facing or 0.0)])


def met(motion: Motion, moments: Sequence[Moment]) -> tuple[Met, ...]:
    """What moments ask for, beside what a motion of the humanoid does within a second of them."""
    frames, turned, found = placed(motion), heading(motion), list[Met]()
    for one in moments:
        at = min(_frame(one.at, motion.fps), len(motion) - 1)
        near = slice(max(0, at - round(motion.fps)), at + round(motion.fps) + 1)
        off: dict[What, Array] = {}  # by frame and joint
        if one.place is not None:
            off["place"] = 100 * np.hypot(*(frames[near][:, [0, 2]] - one.place).T)[:, None]
        if one.facing is not None:
            off["facing"] = np.abs(np.degrees(wrapped(turned[near] - math.radians(one.facing))))[:, None]
        if one.pose is not None:
            off["pose"] = 100 * np.linalg.norm(_joints(frames[near], motion) - _joints(_pose(one), motion), axis=-1)
        for what, each in off.items():
            mean, late = each.mean(axis=1), np.abs(np.arange(len(each)) + near.start - at) / motion.fps
            here = at - near.start
            nearest = float(late[mean <= mean.min() + 1].min())
            found.append(Met(one.at, what, float(mean[here]), float(each[here].max()), nearest))
    return tuple(found)


def _joints(frames: Array, like: Motion) -> Array:
    """Places (T, J, 3) of the joints of placed frames (T, E), each frame seen from where it is, without tips."""
    seen = seen_from(frames[:, None], pose_of(frames))[:, 0]
    joints = [HUMANOID.index(name) for name in BONES]
    found: Array = positions(unplaced(seen, like))[:, joints]
    return found
