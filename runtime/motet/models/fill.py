"""Fill: the missing frames in a gap of a motion, between two motions, or from the end of one to its start."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, cast, overload

import numpy as np
from numpy.typing import ArrayLike

from motet.bundle.graph import Arrays, Graph
from motet.bundle.manifest import Manifest
from motet.errors import BundleError, MotionError
from motet.models.base import BundleModel
from motet.models.gaps import Gap, at_own_rate, log_elsewhere, spans_of
from motet.motion.follow import placed_after, to_figure_of
from motet.motion.humanoid import HUMANOID, on_humanoid
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet.representation.placed import PLACED_CHANNELS, bridge, placed, pose_of, put_at, seen_from, unplaced
from motet.representation.retargeting import from_model_figure
from motet.representation.root_sixd import facing
from motet.settings import Progress, checked_int, silent

SEEN = 5.0
"""Seconds before and after a gap from which a figure is retargeted onto the humanoid: its ground, its stance."""

JOIN_SECONDS, LOOP_SECONDS = 1.0, 0.5
"""Default seconds of a transition between two motions, and from the end of one to its start."""


@dataclass(frozen=True)
class Sides:
    """What is known about a gap, at the model's frame rate. own: both sides, on their own figure; figure: the same on
    the humanoid. past: (P, E) placed frames before the gap, the last of them right before it. after: (A, E)."""

    own: Motion
    figure: Motion
    past: Array
    after: Array


class FillModel(BundleModel):
    """A model that fills gaps in motions; threads can share it.

    graphs: "filler" (past, plain, after -> filled), of placed frames (:mod:`motet.representation.placed`) of the
        humanoid. Its loop's defaults are "context", the frames it sees before and after a gap, "least", the frames
        it needs there, and "longest", the frames of the longest gap, all at the model's frame rate.
    """

    VERB = "fill"
    LOOPS = ("between",)
    ROLES = ("filler",)

    def __init__(self, manifest: Manifest, graphs: Mapping[str, Graph], tables: Arrays | None = None) -> None:
        super().__init__(manifest, graphs, tables)
        if self.contract.skeleton != HUMANOID:
            raise BundleError("manifest, motion.skeleton: a model that fills gaps needs motet's humanoid")
        self.sizes["E"] = PLACED_CHANNELS
        filled = "batch gap E"
        self.bind("filler", {"past": "batch before E", "plain": filled, "after": "batch behind E"}, {"filled": filled})
        self.context, self.least, self.longest = (int(self.defaults[key]) for key in ("context", "least", "longest"))

    @property
    def seconds(self) -> float:
        """The longest gap, in seconds."""
        return self.longest / self.fps

    @overload
    def fill(self, motions: Motion, gaps: Sequence[Gap], *, progress: Progress = ...) -> Motion: ...
    @overload
    def fill(
        self, motions: Sequence[Motion], gaps: Sequence[Sequence[Gap]], *, progress: Progress = ...
    ) -> list[Motion]: ...
    def fill(
        self,
        motions: Motion | Sequence[Motion],
        gaps: Sequence[Gap] | Sequence[Sequence[Gap]],
        *,
        progress: Progress = silent,
    ) -> Motion | list[Motion]:
        """A motion with its gaps filled plausibly; the present content of their frames is ignored.

        gaps: for several motions, a list for each. A gap is (start, stop) in seconds: the frames from ``start`` up to,
            but not including, ``stop`` are replaced. All others are unchanged, bit for bit, and so are channels, units,
            figure and frame rate. Where a figure's world or channels make that impossible, the result is on the
            humanoid at the model's frame rate, which is logged.
        progress: called with the number of motions done and in total.
        MotionError, with the remedy, for gaps that are empty, longer than :attr:`seconds`, outside the motion or
        overlapping, or with fewer than :attr:`least` frames at the model's rate before or after them; and for a figure
        that is not human.
        """
        if isinstance(motions, Motion):
            return self._filled(motions, cast(Sequence[Gap], gaps))
        if len(gaps) != len(motions):
            raise MotionError(f"{len(motions)} motions need a list of gaps for each, not {len(gaps)}")
        found = list[Motion]()
        for motion, own in zip(motions, cast(Sequence[Sequence[Gap]], gaps), strict=True):
            found.append(self._filled(motion, own))
            progress(len(found), len(motions))
        return found

    def _filled(self, motion: Motion, gaps: Sequence[Gap]) -> Motion:
        spans = spans_of(motion, gaps, self.seconds)
        result = motion
        for number, (start, stop) in enumerate(spans):
            end = spans[number + 1][0] if number + 1 < len(spans) else len(motion)
            new = self._between(result[:start], result[stop:end], stop - start)
            if new is None:
                log_elsewhere()
                return self._filled(self._on_humanoid(motion), gaps)
            values = np.array(result.values)
            values[start:stop] = new.values
            result = replace(result, values=values)
        return result

    def join(self, first: Motion, second: Motion, *, seconds: float = JOIN_SECONDS) -> Motion:
        """One motion, a transition of ``seconds``, and another motion, placed where the first leads.

        The second is turned to face the way the first does at its end, and begins ahead of it by the mean of both
        velocities. If it has another frame rate or figure, it is converted to the first's, which is logged. The frames
        of the first are unchanged, bit for bit; for figures where that is impossible see :meth:`fill`.
        MotionError unless 0 < seconds <= :attr:`seconds`, and like :meth:`fill`.
        """
        before, new, after = self._joined(first, second, seconds)
        return replace(before, values=np.concatenate([before.values, new.values, after.values]))

    def looped(self, motion: Motion, *, seconds: float = LOOP_SECONDS) -> Motion:
        """The motion and a transition of ``seconds`` back to its start: the last frame is one before the first pose.

        Position on the ground and heading carry over, by the same amount at each repetition. Errors like
        :meth:`join`. To find a part of the motion that already repeats, use :func:`motet.motion.looped`.
        """
        before, new, _ = self._joined(motion, motion, seconds)
        return replace(before, values=np.concatenate([before.values, new.values]))

    def frames_between(self, past: ArrayLike, after: ArrayLike, frames: int, pace: float = 1.0) -> Array:
        """Placed frames (P, E) and (A, E) to the ``frames`` (frames, E) float64 between them, all in one world.

        pace: frames at the model's rate from one of them to the next, about 1. Only the nearest :attr:`context` frames
        are used. MotionError for too few frames, another number of channels, or more than twice
        :attr:`longest` frames to fill.
        """
        known = [np.asarray(part, dtype=np.float64) for part in (past, after)]
        for part, name in zip(known, ("before", "after"), strict=True):
            if part.ndim != 2 or part.shape[1] != self.sizes["E"] or len(part) < self.least:
                need = f"at least {self.least} frames of {self.sizes['E']} channels {name} it"
                raise MotionError(f"a gap needs {need}, not {part.shape}")
            if not np.isfinite(part).all():
                raise MotionError("frames must be finite numbers")
        frames = checked_int("frames", frames, 0, 2 * self.longest, MotionError)
        pose = pose_of(known[0][-1])
        past, after = seen_from(known[0][-self.context :], pose), seen_from(known[1][: self.context], pose)
        plain = bridge(past, after, frames, pace)
        if not frames:
            return plain
        rows = (one[None].astype(np.float32) for one in (past, plain, after))
        filled: Array = put_at(self.loop.run(self.graphs["filler"], *rows)[0], pose)
        return filled

    def replay(self, given: Arrays, settings: Mapping[str, Any]) -> Arrays:
        """Placed frames "past" (P, E) and "after" (A, E), and the number of "frames" of the settings, to "filled"."""
        count = int(settings["frames"])
        if not 1 <= count <= self.longest:
            raise BundleError(f"golden vectors fill a gap of 1 to {self.longest} frames, not {count}")
        return {"filled": self.frames_between(given["past"], given["after"], count)}

    def _joined(self, first: Motion, second: Motion, seconds: float) -> tuple[Motion, Motion, Motion]:
        """The first motion, the transition, and the second placed after it; all in the channels of the first."""
        if not 0 < seconds <= self.seconds:
            raise MotionError(f"a transition takes more than 0 and at most {self.seconds:g} seconds, not {seconds:g}")
        if None in (first.skeleton, second.skeleton) or not self._in_its_world(first):
            return self._elsewhere(first, second, seconds)
        count = max(1, round(seconds * first.fps))
        other = second if second is first else to_figure_of(second, first)
        known = self._sides(first, other)
        ends = len(known.past)
        turn = float(facing(known.figure[:ends])[-1] - facing(known.figure[ends:])[0])
        after = placed_after(other, first, (count + 1) / first.fps, turn)
        new = None if after is None else self._between(first, after, count)
        if after is None or new is None:
            return self._elsewhere(first, second, seconds)
        return first, new, after

    def _in_its_world(self, motion: Motion) -> bool:
        """Whether a motion's figure stands in its own world like in the model's, and can be placed there."""
        part = motion[-round(SEEN * motion.fps) :].continuous().resample(self.fps, to_end=True)
        ends = replace(part, values=part.values[[0, -1]] if len(part) else part.values)
        return from_model_figure(on_humanoid(part), part, ends) is not None

    def _elsewhere(self, first: Motion, second: Motion, seconds: float) -> tuple[Motion, Motion, Motion]:
        """Like :meth:`_joined`, on the humanoid."""
        log_elsewhere()
        return self._joined(self._on_humanoid(first), self._on_humanoid(second), seconds)

    def _between(self, before: Motion, after: Motion, count: int) -> Motion | None:
        """``count`` frames between two parts of a motion, at its own rate, in its channels; None where they cannot be
        retargeted onto its figure."""
        known = self._sides(before, after)
        span = (count + 1) * self.fps / before.fps
        knots = max(0, round(span) - 1)
        new = self.frames_between(known.past, known.after, knots, span / (knots + 1))
        frames = at_own_rate(known.past, new, known.after, count)
        ends = replace(before, values=np.concatenate([before.values[-1:], after.values[:1]]))
        like = replace(known.figure[:1], fps=before.fps)
        return from_model_figure(unplaced(frames, like), known.own, ends)

    def _sides(self, before: Motion, after: Motion) -> Sides:
        """What is known about a gap; MotionError for too few frames."""
        seen = round(SEEN * before.fps)
        parts = (
            before[-seen:].continuous().resample(self.fps, to_end=True),
            after[:seen].continuous().resample(self.fps),
        )
        for part, given, name in zip(parts, (before, after), ("before", "after"), strict=True):
            if len(part) < self.least:
                need = f"at least {self.least / self.fps:.2g} s of motion ({self.least} frames at {self.fps:g} fps)"
                raise MotionError(f"a gap needs {need} {name} it, but there are {given.duration:.2g} s")
        own = replace(parts[0], values=np.concatenate([part.values for part in parts]))
        figure = on_humanoid(own)
        return Sides(own, figure, *np.split(placed(figure), [len(parts[0])]))

    def _on_humanoid(self, motion: Motion) -> Motion:
        """A motion on the humanoid, at the model's rate."""
        return on_humanoid(motion.continuous().resample(self.fps))
