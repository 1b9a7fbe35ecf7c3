"""Continue a motion for any length with a motion-code model: lively, at its pace, feet held."""

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import islice

import numpy as np

from motet.errors import DecodingError, MotionError
from motet.figures.feet.contacts import GROUND_PERCENT, feet_of, ground_of
from motet.figures.feet.hold import hold_feet, windows
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

RATES = 3  # channels of the root that scale with the tempo


class Continuation:
    """A motion to be continued by a motion-code model, any number of times; threads can share it.

    model: any motion-code model. motion: of any human figure. predicted: seconds at its end that were predicted, not
    recorded: they begin what follows. MotionError for a motion that is too short or not of a human figure.
    """

    def __init__(self, model: CodesModel, motion: Motion, predicted: float = 0.0) -> None:
        self.model, self.rules = model, model.continuation
        whole = model.at_own_rate(motion)
        figure = model.contract.on_figure(whole)
        self.context = model.context(figure)
        self.given = len(self.context.frames) - round(predicted * model.fps)  # frames of the context, the own ones
        if self.given < 2:
            raise MotionError(f"only {len(whole)} frames, some of them predicted: too few to continue from")
        own = len(whole) - len(self.context.frames) + self.given
        # as it is with what was predicted: it is smoothed over time, and alone it would lead another way
        faced, place = facing(figure)[own - 1], last_place(figure[:own])
        self.own, self.figure, self.pose = whole[:own], figure[:own], np.array([place[0], place[2], faced])
        looked_at = self.context.frames[max(0, self.given - round(self.rules.pace_seen * model.fps)) : self.given]
        self.pace = Pace.of(looked_at[:, :RATES], model.fps, self.rules)

    def follow(self, count: int, seed: int) -> tuple[Motion, Motion]:
        """The next ``count`` frames, and the motion before them: :func:`brought_back`. With the same seed, a shorter
        continuation is the beginning of a longer one."""
        rules, contract = self.rules, self.model.contract
        # a stance affects 0.7 s before it and after its anchor (motet.figures.feet.hold)
        ahead = round((rules.anchor + 0.7 + 2 * rules.ground_reach) * contract.fps)
        before = self.context.frames[: self.given][-round(rules.ground_seen * contract.fps) :]
        predicted = self.context.frames[self.given :]
        frames = np.concatenate([before, predicted, self._drawn(count - len(predicted) + ahead, seed)])
        if contract.skeleton == HUMANOID:
            frames = self._on_ground(frames, len(before))
        shown = contract.features(frames[len(before) : len(before) + count])
        return brought_back(in_world(shown, self.figure, self.pose)[0], self.own, self.figure)

    def _drawn(self, count: int, seed: int) -> Array:
        """Frames (count, D) after those of the context, at its pace and without a jump."""
        model, rules, context = self.model, self.rules, self.context
        drawing = CodesSettings.read(model.defaults, "defaults")
        continuer = Continuer(model.source, model.codec, drawing, rules)
        known = len(context.codes) - math.ceil((len(context.frames) - self.given) / model.codec.field.hop)
        steps = continuer.steps(context.codes, max(1, known), self.pace, seed)
        decoder, frames = model.decoder(context), context.frames[-1:]
        while len(found := paced(frames, self.pace, model.fps, rules)) < count:
            more = islice(steps, math.ceil((count - len(found)) / model.codec.field.hop))
            frames = np.concatenate([frames, decoder.push(np.stack(list(more)))])
        return found[: max(0, count)]

    def _on_ground(self, frames: Array, given: int) -> Array:
        """Frames (T, D), the first ``given`` of them known, on their ground and with planted feet; the planting blends
        in after the given frames."""
        contract, rules = self.model.contract, self.rules
        level = levelled(contract, frames, given, rules)
        motion = contract.motion(level, plant=False)
        ground = ground_under(sole_points(*global_transforms(motion[:given])))
        held = contract.frames(hold_feet(motion, trembling=True, ground=ground, anchor=rules.anchor))
        bent = {sided(side, part) for side in LEFT_RIGHT for part in LEG[:3]}
        legs = [column for column, name in enumerate(contract.channels) if name.rpartition(".")[0] in bent]
        share = np.clip((np.arange(len(frames)) - given) / (SETTLED * contract.fps), 0, 1)[:, None]
        level[:, legs] += share * (held - level)[:, legs]
        return level


def levelled(contract: MotionContract, frames: Array, given: int, rules: ContinuationSettings) -> Array:
    """Frames (T, D) shifted so that the feet touch the same ground as in the first ``given`` frames. The recordings in
    memory were made on other floors, and on mounds and steps."""
    soles = positions(contract.motion(frames, plant=False))[:, feet_of(HUMANOID), 1].min(axis=1)
    reach = round(rules.ground_reach * contract.fps)
    grounds = np.percentile(windows(soles, reach), GROUND_PERCENT, axis=1)
    off = np.clip(grounds - ground_of(soles[:given, None]), -rules.ground_limit, rules.ground_limit)
    # at the seam there is no leap to another floor
    settled = (1 - np.cos(np.pi * np.clip((np.arange(len(frames)) - given) / reach, 0, 1))) / 2
    level = np.array(frames)
    level[:, contract.channels.index("root.height")] -= settled * averaged(off, reach)
    return level


def averaged(values: Array, reach: int) -> Array:
    """Values (T,) smoothed by a Hann window of ``reach`` frames on either side."""
    bell = np.hanning(2 * reach + 3)[1:-1]
    found: Array = (windows(values, reach) * (bell / bell.sum())).sum(axis=1)
    return found


def paced(frames: Array, pace: Pace, fps: float, rules: ContinuationSettings) -> Array:
    """Frames after the first of (T, D), played faster or slower where they deviate from a pace. A standing figure keeps
    standing. The last frames are left out: their speed is not known yet."""
    reach, times = round(rules.tempo_reach * fps), np.arange(len(frames))
    if pace.turn is None:
        return frames[1:]
    speed = averaged(np.linalg.norm(frames[:, : RATES - 1], axis=1), reach)
    asked = np.clip(pace.speed / np.maximum(speed, 1e-3), 1 / rules.tempo, rules.tempo)
    ratio = 1 + (asked[1:] - 1) * np.minimum(times[:-1] / (SETTLED * fps), 1.0)
    shown = np.concatenate([[0.0], np.cumsum(1 / ratio)])
    last = max(0, math.floor(shown[max(0, len(frames) - 1 - reach)]))
    at = np.interp(np.arange(1, last + 1), shown, times)
    found = np.column_stack([np.interp(at, times, column) for column in frames.T])
    found[:, :RATES] *= np.interp(at, times[1:], ratio)[:, None] if len(at) else 1
    return found


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
    continuation, found = Continuation(model, motion, predicted), list[Motion]()
    own = motion[: len(motion) - round(predicted * motion.fps)]
    for seed in seeds:
        following, before = continuation.follow(math.ceil(count * model.fps / motion.fps) + 1, seed)
        following = at_rate(before, following, motion.fps)[:count]
        whole = own if before is continuation.own else model.contract.on_figure(own)
        found.append(together(whole, following) if append else following)
        progress(len(found), len(seeds))
    return found


def at_rate(before: Motion, following: Motion, fps: float) -> Motion:
    """What follows a motion's last frame, at another frame rate."""
    return following if following.fps == fps else together(before[-1:], following).resample(fps)[1:]


def brought_back(
    following: Motion, own: Motion, figure: Motion, measured: Figure | None = None
) -> tuple[Motion, Motion]:
    """What follows on the contract's figure, and the motion before it: both the motion's own, or where that is not
    possible on that figure.

    own: the motion at the contract's frame rate. figure: the same on the contract's figure. measured: the motion's
    figure, where it is known already.
    """
    if figure is own or (own.skeleton and own.skeleton.joints) == (figure.skeleton and figure.skeleton.joints):
        return following, figure  # the motion was taken as it is, with no more than its length unit found
    shown = together(figure[-1:], following.select(figure.channels, figure.units))
    back = from_model_figure(shown, own, own[-1:], measured)
    return (following, figure) if back is None else (back, own)


def together(before: Motion, following: Motion) -> Motion:
    """A motion and what follows it, in the channels of the latter."""
    before = before.select(following.channels, following.units)
    return replace(following, values=np.concatenate([before.values, following.values]))
