"""Compose: prompts on a time line, and places, facings and poses that are met at their times.

Walks and runs to a place are steered as by ``control``, all else is a story as of ``generate``. The rest of the way to
a place is added to the path, and the difference from a pose to the joints around it; standing feet are held.
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
"""Largest invisible correction of an unsteered motion, m/s."""

DRAWS = 4
"""The most times that an unsteered motion is drawn."""

FLAT = np.array([1.0, np.nan, 1.0])
"""Multiplies a place: x and z stay, and the height is free."""

BURIED = 0.05
"""Metres that a pose may be under the ground, where soles are thinner than the humanoid's."""


What = Literal["place", "facing", "pose"]


class Met(NamedTuple):
    """How well a place, a facing or a pose was met."""

    at: float
    """Its time in the plan, seconds."""

    what: What

    off: float
    """Centimetres of a place; degrees of a facing; of a pose the mean distance of its joints in centimetres, with the
    figure's place and heading taken out."""

    worst: float
    """Of a pose, the distance of its worst joint."""

    late: float
    """Seconds between its time and the time at which it is nearest, within a centimetre or a degree."""

    def __str__(self) -> str:
        """In words."""
        unit = "degrees" if self.what == "facing" else "cm"
        worst = f" (worst joint {self.worst:.1f})" if self.what == "pose" else ""
        return f"{self.at:g} s {self.what}: {self.off:.1f} {unit} off{worst}, {self.late:.2f} s"


@dataclass(frozen=True, eq=False)
class Composition:
    """A motion that follows a plan."""

    motion: Motion
    """Of the humanoid, at the models' frame rate."""

    passages: tuple[Passage, ...]
    """When each prompt is shown."""

    met: tuple[Met, ...]
    """How well places, facings and poses were met."""


def _frame(at: float, fps: float) -> int:
    """The frame of a moment: the last one before it, since the next frame begins what follows."""
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
    line = time_line(moments)
    poses = {_frame(moment.at, fps): _pose(moment) for moment in line if moment.pose is not None}
    start = _start(line[0])
    legs = []
    for moment in line[1:]:
        if moment.place is not None or moment.facing is not None:
            legs.append(_leg(moment, start, fps))

    # Prompts are drawn as seen from the start; then the motion is put there, led through the poses, and its feet held.
    motion, passages = _shown(_parts(line, legs, steer), legs, writer, steer, seed, strict)
    motion = hold_feet(_through(moved(motion, line[0]), poses), ground=0.0)
    return Composition(motion, tuple(passages), met(motion, line))


def _shown(
    parts: Sequence[_Part], legs: Sequence[Leg], writer: "CodesModel", steer: SteerModel, seed: int, strict: bool
) -> tuple[Motion, list[Passage]]:
    """The motion of prompts, and when each is shown: walks one by one, and all between two walks as one story."""
    motion: Motion | None = None
    passages: list[Passage] = []
    for run in _runs(parts):
        begin = run[0].start / writer.fps
        run_legs = [leg for leg in legs if run[0].start <= leg.frame < run[-1].stop]
        if walk := run[0].walk:
            motion = _led(motion, walked(steer, walk, motion), run, run_legs)
            passages.append(Passage(walk.text, begin, walk.stop / writer.fps, f"{walk.gait.name}, steered"))
        else:
            motion, story = _drawn(run, run_legs, writer, motion, seed, strict)
            for passage in story.passages:
                passages.append(replace(passage, start=passage.start + begin, stop=passage.stop + begin))
    assert motion is not None
    return motion, passages


def _leg(moment: Moment, start: Array, fps: float) -> Leg:
    """The place and facing of a moment, seen from the start (3,): x, z and facing."""
    frame = _frame(moment.at, fps)
    place = None
    if moment.place:
        sin = np.sin(start[2])
        cos = np.cos(start[2])
        x, z = np.array(moment.place) - start[:2]
        place = np.array([x * cos - z * sin, z * cos + x * sin])
    return Leg(frame, place, None if moment.facing is None else math.radians(moment.facing) - start[2])


def _parts(line: Sequence[Moment], legs: Sequence[Leg], steer: SteerModel) -> list[_Part]:
    """The prompts in order. One with a gait goes to its own places, then towards the next place of the plan."""
    prompts = [moment for moment in line if moment.text is not None]
    starts = [round(moment.at * steer.fps) for moment in (*prompts, line[-1])]
    gaits = [gait_of(str(prompt.text), steer) for prompt in prompts]
    parts = []
    for i, (prompt, gait, (start, stop)) in enumerate(zip(prompts, gaits, pairwise(starts), strict=True)):
        text = str(prompt.text)
        next_walk = next((starts[j] for j in range(i + 1, len(prompts)) if gaits[j]), starts[-1])
        walk_legs = _walk_legs([leg for leg in legs if start <= leg.frame < next_walk], stop)
        halts = i + 1 < len(prompts) and not gaits[i + 1]
        walk = Walk(text, start, stop, gait, walk_legs, halts) if gait and walk_legs else None
        parts.append(_Part(text, start, stop, walk))
    return parts


def _walk_legs(ahead: Sequence[Leg], stop: int) -> list[Leg]:
    """The legs of a walk that stops at a frame, of those ahead: its own, then the next one as far as it gets."""
    walk_legs = [leg for leg in ahead if leg.frame < stop]
    following = ahead[len(walk_legs) :]
    if following and (not walk_legs or walk_legs[-1].frame < stop - 1):
        walk_legs.append(following[0]._replace(frame=stop - 1))
    return walk_legs


def _runs(parts: Sequence[_Part]) -> Iterator[list[_Part]]:
    """Each walk alone, and all parts between walks together."""
    for _, run in groupby(parts, lambda part: part.start if part.walk else -1):
        yield list(run)


def _drawn(
    parts: Sequence[_Part], legs: Sequence[Leg], writer: "CodesModel", after: Motion | None, seed: int, strict: bool
) -> tuple[Motion, "Story"]:
    """Prompts that are not steered, each as long as it is shown; drawn again if the motion is too far from a place."""
    seconds = [(part.stop - part.start) / writer.fps for part in parts]
    texts = [part.text for part in parts]
    for draws_left in reversed(range(DRAWS)):
        story = writer.story(texts, seconds=seconds, after=after, seed=seed, strict=strict)
        try:
            new = writer.contract.motion(story.frames, after=after, plant=False)
            return _led(after, new, parts, legs), story
        except MotionError:
            if not draws_left:
                raise
        seed = int(np.random.SeedSequence(seed).generate_state(1)[0])
    raise AssertionError


def _through(motion: Motion, poses: Mapping[int, Array]) -> Motion:
    """The motion that comes to poses (1, E), wherever the figure is at their frames, and leaves them."""
    moves = _moves(motion)
    keys = {}
    for at, pose in poses.items():
        place_of_figure = pose_of(placed(motion[at])[0])
        pose_there = unplaced(put_at(seen_from(pose, pose_of(pose[0])), place_of_figure), motion)
        height = np.array([np.nan, pose[0, 1], np.nan])
        keys[at] = Key(dict(enumerate(local_rotations(pose_there)[0])), height, moves.facing[at])
    moves = moves.through(keys, round(REACH * motion.fps))
    turns = {name: moves.turns[:, joint] for joint, name in enumerate(HUMANOID.names)}
    return posed(motion, turns, {BONES[0]: moves.root}).continuous()


def _moves(motion: Motion) -> Moves:
    return Moves(local_rotations(motion), local_translations(motion)[:, 0], heading(motion))


def _led(before: Motion | None, motion: Motion, parts: Sequence[_Part], legs: Sequence[Leg]) -> Motion:
    """A motion and the next parts, led to their places: turned on the way to each, and moved. MotionError where that
    is too much, with the time it takes."""
    moves = _moves(motion)
    last = 0
    for leg in legs:
        at = leg.frame - parts[0].start
        text = next(part.text for part in parts if leg.frame < part.stop)
        moves = _led_to(moves, leg, last, at, motion.fps, text)
        last = at
    root = BONES[0]
    new = posed(motion, {root: moves.turns[:, 0]}, {root: moves.root})
    together = new.values if before is None else np.concatenate([before.values, new.values])
    return replace(motion, values=together).continuous()


def _led_to(moves: Moves, leg: Leg, last: int, at: int, fps: float, text: str) -> Moves:
    """Moves of a text that are led from where they are at one frame to the place of a leg at another."""
    # The way over the ground that the motion goes, and the way to the place; NaN without one.
    way = (moves.root[at] - moves.root[last])[[0, 2]]
    place = FLAT * np.nan if leg.place is None else np.insert(leg.place, 1, np.nan)
    wanted = (place - moves.root[last])[[0, 2]]
    here = {last: Key(place=moves.root[last] * FLAT, facing=moves.facing[last])}

    # Turned within a second, unless the facing is planned or the way is short.
    if leg.facing is None and np.hypot(*(wanted - way)) > DRIFT and np.hypot(*way) > DRIFT:
        turn = np.arctan2(*wanted) - np.arctan2(*way)
        turned = min(last + round(fps), at)
        moves = moves.through(here | {turned: Key(facing=moves.facing[turned] + turn)}, 1)

    # Moved the rest of the way.
    rest = float(np.hypot(*(place - moves.root[at])[[0, 2]]))
    seconds = (at - last) / fps
    if rest > DRIFT * max(1.0, seconds):
        raise _too_far(text, way, wanted, seconds, (leg.frame + 1) / fps)
    facing = np.nan if leg.facing is None else leg.facing
    return moves.through(here | {at: Key(place=place, facing=facing)}, 1)


def _too_far(text: str, way: Array, wanted: Array, seconds: float, at: float) -> MotionError:
    """The error of a prompt that goes a way (2,) in some seconds, and not the way that is wanted until ``at``."""
    goes = float(np.hypot(*way))
    far = float(np.hypot(*wanted))
    advice = "it does not stay so near"
    if goes < far:
        advice = "walk there first" if goes < DRIFT else f"it takes {far / goes * seconds:.1f} s"
    return MotionError(
        f"{text!r} goes {goes:.1f} m in {seconds:.1f} s, and the place of {at:.3g} s is {far:.1f} m away: {advice}"
    )


def _pose(moment: Moment) -> Array:
    """The placed frame (1, E) of a moment's pose; MotionError for one of no human, or under the ground."""
    assert moment.pose is not None
    try:
        pose = on_humanoid(moment.pose)[int(moment.pose_at * moment.pose.fps)]
    except MotionError as error:
        raise MotionError(f"the pose of {moment.at:g} s: {error}") from error
    rotations, positions_of_joints = global_transforms(pose)
    soles = sole_points(rotations, positions_of_joints)
    low = min(float(positions_of_joints[..., 1].min()), float(soles[..., 1].min()))
    if low < -BURIED:
        raise MotionError(f"the pose of {moment.at:g} s is {-100 * low:.0f} cm under the ground")
    frame: Array = placed(pose)
    return frame


def moved(motion: Motion, start: Moment) -> Motion:
    """A motion of the humanoid that begins at the origin, put at the place and facing of a moment."""
    return unplaced(put_at(placed(motion), _start(start)), motion)


def _start(moment: Moment) -> Array:
    return np.array([*(moment.place or (0.0, 0.0)), math.radians(moment.facing or 0.0)])


def met(motion: Motion, moments: Sequence[Moment]) -> tuple[Met, ...]:
    """How well a motion of the humanoid meets the moments of a plan, within a second of each."""
    frames = placed(motion)
    headings = heading(motion)
    results = []
    for moment in moments:
        at = min(_frame(moment.at, motion.fps), len(motion) - 1)
        first = max(0, at - round(motion.fps))
        near = slice(first, at + round(motion.fps) + 1)
        for what, distances in _distances(moment, frames[near], headings[near], motion).items():
            mean = distances.mean(axis=1)
            seconds_off = np.abs(np.arange(len(mean)) + first - at) / motion.fps
            late = float(seconds_off[mean <= mean.min() + 1].min())
            here = at - first
            results.append(Met(moment.at, what, float(mean[here]), float(distances[here].max()), late))
    return tuple(results)


def _distances(moment: Moment, frames: Array, headings: Array, motion: Motion) -> dict[What, Array]:
    """The distances (T, J) of a moment's place, facing and pose from placed frames (T, E): centimetres and degrees."""
    distances: dict[What, Array] = {}
    if moment.place is not None:
        distances["place"] = 100 * np.hypot(*(frames[:, [0, 2]] - moment.place).T)[:, None]
    if moment.facing is not None:
        distances["facing"] = np.abs(np.degrees(wrapped(headings - math.radians(moment.facing))))[:, None]
    if moment.pose is not None:
        off = _joints(frames, motion) - _joints(_pose(moment), motion)
        distances["pose"] = 100 * np.linalg.norm(off, axis=-1)
    return distances


def _joints(frames: Array, like: Motion) -> Array:
    """Places (T, J, 3) of the joints of placed frames (T, E), each frame seen from where it is, without tips."""
    seen = seen_from(frames[:, None], pose_of(frames))[:, 0]
    joints = [HUMANOID.index(name) for name in BONES]
    places: Array = positions(unplaced(seen, like))[:, joints]
    return places
