"""What follows a motion for as long as is wanted, by a model that writes codes: alive, at its pace, its feet held."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from motet.decode.codes import Drawing
from motet.decode.continue_codes import Ground, Pace, Shown, onward
from motet.errors import DecodingError, MotionError
from motet.models.generate import SETTLED, GenerateModel
from motet.models.generate_codes import CodesModel
from motet.models.progress import Progress, silent
from motet.motion.feet.contacts import GROUND_PERCENT, feet_of, ground_of
from motet.motion.feet.hold import hold_feet, windows
from motet.motion.humanoid import HUMANOID, Figure
from motet.motion.kinematics import positions
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet.motion.springs import damped, damping_of
from motet.representation.contract import MotionContract
from motet.representation.retargeting import from_model_figure
from motet.representation.root_block import last_place
from motet.representation.root_sixd import facing, in_world

LOOKED_AT = 2.0
"""Seconds of a motion's end whose pace is kept."""

HALF_LIFE = 0.1
"""Seconds after which half of what a motion's last frame is beside its codes is left."""

QUICKER, LASTING = 1.15, 1.5
"""What goes on is played so many times quicker or slower at most, by its speed in so many seconds before and after."""

SEEN = 1.0
"""Seconds of a motion's end that say where the ground is, beside what follows."""

AROUND, OFF = 0.7, 0.1
"""Seconds, more than a stride, and metres: see :func:`levelled`."""

RATES = 3
"""Channels that are rates: what they are off by is a speed already."""


@dataclass(frozen=True, eq=False)
class Follower:
    """Goes on with a motion, as often as is wanted.

    writer: the model whose codes go on. own: the motion at the writer's frame rate; figure: the same on the writer's
    figure. given, predicted: (T, D) frames of its last seconds and (P, D) of what was predicted of what follows, in the
    writer's units, together whole steps of codes. pace: to be kept. pose: x, z and facing (3,) at the motion's end, the
    facing as it is with what was predicted: it is smoothed over time, and alone it would lead another way.
    """

    writer: CodesModel
    own: Motion
    figure: Motion
    given: Array
    predicted: Array
    pace: Pace
    pose: Array

    @staticmethod
    def of(writer: CodesModel, motion: Motion, predicted: float = 0.0) -> "Follower":
        """MotionError for a motion that is too short, or of a figure that is no human's.

        predicted: seconds at its end that are not the motion's own: part of what follows.
        """
        whole = motion if motion.fps == writer.fps else motion.continuous().resample(writer.fps, to_end=True)
        figure = writer.contract.on_figure(whole)
        frames = writer.last_frames(figure)
        end = len(frames) - round(predicted * writer.fps)
        if end < 2:
            raise MotionError(f"a motion of {len(whole)} frames, so many of them predicted, is too short to go on with")
        pace = Pace.of(frames[max(0, end - round(LOOKED_AT * writer.fps)) : end, :RATES], writer.fps)
        own = len(whole) - len(frames) + end
        place = last_place(figure[:own])
        pose = np.array([place[0], place[2], facing(figure)[own - 1]])
        return Follower(writer, whole[:own], figure[:own], frames[:end], frames[end:], pace, pose)

    def follow(self, count: int, seed: int) -> tuple[Motion, Motion]:
        """So many frames that follow, the same for the same seed, and the motion before them: :func:`brought_back`."""
        frames = np.concatenate([self.predicted, self.drawn(count - len(self.predicted), seed)])
        following, _ = in_world(self.writer.contract.features(self.held(frames)), self.figure, self.pose)
        return brought_back(following, self.own, self.figure)

    def drawn(self, count: int, seed: int) -> Array:
        """Frames (count, D) after those predicted, in the writer's units, joined without a leap."""
        writer, hop, frames = self.writer, self.writer.sight.hop, np.concatenate([self.given, self.predicted])
        names = ("temperature", "first_temperature", "top_p", "guidance", "memory")
        drawing = Drawing(*(writer.defaults[name] for name in names))
        ground = Ground(writer.book(), hop / writer.fps)
        shown = Shown(writer.codes_of(frames), self.pace, math.ceil(len(self.predicted) / hop))
        # what is decoded last is decoded without what follows
        steps = math.ceil(count * QUICKER / hop) + writer.sight.ahead
        codes = onward(writer.source, drawing, ground, shown, steps, seed)
        following = joined(frames, writer.frames_of(np.concatenate([shown.codes, codes])), writer.fps)
        return paced(np.concatenate([frames[-1:], following]), self.pace, writer.fps)[:count]

    def held(self, frames: Array) -> Array:
        """Frames (T, D) that follow, on the ground of the motion's end, and with feet that stay where they stand; at
        first as far as they did before."""
        contract, before = self.writer.contract, self.given[-round(SEEN * self.writer.fps) :]
        if contract.skeleton != HUMANOID:
            return frames
        level = levelled(contract, np.concatenate([before, frames]), len(before))
        planted = contract.frames(hold_feet(contract.motion(level, plant=False), trembling=True))[len(before) :]
        share = np.minimum(np.arange(len(frames)) / (SETTLED * self.writer.fps), 1.0)[:, None]
        level = level[len(before) :]
        found: Array = level + share * (planted - level)
        return found


def levelled(contract: MotionContract, frames: Array, given: int) -> Array:
    """Frames (T, D) whose feet come down to where they came down in the first ``given`` of them.

    What is remembered was recorded on other floors, and on mounds and steps. Where the ground is, is seen over AROUND
    seconds before and after; what is farther off than OFF is no other floor but a jump, or a figure on its hands.
    """
    soles = positions(contract.motion(frames, plant=False))[:, feet_of(HUMANOID), 1].min(axis=1)
    reach = round(AROUND * contract.fps)
    grounds = np.percentile(windows(soles, reach), GROUND_PERCENT, axis=1)
    off = np.clip(grounds - ground_of(soles[:given, None]), -OFF, OFF)
    bell = np.hanning(2 * reach + 3)[1:-1]
    # at the seam there is no leap to another floor
    settled = (1 - np.cos(np.pi * np.clip((np.arange(len(frames)) - given) / reach, 0, 1))) / 2
    level = np.array(frames)
    level[:, contract.channels.index("root.height")] -= settled * (windows(off, reach) @ (bell / bell.sum()))
    return level


def futures(
    writer: GenerateModel,
    motion: Motion,
    count: int,
    seeds: Sequence[int],
    progress: Progress = silent,
    predicted: float = 0.0,
) -> list[tuple[Motion, Motion]]:
    """For each seed so many frames that follow a motion, at its frame rate, and the motion as it goes before them.

    Both are in the motion's own channels, or where that is not possible on the writer's figure. progress: called with
    the number of futures done and of all. predicted: as :meth:`Follower.of`. DecodingError where the writer does not
    write codes, MotionError as :meth:`Follower.of`.
    """
    if not isinstance(writer, CodesModel):
        raise DecodingError(f"what goes on beyond the horizon writes codes, as motet.load('generate'), not {writer!r}")
    follower, found = Follower.of(writer, motion, predicted), list[tuple[Motion, Motion]]()
    own = motion[: len(motion) - round(predicted * motion.fps)]
    for seed in seeds:
        following, before = follower.follow(math.ceil(count * writer.fps / motion.fps) + 1, seed)
        whole = own if before is follower.own else writer.contract.on_figure(own)
        found.append((at_rate(before, following, motion.fps)[:count], whole))
        progress(len(found), len(seeds))
    return found


def at_rate(before: Motion, following: Motion, fps: float) -> Motion:
    """What follows a motion's last frame, at another frame rate."""
    if following.fps == fps:
        return following
    last = before[-1:].select(following.channels, following.units)
    return replace(following, values=np.concatenate([last.values, following.values])).resample(fps)[1:]


def joined(given: Array, found: Array, fps: float) -> Array:
    """What follows given frames (T, D), from frames (T + N, D) that show them, too, but not exactly.

    What the last given frame is beside what was found, and how fast that changes, goes by a critically damped spring
    (inertialisation: Bollo 2016), so that neither poses nor velocities leap.
    """
    beside = given[-2:] - found[len(given) - 2 : len(given)]
    off, speed = beside[1], (beside[1] - beside[0]) * fps
    speed[:RATES] = 0
    following = np.array(found[len(given) :])
    for place in range(len(following)):
        left, _ = damped(off, speed, damping_of(HALF_LIFE), (place + 1) / fps)
        following[place] += left
    return following


def paced(frames: Array, pace: Pace, fps: float) -> Array:
    """Frames after the first of (T, D), played up to QUICKER times quicker or slower where they are off a pace.

    What stands goes on standing. The last frames may be missing, or be too many.
    """
    if pace.turn is None:
        return frames[1:]
    reach = round(LASTING * fps)
    bell = np.hanning(2 * reach + 3)[1:-1]
    speed = windows(np.linalg.norm(frames[:, : RATES - 1], axis=1), reach) @ (bell / bell.sum())
    asked = np.clip(pace.speed / np.maximum(speed, 1e-3), 1 / QUICKER, QUICKER)
    ratio = 1 + (asked[1:] - 1) * np.minimum(np.arange(len(frames) - 1) / (SETTLED * fps), 1.0)
    shown = np.concatenate([[0.0], np.cumsum(1 / ratio)])
    at = np.interp(np.arange(1, math.floor(shown[-1]) + 1), shown, np.arange(len(frames)))
    found = np.column_stack([np.interp(at, np.arange(len(frames)), column) for column in frames.T])
    found[:, :RATES] *= np.interp(at, np.arange(1, len(frames)), ratio)[:, None]
    return found


def carried_on(
    contract: MotionContract, frames: ArrayLike, own: Motion, figure: Motion, measured: Figure | None = None
) -> tuple[Motion, Motion]:
    """Frames (T, D) that follow a motion as a motion, and that motion as it is to be put before them.

    own: the motion at the contract's frame rate. figure: the same on the contract's figure. measured: the motion's
    figure, where it is known already.
    """
    return brought_back(contract.motion(frames, after=figure, plant=False), own, figure, measured)


def brought_back(
    following: Motion, own: Motion, figure: Motion, measured: Figure | None = None
) -> tuple[Motion, Motion]:
    """What follows on the contract's figure, and the motion before it: both the motion's own, or where that is not
    possible on that figure. Arguments as :func:`carried_on`."""
    if _same_joints(own, figure):
        return following, figure
    shown = together(figure[-1:], following.select(figure.channels, figure.units))
    back = from_model_figure(shown, own, own[-1:], measured)
    return (following, figure) if back is None else (back, own)


def _same_joints(own: Motion, figure: Motion) -> bool:
    """Whether a motion was taken as it is, with no more than its length unit found."""
    return figure is own or (own.skeleton and own.skeleton.joints) == (figure.skeleton and figure.skeleton.joints)


def together(before: Motion, following: Motion) -> Motion:
    """A motion and what follows it, in the channels of the latter."""
    before = before.select(following.channels, following.units)
    return replace(following, values=np.concatenate([before.values, following.values]))
