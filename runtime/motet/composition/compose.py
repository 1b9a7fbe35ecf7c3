"""Compose: prompts on a time line, and places, facings and poses that are met at their times.

Walks and runs to a place are steered as by ``control``, all else is a story as of ``generate``. The rest of the way to
a place is added to the path, and the difference from a pose to the joints around it; standing feet are held.

Frames are counted from the start of the plan. Until :func:`moved`, all is seen from the place and facing of the start.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Literal, NamedTuple

import numpy as np

from motet.composition.keys import Key, Moves
from motet.composition.plans import Moment, parse_plan, time_line
from motet.composition.steered_segments import Leg, Walk, gait_of, walked
from motet.errors import MotionError, SettingError, needs
from motet.figures.feet.hold import hold_feet
from motet.figures.humanoid import BONES, HUMANOID, on_humanoid, sole_points
from motet.generate.base import Story
from motet.generate.codec import seen_from as ground_seen_from
from motet.generate.model import CodesModel
from motet.models.load import load
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

KEY_POSE_SECONDS = 0.5
"""Seconds within which a figure comes to a pose, and leaves it."""

DRIFT = 0.5
"""Largest invisible correction of an unsteered motion, m/s."""


GROUND = [0, 2]
"""The axes of the ground in a place."""


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


def compose(
    model: CodesModel,
    plan: str | Sequence[Moment],
    *,
    steer: SteerModel | None = None,
    seed: int = 0,
    strict: bool = False,
) -> Composition:
    """A motion that shows prompts at their times and meets the places, facings and poses of a plan.

    model: draws the prompts, such as ``motet.load("generate")``.
    plan: moments (:class:`motet.Moment`), such as ``motet.read_plan`` gives; or a script as ``motet.parse_plan`` reads
        it. Feet are planted. A prompt for walking or running, and nothing else, is steered to its places; any other
        motion is turned and moved there by up to half a metre a second.
    steer: the model of walks to places, by default the bundle "control".
    seed, strict: like :meth:`motet.CodesModel.story`.
    SettingError for moments that are out of order; MotionError for a place that is out of reach, with the time that
    it takes, and for a pose that is not a human's or is under the ground; TextError like a story.
    """
    needs(model, CodesModel, "a model such as motet.load('generate')")
    line = _line_of(plan)
    steer = steer or load("control")
    if model.fps != steer.fps:
        raise SettingError(f"models of one frame rate are needed, not {model.fps:g} and {steer.fps:g}")

    # The plan in frames: poses are refused before anything is drawn.
    poses = {_frame(moment.at, model.fps): _pose(moment) for moment in line if moment.pose is not None}
    legs = _legs(line, model.fps)
    parts = _parts(line, legs, steer)

    # Prompts are drawn as seen from the start; then the motion is put there, led through the poses, and its feet held.
    motion, passages = _Drawing(model, steer, legs, strict).shown(parts, seed)
    motion = _through(moved(motion, line[0]), poses)
    motion = hold_feet(motion, ground=0.0)
    return Composition(motion, tuple(passages), met(motion, line))


def _line_of(plan: str | Sequence[Moment]) -> list[Moment]:
    """The moments of a plan in order; ScriptError, ArgumentError and SettingError for one that is none."""
    moments = parse_plan(plan) if isinstance(plan, str) else list(plan)
    for moment in moments:
        needs(moment, Moment, "a moment")
    return time_line(moments)


def _legs(line: Sequence[Moment], fps: float) -> list[Leg]:
    """The places and facings of a plan after its first moment, seen from where that starts."""
    start = _start(line[0])
    legs = []
    for moment in line[1:]:
        place = None
        facing = None
        if moment.place is not None:
            forward, left, _ = ground_seen_from(start, np.array([*moment.place, 0.0]))
            place = np.array([left, forward])
        if moment.facing is not None:
            facing = math.radians(moment.facing) - start[2]
        if place is not None or facing is not None:
            legs.append(Leg(_frame(moment.at, fps), place, facing))
    return legs


def _parts(line: Sequence[Moment], legs: Sequence[Leg], steer: SteerModel) -> list[_Part]:
    """The prompts in order. One with a gait goes to its own places, then towards the next place of the plan."""
    stop = round(line[-1].at * steer.fps)
    next_walk = stop
    halts = False  # whether another act follows
    parts: list[_Part] = []
    # From the last to the first, as a walk depends on the prompts after it.
    for prompt in reversed(line):
        if prompt.text is None:
            continue
        start = round(prompt.at * steer.fps)
        walk = None
        gait = gait_of(prompt.text, steer)
        if gait:
            ahead = [leg for leg in legs if start <= leg.frame < next_walk]
            walk_legs = _walk_legs(ahead, stop)
            walk = Walk(prompt.text, start, stop, gait, walk_legs, halts) if walk_legs else None
            next_walk = start
        parts.insert(0, _Part(prompt.text, start, stop, walk))
        halts = gait is None
        stop = start
    return parts


def _walk_legs(ahead: Sequence[Leg], stop: int) -> list[Leg]:
    """The legs of a walk that stops at a frame, of those ahead: its own, then the next one as far as it gets."""
    walk_legs = [leg for leg in ahead if leg.frame < stop]
    following = ahead[len(walk_legs) :]
    if following and (not walk_legs or walk_legs[-1].frame < stop - 1):
        walk_legs.append(following[0]._replace(frame=stop - 1))
    return walk_legs


@dataclass(frozen=True, eq=False)
class _Drawing:
    """Draws the prompts of a plan, led to its places."""

    model: CodesModel
    steer: SteerModel
    legs: Sequence[Leg]
    strict: bool

    def shown(self, parts: Sequence[_Part], seed: int) -> tuple[Motion, list[Passage]]:
        """The motion of prompts, and when each is shown: walks one by one, and all between two walks as one story."""
        fps = self.model.fps
        motion: Motion | None = None
        passages = []
        # a walk alone, or neighbouring prompts together
        for _, run in groupby(parts, lambda part: part.start if part.walk else -1):
            together = list(run)
            begin = together[0].start / fps
            walk = together[0].walk
            # walks are steered from where the motion ends
            if walk is not None:
                motion = self._led(motion, walked(self.steer, walk, motion), together)
                passages.append(Passage(walk.text, begin, walk.stop / fps, f"{walk.gait.name}, steered"))
                continue
            # prompts are drawn as one story that goes on from there
            motion, story = self._story(motion, together, seed)
            for passage in story.passages:
                passages.append(replace(passage, start=passage.start + begin, stop=passage.stop + begin))
        assert motion is not None
        return motion, passages

    def _story(self, before: Motion | None, parts: Sequence[_Part], seed: int) -> tuple[Motion, Story]:
        """Prompts that are not steered, each as long as it is shown; drawn again if they are too far from a place."""
        model = self.model
        seconds = [(part.stop - part.start) / model.fps for part in parts]
        texts = [part.text for part in parts]
        # at most four times
        for draws_left in reversed(range(4)):
            story = model.story(texts, seconds=seconds, after=before, seed=seed, strict=self.strict)
            try:
                new = model.contract.motion(story.frames, after=before, plant=False)
                return self._led(before, new, parts), story
            except MotionError:
                if not draws_left:
                    raise
            seed = int(np.random.SeedSequence(seed).generate_state(1)[0])
        raise AssertionError

    def _led(self, before: Motion | None, motion: Motion, parts: Sequence[_Part]) -> Motion:
        """A motion and the next parts, led to their places: turned on the way to each, and moved. MotionError where
        that is too much, with the time it takes."""
        moves = _moves(motion)
        start = parts[0].start
        last = start
        for leg in self.legs:
            if start <= leg.frame < parts[-1].stop:
                text = next(part.text for part in parts if leg.frame < part.stop)
                moves = _led_to(moves, leg, last - start, leg.frame - start, motion.fps, text)
                last = leg.frame
        root = BONES[0]
        new = posed(motion, {root: moves.turns[:, 0]}, {root: moves.root})
        values = new.values if before is None else np.concatenate([before.values, new.values])
        return replace(motion, values=values).continuous()


def _moves(motion: Motion) -> Moves:
    return Moves(local_rotations(motion), local_translations(motion)[:, 0], heading(motion))


def _led_to(moves: Moves, leg: Leg, last: int, at: int, fps: float, text: str) -> Moves:
    """Moves of a text that are led from where they are at one frame to the place of a leg at another."""
    start = moves.root[last]
    # x and z stay, and the height is free
    here = {last: Key(place=start * np.array([1.0, np.nan, 1.0]), facing=moves.facing[last])}
    # The way over the ground that the motion goes, and the way to the place; NaN without one.
    place = np.full(3, np.nan)
    if leg.place is not None:
        place[GROUND] = leg.place
    way = (moves.root[at] - start)[GROUND]
    wanted = (place - start)[GROUND]

    # Turned within a second, unless the facing is planned.
    facing = leg.facing
    if facing is None:
        moves = _turned_to(moves, here, way, wanted, min(last + round(fps), at))
        facing = np.nan

    # Moved the rest of the way, so slowly that it is not seen.
    seconds = (at - last) / fps
    if _length((place - moves.root[at])[GROUND]) > DRIFT * max(1.0, seconds):
        raise _too_far(text, way, wanted, seconds, (leg.frame + 1) / fps)
    return moves.through(here | {at: Key(place=place, facing=facing)}, 1)


def _turned_to(moves: Moves, here: Mapping[int, Key], way: Array, wanted: Array, frame: int) -> Moves:
    """Moves turned between a key and another frame from their way (2,) to the one wanted, unless it is short."""
    if not (_length(wanted - way) > DRIFT and _length(way) > DRIFT):
        return moves
    turn = np.arctan2(*wanted) - np.arctan2(*way)
    return moves.through({**here, frame: Key(facing=moves.facing[frame] + turn)}, 1)


def _length(way: Array) -> float:
    return float(np.hypot(*way))


def _too_far(text: str, way: Array, wanted: Array, seconds: float, at: float) -> MotionError:
    """The error of a prompt that goes a way (2,) in some seconds, and not the way that is wanted until ``at``."""
    goes = _length(way)
    far = _length(wanted)
    advice = "it does not stay so near"
    if goes < far:
        advice = "walk there first" if goes < DRIFT else f"it takes {far / goes * seconds:.1f} s"
    return MotionError(
        f"{text!r} goes {goes:.1f} m in {seconds:.1f} s, and the place of {at:.3g} s is {far:.1f} m away: {advice}"
    )


def _through(motion: Motion, poses: Mapping[int, Array]) -> Motion:
    """The motion that comes to poses (1, E), wherever the figure is at their frames, and leaves them."""
    moves = _moves(motion)
    keys = {}
    # the pose where the figure is at its frame, at its own height
    for at, pose in poses.items():
        place_of_figure = pose_of(placed(motion[at])[0])
        pose_there = unplaced(put_at(seen_from(pose, pose_of(pose[0])), place_of_figure), motion)
        height = np.array([np.nan, pose[0, 1], np.nan])
        keys[at] = Key(dict(enumerate(local_rotations(pose_there)[0])), height, moves.facing[at])
    moves = moves.through(keys, round(KEY_POSE_SECONDS * motion.fps))
    turns = {name: moves.turns[:, joint] for joint, name in enumerate(HUMANOID.names)}
    return posed(motion, turns, {BONES[0]: moves.root}).continuous()


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
    # soles may be thinner than the humanoid's
    if low < -0.05:
        raise MotionError(f"the pose of {moment.at:g} s is {-100 * low:.0f} cm under the ground")
    return placed(pose)


def moved(motion: Motion, start: Moment) -> Motion:
    """A motion of the humanoid that begins at the origin, put at the place and facing of a moment."""
    return unplaced(put_at(placed(motion), _start(start)), motion)


def _start(moment: Moment) -> Array:
    return np.array([*(moment.place or (0.0, 0.0)), math.radians(moment.facing or 0.0)])


def met(motion: Motion, moments: Sequence[Moment]) -> tuple[Met, ...]:
    """How well a motion of the humanoid meets the moments of a plan, within a second of each."""
    frames = placed(motion)
    headings = heading(motion)
    second = round(motion.fps)
    results = []
    for moment in moments:
        at = min(_frame(moment.at, motion.fps), len(motion) - 1)
        first = max(0, at - second)
        near = slice(first, at + second + 1)
        for what, distances in _distances(moment, frames[near], headings[near], motion).items():
            results.append(_met_at(moment.at, what, distances, at - first, motion.fps))
    return tuple(results)


def _met_at(seconds: float, what: What, distances: Array, here: int, fps: float) -> Met:
    """How well something is met at one frame, by its distances (T, J) in this and the frames around."""
    mean = distances.mean(axis=1)
    nearest = np.flatnonzero(mean <= mean.min() + 1)  # within a centimetre or a degree
    late = float(np.abs(nearest - here).min() / fps)
    return Met(seconds, what, float(mean[here]), float(distances[here].max()), late)


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
    return positions(unplaced(seen, like))[:, joints]
