"""Continue a motion for any length with a motion-code model: lively, at its pace, feet held."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import islice, product

import numpy as np

from motet.decode.loop import Ids
from motet.errors import DecodingError, MotionError
from motet.figures.feet.contacts import GROUND_PERCENT, bell, feet_of, ground_of, windows
from motet.figures.feet.hold import hold_feet
from motet.figures.humanoid import HUMANOID, Figure
from motet.figures.humanoid.bones import LEFT_RIGHT, LEG, ground_under, sided, sole_points
from motet.generate.base import SETTLED, GenerateModel
from motet.generate.codes import CodesSettings
from motet.generate.continue_codes import ContinuationSettings, Continuer, Pace
from motet.generate.model import CodesModel
from motet.motion.kinematics import global_transforms, positions
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet.representation.contract import MotionContract
from motet.representation.retargeting import from_model_figure
from motet.representation.root_block import last_place
from motet.representation.root_sixd import facing, in_world
from motet.settings import Progress, silent

VELOCITY_CHANNELS = 3  # channels of the root that scale with the tempo


class Continuation:
    """A motion to be continued by a motion-code model, any number of times; threads can share it.

    model: any motion-code model. motion: of any human figure. predicted: seconds at its end that were predicted, not
    recorded: they begin the continuation. MotionError for a motion that is too short or not of a human figure.
    """

    def __init__(self, model: CodesModel, motion: Motion, predicted: float = 0.0) -> None:
        self.model = model
        self.rules = model.continuation
        whole = model.at_own_rate(motion)
        figure = model.contract.on_figure(whole)
        self.context = model.context(figure)
        # Frames of the context that were recorded, and those of the motion.
        predicted_frames = round(predicted * model.fps)
        self.recorded = len(self.context.frames) - predicted_frames
        if self.recorded < 2:
            raise MotionError(f"only {len(whole)} frames, some of them predicted: too few to continue from")
        end = len(whole) - predicted_frames
        self.motion = whole[:end]
        self.figure = figure[:end]
        # The facing is smoothed over time: it is taken with the predicted frames, or it would lead another way.
        x, _, z = last_place(self.figure)
        self.pose = np.array([x, z, facing(figure)[end - 1]])
        # The pace of the last recorded seconds.
        recent = self.context.frames[: self.recorded, :VELOCITY_CHANNELS][-round(self.rules.pace_seen * model.fps) :]
        self.pace = Pace.of(recent, model.fps, self.rules)

    def follow(self, count: int, seed: int) -> tuple[Motion, Motion]:
        """The next ``count`` frames, and the motion before them: :func:`brought_back`. With the same seed, a shorter
        continuation is the beginning of a longer one."""
        rules = self.rules
        contract = self.model.contract
        # A stance affects 0.7 s before it and after its anchor (motet.figures.feet.hold).
        ahead = round((rules.anchor + 0.7 + 2 * rules.ground_reach) * contract.fps)
        before = self.context.frames[: self.recorded][-round(rules.ground_seen * contract.fps) :]
        predicted = self.context.frames[self.recorded :]
        frames = np.concatenate([before, predicted, self._drawn(count - len(predicted) + ahead, seed)])
        if contract.skeleton == HUMANOID:
            frames = self._on_ground(frames, len(before))
        following = contract.features(frames[len(before) : len(before) + count])
        return brought_back(in_world(following, self.figure, self.pose)[0], self.motion, self.figure)

    def _drawn(self, count: int, seed: int) -> Array:
        """Frames (count, D) after those of the context, at its pace and without a jump."""
        model = self.model
        hop = model.codec.field.hop
        decoder = model.decoder(self.context)
        steps = self._steps(seed)
        # As many steps as the frames would take, and more where they are played faster.
        frames = self.context.frames[-1:]
        following = frames[:0]
        while len(following) < count:
            more = islice(steps, math.ceil((count - len(following)) / hop))
            frames = np.concatenate([frames, decoder.push(np.stack(list(more)))])
            following = paced(frames, self.pace, model.fps, self.rules)
        return following[: max(0, count)]

    def _steps(self, seed: int) -> Iterator[Ids]:
        """The steps of codes (P,) after those of the context, which is recognised by those that were recorded."""
        model = self.model
        codes = self.context.codes
        predicted_frames = len(self.context.frames) - self.recorded
        known = max(1, len(codes) - math.ceil(predicted_frames / model.codec.field.hop))
        drawing = CodesSettings.read(model.defaults, "defaults")
        return Continuer(model.source, model.codec, drawing, self.rules).steps(codes, known, self.pace, seed)

    def _on_ground(self, frames: Array, known: int) -> Array:
        """Frames (T, D), the first ``known`` of them recorded, on their ground and with planted feet; the planting
        blends in after the recorded frames."""
        contract = self.model.contract
        level = levelled(contract, frames, known, self.rules)
        motion = contract.motion(level, plant=False)
        ground = ground_under(sole_points(*global_transforms(motion[:known])))
        held = contract.frames(hold_feet(motion, trembling=True, ground=ground, anchor=self.rules.anchor))
        # Only the legs take the held frames.
        bent = {sided(side, part) for side, part in product(LEFT_RIGHT, LEG[:3])}
        joints = [name.rpartition(".")[0] for name in contract.channels]
        legs = [column for column, joint in enumerate(joints) if joint in bent]
        share = np.clip((np.arange(len(frames)) - known) / (SETTLED * contract.fps), 0, 1)[:, None]
        level[:, legs] += share * (held - level)[:, legs]
        return level


def levelled(contract: MotionContract, frames: Array, known: int, rules: ContinuationSettings) -> Array:
    """Frames (T, D) shifted so that the feet touch the same ground as in the first ``known`` frames: recordings in
    memory were made on other floors, and on mounds and steps."""
    soles = positions(contract.motion(frames, plant=False))[:, feet_of(HUMANOID), 1].min(axis=1)
    reach = round(rules.ground_reach * contract.fps)
    grounds = np.percentile(windows(soles, reach), GROUND_PERCENT, axis=1)
    off = np.clip(grounds - ground_of(soles[:known, None]), -rules.ground_limit, rules.ground_limit)
    # The shift begins at the seam, without a jump to another floor.
    settled = (1 - np.cos(np.pi * np.clip((np.arange(len(frames)) - known) / reach, 0, 1))) / 2
    level = np.array(frames)
    level[:, contract.channels.index("root.height")] -= settled * averaged(off, reach)
    return level


def averaged(values: Array, reach: int) -> Array:
    """Values (T,) smoothed by a Hann window of ``reach`` frames on either side."""
    return np.asarray((windows(values, reach) * bell(reach)).sum(axis=1))


def paced(frames: Array, pace: Pace, fps: float, rules: ContinuationSettings) -> Array:
    """Frames after the first of (T, D), played faster or slower where they deviate from a pace. A standing figure keeps
    standing. The last frames are left out: their speed is not known yet."""
    if pace.turn is None:
        return frames[1:]
    reach = round(rules.tempo_reach * fps)
    rate = _playback_rate(frames, pace, fps, rules)
    # The times at which frames are shown, and the frames at whole times.
    times = np.arange(len(frames))
    shown_at = np.append(0.0, np.cumsum(1 / rate))
    last = max(0, math.floor(shown_at[max(0, len(frames) - 1 - reach)]))
    at = np.interp(np.arange(1, last + 1), shown_at, times)
    played = np.column_stack([np.interp(at, times, column) for column in frames.T])
    # What is played faster is faster over the ground.
    if last:
        played[:, :VELOCITY_CHANNELS] *= np.interp(at, times[1:], rate)[:, None]
    return played


def _playback_rate(frames: Array, pace: Pace, fps: float, rules: ContinuationSettings) -> Array:
    """The rate (T - 1,) at which frames (T, D) after the first are played to keep a pace, from 1 at the seam."""
    speed = averaged(np.linalg.norm(frames[:, : VELOCITY_CHANNELS - 1], axis=1), round(rules.tempo_reach * fps))
    wanted_rate = np.clip(pace.speed / np.maximum(speed, 1e-3), 1 / rules.tempo, rules.tempo)
    settled = np.minimum(np.arange(len(frames) - 1) / (SETTLED * fps), 1.0)
    rate: Array = 1 + (wanted_rate[1:] - 1) * settled
    return rate


def futures(
    model: GenerateModel,
    motion: Motion,
    count: int,
    seeds: Sequence[int],
    append: bool = False,
    progress: Progress = silent,
    predicted: float = 0.0,
) -> list[Motion]:
    """For each seed, ``count`` frames that follow a motion, at its frame rate, after the motion where ``append``.

    They are in the motion's own channels or, where that is impossible, on the model's figure. progress: called with the
    number of futures done and in total. predicted and MotionError: like :class:`Continuation`. DecodingError unless the
    model is a motion-code model.
    """
    if not isinstance(model, CodesModel):
        raise DecodingError(f"beyond must be a motion-code model such as motet.load('generate'), not {model!r}")
    continuation = Continuation(model, motion, predicted)
    recorded = motion[: len(motion) - round(predicted * motion.fps)]
    motions: list[Motion] = []
    for seed in seeds:
        # a frame more at the model's rate, for the resampling
        following, before = continuation.follow(math.ceil(count * model.fps / motion.fps) + 1, seed)
        following = at_rate(before, following, motion.fps)[:count]
        if append:
            whole = recorded if before is continuation.motion else model.contract.on_figure(recorded)
            following = together(whole, following)
        motions.append(following)
        progress(len(motions), len(seeds))
    return motions


def at_rate(before: Motion, following: Motion, fps: float) -> Motion:
    """The frames after a motion's last one, at another frame rate."""
    return following if following.fps == fps else together(before[-1:], following).resample(fps)[1:]


def brought_back(
    following: Motion, motion: Motion, figure: Motion, measured: Figure | None = None
) -> tuple[Motion, Motion]:
    """The following frames on the contract's figure, and the motion before them: both on the motion's figure, or where
    that is impossible on the contract's.

    motion: at the contract's frame rate. figure: the same on the contract's figure. measured: the motion's figure,
    where it is known already.
    """
    if figure is motion or (motion.skeleton and motion.skeleton.joints) == (figure.skeleton and figure.skeleton.joints):
        return following, figure  # the motion was taken as it is, only its length unit was found
    shown = together(figure[-1:], following.select(figure.channels, figure.units))
    back = from_model_figure(shown, motion, motion[-1:], measured)
    return (following, figure) if back is None else (back, motion)


def together(before: Motion, following: Motion) -> Motion:
    """A motion and the frames that follow it, in the channels of the latter."""
    before = before.select(following.channels, following.units)
    return replace(following, values=np.concatenate([before.values, following.values]))
