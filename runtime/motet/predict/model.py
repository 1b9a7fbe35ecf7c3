"""Predict: the next frames of a motion, from its last ones."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, TypedDict, Unpack, overload

import numpy as np
from numpy.typing import ArrayLike

from motet.bundle.graph import Arrays, Floats, Graph, bind
from motet.bundle.manifest import Manifest
from motet.decode.loop import two_rows
from motet.errors import BundleError, DecodingError, MotionError, needs
from motet.figures.feet.treadmill import travelling
from motet.figures.humanoid import Figure
from motet.generate.base import GenerateModel
from motet.generate.continuation import brought_back, futures, together
from motet.models.base import BundleModel
from motet.motion.motion import Motion, motions_of
from motet.motion.rotations import Array
from motet.predict.free_run import LOOPS
from motet.settings import Progress, Seed, checked_int, is_number, seeds_of, silent

MAX_FRAMES = 100_000  # of a prediction, which is held in memory as a whole
MAX_SAMPLES = 100  # futures of one call
SURE = 0.5
"""Seconds taken from the predictor where a code model continues beyond the horizon; later ones regress to the mean."""


class _Options(TypedDict, total=False):
    seconds: float | None
    frames: int | None
    append: bool
    progress: Progress
    beyond: GenerateModel | None
    seed: Seed


class PredictModel(BundleModel):
    """A model that continues motions; sessions and threads can share it.

    After ``horizon`` frames, its default, a prediction continues from its own last frames. A graph "error" may be there
    as well, from frames and the encoder's outputs to the expected error (B, N) in metres of each frame of a horizon.
    """

    VERB = "predict"
    LOOPS = LOOPS

    def __init__(self, manifest: Manifest, graphs: Mapping[str, Graph], tables: Arrays | None = None) -> None:
        super().__init__(manifest, graphs, tables)
        self.horizon = int(self.defaults["horizon"])
        encoder = graphs["encoder"].spec
        step = graphs["step"].spec
        self.bind("encoder", {"frames": "batch L D"}, {})
        bind("step", step, self.loop.inputs, self.loop.outputs, self.sizes, provided=encoder.outputs)
        self.seed_frames = self.sizes["L"]
        if self.knows_errors:
            known = (*encoder.inputs, *encoder.outputs)
            bind("error", graphs["error"].spec, {}, {"error": "batch N"}, self.sizes, provided=known)
            if self.sizes["N"] != self.horizon:
                raise BundleError(f"graph error: outputs {self.sizes['N']} errors for a horizon of {self.horizon}")

    @property
    def sure(self) -> int:
        """Number of frames taken from the predictor where a code model continues beyond the horizon."""
        return min(self.horizon, round(SURE * self.fps))

    @property
    def knows_errors(self) -> bool:
        """Whether the model can give :meth:`expected_errors`."""
        return "error" in self.graphs

    def count(self, seconds: float | None = None, frames: int | None = None) -> int:
        """Number of frames of a prediction; DecodingError for both, or for a length out of range."""
        if seconds is None:
            return checked_int("frames", self.horizon if frames is None else frames, 1, MAX_FRAMES, DecodingError)
        if frames is not None or not is_number(seconds) or not 0 < seconds <= MAX_FRAMES / self.fps:
            limits = f"more than 0 and at most {MAX_FRAMES / self.fps:g}"
            raise DecodingError(f"give seconds, {limits}, or frames; not {seconds} and {frames}")
        return max(1, round(seconds * self.fps))

    @overload
    def predict(self, motions: Motion, **options: Unpack[_Options]) -> Motion: ...
    @overload
    def predict(self, motions: Sequence[Motion], **options: Unpack[_Options]) -> list[Motion]: ...
    def predict(
        self,
        motions: Motion | Sequence[Motion],
        *,
        seconds: float | None = None,
        frames: int | None = None,
        append: bool = False,
        progress: Progress = silent,
        beyond: GenerateModel | None = None,
        seed: Seed = 0,
    ) -> Motion | list[Motion]:
        """The ``seconds`` or ``frames`` (the horizon by default) that follow a motion, at the model's frame rate.

        A motion is continued in its own channels, units and skeleton, from its own place. One of another human figure
        is retargeted onto the model's, and the prediction back, or returned on the model's where that is impossible
        (docs/humanoid.md). The model sees the last :attr:`seed_frames` at its frame rate; of another figure, all frames
        are used to measure its joints and its ground. Resampling a motion keeps its last frame. A clip in place is
        given the path that its feet imply (:func:`motet.motion.with_travel`), of which a TravelWarning tells.
        append: return the resampled motion followed by the prediction.
        progress: called with the number of motions done and in total.
        beyond: a motion-code model such as ``motet.load("generate")``. It continues a prediction longer than the
            horizon, at the motion's pace (docs/predict.md), after SURE seconds by the predictor. Without it the
            predictor continues from its own last frames, and its motion fades out.
        seed: of sampling by ``beyond``; motion i uses seed + i (or seed[i]).
        Several motions are continued in one batch, each as it would be alone. MotionError for a motion that is too
        short, lacks channels of the model, or is not of a human figure; DecodingError for a length out of range, or
        where ``beyond`` is not a motion-code model.
        """
        count = self.count(seconds, frames)
        travelled = [travelling(motion) for motion in motions_of(motions)]
        needs(beyond, GenerateModel | None, "beyond to be a model, such as motet.load('generate')")
        # longer than the horizon: a generate model goes on from what is predicted
        if beyond is not None and count > self.horizon:
            seeds = seeds_of(seed, len(travelled), DecodingError)
            predicted = self._beyond(travelled, count, append, progress, beyond, seeds)
        else:
            predicted = []
            # batches of the loop's size; each comes back to its own figure
            seen = [self._seen(motion) for motion in travelled]
            for start in range(0, len(travelled), self.loop.batch):
                part = seen[start : start + self.loop.batch]
                following = self.next_frames([last for *_, last in part], count)
                for (whole, figure, _), new in zip(part, following, strict=True):
                    predicted.append(self._shown(new, whole, figure, append))
                progress(len(predicted), len(travelled))
        return predicted[0] if isinstance(motions, Motion) else predicted

    def _beyond(
        self,
        motions: Sequence[Motion],
        count: int,
        append: bool,
        progress: Progress,
        writer: GenerateModel,
        seeds: Sequence[int],
    ) -> list[Motion]:
        """More frames than the horizon, all but the first by a code model."""
        predicted = list[Motion]()
        for motion, seed in zip(motions, seeds, strict=True):
            start = self.predict(motion, frames=self.sure, append=True)
            predicted += futures(writer, start, count, [seed], append, predicted=self.sure / self.fps)
            progress(len(predicted), len(motions))
        return predicted

    def futures(  # noqa: PLR0913  settings, all but the first of which have a default
        self,
        motion: Motion,
        *,
        beyond: GenerateModel,
        samples: int = 1,
        seconds: float | None = None,
        frames: int | None = None,
        append: bool = False,
        seed: Seed = 0,
        progress: Progress = silent,
    ) -> list[Motion]:
        """``samples`` different futures of a motion, each of ``seconds`` or ``frames`` (the horizon by default).

        beyond: a motion-code model such as ``motet.load("generate")``. It draws all frames from the first on
        (docs/predict.md): they differ as far as the future is open, whereas :meth:`predict` begins with the average
        future. Sample i is the one drawn alone with seed + i. append, channels and errors: like :meth:`predict`;
        progress: called with the number of samples done and in total. DecodingError unless samples is 1 to MAX_SAMPLES.
        """
        samples = checked_int("samples", samples, 1, MAX_SAMPLES, DecodingError)
        count = self.count(seconds, frames)
        seeds = seeds_of(seed, samples, DecodingError)
        return futures(beyond, self.at_own_rate(travelling(motion)), count, seeds, append, progress)

    def _seen(self, motion: Motion, measured: Figure | None = None) -> tuple[Motion, Motion, Array]:
        """The motion at the model's frame rate, the same on the model's figure, and its last frames (L, C)."""
        whole = self.at_own_rate(motion)
        figure = self.contract.on_figure(whole, measured)
        frames = self.contract.frames(figure[max(0, len(whole) - self.seed_frames - 1) :])
        if len(frames) < self.seed_frames:
            limit = f"the model needs {self.seed_frames} frames at {self.fps:g} fps"
            raise MotionError(f"{limit}, but the motion has {len(frames)} ({len(motion)} at {motion.fps:g} fps)")
        return whole, figure, frames[-self.seed_frames :]

    def _shown(
        self, frames: Floats, whole: Motion, figure: Motion, append: bool, measured: Figure | None = None
    ) -> Motion:
        """The next frames (T, C) in the motion's own channels, after it where they are to be appended."""
        new = self.contract.motion(frames, after=figure, plant=False)
        following, before = brought_back(new, whole, figure, measured)
        return together(before, following) if append else following

    def next_frames(self, seeds: ArrayLike, frames: int | None = None) -> Floats:
        """Seed frames (B, L, C) in the contract's channels, to the next frames (B, frames, C) float32.

        Each row is the same as alone, bit for bit with one thread.
        DecodingError for a number of frames out of range, MotionError for seeds of another shape.
        """
        seed_rows = np.asarray(seeds, dtype=np.float32)
        count = self.count(None, frames)
        shape = (self.seed_frames, len(self.contract.channels))
        if seed_rows.ndim != 3 or seed_rows.shape[1:] != shape:
            takes = f"the model takes (batch, {shape[0]}, {shape[1]})"
            raise MotionError(f"seeds of shape {seed_rows.shape} do not fit: {takes}")
        if not np.isfinite(seed_rows).all():
            raise MotionError("seeds must be finite numbers")
        rows = seed_rows[two_rows(np.arange(len(seed_rows)))]
        continued: Floats = self.loop.run(self.graphs["encoder"], self.graphs["step"], rows, count, self.horizon)
        return continued[: len(seed_rows)]

    def expected_errors(self, motions: Motion | Sequence[Motion]) -> Floats:
        """Expected joint position error of each predicted frame, in centimetres.

        (horizon,) for a motion, (B, horizon) for several: the mean over the joints of the model's figure, in the world,
        for people not in the training data. Errors like :meth:`predict`, and DecodingError for a model that does not
        estimate its errors.
        """
        if not self.knows_errors:
            raise DecodingError(f"{self!r} does not estimate its errors: it has no graph 'error'")
        travelled = [travelling(motion) for motion in motions_of(motions)]
        if not travelled:
            return np.zeros((0, self.horizon), dtype=np.float32)
        seeds = np.zeros((len(travelled), self.seed_frames, len(self.contract.channels)), dtype=np.float32)
        for row, motion in zip(seeds, travelled, strict=True):
            row[:] = self._seen(motion)[2]
        # the encoder's output is what the error is estimated from
        known = {"frames": seeds[two_rows(np.arange(len(travelled)))]}
        known |= self.graphs["encoder"](known)
        error = self.graphs["error"]
        errors = 100 * error({t.name: known[t.name] for t in error.spec.inputs})["error"][: len(travelled)]
        return errors[0] if isinstance(motions, Motion) else errors

    def replay(self, inputs: Arrays, settings: Mapping[str, Any]) -> Arrays:
        """Seed frames (L, C) and the number of "frames" of the settings to the next frames (frames, C)."""
        count = int(settings["frames"])
        if count > 1000:
            raise BundleError(f"golden vectors hold at most 1000 frames, not {count}")
        return {"frames": self.next_frames(inputs["frames"][None], count)[0]}

    def stream(self, start: Motion | None = None) -> "PredictSession":
        """A session to push frames into as they arrive.

        start: the motion so far; its channels, units, frame rate and skeleton are those of the frames to come. By
            default it is empty, with the channels and frame rate of :attr:`contract`.
        """
        if start is None:
            start = self.contract.features(np.empty((0, len(self.contract.channels))))
        return PredictSession(self, start)


class PredictSession:
    """A growing motion: push new frames, predict the next. Keeps only the frames that the model uses.

    A figure other than the model's is measured once, with its ground, at the first prediction: from the motion that the
    session starts with or, where that is too short, from the frames kept.
    """

    def __init__(self, model: PredictModel, start: Motion) -> None:
        self.model = model
        self._kept = math.ceil((model.seed_frames + 1) * start.fps / model.fps) + 1
        self._start = start
        self._motion = start[-self._kept :]

    def push(self, frames: ArrayLike) -> None:
        """The next frame (D,), or several (T, D); MotionError where they do not fit; nothing is changed then."""
        try:
            new = np.atleast_2d(np.asarray(frames, dtype=np.float64))
        except (TypeError, ValueError) as error:
            raise MotionError(f"a frame needs {len(self._motion.channels)} numbers, not {frames!r}") from error
        if new.ndim != 2 or new.shape[1] != len(self._motion.channels):
            raise MotionError(f"a frame of shape {np.shape(frames)} does not fit {len(self._motion.channels)} channels")
        values = np.concatenate([self._motion.values, new])[-self._kept :]
        self._motion = replace(self._motion, values=values)

    def __repr__(self) -> str:
        return f"PredictSession({self._motion!r} kept, {self.model!r})"

    def predict(self, frames: int | None = None, *, seconds: float | None = None) -> Motion:
        """Like :meth:`PredictModel.predict`, after all frames pushed so far."""
        model = self.model
        count = self.model.count(seconds, frames)
        whole, figure, last = model._seen(self._motion, self._figure)
        return model._shown(model.next_frames([last], count)[0], whole, figure, False, self._figure)

    @cached_property
    def _figure(self) -> Figure | None:
        known = self._start if len(self._start) >= len(self._motion) else self._motion
        self._start = known[:0]  # not needed any more
        return self.model.contract.measured(self.model.at_own_rate(known))
