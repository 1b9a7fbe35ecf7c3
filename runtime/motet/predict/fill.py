"""Fill: the missing frames in a gap of a motion, between two motions, or from the end of one to its start."""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, cast, overload

import numpy as np
from numpy.typing import ArrayLike

from motet.bundle.graph import Arrays, Graph
from motet.bundle.manifest import Manifest
from motet.errors import BundleError, MotionError
from motet.figures.feet.treadmill import travelling
from motet.figures.humanoid import HUMANOID, on_humanoid
from motet.figures.root_motion import placed_after, to_figure_of
from motet.models.base import BundleModel
from motet.motion.motion import Motion, spline
from motet.motion.rotations import Array
from motet.predict.between import LOOPS
from motet.representation.placed import PLACED_CHANNELS, bridge, placed, pose_of, put_at, seen_from, unplaced
from motet.representation.retargeting import from_model_figure
from motet.representation.root_sixd import facing
from motet.settings import Progress, checked_int, is_number, silent

log = logging.getLogger(__name__)

Gap = tuple[float, float]
"""Times in seconds of the first missing frame and of the first frame after the gap."""

SEEN = 5.0  # seconds around a gap from which a figure is retargeted onto the humanoid: its ground, its stance
# of a transition between two motions, and from the end of one to its start
JOIN_SECONDS = 1.0
LOOP_SECONDS = 0.5


class FillModel(BundleModel):
    """A model that fills gaps in motions; threads can share it.

    Its graph "filler" takes placed frames (:mod:`motet.representation.placed`) of the humanoid. Its loop's defaults are
    "context", the frames it sees before and after a gap, "least", those it needs there, and "longest", those of the
    longest gap, all at the model's frame rate.
    """

    VERB = "fill"
    LOOPS = LOOPS
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
            humanoid at the model's frame rate, which is logged. A clip in place is first given the path that its feet
            imply (:func:`motet.motion.with_travel`), of which a TravelWarning tells.
        progress: called with the number of motions done and in total.
        MotionError, with the remedy, for gaps that are empty, longer than :attr:`seconds`, outside the motion or
        overlapping, or with fewer than :attr:`least` frames at the model's rate before or after them; and for a figure
        that is not human.
        """
        if isinstance(motions, Motion):
            return self._filled(travelling(motions), cast(Sequence[Gap], gaps))
        if len(gaps) != len(motions):
            raise MotionError(f"{len(motions)} motions need a list of gaps for each, not {len(gaps)}")
        filled = list[Motion]()
        for motion, motion_gaps in zip(motions, cast(Sequence[Sequence[Gap]], gaps), strict=True):
            filled.append(self._filled(travelling(motion), motion_gaps))
            progress(len(filled), len(motions))
        return filled

    def _filled(self, motion: Motion, gaps: Sequence[Gap]) -> Motion:
        spans = self._spans(motion, gaps)
        result = motion
        for (start, stop), (end, _) in zip(spans, [*spans[1:], (len(motion), 0)], strict=True):
            new = self._between(result[:start], result[stop:end], stop - start)
            if new is None:
                return self._filled(self._elsewhere(motion)[0], gaps)
            result = replace(result, values=np.concatenate([result.values[:start], new.values, result.values[stop:]]))
        return result

    def _spans(self, motion: Motion, gaps: Sequence[Gap]) -> list[tuple[int, int]]:
        """The frames of gaps, in the order of time; MotionError as :meth:`fill`."""
        if not isinstance(gaps, Sequence):
            raise MotionError(f"gaps are a list of (start, stop) in seconds, not {gaps!r}")
        if not gaps:
            raise MotionError("there is no gap to fill: give one, in seconds, such as (1.0, 2.0)")
        spans = sorted((self._span(motion, gap), gap) for gap in gaps)
        for ((_, last), (start, stop)), ((first, _), (then, end)) in pairwise(spans):
            if first <= last:
                both = f"{start:g}:{stop:g} and {then:g}:{end:g}"
                raise MotionError(f"the gaps {both} overlap or touch: merge them, or leave motion between them")
        return [span for span, _ in spans]

    def _span(self, motion: Motion, gap: Gap) -> tuple[int, int]:
        """The frames of a gap."""
        start, stop = _seconds_of(gap)
        text = f"the gap {start:g}:{stop:g} s"
        whole = f"the motion of {motion.duration:g} s"
        if start < 0 or stop > motion.duration + 0.5 / motion.fps:
            raise MotionError(f"{text} is not within {whole}")
        # whole frames, with some on both sides
        first = round(start * motion.fps)
        last = round(stop * motion.fps)
        if first == last:
            raise MotionError(f"{text} has no frame at {motion.fps:g} fps: make it longer")
        if first == 0:
            raise MotionError(f"{text} is at the very start of {whole}: a gap needs frames before it")
        if last >= len(motion):
            raise MotionError(
                f"{text} is at the very end of {whole}: a gap needs frames after it (motet predict continues)"
            )
        if stop - start > self.seconds + 1e-9:
            raise MotionError(f"{text} is too long: at most {self.seconds:g} s can be filled")
        return first, last

    def join(self, first: Motion, second: Motion, *, seconds: float = JOIN_SECONDS) -> Motion:
        """One motion, a transition of ``seconds``, and another motion, placed where the first leads.

        The second is turned to face the way the first does at its end, and begins ahead of it by the mean of both
        velocities. If it has another frame rate or figure, it is converted to the first's, which is logged. The frames
        of the first are unchanged, bit for bit; for figures where that is impossible see :meth:`fill`.
        MotionError unless 0 < seconds <= :attr:`seconds`, and like :meth:`fill`.
        """
        before, new, after = self._joined(travelling(first), travelling(second), seconds)
        return replace(before, values=np.concatenate([before.values, new.values, after.values]))

    def looped(self, motion: Motion, *, seconds: float = LOOP_SECONDS) -> Motion:
        """The motion and a transition of ``seconds`` back to its start: the last frame is one before the first pose.

        Position on the ground and heading carry over, by the same amount at each repetition. Errors like
        :meth:`join`. To find a part of the motion that already repeats, use :func:`motet.motion.looped`.
        """
        motion = travelling(motion)
        before, new, _ = self._joined(motion, motion, seconds)
        return replace(before, values=np.concatenate([before.values, new.values]))

    def frames_between(self, past: ArrayLike, after: ArrayLike, frames: int, pace: float = 1.0) -> Array:
        """Placed frames (P, E) and (A, E) to the ``frames`` (frames, E) float64 between them, all in one world.

        pace: frames at the model's rate from one of them to the next, about 1. Only the nearest :attr:`context` frames
        are used. MotionError for too few frames, another number of channels, or more than twice
        :attr:`longest` frames to fill.
        """
        # both sides are long enough, and finite
        known = [np.asarray(part, dtype=np.float64) for part in (past, after)]
        for part, name in zip(known, ("before", "after"), strict=True):
            if part.ndim != 2 or part.shape[1] != self.sizes["E"] or len(part) < self.least:
                need = f"at least {self.least} frames of {self.sizes['E']} channels {name} it"
                raise MotionError(f"a gap needs {need}, not {part.shape}")
            if not np.isfinite(part).all():
                raise MotionError("frames must be finite numbers")
        frames = checked_int("frames", frames, 0, 2 * self.longest, MotionError)
        # seen from the last pose before the gap, as the net was trained
        pose = pose_of(known[0][-1])
        past = seen_from(known[0][-self.context :], pose)
        after = seen_from(known[1][: self.context], pose)
        plain = bridge(past, after, frames, pace)
        if not frames:
            return plain
        # the net corrects the plain transition
        rows = (values[None].astype(np.float32) for values in (past, plain, after))
        filled: Array = put_at(self.loop.run(self.graphs["filler"], *rows)[0], pose)
        return filled

    def replay(self, inputs: Arrays, settings: Mapping[str, Any]) -> Arrays:
        """Placed frames "past" (P, E) and "after" (A, E), and the number of "frames" of the settings, to "filled"."""
        count = int(settings["frames"])
        if not 1 <= count <= self.longest:
            raise BundleError(f"golden vectors fill a gap of 1 to {self.longest} frames, not {count}")
        return {"filled": self.frames_between(inputs["past"], inputs["after"], count)}

    def _joined(self, first: Motion, second: Motion, seconds: float) -> tuple[Motion, Motion, Motion]:
        """The first motion, the transition, and the second placed after it; all in the channels of the first."""
        if not is_number(seconds) or not 0 < seconds <= self.seconds:
            raise MotionError(f"a transition takes more than 0 and at most {self.seconds:g} seconds, not {seconds}")
        if None not in (first.skeleton, second.skeleton) and self._in_its_world(first):
            # in the world of the first: the second turned and placed to follow it
            count = max(1, round(seconds * first.fps))
            other = second if second is first else to_figure_of(second, first)
            _, figure, past, _ = self._sides(first, other)
            turn = float(facing(figure[: len(past)])[-1] - facing(figure[len(past) :])[0])
            after = placed_after(other, first, (count + 1) / first.fps, turn)
            new = None if after is None else self._between(first, after, count)
            if after is not None and new is not None:
                return first, new, after
        # else both on the humanoid, and once more
        first, second = self._elsewhere(first, second)
        return self._joined(first, second, seconds)

    def _in_its_world(self, motion: Motion) -> bool:
        """Whether a motion's figure stands in its own world like in the model's, and can be placed there."""
        part = motion[-round(SEEN * motion.fps) :].continuous().resample(self.fps, to_end=True)
        ends = replace(part, values=part.values[[0, -1]] if len(part) else part.values)
        return from_model_figure(on_humanoid(part), part, ends) is not None

    def _elsewhere(self, *motions: Motion) -> list[Motion]:
        """Motions on the humanoid, at the model's rate, which is logged."""
        log.warning(
            "the result uses the model's skeleton and frame rate: the file has no skeleton, a different world, or no "
            "channels for the position and rotation of the hips"
        )
        return [on_humanoid(motion.continuous().resample(self.fps)) for motion in motions]

    def _between(self, before: Motion, after: Motion, count: int) -> Motion | None:
        """``count`` frames between two parts of a motion, at its own rate, in its channels; None where they cannot be
        retargeted onto its figure."""
        sides, figure, past, behind = self._sides(before, after)
        span = (count + 1) * self.fps / before.fps
        filled = max(0, round(span) - 1)
        new = self.frames_between(past, behind, filled, span / (filled + 1))
        # from the last frame before the gap to the first after it, on splines through the model's frames
        times = len(past[-2:]) - 1 + np.arange(count + 2) / (count + 1) * (filled + 1)
        frames = spline(np.concatenate([past[-2:], new, behind[:2]]), times)
        ends = replace(before, values=np.concatenate([before.values[-1:], after.values[:1]]))
        return from_model_figure(unplaced(frames, replace(figure[:1], fps=before.fps)), sides, ends)

    def _sides(self, before: Motion, after: Motion) -> tuple[Motion, Motion, Array, Array]:
        """What is known about a gap, at the model's rate: both sides on their own figure, the same on the humanoid, and
        placed frames (P, E) before the gap and (A, E) after it. MotionError for too few frames."""
        # a few seconds on both sides, at the model's rate
        seen = round(SEEN * before.fps)
        past = before[-seen:].continuous().resample(self.fps, to_end=True)
        behind = after[:seen].continuous().resample(self.fps)
        for part, side, name in ((past, before, "before"), (behind, after, "after")):
            if len(part) < self.least:
                need = f"at least {self.least / self.fps:.2g} s of motion ({self.least} frames at {self.fps:g} fps)"
                raise MotionError(f"a gap needs {need} {name} it, but there are {side.duration:.2g} s")
        # both in one motion, so that they come to the humanoid alike
        sides = replace(past, values=np.concatenate([past.values, behind.values]))
        figure = on_humanoid(sides)
        frames = placed(figure)
        return sides, figure, frames[: len(past)], frames[len(past) :]


def _seconds_of(gap: Gap) -> tuple[float, float]:
    """The start and the stop of a gap in seconds; MotionError for anything else, and for one that is empty."""
    try:
        start, stop = map(float, gap)
    except (TypeError, ValueError) as error:
        raise MotionError(f"a gap is two numbers in seconds, such as (1.0, 2.0), not {gap!r}") from error
    if not (np.isfinite([start, stop]).all() and start < stop):
        raise MotionError(f"the gap {start:g}:{stop:g} s is empty: it must start before it stops")
    return start, stop
